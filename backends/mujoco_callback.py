"""What MuJoCo calls at every stage of a step: the drives' equations, compiled, as its control callback.

MuJoCo's callbacks belong to the whole process. Ours is set only while engines of ours advance, each of which has a seat
meanwhile, and acts on their data alone.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from ..core.simulation import imposed
from ..core.simulation.by_address import (
    ENGINE,
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
from ..core.simulation.compiled import as_it_stands
from .mujoco_call import library

# motor sides are moved by torque, by torque with friction under load, or by a motion
WAYS = ("torque", "load", "motion")
_LOAD, _MOTION = (WAYS.index(way) for way in ("load", "motion"))

_numba: Any = import_module("numba")
_types: Any = _numba.types
_ir: Any = import_module("llvmlite.ir")

(
    WAY,  # which of WAYS
    CALLS,  # since the advance began; RK4 calls four times a step, first at the accepted state
    MIXED,  # 1 where rigid joints are imposed beside elastic ones
    DOFS,
    CLOCK,  # time at which the advance began, step
    POSITION,
    SPEED,
    COMMAND,
    APPLIED,
    BIAS,
    MASS,  # lower triangle by rows
    ARMATURE,
    ROWS,
    MOTOR,  # coordinate of each joint's motor side
    ARM,  # coordinate that moves the arm alone: the deflection, or the same where rigid
    ORDERED,  # elastic joints, then rigid ones
    ELASTIC,  # how many are elastic
    MATRIX,  # from here on workspace
    FACTOR,
    VECTOR,
    ACCELERATION,
    ARM_BIAS,
    TORQUE,
) = range(ENGINE, ENGINE + 23)

# engines that advance at a time: each has a seat, with the addresses of its mjData and its book
_SEATS = 32
_SEATED = (ctypes.c_int64 * (2 * _SEATS))()
_SYMBOL = "mbexport_mujoco_seats"
_ROOM = threading.BoundedSemaphore(_SEATS)
_LOCK = threading.Lock()
_FREE = list(range(_SEATS))
# what stood in MuJoCo's variable before the first of ours came
_BEFORE: list[int | None] = [None]

import_module("llvmlite.binding").add_symbol(_SYMBOL, ctypes.addressof(_SEATED))


def _seats(typing: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = context.get_c_value(builder, _ir.IntType(64), _SYMBOL)
        return builder.ptrtoint(place, _ir.IntType(64))

    return _types.intp(), generate


_seats_address: Any = import_module("numba.extending").intrinsic(_seats)
_acceleration: Any = imposed.imposed_acceleration
as_it_stands(_acceleration)


@_numba.njit
def _arm_mass_and_bias(book: Any, n: int) -> Any:
    """Mass matrix (armature of rigid joints included) and bias of the arms, from MuJoCo's of all coordinates."""
    arm = integers(book[ARM], n)
    rows = integers(book[ROWS], book[DOFS])
    everywhere = floats(book[BIAS], book[DOFS])
    matrix = floats(book[MATRIX], n * n).reshape((n, n))
    bias = floats(book[ARM_BIAS], n)
    for i in range(n):
        bias[i] = everywhere[arm[i]]
        row = floats(book[MASS] + 8 * rows[arm[i]], arm[i] + 1)
        for j in range(i + 1):
            matrix[i, j] = row[arm[j]]
            matrix[j, i] = row[arm[j]]
    return matrix, bias


@_numba.njit
def _evaluate_loaded(book: Any, memory: Any, n: int, t: float, accept: bool) -> None:
    """The drives' torques, with the load of rigid joints solved together with the accelerations."""
    matrix, bias = _arm_mass_and_bias(book, n)
    for i in range(n):
        if memory.table.elastic[i] == 0:
            matrix[i, i] -= memory.table.inertia[i]
    command = floats(book[COMMAND], n)
    factor = floats(book[FACTOR], n * n).reshape((n, n))
    evaluate_loaded_drives(memory, t, accept, command, matrix, bias, factor, floats(book[ACCELERATION], n))


@_numba.njit
def _drive_rigid_joints(book: Any, memory: Any, n: int) -> None:
    """Forces that make rigid joints follow the motion, once those on elastic ones stand in qfrc_applied."""
    q_ref, dq_ref, ddq_ref = motion_reference(book, n)
    matrix, bias = _arm_mass_and_bias(book, n)
    applied = floats(book[APPLIED], book[DOFS])
    arm = integers(book[ARM], n)
    order = integers(book[ORDERED], n)
    e = book[ELASTIC]
    acceleration = floats(book[ACCELERATION], n)
    torque = floats(book[TORQUE], n)
    for i in range(n):
        torque[i] = applied[arm[i]]
    for r in order[e:]:
        acceleration[r] = _acceleration(memory.q[r], memory.dq[r], q_ref[r], dq_ref[r], ddq_ref[r])
    factor = floats(book[FACTOR], e * e).reshape((e, e))
    accelerate_elastic(matrix, bias, torque, order, e, factor, floats(book[VECTOR], e), acceleration)
    for r in order[e:]:
        force = bias[r]
        for j in range(n):
            force += matrix[r, j] * acceleration[j]
        applied[arm[r]] = force


@_numba.njit
def _read_state(book: Any, memory: Any) -> Any:
    """MuJoCo's state into the drives' memory; (stage 0 to 3, its time)."""
    stage = book[CALLS] % 4
    clock = floats(book[CLOCK], 2)
    t = clock[0] + (book[CALLS] // 4 + (0.0 if stage == 0 else 1.0 if stage == 3 else 0.5)) * clock[1]
    book[CALLS] += 1
    n = memory.q.shape[0]
    position = floats(book[POSITION], book[DOFS])
    speed = floats(book[SPEED], book[DOFS])
    motor = integers(book[MOTOR], n)
    arm = integers(book[ARM], n)
    for i in range(n):
        memory.theta[i] = memory.q[i] = position[motor[i]]
        memory.dtheta[i] = memory.dq[i] = speed[motor[i]]
        if arm[i] != motor[i]:
            memory.q[i] += position[arm[i]]
            memory.dq[i] += speed[arm[i]]
    return stage, t


@_numba.njit
def _write_torques(book: Any, memory: Any) -> None:
    """The drives' torques into qfrc_applied; the command acts through MuJoCo's own motors."""
    n = memory.q.shape[0]
    applied = floats(book[APPLIED], book[DOFS])
    motor = integers(book[MOTOR], n)
    arm = integers(book[ARM], n)
    for i in range(n):
        if arm[i] == motor[i]:
            applied[arm[i]] = memory.on_arm[i] - memory.friction[i]
        else:
            # the motor's coordinate carries the arm too: both sides' torques act on it
            applied[arm[i]] = memory.transmitted[i] + memory.on_arm[i]
            applied[motor[i]] = applied[arm[i]] - memory.friction[i] - memory.reaction[i]


@_numba.njit
def _write_motion(book: Any, memory: Any, stage: int, t: float) -> None:
    """Motor sides follow the imposed motion, arms their springs, into qfrc_applied."""
    n = memory.q.shape[0]
    applied = floats(book[APPLIED], book[DOFS])
    armature = floats(book[ARMATURE], book[DOFS])
    motor = integers(book[MOTOR], n)
    arm = integers(book[ARM], n)
    follow_motion(book, n, t)
    q_ref, dq_ref, ddq_ref = motion_reference(book, n)
    for i in range(n):
        memory.theta[i] = q_ref[i]
        memory.dtheta[i] = dq_ref[i]
    evaluate_drives(memory, t, stage == 0)
    for i in range(n):
        if arm[i] != motor[i]:
            applied[arm[i]] = memory.transmitted[i] + memory.on_arm[i]
            applied[motor[i]] = applied[arm[i]] + armature[motor[i]] * ddq_ref[i]
    if book[MIXED] == 1:
        follow_acceleration(book, n, t, stage)
        _drive_rigid_joints(book, memory, n)


@_numba.njit
def _book_of(data: int) -> int:
    """Address of the book of the engine with that mjData; 0 where it is none of ours that advances."""
    seats = integers(_seats_address(), 2 * _SEATS)
    for k in range(_SEATS):
        if seats[2 * k] == data:
            return seats[2 * k + 1]
    return 0


@cache
def _compiled() -> Any:
    """The callback, compiled: void(const mjModel*, mjData*)."""
    stamp = source_stamp(sys.modules[__name__], imposed)

    def drive(model: int, data: int) -> None:
        address = _book_of(data)
        if stamp != 0 and address != 0:
            book = integers(address, SIZE)
            memory = drive_memory_at(book)
            stage, t = _read_state(book, memory)
            if book[WAY] == _MOTION:
                _write_motion(book, memory, stage, t)
                return
            if book[WAY] == _LOAD:
                _evaluate_loaded(book, memory, memory.q.shape[0], t, stage == 0)
            else:
                evaluate_drives(memory, t, stage == 0)
            _write_torques(book, memory)

    return _numba.cfunc("void(intp, intp)", cache=True)(drive)


class Callback(NamedTuple):
    """The compiled callback.

    Attributes:
        address: Of its code.
        slot: MuJoCo's variable mjcb_control. Setting it through the Python binding costs as much as two steps' laws.
    """

    address: int
    slot: ctypes.c_void_p


@cache
def callback() -> Callback:
    """The callback.

    Raises:
        RefusedError: MuJoCo is not installed as its Python package brings it.
    """
    return Callback(int(_compiled().address), ctypes.c_void_p.in_dll(library(), "mjcb_control"))


def take_seat(data: int, book: int, drives: Callback) -> int:
    """Have the callback act on an engine until it leaves its seat.

    Args:
        data: Address of its mjData.
        book: Address of its book.
        drives: The callback.

    Returns:
        The seat.
    """
    _ROOM.acquire()
    with _LOCK:
        if len(_FREE) == _SEATS:
            _BEFORE[0] = drives.slot.value
            drives.slot.value = drives.address
        seat = _FREE.pop()
        _SEATED[2 * seat], _SEATED[2 * seat + 1] = data, book
    return seat


def leave_seat(seat: int, drives: Callback) -> None:
    """The callback acts no longer on the engine that has that seat."""
    with _LOCK:
        _SEATED[2 * seat] = 0
        _FREE.append(seat)
        if len(_FREE) == _SEATS:
            drives.slot.value = _BEFORE[0]
    _ROOM.release()
