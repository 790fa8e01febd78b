"""Arms that bend: where, by how much and how damped, of a motion that Exudyn made and nothing of the diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis import prepare
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.polish import polished
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.effects import EffectRow

from .pendulums import pendulum_run

DATABASE = load("planar2r")
NOISE = {"q": 1.0e-5, "tau": 0.02, "ee": 2.0e-5}
STIFFNESS, DAMPING, AT = 600.0, 0.1, 0.3


def bending_run(seed):
    """What the sensors say of an arm whose second link bends, while its motors go as they are told."""
    t = np.arange(1001) / 250.0
    ways = [0.5 * np.sin(pace * (1.0 + 0.1 * seed) * t) ** 2 for pace in (1.3, 1.6)]
    q = np.stack(ways, axis=1) + 0.1 * (1.0 - np.cos(5.0 * t))[:, None]
    command = {"q_cmd": q, "dq_cmd": np.gradient(q, t, axis=0)}
    empty = {"q": q, "tau": np.zeros_like(q), "ee": np.zeros((len(t), 3))}
    run = replace(
        pendulum_run("motion", duration=0.1), t=t, signals=empty | command, control=Control("motion"), noise={}
    )
    values = {"ku": STIFFNESS, "kv": STIFFNESS, "bu": DAMPING, "bv": DAMPING, "at": AT}
    bent = robot_of(DATABASE, "rigid", run, {"link_flexibility": (EffectRow(2, values),)})
    random = np.random.default_rng(seed)
    said = {
        name: np.asarray(exact) + NOISE[name] * random.normal(size=exact.shape)
        for name, exact in sorted(resimulated(bent, robot_of(DATABASE, "rigid", run), run, "exudyn").items())
    }
    noise = {name: np.full(values.shape[1], NOISE[name]) for name, values in said.items()}
    return replace(run, name=f"bends-{seed}", signals=run.signals | said, noise=noise)


def fit_of(runs):
    asked = problem(DATABASE, "rigid", runs)
    far = {"ku": 500.0, "kv": 500.0, "bu": 4.0, "bv": 4.0, "at": 0.5}
    bend = Found("link_flexibility", 2, EffectRow(2, far), 0.0)
    return asked, refined(asked, whitening(asked), [bend], blocks(asked.evidence))


@pytest.fixture(scope="module")
def runs():
    return [bending_run(seed) for seed in (1, 2)]


@pytest.mark.parametrize("exactly", [True, False])
def test_where_an_arm_bends_is_fitted_with_how_much(runs, exactly, monkeypatch):
    if not exactly:
        monkeypatch.setattr(prepare, "follows", lambda run: False)
    values = fit_of(runs)[1].rows["link_flexibility", 2].values
    assert values["at"] == pytest.approx(AT, abs=0.02)
    assert values["kv"] == pytest.approx(STIFFNESS, rel=0.05)
    if exactly:
        # it rings above what positions tell, and an exact motion shows for how long
        assert values["bv"] == pytest.approx(DAMPING, rel=0.1)


def test_what_rings_faster_than_a_smoothed_motion_shows_is_damped_as_its_simulation_says(runs, monkeypatch):
    monkeypatch.setattr(prepare, "follows", lambda run: False)
    # one run says it: what is too stiff takes millions of steps of each
    asked, fit = fit_of(runs[:1])
    assert fit.rows["link_flexibility", 2].values["bv"] > 10.0 * DAMPING
    better = polished(asked, "rigid", runs[:1], fit, "mjcf")
    assert better.rows["link_flexibility", 2].values["bv"] == pytest.approx(DAMPING, rel=0.5)
