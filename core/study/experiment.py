"""One variant of a study: its robot, its run, its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from ..build import build
from ..database import FrozenMap
from ..effects import catalogue
from ..errors import MbexportError, RefusedError, UsageError
from ..kinematics import kinematics
from ..simulation import backend_named
from ..simulation.run import simulate
from .figures import figures_of
from .values import Place, with_values

if TYPE_CHECKING:
    from ..control import Control
    from ..database import Database
    from ..motion import MotionLaw
    from ..representation import Robot

# the variant that is the database as it stands
NOMINAL = -1


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a variant.

    Attributes:
        variant: Its number, from 0; NOMINAL for the database as it stands.
        figures: In the order of `figure_names`; () where it failed.
        failed: "" where it ran; "refused": no robot has these numbers, an engine refused, or the motion did not stay
            finite; "crashed": the process that ran it died.
        reason: Why it failed, as a sentence.
    """

    variant: int
    figures: tuple[float, ...] = ()
    failed: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """What all variants share. It travels to other processes and machines.

    Attributes:
        database: The robot as it stands.
        places: What varies.
        level: Level of complexity; None where `effects` says it.
        effects: Names of effects instead of a level, or None.
        backend: Name of the backend.
        motion: Commanded joint motion, of the robot as it stands, the same for all variants.
        control: Controller; mode motion imposes the motion.
        duration: [s].
        rate: Rate of the record [Hz].
    """

    database: Database
    places: tuple[Place, ...]
    level: str | None
    effects: tuple[str, ...] | None
    backend: str
    motion: MotionLaw
    control: Control
    duration: float
    rate: float

    def robot(self) -> Robot:
        """The robot as the database stands.

        Raises:
            UsageError: No such level, or an effect that has no table.
        """
        return self._built(self.database)

    def effects_used(self) -> tuple[str, ...]:
        """Names of the effects that the variants have, sorted."""
        if self.effects is not None:
            return self.effects
        if self.level in (None, "full"):
            return tuple(sorted({*self.database.effects, *self._varied_effects()}))
        return self.database.level_effects(self.level)

    def _varied_effects(self) -> set[str]:
        return {place.table for place in self.places} & set(catalogue())

    def run(self, variant: int, values: Sequence[float] | None) -> Outcome:
        """A variant simulated; what cannot be is an outcome too.

        Args:
            variant: Its number.
            values: SI, one a place; None: the database as it stands.

        Raises:
            UsageError: Of the nominal variant: the options do not fit together.
        """
        try:
            # an engine may warn before it gives up; the outcome says so
            with np.errstate(all="ignore"):
                return Outcome(variant, self._figures(values))
        except UsageError as error:
            if variant == NOMINAL:
                raise
            return Outcome(variant, (), "refused", str(error))
        except (MbexportError, ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
            return Outcome(variant, (), "refused", str(error) or type(error).__name__)

    def died(self, variant: int, values: Sequence[float] | None) -> Outcome:
        """What becomes of a variant that its process died of."""
        return Outcome(variant, (), "crashed", "the process that ran it died.")

    def versions(self) -> dict[str, str]:
        """Versions that results depend on, on the machine that is asked."""
        engine = backend_named(self.backend).version()
        return {"mbexport": version("mbexport"), "numpy": version("numpy"), self.backend: engine}

    def _figures(self, values: Sequence[float] | None) -> tuple[float, ...]:
        varied = self._varied(values)
        # a controller's feedforward knows the robot as it stands, not the variant
        nominal = None if values is None or self.control.mode != "pd" else self.robot()
        trace = simulate(
            self._built(varied),
            self.backend,
            self.motion,
            self.control,
            duration=self.duration,
            rate=self.rate,
            nominal=nominal,
        )
        rigid = kinematics(build(varied, effects=()))
        figures = figures_of(trace, rigid.tool_in_base(self.motion.at(trace.t)[0])[:, :3, 3])
        if not np.isfinite(figures).all():
            raise RefusedError("its figures are not finite.")
        return figures

    def _varied(self, values: Sequence[float] | None) -> Database:
        # what a run does not need would be written out for every variant's hash
        bare = replace(self.database, motions=FrozenMap(), visuals=())
        return bare if values is None else with_values(bare, self.places, values)

    def _built(self, database: Database) -> Robot:
        if self.effects is not None:
            # as the database stands it may lack the table of an effect that varies
            lacking = self._varied_effects() - set(database.effects)
            return build(database, effects=[name for name in self.effects if name not in lacking])
        return build(database, self.level or "full")
