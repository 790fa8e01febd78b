"""The equations of a co-simulation unit in C: bodies, drives, laws and motion, from the texts that Numba compiles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

from ..core.errors import RefusedError
from ..core.kinematics import rigid_body
from ..core.motion import evaluate
from ..core.simulation import drive_law
from ..core.simulation.compiled import law_function
from .c_text import DOUBLE, INT, CType, Signature, Struct, UntranslatableError, array, c_function

JOINT = array("N_JOINTS")
MATRIX = array("N_JOINTS", "N_JOINTS")
ROTATIONS = array("N_JOINTS", "3", "3")
POSITIONS = array("N_JOINTS", "3")
ROTATION, POSITION, WRENCH = array("3", "3"), array("3"), array("6")
PARAMETERS = array("8")

CHAIN: Struct = {
    "kind": array("N_JOINTS", base="int"),
    "rotation": ROTATIONS,
    "position": POSITIONS,
    "mass": JOINT,
    "com": POSITIONS,
    "tensor": ROTATIONS,
    "gravity": POSITION,
}
DRIVES: Struct = {
    **dict.fromkeys(drive_law.DriveTable._fields, JOINT),
    "elastic": array("N_JOINTS", base="int"),
    "first": array("N_JOINTS + 1", base="int"),
    "kinds": array("N_TERMS", base="int"),
    "laws": array("N_TERMS", base="law_function"),
    "parameters": array("N_TERMS", "8"),
    "slip_first": array("N_JOINTS + 1", base="int"),
    "slip_stiffness": array("N_SLIPS"),
    "slip_level": array("N_SLIPS"),
}
MOTION: Struct = {"knots": array("N_KNOTS"), "coefficients": array("N_POWERS", "N_KNOTS - 1", "N_JOINTS")}
STRUCTS = {"ChainTable": CHAIN, "DriveTable": DRIVES, "MotionTable": MOTION}

_LAW_ARGUMENTS = {"p": PARAMETERS, **dict.fromkeys(("t", "theta", "dtheta", "q", "dq", "load"), DOUBLE)}
_CHAIN, _DRIVES, _MOTION = (CType(name, struct=True) for name in STRUCTS)
_PLACED = {"table": _CHAIN, "rotation": ROTATIONS, "position": POSITIONS}
_TORQUES = {
    "table": _DRIVES,
    "stick_anchor": JOINT,
    "slip_anchor": array("N_SLIPS"),
    "t": DOUBLE,
    **dict.fromkeys(("q", "dq", "theta", "dtheta", "load", "transmitted", "reaction", "friction", "on_arm"), JOINT),
    "accept": INT,
}
# in the order in which C wants to read them
KERNELS: tuple[tuple[Any, Signature], ...] = (
    (
        rigid_body.place_joints,
        Signature("place_joints", {"table": _CHAIN, "q": JOINT, "rotation": ROTATIONS, "position": POSITIONS}),
    ),
    (rigid_body.carry_wrench, Signature("carry_wrench", {"r": ROTATION, "p": POSITION, "wrench": WRENCH})),
    (
        rigid_body.newton_euler,
        Signature("newton_euler", {**_PLACED, "dq": JOINT, "ddq": JOINT, "out": JOINT}),
    ),
    (rigid_body.composite_inertia, Signature("composite_inertia", {**_PLACED, "M": MATRIX})),
    (drive_law.call_law, Signature("call_law", {"law": CType("law_function"), **_LAW_ARGUMENTS}, DOUBLE)),
    (
        drive_law.transmitted_torque,
        Signature(
            "transmitted_torque",
            dict.fromkeys(("stiffness", "damping", "half_gap", "stretch", "dstretch"), DOUBLE),
            DOUBLE,
        ),
    ),
    (drive_law.drive_torques, Signature("drive_torques", _TORQUES)),
    (drive_law.factorised, Signature("factorised", {"matrix": MATRIX})),
    (drive_law.solved, Signature("solved", {"factor": MATRIX, "x": JOINT})),
    (
        drive_law.loaded_torques,
        Signature(
            "loaded_torques",
            {**_TORQUES, "command": JOINT, "mass_matrix": MATRIX, "bias": JOINT, "factor": MATRIX, "ddq": JOINT},
        ),
    ),
    (
        evaluate.motion_at,
        Signature("motion_at", {"t": DOUBLE, "table": _MOTION, "q": JOINT, "dq": JOINT, "ddq": JOINT}),
    ),
)
_KNOWN = {function.__name__: signature for function, signature in KERNELS}


def law_name(effect: str, law: str) -> str:
    """Name of a law in C."""
    return f"law_{effect}_{law}"


def struct_text(name: str) -> str:
    """Definition of one of the structs."""
    fields = "\n".join(f"    {kind.declared(part)};" for part, kind in STRUCTS[name].items())
    return f"typedef struct {{\n{fields}\n}} {name};\n"


@cache
def kernel_text() -> str:
    """Structs and equations."""
    arguments = ", ".join(kind.declared(name) for name, kind in _LAW_ARGUMENTS.items())
    head = f"typedef double (*law_function)({arguments});\n"
    structs = [struct_text(name) for name in STRUCTS]
    return "\n".join([head, *structs, *(c_function(text, said, STRUCTS, _KNOWN) for text, said in KERNELS)])


def law_text(laws: Sequence[tuple[str, str]]) -> str:
    """The laws of effects, each once.

    Args:
        laws: (effect, law) of each.

    Raises:
        RefusedError: A law's text has no form in C; the message names it.
    """
    texts: list[str] = []
    for effect, law in laws:
        try:
            texts.append(
                c_function(law_function(effect, law), Signature(law_name(effect, law), _LAW_ARGUMENTS, DOUBLE))
            )
        except UntranslatableError as error:
            raise RefusedError(f"fmu: the law {law!r} of {effect} has no form in C: {error}.") from error
    return "\n".join(texts)
