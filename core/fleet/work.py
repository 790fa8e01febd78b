"""One case diagnosed, wherever there is room."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version

import numpy as np

from ..diagnosis import named
from ..diagnosis.diagnosis import Diagnosis
from ..diagnosis.written import files_of
from ..errors import MbexportError
from ..simulation import backend_named
from .cases import Case


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a case.

    Attributes:
        number: Its place among the cases, from 0.
        files: Relative path to text of its diagnosis; {} where it failed.
        failed: "" where there is a diagnosis; "refused": bad input, or an engine refused; "crashed": the process that
            ran it died.
        reason: Why it failed, as a sentence.
    """

    number: int
    files: Mapping[str, str] = field(default_factory=dict[str, str])
    failed: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Diagnosing:
    """What all cases share; it travels to other processes and machines, which must see the same folders.

    Attributes:
        level: Of the nominal models.
        backend: Engine in which candidates are simulated.
        backends: Where corrected robots are simulated again; None: everywhere.
        page: Diagnosis to its page as HTML.
    """

    level: str
    backend: str
    backends: tuple[str, ...] | None
    page: Callable[[Diagnosis], str]

    def run(self, number: int, case: Case) -> Outcome:
        """A case diagnosed; what cannot be is an outcome too."""
        try:
            # an engine may warn before it gives up; the outcome says so
            with np.errstate(all="ignore"):
                found = named.diagnose(
                    case.robot,
                    case.runs,
                    () if case.holdout is None else case.holdout,
                    level=self.level,
                    backend=self.backend,
                    backends=self.backends,
                )
                return Outcome(number, files_of(found, self.page(found)))
        except MbexportError as error:
            return Outcome(number, {}, "refused", str(error))
        except (ArithmeticError, LookupError, RuntimeError, ValueError) as error:
            # one robot that nobody thought of must not end the others
            return Outcome(number, {}, "refused", f"{type(error).__name__}: {error}")

    def died(self, number: int, case: Case) -> Outcome:
        """What becomes of a case that its process died of."""
        return Outcome(number, {}, "crashed", "the process that ran it died.")

    def versions(self) -> dict[str, str]:
        """Versions that results depend on, on the machine that is asked."""
        engine = backend_named(self.backend).version()
        return {"mbexport": version("mbexport"), "numpy": version("numpy"), self.backend: engine}
