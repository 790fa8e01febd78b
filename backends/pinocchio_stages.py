"""The classical Runge-Kutta method around Pinocchio's accelerations, compiled: everything of a stage but the bodies.

Kutta (1901). A stage is one call of Pinocchio, which leaves its result in its own memory, and one call of `stage`.
"""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

from ..core.simulation.by_address import (
    ENGINE,
    IMPOSED,
    SIZE,
    accelerate_elastic,
    drive_memory_at,
    evaluate_drives,
    evaluate_loaded_drives,
    floats,
    follow_acceleration,
    follow_motion,
    integers,
    motion_reference,
    source_stamp,
)

_numba: Any = import_module("numba")

(
    SOLVED,  # 1 where mass matrix and bias are asked of Pinocchio and the accelerations solved here
    ELASTIC,  # how many joints are elastic
    ORDERED,  # elastic joints, then rigid ones
    STAGE,  # 0 to 3
    STEPS,  # done since the advance began
    CLOCK,  # time at which the advance began, step
    COMMAND,
    START,  # state at the step's start: q, dq, theta, dtheta, shape (4, n)
    SUM,  # of the stages' slopes, weighted, shape (4, n)
    CONFIGURATION,  # Pinocchio's, from here to ACCELERATION
    VELOCITY,
    TORQUE,
    ACCELERATION,
    MASS,
    BIAS,
    CONFIGURATION_SIZE,
    FIRST,  # place of each joint in the configuration
    PLACE,  # place in the velocity
    CIRCLE,  # 1 where the configuration has cosine and sine
    MATRIX,  # from here on workspace, in the joints' order
    FACTOR,
    VECTOR,
    ARM_BIAS,
    ARM_TORQUE,
    SLOPE,
) = range(ENGINE, ENGINE + 25)


@_numba.njit
def _time(book: Any) -> float:
    clock = floats(book[CLOCK], 2)
    stage = book[STAGE]
    return clock[0] + (book[STEPS] + (0.0 if stage == 0 else 1.0 if stage == 3 else 0.5)) * clock[1]


@_numba.njit
def _place(book: Any, memory: Any) -> None:
    """The stage's state, which stands in the drives' memory, to Pinocchio, with the torques on the arms."""
    n = memory.q.shape[0]
    elastic = memory.table.elastic
    t = _time(book)
    if book[IMPOSED] == 1:
        follow_motion(book, n, t)
        q_ref, dq_ref, _ = motion_reference(book, n)
        for i in range(n):
            memory.theta[i] = q_ref[i]
            memory.dtheta[i] = dq_ref[i]
            if elastic[i] == 0:
                memory.q[i] = q_ref[i]
                memory.dq[i] = dq_ref[i]
    first = integers(book[FIRST], n)
    place = integers(book[PLACE], n)
    circle = integers(book[CIRCLE], n)
    configuration = floats(book[CONFIGURATION], book[CONFIGURATION_SIZE])
    velocity = floats(book[VELOCITY], n)
    for i in range(n):
        if circle[i] == 1:
            configuration[first[i]] = math.cos(memory.q[i])
            configuration[first[i] + 1] = math.sin(memory.q[i])
        else:
            configuration[first[i]] = memory.q[i]
        velocity[place[i]] = memory.dq[i]
    if book[SOLVED] == 1:
        return
    evaluate_drives(memory, t, book[STAGE] == 0)
    torque = floats(book[TORQUE], n)
    command = floats(book[COMMAND], n)
    for i in range(n):
        if elastic[i] == 1:
            torque[place[i]] = memory.transmitted[i] + memory.on_arm[i]
        else:
            torque[place[i]] = memory.table.gain[i] * command[i] - memory.friction[i] + memory.on_arm[i]


@_numba.njit
def _solve(book: Any, memory: Any, n: int, acceleration: Any) -> None:
    """Accelerations of the arms from Pinocchio's mass matrix and bias, in the joints' order."""
    place = integers(book[PLACE], n)
    mass = floats(book[MASS], n * n).reshape((n, n))
    everywhere = floats(book[BIAS], n)
    matrix = floats(book[MATRIX], n * n).reshape((n, n))
    bias = floats(book[ARM_BIAS], n)
    for i in range(n):
        bias[i] = everywhere[place[i]]
        for j in range(n):
            # its memory is by columns and the upper triangle is the one that it fills
            matrix[i, j] = mass[max(place[i], place[j]), min(place[i], place[j])]
    t = _time(book)
    accept = book[STAGE] == 0
    if book[IMPOSED] == 0:
        command = floats(book[COMMAND], n)
        factor = floats(book[FACTOR], n * n).reshape((n, n))
        evaluate_loaded_drives(memory, t, accept, command, matrix, bias, factor, acceleration)
        return
    evaluate_drives(memory, t, accept)
    follow_acceleration(book, n, t, book[STAGE])
    _, _, ddq_ref = motion_reference(book, n)
    torque = floats(book[ARM_TORQUE], n)
    for i in range(n):
        torque[i] = memory.transmitted[i] + memory.on_arm[i]
        acceleration[i] = ddq_ref[i]
    e = book[ELASTIC]
    factor = floats(book[FACTOR], e * e).reshape((e, e))
    order = integers(book[ORDERED], n)
    accelerate_elastic(matrix, bias, torque, order, e, factor, floats(book[VECTOR], e), acceleration)


@_numba.njit
def _begin(book: Any, memory: Any) -> None:
    n = memory.q.shape[0]
    start = floats(book[START], 4 * n).reshape((4, n))
    total = floats(book[SUM], 4 * n).reshape((4, n))
    book[STAGE] = 0
    book[STEPS] = 0
    for i in range(n):
        memory.q[i] = start[0, i]
        memory.dq[i] = start[1, i]
        memory.theta[i] = start[2, i]
        memory.dtheta[i] = start[3, i]
        for k in range(4):
            total[k, i] = 0.0
    _place(book, memory)


@_numba.njit
def _found(book: Any, memory: Any) -> None:
    """Pinocchio's accelerations into the slopes."""
    n = memory.q.shape[0]
    place = integers(book[PLACE], n)
    found = floats(book[ACCELERATION], n)
    acceleration = floats(book[SLOPE], 4 * n).reshape((4, n))[1]
    for i in range(n):
        acceleration[i] = found[place[i]]


@_numba.njit
def _move(book: Any, memory: Any) -> None:
    """From the accelerations among the slopes to the state of the next stage, or of the next step."""
    table = memory.table
    n = memory.q.shape[0]
    command = floats(book[COMMAND], n)
    start = floats(book[START], 4 * n).reshape((4, n))
    total = floats(book[SUM], 4 * n).reshape((4, n))
    slope = floats(book[SLOPE], 4 * n).reshape((4, n))
    stage = book[STAGE]
    weight = 2.0 if 0 < stage < 3 else 1.0
    h = floats(book[CLOCK], 2)[1]
    reach = h if stage == 2 else 0.5 * h
    for i in range(n):
        slope[0, i] = memory.dq[i]
        slope[2, i] = memory.dtheta[i]
        if table.elastic[i] == 0:
            slope[3, i] = slope[1, i]
        elif book[IMPOSED] == 1:
            slope[3, i] = 0.0
        else:
            driving = table.gain[i] * command[i] - memory.friction[i] - memory.reaction[i]
            slope[3, i] = driving / table.inertia[i]
        for k in range(4):
            total[k, i] += weight * slope[k, i]
            if stage == 3:
                start[k, i] += h / 6.0 * total[k, i]
                total[k, i] = 0.0
                slope[k, i] = 0.0
        memory.q[i] = start[0, i] + reach * slope[0, i]
        memory.dq[i] = start[1, i] + reach * slope[1, i]
        memory.theta[i] = start[2, i] + reach * slope[2, i]
        memory.dtheta[i] = start[3, i] + reach * slope[3, i]
    if stage == 3:
        book[STAGE] = 0
        book[STEPS] += 1
    else:
        book[STAGE] = stage + 1


@cache
def stage_functions(solved: bool) -> tuple[Callable[[int], None], Callable[[int], None]]:
    """(begin, stage), compiled; both take the address of a book.

    `begin` starts an advance: the book's START, CLOCK and COMMAND are set. `stage` is called after Pinocchio has found
    the accelerations of the state it was handed.

    Args:
        solved: Pinocchio finds mass matrix and bias instead, and `stage` solves for the accelerations.
    """
    stamp = source_stamp(sys.modules[__name__])

    def begin(address: int) -> None:
        if stamp != 0:
            book = integers(address, SIZE)
            _begin(book, drive_memory_at(book))

    def stage(address: int) -> None:
        if stamp != 0:
            book = integers(address, SIZE)
            memory = drive_memory_at(book)
            _found(book, memory)
            _move(book, memory)
            _place(book, memory)

    def solved_stage(address: int) -> None:
        if stamp != 0:
            book = integers(address, SIZE)
            memory = drive_memory_at(book)
            n = memory.q.shape[0]
            _solve(book, memory, n, floats(book[SLOPE], 4 * n).reshape((4, n))[1])
            _move(book, memory)
            _place(book, memory)

    functions = (begin, solved_stage if solved else stage)
    made = [_numba.cfunc("void(intp)", cache=True)(function) for function in functions]
    # called with Python's lock held: letting it go and taking it back costs more than a stage
    kind = ctypes.PYFUNCTYPE(None, ctypes.c_ssize_t)
    begin_at, stage_at = (kind(function.address) for function in made)
    _kept.extend(made)
    return begin_at, stage_at


_kept: list[Any] = []
