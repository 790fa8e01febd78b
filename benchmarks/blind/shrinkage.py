"""How far a gap truly shrinks with the effects that a diagnosis found: by the generator's engine, without noise.

The true robot's held-out run is simulated, and the same run of two others: the database's, and the database's with
what was found; the one example's tolerances are drawn in all three, so that they, which no effect is blamed for, are in
neither gap. Channels (speeds aside) count in units of their noise floor; over the channels of a signal, and over
signals, root of the mean square: shrinkage = 1 - gap after / gap before. Mode unknown: torques along the true motion.
Mode torque: what differing torques move in half a second, from the true state, again and again.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from apart import Asked, Scene, Track
from design import Judge, as_simulated, law_of
from world import COLUMN, World, simulate, world_of

# a gap, in units of noise, that is one of rounding
NOTHING = 1.0e-6


def place_number(at: str) -> int:
    """0 for the robot, N for joint_N and arm_N."""
    return 0 if at == "robot" else int(at.partition("_")[2])


def corrected(recipe: dict, found: list[dict]) -> World:
    """The database's robot with rows replaced by what was found, as this example of it was drawn."""
    database = {effect: {at: dict(row) for at, row in rows.items()} for effect, rows in recipe["database"].items()}
    for finding in found:
        told = {name: p["value"] for name, p in finding["parameters"].items() if p.get("value") is not None}
        # numbers that no run shows stand in the tables, and those that are shown go with them
        row = {name: float(value) for name, value in (finding.get("row") or told).items()}
        database.setdefault(finding["effect"], {})[str(place_number(finding["at"]))] = row
    return world_of({**recipe, "database": database}, [], drawn=recipe["drawn"])


def differences(judge: Judge, other: World, rows: list[dict]) -> list[list[np.ndarray]]:
    """Between the true robot and another one on each of some runs, a signal each, in units of the noise floor."""
    scene = Scene(judge.recipe, None, rows, without=other, judge=judge)
    if scene.mode not in ("torque", "unknown"):
        return [signals(scene, other, track, row) for track, row in zip(scene.paths, rows, strict=True)]
    gains = scene.truth.drives[:, COLUMN["gain"]] - other.drives[:, COLUMN["gain"]]
    lengths = [3 if name == "ee" else scene.n for name in scene.floors]
    out = []
    for track in scene.paths:
        asked = track.asked_by(scene.truth)
        asked = Asked(**{**vars(asked), "extra": (track.tau * gains)[:, :, None], "reported": False})
        out.append(split(track.shown(asked)[:, 0], lengths, len(track.thin)))
    return out


def gap(judge: Judge, other: World) -> float:
    """Between the true robot and another one on the held-out run, in units of the noise floor."""
    (parts,) = differences(judge, other, judge.recipe["runs"][-1:])
    with np.errstate(over="ignore", invalid="ignore"):
        return math.sqrt(float(np.mean([np.mean(np.square(part)) for part in parts])))


def left_by(recipe: dict, found: list[dict]) -> float:
    """Part of the gap's energy on all runs that the robot with what was found leaves; nan where there is no gap."""
    judge = Judge(recipe)

    def energy(other: World) -> float:
        with np.errstate(over="ignore", invalid="ignore"):
            parts = itertools.chain(*differences(judge, other, recipe["runs"]))
            return float(sum(np.sum(np.square(part)) for part in parts))

    before = energy(world_of(recipe, [], drawn=recipe["drawn"]))
    return energy(corrected(recipe, found)) / before if before > NOTHING**2 else math.nan


def split(values: np.ndarray, lengths: list[int], m: int) -> list[np.ndarray]:
    ends = np.cumsum([m * length for length in lengths])[:-1]
    return np.split(values, ends)


def signals(scene: Scene, other: World, track: Track, row: dict) -> list[np.ndarray]:
    """Difference of each signal under the same command and controller, in units of noise."""
    law = law_of(scene.recipe, row)
    run = simulate(as_simulated(scene.recipe), other, law, track.seconds)
    return [(track.true.channel(name) - run.channel(name))[track.thin] / floor for name, floor in scene.floors.items()]


def true_shrinkage(recipe: dict, found: list[dict]) -> tuple[float, float] | None:
    """(1 - gap after / gap before, gap before in units of noise); None where the channels judged by show no gap.

    In mode torque these are positions alone: what is wrong with a torque sensor moves none.
    """
    judge = Judge(recipe)
    before = gap(judge, world_of(recipe, [], drawn=recipe["drawn"]))
    if before < NOTHING:
        return None
    after = gap(judge, corrected(recipe, found)) if found else before
    if not math.isfinite(after):
        return -math.inf, before
    return 1.0 - after / before, before
