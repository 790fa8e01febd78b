"""Slow work beside a page: only what was asked for last is worth finishing."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Latest(Generic[Result]):
    """Runs jobs in a thread of its own, one at a time; a job that waits is replaced by a newer one.

    Engines may keep state of the whole process, so that all runs of a page go through one of these.
    """

    def __init__(self, done: Callable[[Result], None], pause: float = 0.0) -> None:
        """A worker that tells `done` each result that is still wanted, from its own thread.

        Args:
            done: Gets the results.
            pause: How long nothing newer must be asked for before a job begins [s].
        """
        self._done, self._pause = done, pause
        self._change = threading.Condition()
        self._waiting: Callable[[], Result] | None = None
        self._asked = 0
        self._busy = False
        self._closed = False
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def ask(self, job: Callable[[], Result]) -> None:
        """Wants a job's result; what was asked for before is not wanted any more."""
        with self._change:
            self._waiting = job
            self._asked += 1
            self._change.notify_all()

    def forget(self) -> None:
        """Wants nothing any more."""
        with self._change:
            self._waiting = None
            self._asked += 1

    def idle(self, timeout: float) -> bool:
        """Waits until nothing is wanted or running, at most so long [s]; whether it came to that."""
        with self._change:
            return self._change.wait_for(lambda: self._waiting is None and not self._busy, timeout)

    def close(self) -> None:
        """Ends the thread when its job is done."""
        with self._change:
            self._closed = True
            self._waiting = None
            self._change.notify_all()

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._waiting is not None or self._closed)
                number = -1
                while number != self._asked and not self._closed:
                    number = self._asked
                    self._change.wait_for(lambda seen=number: seen != self._asked or self._closed, self._pause)
                if self._closed:
                    return
                if self._waiting is None:
                    continue
                job, number, self._waiting, self._busy = self._waiting, self._asked, None, True
            try:
                result = job()
                with self._change:
                    wanted = number == self._asked and not self._closed
                if wanted:
                    self._done(result)
            finally:
                with self._change:
                    self._busy = False
                    self._change.notify_all()
