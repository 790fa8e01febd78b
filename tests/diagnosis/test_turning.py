"""Dry friction that turns in another way than engines have it: the cause is found, and what that leaves is told."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis.compared import compared
from mbexport.core.diagnosis.diagnosis import Overlay
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_form import other_form
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.diagnosis.turning import turning
from mbexport.core.diagnosis.unseen import Split
from mbexport.core.diagnosis.words import TURNS_SAID
from mbexport.core.effects import EffectRow

from .pendulums import INERTIA, NOISE, WEIGHT, command, pendulum_run

KP, KD = 400.0, 8.0
LEVEL = 1.0
SMALL = 1.0e-3 / 16.0


def bristles(seed, duration=3.0, bend=2.0e-4, damping=4.0, also=lambda t: 0.0):
    """A run of the pendulum under its controller with LuGre's friction (Canudas de Wit et al., 1995).

    Args:
        seed: Of the noise.
        duration: [s].
        bend: Of its bristles where they slide [rad].
        damping: Of these, as a part of the critical one.
        also: Torque at a time that is there, too.
    """
    stiffness = LEVEL / bend
    viscous = 2.0 * damping * math.sqrt(stiffness * INERTIA)
    ticks = np.arange(round(1000 * duration) + 1) / 1000.0
    pace = 1.0 + 0.1 * seed
    asked, rate, _ = command(pace * ticks)
    rate = pace * rate
    q = dq = z = 0.0
    states, given = [], []
    for k in range(len(ticks)):
        torque = KP * (asked[k] - q) + KD * (rate[k] - dq)
        states.append((q, dq))
        given.append(torque)
        more = also(ticks[k])
        for _ in range(16):
            dz = dq - stiffness * abs(dq) / LEVEL * z
            z += SMALL * dz
            dq += SMALL * (torque + more - stiffness * z - viscous * dz - WEIGHT * math.sin(q)) / INERTIA
            q += SMALL * dq
    random = np.random.default_rng(seed)
    q, tau = np.array(states)[:, :1], np.array(given)[:, None]
    signals = {
        "q": q + NOISE["q"] * random.normal(size=q.shape),
        "tau": tau + NOISE["tau"] * random.normal(size=q.shape),
        "q_cmd": asked[:, None],
        "dq_cmd": rate[:, None],
    }
    run = pendulum_run(rate=1000.0, duration=duration)
    return replace(run, name=f"bristles-{seed}", signals=signals, control=Control("pd", (KP,), (KD,)))


RUBS = Found("coulomb_friction", 1, EffectRow(1, FrozenMap({"torque": LEVEL})), 500.0)


def judged(run):
    """What Coulomb's friction of the right size leaves of a run in MuJoCo, along it, and of that near turns."""
    runs = [bristles(1), run]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = SimpleNamespace(
        whole=asked,
        whiten=whitening(asked),
        ways=[Split((0,), (1,))],
        runs=runs,
        by_bands=False,
        bounces=lambda *_: None,
    )
    known, rubbing = (robot_of(load("pendulum"), "rigid", run, rows) for rows in ({}, {RUBS.effect: (RUBS.row,)}))
    overlay = Overlay(
        run.name,
        run.t,
        compared(run, rubbing),
        {},
        resimulated(rubbing, known, run, "mjcf"),
        noise_floor(load("pendulum"), "rigid", run).sigma,
        True,
    )
    unseen = SimpleNamespace(beyond=1.0, rows=[[RUBS.row]], numbers_beyond=(0.0,))
    held = SimpleNamespace(
        found=(RUBS,), open=0.1, adequate=False, explains=False, overlays=(overlay,), unseen=unseen, by=0.6
    )
    return judge, held


def test_what_dry_friction_leaves_at_its_turns_is_another_form_of_it():
    judge, held = judged(bristles(3))
    left = (held.overlays[0].measured["tau"] - held.overlays[0].after["tau"]) / NOISE["tau"]
    assert np.sqrt(np.mean(left**2)) > 3.0
    assert turning(judge.runs[1:], held.overlays, held.found).leaves < 0.3
    form = other_form(judge, held)
    assert (form.place, form.said) == (0, TURNS_SAID)
    # neither where that is most of the gap, nor of what does not turn
    held.open = 0.3
    assert other_form(judge, held) is None
    damps = Found("viscous_friction", 1, EffectRow(1, FrozenMap({"coefficient": 0.1})), 500.0)
    assert turning(judge.runs[1:], held.overlays, (damps,)) is None


def test_what_is_left_between_turns_too_is_another_cause():
    judge, held = judged(bristles(3, also=lambda t: 0.5 * math.sin(31.0 * t)))
    assert turning(judge.runs[1:], held.overlays, held.found).leaves > 0.4
    assert other_form(judge, held) is None


def test_a_controller_that_nobody_knows_tells_nothing_of_turns():
    judge, held = judged(bristles(3))
    silent = [replace(run, control=Control("unknown")) for run in judge.runs[1:]]
    assert turning(silent, held.overlays, held.found) is None
    # nor does one so soft that the blow of a turn is still felt at the next
    soft = [replace(run, control=Control("pd", (KP,), (50.0 * KD,))) for run in judge.runs[1:]]
    assert turning(soft, held.overlays, held.found) is None
