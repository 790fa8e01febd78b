"""Where variants run: in this process, in others beside it, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from importlib.metadata import version
from typing import Any

from ..errors import UsageError
from ..simulation import backend_named
from .experiment import Experiment, Outcome

Values = tuple[float, ...] | None
# s until a scheduler must have answered
ANSWER_TIME = 10.0
# callbacks of an engine may belong to its whole process, so variants of one process take turns
_TURN = threading.Lock()
_experiment: Experiment | None = None


def cores() -> int:
    """Cores that this process may use."""
    # not everywhere
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


def run_variant(experiment: Experiment, variant: int, values: Values) -> Outcome:
    """`Experiment.run`, one variant a process at a time."""
    with _TURN:
        return experiment.run(variant, values)


class Workers:
    """Runs variants, some at a time.

    Attributes:
        slots: How many run at a time.
    """

    slots = 1

    def submit(self, variant: int, values: Values) -> Future[Outcome]:
        """Have a variant run; a process that dies of it is an exception of `deaths` in the future."""
        raise NotImplementedError

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


class ThisProcess(Workers):
    """One variant after the other, here."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment

    def submit(self, variant: int, values: Values) -> Future[Outcome]:
        """As the base says."""
        future: Future[Outcome] = Future()
        try:
            future.set_result(run_variant(self._experiment, variant, values))
        except UsageError as error:
            future.set_exception(error)
        return future


class Processes(Workers):
    """Processes beside this one, each with its engine loaded and its kernels compiled once."""

    def __init__(self, experiment: Experiment, slots: int) -> None:
        self.slots = slots
        self._experiment = experiment
        self._pool = self._started()

    @property
    def deaths(self) -> tuple[type[BaseException], ...]:
        """As the base says."""
        return (BrokenProcessPool,)

    def submit(self, variant: int, values: Values) -> Future[Outcome]:
        """As the base says."""
        try:
            return self._pool.submit(_run_here, variant, values)
        except BrokenProcessPool as error:
            future: Future[Outcome] = Future()
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
            self.slots, multiprocessing.get_context("spawn"), initializer=_take, initargs=(self._experiment,)
        )


def _take(experiment: Experiment) -> None:
    """What a process keeps for all its variants."""
    global _experiment  # noqa: PLW0603 - a pool's processes have no other place
    _experiment = experiment
    # an interrupt is the first process's business: it lets the others finish what they run
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Where the first process was killed nobody takes results any more, and the pool would wait forever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _run_here(variant: int, values: Values) -> Outcome:
    assert _experiment is not None
    return run_variant(_experiment, variant, values)


class Cluster(Workers):
    """Workers of a Dask cluster; they need the same mbexport and the same engine."""

    def __init__(self, experiment: Experiment, address: str) -> None:
        """Connect.

        Args:
            experiment: What is run.
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
            self._check(address, experiment.backend)
        except UsageError:
            self._client.close()
            raise
        self.slots = sum(self._client.nthreads().values())
        self._experiment: Any = self._client.scatter(experiment, broadcast=True, hash=False)
        self._executor: Executor = self._client.get_executor(pure=False)

    def _check(self, address: str, backend: str) -> None:
        here = versions_of(backend)
        there: dict[str, Any] = self._client.run(versions_of, backend, on_error="return")
        if not there:
            raise UsageError(f"the Dask cluster at {address!r} has no workers.")
        for worker, versions in sorted(there.items()):
            if versions != here:
                raise UsageError(
                    f"worker {worker} cannot run this study: it has {versions!r}, this process {here!r}; results must "
                    "not depend on where they were made."
                )

    @property
    def deaths(self) -> tuple[type[BaseException], ...]:
        """As the base says."""
        return (self._distributed.KilledWorker,)

    def submit(self, variant: int, values: Values) -> Future[Outcome]:
        """As the base says."""
        return self._executor.submit(run_variant, self._experiment, variant, values)

    def close(self) -> None:
        """As the base says."""
        self._executor.shutdown(wait=False)
        self._client.close()


def versions_of(backend: str) -> dict[str, str]:
    """Versions that results depend on, on the machine that is asked."""
    return {"mbexport": version("mbexport"), "numpy": version("numpy"), backend: backend_named(backend).version()}
