"""Functions side by side: in their order, in threads here, one after the other in a process that has company."""

from __future__ import annotations

import multiprocessing
import threading
import time

import pytest

from mbexport.core import parallel
from mbexport.core.parallel import side_by_side


def test_results_come_in_the_order_of_what_was_given(monkeypatch):
    monkeypatch.setattr(parallel, "cores", lambda: 2)

    def slowest_first(k: int) -> int:
        time.sleep(0.02 * (4 - k))
        return k * k

    assert side_by_side(slowest_first, range(5)) == [0, 1, 4, 9, 16]


def test_an_error_is_the_callers(monkeypatch):
    monkeypatch.setattr(parallel, "cores", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda k: 1 // k, [1, 0])


@pytest.mark.parametrize(("cores", "company", "threads"), [(2, False, True), (1, False, False), (2, True, False)])
def test_threads_are_taken_where_cores_are_to_spare(monkeypatch, cores, company, threads):
    monkeypatch.setattr(parallel, "cores", lambda: cores)
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: object() if company else None)
    who = side_by_side(lambda _: threading.current_thread(), [1, 2])
    assert all((one is not threading.main_thread()) == threads for one in who)
