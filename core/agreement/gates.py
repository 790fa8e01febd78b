"""How near is near enough: a limit for every signal and kind of integrator, with where it comes from.

Measured on the paper's arm (reach 1.7 m), every engine against Pinocchio with DOP853 and Radau at 1e-12; each limit
leaves a factor of two or more over what was reached. Lengths scale with the robot's reach; the error of a first-order
integrator scales with its step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..simulation.backend import Backend

Manner = Literal["algebra", "explicit", "implicit", "first", "extrapolated", "halved"]
"""How a voice came to its numbers: no integration at all, an explicit method of order four or a variable step,
a second-order implicit one, a first-order one as it runs, or that one extrapolated from two steps (Richardson); halved:
any of them at half its step, where play opens and closes."""

OPEN = 2.0
"""Where play opens and closes, a run at half its step may be off by this many times what halving its step changed. With
errors of first order that is once; twice, for every meeting with an edge leaves an error of its own."""

PAPER_REACH = 1.7
"""Reach of the arm that the limits were measured on [m]."""

ORDER_TOLERANCE = 0.1
"""How far the observed order of a first-order integrator may be from one."""

ORDER_FLOOR = 100.0
"""The order is judged where the error at the smaller step is this many times the error that no step removes."""


@dataclass(frozen=True, slots=True)
class Gate:
    """The limits of one signal.

    Attributes:
        signal: Its name.
        unit: "m" (scales with reach), "rad", or "1": relative.
        explicit: Limit between voices of order four, with a variable step, or without integration.
        implicit: Limit where a second-order implicit integrator takes part.
        first: Limit where a first-order integrator takes part, at `first_step`; grows with the step.
        first_step: The step [s] that `first` is for; 0: any.
        extrapolated: Limit for that integrator extrapolated from two steps.
        absolute: Added to a relative limit [rad, or m at PAPER_REACH].
        reached: What was reached when it was set, and how.
    """

    signal: str
    unit: str
    explicit: float
    implicit: float
    first: float
    first_step: float
    extrapolated: float
    absolute: float = 0.0
    absolute_first: float = 0.0
    reached: str = ""


def _algebra(signal: str, unit: str, limit: float, reached: str) -> Gate:
    return Gate(signal, unit, limit, limit, limit, 0.0, limit, reached=reached)


GATES: dict[str, Gate] = {
    gate.signal: gate
    for gate in (
        _algebra("tool_position", "m", 1e-12, "1e-15 m in all engines"),
        _algebra("tool_orientation", "rad", 1e-12, "1e-15 in all engines"),
        _algebra("mass_matrix", "1", 1e-10, "8e-13 MuJoCo, 1e-13 Exudyn, 2e-14 PyBullet with principal axes"),
        _algebra("gravity", "1", 1e-10, "as the mass matrix"),
        _algebra("bias", "1", 1e-10, "as the mass matrix"),
        _algebra("inverse_dynamics", "1", 1e-10, "as the mass matrix"),
        _algebra("motor_inertia", "1", 1e-10, "numbers read back from the export"),
        _algebra("drive_torque", "1", 1e-10, "one law compiled once, on numbers read back from the export"),
        _algebra("acceleration", "1", 1e-5, "extrapolated from steps of 1/64, 1/128 and 1/256 of a run's"),
        _algebra("static_sag", "1", 1e-9, "solved with each engine's own gravity and springs, so no step limits it"),
        _algebra("knots", "rad", 1e-12, "the text of a motion's table against the law that was read from it"),
        _algebra("followed", "rad", 1e-12, "the exercise's own formula against what the motor sides followed"),
        _algebra("control_torque", "1", 1e-9, "the controller's law at every tick against the torque that was given"),
        _algebra("imposed_torque", "1", 1e-10, "inverse dynamics along the motion"),
        Gate("imposed_tip", "m", 1e-12, 1e-12, 1e-12, 0.0, 1e-12, reached="kinematics along the motion"),
        Gate(
            "rigid_loop_tip", "m", 1e-9, 5e-7, 2.5e-4, 1e-3, 1e-6,
            reached="RK4 5e-11, generalised-alpha 1.3e-7, first order 1e-4 at 1 ms, extrapolated 2e-7",
        ),
        Gate(
            "compliant_tip", "m", 1e-6, 1e-6, 5e-5, 1e-4, 1e-7,
            reached="RK4 1e-12, implicit 2.6e-7, first order 3.5e-6 at 0.1 ms, extrapolated 1e-9",
        ),
        Gate(
            "deflection", "1", 1e-3, 1e-3, 3e-2, 1e-4, 1e-3, absolute=1e-8, absolute_first=1e-7,
            reached="of its peak, and an absolute part",
        ),
        Gate(
            "loop_tip", "m", 1e-8, 2e-5, 5e-5, 1e-4, 1e-6,
            reached="RK4 6e-14, first order 1.2e-5 at 0.1 ms, extrapolated 4e-9",
        ),
        Gate(
            "friction_tip", "m", 1e-8, 2e-5, 5e-5, 1e-4, 1e-6,
            reached="one smooth law: RK4 4e-10, first order 1.3e-5 at 0.1 ms, extrapolated 1e-7",
        ),
        _algebra("stick_tip", "m", 5e-5, "friction that sticks: RK4 2e-14, first order 8e-6 at 0.1 ms or less"),
    )
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Limit:
    """A gate for one pair of voices.

    Attributes:
        value: In the signal's unit; of relative signals a plain number.
        absolute: Added to a relative limit [rad, or m at PAPER_REACH].
        manner: The less exact of the two, which decides.
    """

    value: float
    absolute: float
    manner: Manner


def limit(signal: str, manners: tuple[Manner, Manner], *, reach: float, step: float, narrow: bool = True) -> Limit:
    """The limit of a signal between two voices.

    Args:
        signal: A name of GATES.
        manners: How each of the two came to its numbers.
        reach: Of the robot [m].
        step: Of the first-order one [s], where there is one.
        narrow: The one of higher order is known to be exact enough for an extrapolated one's gate, where that is the
            narrower of the two.
    """
    gate = GATES[signal]
    lengths = reach / PAPER_REACH if gate.unit == "m" else 1.0
    values: dict[Manner, tuple[float, float]] = {
        "algebra": (gate.explicit, gate.absolute),
        "explicit": (gate.explicit, gate.absolute),
        "implicit": (gate.implicit, gate.absolute),
        "first": (gate.first * (step / gate.first_step if gate.first_step else 1.0), gate.absolute_first),
        "extrapolated": (gate.extrapolated, gate.absolute_first),
        # what is open is added by who knows it
        "halved": (gate.explicit, gate.absolute),
    }
    rough: list[Manner] = [manner for manner in manners if narrow and manner not in ("algebra", "explicit")]
    rough = rough or list(manners)
    worse = max(rough, key=lambda manner: values[manner][0])
    absolute = max(values[manner][1] for manner in rough)
    return Limit(values[worse][0] * lengths, absolute, worse)


def manner_of(backend: Backend) -> Manner:
    """How a backend's runs come to their numbers."""
    if backend.gate_class == "B":
        return "first"
    return "implicit" if backend.order == 2 else "explicit"
