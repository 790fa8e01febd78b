"""The tip's two paths along a motion: where it should be, and where the robot brings it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..control import Control, default_pd
from ..errors import RefusedError
from ..kinematics import kinematics
from ..motion import MotionLaw
from ..representation import Robot
from ..simulation.run import simulate
from .bench import Bench

Array = NDArray[np.float64]
Drive = Literal["motion", "pd"]

# points a path is drawn with, about
POINTS = 600
# records a second at most
FASTEST = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """A run, as far as it is drawn; positions in the base.

    Attributes:
        t: Times [s], shape (m,).
        theta: Commanded joint positions [rad or m], shape (m, n).
        q: Positions of the arm sides, shape (m, n).
        rigid: Tip of the robot without any effect, the motion imposed [m], shape (m, 3).
        real: Tip of the robot as it runs [m], shape (m, 3).
        warnings: What the run had to say.
    """

    t: Array
    theta: Array
    q: Array
    rigid: Array
    real: Array
    warnings: tuple[str, ...] = ()

    @property
    def error(self) -> Array:
        """From where the tip should be to where it is [m], shape (m, 3)."""
        return self.real - self.rigid

    @property
    def distance(self) -> Array:
        """Length of the error [m], shape (m,)."""
        return np.linalg.norm(self.error, axis=1)

    def magnified(self, factor: float) -> Array:
        """The real path with its error drawn larger, shape (m, 3)."""
        return self.rigid + factor * self.error


def run_paths(bench: Bench, motion: MotionLaw, drive: Drive, backend: str) -> Paths:
    """The paths of a bench's robot.

    Args:
        bench: The robot.
        motion: Commanded motion.
        drive: "motion": imposed on the motor sides; "pd": the controller of `controller_of`.
        backend: Name of the engine that runs it.

    Raises:
        RefusedError: The engine refuses the robot.
        UsageError: The effects turn an arm into what no body can be.
    """
    robot = bench.robot()
    control, nominal = controller_of(bench, drive)
    rate = min(FASTEST, POINTS / motion.duration)
    # an engine may warn before it gives up; the refusal says so
    with np.errstate(all="ignore"):
        trace = simulate(robot, backend, motion, control, rate=rate, nominal=nominal)
    if not np.isfinite(trace.tip).all():
        raise RefusedError(f"{robot.name} does not stay finite: its drives cannot hold this motion.")
    theta = motion.at(trace.t)[0]
    rigid = kinematics(rigid_of(bench)).tool_in_base(theta)[:, :3, 3]
    return Paths(trace.t, theta, trace.joints["q_link"], rigid, trace.tip, trace.warnings)


def rigid_of(bench: Bench) -> Robot:
    """The bench's robot without any effect: what its tip is held against."""
    return build(bench.database(), effects=())


def controller_of(bench: Bench, drive: Drive) -> tuple[Control | None, Robot | None]:
    """The controller, and the robot whose weight it feeds forward: both know the database as it was read.

    Imposed motion needs neither.
    """
    if drive == "motion":
        return None, None
    known = build(bench.original, "full")
    return default_pd(known, feedforward="gravity"), known
