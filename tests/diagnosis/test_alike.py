"""Other names of a finding: which is likelier, and which is none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis.alike import ABOUT, BESIDE, Alike, _springs_instead, alike
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.mimic import Model, Sizes, as_it_is
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import FAR, problem
from mbexport.core.diagnosis.refine import SHORTEST_PART, refined
from mbexport.core.diagnosis.state import Search
from mbexport.core.diagnosis.told_apart import told_apart
from mbexport.core.diagnosis.tried import ALIKE
from mbexport.core.diagnosis.unseen import Short, splits
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import Run

from .searching import COLUMNS, RIGID_BEARING, question


def test_an_arm_that_bends_where_its_joint_is_has_a_bearing_that_gives(monkeypatch):
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    bearing = Found("joint_compliance_6d", 1, EffectRow(1, {**rigid, "krx": 800.0, "brx": 0.5}), 50.0)
    for at, worse, nats, name in (
        (SHORTEST_PART, 0.0, 3.0, "joint_compliance_6d"),
        # nothing tells where it bends
        (0.4, 0.0, 3.0, "joint_compliance_6d"),
        (0.4, 1.2 * ALIKE, 3.0, "link_flexibility"),
        (0.4, 0.0, 1.2 * ALIKE, "link_flexibility"),
        (SHORTEST_PART, 0.0, 30.0, "link_flexibility"),
    ):
        short = (Short(0.0, 0.0), Short(nats, 0.05))
        monkeypatch.setattr("mbexport.core.diagnosis.told_apart.fall_short", lambda *_, short=short: short)
        bend = {"ku": 800.0, "kv": 900.0, "bu": 0.5, "bv": 0.5, "at": at}
        arm = Found("link_flexibility", 1, EffectRow(1, bend), 50.0)
        _, better = told_apart(judge, [arm], [(Alike(bearing, worse, 0.0),)])
        assert [item.effect for item in better or [arm]] == [name]


@pytest.mark.parametrize(
    ("ways", "nats", "name"),
    [
        (("kry",), 3.0, "joint_compliance"),
        (("krx", "kry"), 3.0, "joint_compliance_6d"),
        (("kry",), 30.0, "joint_compliance_6d"),
    ],
)
def test_what_gives_one_way_alone_is_a_drive_before_it_is_a_bearing(monkeypatch, ways, nats, name):
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(
        "mbexport.core.diagnosis.told_apart.fall_short", lambda *_: (Short(0.0, 0.0), Short(nats, 0.05))
    )
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    bearing = Found("joint_compliance_6d", 1, EffectRow(1, {**rigid, **dict.fromkeys(ways, 800.0)}), 50.0)
    drive = Found("joint_compliance", 1, EffectRow(1, {"stiffness": 800.0, "damping": 0.5}), 50.0)
    _, better = told_apart(judge, [bearing], [(Alike(drive, 0.0, 0.0),)])
    assert [item.effect for item in better or [bearing]] == [name]


@pytest.mark.parametrize(
    ("nats", "off", "name"),
    [(3.0, "theta", "encoder_offset"), (30.0, "theta", "kinematic_error"), (3.0, "a", "kinematic_error")],
)
def test_an_angle_that_is_off_is_the_encoders_before_it_is_the_arms(monkeypatch, nats, off, name):
    """Where runs that no fit saw tell them apart it is what they say; a length is the arm's."""
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(
        "mbexport.core.diagnosis.told_apart.fall_short", lambda *_: (Short(0.0, 0.0), Short(nats, 0.05))
    )
    none = dict.fromkeys(("alpha", "a", "theta", "d", "beta"), 0.0)
    arm = Found("kinematic_error", 1, EffectRow(1, none | {off: 0.01}), 50.0)
    encoder = Found("encoder_offset", 1, EffectRow(1, {"offset": 0.01}), 0.0)
    _, better = told_apart(judge, [arm], [(Alike(encoder, 0.0, 0.0),)])
    # by whatever name, the evidence is that of both
    assert [(item.effect, item.gain) for item in better or [arm]] == [(name, 50.0)]


@pytest.mark.parametrize(
    ("at", "nats", "name"), [(1, 3.0, "encoder_offset"), (1, 1.2 * ALIKE, "backlash"), (2, 3.0, "backlash")]
)
def test_play_that_no_load_ever_crosses_is_an_angle_that_is_off(monkeypatch, at, nats, name):
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(
        "mbexport.core.diagnosis.told_apart.fall_short", lambda *_: (Short(0.0, 0.0), Short(nats, 0.05))
    )
    wide = {"gap": 0.02, "stiffness": math.inf, "damping": math.inf}
    play = Found("backlash", 1, EffectRow(1, wide), 50.0)
    encoder = Found("encoder_offset", at, EffectRow(at, {"offset": 0.01}), 0.0)
    _, better = told_apart(judge, [play], [(Alike(encoder, 0.0, 0.0),)])
    assert [item.effect for item in better or [play]] == [name]


def test_a_robot_that_cannot_be_mimics_nothing():
    """Its friction could not be given a stiffness to stick with."""
    asked = question()
    rubs = {"coulomb_friction": (EffectRow(1, {"torque": 0.1}),)}
    light = Found("link_inertia", 1, EffectRow(1, dict.fromkeys(COLUMNS, 0.0) | {"Izz": -10.0}), 50.0)
    assert np.all(Model(asked, rubs, light, (), Sizes(asked), as_it_is).said == FAR)


def test_a_drive_a_bearing_and_an_arm_as_stiff_as_an_arm_are_tried_in_its_place():
    asked = question()
    arm = {"ku": 900.0, "kv": math.inf, "bu": 0.5, "bv": 0.0, "at": 0.5, "stiffening": 7.0}
    tried = _springs_instead(asked, Found("link_flexibility", 1, EffectRow(1, arm), 50.0))
    stiff = [900.0 * times for times in (*ABOUT, *BESIDE)]
    count = len(stiff)
    assert [item.row.values["stiffness"] for item in tried[:count]] == stiff
    # what rings long is met within a few per cent of its own stiffness only
    ordered = np.sort(stiff)
    assert np.max((ordered[1:] / ordered[:-1])[1:-1]) < 1.8
    assert np.max((ordered[1:] / ordered[:-1])[3:6]) < 1.1
    drive, bearing, bend = tried[1::count]
    assert drive.key == ("joint_compliance", 1)
    assert drive.row.values == {"stiffness": 900.0, "damping": 0.5, "stiffening": 7.0}
    tilts = {"krx": 900.0, "kry": 900.0, "brx": 0.5, "bry": 0.5, "stiffening": 7.0}
    assert (bearing.key, bearing.row.values) == (("joint_compliance_6d", 1), RIGID_BEARING | tilts)
    bends = {"ku": 900.0, "kv": 900.0, "bu": 0.5, "bv": 0.5, "at": 0.5, "stiffening": 7.0}
    assert (bend.key, bend.row.values) == (("link_flexibility", 1), bends)
    slide = replace(
        asked, database=replace(asked.database, joints=(replace(asked.database.joints[0], kind="prismatic"),))
    )
    tried = _springs_instead(slide, Found("link_flexibility", 1, EffectRow(1, arm), 50.0))
    assert [item.effect for item in tried] == ["joint_compliance_6d"] * count + ["link_flexibility"] * count
    assert _springs_instead(asked, Found("viscous_friction", 1, EffectRow(1, {"coefficient": 1.0}), 50.0)) == []
    # where it hardly gives one way, a bearing may be as stiff as it is the other way
    uneven = _springs_instead(asked, Found("link_flexibility", 1, EffectRow(1, arm | {"kv": 5.0, "bv": 0.1}), 50.0))
    assert {900.0, 5.0} <= {item.row.values["krx"] for item in uneven if item.effect == "joint_compliance_6d"}


def test_what_would_gain_as_much_elsewhere_is_no_other_name(monkeypatch):
    """Friction of two joints that takes as much each: neither is a name of the other."""
    arm = load("planar2r")
    t = np.arange(1001) / 250.0
    q = np.column_stack([0.5 * np.sin(2.0 * t), 0.5 * np.sin(3.1 * t)])
    dq = np.column_stack([1.0 * np.cos(2.0 * t), 1.55 * np.cos(3.1 * t)])
    ddq = np.column_stack([-2.0 * np.sin(2.0 * t), -4.805 * np.sin(3.1 * t)])
    random = np.random.default_rng(3)
    tau = (
        dynamics(build(arm, "rigid")).inverse_dynamics(q, dq, ddq)
        + dq * (0.1, 0.0625)
        + 0.01 * random.normal(size=q.shape)
    )
    noise = {"q": np.full(2, 1e-6), "tau": np.full(2, 0.01)}
    q = q + 1e-6 * random.normal(size=q.shape)
    run = Run("swing", t, {"q": q, "tau": tau}, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    state = Search(asked, whitening(asked))
    state.begin()
    one = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    fit = refined(asked, state.whiten, [one], blocks(asked.evidence))
    assert ("viscous_friction", 2) not in {other.found.key for other in alike(state, [one], fit, one)}
    monkeypatch.setattr("mbexport.core.diagnosis.fit.SAME", -2.0)
    assert ("viscous_friction", 2) in {other.found.key for other in alike(state, [one], fit, one)}
    # a name that says more of the same is one all the more
    lesser = Found("coulomb_friction", 2, EffectRow(2, {"torque": 0.06}), 50.0)
    names = alike(state, [lesser], refined(asked, state.whiten, [lesser], blocks(asked.evidence)), lesser)
    assert any(other.worse < -ALIKE for other in names)
