"""Numbers from simulation: what tolerances may do is taken out of them, a delay is found in another tick."""

import math
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core import parallel
from mbexport.core.database import load
from mbexport.core.diagnosis import polish, resimulate
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.polish import KnownSlopes, _Loose, _scatter, closing, polished
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import in_one_turn, refined
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import RefusedError
from mbexport.core.simulation import backend_named

from .pendulums import FINE, pendulum_run, soft_run

RANDOM = np.random.default_rng(4)
# two runs of some rows and channels, three tolerances
COLUMNS = [RANDOM.normal(size=(m, 2, 3)) for m in (7, 5)]


def flat(values):
    """Rows and channels of all runs, one after the other."""
    return np.concatenate([one.reshape(-1, *one.shape[2:]) for one in values])


def test_what_lies_along_tolerances_is_taken_out_as_their_prior_allows():
    loose = _Loose.of(COLUMNS)
    whole = flat(COLUMNS)
    dense = np.linalg.inv(np.eye(len(whole)) + whole @ whole.T)
    left = [RANDOM.normal(size=one.shape[:2]) for one in COLUMNS]
    slopes = [RANDOM.normal(size=(*one.shape[:2], 4)) for one in COLUMNS]
    np.testing.assert_allclose(flat(loose.without(left)), dense @ flat(left), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(flat(loose.without(slopes)), dense @ flat(slopes), rtol=1e-10, atol=1e-12)
    assert loose.energy(left) == pytest.approx(flat(left) @ dense @ flat(left))


def test_without_tolerances_nothing_is_taken_out():
    loose = _Loose.of([one[..., :0] for one in COLUMNS])
    left = [RANDOM.normal(size=one.shape[:2]) for one in COLUMNS]
    np.testing.assert_array_equal(flat(loose.without(left)), flat(left))
    assert loose.energy(left) == pytest.approx(float(flat(left) @ flat(left)))


@pytest.mark.parametrize("ticks", [0.9, 2.6])
def test_a_delay_is_found_from_another_tick(ticks):
    """What a record at ticks shows jumps between them, and no slope points there."""
    runs = [pendulum_run(seed=seed, delay=4) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    late = Found("delay", 0, EffectRow(0, {"time": 1e-3 * ticks}), 50.0)
    fit = refined(asked, whitening(asked), [late], blocks(asked.evidence))
    fit = replace(fit, rows={late.key: late.row})
    better = polished(asked, "rigid", runs, fit, "mjcf")
    assert better.rows[late.key].values["time"] == pytest.approx(4.0e-3 / FINE, rel=0.02)


def test_a_number_that_no_run_shows_stays_where_it_is():
    """Along a pendulum's axis its load may be anywhere, and a fit leaves it at next to nothing, without an interval."""
    runs = [pendulum_run(seed=1, against=lambda t, q, dq: 0.2 * math.sin(q))]
    asked = problem(load("pendulum"), "rigid", runs)
    nowhere = {"x": -2.2e-87, "y": 1.0e-88, "z": -1.4e-273}
    values = {column.name: column.default or 0.0 for column in effect_named("payload").columns}
    load_at_hand = Found("payload", 0, EffectRow(0, values | {"mass": 0.03} | nowhere), 50.0)
    fit = refined(asked, whitening(asked), [load_at_hand], blocks(asked.evidence))
    sure = np.diag([1.0e-4 if name == "mass" else 0.0 for _, _, name in fit.free])
    assert len(sure) == 4
    better = polished(
        asked, "rigid", runs, replace(fit, rows={load_at_hand.key: load_at_hand.row}, covariance=sure), "mjcf"
    )
    assert better is not None
    assert better.rows[load_at_hand.key].values["x"] == pytest.approx(0.0, abs=1e-9)


def test_what_takes_an_engine_minutes_is_not_simulated(monkeypatch):
    """A spring that hardly gives, on a light motor, takes steps of microseconds."""
    runs = [pendulum_run(seed=1)]
    asked = problem(load("pendulum"), "rigid", runs)
    hard = EffectRow(1, {"stiffness": 1e9, "damping": 1.0})
    spring = Found("joint_compliance", 1, hard, 50.0)
    fit = replace(refined(asked, whitening(asked), [spring], blocks(asked.evidence)), rows={spring.key: hard})
    for name in ("resimulated", "resimulated_once"):
        monkeypatch.setattr(polish, name, lambda *_: pytest.fail("simulated"))
    assert polished(asked, "rigid", runs, fit, "mjcf") is None


def test_a_phase_is_told_within_one_turn():
    asked = problem(load("pendulum"), "rigid", [pendulum_run(duration=1.0)])
    wave = Found("torque_ripple", 1, EffectRow(1, {"amplitude": 0.3, "cycles": 20.0, "phase": 7.0}), 50.0)
    fit = replace(refined(asked, whitening(asked), [wave], blocks(asked.evidence)), rows={wave.key: wave.row})
    assert in_one_turn(fit).rows[wave.key].values["phase"] == pytest.approx(7.0 - 2.0 * np.pi)


def test_a_base_is_not_told_to_be_tilted_by_turns():
    """A fit that begins far away may end there."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run(duration=1.0)])
    tilt = Found("base_tilt", 0, EffectRow(0, {"roll": 0.03 - 12.0 * np.pi, "pitch": 0.04 + 26.0 * np.pi}), 50.0)
    fit = replace(refined(asked, whitening(asked), [tilt], blocks(asked.evidence)), rows={tilt.key: tilt.row})
    told = in_one_turn(fit).rows[tilt.key].values
    assert (told["roll"], told["pitch"]) == pytest.approx((0.03, 0.04))


def test_along_a_given_motion_many_numbers_are_simulated(monkeypatch):
    """A simulation takes little there."""
    monkeypatch.setattr(polish, "MOST_FROM_AFAR", 0)
    for mode, there in (("motion", True), ("pd", False)):
        runs = [pendulum_run(mode, lambda t, q, dq: 0.2 * dq, seed=1)]
        asked = problem(load("pendulum"), "rigid", runs)
        rubs = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.2}), 50.0)
        fit = refined(asked, whitening(asked), [rubs], blocks(asked.evidence))
        off = replace(fit, rows={rubs.key: EffectRow(1, {"coefficient": 0.1})})
        assert (polished(asked, "rigid", runs, off, "mjcf", far=True) is not None) is there


def test_a_robot_that_no_run_of_would_end_is_refused():
    """Stiff and light beyond all that is built: an engine was asked for ten thousand million steps."""
    run = pendulum_run(seed=1)
    hard = {"joint_compliance": (EffectRow(1, {"stiffness": 1e20, "damping": 1.0}),)}
    robot, plain = (robot_of(load("pendulum"), "rigid", run, rows) for rows in (hard, {}))
    with pytest.raises(RefusedError, match="largest eigenvalue"):
        resimulated(robot, plain, run, "mjcf")


def test_numbers_of_a_robot_that_no_run_of_would_end_stay_as_they_are():
    """It ended a diagnosis."""
    runs = [pendulum_run(seed=1, duration=1.0)]
    asked = problem(load("pendulum"), "rigid", runs)
    hard = Found("joint_compliance", 1, EffectRow(1, {"stiffness": 1e20, "damping": 1.0}), 50.0)
    fit = refined(asked, whitening(asked), [hard], blocks(asked.evidence))
    stiff = replace(fit, rows={hard.key: hard.row})
    assert polished(asked, "rigid", runs, stiff, "mjcf") is None


def test_what_would_close_the_gap_is_seen_in_simulation():
    """Beside a found friction a delay takes nearly all that is left, and an inertia that is not there nothing."""

    def rubbing(t, q, dq):
        return 0.03 * math.tanh(1000.0 * dq)

    runs = [pendulum_run(seed=seed, against=rubbing, delay=6, duration=3.0) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    rubs = Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.03}), 50.0)
    fit = refined(asked, whitening(asked), [rubs], blocks(asked.evidence))
    late, heavy = {"delay": (EffectRow(0, {"time": 0.0015}),)}, {"rotor_inertia": (EffectRow(1, {"inertia": 1e-4}),)}
    now, (with_delay, with_inertia) = closing(asked, "rigid", runs, fit, [late, heavy], "mjcf")
    assert now > 1.0e4
    assert with_delay < 0.5 * now
    assert with_inertia > 0.7 * now


def test_without_findings_an_option_is_tried_alone():
    runs = [pendulum_run(seed=1, delay=6, duration=3.0)]
    asked = problem(load("pendulum"), "rigid", runs)
    fit = refined(asked, whitening(asked), [], blocks(asked.evidence))
    now, (with_delay,) = closing(asked, "rigid", runs, fit, [{"delay": (EffectRow(0, {"time": 0.0015}),)}], "mjcf")
    assert with_delay < 0.5 * now


def test_an_option_that_no_robot_can_have_closes_nothing():
    """An inertia that is less than none ended a diagnosis."""
    runs = [pendulum_run(seed=1, duration=1.0)]
    asked = problem(load("pendulum"), "full", runs)
    fit = refined(asked, whitening(asked), [], blocks(asked.evidence))
    light = {"rotor_inertia": (EffectRow(1, {"inertia": -5.0}),)}
    _, energies = closing(asked, "full", runs, fit, [light], "mjcf")
    assert energies == [math.inf]


def test_what_would_close_the_gap_of_a_robot_whose_runs_take_minutes_is_not_asked():
    """An arm that bends behind a damper many times too hard for it: each of two dozen runs would have taken 30 s."""
    runs = [pendulum_run(seed=1, duration=1.0)]
    asked = problem(load("pendulum"), "rigid", runs)
    hard = Found("joint_compliance", 1, EffectRow(1, {"stiffness": 1e10, "damping": 1.0}), 50.0)
    fit = replace(refined(asked, whitening(asked), [], blocks(asked.evidence)), rows={hard.key: hard.row})
    with pytest.raises(RefusedError, match="to try, each"):
        closing(asked, "rigid", runs, fit, [{"delay": (EffectRow(0, {"time": 0.0015}),)}] * 20, "mjcf")


def test_how_wide_a_play_is_is_told_by_simulation_too():
    """An interval knows of two ways to it which are apart."""
    hard = {"stiffness": 400.0, "damping": 2.0}
    runs = [soft_run(400.0, 2.0, gap=0.02, seed=seed) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    play = Found("backlash", 1, EffectRow(1, {"gap": 0.018, **hard}), 50.0)
    fit = refined(asked, whitening(asked), [play], blocks(asked.evidence))
    sure = replace(fit, rows={play.key: play.row}, covariance=np.diag([1e-10] * len(fit.free)))
    better = polished(asked, "rigid", runs, sure, "mjcf")
    told = better.rows[play.key].values["gap"]
    assert told == pytest.approx(0.02, rel=0.005)
    gap = next(k for k, (_, _, name) in enumerate(better.free) if name == "gap")
    assert math.sqrt(better.covariance[gap, gap]) >= told - 0.018


@pytest.mark.parametrize(("seconds", "t"), [(1.0, 12.706), (4.0, 2.3646)])
def test_few_blocks_of_time_know_little_of_how_they_scatter(seconds, t):
    """Two say next to nothing; the quantiles of Student's t are the tables'."""
    left, slope = RANDOM.normal(size=(400, 1)), np.ones((400, 1, 1))
    pulls = np.array([np.sum(part) for part in np.array_split(left, round(2.0 * seconds))])
    there = np.sum(pulls**2) * len(pulls) / (len(pulls) - 1) / 400.0**2
    run = SimpleNamespace(duration=seconds, since=0.0, judged=np.ones(400, dtype=bool))
    said = _scatter(_Loose.of([np.zeros((400, 1, 0))]), [left], [slope], [run], np.zeros(1))
    assert math.sqrt(said[0] / there) == pytest.approx(t / 1.95996, rel=1e-4)


def test_slopes_of_nearly_the_same_numbers_are_taken_once(monkeypatch):
    """Runs that other fits saw too are simulated for a fit's value alone, and its numbers come out the same."""
    runs = [pendulum_run(against=lambda t, q, dq: 0.2 * dq, seed=seed) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    rubs = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.2}), 50.0)
    fit = refined(asked, whitening(asked), [rubs], blocks(asked.evidence))
    asks: list[object] = []
    simulate = polish.resimulated_once

    def counted(*words):
        asks.append(words)
        return simulate(*words)

    for name in ("resimulated", "resimulated_once"):
        monkeypatch.setattr(polish, name, counted)
    alone = polished(asked, "rigid", runs, fit, "mjcf")
    first = len(asks)
    known = KnownSlopes()
    assert polished(asked, "rigid", runs, fit, "mjcf", known=known).rows == alone.rows
    asks.clear()
    near = replace(fit, rows={rubs.key: EffectRow(1, {"coefficient": fit.rows[rubs.key].values["coefficient"] + 1e-6})})
    again = polished(asked, "rigid", runs, near, "mjcf", known=known)
    assert len(asks) == first - len(runs)
    assert again.rows[rubs.key].values["coefficient"] == pytest.approx(
        alone.rows[rubs.key].values["coefficient"], rel=1e-4
    )
    asks.clear()
    far = replace(fit, rows={rubs.key: EffectRow(1, {"coefficient": 0.1})})
    polished(asked, "rigid", runs, far, "mjcf", known=known)
    assert len(asks) >= first
    asks.clear()
    # within one standard deviation nothing tells one number from another
    unsure = replace(far, covariance=np.array([[0.1**2]]))
    polished(asked, "rigid", runs, unsure, "mjcf", known=KnownSlopes())
    first = len(asks)
    asks.clear()
    off = replace(unsure, rows={rubs.key: EffectRow(1, {"coefficient": 0.17})})
    polished(asked, "rigid", runs, unsure, "mjcf", known=known)
    asks.clear()
    polished(asked, "rigid", runs, off, "mjcf", known=known)
    assert len(asks) == first - len(runs)


def test_simulated_side_by_side_numbers_are_what_they_are_one_after_the_other(monkeypatch):
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.4 * dq, duration=1.5) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    names = ("viscous_friction", {"coefficient": 0.3}), ("rotor_inertia", {"inertia": 0.01})
    found = [Found(effect, 1, EffectRow(1, values), 50.0) for effect, values in names]
    fit = refined(asked, whitening(asked), found, blocks(asked.evidence))
    went: set[str] = set()
    simulated = resimulate.resimulated_once

    def noted(*given, **options):
        went.add(threading.current_thread().name)
        return simulated(*given, **options)

    monkeypatch.setattr(polish, "resimulated_once", noted)
    monkeypatch.setattr(parallel, "cores", lambda: 2)
    answers = []
    for threads in (True, False):
        went.clear()
        resimulated.cache_clear()
        monkeypatch.setattr(type(backend_named("mjcf")), "threads", threads)
        answers.append(polished(asked, "rigid", runs, fit, "mjcf"))
        assert any("side by side" in name for name in went) is threads
    assert answers[0].rows == answers[1].rows
    np.testing.assert_array_equal(answers[0].covariance, answers[1].covariance)
