"""What a difference looks like: changes of one model, put in and found again, without any engine."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.agreement.drive_faults import acceleration_look, armature_look, torque_look
from mbexport.core.agreement.geometry_faults import geometry_look
from mbexport.core.agreement.inertia_faults import inertia_look
from mbexport.core.agreement.quantities import FEW, random_states, table_accelerations
from mbexport.core.agreement.reference import Lump, apply, read
from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.representation import Pose


@pytest.fixture(scope="module")
def subject(random_database, tmp_path_factory):
    """(tables, representation, states, tables without each effect) of one robot with everything in it."""
    folder = random_database(tmp_path_factory.mktemp("robot"), 11, 5)
    robot, tables = build(load(folder)), read(folder)
    without = {
        name: lambda name=name: read(folder, [other for other in tables.effects if other != name])
        for name in tables.effects
    }
    return tables, robot, random_states(robot, 12), without


def geometry(subject, seen):
    tables, robot, states, without = subject
    return geometry_look(tables, robot, states.q, seen(states.q), without)


def with_row(tables, arm, column, value):
    rows = tables.rows.copy()
    rows[arm, column] = value
    return replace(tables, rows=rows)


ROWS = {"alpha": 0, "a": 1, "theta": 2, "d": 3, "beta": 4}


@pytest.mark.parametrize("column", ["alpha", "theta", "beta"])
def test_angles_in_degrees(subject, column):
    value = subject[0].rows[2, ROWS[column]]
    for factor, words in (
        (180 / math.pi, "is degrees taken for radians"),
        (math.pi / 180, "is radians taken for degrees"),
    ):
        look = geometry(subject, with_row(subject[0], 2, ROWS[column], factor * value).tool_in_world)
        assert look.at == "arm_3" and look.text.startswith(f"{column} of arm_3 {words}")


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1e3, "is millimetres taken for metres"), (-1.0, "has the opposite sign"), (0.0, "is left out"), (1.03, "is ")],
)
@pytest.mark.parametrize("column", ["a", "d"])
def test_lengths(subject, column, factor, words):
    look = geometry(
        subject, with_row(subject[0], 1, ROWS[column], factor * subject[0].rows[1, ROWS[column]]).tool_in_world
    )
    assert look.at == "arm_2" and look.text.startswith(f"{column} of arm_2 {words}")


def test_rows_swapped_and_effects_lost(subject):
    rows = subject[0].rows.copy()
    rows[[1, 3]] = rows[[3, 1]]
    assert (
        "rows arm_2 and arm_4 of the kinematics are swapped"
        in geometry(subject, replace(subject[0], rows=rows).tool_in_world).text
    )
    for effect in ("kinematic_error", "base_tilt"):
        assert geometry(subject, subject[3][effect]().tool_in_world).text == f"{effect} is left out"


def test_tool_base_and_corrections(subject):
    tables = subject[0]
    look = geometry(subject, replace(tables, tool=np.eye(4)).tool_in_world)
    assert "the tool's transform is left out" in look.text
    straight = tables.base.copy()
    straight[:3, :3] = np.eye(3)
    assert (
        "the base's transform has lost its rotation"
        in geometry(subject, replace(tables, base=straight).tool_in_world).text
    )
    moved = replace(tables, rows=tables.rows + tables.corrections[1:])
    assert "the geometry corrections move the chain" in geometry(subject, moved.tool_in_world).text


def test_joints_turned_or_swapped(subject):
    tables = subject[0]
    flipped = np.array([1, 1, -1, 1, 1])
    assert geometry(subject, lambda q: tables.tool_in_world(q * flipped)).text == "joint_3 turns the other way"
    swapped = geometry(subject, lambda q: tables.tool_in_world(q[:, [0, 3, 2, 1, 4]]))
    assert "the positions of joint_2 and joint_4 are swapped" in swapped.text


def test_a_frame_that_no_row_can_give(subject):
    """A joint's frame turned about an axis of its own: only the transform itself tells."""
    tables = subject[0]
    turn = Pose.from_rpy((0.0, 0.0, 0.0), (0.1, 0.2, 0.3)).matrix()

    def seen(q):
        frames = tables.frames(q)[0]
        before, after = frames[:, 2], np.linalg.inv(frames[:, 2]) @ tables.tool_in_world(q)
        return before @ turn @ after

    look = geometry(subject, seen)
    assert look.at in {"joint_4", "joint_3"} and "is turned by" in look.text


def test_what_cannot_be_explained_says_so(subject):
    look = geometry(subject, lambda q: subject[0].tool_in_world(np.sin(q)))
    assert look.at == "robot" and "no single row, unit, sign or frame does that" in look.text


def inertia(subject, changed):
    tables, robot, states, without = subject
    q = states.q
    return inertia_look(tables, robot, q, changed.mass_matrix(q), changed.gravity_torque(q), without)


def with_lump(tables, arm, change):
    lumps = list(tables.lumps)
    lumps[arm] = (change(lumps[arm][0]), *lumps[arm][1:])
    return replace(tables, lumps=tuple(lumps))


def test_signs_and_values_of_inertias(subject):
    tables = subject[0]
    for (a, b), name in (((0, 1), "Ixy"), ((0, 2), "Ixz"), ((1, 2), "Iyz")):

        def flipped(lump, a=a, b=b):
            tensor = lump.tensor.copy()
            tensor[a, b] = tensor[b, a] = -tensor[a, b]
            return Lump(lump.mass, lump.com, tensor)

        look = inertia(subject, with_lump(tables, 3, flipped))
        assert look.at == "arm_4" and look.text.startswith(f"{name} of arm_4 has the opposite sign")
    every = tables
    for arm in range(5):
        every = with_lump(
            every, arm, lambda lump: Lump(lump.mass, lump.com, 2 * np.diag(np.diag(lump.tensor)) - lump.tensor)
        )
    assert inertia(subject, every).text == "the products of inertia have the opposite sign in every arm"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lump: Lump(0.0, lump.com, 0 * lump.tensor), "the whole body of arm_4 is left out"),
        (lambda lump: Lump(lump.mass, lump.com, 0 * lump.tensor), "the moments of inertia of arm_4 are left out"),
        (lambda lump: Lump(lump.mass, 0 * lump.com, lump.tensor), "the center of mass of arm_4 is left out"),
        (lambda lump: Lump(lump.mass, lump.com, 1e-6 * lump.tensor), "the units kg m^2 and kg mm^2 are mixed up"),
        (
            lambda lump: Lump(lump.mass, lump.com * [1, -1, 1], lump.tensor),
            "y of the center of mass of arm_4 has the opposite",
        ),
        (lambda lump: Lump(1.2 * lump.mass, lump.com, lump.tensor), "the inertia of arm_4 differs"),
        (
            lambda lump: Lump(lump.mass, lump.com, np.diag(np.linalg.eigvalsh(lump.tensor))),
            "the rotation of arm_4's inertia is lost",
        ),
        (
            lambda lump: Lump(
                lump.mass,
                lump.com,
                lump.tensor + lump.mass * (lump.com @ lump.com * np.eye(3) - np.outer(lump.com, lump.com)),
            ),
            "the inertia of arm_4 has Steiner's part twice",
        ),
    ],
)
def test_changes_of_one_body(subject, change, words):
    look = inertia(subject, with_lump(subject[0], 3, change))
    assert look.at == "arm_4" and words in look.text


def test_rows_of_inertia_swapped_and_effects_lost(subject):
    tables = subject[0]
    lumps = list(tables.lumps)
    lumps[2], lumps[3] = lumps[3], lumps[2]
    assert (
        "rows arm_3 and arm_4 of the inertias are swapped" in inertia(subject, replace(tables, lumps=tuple(lumps))).text
    )
    for effect in ("payload", "link_inertia"):
        assert inertia(subject, subject[3][effect]()).text == f"{effect} is left out"


def test_gravity(subject):
    tables = subject[0]
    assert inertia(subject, replace(tables, gravity=-tables.gravity)).text.startswith("gravity is (")
    turn = Pose.from_rpy((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)).rotation_matrix()
    assert "another direction" in inertia(subject, replace(tables, gravity=turn @ tables.gravity)).text


def told(subject):
    """The representation and what its drives give."""
    tables, robot, states, _ = subject
    return (
        tables,
        robot,
        states,
        np.concatenate(tables.drive_torque(states.q, states.dq, states.theta, states.dtheta), axis=-1),
    )


def changed(array, at, value):
    copy = array.copy()
    copy[at] = value
    return copy


def drives(subject, **columns):
    tables, robot, states, expected = told(subject)
    other = replace(tables, **columns)
    seen = np.concatenate(other.drive_torque(states.q, states.dq, states.theta, states.dtheta), axis=-1)
    return torque_look(robot, states, expected, seen)


def test_drives(subject):
    tables = subject[0]
    at = int(np.flatnonzero(np.isfinite(tables.stiffness))[0])
    joint = f"joint_{at + 1}"
    look = drives(subject, stiffness=tables.stiffness * 180 / math.pi)
    assert look.kind == "stiffness" and "is taken per radian where it is per degree" in look.text
    look = drives(subject, damping=changed(tables.damping, at, 0.0))
    assert (look.kind, look.at) == ("damping", joint) and f"the damping of {joint} is lost" in look.text
    at = int(np.flatnonzero(tables.viscous)[0])
    look = drives(subject, viscous=changed(tables.viscous, at, 0.0))
    assert look.at == f"joint_{at + 1}" and "the viscous damping of" in look.text and "is lost" in look.text
    none = int(np.flatnonzero(tables.viscous == 0.0)[0])
    look = drives(subject, viscous=changed(tables.viscous, none, 0.04))
    assert look.text == f"joint_{none + 1} has a damping of 0.04 N m s/rad that the robot has not, like a default"
    at = int(np.flatnonzero(tables.coulomb)[0])
    look = drives(subject, coulomb=changed(tables.coulomb, at, tables.coulomb[at] + 2.0))
    assert look.kind == "friction" and "dry friction of" in look.text and "is 2 N m (or N) more" in look.text
    at = int(np.flatnonzero(tables.spring)[0])
    look = drives(subject, spring=changed(tables.spring, at, 0.0))
    assert f"arm side of joint_{at + 1} is lost" in look.text


def test_armature(subject):
    _, robot, _, _ = subject
    told_inertia = np.array([stage.drive.inertia for stage in robot.stages])
    at = int(np.flatnonzero(told_inertia)[0])
    look = armature_look(robot, told_inertia, changed(told_inertia, at, 0.0))
    assert (look.kind, look.at) == ("armature", f"joint_{at + 1}") and "is lost" in look.text
    assert "the motor-side inertia (armature) is lost at" in armature_look(robot, np.ones(5), np.zeros(5)).text


def test_what_acts_only_while_running(random_database, tmp_path):
    """Torques that no static answer shows: of joints, of links, of motor sides."""
    folder = random_database(tmp_path, 4, 4, ("rotor_inertia", "viscous_friction"))
    robot, tables = build(load(folder)), read(folder)
    states, few = random_states(robot), slice(0, FEW)
    expected = table_accelerations(tables, states, few)
    q, dq = states.q[few], states.dq[few]
    arms = tables.mass_matrix(q) + np.diag(tables.rotor)

    def look(torque):
        gained = -np.linalg.solve(arms, torque[..., None])[..., 0]
        seen = expected + np.concatenate([gained, gained], axis=-1)
        return acceleration_look(tables, robot, states, expected, seen)

    found = look(0.04 * apply(tables.mass_matrix(q), dq))
    assert found.kind == "default damping" and "0.04 1/s" in found.text
    found = look(dq * [0, 0, 0.3, 0])
    assert (found.kind, found.at) == ("damping", "joint_3") and "0.3" in found.text
    lost = replace(tables, rotor=changed(tables.rotor, int(np.argmax(tables.rotor)), 0.0))
    found = acceleration_look(tables, robot, states, expected, table_accelerations(lost, states, few))
    assert found.kind == "armature" and "less motor-side inertia" in found.text
