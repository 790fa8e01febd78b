"""All that the controls of a page change, and what is to be seen then; it knows nothing of pages."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import MbexportError, UsageError
from ..motion import MotionLaw, motion_named, motion_names
from .bench import Bench
from .paths import Drive, Paths, rigid_of, run_paths
from .posture import Posture, Postures
from .saving import export_robot, save_database
from .worker import Latest

if TYPE_CHECKING:
    from ..representation import Robot
    from ..study.values import Place

Array = NDArray[np.float64]

# motions to begin with, the first that the robot can do
_FIRST_MOTIONS = ("greca", "excitation", "hold")
# a slider that is being dragged begins no run [s]
PAUSE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a page shows.

    Attributes:
        bench: What was changed, and what acts.
        robot: The last one that could be built.
        posture: Where it stands.
        paths: The last run; None before the first.
        running: A newer run is on its way.
        time: Instant of the motion that is shown [s]; None: the posture of the sliders, at rest.
        problem: Why the bench has no robot, or the robot no run; "" where all is well.
    """

    bench: Bench
    robot: Robot
    posture: Posture
    paths: Paths | None = None
    running: bool = False
    time: float | None = None
    problem: str = ""


class Session:
    """One robot, changed from any thread; what is to be seen comes to `show`, from a thread of its own."""

    def __init__(
        self,
        database_bench: Bench,
        *,
        backend: str,
        motion: str | None = None,
        drive: Drive = "motion",
        output: Path,
        show: Callable[[View], None] = lambda view: None,
    ) -> None:
        """A session that begins with a bench.

        Args:
            database_bench: The robot as its database stands.
            backend: Name of the engine that runs it.
            motion: Name of the motion; None: the Greca, or what the robot can do instead.
            drive: How it is driven.
            output: Folder that saves and exports go into.
            show: Gets every new view.

        Raises:
            MbexportError: The robot cannot be built, or cannot do the motion.
        """
        self._lock = threading.RLock()
        self._bench, self._backend, self._output = database_bench, backend, output
        self._drive: Drive = drive
        self._start = database_bench.robot()
        self.motion, self._law = self._first_motion(motion)
        self._postures = Postures.of(self._start, rigid_of(database_bench))
        self._theta: Array = np.array(self._start.home())
        self._time: float | None = None
        self._paths: Paths | None = None
        self._running = False
        self._problem = ""
        self._path_problem = ""
        self._show = show
        self._built = database_bench
        self._view = self._look()
        self._quick: Latest[View | None] = Latest(self._shown)
        self._slow: Latest[Paths | str] = Latest(self._ran, PAUSE)

    # what a page asks
    @property
    def view(self) -> View:
        """The last view."""
        with self._lock:
            return self._view

    @property
    def bench(self) -> Bench:
        """What was changed, up to now."""
        with self._lock:
            return self._bench

    @property
    def drive(self) -> Drive:
        """How the robot is driven."""
        with self._lock:
            return self._drive

    @property
    def duration(self) -> float:
        """Of the motion [s]."""
        with self._lock:
            return self._law.duration

    @property
    def output(self) -> Path:
        """Folder that saves and exports go into."""
        return self._output

    def motions(self) -> tuple[str, ...]:
        """Names of the motions to choose from."""
        return motion_names(self._bench.original)

    # what the controls do
    def run(self) -> None:
        """Begin a run along the motion."""
        with self._lock:
            bench, law, drive = self._bench, self._law, self._drive
            self._running = True
            self._slow.ask(lambda: _run(bench, law, drive, self._backend))
        self._refresh()

    def change(self, place: Place, value: float) -> None:
        """Another number at a place, SI."""
        self._rebuild(lambda bench: bench.changed(place, value))

    def switch(self, effect: str, on: bool) -> None:
        """An effect acts or does not."""
        self._rebuild(lambda bench: bench.switched(effect, on))

    def reset(self) -> None:
        """All as it was in the beginning."""
        with self._lock:
            self._theta = np.array(self._start.home())
            self._time = None
            effects = self._start.effects
        self._rebuild(lambda bench: Bench(bench.original, effects=effects))

    def place_joint(self, joint: int, position: float) -> None:
        """Motor side of one joint (from 0) to a position [rad or m], at rest."""
        with self._lock:
            theta = self._theta.copy()
            theta[joint] = position
            self._theta, self._time = theta, None
        self._refresh()

    def place_at(self, time: float) -> None:
        """The robot where the motion has it at an instant [s]."""
        with self._lock:
            self._time = min(max(time, 0.0), self._law.duration)
            self._theta = self._law.at([self._time])[0][0]
        self._refresh()

    def choose_motion(self, name: str) -> None:
        """Another motion; one that the robot cannot do is a problem to be seen."""
        try:
            law = motion_named(self._start, name, self._bench.original)
        except MbexportError as error:
            with self._lock:
                self._path_problem = str(error)
            self._refresh()
            return
        with self._lock:
            self.motion, self._law, self._paths, self._time = name, law, None, None
        self.run()

    def choose_drive(self, drive: Drive) -> None:
        """Imposed motion, or a controller."""
        with self._lock:
            self._drive = drive
        self.run()

    def save(self) -> Path:
        """Write the changed database; where to.

        Raises:
            MbexportError: The bench has no robot, or the folder cannot be written.
        """
        return save_database(self.bench, self._output)

    def export(self, backends: Sequence[str]) -> Path:
        """Write the robot's models; where to.

        Raises:
            MbexportError: The bench has no robot, a backend refuses it, or the folder cannot be written.
        """
        with self._lock:
            bench, law = self._bench, self._law
        return export_robot(bench, backends, law, self._output)

    def settle(self, timeout: float = 60.0) -> View:
        """Wait until all that was asked for is shown, at most so long [s]; the last view."""
        self._slow.idle(timeout)
        self._quick.idle(timeout)
        return self.view

    def close(self) -> None:
        """End the threads."""
        self._slow.close()
        self._quick.close()

    # what becomes of it
    def _first_motion(self, wanted: str | None) -> tuple[str, MotionLaw]:
        names = _FIRST_MOTIONS if wanted is None else (wanted,)
        for name in names:
            try:
                return name, motion_named(self._start, name, self._bench.original)
            except UsageError:
                if name == names[-1]:
                    raise
        raise AssertionError

    def _rebuild(self, change: Callable[[Bench], Bench]) -> None:
        with self._lock:
            self._bench = change(self._bench)
        self.run()

    def _refresh(self) -> None:
        self._quick.ask(self._try_to_look)

    def _try_to_look(self) -> View | None:
        with self._lock:
            bench = self._bench
        if bench is not self._built:
            # slow enough that sliders may move meanwhile
            try:
                postures = Postures.of(bench.robot(), rigid_of(bench))
                problem = ""
            except MbexportError as error:
                postures, problem = self._postures, str(error)
            with self._lock:
                self._postures, self._problem, self._built = postures, problem, bench
        try:
            return self._look()
        except MbexportError as error:
            return replace(self.view, problem=str(error))

    def _look(self) -> View:
        with self._lock:
            theta, time, paths, postures = self._theta, self._time, self._paths, self._postures
            problem = self._problem or self._path_problem
        if time is not None and paths is not None:
            k = int(np.argmin(np.abs(paths.t - time)))
            posture = postures.moving(paths.theta[k], paths.q[k])
        else:
            posture = postures.at(theta)
        return View(self._bench, postures.robot, posture, paths, self._running, time, problem)

    def _shown(self, view: View | None) -> None:
        if view is not None:
            with self._lock:
                self._view = view
            self._show(view)

    def _ran(self, result: Paths | str) -> None:
        with self._lock:
            self._running = False
            if isinstance(result, str):
                self._paths, self._path_problem = None, result
            else:
                self._paths, self._path_problem = result, ""
        self._refresh()


def _run(bench: Bench, law: MotionLaw, drive: Drive, backend: str) -> Paths | str:
    """The run, or why there is none."""
    try:
        return run_paths(bench, law, drive, backend)
    except MbexportError as error:
        return str(error)
    except (ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
        return f"{backend} gave up: {error}"
