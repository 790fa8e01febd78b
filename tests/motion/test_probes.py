"""Small experiments stay where they may go, begin and end at rest, and are what their words say."""

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.motion import from_table
from mbexport.core.motion.probes import Room, one_after_the_other, probes, stretched

LENGTH = 8.0


def library(name):
    robot = build(load(name), "rigid")
    n = robot.n
    room = Room(np.full(n, 0.1), np.linspace(0.5, 0.2, n), np.linspace(1.2, 2.0, n), np.full(n, 8.0))
    return room, list(probes(robot, range(min(n, 2)), [8.0] * min(n, 2), tool=True))


@pytest.mark.parametrize("name", ["pendulum", "scara", "puma560"])
def test_every_motion_keeps_its_room_and_returns_to_rest(name):
    room, found = library(name)
    assert len({probe.words for probe in found}) >= len(found) - 2
    for probe in [*found, one_after_the_other(found[0], found[-1])]:
        law = probe.make(room, LENGTH)
        t = np.linspace(0.0, law.duration, 8001)
        q, dq, ddq = law.at(t)
        assert np.all(np.abs(q - room.centre) <= room.swing * (1.0 + 1e-6)), probe.words
        assert np.all(np.abs(dq) <= room.speed * (1.0 + 1e-6)), probe.words
        assert np.all(np.abs(ddq) <= room.acceleration * (1.0 + 1e-6)), probe.words
        assert np.allclose(q[[0, -1]], room.centre, atol=1e-12), probe.words
        assert np.allclose(dq[[0, -1]], 0.0, atol=1e-12), probe.words
        assert np.ptp(q, axis=0).max() > 0.005, probe.words
        # speeds without jumps
        assert np.abs(np.diff(dq, axis=0)).max() <= 1.01 * room.acceleration.max() * t[1], probe.words


def test_a_sweep_holds_several_speeds_of_both_signs():
    room, found = library("pendulum")
    law = next(p for p in found if "several constant speeds" in p.words).make(room, LENGTH)
    t = np.linspace(0.0, law.duration, 20001)
    dq, ddq = (values[:, 0] for values in law.at(t)[1:])
    constant = np.round(dq[np.abs(ddq) < 1e-9], 6)
    speeds = sorted({speed for speed in constant if (constant == speed).sum() > 20 and speed})
    assert len(speeds) >= 6
    assert min(speeds) == -max(speeds)


def test_a_stretched_motion_goes_the_same_way():
    room, found = library("pendulum")
    law = found[0].make(room, LENGTH)
    slow = stretched(law, 1.6)
    t = np.linspace(0.0, law.duration, 50)
    assert slow.duration == pytest.approx(1.6 * law.duration)
    for power, (one, other) in enumerate(zip(law.at(t), slow.at(1.6 * t), strict=True)):
        assert np.allclose(one, 1.6**power * other, atol=1e-9)


def test_one_after_the_other_is_what_both_are():
    room, found = library("scara")
    both = one_after_the_other(found[0], found[4]).make(room, LENGTH)
    parts = [found[k].make(room, 0.5 * LENGTH) for k in (0, 4)]
    t = np.linspace(0.0, parts[1].duration - 1e-6, 40)
    assert np.allclose(both.at(parts[0].duration + t)[0], parts[1].at(t)[0], atol=1e-12)
    again = from_table(both.knots, *both.at(both.knots))
    assert np.allclose(again.at(t)[0], both.at(t)[0], atol=1e-6)
