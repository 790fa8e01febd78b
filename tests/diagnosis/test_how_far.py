"""How far a gap shrinks, on a pendulum that rubs and whose gains are not what they should be."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pendulums import MASS, pendulum_run

from mbexport.core.database import FrozenMap, Tolerance, load
from mbexport.core.diagnosis.blocks import DRAWS, Sums
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.how_far import Fold, _Shrunk, how_far
from mbexport.core.effects import EffectRow

DATABASE = load("pendulum")
RUN = pendulum_run("pd", lambda t, q, dq: 0.4 * dq + 0.25 * np.tanh(dq / 2e-3))


def found(effect, **values):
    return Found(effect, 1, EffectRow(1, FrozenMap(values)), 0.0)


VISCOUS, DRY = found("viscous_friction", coefficient=0.4), found("coulomb_friction", torque=0.25)


def test_the_right_effects_take_the_gap_and_each_its_part():
    answer, overlays = how_far(DATABASE, "rigid", [Fold((VISCOUS, DRY), (RUN,))], "mjcf", ("mjcf", "urdf"))
    assert answer.shrinks_by == pytest.approx(1.0, abs=0.05)
    assert answer.ci95 is not None and answer.ci95[0] <= answer.shrinks_by <= answer.ci95[1]
    assert [one.effect for one in answer.by_effect] == ["viscous_friction", "coulomb_friction"]
    assert sum(one.shrinks_by for one in answer.by_effect) == pytest.approx(answer.shrinks_by)
    assert all(one.shrinks_by > 0.2 for one in answer.by_effect)
    assert answer.backends["urdf"] == pytest.approx(answer.backends["mjcf"], abs=1e-3)
    # without the last one there is what the first one took
    assert answer.without["coulomb_friction joint_1"] == pytest.approx(answer.by_effect[0].shrinks_by)
    assert answer.without["viscous_friction joint_1"] < answer.shrinks_by - 0.2
    assert answer.before["q"] > 20.0 * answer.noise["q"]
    # its friction begins to hold otherwise than ours
    assert answer.after["q"] < 5.0 * answer.noise["q"]
    (overlay,) = overlays
    assert overlay.held_out
    assert (
        np.abs(overlay.measured["q"] - overlay.before["q"]).max()
        > np.abs(overlay.measured["q"] - overlay.after["q"]).max()
    )


def test_a_wrong_effect_makes_it_worse_and_says_so():
    answer, _ = how_far(DATABASE, "rigid", [Fold((found("viscous_friction", coefficient=3.0),), (RUN,))], "mjcf")
    assert answer.shrinks_by is not None and answer.shrinks_by < 0.0


def test_no_gap_does_not_shrink():
    quiet = pendulum_run("pd", seed=4)
    answer, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS,), (quiet,))], "mjcf")
    assert answer.shrinks_by is None
    assert answer.ci95 is None
    assert answer.by_effect == ()


def test_an_engine_that_refuses_is_named():
    answer, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS, DRY), (RUN,))], "mjcf", ("mjcf", "adams"))
    assert set(answer.refused) == {"adams"}
    assert answer.refused["adams"]


def test_a_part_of_the_findings_that_cannot_be_simulated_costs_no_answer(monkeypatch):
    """Dry friction alone is refused here; its share is in that of both."""
    from mbexport.core.diagnosis import how_far as module
    from mbexport.core.errors import RefusedError

    real = module.resimulated

    def refusing(robot, *rest):
        if robot.effects == ("coulomb_friction",):
            raise RefusedError("the motion is no longer finite")
        return real(robot, *rest)

    monkeypatch.setattr(module, "resimulated", refusing)
    answer, _ = how_far(DATABASE, "rigid", [Fold((DRY, VISCOUS), (RUN,))], "mjcf")
    assert answer.shrinks_by == pytest.approx(1.0, abs=0.05)
    assert [one.shrinks_by for one in answer.by_effect] == pytest.approx([0.0, answer.shrinks_by])
    assert answer.without["viscous_friction joint_1"] is None
    assert answer.without["coulomb_friction joint_1"] is not None


def test_noise_that_is_louder_than_on_average_is_no_gap():
    """What is told goes by the noise of the very run: coloured noise of seconds is a third louder or quieter."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(3)
    calm = pendulum_run("pd", lambda t, q, dq: 0.1 * dq, noise={"q": 1e-9, "tau": 1e-9})
    sigma, memory = 0.02, 0.97
    white = rng.normal(size=(len(calm.t) + 500, 1)) * sigma * np.sqrt(1.0 - memory**2)
    tau = calm.signals["tau"] + lfilter([1.0], [1.0, -memory], white, axis=0)[500:]
    run = replace(calm, signals=dict(calm.signals) | {"tau": tau}, noise={"tau": np.array([sigma])})
    exact = Fold((found("viscous_friction", coefficient=0.1),), (run,))
    plain, _ = how_far(DATABASE, "rigid", [exact], "mjcf")
    told = plain.as_heard
    # the record is this much louder than it is said to be, and no more of it is a gap
    assert told.after["tau"] == plain.after["tau"]
    assert told.noise["tau"] == pytest.approx(plain.after["tau"], rel=1e-6)
    assert told.signals["tau"] == pytest.approx(1.0, abs=1e-6)
    assert abs(plain.signals["tau"] - 1.0) > 1e-3 or plain.noise["tau"] > plain.after["tau"]
    # a tenth of the friction that is missing is far more than that
    wrong = Fold((found("viscous_friction", coefficient=0.05),), (run,))
    half = how_far(DATABASE, "rigid", [wrong], "mjcf")[0].as_heard
    assert half.signals["tau"] == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("times", "gone"), [(3.3, True), (8.0, False)])
def test_what_a_tolerance_makes_of_one_robot_is_no_gap(times, gone):
    """Few numbers are off, each once: together they make twice what is counted for them in one robot of thirty."""
    off = 3.0e-3
    database = replace(DATABASE, tolerance=Tolerance(com=off))
    moment = times * off * MASS * 9.81
    run = pendulum_run("pd", lambda t, q, dq: 0.3 * dq + moment * math.sin(q))
    answer, _ = how_far(database, "rigid", [Fold((found("viscous_friction", coefficient=0.3),), (run,))], "mjcf")
    assert (answer.as_heard.shrinks_by > 0.999) == gone
    assert answer.as_heard.shrinks_by > answer.shrinks_by or not gone


@pytest.mark.parametrize(("by", "told"), [(0.98, (0.9, 0.98)), (0.92, (0.9, 0.95))])
def test_how_far_a_gap_shrinks_lies_within_its_interval(by, told):
    """Blocks drawn anew leave of noise what the whole takes for it."""
    before = SimpleNamespace(gap=lambda: np.ones(1001))
    after = SimpleNamespace(gap=lambda: np.linspace(0.1013, 0.0487, 1001))
    low, high = _Shrunk.interval(SimpleNamespace(by=lambda: by, _drawn=(before, after)))
    assert (low, high) == pytest.approx(told, abs=2e-3)


def test_an_interval_knows_that_noise_may_hide_what_is_left():
    """Of noise as loud as what is left, whose power scatters like an exponential variable, a part may be a gap."""

    def sums(square, shape=(1,)):
        return Sums(*({"tau": np.full(shape, value)} for value in (square, 100.0, 100.0)))

    draws = [sums(square, (DRAWS, 1)) for square in (4900.0, 100.0)]
    heard = SimpleNamespace(by=lambda: 1.0, known=sums(4900.0), _drawn=draws, _freedom=lambda name: np.array([2.0]))
    heard._gaps_unsure = lambda: _Shrunk._gaps_unsure(heard)
    assert _Shrunk.interval(heard) == (1.0, 1.0)
    low, high = _Shrunk.interval(heard, heard=True)
    quiet = -np.log(1.0 - 0.025)
    assert low == pytest.approx(1.0 - np.sqrt((1.0 - quiet) / (49.0 - quiet)), abs=2e-3)
    assert high == 1.0


def test_what_numbers_may_be_off_by_is_told_as_gap():
    """As much as the interval of a number makes is left, in expectation, of a gap that it closes."""
    run = pendulum_run("pd", lambda t, q, dq: 0.4 * dq)
    known, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS,), (run,))], "mjcf")
    assert known.as_heard.signals["tau"] == pytest.approx(1.0, abs=1e-6)
    # a tenth of a noise's power, and in the other channel none
    unsure = {"q": np.array([0.0]), "tau": np.array([0.1 * known.after["tau"] ** 2])}
    doubted, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS,), (run,), unsure)], "mjcf")
    assert doubted.shrinks_by == known.shrinks_by
    assert doubted.as_heard.signals["q"] == pytest.approx(known.as_heard.signals["q"])
    gap = np.sqrt(known.before["tau"] ** 2 - 0.9 * known.after["tau"] ** 2)
    expected = 1.0 - np.sqrt(0.1) * known.after["tau"] / gap
    assert doubted.as_heard.signals["tau"] == pytest.approx(expected, abs=1e-6)


def test_what_is_far_above_noise_is_a_gap_however_little_is_known_of_the_noise(monkeypatch):
    """A servo whose torque's noise is hardly known has not all of its gap closed."""
    from mbexport.core.diagnosis.noise import Noise

    monkeypatch.setattr(Noise, "chance", lambda self, name, square: np.ones_like(square))
    half = Fold((found("viscous_friction", coefficient=0.2),), (pendulum_run("pd", lambda t, q, dq: 0.4 * dq),))
    answer, _ = how_far(DATABASE, "rigid", [half], "mjcf")
    assert answer.as_heard.signals["tau"] == pytest.approx(0.5, abs=0.1)
    assert answer.as_heard.noise["tau"] == pytest.approx(answer.floor["tau"])


def test_a_channel_without_noise_weighs_no_more_than_its_known_noise():
    """What a simulation wrote and nobody disturbed is left at next to nothing: no sensor is as good."""
    clean = pendulum_run("pd", lambda t, q, dq: 0.4 * dq, noise={"q": 0.0, "tau": 0.01})
    run = replace(clean, noise={"q": np.array([2e-5]), "tau": np.array([0.01])})
    answer, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS,), (run,))], "mjcf")
    assert answer.after["q"] < 0.1 * answer.floor["q"]
    assert answer.as_heard.noise["q"] == pytest.approx(answer.floor["q"])
    assert answer.as_heard.signals["q"] == pytest.approx(1.0)
