"""Many independent tasks: in this process, in others beside it, or on a Dask cluster; each kept as soon as it is done.

What is run is a `Work`: an object that travels to where it runs. A task is its number and what it is given; a process
that dies of a task takes only that one along.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any, Generic, Protocol, TypeVar

from .errors import MbexportError, UsageError

Given = TypeVar("Given")
Given_contra = TypeVar("Given_contra", contravariant=True)
Result = TypeVar("Result")
Item = TypeVar("Item")
Made = TypeVar("Made")
Result_co = TypeVar("Result_co", covariant=True)

# tasks that wait at each place where one runs: enough that none idles, few enough to stop at once
WAITING = 2
MOST_WORKERS = 1024
# s until a scheduler must have answered
ANSWER_TIME = 10.0
# callbacks of an engine may belong to its whole process, so tasks of one process take turns
_TURN = threading.Lock()
_work: Work[Any, Any] | None = None
# what the names of threads begin with that work side by side
_THREADS = "side by side"


class Work(Protocol[Given_contra, Result_co]):
    """What runs tasks; it must survive pickling."""

    def run(self, number: int, given: Given_contra, /) -> Result_co:
        """One task."""
        ...

    def died(self, number: int, given: Given_contra, /) -> Result_co:
        """What becomes of a task that its process died of."""
        ...

    def versions(self) -> dict[str, str]:
        """Versions that results depend on, on the machine that is asked."""
        ...


def cores() -> int:
    """Cores that this process may use."""
    # not everywhere
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


def side_by_side(of: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
    """What a function makes of each item, in their order, in threads where there are cores to spare.

    For functions that spend their time in compiled code, which leaves Python to others meanwhile. A process that itself
    is one of several has none to spare, nor has a thread that is.
    """
    threads = min(len(items), cores())
    company = multiprocessing.parent_process() is not None or threading.current_thread().name.startswith(_THREADS)
    if threads < 2 or company:
        return [of(item) for item in items]
    return list(_threads().map(of, items))


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), _THREADS)


def check_options(workers: int | None, dask: str | None) -> None:
    """Refuse options that do not fit together.

    Raises:
        UsageError: They do not.
    """
    if workers is not None and dask is not None:
        raise UsageError("--workers and --dask exclude each other; a cluster has its own.")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise UsageError(f"--workers {workers}: it must be from 1 to {MOST_WORKERS}.")


def run_all(
    work: Work[Given, Result],
    tasks: Sequence[tuple[int, Given]],
    keep: Callable[[Result], None],
    *,
    workers: int | None = None,
    dask: str | None = None,
) -> None:
    """Run tasks in their order, as many at a time as there is room; results come as they are done.

    Stopped by Ctrl-C, it lets what runs finish and keeps it.

    Args:
        work: What runs them.
        tasks: Number and what is given; numbers differ.
        keep: Takes each result.
        workers: Processes of this machine; None: as many as it has cores.
        dask: Address of a Dask scheduler instead.

    Raises:
        UsageError: Options that do not fit together; no cluster.
        MbexportError: A task's own, which ends all.
    """
    check_options(workers, dask)
    if not tasks:
        return
    # none more than there is to do
    staff = _staff(work, min(workers or cores(), len(tasks)), dask)
    try:
        _run_all(work, staff, list(tasks), keep)
    finally:
        staff.close()


def _staff(work: Work[Given, Result], workers: int, dask: str | None) -> _Staff[Given, Result]:
    if dask is not None:
        return _Cluster(work, dask)
    return _Processes(work, workers) if workers > 1 else _ThisProcess(work)


def _run_all(
    work: Work[Given, Result],
    staff: _Staff[Given, Result],
    todo: list[tuple[int, Given]],
    keep: Callable[[Result], None],
) -> None:
    waiting = iter(todo)
    running: dict[Future[Result], tuple[int, Given]] = {}

    def fill() -> None:
        while len(running) < WAITING * staff.slots:
            task = next(waiting, None)
            if task is None:
                return
            running[staff.submit(*task)] = task

    try:
        fill()
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            died: list[tuple[int, Given]] = []
            for future in done:
                task = running.pop(future)
                try:
                    keep(future.result())
                except staff.deaths:
                    died.append(task)
            if died:
                # whoever ran beside it died too: each again, alone, tells which it was
                died += _left_over(running, staff, keep)
                staff.restart()
                for task in sorted(died, key=lambda one: one[0]):
                    keep(_alone(work, staff, task))
            fill()
    except KeyboardInterrupt:
        # what runs is let finish, and kept
        for future in running:
            if not future.cancel() and not future.exception():
                keep(future.result())
        raise


def _left_over(
    running: dict[Future[Result], tuple[int, Given]], staff: _Staff[Given, Result], keep: Callable[[Result], None]
) -> list[tuple[int, Given]]:
    """Takes what runs after a death; gives back the tasks that it took along."""
    died: list[tuple[int, Given]] = []
    for future, task in running.items():
        try:
            keep(future.result())
        except staff.deaths:
            died.append(task)
    running.clear()
    return died


def _alone(work: Work[Given, Result], staff: _Staff[Given, Result], task: tuple[int, Given]) -> Result:
    try:
        return staff.submit(*task).result()
    except staff.deaths:
        staff.restart()
        return work.died(*task)


class _Staff(ABC, Generic[Given, Result]):
    """Runs tasks, some at a time.

    Attributes:
        slots: How many run at a time.
    """

    slots = 1

    @abstractmethod
    def submit(self, number: int, given: Given) -> Future[Result]:
        """Have a task run; a process that dies of it is an exception of `deaths` in the future."""

    @property
    def deaths(self) -> tuple[type[BaseException], ...]:
        """What a future raises where the process that ran it died."""
        return ()

    def restart(self) -> None:
        """Go on after a death."""
        return

    def close(self) -> None:
        """Give processes back; what runs is waited for, what waits is dropped."""
        return


def _in_turn(work: Work[Given, Result], number: int, given: Given) -> Result:
    """One task a process at a time."""
    with _TURN:
        return work.run(number, given)


class _ThisProcess(_Staff[Given, Result]):
    """One task after the other, here."""

    def __init__(self, work: Work[Given, Result]) -> None:
        self._work = work

    def submit(self, number: int, given: Given) -> Future[Result]:
        """As the base says."""
        future: Future[Result] = Future()
        try:
            future.set_result(_in_turn(self._work, number, given))
        except MbexportError as error:
            future.set_exception(error)
        return future


class _Processes(_Staff[Given, Result]):
    """Processes beside this one, each with its engine loaded and its kernels compiled once."""

    def __init__(self, work: Work[Given, Result], slots: int) -> None:
        self.slots = slots
        self._work = work
        self._pool = self._started()

    @property
    def deaths(self) -> tuple[type[BaseException], ...]:
        """As the base says."""
        return (BrokenProcessPool,)

    def submit(self, number: int, given: Given) -> Future[Result]:
        """As the base says."""
        try:
            return self._pool.submit(_run_here, number, given)
        except BrokenProcessPool as error:
            future: Future[Result] = Future()
            future.set_exception(error)
            return future

    def restart(self) -> None:
        """As the base says."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._started()

    def close(self) -> None:
        """As the base says."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _started(self) -> Executor:
        # spawned, not forked: engines and Numba may hold threads and locks
        return ProcessPoolExecutor(
            self.slots, multiprocessing.get_context("spawn"), initializer=_take, initargs=(self._work,)
        )


def _take(work: Work[Any, Any]) -> None:
    """What a process keeps for all its tasks."""
    global _work  # noqa: PLW0603 - a pool's processes have no other place
    _work = work
    # an interrupt is the first process's business: it lets the others finish what they run
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Where the first process was killed nobody takes results any more, and the pool would wait forever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _run_here(number: int, given: Any) -> Any:
    assert _work is not None
    return _in_turn(_work, number, given)


class _Cluster(_Staff[Given, Result]):
    """Workers of a Dask cluster; they need the same mbexport and the same engine."""

    def __init__(self, work: Work[Given, Result], address: str) -> None:
        """Connect.

        Args:
            work: What is run.
            address: Of the scheduler, such as "tcp://host:8786".

        Raises:
            UsageError: Nobody answers, there are no workers, or they have another mbexport.
        """
        try:
            distributed: Any = import_module("distributed")
        except ImportError as error:
            raise UsageError("--dask needs Dask: pip install 'mbexport[cluster]'") from error
        self._distributed = distributed
        try:
            self._client: Any = distributed.Client(address, timeout=ANSWER_TIME, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise UsageError(f"no Dask scheduler answers at {address!r}: give its address, tcp://host:port.") from error
        try:
            self._check(address, work)
        except UsageError:
            self._client.close()
            raise
        self.slots = sum(self._client.nthreads().values())
        self._work: Any = self._client.scatter(work, broadcast=True, hash=False)
        self._executor: Executor = self._client.get_executor(pure=False)

    def _check(self, address: str, work: Work[Given, Result]) -> None:
        here = work.versions()
        there: dict[str, Any] = self._client.run(work.versions, on_error="return")
        if not there:
            raise UsageError(f"the Dask cluster at {address!r} has no workers.")
        for worker, versions in sorted(there.items()):
            if versions != here:
                raise UsageError(
                    f"worker {worker} cannot run this: it has {versions!r}, this process {here!r}; results must not "
                    "depend on where they were made."
                )

    @property
    def deaths(self) -> tuple[type[BaseException], ...]:
        """As the base says."""
        return (self._distributed.KilledWorker,)

    def submit(self, number: int, given: Given) -> Future[Result]:
        """As the base says."""
        return self._executor.submit(_in_turn, self._work, number, given)

    def close(self) -> None:
        """As the base says."""
        self._executor.shutdown(wait=False)
        self._client.close()


@contextmanager
def progress_bar(
    wanted: bool, what: str, total: int, before: int, failed: Callable[[Result], bool]
) -> Generator[Callable[[Result], None], None, None]:
    """A function that is told each result, with or without a bar on standard error.

    Args:
        wanted: Whether there is a bar.
        what: What is counted, in the plural.
        total: How many are to be done.
        before: How many were done before.
        failed: Whether a result is one that failed.
    """
    if not wanted:
        yield _say_nothing
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=total + before, completed=before)
        count = 0

        def advance(result: Result) -> None:
            nonlocal count
            count += failed(result)
            progress.update(task, advance=1, description=f"{what} ({count} failed)" if count else what)

        yield advance


def _say_nothing(result: object) -> None:
    """No bar."""
