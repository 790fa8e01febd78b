"""The laws of a drive as function expressions of Adams."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.representation import Drive, Robot, Term
from .adams_model import Joint, Marker, Spring
from .law_expression import Dialect, law_expression

_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "log10")
ADAMS = Dialect(
    "**",
    {name: name.upper() for name in (*_FUNCTIONS, "sqrt", "abs", "max", "min")} | {"fabs": "ABS", "copysign": "SIGN"},
)


@dataclass(frozen=True, slots=True)
class Sides:
    """The joints of one stage.

    Attributes:
        motor: Between the part before and the motor side: the dummy part, or the arm where the joint is rigid.
        arm: Between the motor side and the arm, elastic; None where the joint is rigid.
        whole: Between the part before and the arm; no joint of the model, where the joint is elastic.
    """

    motor: Joint
    arm: Joint | None
    whole: Joint


def number(value: float) -> str:
    """A number as expressions write it."""
    return ADAMS.number(value)


def spring_torque(spring: Spring, joint: Joint) -> str:
    """A linear spring-damper as View exports it."""
    return (
        f"-{number(spring.stiffness)}*({joint.position} - {number(spring.rest)}) "
        f"- {number(spring.damping)}*{joint.velocity}"
    )


class DriveLaws:
    """The laws of one drive as expressions.

    Attributes:
        unsaid: Names of effects that have no expression here.
        error: Transmission error e, "" where there is none.
        wobble: de/dtheta, "" where there is none.
        transmitted: T that the spring passes to the arm; "" where the joint is rigid.
    """

    def __init__(self, robot: Robot, drive: Drive, sides: Sides) -> None:
        """Read the laws of a drive between these joints."""
        self._drive = drive
        self._velocity = robot.friction.velocity
        self._motor = sides.motor
        self._whole = sides.whole
        # what depends on two joints is no law of one
        self.unsaid = {term.effect for term in self._drive.terms if term.kind == "coupled"}
        self._values = {
            "t": "TIME",
            "theta": sides.motor.position,
            "dtheta": sides.motor.velocity,
            "q": sides.whole.position,
            "dq": sides.whole.velocity,
        }
        self.error = " + ".join(self._terms("error"))
        self.wobble = _bracketed(self._terms("error_slope"))
        self.transmitted = self._spring_torque(sides.arm) if sides.arm else ""
        if sides.arm:
            self._values["load"] = self.transmitted

    def resistances(self) -> list[str]:
        """What stands against the motor side, each to be subtracted."""
        drive, speed = self._drive, self._motor.velocity
        out = [f"{number(drive.damping)}*{speed}"] if drive.damping else []
        out += self._terms("resistance")
        level = self._terms("level")
        if level:
            out.append(f"{_bracketed(level)}*TANH({speed}/{number(self._velocity)})")
        return out

    def on_arm(self) -> list[str]:
        """What acts on the arm beside T, joined by signs."""
        springs = [
            f"- {number(spring.stiffness)}*({self._whole.position} - {number(spring.rest)})"
            for spring in self._drive.arm_springs
        ]
        return springs + [f"+ {term}" for term in self._terms("arm")]

    def _terms(self, kind: str) -> list[str]:
        found = [(term, self._expression(term)) for term in self._drive.terms if term.kind == kind]
        self.unsaid |= {term.effect for term, text in found if text is None}
        return [text for _, text in found if text is not None]

    def _expression(self, term: Term) -> str | None:
        return law_expression(term.effect, term.law, term.parameters, self._values, ADAMS)

    def _spring_torque(self, joint: Joint) -> str:
        spring = self._drive.spring
        assert spring is not None
        k, b = number(spring.stiffness), number(spring.damping)
        stretch, speed = f"-{joint.position}", f"-{joint.velocity}"
        if self.error:
            stretch = f"{self.error} - {joint.position}"
            speed = f"{self.wobble}*{self._motor.velocity} - {joint.velocity}" if self.wobble else speed
        if not spring.gap:
            return f"({k}*({stretch}) + {b}*({speed}))"
        half = number(spring.gap / 2.0)
        above = f"IF({stretch} - {half}:0.0,0.0,MAX(0.0,{k}*({stretch} - {half}) + {b}*({speed})))"
        below = f"IF({stretch} + {half}:MIN(0.0,{k}*({stretch} + {half}) + {b}*({speed})),0.0,0.0)"
        return f"({above} + {below})"


def _bracketed(terms: list[str]) -> str:
    return f"({' + '.join(terms)})" if len(terms) > 1 else "".join(terms)


def said_laws(robot: Robot, i: int) -> DriveLaws:
    """The laws of joint i (from 0), to ask which of them can be said."""
    stage = robot.stages[i]
    marker = Marker(0, "", "")
    joint = Joint(0, stage.joint.name, stage.joint.kind, marker, marker)
    laws = DriveLaws(robot, stage.drive, Sides(joint, joint if stage.drive.spring else None, joint))
    laws.resistances()
    laws.on_arm()
    return laws
