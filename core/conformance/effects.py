"""Every effect of the catalogue, alone and together: realised as its law says, or refused by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..agreement.quantities import STATICS
from ..agreement.samples import SAMPLED, sampled
from ..agreement.scenarios import SCENARIOS
from ..build import build
from ..errors import RefusedError
from .check import Check, Refusals, must
from .emission import told
from .subject import Subject, database
from .together import compared

ROBOT = "planar2r"
# of a run [s] at most: long enough for an effect to show, for there are many of them
DURATION = 0.5
COMBINATIONS = 3
TOGETHER = 5
QUICK = ("delay", "hysteresis", "joint_compliance_6d", "load_friction", "transmission_error")


def checks() -> Iterator[Check]:
    """Of this module."""
    for name in SAMPLED:
        yield Check("effect", name, lambda subject, name=name: realised(subject, [name]), name in QUICK)
    for number in range(1, COMBINATIONS + 1):
        yield Check("effects", str(number), lambda subject, number=number: realised(subject, combination(number)))


def combination(number: int) -> list[str]:
    """Names of some effects, drawn; the same for the same number."""
    drawn = np.random.default_rng([2013, number]).choice(SAMPLED, TOGETHER, replace=False)
    return sorted(str(name) for name in drawn)


def realised(subject: Subject, names: Sequence[str]) -> Refusals:
    """Statics and runs of a robot with these effects agree, and the concept report speaks of them."""
    source = sampled(database(ROBOT), names)
    model = build(source)
    try:
        told(subject, model)
    except RefusedError as error:
        must(any(name in str(error) for name in names), f"it refuses to emit and names none of {names}: {error}")
    return compared(subject, source, (*STATICS, *SCENARIOS), duration=min(DURATION, subject.duration))
