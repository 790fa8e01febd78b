"""MuJoCo's own functions by address, which compiled code calls as they are."""

from __future__ import annotations

import ctypes
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ..core.errors import RefusedError

_types: Any = import_module("numba").types
_ir: Any = import_module("llvmlite.ir")
_mujoco: Any = import_module("mujoco")


@cache
def library() -> ctypes.CDLL:
    """MuJoCo's library.

    Raises:
        RefusedError: MuJoCo is not installed as its Python package brings it.
    """
    folder = Path(str(_mujoco.__file__)).parent
    files = sorted({*folder.glob("libmujoco.*"), *folder.glob("mujoco.dll")})
    if not files:
        raise RefusedError(f"MuJoCo's library is not beside its Python package in {folder}; install it from PyPI.")
    return ctypes.CDLL(str(files[0]))


@cache
def address_of(function: str) -> int:
    """Address of one of its functions.

    Raises:
        RefusedError: As `library`.
    """
    address = ctypes.cast(getattr(library(), function), ctypes.c_void_p).value
    assert address is not None
    return address


def _call(typing: Any, function: Any, model: Any, data: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        address = _ir.IntType(64)
        kind = _ir.FunctionType(_ir.VoidType(), [address, address])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), [args[1], args[2]])
        return context.get_dummy_value()

    return _types.void(_types.intp, _types.intp, _types.intp), generate


# void(const mjModel*, mjData*) by its address, within compiled code
called: Any = import_module("numba.extending").intrinsic(_call)
