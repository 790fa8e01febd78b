"""What MuJoCo calls at every stage of a step: the drives' equations, compiled, as its control callback.

MuJoCo's callbacks belong to the whole process. Ours is set only while one of our engines advances, one at a time, and
acts on that engine's data alone.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..core.errors import RefusedError
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

Way = Literal["torque", "load", "motion"]

_numba: Any = import_module("numba")
_types: Any = _numba.types
_ir: Any = import_module("llvmlite.ir")
_mujoco: Any = import_module("mujoco")
_step: Any = _mujoco.mj_step

(
    DATA,  # address of the engine's mjData
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

# compiled code finds the book of the engine that advances here
_CURRENT = np.zeros(1, dtype=np.int64)
_SYMBOL = "mbexport_mujoco_book"
_LOCK = threading.Lock()

import_module("llvmlite.binding").add_symbol(_SYMBOL, _CURRENT.ctypes.data)


def _current_book(typing: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(context.get_c_value(builder, _ir.IntType(64), _SYMBOL))

    return _types.intp(), generate


_book_address: Any = import_module("numba.extending").intrinsic(_current_book)
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


@cache
def _compiled(way: Way) -> Any:
    """The callback for one way of running, compiled: void(const mjModel*, mjData*)."""
    stamp = source_stamp(sys.modules[__name__], imposed)

    def by_torque(model: int, data: int) -> None:
        book = integers(_book_address(), SIZE)
        if stamp != 0 and book[DATA] == data:
            memory = drive_memory_at(book)
            stage, t = _read_state(book, memory)
            evaluate_drives(memory, t, stage == 0)
            _write_torques(book, memory)

    def under_load(model: int, data: int) -> None:
        book = integers(_book_address(), SIZE)
        if stamp != 0 and book[DATA] == data:
            memory = drive_memory_at(book)
            stage, t = _read_state(book, memory)
            _evaluate_loaded(book, memory, memory.q.shape[0], t, stage == 0)
            _write_torques(book, memory)

    def by_motion(model: int, data: int) -> None:
        book = integers(_book_address(), SIZE)
        if stamp != 0 and book[DATA] == data:
            memory = drive_memory_at(book)
            stage, t = _read_state(book, memory)
            _write_motion(book, memory, stage, t)

    function = {"torque": by_torque, "load": under_load, "motion": by_motion}[way]
    return _numba.cfunc("void(intp, intp)", cache=True)(function)


class Callback(NamedTuple):
    """A compiled callback.

    Attributes:
        address: Of its code.
        slot: MuJoCo's variable mjcb_control. Setting it through the Python binding costs as much as two steps' laws.
    """

    address: int
    slot: ctypes.c_void_p


@cache
def callback(way: Way) -> Callback:
    """The callback for motor sides that are moved by torque, by torque with friction under load, or by a motion.

    Raises:
        RefusedError: MuJoCo is not installed as its Python package brings it.
    """
    folder = Path(str(_mujoco.__file__)).parent
    library = sorted({*folder.glob("libmujoco.*"), *folder.glob("mujoco.dll")})
    if not library:
        raise RefusedError(f"MuJoCo's library is not beside its Python package in {folder}; install it from PyPI.")
    slot = ctypes.c_void_p.in_dll(ctypes.CDLL(str(library[0])), "mjcb_control")
    return Callback(int(_compiled(way).address), slot)


def step_with_drives(model: Any, data: Any, steps: int, book: int, drives: Callback) -> None:
    """Step a model of one of our engines that many times, the callback set.

    Args:
        model: mjModel.
        data: Its mjData.
        steps: How many.
        book: Address of the engine's book.
        drives: The callback.
    """
    address, slot = drives
    with _LOCK:
        before = slot.value
        _CURRENT[0] = book
        slot.value = address
        try:
            _step(model, data, steps)
        finally:
            slot.value = before
