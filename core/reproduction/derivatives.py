"""What it does that each code differentiates the motion law by itself (section 8 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics import dynamics, kinematics
from ..motion import MotionLaw, from_table
from ..representation import Robot
from ..simulation import Trace
from .case import Case
from .open_loop import rms
from .statics import damping, stiffness

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1.0e-3
"""Over which the code that takes differences takes them, backwards [s]."""
START = 0.4
"""After which the jolt of a spline that does not begin at rest has died away [s]."""
SPACING = 2.5e-4
"""Between the knots of the command that stands for a law with a speed of its own [s]."""

ALL_THREE = "all_three"
WORDS = {
    ALL_THREE: "rotation, speed and acceleration given (quintic pieces)",
    "akima": "rotation only, Akima's spline differentiated exactly",
    "cubic": "rotation only, a cubic spline differentiated exactly",
    "difference": "rotation only, Akima's spline, speed by backward differences",
}


@dataclass(frozen=True, slots=True, eq=False)
class Operator:
    """One way to come from rotations at knots to speeds and accelerations, against all three being given.

    Attributes:
        name: Key of WORDS.
        position: Largest error of the rotation [rad].
        speed: Largest error of the speed [rad/s].
        acceleration: Largest error of the acceleration [rad/s^2].
        torque: Largest error of a rigid joint's torque [N m].
        tip: How far it moves the elastic arm's tip at most [m]; 0 where all three are given.
        tip_rms: The same, root of the mean square [m].
        expected: The most that the springs and dampers at rest would make of the errors of rotation and speed,
            J (dq + b / K d(dq/dt)) [m].
        engines: How far the tips of two engines with this law are apart at most [m].
    """

    name: str
    position: float
    speed: float
    acceleration: float
    torque: float
    tip: float
    tip_rms: float
    expected: float
    engines: float | None

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "position_rad": self.position,
            "speed_rad_s": self.speed,
            "acceleration_rad_s2": self.acceleration,
            "rigid_torque_N_m": self.torque,
            "tip_m": {"rms": self.tip_rms, "largest": self.tip},
            "expected_tip_m": self.expected,
            "engines_apart_m": self.engines,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Derivatives:
    """The operators, and the paper's situation: two codes that differ in theirs.

    Attributes:
        t: Times [s], shape (m,).
        away: Operator -> distance of the tip from where it is with all three given [m], shape (m,).
        codes: Distance of the tips of two codes [m], shape (m,): one engine that differentiates the spline, another
            that takes differences.
        who: Names of those engines.
        operators: One of each way.
        largest_torque: Of a rigid joint with all three given [N m], for the scale.
    """

    t: Array
    away: dict[str, Array]
    codes: Array
    who: tuple[str, str]
    operators: tuple[Operator, ...]
    largest_torque: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "operators": {operator.name: operator.to_json() for operator in self.operators},
            "two_codes_m": {
                "rms": rms(self.codes),
                "largest": float(np.max(self.codes)),
                "largest_after_the_start": float(np.max(self.codes[self.t > START])),
                "between": list(self.who),
            },
            "difference_step_s": DIFFERENCE_STEP,
            "largest_rigid_torque_N_m": self.largest_torque,
        }


def derivatives(case: Case) -> Derivatives:
    """Imposed rotations at the knots of the first key, turned into speeds in several ways."""
    key = case.first_key()
    t = np.linspace(0.0, key.duration, round(key.duration / SPACING) + 1)
    laws = dict(_laws(case, key))
    signals = {name: law.at(t) for name, law in laws.items() if name != "difference"}
    signals["difference"] = _by_differences(laws["akima"], t)
    one, other = case.reference, case.backends[1 if len(case.backends) > 1 else 0]
    traces = {name: _run(case, name, law, one) for name, law in laws.items()}
    again = {name: _run(case, name, laws[name], other) for name in ("akima", "difference")} if other != one else {}
    base = traces[ALL_THREE]
    away = {name: _apart(trace, base) for name, trace in traces.items()}
    arms = dynamics(case.rigid)
    torque = {name: arms.inverse_dynamics(*values) for name, values in signals.items()}
    truth = signals[ALL_THREE]
    operators: list[Operator] = []
    for name in laws:
        off = [float(np.max(np.abs(a - b))) for a, b in zip(signals[name], truth, strict=True)]
        operators.append(
            Operator(
                name,
                position=off[0],
                speed=off[1],
                acceleration=off[2],
                torque=float(np.max(np.abs(torque[name] - torque[ALL_THREE]))),
                tip=float(np.max(away[name])),
                tip_rms=rms(away[name]),
                expected=_expected(case.compliant, truth, signals[name]),
                engines=float(np.max(_apart(traces[name], again[name]))) if name in again else None,
            )
        )
    codes = _apart(traces["akima"], again.get("difference", traces["difference"]))
    largest = float(np.max(np.abs(torque[ALL_THREE])))
    return Derivatives(base.t, away, codes, (one, other), tuple(operators), largest)


def _laws(case: Case, key: MotionLaw) -> Iterator[tuple[str, MotionLaw]]:
    """Name of each way, and the law that the drives follow."""
    from scipy.interpolate import CubicSpline

    t = key.knots
    q = key.at(t)[0]
    akima = from_table(t, q)
    yield ALL_THREE, key
    yield "akima", akima
    yield "cubic", MotionLaw(t, np.asarray(CubicSpline(t, q).c, dtype=np.float64))
    yield "difference", felt(case.compliant, akima, DIFFERENCE_STEP)


def backward(law: MotionLaw, t: Array, step: float) -> Array:
    """Speeds by backward differences over a step [s], shape (m, n)."""
    return (law.at(t)[0] - law.at(t - step)[0]) / step


def felt(robot: Robot, law: MotionLaw, step: float) -> MotionLaw:
    """The consistent law that the arms feel where a code follows a law with speeds by backward differences.

    Through its springs and dampers an arm feels K theta + b s, theta the rotation and s what the code holds for its
    speed. A law x with K x + b x' = K theta + b s is the same to it: e = x - theta follows b e' + K e = b (s - theta'),
    solved exactly for a right-hand side that is linear between knots.

    Args:
        robot: With springs and dampers in all joints.
        law: Rotations.
        step: Of the differences [s].
    """
    count = round(law.duration / SPACING)
    t = np.linspace(0.0, law.duration, count + 1)
    q, dq, _ = law.at(t)
    error = backward(law, t, step) - dq
    rate = stiffness(robot) / damping(robot)
    h = law.duration / count
    decay = np.exp(-rate * h)
    # response to a constant and to a ramp over one interval
    constant = (1.0 - decay) / rate
    ramp = (h - constant) / (rate * h)
    e = np.zeros_like(q)
    for k in range(count):
        e[k + 1] = decay * e[k] + constant * error[k] + ramp * (error[k + 1] - error[k])
    return from_table(t, q + e, dq + error - rate * e)


def _by_differences(law: MotionLaw, t: Array) -> tuple[Array, Array, Array]:
    """Rotation, speed and acceleration as a code holds them that takes differences of differences, shapes (m, n)."""
    speed, before = (backward(law, moment, DIFFERENCE_STEP) for moment in (t, t - DIFFERENCE_STEP))
    return law.at(t)[0], speed, (speed - before) / DIFFERENCE_STEP


def _run(case: Case, name: str, law: MotionLaw, backend: str) -> Trace:
    return case.run(f"motion law: {name}", case.compliant, backend, law, duration=law.duration)


def _apart(one: Trace, other: Trace) -> Array:
    """Distance of two tips [m], shape (m,)."""
    return np.linalg.norm(one.tip - other.tip, axis=1)


def _expected(robot: Robot, base: tuple[Array, Array, Array], other: tuple[Array, Array, Array]) -> float:
    """What springs and dampers at rest make of the difference of two laws [m]."""
    lag = damping(robot) / stiffness(robot)
    shift = other[0] - base[0] + lag * (other[1] - base[1])
    return float(
        np.max(np.linalg.norm(np.einsum("mij,mj->mi", kinematics(robot).jacobian(base[0])[:, :3], shift), axis=1))
    )
