"""Runs whose commands jump, moved by another engine than the one that diagnoses."""

import numpy as np

from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis.model import level_rows, merged
from mbexport.core.effects import EffectRow
from mbexport.core.motion import from_table
from mbexport.core.recording import Run
from mbexport.core.simulation import simulate

PLANAR = load("planar2r")
CONTROL = Control("pd", (900.0, 250.0), (40.0, 12.0), "gravity", 1000.0)
T = np.arange(501) / 250.0
RUBS = {"coulomb_friction": (EffectRow(1, {"torque": 1.6}),)}


def triangle(seed):
    """Constant speeds that turn at once."""
    periods = np.array([0.9, 1.3]) + 0.1 * seed
    part = (T[:, None] / periods + 0.25) % 1.0
    return 0.5 * (np.abs(4.0 * part - 2.0) - 1.0)


def steps(seed):
    """Positions to go to at once."""
    places = np.random.default_rng(seed).uniform(-0.35, 0.35, (8, 2))
    places[0] = 0.0
    number = (T[:, None] / (np.array([0.5, 0.7]) + 0.03 * seed)).astype(int)
    return np.take_along_axis(places, number, axis=0)


def swings(seed):
    """A SCARA's constant speeds that turn at once."""
    part = (T[:, None] / np.array([0.9, 1.1, 1.3, 1.2]) + 0.25) % 1.0
    return np.array([0.7, 0.7, 0.06, 0.7]) * (np.abs(4.0 * part - 2.0) - 1.0)


def smooth(seed):
    """From rest to rest, and no jump on the way."""
    s = np.clip(np.minimum(T, 2.0 - T), 0.0, 1.0)
    return np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), [0.6, -0.5])


def recorded(motion, rows=None, seed=1, control=CONTROL, database=PLANAR, level="rigid"):
    """A run that Pinocchio made of a robot, with what its database does not know."""
    law, known = from_table(T, motion(seed)), level_rows(database, level)
    plant, nominal = assembled(database, merged(known, rows or {})), assembled(database, known)
    trace = simulate(plant, "urdf", law, control=control, nominal=nominal, rate=250.0)
    noise = {"q": np.full(database.n, 2e-5), "dq": np.full(database.n, 2e-3), "tau": np.full(database.n, 0.05)}
    random = np.random.default_rng(seed)
    q_cmd, dq_cmd, _ = law.at(trace.t)
    signals = {name: trace.joints[name] + noise[name] * random.normal(size=q_cmd.shape) for name in noise}
    signals |= {"q_cmd": q_cmd, "dq_cmd": dq_cmd}
    return Run(f"run {seed}", trace.t, signals, control, noise, (), {}, "", (), 250.0)


def loudest(evidence, robots, signals=("tau", "u")):
    left = evidence.residual(robots)
    return max(float(np.mean(left[c.first : c.last] ** 2)) for c in evidence.channels if c.signal in signals)
