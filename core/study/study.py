"""A parametric study: many variants of one robot, run alike."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from ..control import Control
from ..effects import catalogue, effect_named
from ..errors import UsageError
from ..motion import hold, motion_named
from ..representation import JointKind
from ..simulation import backend_named
from ..simulation.run import DEFAULT_RATE
from .design import Design, Sampling, design
from .experiment import NOMINAL, Experiment
from .figures import figure_units
from .parameter import Parameter, parse_vary
from .values import value_at

if TYPE_CHECKING:
    from ..database import Database
    from ..motion import MotionLaw

SCHEMA = "mbexport-study/1"
_LIBRARIES = ("mbexport", "numpy", "scipy", "SALib")


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """All variants, and how each is run.

    Attributes:
        experiment: What they share.
        design: Which they are.
    """

    experiment: Experiment
    design: Design

    def tasks(self) -> Iterator[tuple[int, tuple[float, ...] | None]]:
        """Number and values of every variant, the nominal one first."""
        yield NOMINAL, None
        for variant, values in enumerate(self.design.values.tolist()):
            yield variant, tuple(values)

    def hash(self) -> str:
        """SHA-256 of all that the results depend on, hex."""
        motion = self.experiment.motion
        hashed = hashlib.sha256(json.dumps(self._conditions(), sort_keys=True).encode())
        for array in (motion.knots, motion.coefficients, self.design.values, self.design.unit):
            hashed.update(repr(array.shape).encode())
            hashed.update(array.tobytes())
        return hashed.hexdigest()

    def facts(self) -> dict[str, Any]:
        """Content of study.json: what was varied and how it was run; nothing of when, where and by how many."""
        database, plan = self.experiment.database, self.design
        kinds: tuple[JointKind, ...] = tuple(joint.kind for joint in database.joints)
        return {
            "schema": SCHEMA,
            "study": self.hash(),
            **self._conditions(),
            "variants": len(plan),
            "columns": {
                **{parameter.name: parameter.unit for parameter in plan.parameters},
                **figure_units(kinds),
            },
            "versions": {name: _version(name) for name in _LIBRARIES},
        }

    def _conditions(self) -> dict[str, Any]:
        experiment, plan = self.experiment, self.design
        backend = backend_named(experiment.backend)
        return {
            "robot": experiment.database.name,
            "source_hash": experiment.database.content_hash(),
            "level": experiment.level if experiment.effects is None else None,
            "effects": list(experiment.effects_used()),
            "backend": backend.name,
            "engine": backend.engine,
            "engine_version": backend.version(),
            "integrator": backend.integrator,
            "control": experiment.control.to_mapping(),
            "duration": experiment.duration,
            "rate": experiment.rate,
            "sampling": plan.sampling,
            "seed": plan.seed,
            "parameters": [_parameter_facts(parameter) for parameter in plan.parameters],
            "mbexport": _version("mbexport"),
        }


def plan_study(
    database: Database,
    vary: Sequence[str],
    *,
    level: str | None = None,
    effects: Sequence[str] | None = None,
    backend: str = "mjcf",
    motion: MotionLaw | str = "greca",
    control: Control | None = None,
    duration: float | None = None,
    rate: float = DEFAULT_RATE,
    sampling: Sampling = "grid",
    count: int | None = None,
    seed: int = 0,
) -> Study:
    """A study, checked as far as that goes without running it.

    Args:
        database: The robot.
        vary: What varies, as `parse_vary` reads it.
        level: Of all variants; None: full.
        effects: Names of effects instead of a level.
        backend: Name of the backend.
        motion: Commanded motion, or its name; of the robot as the database stands.
        control: Controller; None imposes the motion.
        duration: [s]; None: the motion's.
        rate: Rate of the record, over whose samples the figures are taken [Hz].
        sampling: How variants are chosen, see `design`.
        count: Of variants, for samples.
        seed: Of samples.

    Raises:
        UsageError: What does not fit together.
    """
    parameters = [parameter for text in vary for parameter in parse_vary(text, database)]
    plan = design(parameters, sampling, count, seed)
    rules = control or Control()
    if rules.mode not in ("motion", "pd"):
        raise UsageError(f"a study runs under control mode motion or pd, not {rules.mode}.")
    places = tuple(parameter.place for parameter in parameters)
    chosen = None if effects is None else tuple(sorted(set(effects)))
    backend_named(backend)
    still = hold(tuple(joint.home for joint in database.joints), 1.0)
    experiment = Experiment(database, places, level, chosen, backend, still, rules, 1.0, rate)
    # so that a wrong level is one error, not one a variant
    nominal = experiment.robot()
    _check_effects(experiment, plan)
    law = motion_named(nominal, motion, database) if isinstance(motion, str) else motion
    length = law.duration if duration is None else duration
    if not length > 0.0:
        raise UsageError(f"--duration {length!r}: it must be above 0.")
    if not rate > 0.0:
        raise UsageError(f"--rate {rate!r}: it must be above 0.")
    return Study(replace(experiment, motion=law, duration=length), plan)


def _check_effects(experiment: Experiment, plan: Design) -> None:
    """What varies must act, and a row that the database lacks must be given whole."""
    database, used = experiment.database, experiment.effects_used()
    given = {place.name for place in experiment.places}
    for parameter in plan.parameters:
        place = parameter.place
        if place.table not in catalogue():
            continue
        if place.table not in used:
            level = "--with" if experiment.effects is not None else f"level {experiment.level!r}"
            raise UsageError(f"{place.name} varies, but {level} does not use {place.table}.")
        if value_at(database, place) is None:
            for column in effect_named(place.table).columns:
                other = replace(place, column=column.name)
                if column.default is None and other.name not in given:
                    raise UsageError(
                        f"{database.name} has no {place.table} at {place.name.partition('@')[2]}, so {other.name} must "
                        f"be given too, such as --vary '{place.table}.{column.name}[SI]@"
                        f"{place.name.partition('@')[2]}=VALUE'."
                    )


def _parameter_facts(parameter: Parameter) -> dict[str, Any]:
    """What a reader of study.json needs to know of a parameter; numbers in SI."""
    facts: dict[str, Any] = {"name": parameter.name, "unit": parameter.unit}
    if parameter.factors:
        facts["database"] = parameter.scale
        facts["factors"] = [parameter.low, parameter.high]
    facts["values"] = [parameter.scale * parameter.low, parameter.scale * parameter.high]
    if parameter.listed:
        facts["listed"] = [parameter.scale * x for x in parameter.listed]
    facts["spacing"] = parameter.spacing
    return facts


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
