"""The drives' equations compiled by Numba: the kernel once, every law once, joined by function addresses."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from types import CellType, CodeType, FunctionType
from typing import Any

from ..effects import law_named
from . import drive_law


def _numba(module: str = "") -> Any:
    """Numba (untyped), loaded when first needed: half a second."""
    return import_module("numba" + module)


@cache
def teach_numba() -> None:
    """Let compiled text call a law by its address, and the kernel's plain helpers as they stand."""
    ir = import_module("llvmlite.ir")
    types = _numba().types
    extending = _numba(".extending")

    def call_address(typing: Any, law: Any, p: Any, t: Any, theta: Any, dtheta: Any, q: Any, dq: Any, load: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = context.make_array(signature.args[1])(context, builder, args[1])
            double = ir.DoubleType()
            function = ir.FunctionType(double, [array.data.type, *[double] * 6])
            return builder.call(builder.inttoptr(args[0], function.as_pointer()), [array.data, *args[2:]])

        return types.float64(types.intp, p, *[types.float64] * 6), generate

    call = extending.intrinsic(call_address)

    def law_by_address(law: Any, p: Any, t: Any, theta: Any, dtheta: Any, q: Any, dq: Any, load: Any) -> Any:
        def implementation(law: Any, p: Any, t: Any, theta: Any, dtheta: Any, q: Any, dq: Any, load: Any) -> Any:
            return call(law, p, t, theta, dtheta, q, dq, load)

        return implementation if isinstance(law, types.Integer) else None

    # overload wants the very same signature, annotations included
    law_by_address.__annotations__ = {}
    extending.overload(drive_law.call_law, strict=False)(law_by_address)
    for helper in (
        drive_law.transmitted_torque,
        drive_law.drive_torques,
        drive_law.factorised,
        drive_law.solved,
        drive_law.loaded_torques,
        drive_law.memory_torques,
        drive_law.coordinate_torques,
        drive_law.flat_memory,
    ):
        as_it_stands(helper)


def as_it_stands(function: Any) -> None:
    """Let compiled text call a plain helper function."""
    _numba(".extending").register_jitable(function)


@cache
def compile_text(function: Any) -> Any:
    """A plain function compiled once a process, cached on disk between processes until what it calls has changed."""
    teach_numba()
    return _numba().njit(cache=True, nogil=True)(_stamped(function))


def _stamped(function: FunctionType) -> FunctionType:
    """A copy that closes over the text of all that it calls, and never reads it.

    Numba finds compiled code by the file of its outermost function and by what that closes over: a helper that has
    changed in another file would go on as it was.
    """
    digest = hashlib.sha256()
    for text in _texts(function, set()):
        digest.update(text)
    code = function.__code__
    code = code.replace(co_freevars=(*code.co_freevars, "stamp"))
    cells = (*(function.__closure__ or ()), CellType(digest.hexdigest()))
    copy = FunctionType(code, function.__globals__, function.__name__, function.__defaults__, cells)
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy


def _texts(function: FunctionType, seen: set[str]) -> Iterator[bytes]:
    """The text of a function, of the functions that it names, and of theirs, with the numbers that they name.

    Of what a decorator made for Numba it is that of the function below it.
    """
    code = function.__code__
    yield repr(_text(code)).encode()
    for name in code.co_names:
        value: Any = function.__globals__.get(name)
        value = inspect.unwrap(value)
        if isinstance(value, int | float | str):
            yield f"{name} {value!r}".encode()
        elif isinstance(value, FunctionType) and (place := f"{value.__module__}.{value.__qualname__}") not in seen:
            seen.add(place)
            yield from _texts(value, seen)


def _text(code: CodeType) -> tuple[Any, ...]:
    """What a function does, functions within it included."""
    constants = tuple(_text(one) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.co_code, constants, code.co_names, code.co_varnames


@cache
def compiled_torques() -> Any:
    """`drive_law.flat_torques`, compiled; the laws in the memory's table are addresses."""
    return compile_text(drive_law.flat_torques)


@cache
def compiled_coordinate_torques() -> Any:
    """`drive_law.flat_coordinate_torques`, compiled; the laws in the memory's table are addresses."""
    return compile_text(drive_law.flat_coordinate_torques)


@cache
def compiled_loaded_torques() -> Any:
    """`drive_law.flat_loaded_torques`, compiled."""
    return compile_text(drive_law.flat_loaded_torques)


def uses_load(effect: str, law: str) -> bool:
    """Whether a law asks for the torque that the drive passes to the arm."""
    return law_named(effect, law).uses_load


def reads_arm(effect: str, law: str) -> bool:
    """Whether a law asks where the arm is or how fast it goes."""
    return law_named(effect, law).reads_arm


def law_function(effect: str, law: str) -> Any:
    """The plain function of one law of one effect."""
    return law_named(effect, law).function


@cache
def _compiled_law(effect: str, law: str) -> Any:
    """One law as a C function double(double *p, double t, theta, dtheta, q, dq, load)."""
    types = _numba().types
    signature = types.float64(types.CPointer(types.float64), *[types.float64] * 6)
    return _numba().cfunc(signature, cache=True)(law_function(effect, law))


def law_address(effect: str, law: str) -> int:
    """Address of the compiled law, good while the process lives."""
    return int(_compiled_law(effect, law).address)
