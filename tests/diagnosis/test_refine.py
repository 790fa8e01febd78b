"""Numbers of findings fitted together: how well they are known, and where they can be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis import refine
from mbexport.core.diagnosis.findings import finding
from mbexport.core.diagnosis.fit import blocks, spread
from mbexport.core.diagnosis.found import Found, rows_of
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import FAR, FARTHEST, problem
from mbexport.core.diagnosis.refine import Refined, covariance_of, left_with, refined, removal, stiffened, vanished
from mbexport.core.diagnosis.unseen import splits
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.recording import Run
from mbexport.core.representation import Inertia

from .pendulums import late_by, pendulum_run, without_torque
from .searching import COLUMNS, NO_SPRING, found, question


def test_taking_a_finding_out_by_its_covariance_is_as_good_as_fitting_without_it():
    asked = question(lambda t, q, dq: 0.4 * dq + 0.5 * math.tanh(dq / 2e-3))
    state, whiten = found(asked)
    assert {item.effect for item in state.found} == {"viscous_friction", "coulomb_friction"}
    parts = blocks(asked.evidence)
    fit = refined(asked, whiten, state.found, parts)
    dry = next(item for item in state.found if item.effect == "coulomb_friction")
    rest = [item for item in state.found if item is not dry]
    quick = removal(fit, dry.key, dry.absent).rows["viscous_friction", 1].values["coefficient"]
    # by covariance the weights stay those of the whole fit, so that it is near, not the same
    sigma = spread(fit.left, parts)
    slope = fit.slope / sigma[:, None]
    at = [k for k, key in enumerate(fit.free) if key[0] == "viscous_friction"]
    base = asked.residual(rows_of([replace(item, row=item.absent) for item in rest]))
    left = whiten(base) / sigma
    exact = -float(slope[:, at[0]] @ left) / float(slope[:, at[0]] @ slope[:, at[0]])
    assert quick == pytest.approx(exact, rel=1e-3)


def test_a_spring_that_rests_far_away_goes_with_all_of_its_torque():
    asked = question(lambda t, q, dq: 0.05 * (q - 8.0))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.05, "rest": 8.0}), 50.0, NO_SPRING)
    fit = refined(asked, whiten, [spring], parts)
    nothing = whiten(asked.residual({}))
    loss = 0.5 * float(np.sum((nothing / spread(fit.left, parts)) ** 2) - len(nothing))
    assert removal(fit, spring.key, NO_SPRING).loss == pytest.approx(loss, rel=0.1)
    # stiffness and rest alone are hardly known
    assert not vanished(fit, spring)


def test_what_no_run_shows_is_known_within_a_few_times_its_size():
    """By a pseudo-inverse it would be known exactly, and could not be taken out for all the world."""
    asked = question(lambda t, q, dq: 0.4 * dq)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    rubs = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
    wave = {"amplitude": 1e-12, "cycles": 9.0, "phase": 0.0}
    nothing = Found("torque_ripple", 1, EffectRow(1, wave), 1.0, EffectRow(1, {**wave, "amplitude": 0.0}))
    fit = refined(asked, whiten, [rubs, nothing], parts)
    sigma = {(one[0], one[2]): math.sqrt(fit.covariance[k, k]) for k, one in enumerate(fit.free)}
    assert sigma["torque_ripple", "cycles"] > 9.0
    assert sigma["viscous_friction", "coefficient"] < 0.01
    assert removal(fit, nothing.key, nothing.absent).loss < 10.0


def test_a_controller_that_does_nothing_explains_nothing():
    asked = question(lambda t, q, dq: 0.8 * math.sin(40.0 * q))
    whiten = whitening(asked)

    def asks(part):
        left = left_with(asked, whiten, {"controller_gain": (EffectRow(1, {"kp": part, "kd": part}),)})
        return sum(float(np.sum(left[c.first : c.last] ** 2)) for c in asked.evidence.channels if c.signal == "u")

    assert asks(0.05) > 2.0 * asks(1.0)
    # a gain that another takes the place of may be moved to nothing
    assert math.isfinite(asks(0.0))
    assert asks(0.0) > 0.9 * asks(0.05)


def test_what_swings_itself_to_pieces_is_a_number_still(monkeypatch):
    """Squares of what such a spring leaves were infinite, and ended a diagnosis."""
    asked = question()
    monkeypatch.setattr(type(asked), "residual", lambda *_: np.array([1e200, -1e200, np.nan, 3.0]))
    left = asked.misfit({})
    assert np.isfinite(left @ left)
    assert left.tolist() == [FARTHEST, -FARTHEST, FAR, 3.0]


def test_a_bearing_is_rigid_where_nothing_tells_how_little_it_gives(monkeypatch):
    asked = question()
    parts = blocks(asked.evidence)
    noise = np.random.default_rng(1).normal(size=len(asked.evidence.weights))

    def left(problem, whiten, rows):
        """Only kx shows."""
        (there,) = rows["joint_compliance_6d"]
        return noise + np.where(np.arange(len(noise)) < 9, 500.0 / there.values["kx"] - 1.0, 0.0) * 5.0

    monkeypatch.setattr(refine, "left_with", left)
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    row = EffectRow(1, {**rigid, "kx": 500.0, "bx": 2.0, "krx": 900.0, "brx": 0.1, "kry": 700.0, "bry": 0.1})
    bearing = ("joint_compliance_6d", 1)
    firm = stiffened(asked, whitening(asked), {bearing: row}, parts)
    assert firm[bearing].values == {**rigid, "kx": 500.0, "bx": 2.0}
    # at least one direction stays
    only = {bearing: EffectRow(1, {**rigid, "krx": 900.0})}
    assert stiffened(asked, whitening(asked), only, parts) == only


def test_numbers_of_which_the_sum_alone_is_known_have_variances():
    """In units far from each other, and known by so many rows that a prior is lost to rounding."""
    for much in (1e6, 1e15, 1e18, 1e22):
        both = np.array([[1.0, 1.0 - 1e-16], [1.0 - 1e-16, 1.0]])
        units = np.array([1e-6, 1e4])
        plain = much * both + 0.1 * np.eye(2)
        covariance = covariance_of(plain / np.outer(units, units))
        assert np.all(np.diagonal(covariance) > 0.0)
        covariance /= np.outer(units, units)
        assert np.all(np.isfinite(covariance))
        assert much * np.sum(covariance) < 10.0
        if much < 1e9:
            np.testing.assert_allclose(covariance @ plain, np.eye(2), atol=1e-6)


def test_moments_that_no_body_has_do_not_cost_the_mass(monkeypatch):
    monkeypatch.setattr(
        "mbexport.core.diagnosis.judge.without_bodies", lambda _, found: {f.key for f in found if f.row.values["Ixx"]}
    )
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.5 * math.sin(q)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    values = dict.fromkeys(("y", "z", *COLUMNS[4:]), 0.0) | {"mass": 0.1, "x": 0.0, "Ixx": -1e-3}
    (load_there,) = judge.held([Found("payload", 0, EffectRow(0, values), 50.0)]).found
    assert load_there.row.values["Ixx"] == 0.0


def test_numbers_that_no_run_shows_are_not_said_to_be_known():
    """Where a pendulum's load is along its axis, and how thick it is across."""
    asked = question(lambda t, q, dq: 0.4 * math.sin(q))
    values = {"mass": 0.1, "x": 0.4, "y": 0.02, "z": 0.05} | dict.fromkeys(
        ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0
    )
    load = Found("payload", 0, EffectRow(0, values), 50.0)
    fit = refined(asked, whitening(asked), [load], blocks(asked.evidence))
    shown = {name: there for (_, _, name), there in zip(fit.free, fit.shown, strict=True)}
    assert shown["mass"] and shown["x"]
    assert not shown["z"]


def test_a_number_that_begins_at_nothing_is_neither_held_there_nor_said_to_be_known():
    """Of more of a pendulum's arm its first moment across, of which runs show something, and along the axis."""
    asked = question(lambda t, q, dq: 0.3 * math.sin(q) + 0.2 * math.cos(q))
    row = EffectRow(1, dict.fromkeys(COLUMNS, 0.0) | {"mass": 0.1} | dict.fromkeys(("mx", "my", "mz"), 1e-9))
    fit = refined(asked, whitening(asked), [Found("link_inertia", 1, row, 50.0)], blocks(asked.evidence))
    spread = {name: math.sqrt(fit.covariance[k, k]) for k, (_, _, name) in enumerate(fit.free)}
    values = fit.rows["link_inertia", 1].values
    # gravity along y: 0.2 N m over 9.81 m/s^2
    assert abs(values["my"]) == pytest.approx(0.2 / 9.81, rel=0.05)
    assert dict(zip((name for _, _, name in fit.free), fit.shown, strict=True))["mz"] is False
    # nearly a fifth of the robot's length, 0.5 m, times that mass, which is at least a tenth of the arm's
    assert spread["mz"] > 0.09 * max(abs(values["mass"]), 0.1 * asked.database.inertias[0].mass)


def test_an_interval_ends_where_its_number_can():
    """No friction drives its joint, however little of it the runs show."""
    asked = question(lambda t, q, dq: 0.4 * dq)
    friction = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
    fit = refined(asked, whitening(asked), [friction], blocks(asked.evidence))
    hardly = replace(fit, covariance=1e8 * fit.covariance)
    low, high = finding(friction, "revolute", 50.0, hardly, ()).parameters["coefficient"].ci95
    assert low == 0.0
    assert high > 0.5


def test_what_simulation_takes_to_nothing_has_vanished():
    asked = question(lambda t, q, dq: 0.4 * dq)
    whiten = whitening(asked)
    columns = ("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}))
    friction = Found(*columns, 50.0, EffectRow(1, {"coefficient": 0.0}))
    fit = refined(asked, whiten, [friction], blocks(asked.evidence))
    assert not vanished(fit, friction)
    none = replace(fit, rows={friction.key: EffectRow(1, {"coefficient": 1e-6})})
    assert vanished(none, friction)


def test_what_shows_with_what_no_run_shows_has_not_vanished():
    """Of a mass and its first moment along an axis that no run turns about, together known well."""
    row, none = (EffectRow(1, {"mass": mass, "mx": 0.0}) for mass in (1.0, 0.0))
    free = (("link_inertia", 1, "mass"), ("link_inertia", 1, "mx"))
    both = np.array([[4.0, -3.99], [-3.99, 4.0]])
    arm = Found("link_inertia", 1, row, 50.0, none)
    fit = Refined({arm.key: row}, np.zeros(10), free, both, np.zeros((10, 2)), (True, False))
    assert not vanished(fit, arm)
    assert vanished(replace(fit, covariance=np.diag(np.diag(both))), arm)


def test_a_delay_is_fitted_across_the_edge_of_a_tick():
    late = 0.0052
    asked = problem(load("pendulum"), "rigid", [without_torque(pendulum_run(against=late_by(late)[0]))])
    start = Found("delay", 0, EffectRow(0, {"time": 0.0035}), 0.0)
    fit = refined(asked, whitening(asked), [start], blocks(asked.evidence))
    assert fit.rows["delay", 0].values["time"] == pytest.approx(late, abs=8e-4)


@pytest.mark.parametrize(("first", "a_body"), [(0.005, True), (0.2, False)])
def test_an_arm_that_is_all_but_a_body_gets_what_its_moments_lack(first, a_body):
    """A flat arm was no body with any mass elsewhere, and its neighbours were named for it."""
    arm = load("planar2r")
    flat = Inertia(1.0, (0.0, 0.1, 0.0), 0.01, 0.02, 0.03)
    t = np.arange(1001) / 250.0
    q = 0.5 * np.sin(2.0 * t)[:, None] * (1.0, 0.8)
    run = Run("swing", t, {"q": q, "tau": q}, Control("unknown"), {}, (), {}, "", (), 250.0)
    asked = problem(replace(arm, inertias=(flat, *arm.inertias[1:])), "rigid", [run])
    key = ("link_inertia", 1)
    moved = dict.fromkeys(("mass", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0) | {"mz": first}
    row = EffectRow(1, moved)
    assert asked.impossible({"link_inertia": (row,)})[0]
    (whole,) = asked.rounded_out({key: row}).values()
    assert (asked.impossible({"link_inertia": (whole,)})[0] == "") is a_body
    more = [whole.values[name] - row.values[name] for name in ("Ixx", "Iyy", "Izz")]
    assert more == [more[0]] * 3
    assert 0.0 < more[0] < 0.011 * 0.03 if a_body else more[0] == 0.0
    # what was no body before need not be one
    never = replace(asked.bodies[0], inertias=(replace(flat, zz=0.0302), *arm.inertias[1:]))
    assert replace(asked, bodies=(never,)).rounded_out({key: row})[key] is row
    # a body stays as it is
    sound = {key: EffectRow(1, moved | {"mz": 0.0, "Ixx": 0.001})}
    assert asked.rounded_out(sound)[key] is sound[key]


def test_a_robot_that_is_lighter_as_its_controller_is_weaker_explains_nothing():
    """All that positions alone show of it is smaller, and so is what it makes of noise."""
    run = without_torque(pendulum_run(against=lambda t, q, dq: 0.3 * dq))
    asked = problem(load("pendulum"), "rigid", [run])
    whiten, scale, body = whitening(asked), 0.1, asked.database.inertias[0]
    tensor = body.tensor_about_origin()
    less = {"mass": body.mass}
    less |= dict(zip(("mx", "my", "mz"), body.first_moments().tolist(), strict=True))
    less |= {f"I{'xyz'[i]}{'xyz'[j]}": float(tensor[i, j]) for i in range(3) for j in range(i, 3)}
    arm = EffectRow(1, {name: (scale - 1.0) * value for name, value in less.items()})
    rows = {"controller_gain": (EffectRow(1, {"kp": scale, "kd": scale}),), "link_inertia": (arm,)}
    nothing, scaled = left_with(asked, whiten, {}), left_with(asked, whiten, rows)
    assert float(scaled @ scaled) == pytest.approx(float(nothing @ nothing), rel=0.1)
