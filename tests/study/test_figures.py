"""The figures of a variant, against what can be worked out by hand."""

from __future__ import annotations

import math
from unittest.mock import Mock

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.simulation import Trace
from mbexport.core.study.experiment import NOMINAL
from mbexport.core.study.figures import figure_names, figure_units, figures_of

G = 9.81


def named(outcome, n=2):
    return dict(zip(figure_names(n), outcome.figures, strict=True))


def sagged(k1, k2):
    """Angles and torques of planar2r at home on its springs, from its table by hand: two rods in a vertical plane."""
    home = math.radians(30), math.radians(-60)
    q1, q2 = home
    for _ in range(200):
        t2 = 1.2 * G * 0.2 * math.cos(q1 + q2)
        t1 = t2 + (2.4 * 0.25 + 1.2 * 0.5) * G * math.cos(q1)
        q1, q2 = home[0] - t1 / k1, home[1] - t2 / k2
    return (q1, q2), (t1, t2)


def tip(q1, q2):
    return np.array([0.5 * math.cos(q1) + 0.4 * math.cos(q1 + q2), 0.5 * math.sin(q1) + 0.4 * math.sin(q1 + q2), 0.0])


def test_the_sag_at_rest_is_that_worked_out_by_hand(small):
    experiment = small().experiment
    for k1, k2 in ((2500.0, 900.0), (1250.0, 1800.0)):
        (q1, q2), (t1, t2) = sagged(k1, k2)
        figures = named(experiment.run(0, (k1, k2)))
        error = tip(q1, q2) - tip(math.radians(30), math.radians(-60))
        assert [figures[f"tip_end_{axis}"] for axis in "xyz"] == pytest.approx(error, abs=1e-9)
        for name in ("tip_rms", "tip_max", "tip_end"):
            assert figures[name] == pytest.approx(np.linalg.norm(error), abs=1e-9)
        assert figures["tip_max_y"] == pytest.approx(abs(error[1]), abs=1e-9)
        for name in ("tau_peak", "tau_rms"):
            assert [figures[f"{name}_1"], figures[f"{name}_2"]] == pytest.approx([t1, abs(t2)], rel=1e-7)
    stands = named(experiment.run(NOMINAL, None))
    assert stands["tip_rms"] == named(experiment.run(0, (2500.0, 900.0)))["tip_rms"]


def test_errors_are_measured_from_the_same_robot_without_effects(small):
    """A longer arm is another robot, and sags otherwise; an arm with an error misses by it."""
    longer = small("kinematics.a[SI]@arm_2=0.4,0.41", level="rigid").experiment.run(0, (0.41,))
    assert named(longer)["tip_max"] < 1e-12
    wrong = small("kinematic_error.a[mm]@arm_2=0,1", level=None, effects=["kinematic_error"]).experiment
    assert wrong.effects_used() == ("kinematic_error",)
    assert named(wrong.run(0, (1.0e-3,)))["tip_end"] == pytest.approx(1.0e-3, rel=1e-9)
    assert named(wrong.run(NOMINAL, None))["tip_end"] < 1e-12


def test_the_controller_knows_the_robot_as_it_stands(small, planar):
    """A payload that the feedforward does not know makes the arm hang lower."""
    control = Control("pd", (600.0, 200.0), (60.0, 20.0), "gravity")
    study = small("payload.mass[kg]@robot=0,2", level=None, effects=["payload"], control=control)
    light, heavy = (named(study.experiment.run(i, values)) for i, values in enumerate(study.design.values.tolist()))
    assert light["tip_end"] < 1e-9
    assert heavy["tip_end_y"] < -1e-3
    assert study.facts()["control"]["mode"] == "pd"


def test_figures_of_a_known_run():
    t = np.arange(4.0)
    pose = np.tile(np.eye(4), (4, 1, 1))
    pose[:, :3, 3] = [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    trace = Trace(t, {"tau": np.array([[1.0], [-7.0], [1.0], [1.0]])}, pose, ("revolute",), {"step": 0.5})
    figures = dict(zip(figure_names(1), figures_of(trace, np.zeros((4, 3))), strict=True))
    assert figures["tip_rms"] == pytest.approx(math.sqrt(27 / 4))
    assert [figures[f"tip_rms_{axis}"] for axis in "xyz"] == pytest.approx([1.5, math.sqrt(17 / 4), 0.5])
    assert [figures["tip_max"], figures["tip_max_x"], figures["tip_max_y"], figures["tip_max_z"]] == [5, 3, 4, 1]
    assert [figures["tip_end"], figures["tip_end_x"], figures["tip_end_y"], figures["tip_end_z"]] == [1, 0, -1, 0]
    assert (figures["tau_peak_1"], figures["tau_rms_1"], figures["step"]) == (7.0, pytest.approx(math.sqrt(13)), 0.5)


def test_units_follow_the_joints():
    units = figure_units(("revolute", "prismatic"))
    assert (units["tip_rms_x"], units["tau_peak_1"], units["tau_rms_2"], units["step"]) == ("m", "N*m", "N", "s")
    assert tuple(units) == figure_names(2)


def test_a_variant_that_cannot_be_is_an_outcome(small, monkeypatch):
    experiment = small("inertia.mass@arm_2=0.5:2:3", "joint_compliance.stiffness@joint_1=0.5:2:3").experiment
    assert experiment.run(0, (0.6, 2500.0)).failed == ""
    impossible = experiment.run(4, (-1.0, 2500.0))
    assert (impossible.variant, impossible.figures, impossible.failed) == (4, (), "refused")
    assert "a mass is above zero" in impossible.reason
    for error in (RefusedError("no longer finite"), np.linalg.LinAlgError("singular"), RuntimeError("solver failed")):
        monkeypatch.setattr("mbexport.core.study.experiment.simulate", Mock(side_effect=error))
        given_up = experiment.run(5, (1.2, 2500.0))
        assert (given_up.failed, given_up.reason) == ("refused", str(error))
    monkeypatch.setattr("mbexport.core.study.experiment.simulate", Mock(side_effect=UsageError("of all variants")))
    with pytest.raises(UsageError):
        experiment.run(NOMINAL, None)


@pytest.mark.parametrize(
    ("vary", "options", "message"),
    [
        ("coulomb_friction.torque@joint_1=1:2:2", {}, "level 'compliant' does not use coulomb_friction"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"level": "rigid"}, "does not use joint_compliance"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"level": None, "effects": ["rotor_inertia"]}, "--with does not"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"level": "nonsense"}, "has no level 'nonsense'"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"level": None, "effects": ["nonsense"]}, "'nonsense'"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"motion": "nonsense"}, "no motion 'nonsense'"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"duration": -1.0}, "above 0"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"rate": 0.0}, "above 0"),
        ("joint_compliance.stiffness@joint_1=1:2:2", {"control": Control("torque")}, "mode motion or pd"),
        ("stribeck_friction.torque[SI]@joint_1=1:2:2", {"level": None}, "stribeck_friction.velocity@joint_1 must be"),
    ],
)
def test_what_would_fail_in_every_variant_is_one_error(small, vary, options, message):
    with pytest.raises(UsageError, match=message):
        small(vary, **options)
