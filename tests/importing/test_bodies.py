"""The nearest possible body, against a general optimiser, and solids against numerical integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from mbexport.core.database.bodies import fault_of
from mbexport.core.importing.bodies import LEAST_GYRATION, LEAST_MASS, put_together, repaired
from mbexport.core.importing.geoms import Solid
from mbexport.core.representation import Inertia, Pose

RNG = np.random.default_rng(5)


def turned(moments: np.ndarray, seed: int) -> Inertia:
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return Inertia.from_tensor(2.0, np.array([0.1, -0.2, 0.3]), axes @ np.diag(moments) @ axes.T)


@pytest.mark.parametrize(
    "moments",
    [
        [1.0, 1.0, 3.0],
        [0.1, 0.2, 5.0],
        [-1.0, 1.0, 1.0],
        [-0.5, -0.2, 1.0],
        [0.0, 0.0, 1.0],
        [-1.0, -1.0, -1.0],
        [0.0] * 3,
    ],
)
def test_the_repair_is_the_nearest_body(moments: list[float]) -> None:
    broken = turned(np.array(moments), 1)
    mended = repaired(broken).body
    assert fault_of(mended) is None
    low, middle, high = np.linalg.eigvalsh(mended.tensor())
    assert high <= low + middle
    assert (mended.mass, mended.com) == (broken.mass, broken.com)

    def distance(entries: np.ndarray) -> float:
        return float(np.sum((symmetric(entries) - broken.tensor()) ** 2))

    least = broken.mass * LEAST_GYRATION**2
    # nothing is assumed here of axes or moments: any six entries, kept possible
    constraints = [
        {"type": "ineq", "fun": lambda e: np.linalg.eigvalsh(symmetric(e))[0] - least},
        {"type": "ineq", "fun": lambda e: np.array([1.0, 1.0, -1.0]) @ np.linalg.eigvalsh(symmetric(e))},
    ]
    best = min(
        (minimize(distance, start, method="SLSQP", constraints=constraints, options={"ftol": 1e-14, "maxiter": 500})
         for start in (entries_of(mended.tensor()), entries_of(mended.tensor() + np.eye(3)))),
        key=lambda result: result.fun,
    )  # fmt: skip
    assert distance(entries_of(mended.tensor())) <= best.fun + 1e-6


def symmetric(e: np.ndarray) -> np.ndarray:
    return np.array([[e[0], e[3], e[4]], [e[3], e[1], e[5]], [e[4], e[5], e[2]]])


def entries_of(tensor: np.ndarray) -> np.ndarray:
    return np.array([tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]])


def test_a_possible_body_is_left_alone() -> None:
    body = turned(np.array([1.0, 2.0, 2.5]), 3)
    assert repaired(body).body == body


def test_mass_is_given_where_there_is_none() -> None:
    mended = repaired(Inertia())
    assert mended.body.mass == LEAST_MASS
    assert fault_of(mended.body) is None
    assert "mass 0.0 -> 0.001 kg" in mended.changes


def test_the_repair_says_by_how_much() -> None:
    assert "1.000000e+00, 1.000000e+00, 3.000000e+00" in repaired(Inertia(1.0, xx=1.0, yy=1.0, zz=3.0)).changes


def test_bodies_add_up_as_point_masses_do() -> None:
    points, weights = RNG.normal(size=(6, 3)), RNG.uniform(0.1, 2.0, size=6)

    def cloud(chosen: slice) -> Inertia:
        p, w = points[chosen], weights[chosen]
        com = w @ p / w.sum()
        tensor = sum(
            m * ((x - com) @ (x - com) * np.eye(3) - np.outer(x - com, x - com)) for m, x in zip(w, p, strict=True)
        )
        return Inertia.from_tensor(float(w.sum()), com, np.asarray(tensor))

    whole, parts = cloud(slice(0, 6)), put_together([cloud(slice(0, 2)), cloud(slice(2, 3)), cloud(slice(3, 6))])
    np.testing.assert_allclose(parts.tensor(), whole.tensor(), atol=1e-14)
    np.testing.assert_allclose(parts.com, whole.com, atol=1e-15)


def test_far_from_the_origin_nothing_cancels() -> None:
    half = Inertia(1.0, xx=1e-6, yy=1e-6, zz=1e-6)
    far = Pose((0.0, 0.0, 1e4))
    both = put_together([half.moved(far), half.moved(far)])
    assert (both.xx, both.yy, both.zz) == (2e-6, 2e-6, 2e-6)


@pytest.mark.parametrize(
    ("solid", "inside"),
    [
        (Solid("sphere", (0.3,)), lambda x, y, z: x**2 + y**2 + z**2 < 0.09),
        (Solid("capsule", (0.2, 0.3)), lambda x, y, z: x**2 + y**2 + np.maximum(np.abs(z) - 0.3, 0.0) ** 2 < 0.04),
        (Solid("cylinder", (0.2, 0.3)), lambda x, y, z: (x**2 + y**2 < 0.04) & (np.abs(z) < 0.3)),
        (Solid("ellipsoid", (0.2, 0.3, 0.4)), lambda x, y, z: (x / 0.2) ** 2 + (y / 0.3) ** 2 + (z / 0.4) ** 2 < 1.0),
        (Solid("box", (0.2, 0.3, 0.4)), lambda x, y, z: (np.abs(x) < 0.2) & (np.abs(y) < 0.3) & (np.abs(z) < 0.4)),
    ],
    ids=lambda value: value.kind if isinstance(value, Solid) else "",
)
def test_solids_weigh_what_their_points_do(solid: Solid, inside: object) -> None:
    step = 0.0125
    grid = np.arange(-0.6 + step / 2, 0.6, step)
    x, y, z = np.meshgrid(grid, grid, grid, indexing="ij")
    full = inside(x, y, z)  # type: ignore[operator]
    x, y, z = x[full], y[full], z[full]
    assert solid.volume() == pytest.approx(len(x) * step**3, rel=0.02)
    body = solid.inertia(3.0)
    assert body.mass == 3.0
    for moment, square in ((body.xx, y**2 + z**2), (body.yy, x**2 + z**2), (body.zz, x**2 + y**2)):
        assert moment == pytest.approx(3.0 * float(square.mean()), rel=0.02)
