"""The readers themselves, on files written by hand whose mechanics is known without them."""

import math

import numpy as np
import pytest

PENDULUM = """A pendulum
!
UNITS/FORCE = NEWTON, MASS = KILOGRAM, LENGTH = METER, TIME = SECOND
ACCGRAV/IGRAV = 0.0, JGRAV = 0.0, KGRAV = -9.81
PART/1, GROUND
!                       adams_view_name='ground.seat'
MARKER/1, PART = 1, QP = 0, 0, 2.0
, REULER = 0.0, 90D, 0.0
PART/2, QG = 0, 0, 2.0, REULER = 0, 1.5707963267948966, 0
, MASS = 3.0, CM = 3
, IP = 0.1, 0.2, 0.25
, 0.03, 0.01, -0.02
MARKER/2, PART = 2
MARKER/3, PART = 2, QP = 0.5, 0, 0.1
!                       adams_view_name='hinge'
JOINT/1, REVOLUTE, I = 2, J = 1
!                       adams_view_name='spring'
SFORCE/1, ROTATIONAL, I = 2, J = 1
, FUNCTION = -50.0*(AZ(2,1) - 0.1) - 4.0*WZ(2,1,1)
, + 2.0
REQUEST/1, CNAMES = "", "angle", "height"
, F2 = AZ(2,1)\\
, F3 = DZ(3,1,1)
END
"""

COMMANDS = """! the same pendulum
defaults units  &
   length = meter  &
   angle = deg  &
   force = newton  &
   mass = kg  &
   time = second
defaults units  &
   coordinate_system_type = cartesian  &
   orientation_type = body313
model create  &
   model_name = m
force create body gravitational  &
   gravity_field_name = g  &
   x_component_gravity = 0.0  &
   y_component_gravity = 0.0  &
   z_component_gravity = -9.81
defaults coordinate_system  &
   default_coordinate_system = .m.ground
marker create  &
   marker_name = .m.ground.seat  &
   location = 0.0, 0.0, 2.0  &
   orientation = 0.0, 90.0, 0.0
part create rigid_body name_and_position  &
   part_name = .m.bob  &
   location = 0.0, 0.0, 2.0  &
   orientation = 0.0, 90.0, 0.0d
defaults coordinate_system  &
   default_coordinate_system = .m.bob
marker create  &
   marker_name = .m.bob.axis  &
   location = 0.0, 0.0, 0.0
marker create  &
   marker_name = .m.bob.cm  &
   location = 0.5, 0.0, 0.1
part create rigid_body mass_properties  &
   part_name = .m.bob  &
   mass = 3.0  &
   center_of_mass_marker = .m.bob.cm  &
   ixx = 0.1  &
   iyy = 0.2  &
   izz = 0.25  &
   ixy = 0.03  &
   izx = 0.01  &
   iyz = -0.02
constraint create joint revolute  &
   joint_name = .m.hinge  &
   i_marker_name = .m.bob.axis  &
   j_marker_name = .m.ground.seat
force create element_like rotational_spring_damper  &
   spring_damper_name = .m.spring  &
   i_marker_name = .m.bob.axis  &
   j_marker_name = .m.ground.seat  &
   damping = 0.06981317007977318  &
   stiffness = 0.8726646259971648  &
   preload = 2.0  &
   displacement_at_preload = 5.729577951308232
output_control create request  &
   request_name = .m.look  &
   component_names = "", "angle", "height"  &
   f2 = "AZ(.m.bob.axis,",  &
        ".m.ground.seat)"  &
   f3 = "DZ(.m.bob.cm,.m.ground.seat,.m.ground.seat)"
"""


@pytest.fixture(params=["dataset", "commands"])
def pendulum(request, readers):
    reader = getattr(readers, request.param)
    return reader.read(PENDULUM if request.param == "dataset" else COMMANDS)


def test_a_pendulum_weighs_what_a_pendulum_weighs(pendulum):
    machine, start = pendulum.machine()
    assert start == pytest.approx([0.0], abs=1e-15)
    # z of the marker points along -y of the world: x stays, y goes up
    for q in (0.0, 0.7, -2.0):
        assert machine.mass_matrix([q]) == pytest.approx(0.25 + 3.0 * 0.5**2)
        assert machine.gravity([q]) == pytest.approx(3.0 * 9.81 * 0.5 * math.cos(q))


def test_a_spring_pulls_back_and_is_per_radian(pendulum):
    machine, _ = pendulum.machine()
    state = machine.state([0.3], np.array([0.2]))
    torque = machine.efforts(state, pendulum.efforts(machine))
    assert torque == pytest.approx(-50.0 * 0.2 - 4.0 * 0.2 + 2.0)


def test_requests_answer(pendulum):
    machine, _ = pendulum.machine()
    name = next(iter(pendulum.requests))
    assert pendulum.request(name, machine.state([0.4])) == pytest.approx({"angle": 0.4, "height": 0.1})


def test_products_of_inertia_have_adams_sign(readers):
    """A point mass at (1, 2, 3) m from the center: its integral of xy is +2."""
    body = readers.dataset.read(PENDULUM)._body("2", readers.dataset.read(PENDULUM).parts["2"])
    assert body.tensor[0, 1] == -0.03
    assert body.tensor[0, 2] == -0.01
    assert body.tensor[1, 2] == 0.02


def test_a_pendulum_swings_at_its_frequency(readers):
    found = readers.dataset.read(PENDULUM.replace("-9.81", "0.0").replace(", + 2.0\n", "").replace("4.0*WZ", "0.0*WZ"))
    machine, _ = found.machine()
    times = np.linspace(0.0, 1.0, 11)
    q = machine.run([0.2], times, found.efforts(machine), error=1.0e-8)
    assert q[:, 0] == pytest.approx(0.1 + 0.1 * np.cos(math.sqrt(50.0) * times), abs=1e-5)


def test_two_pendulums_are_the_textbooks(readers):
    """Point masses m1, m2 on rods l1, l2, relative angles: M11 = m1 l1^2 + m2 (l1^2 + l2^2 + 2 l1 l2 cos q2)."""
    multibody = readers.multibody
    m1, m2, l1, l2 = 1.3, 0.7, 0.8, 0.5
    bodies = {
        "one": multibody.Body(m1, np.array([l1, 0.0, 0.0]), np.zeros((3, 3))),
        "two": multibody.Body(m2, np.array([l2, 0.0, 0.0]), np.zeros((3, 3))),
    }
    elbow = multibody.frame(None, (l1, 0.0, 0.0))
    links = [
        multibody.Link("two", "revolute", "one", elbow, "two", np.eye(4)),
        multibody.Link("one", "revolute", "ground", np.eye(4), "one", np.eye(4)),
    ]
    machine = multibody.Machine(bodies, links, (0.0, -9.81, 0.0))
    assert machine.names == ["one", "two"]
    q, dq = np.array([0.4, -0.9]), np.array([1.1, -0.6])
    matrix, bias = machine.equations(machine.state(q, dq))
    c, s = math.cos(q[1]), math.sin(q[1])
    assert matrix[0, 0] == pytest.approx(m1 * l1**2 + m2 * (l1**2 + l2**2 + 2.0 * l1 * l2 * c))
    assert matrix[0, 1] == pytest.approx(m2 * (l2**2 + l1 * l2 * c))
    assert matrix[1, 0] == pytest.approx(matrix[0, 1], rel=1e-14)
    assert matrix[1, 1] == pytest.approx(m2 * l2**2)
    weight = 9.81 * np.array(
        [(m1 + m2) * l1 * math.cos(q[0]) + m2 * l2 * math.cos(q.sum()), m2 * l2 * math.cos(q.sum())]
    )
    swing = m2 * l1 * l2 * s * np.array([-(2.0 * dq[0] * dq[1] + dq[1] ** 2), dq[0] ** 2])
    assert bias == pytest.approx(weight + swing)


def test_a_slider_on_a_turntable_feels_coriolis(readers):
    multibody = readers.multibody
    bodies = {
        "table": multibody.Body(0.0, np.zeros(3), np.diag([1.0, 1.0, 2.0])),
        "slider": multibody.Body(3.0, np.zeros(3), np.zeros((3, 3))),
    }
    outwards = multibody.frame(multibody.about(1, math.pi / 2.0))
    links = [
        multibody.Link("turn", "revolute", "ground", np.eye(4), "table", np.eye(4)),
        multibody.Link("slide", "prismatic", "table", outwards, "slider", np.eye(4)),
    ]
    machine = multibody.Machine(bodies, links, (0.0, 0.0, 0.0))
    matrix, bias = machine.equations(machine.state([0.3, 0.5], np.array([2.0, 0.4])))
    assert matrix == pytest.approx(np.diag([2.0 + 3.0 * 0.25, 3.0]))
    assert bias == pytest.approx([2.0 * 3.0 * 0.5 * 2.0 * 0.4, -3.0 * 0.5 * 4.0])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.0E-3 + 2*3", 6.001),
        ("-2.0**2", -4.0),
        ("2.0*(-3.0)", -6.0),
        ("90D", math.pi / 2.0),
        ("1.0D0*180.0d", math.pi),
        ("MAX(-1.0,MIN(2.0,TIME))", 0.5),
        ("IF(TIME - 1.0:7.0,8.0,9.0)", 7.0),
        ("IF(TIME - 0.5:7.0,8.0,9.0)", 8.0),
        ("TANH(TIME/2.0) - SIN(PI)", math.tanh(0.25)),
        ("8/4/2", 1.0),
    ],
)
def test_expressions_mean_what_they_say(readers, text, value):
    class Scope:
        time = 0.5

    assert readers.expressions.Expression(text)(Scope()) == pytest.approx(value, abs=1e-15)


def test_angles_are_body_fixed_3_1_3(readers):
    """Rz(90) Rx(90): x goes to y, z to x."""
    r = readers.model.body313((math.pi / 2.0, math.pi / 2.0, 0.0))
    assert r == pytest.approx(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), abs=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("LENGTH = METER", "LENGTH = MILLIMETER", "not SI"),
        ("END\n", "", "no END"),
        ("PART/1, GROUND", "PART/1, GROUND\nPART/7, GROUND", "GROUND exactly once"),
        ("JOINT/1, REVOLUTE", "GIMBAL/1", "unknown statement"),
        ("90D", "45D", "do not stand on each other"),
        (", REULER = 0.0, 90D, 0.0\n", "", "do not stand on each other"),
        ("QG = 0, 0, 2.0", "QG = 0, 0, 1.9", "do not stand on each other"),
        ("AZ(2,1) -", "AZQ(2,1) -", "unknown function"),
    ],
)
def test_broken_datasets_are_found(readers, old, new, complaint):
    with pytest.raises(AssertionError, match=complaint):
        found = readers.dataset.read(PENDULUM.replace(old, new))
        machine, _ = found.machine()
        found.efforts(machine)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("default_coordinate_system = .m.bob", "default_coordinate_system = .m.ground", "a marker on another part"),
        ("model create", "model make", "unknown command"),
        ("orientation = 0.0, 90.0, 0.0\npart", "orientation = 0.0, 1.5707963, 0.0\npart", "do not stand on each other"),
        (".m.bob.cm  &\n   ixx", ".m.bob.center  &\n   ixx", "comes later"),
        ("mass = 3.0  &\n", "mass = 3.0  &\n! why\n", "a comment inside"),
    ],
)
def test_broken_commands_are_found(readers, old, new, complaint):
    assert old in COMMANDS
    with pytest.raises(AssertionError, match=complaint):
        readers.commands.read(COMMANDS.replace(old, new)).machine()
