"""From the drives as plain data to the arrays of their equations; emitted scripts carry this text verbatim."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from .drive_law import ARM, ERROR, ERROR_SLOPE, LEVEL, RESISTANCE, DriveTable


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
    kinds = {"level": LEVEL, "resistance": RESISTANCE, "arm": ARM, "error": ERROR, "error_slope": ERROR_SLOPE}
    parameters = np.zeros((len(terms), 8))
    for row, term in zip(parameters, terms, strict=True):
        row[: len(term["parameters"])] = term["parameters"]
    laws = [law_of(term["effect"], term["law"]) for term in terms]
    addresses = all(isinstance(law, int) for law in laws)

    def of_spring(name: str) -> Any:
        return np.array([joint["spring"][name] if joint["spring"] else 0.0 for joint in joints])

    def of_stick(name: str) -> Any:
        return np.array([joint["stick"][name] if joint["stick"] else 0.0 for joint in joints])

    def first(name: str) -> Any:
        return np.cumsum([0, *(len(joint[name]) for joint in joints)], dtype=np.int64)

    # all springs on an arm pull as one: the sum of their stiffnesses, at the mean of their rests
    pull = [sum(spring["stiffness"] for spring in joint["arm_springs"]) for joint in joints]
    moment = [sum(spring["stiffness"] * spring["rest"] for spring in joint["arm_springs"]) for joint in joints]
    return DriveTable(
        inertia=np.array([joint["inertia"] for joint in joints]),
        elastic=np.array([joint["spring"] is not None for joint in joints], dtype=np.int64),
        stiffness=of_spring("stiffness"),
        spring_damping=of_spring("damping"),
        half_gap=of_spring("gap") / 2,
        damping=np.array([0.0 if "damping" in native else joint["damping"] for joint in joints]),
        gain=np.array([joint["gain"] for joint in joints]),
        arm_stiffness=np.array([0.0 if "arm_springs" in native else float(k) for k in pull]),
        arm_rest=np.array([m / k if k else 0.0 for m, k in zip(moment, pull, strict=True)]),
        stick_displacement=of_stick("displacement") * (friction["model"] == "stick"),
        stick_time=of_stick("time"),
        smooth_velocity=np.array([friction["velocity"] for _ in joints]),
        first=first("terms"),
        kinds=np.array([kinds[term["kind"]] for term in terms], dtype=np.int64),
        laws=np.array(laws, dtype=np.int64) if addresses else laws,
        parameters=parameters,
        slip_first=first("slips"),
        slip_stiffness=np.array([float(slip["stiffness"]) for slip in slips]),
        slip_level=np.array([float(slip["level"]) for slip in slips]),
    )
