"""The paper's test case as it is run here, with every choice that the paper leaves open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..control import Control, default_pd
from ..database import Database, load
from ..errors import PluginError, RefusedError, UsageError
from ..kinematics import kinematics
from ..motion import MotionLaw, motion_named
from ..representation import Robot
from ..simulation import Trace, backend_named, backend_names, simulate

Array = NDArray[np.float64]
Tell = Callable[[str, int, int], None]

ROBOT = "imece2013"
LEVEL = "compliant"
MOTION = "greca"

# What follows stands in no line of the paper.
RATE = 1000.0
"""Of the record [Hz]."""
REST = 0.5
"""How long a run goes on after the motion has ended, so that the arms ring freely [s]."""
FREQUENCY = 10.0
"""That the controller gives every joint by itself [Hz]: above the arm's own first one, as of a stiff axis."""
DAMPING_RATIO = 0.7
TICK = 1.0e-3
"""Period of the controller, and one communication step [s]."""
STILL = 1.0e-9
"""Speed below which a joint stands [rad/s]."""
KEY_EDGES = 8
"""Edges of one Greek key; what is a comparison of variants runs along the first one only."""


@dataclass(slots=True, eq=False)
class Case:
    """The robot, its motion, the engines, and how far the work has come.

    Attributes:
        database: Of the paper's arm.
        rigid, compliant: The robot at the two levels.
        motion: The Greek key, from rest to rest along every edge.
        corners: When the motion stands at a corner, its two ends included [s], shape (edges + 1,).
        backends: Names of those that run, the reference first.
        left_out: Names of those that do not, with the reason.
        tell: Called with what is done, how many runs are finished, and how many there are.
        total: How many runs there are.
        done: How many are finished.
    """

    database: Database
    rigid: Robot
    compliant: Robot
    motion: MotionLaw
    corners: Array
    backends: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    tell: Tell
    total: int = 0
    done: int = field(default=0)

    @property
    def reference(self) -> str:
        """Name of the backend that runs what one engine is enough for."""
        return self.backends[0]

    def control(self, robot: Robot | None = None, frequency: float = FREQUENCY) -> Control:
        """The feedback on the joints' rotations, with the weight of the rigid arms fed forward."""
        return default_pd(robot or self.compliant, frequency, DAMPING_RATIO, 1.0 / TICK, feedforward="gravity")

    def first_key(self) -> MotionLaw:
        """The motion along the first Greek key, or all of it where it is shorter."""
        return cut_at(self.motion, float(self.corners[min(KEY_EDGES, len(self.corners) - 1)]))

    def command(self, t: Array, motion: MotionLaw | None = None) -> Array:
        """Where the tip is asked to be, in the base [m], shape (m, 3)."""
        return kinematics(self.rigid).tool_in_base((motion or self.motion).at(t)[0])[:, :3, 3]

    def run(
        self,
        what: str,
        robot: Robot,
        backend: str,
        motion: MotionLaw,
        control: Control | None = None,
        *,
        duration: float | None = None,
        rate: float = RATE,
        step: float | None = None,
    ) -> Trace:
        """One run in one engine, to some time of rest after the whole motion where no duration [s] is given."""
        self.tell(f"{what}: {backend}", self.done, self.total)
        length = self.motion.duration + REST if duration is None else duration
        trace = simulate(robot, backend, motion, control, duration=length, rate=rate, step=step)
        self.done += 1
        return trace


def paper_case(backends: Sequence[str] | None, edges: int | None, tell: Tell) -> Case:
    """The case, on all engines that run here or some, along all of the path or its first edges.

    Raises:
        UsageError: The path has not that many edges.
        RefusedError: No engine is there.
        PluginError: A backend that was asked for by name is unknown or broken.
    """
    database = load(ROBOT)
    rigid, compliant = build(database, "rigid"), build(database, LEVEL)
    motion = motion_named(rigid, MOTION, database)
    corners = corners_of(motion)
    if edges is not None:
        if not 1 <= edges < len(corners):
            raise UsageError(f"{edges} edges: the path has {len(corners) - 1}; choose 1 to {len(corners) - 1}.")
        motion, corners = cut_at(motion, float(corners[edges])), corners[: edges + 1]
    able, left_out = _able(backends)
    return Case(database, rigid, compliant, motion, corners, able, left_out, tell)


def _able(backends: Sequence[str] | None) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Names of backends that run, those of high order first, and of others with the reason."""
    able: list[str] = []
    left_out: list[tuple[str, str]] = []
    for name in backends if backends is not None else backend_names():
        try:
            backend = backend_named(name)
            backend.version()
        except (PluginError, RefusedError) as error:
            if backends is not None:
                raise
            left_out.append((name, str(error)))
            continue
        if backend.runs:
            able.append(name)
        else:
            left_out.append((name, f"{backend.engine} is not here; what mbexport emits for it is run there"))
    if not able:
        raise RefusedError("no backend can run: " + "; ".join(f"{name}: {why}" for name, why in left_out))
    # MuJoCo is the quickest: it takes what one engine is enough for
    order = sorted(able, key=lambda name: (backend_named(name).gate_class, name != "mjcf", name))
    return tuple(order), tuple(left_out)


def corners_of(motion: MotionLaw) -> Array:
    """Knots at which every joint is at rest [s]."""
    speeds = motion.at(motion.knots)[1]
    return motion.knots[np.all(np.abs(speeds) < STILL, axis=1)]


def cut_at(motion: MotionLaw, end: float) -> MotionLaw:
    """The motion up to one of its knots."""
    last = int(np.searchsorted(motion.knots, end - 1.0e-9))
    return MotionLaw(motion.knots[: last + 1], motion.coefficients[:, :last])
