"""URDF in Pinocchio: the file's numbers, the sheet's drives, and the same motion as MuJoCo's."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from mbexport.backends.common import joint_data
from mbexport.backends.mjcf import MjcfBackend
from mbexport.backends.urdf import UrdfBackend
from mbexport.backends.urdf_text import urdf_text
from mbexport.core.control import Control
from mbexport.core.errors import RefusedError
from mbexport.core.expansion import expanded
from mbexport.core.motion import from_table
from mbexport.core.representation import (
    ArmSpring,
    Bend,
    Drive,
    FrictionModel,
    Inertia,
    Joint,
    Mount,
    Pose,
    Shape,
    Slip,
    Spring,
    Stick,
    Term,
)
from mbexport.core.simulation.backend import Emission, MachineState

BACKEND = UrdfBackend()
STICK = Stick(5.0e-6, 2.0 * math.sqrt(5.0e-6 / 3.0))


def term(effect, *parameters, kind="level"):
    return Term(effect, kind, kind, parameters)


def with_joint(robot, i, **changes):
    stages = list(robot.stages)
    stages[i] = replace(stages[i], joint=replace(stages[i].joint, **changes))
    return replace(robot, stages=tuple(stages))


def with_file(emission, name, change):
    assert change(emission.files[name]) != emission.files[name]
    return Emission(
        emission.backend, emission.main, {**emission.files, name: change(emission.files[name])}, emission.concepts
    )


@pytest.fixture
def loaded(program):
    return lambda robot, control=None: BACKEND.engine_for(robot, program(robot.n, control))


@pytest.fixture
def both(program):
    """The same robot in MuJoCo and in Pinocchio."""
    return lambda robot, mode="motion": [
        backend.engine_for(robot, program(robot.n, Control(mode))) for backend in (MjcfBackend(), BACKEND)
    ]


# statics


@pytest.mark.parametrize("n", range(1, 9))
def test_statics_are_the_tables(random_robot, statics, loaded, n):
    robot = random_robot(n, n)
    engine = loaded(robot)
    q = np.random.default_rng(100 + n).uniform(-2.0, 2.0, n)
    tool, matrix, torque = statics(robot, q)
    assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-13)
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    assert np.max(np.abs(engine.mass_matrix(q) - matrix) / scale) < 1e-12
    assert np.max(np.abs(engine.gravity(q) - torque)) < 1e-12 * np.max(np.abs(torque))


@pytest.mark.parametrize("n", range(1, 9))
def test_statics_are_mujocos(random_robot, both, soft, n):
    mujoco, engine = both(random_robot(50 + n, n, lambda i: soft(i) if i % 3 == 1 else Drive(inertia=1.0)))
    rng = np.random.default_rng(n)
    for _ in range(3):
        q, dq, ddq = rng.normal(size=(3, n))
        bias, torque = engine.bias(q, dq), engine.inverse_dynamics(q, dq, ddq)
        assert np.max(np.abs(mujoco.bias(q, dq) - bias)) < 1e-12 * np.max(np.abs(bias))
        assert np.max(np.abs(mujoco.inverse_dynamics(q, dq, ddq) - torque)) < 1e-12 * np.max(np.abs(torque))
        assert np.max(np.abs(engine.mass_matrix(q) @ ddq + bias - torque)) < 1e-12 * np.max(np.abs(torque))
        assert np.array_equal(mujoco.motor_inertia(), engine.motor_inertia())


def test_joints_go_by_name_not_by_order(random_robot, statics, program):
    """Names in another order of the alphabet, and more than nine joints."""
    robot = random_robot(2, 11)
    names = ["z", "b", "joint_10", "joint_9", "a", "Z", "A_", "y", "joint_2", "joint_1", "m"]
    for i, name in enumerate(names):
        robot = with_joint(robot, i, name=name)
    q = np.random.default_rng(0).normal(size=11)
    tool, _, torque = statics(robot, q)
    engine = BACKEND.load(BACKEND.emit(robot, program(11)))
    assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-12)
    assert np.allclose(engine.gravity(q), torque, rtol=1e-11, atol=1e-11)


# what is in the file


def test_numbers_keep_their_digits(random_robot):
    robot = random_robot(1, 3)
    root = ET.fromstring(urdf_text(robot))
    tool = robot.tool_in_last_joint()
    origin = root.find("joint[@name='arm_to_tool']/origin")
    assert tuple(map(float, origin.get("xyz").split())) == tool.xyz
    assert tuple(map(float, origin.get("rpy").split())) == tool.rpy()
    for i in range(3):
        inertia = robot.inertia_in_joint(i)
        inertial = root.find(f"link[@name='arm_{i + 1}']/inertial")
        assert tuple(map(float, inertial.find("origin").get("xyz").split())) == inertia.com
        assert inertial.find("origin").get("rpy") == "0.0 0.0 0.0"
        assert float(inertial.find("mass").get("value")) == inertia.mass
        for name in ("xx", "yy", "zz", "xy", "xz", "yz"):
            assert float(inertial.find("inertia").get(f"i{name}")) == getattr(inertia, name)


def test_principal_axes_are_the_same_body(random_robot):
    robot = random_robot(1, 4)
    turned = pinocchio.buildModelFromXML(urdf_text(robot, principal_axes=True))
    plain = pinocchio.buildModelFromXML(urdf_text(robot))
    for inertia, expected in zip(turned.inertias, plain.inertias, strict=True):
        assert np.allclose(inertia.inertia, expected.inertia, rtol=0.0, atol=1e-14)
        assert inertia.lever == pytest.approx(expected.lever, abs=1e-15)
    for inertia in ET.fromstring(urdf_text(robot, principal_axes=True)).iter("inertia"):
        assert {inertia.get(name) for name in ("ixy", "ixz", "iyz")} == {"0.0"}
        moments = [float(inertia.get(name)) for name in ("ixx", "iyy", "izz")]
        assert moments == sorted(moments)


@pytest.mark.parametrize(
    ("joint", "kind", "limit"),
    [
        (Joint("joint_1"), "continuous", None),
        (Joint("joint_1", velocity=2.0), "continuous", {"effort": 1e9, "velocity": 2.0}),
        (
            Joint("joint_1", "revolute", -1.0, 2.0, effort=5.0),
            "revolute",
            {"lower": -1.0, "upper": 2.0, "effort": 5.0, "velocity": 1e9},
        ),
        (
            Joint("joint_1", "revolute", lower=-1.0),
            "revolute",
            {"lower": -1.0, "upper": 1e9, "effort": 1e9, "velocity": 1e9},
        ),
        (Joint("joint_1", "prismatic"), "prismatic", {"lower": -1e9, "upper": 1e9, "effort": 1e9, "velocity": 1e9}),
    ],
)
def test_limits_are_said_where_the_format_wants_them(random_robot, loaded, joint, kind, limit):
    robot = random_robot(1, 1)
    robot = replace(robot, stages=(replace(robot.stages[0], joint=joint),))
    element = ET.fromstring(urdf_text(robot)).find("joint[@name='joint_1']")
    assert element.get("type") == kind
    assert element.find("axis").get("xyz") == "0 0 1"
    found = element.find("limit")
    assert limit == (None if found is None else {name: float(value) for name, value in found.attrib.items()})
    assert loaded(robot).n == 1


def test_links_without_mass_say_so(random_robot):
    """Some engines take a link without inertial as 1 kg."""
    robot = random_robot(1, 2)
    masses = {
        link.get("name"): float(link.find("inertial/mass").get("value"))
        for link in ET.fromstring(urdf_text(robot)).iter("link")
    }
    assert {name for name, mass in masses.items() if mass == 0.0} == {"world", "base", "tool"}


def test_shapes_are_there_and_weigh_nothing(random_robot):
    robot = random_robot(1, 1)
    at = Pose.from_rpy((0.1, 0.2, 0.3), (0.3, 0.2, 0.1))
    shapes = (
        Shape("box", (0.1, 0.2, 0.3), at),
        Shape("cylinder", (0.1, 0.4), at),
        Shape("sphere", (0.2,), at),
        Shape("mesh", (1.0, 1.0, 0.5), at, mesh='a "b"<c>.stl', rgba=(0.1, 0.2, 0.3, 1.0)),
    )
    stage = replace(robot.stages[0], arm=replace(robot.stages[0].arm, shapes=shapes))
    text = urdf_text(replace(robot, stages=(stage,)))
    link = ET.fromstring(text).find("link[@name='arm_1']")
    assert [visual.find("geometry")[0].tag for visual in link.iter("visual")] == ["box", "cylinder", "sphere", "mesh"]
    assert link.find("visual/geometry/mesh").get("filename") == 'a "b"<c>.stl'
    assert len({material.get("name") for material in link.iter("material")}) == 2
    assert pinocchio.buildModelFromXML(text).inertias[1].mass == robot.stages[0].arm.inertia.mass


def test_damping_is_the_files_and_gravity_the_sheets(random_robot, program):
    emission = BACKEND.emit(random_robot(1, 2, lambda i: Drive(damping=3.0), revolute_only=True), program(2))
    zero, one = np.zeros(2), np.ones(2)
    engine = BACKEND.load(emission)
    assert engine.drive_torque(zero, one, zero, one)[1] == pytest.approx([-3.0, -3.0])
    lost = BACKEND.load(with_file(emission, emission.main, lambda text: text.replace('damping="3.0"', 'damping="0.0"')))
    assert lost.drive_torque(zero, one, zero, one)[1] == pytest.approx([0.0, 0.0])
    sheet = next(name for name in emission.files if name.endswith(".drives.json"))
    floating = BACKEND.load(
        with_file(emission, sheet, lambda text: text.replace("-9.81", "0.0").replace("-0.2", "0.0"))
    )
    assert not np.allclose(floating.gravity(zero), engine.gravity(zero))


def test_same_robot_same_bytes_and_remarks_cannot_break_out(random_robot, program):
    robot = random_robot(1, 2)
    assert BACKEND.emit(robot, program(2)) == BACKEND.emit(robot, program(2))
    nasty = replace(robot, level='a"<b> & c', source_hash="--> <x/>", notes=("---", "two\nlines"))
    assert BACKEND.load(BACKEND.emit(nasty, program(2))).n == 2


def test_sheets_of_all_backends_are_one(random_robot, program, soft):
    robot = random_robot(1, 2, soft)
    texts = [
        {name: text for name, text in backend.emit(robot, program(2)).files.items() if name.endswith(".json")}
        for backend in (BACKEND, MjcfBackend())
    ]
    assert texts[0] == texts[1]


def test_concepts_name_every_datum(random_robot, program, soft):
    drive = replace(
        soft(0),
        damping=1.0,
        terms=(term("coulomb_friction", 1.0), term("torque_ripple", 1.0, 2.0, 0.0, kind="resistance")),
    )
    robot = with_joint(random_robot(1, 3, lambda i: drive), 0, lower=-1.0)
    concepts = BACKEND.emit(robot, program(3)).concepts
    said = {(concept.datum, concept.at) for concept in concepts}
    for stage in robot.stages:
        for datum in joint_data(stage):
            assert (datum, stage.joint.name) in said or (datum, "all joints") in said
    status = {concept.datum: concept.status for concept in concepts}
    assert status["limits.position"] == "approximated"
    assert status["viscous_friction.coefficient"] == "exact"
    assert status["coulomb_friction"] == "approximated"
    for datum in ("gravity", "rotor_inertia.inertia", "joint_compliance.stiffness", "torque_ripple", "home"):
        assert status[datum] == "impossible"


# runs


def pd(state, t):
    return 400.0 * (0.5 * math.sin(3.0 * t) - state.theta) - 60.0 * state.dtheta


def run(engine, start, law=None, ticks=150, steps=5, driven=1.0):
    engine.reset(start, law)
    for k in range(ticks):
        if law is None:
            engine.hold(driven * pd(engine.state(), k * 1e-3))
        engine.advance(1e-3, steps)
    return engine.state(), engine.friction(), engine.transmitted()


def drives_of(soft):
    def rigid(i, **more):
        return Drive(inertia=1.0 + i, **more)

    level = {"terms": (term("coulomb_friction", 3.0), term("stribeck_friction", 2.0, 0.05))}
    loaded = {"terms": (term("coulomb_friction", 1.0), term("load_friction", 0.2))}
    wobble = (1.0e-3, 20.0, 0.3)
    gear = {
        "terms": (
            term("transmission_error", *wobble, kind="error"),
            term("transmission_error", *wobble, kind="error_slope"),
        )
    }
    play = {"spring": Spring(4.0e3, 20.0, 2.0e-3)}
    rest = {"damping": 3.0, "gain": 1.1, "arm_springs": (ArmSpring(30.0, -1.0), ArmSpring(5.0, 0.2))}
    return {
        "rigid": (rigid, {}),
        "rigid, linear": (rigid, rest),
        "rigid, friction": (rigid, level | rest),
        "rigid, sticking": (rigid, level | {"stick": STICK}),
        "rigid, hysteresis": (rigid, {"slips": (Slip(800.0, 1.0), Slip(800.0, 2.0))}),
        "rigid, load": (rigid, loaded),
        "elastic": (soft, {}),
        "elastic, linear": (soft, rest),
        "elastic, friction": (soft, level | rest),
        "elastic, sticking": (soft, level | {"stick": STICK}),
        "elastic, load": (soft, loaded),
        "elastic, gear": (soft, gear),
        "elastic, play": (soft, play),
        "mixed": (lambda i, **more: (soft if i % 2 else rigid)(i, **more), level | rest),
        "mixed, load": (lambda i, **more: (soft if i % 2 else rigid)(i, **more), loaded),
    }


CASES = list(drives_of(Drive))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("imposed", [False, True], ids=["torque", "motion"])
def test_runs_are_mujocos(random_robot, both, soft, still, case, imposed):
    drive, more = drives_of(soft)[case]
    stick = "sticking" in case
    robot = random_robot(31, 4, lambda i: replace(drive(i, **{k: v for k, v in more.items() if k != "spring"}), **more))
    robot = replace(robot, friction=FrictionModel("stick" if stick else "smooth", 1.0e-2))
    law = None
    start = still([0.1, -0.2, 0.1, 0.2])
    if imposed:
        law = from_table(np.linspace(0.0, 0.2, 5), 0.1 * np.random.default_rng(1).normal(size=(5, 4)))
        theta, dtheta, _ = law.at(0.0)
        start = MachineState(0.0, theta, dtheta, theta, dtheta)
    (one, one_friction, one_passed), (two, two_friction, two_passed) = (
        run(engine, start, law) for engine in both(robot, "motion" if imposed else "torque")
    )
    assert np.max(np.abs(two.q - start.q)) > 1e-3
    # rigid joints beside elastic ones are moved by force in MuJoCo, and by hand here
    exact = 1e-7 if imposed and "mixed" in case else 1e-11
    for a, b, tolerance in (
        (one.q, two.q, exact),
        (one.theta, two.theta, 1e-11),
        (one.dq, two.dq, 1e2 * exact),
        (one_friction, two_friction, 1e5 * exact),
        (one_passed, two_passed, 1e5 * exact),
    ):
        assert np.max(np.abs(a - b)) < tolerance
    if "friction" in case or "sticking" in case:
        assert np.all(two_friction != 0.0)


def test_bearings_and_bending_arms_run_alike(random_robot, both, soft, still):
    robot = random_robot(5, 3, soft, revolute_only=True)
    stages = list(robot.stages)
    mount = Mount((4e5, math.inf, 3e5, 2e4, 3e4), (50.0, 0.0, 40.0, 5.0, 5.0))
    stages[1] = replace(stages[1], mount=mount, bend=Bend((2e4, 3e4), (5.0, 6.0), 0.4))
    for imposed in (False, True):
        whole = expanded(replace(robot, stages=tuple(stages)), imposed=imposed)
        law = None
        if imposed:
            law = from_table([0.0, 0.05, 0.1], whole.spread(np.array([[0.0] * 3, [0.1] * 3, [0.3] * 3])))
        n = whole.robot.n
        ends = [
            run(engine, still(np.zeros(n)), law, 20, 40, whole.spread(np.ones(3)))[0].q
            for engine in both(whole.robot, "motion" if imposed else "torque")
        ]
        assert n == 9
        assert np.max(np.abs(ends[0])) > 1e-3
        assert np.max(np.abs(ends[0] - ends[1])) < 1e-12


def test_fourth_order(random_robot, loaded, soft, still):
    engine = loaded(random_robot(12, 3, lambda i: soft(i, damping=1.0)), Control("torque"))
    ends = [run(engine, still([0.3, 0.2, 0.1]), None, 100, steps)[0].q for steps in (2, 4, 16)]
    order = np.log2(np.linalg.norm(ends[0] - ends[2]) / np.linalg.norm(ends[1] - ends[2]))
    assert 3.7 < order < 4.3


def test_a_run_that_bursts_says_when(random_robot, loaded, still):
    engine = loaded(random_robot(1, 2, lambda i: Drive(inertia=1e-3, spring=Spring(1e6))), Control("torque"))
    engine.reset(still([0.1, 0.1]), None)
    with pytest.raises(RefusedError, match=r"t = 0\.\d+ s"):
        for _ in range(100):
            engine.advance(0.01, 1)


def test_a_file_that_is_none_is_refused(random_robot, program):
    emission = BACKEND.emit(random_robot(1, 2), program(2))
    with pytest.raises(RefusedError, match=r"random\.urdf"):
        BACKEND.load(with_file(emission, emission.main, lambda text: text[:400]))


def test_bodies_that_mujoco_refuses_run_here(random_robot, statics, loaded):
    """An arm of mass 0 or a broken triangle, as published."""
    robot = random_robot(1, 3)
    stages = list(robot.stages)
    stages[0] = replace(stages[0], arm=replace(stages[0].arm, inertia=Inertia(0.0, (0.0, 0.0, 0.0), 0.0, 0.35, 0.0)))
    robot = replace(robot, stages=tuple(stages))
    q = np.array([0.1, 0.2, 0.3])
    assert np.allclose(loaded(robot).mass_matrix(q), statics(robot, q)[1], rtol=1e-12, atol=1e-12)
