"""A program for a robot whose elastic parts are written as joints: passive joints get no command and no gains."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import RefusedError
from ..expansion import Expansion
from .backend import Program

if TYPE_CHECKING:
    from ..control import Control


def whole_program(whole: Expansion, program: Program) -> Program:
    """The program of the driven joints for the whole robot.

    Raises:
        RefusedError: A feedforward, which knows rigid bodies only, in an emitted script of a robot with passive joints.
    """
    if not whole.passive:
        return program
    motion = program.motion.spread(whole.driven, whole.robot.n)
    return replace(program, motion=motion, control=_spread(whole, program.control))


def _spread(whole: Expansion, control: Control) -> Control:
    if control.feedforward != "none":
        raise RefusedError(
            f"{whole.robot.name}: a script cannot add a feedforward to a robot with bending arms or elastic bearings; "
            "run it by `mbexport simulate`, or leave the feedforward out."
        )

    def fill(values: tuple[float, ...], value: float) -> tuple[float, ...]:
        return tuple(whole.spread(np.array(values), value).tolist()) if values else ()

    return replace(
        control, kp=fill(control.kp, 0.0), kd=fill(control.kd, 0.0), torque_limit=fill(control.torque_limit, math.inf)
    )
