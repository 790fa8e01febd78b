"""A running model behind one number, for compiled code that an engine calls or that is called at every stage.

A book is an int64 array: sizes, flags and the addresses of the arrays of one running model. A C function that gets the
book's address finds everything else, and costs a third of a microsecond to call from Python.

This module imports Numba; import it only where something runs.
"""

from __future__ import annotations

import hashlib
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..motion import evaluate
from ..motion.evaluate import MotionTable
from . import drive_law
from .compiled import teach_numba
from .drive_law import DriveMemory, DriveTable
from .drives import Drives

if TYPE_CHECKING:
    from ..motion import MotionLaw

_numba: Any = import_module("numba")
_types: Any = _numba.types
_intrinsic: Any = import_module("numba.extending").intrinsic

# places in a book
JOINTS, TERMS, SLIPS = range(3)
IMPOSED, PIECES, ORDER, KNOTS, COEFFICIENTS = range(3, 8)
Q_REF, DQ_REF, DDQ_REF, Q_ASIDE, DQ_ASIDE = range(8, 13)
MEMORY = 13  # the drives' memory, field by field
TABLE = MEMORY + len(DriveMemory._fields) - 1
ENGINE = TABLE + len(DriveTable._fields)  # the engine's own places begin here
SIZE = ENGINE + 32
# two instants closer than this are one [s]
INSTANT = 1.0e-9


class Book:
    """The arrays of one running model and their addresses.

    Attributes:
        entries: The book itself, shape (SIZE,), int64.
        address: Where it stands.
        q_ref, dq_ref, ddq_ref: Imposed motion of the motor sides, shape (n,).
    """

    def __init__(self, drives: Drives) -> None:
        """A book of drives without imposed motion."""
        n = len(drives.q)
        self.entries = np.zeros(SIZE, dtype=np.int64)
        self.address = int(self.entries.ctypes.data)
        self.q_ref, self.dq_ref, self.ddq_ref = (np.zeros(n) for _ in range(3))
        self._kept: dict[int, Any] = {}
        memory = drives.memory
        self.entries[[JOINTS, TERMS, SLIPS]] = n, len(memory.table.kinds), len(memory.slip_anchor)
        for k, array in enumerate((*memory[:-1], *memory.table)):
            self.put(MEMORY + k, array)
        for place, array in ((Q_REF, self.q_ref), (DQ_REF, self.dq_ref), (DDQ_REF, self.ddq_ref)):
            self.put(place, array)
        for place in (Q_ASIDE, DQ_ASIDE):
            self.put(place, np.zeros(n))

    def put(self, place: int, array: Any) -> None:
        """Write an array's address; it is of float64 or int64, in one piece, and lives as long as the book."""
        self._kept[place] = array
        self.entries[place] = array.ctypes.data

    def impose(self, motion: MotionLaw | None) -> None:
        """Motor sides follow a motion; None: they move freely."""
        self.entries[IMPOSED] = motion is not None
        if motion is not None:
            table = motion.table()
            self.entries[[ORDER, PIECES]] = table.coefficients.shape[:2]
            self.put(KNOTS, table.knots)
            self.put(COEFFICIENTS, table.coefficients)


def _pointer_to(element: Any) -> Any:
    def pointer(typing: Any, address: Any) -> Any:
        kind = _types.CPointer(element)

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(kind))

        return kind(_types.intp), generate

    return _intrinsic(pointer)


_carray: Any = _numba.carray
_float_pointer: Any = _pointer_to(_types.float64)
_integer_pointer: Any = _pointer_to(_types.int64)
teach_numba()
# numpy's error model: no check of every division, which halves the cost
_torques: Any = _numba.njit(error_model="numpy")(drive_law.drive_torques)
_loaded_torques: Any = _numba.njit(error_model="numpy")(drive_law.loaded_torques)
_motion: Any = _numba.njit(error_model="numpy")(evaluate.motion_at)
_factorised: Any = drive_law.factorised
_solved: Any = drive_law.solved


@_numba.njit
def floats(address: int, count: int) -> Any:
    """The array of that many floats at an address; compiled code only."""
    return _carray(_float_pointer(address), (count,))


@_numba.njit
def integers(address: int, count: int) -> Any:
    """The array of that many integers at an address; compiled code only."""
    return _carray(_integer_pointer(address), (count,))


@_numba.njit
def drive_memory_at(book: Any) -> Any:
    """The drives' memory of a book; compiled code only."""
    n = book[JOINTS]
    m = book[TERMS]
    s = book[SLIPS]
    return DriveMemory(
        floats(book[MEMORY], n),
        floats(book[MEMORY + 1], n),
        floats(book[MEMORY + 2], n),
        floats(book[MEMORY + 3], n),
        floats(book[MEMORY + 4], n),
        floats(book[MEMORY + 5], n),
        floats(book[MEMORY + 6], n),
        floats(book[MEMORY + 7], n),
        floats(book[MEMORY + 8], n),
        floats(book[MEMORY + 9], n),
        floats(book[MEMORY + 10], s),
        DriveTable(
            floats(book[TABLE], n),
            integers(book[TABLE + 1], n),
            floats(book[TABLE + 2], n),
            floats(book[TABLE + 3], n),
            floats(book[TABLE + 4], n),
            floats(book[TABLE + 5], n),
            floats(book[TABLE + 6], n),
            floats(book[TABLE + 7], n),
            floats(book[TABLE + 8], n),
            floats(book[TABLE + 9], n),
            floats(book[TABLE + 10], n),
            floats(book[TABLE + 11], n),
            integers(book[TABLE + 12], n + 1),
            integers(book[TABLE + 13], m),
            integers(book[TABLE + 14], m),
            _carray(_float_pointer(book[TABLE + 15]), (m, 8)),
            integers(book[TABLE + 16], n + 1),
            floats(book[TABLE + 17], s),
            floats(book[TABLE + 18], s),
        ),
    )


@_numba.njit
def evaluate_drives(memory: Any, t: float, accept: bool) -> None:
    """`drive_law.drive_torques` at the state that stands in the drives' memory."""
    _torques(
        memory.table,
        memory.stick_anchor,
        memory.slip_anchor,
        t,
        memory.q,
        memory.dq,
        memory.theta,
        memory.dtheta,
        memory.load,
        memory.transmitted,
        memory.reaction,
        memory.friction,
        memory.on_arm,
        accept,
    )


@_numba.njit
def evaluate_loaded_drives(
    memory: Any, t: float, accept: bool, command: Any, mass_matrix: Any, bias: Any, factor: Any, ddq: Any
) -> None:
    """`drive_law.loaded_torques` at the state that stands in the drives' memory."""
    _loaded_torques(
        memory.table,
        memory.stick_anchor,
        memory.slip_anchor,
        t,
        memory.q,
        memory.dq,
        memory.theta,
        memory.dtheta,
        memory.load,
        memory.transmitted,
        memory.reaction,
        memory.friction,
        memory.on_arm,
        accept,
        command,
        mass_matrix,
        bias,
        factor,
        ddq,
    )


@_numba.njit
def motion_reference(book: Any, n: int) -> Any:
    """Where `follow_motion` wrote: positions, speeds and accelerations of n joints."""
    return floats(book[Q_REF], n), floats(book[DQ_REF], n), floats(book[DDQ_REF], n)


@_numba.njit
def _motion_table(book: Any, n: int) -> Any:
    return MotionTable(
        floats(book[KNOTS], book[PIECES] + 1),
        _carray(_float_pointer(book[COEFFICIENTS]), (book[ORDER], book[PIECES], n)),
    )


@_numba.njit
def follow_motion(book: Any, n: int, t: float) -> None:
    """The imposed motion of n joints at time t [s] into the book's q_ref, dq_ref and ddq_ref."""
    q_ref, dq_ref, ddq_ref = motion_reference(book, n)
    _motion(t, _motion_table(book, n), q_ref, dq_ref, ddq_ref)


@_numba.njit
def follow_acceleration(book: Any, n: int, t: float, stage: int) -> None:
    """The imposed acceleration as a stage of a step sees it, into the book's ddq_ref.

    A law's acceleration jumps at its knots. A step that begins there is on the piece after, one that ends there on the
    piece before: else a Runge-Kutta step would lose its order at every knot.
    """
    side = INSTANT if stage == 0 else -INSTANT if stage == 3 else 0.0
    aside = floats(book[Q_ASIDE], n)
    _motion(t + side, _motion_table(book, n), aside, floats(book[DQ_ASIDE], n), floats(book[DDQ_REF], n))


@_numba.njit
def accelerate_elastic(
    mass_matrix: Any, bias: Any, torque: Any, order: Any, count: int, factor: Any, vector: Any, acceleration: Any
) -> None:
    """Accelerations of the elastic joints' arms where those of the rigid joints are imposed.

    Args:
        mass_matrix: Of the arms, shape (n, n).
        bias: Gravity, Coriolis and centrifugal torques, shape (n,).
        torque: On the arms; used at elastic joints, shape (n,).
        order: Elastic joints, then rigid ones, shape (n,).
        count: How many are elastic, e.
        factor: Workspace, shape (e, e).
        vector: Workspace, shape (e,).
        acceleration: In: at rigid joints; out: at elastic ones, shape (n,).
    """
    for k in range(count):
        i = order[k]
        vector[k] = torque[i] - bias[i]
        for r in order[count:]:
            vector[k] -= mass_matrix[i, r] * acceleration[r]
        for m in range(count):
            factor[k, m] = mass_matrix[i, order[m]]
    _factorised(factor)
    _solved(factor, vector)
    for k in range(count):
        acceleration[order[k]] = vector[k]


def source_stamp(*modules: ModuleType) -> int:
    """A number that changes with the text of some modules and of those that this one compiles.

    Numba finds compiled code by the file of its outermost function alone; a function that closes over this number is
    compiled anew when what it calls has changed.
    """
    digest = hashlib.sha256()
    for module in (drive_law, evaluate, import_module(__name__), *modules):
        digest.update(Path(str(module.__file__)).read_bytes())
    return int.from_bytes(digest.digest()[:7], "little")
