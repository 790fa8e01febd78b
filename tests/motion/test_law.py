"""Motion laws against finite differences, against SciPy's splines, and against their compiled text."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

from mbexport.core.errors import RunFileError
from mbexport.core.kinematics.compiled import compiled
from mbexport.core.motion import MotionLaw, evaluate, from_table, hold, motion_at, point_to_point

RNG = np.random.default_rng(7)
T = np.cumsum(RNG.uniform(0.1, 0.3, size=20))
Q, DQ, DDQ = RNG.normal(size=(3, 20, 3))
LAWS = {
    "akima": from_table(T, Q),
    "cubic": from_table(T, Q, DQ),
    "quintic": from_table(T, Q, DQ, DDQ),
    "hold": hold([0.1, 0.2, 0.3], 2.0),
    "point to point": point_to_point([0.0, 0.0, 0.0], [1.0, -1.0, 0.5], 2.0),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_speed_and_acceleration_are_the_derivatives(law: MotionLaw) -> None:
    h = 1e-5
    inner = RNG.uniform(law.knots[0], law.knots[-1], size=300)
    away = np.abs(inner[:, None] - law.knots).min(axis=1) > 2 * h
    t = inner[away]
    q, dq, ddq = law.at(t)
    (before, before_speed, _), (after, after_speed, _) = law.at(t - h), law.at(t + h)
    scale = 1.0 + np.abs(ddq).max()
    assert np.allclose((after - before) / (2 * h), dq, atol=1e-7 * scale)
    assert np.allclose((after_speed - before_speed) / (2 * h), ddq, atol=1e-6 * scale)
    assert q.shape == dq.shape == ddq.shape == (len(t), 3)


def test_knots_are_kept() -> None:
    for name, count in (("akima", 1), ("cubic", 2), ("quintic", 3)):
        for got, want in zip(LAWS[name].at(T)[:count], (Q, DQ, DDQ), strict=False):
            # at the last knot the piece before it is evaluated at its end
            assert np.array_equal(got[:-1], want[:-1])
            assert np.allclose(got[-1], want[-1], rtol=1e-12, atol=1e-12)


def test_the_last_instant_is_no_rest_though_rounding_puts_it_behind_the_end() -> None:
    """A log that begins at 2.668 s and ends at 4 s lasts 1.3319999999999999 s for a clock that ticks at 1.332 s."""
    end = T[-1]
    for law in (LAWS["cubic"], LAWS["quintic"]):
        q, dq, ddq = (np.empty(3) for _ in range(3))
        motion_at(end + 2e-16 * end, law.table(), q, dq, ddq)
        assert np.allclose(dq, DQ[-1])
        assert np.allclose(law.at(end + 2e-16 * end)[1], DQ[-1])
        motion_at(end + 1e-6, law.table(), q, dq, ddq)
        assert not dq.any()
        assert not law.at(end + 1e-6)[1].any()


def test_continuity_is_what_the_table_gives() -> None:
    eps = 1e-12
    for name, smooth in (("akima", 1), ("cubic", 1), ("quintic", 2)):
        before, after = LAWS[name].at(T[1:-1] - eps), LAWS[name].at(T[1:-1])
        for order in range(smooth + 1):
            assert np.allclose(before[order], after[order], atol=1e-7)
        if smooth == 1:
            assert np.abs(before[2] - after[2]).max() > 0.1


def test_are_the_splines_of_scipy() -> None:
    t = RNG.uniform(T[0], T[-1], size=100)
    assert np.allclose(LAWS["akima"].at(t)[0], Akima1DInterpolator(T, Q)(t), rtol=0, atol=1e-12)
    assert np.allclose(LAWS["cubic"].at(t)[0], CubicHermiteSpline(T, Q, DQ)(t), rtol=0, atol=1e-12)


def test_quintic_reproduces_a_quintic() -> None:
    p = np.polynomial.Polynomial(RNG.normal(size=6))
    t = np.array([0.0, 0.7, 1.9])
    law = from_table(t, p(t)[:, None], p.deriv()(t)[:, None], p.deriv(2)(t)[:, None])
    fine = np.linspace(0, 1.9, 50)
    for got, want in zip(law.at(fine), (p, p.deriv(), p.deriv(2)), strict=True):
        assert np.allclose(got[:, 0], want(fine), rtol=0, atol=1e-11)


def test_rests_outside() -> None:
    law = LAWS["quintic"]
    for t, end in ((T[0] - 1.0, Q[0]), (T[-1] + 1.0, Q[-1])):
        q, dq, ddq = law.at(t)
        assert np.allclose(q, end, rtol=0, atol=1e-12)
        assert not dq.any()
        assert not ddq.any()


def test_goes_on_with_its_last_acceleration() -> None:
    t = np.linspace(0.0, 1.0, 6)
    law = from_table(t, np.sin(3.0 * t)[:, None], 3.0 * np.cos(3.0 * t)[:, None])
    longer = law.going_on(0.1)
    q, dq, ddq = law.at(1.0)
    for late in (0.02, 0.08):
        there = longer.at(1.0 + late)
        np.testing.assert_allclose(there[0], q + dq * late + 0.5 * ddq * late**2, atol=1e-14)
        np.testing.assert_allclose(there[1], dq + ddq * late, atol=1e-14)
        np.testing.assert_allclose(there[2], ddq, atol=1e-12)
    np.testing.assert_allclose(longer.at(t), law.at(t), atol=1e-12)
    assert (longer.at(1.2)[1] == 0.0).all() and (law.at(1.02)[1] == 0.0).all()
    np.testing.assert_array_equal(hold([0.3], 1.0).going_on(0.1).at(1.05)[0], [0.3])


def test_scalar_and_many_times() -> None:
    law = LAWS["akima"]
    q, dq, ddq = law.at(np.full((2, 4), 1.0))
    assert q.shape == dq.shape == ddq.shape == (2, 4, 3)
    assert law.at(1.0)[0].shape == (3,)
    assert np.array_equal(law.at(1.0)[0], q[1, 2])
    assert law.duration == T[-1]


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_plain_and_compiled_text_equal_the_law(law: MotionLaw) -> None:
    fast = compiled(evaluate.__name__)["motion_at"]
    table = law.table()
    times = np.concatenate([RNG.uniform(-1.0, law.duration + 1.0, size=30), law.knots[:5], law.knots[-2:]])
    want = law.at(times)
    for evaluated in (motion_at, fast):
        got = np.empty((3, law.n))
        for i, t in enumerate(times):
            evaluated(float(t), table, *got)
            for order in range(3):
                assert np.allclose(got[order], want[order][i], rtol=1e-14, atol=1e-14)


def test_shifted_moves_positions_only() -> None:
    law = LAWS["cubic"]
    for order, (moved, plain) in enumerate(zip(law.shifted([1.0, 2.0, 3.0]).at(T), law.at(T), strict=True)):
        assert np.allclose(moved - plain, [[1.0, 2.0, 3.0]] if order == 0 else 0.0, atol=1e-14)


def test_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        LAWS["cubic"].coefficients[0, 0, 0] = 1.0
    table = LAWS["cubic"].table()
    table.coefficients[0, 0, 0] = 1.0  # the caller's own copy
    assert LAWS["cubic"].coefficients[0, 0, 0] != 1.0


def test_point_to_point_rests_at_both_ends() -> None:
    law = LAWS["point to point"]
    q, dq, ddq = law.at([0.0, 1.0, 2.0])
    assert np.allclose(q, [[0, 0, 0], [0.5, -0.5, 0.25], [1, -1, 0.5]], atol=1e-14)
    assert np.allclose([dq[0], dq[2], ddq[0], ddq[2]], 0.0, atol=1e-12)
    assert dq[1, 0] == pytest.approx(1.875 / 2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0], [[1.0]]), "two times or more"),
        (([0.0, 1.0, 1.0], [[1.0]] * 3), r"row 3 has t = 1\.0 s after 1\.0 s"),
        (([0.0, 1.0], [[1.0]] * 3), r"shape \(3, 1\) do not fit"),
        (([0.0, 1.0], [[1.0], [math.nan]]), r"row 2 \(t = 1\.0 s\).*not finite"),
        (([0.0, 1.0], [[1.0], [2.0]], None, [[0.0], [0.0]]), "give dq too"),
    ],
)
def test_tables_that_make_no_motion(arguments: tuple, message: str) -> None:
    with pytest.raises(RunFileError, match=message):
        from_table(*arguments)
    with pytest.raises(RunFileError, match=r"^here\.dat: "):
        from_table(*arguments, source="here.dat")
