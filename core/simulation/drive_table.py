"""From the drives as plain data to the arrays of their equations; emitted scripts carry this text verbatim."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from .drive_law import ARM, COUPLED, ERROR, ERROR_SLOPE, LEVEL, RESISTANCE, DriveMemory, DriveTable


def drive_table(data: dict[str, Any], law_of: Callable[[str, str], Any], native: Collection[str] = ()) -> DriveTable:
    """Arrays for the drives' equations.

    Args:
        data: As `DriveSheet.to_data` gives it.
        law_of: (effect, law) -> its address, or its function where the text runs uncompiled.
        native: What the engine does by itself and the equations shall leave out: "damping" (linear friction),
            "arm_springs".
    """
    joints = data["joints"]
    friction = data["friction"]
    terms = [term for joint in joints for term in joint["terms"]]
    slips = [slip for joint in joints for slip in joint["slips"]]
    kinds = {
        "level": LEVEL,
        "resistance": RESISTANCE,
        "arm": ARM,
        "error": ERROR,
        "error_slope": ERROR_SLOPE,
        "coupled": COUPLED,
    }
    parameters = np.zeros((len(terms), 8))
    for row, term in zip(parameters, terms, strict=True):
        row[: len(term["parameters"])] = term["parameters"]
    laws = [law_of(term["effect"], term["law"]) for term in terms]
    addresses = all(isinstance(law, int) for law in laws)

    def each(name: str) -> Any:
        return np.array([joint[name] for joint in joints], dtype=float)

    def part(of: str, name: str) -> Any:
        return np.array([joint[of][name] if joint[of] else 0.0 for joint in joints], dtype=float)

    def first(name: str) -> Any:
        return np.cumsum([0, *(len(joint[name]) for joint in joints)], dtype=np.int64)

    # all springs on an arm pull as one: the sum of their stiffnesses, at the mean of their rests
    pull = [sum(spring["stiffness"] for spring in joint["arm_springs"]) for joint in joints]
    moment = [sum(spring["stiffness"] * spring["rest"] for spring in joint["arm_springs"]) for joint in joints]
    return DriveTable(
        inertia=each("inertia"),
        elastic=np.array([joint["spring"] is not None for joint in joints], dtype=np.int64),
        stiffness=part("spring", "stiffness"),
        spring_damping=part("spring", "damping"),
        half_gap=part("spring", "gap") / 2,
        damping=each("damping") * ("damping" not in native),
        gain=each("gain"),
        arm_stiffness=np.array(pull, dtype=float) * ("arm_springs" not in native),
        arm_rest=np.array([m / k if k else 0.0 for m, k in zip(moment, pull, strict=True)]),
        stick_displacement=part("stick", "displacement") * (friction["model"] == "stick"),
        stick_time=part("stick", "time"),
        smooth_velocity=np.full(len(joints), float(friction["velocity"])),
        first=first("terms"),
        kinds=np.array([kinds[term["kind"]] for term in terms], dtype=np.int64),
        laws=np.array(laws, dtype=np.int64) if addresses else laws,
        parameters=parameters,
        slip_first=first("slips"),
        slip_stiffness=np.array([slip["stiffness"] for slip in slips], dtype=float),
        slip_level=np.array([slip["level"] for slip in slips], dtype=float),
    )


def drive_memory(table: DriveTable) -> DriveMemory:
    """Memory for a table, everything at zero."""
    n = len(table.inertia)
    return DriveMemory._make([*(np.zeros(n) for _ in range(10)), np.zeros(len(table.slip_level)), table])


def relax(memory: DriveMemory) -> None:
    """Friction and hysteresis at zero force at the state that stands in memory."""
    table = memory.table
    memory.stick_anchor[:] = memory.theta + table.stick_time * memory.dtheta
    memory.slip_anchor[:] = np.repeat(memory.theta, np.diff(table.slip_first))
