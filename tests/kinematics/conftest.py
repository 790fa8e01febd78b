from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from mbexport.core.representation import Arm, Inertia, Joint, Pose, Robot, Stage, VeitscheggerWu


def _random_inertia(rng: np.random.Generator) -> Inertia:
    mass = float(rng.uniform(0.5, 20.0))
    points = rng.normal(size=(8, 3)) * rng.uniform(0.02, 0.3, size=3)
    points -= points.mean(axis=0)
    tensor = sum((p @ p) * np.eye(3) - np.outer(p, p) for p in points) * mass / len(points)
    return Inertia.from_tensor(mass, rng.uniform(-0.3, 0.3, size=3), np.asarray(tensor))


def make_random_robot(seed: int, n: int) -> Robot:
    """Both kinds of joint, beta and corrections that are allowed, a tilted base, a tool."""
    rng = np.random.default_rng(seed)
    kinds = ["prismatic" if rng.uniform() < 0.3 else "revolute" for _ in range(n)]

    def correction(kind: str) -> VeitscheggerWu:
        # what commutes with the joint's motion: turn and shift along the axis, and any shift across a slide
        a = float(rng.uniform(-0.2, 0.2)) if kind == "prismatic" else 0.0
        return VeitscheggerWu(a=a, theta=float(rng.uniform(-1, 1)), d=float(rng.uniform(-0.2, 0.2)))

    corrections = [correction(kind) for kind in kinds] + [VeitscheggerWu()]
    stages = tuple(
        Stage(
            Joint(f"joint_{i + 1}", kinds[i]),  # type: ignore[arg-type]  # a plain str in a test
            Arm(
                f"arm_{i + 1}",
                VeitscheggerWu(*(float(x) for x in rng.uniform(-1, 1, size=5) * (3.0, 0.5, 3.0, 0.5, 0.3))),
                corrections[i + 1],
                _random_inertia(rng),
            ),
        )
        for i in range(n)
    )
    base = Pose.from_rpy((0.1, -0.2, 0.3), tuple(rng.uniform(-math.pi, math.pi, size=3)))
    tool = Pose.from_rpy((0.05, 0.02, 0.1), (0.3, -0.4, 1.2))
    return Robot(f"random_{seed}", (0.3, -0.2, -9.81), base, corrections[0], stages, tool)


@pytest.fixture(scope="session")
def random_robot() -> Callable[[int, int], Robot]:
    return make_random_robot
