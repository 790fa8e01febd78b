"""What is seen after a control was moved; no page is needed."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.errors import UsageError
from mbexport.core.kinematics import tool_in_base
from mbexport.core.motion import hold, point_to_point
from mbexport.core.simulation import simulate
from mbexport.core.studio import Bench
from mbexport.core.studio.guard import is_loopback, may_talk
from mbexport.core.studio.paths import rigid_of, run_paths
from mbexport.core.studio.posture import Postures
from mbexport.core.studio.scene import _cylinder
from mbexport.core.studio.words import changes, readout
from mbexport.core.studio.worker import Latest
from mbexport.core.study.values import Place

STIFFNESS = Place("joint_compliance", "stiffness", "joint", 2)


def test_a_robot_at_rest_is_where_its_simulation_rests():
    bench = Bench.of(mbexport.load("imece2013"))
    robot = bench.robot()
    theta = np.array(robot.home()) + 0.2
    posture = Postures.of(robot, rigid_of(bench)).at(theta)
    run = simulate(robot, "urdf", hold(tuple(theta), 0.01), rate=100.0)
    assert posture.tool == pytest.approx(run.tool_in_base[-1], abs=1e-9)
    expected = run.tip[-1] - np.asarray(tool_in_base(robot, theta))[:3, 3]
    assert posture.error == pytest.approx(expected, abs=1e-9)
    assert np.linalg.norm(posture.error) > 1e-4


def test_bearings_and_bends_sag_with_their_arms():
    bench = Bench.of(mbexport.load("imece2013"), "rigid").changed(Place("link_flexibility", "ku", "arm", 2), 5.0e4)
    robot = bench.robot()
    theta = np.array(robot.home())
    posture = Postures.of(robot, rigid_of(bench)).at(theta)
    run = simulate(robot, "urdf", hold(tuple(theta), 0.01), rate=100.0)
    assert posture.tool == pytest.approx(run.tool_in_base[-1], abs=1e-9)
    assert np.linalg.norm(posture.arms[-1] - posture.rigid_arms[-1]) > 1e-4


def test_paths_are_the_runs(bench):
    home = np.array(bench.robot().home())
    motion = point_to_point(home, home + 0.3, 0.5)
    paths = run_paths(bench, motion, "motion", "urdf")
    run = simulate(bench.robot(), "urdf", motion, rate=1000.0)
    assert paths.real == pytest.approx(run.tip)
    assert paths.rigid == pytest.approx(np.asarray(tool_in_base(bench.robot(), motion.at(paths.t)[0]))[:, :3, 3])
    assert paths.distance.max() > 1e-5
    assert paths.magnified(3.0) - paths.rigid == pytest.approx(3.0 * paths.error)
    rigid = bench
    for name in bench.effects:
        rigid = rigid.switched(name, False)
    assert run_paths(rigid, motion, "motion", "urdf").distance.max() < 1e-9
    followed = run_paths(bench, motion, "pd", "urdf")
    assert followed.distance.max() > paths.distance.max()


def test_sliders_are_seen_at_once_and_along_the_motion(session):
    seen = []
    session._show = seen.append
    session.run()
    before = session.settle()
    session.change(STIFFNESS, 0.25 * session.bench.nominal(STIFFNESS))
    after = session.settle()
    assert np.linalg.norm(after.posture.error) > 1.5 * np.linalg.norm(before.posture.error)
    assert after.paths.distance.max() > 1.5 * before.paths.distance.max()
    assert not after.running
    assert seen[-1] is after
    session.reset()
    assert session.settle().posture.error == pytest.approx(before.posture.error, abs=1e-12)
    session.place_joint(1, 0.5)
    assert session.settle().posture.theta[1] == 0.5


def test_what_cannot_be_is_said_and_the_last_robot_stays(session):
    good = session.settle()
    session.change(Place("inertia", "mass", "arm", 1), -3.0)
    bad = session.settle()
    assert "a mass is above zero" in bad.problem or "minimum" in bad.problem or "must" in bad.problem
    assert bad.robot.stages == good.robot.stages
    session.change(Place("inertia", "mass", "arm", 1), 3.0)
    assert session.settle().problem == ""


def test_springs_too_soft_to_stand_on_are_said(session):
    session.change(STIFFNESS, 1.0e-6)
    assert "too soft" in session.settle().problem


def test_the_motion_can_be_stopped_at_any_instant(session):
    session.choose_motion("excitation")
    view = session.settle()
    session.place_at(0.4 * session.duration)
    view = session.settle()
    k = int(np.argmin(np.abs(view.paths.t - view.time)))
    assert view.posture.tool[:3, 3] == pytest.approx(view.paths.real[k], abs=1e-9)
    session.place_joint(0, 0.1)
    assert session.settle().time is None


def test_a_motion_that_is_none_is_a_problem_to_be_seen(session):
    session.choose_motion("nothing")
    assert "no motion 'nothing'" in session.settle().problem


def test_saves_and_exports_write_over_nothing(session):
    session.change(STIFFNESS, 500.0)
    folders = [session.save(), session.save(), session.export(["urdf"]), session.export(["urdf"])]
    assert [folder.name for folder in folders] == ["database-1", "database-2", "export-1", "export-2"]
    assert (folders[2] / "planar2r.urdf").is_file()
    with pytest.raises(UsageError, match="choose a format"):
        session.export([])


def test_the_readout_says_numbers_and_nothing_of_strangers_runs(session):
    session.run()
    session.change(STIFFNESS, 500.0)
    view = session.settle()
    text = readout(view, "hold", 5.0)
    assert f"{1e3 * np.linalg.norm(view.posture.error):.3f} mm" in text
    assert "5 times larger" in text
    assert "joint_compliance.stiffness@joint_2" in changes(view)
    assert "<script>" not in readout(replace(view, problem="<script>"), "<script>", 1.0)


def test_only_what_was_asked_for_last_is_told():
    told, gate = [], threading.Event()
    worker = Latest(told.append)
    worker.ask(lambda: gate.wait(5.0) and 1)
    time.sleep(0.05)
    worker.ask(lambda: 2)
    worker.ask(lambda: 3)
    gate.set()
    assert worker.idle(5.0)
    assert told == [3]
    worker.close()


def test_a_pause_spares_jobs():
    told, ran = [], []
    worker = Latest(told.append, pause=0.1)
    for k in range(5):
        worker.ask(lambda k=k: ran.append(k) or k)
        time.sleep(0.01)
    assert worker.idle(5.0)
    assert ran == told == [4]
    worker.close()


@pytest.mark.parametrize(
    ("origin", "host", "loopback", "answer"),
    [
        ("http://127.0.0.1:8080", "127.0.0.1:8080", True, True),
        (None, "localhost:8080", True, True),
        ("http://evil.example", "127.0.0.1:8080", True, False),
        ("http://evil.example:8080", "evil.example:8080", True, False),
        ("http://127.0.0.1:9999", "127.0.0.1:8080", True, False),
        ("null", "127.0.0.1:8080", True, False),
        ("http://robot.lan:8080", "robot.lan:8080", False, True),
        ("http://evil.example", "robot.lan:8080", False, False),
        (None, None, True, False),
    ],
)
def test_only_the_page_itself_may_talk(origin, host, loopback, answer):
    assert may_talk(origin, host, loopback=loopback) is answer


def test_cylinders_are_closed_and_look_outwards():
    vertices, faces = _cylinder(0.1, 0.5)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    # volume by the divergence theorem is positive where all triangles look outwards
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(np.pi * 0.1**2 * 0.5, rel=0.01)
    normals = np.cross(b - a, c - a)
    assert (np.einsum("ij,ij->i", normals, a + b + c) > 0.0).all()


def test_loopback():
    assert [is_loopback(h) for h in ("127.0.0.1", "localhost", "::1", "[::1]", "0.0.0.0", "lan")] == [True] * 4 + [
        False
    ] * 2
