"""Friction that only follows a resistance that grows faster than with its joint's speed, as oil that is stirred."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache

import numpy as np

from .diagnosis import Rejected
from .fit import blocks, spread
from .forms import torque_column
from .held import GROWS, Held, NoLaw
from .judge import Judge
from .refine import Refined, refined
from .tried import ALIKE

# part of what Coulomb's friction lost that Stribeck's may have got more or less
AS_MUCH, BESIDE_IT = 0.5, ("stribeck_friction", "viscous_friction")
# log evidence by which a drag says more than viscous friction that is none
SAYS_MORE = 10.0
GROWS_SAID = "a resistance that grows faster than with the speed of joint {joint}"


def without_growing(judge: Judge, held: Held) -> Held:
    """What holds without the friction that only follows, together, what grows faster than with a joint's speed.

    Coulomb's is less than it was known to be by as much as Stribeck's is more, and there is more viscous friction:
    near rest nothing has changed, and above it what they make together is bent upwards, as no friction is. Or
    Coulomb's is less and viscous friction more, and what goes with the speed's square says as much as both. More
    viscous friction alone, of which that says more, stays as the catalogue's nearest.
    """
    before = {
        (name, row.at): row.values
        for name in ("coulomb_friction", *BESIDE_IT)
        for row in judge.whole.known.get(name, ())
    }
    totals = {item.key: item.row.values for item in held.found}
    # the same whichever joint is asked about
    fit: Callable[[], Refined] = cache(
        lambda: refined(judge.whole, judge.whiten, held.found, blocks(judge.whole.evidence))
    )
    for joint in range(1, judge.database.n + 1):
        laws = [(effect, joint) for effect in ("coulomb_friction", *BESIDE_IT)]
        less, more, faster = (
            totals[law][name] - (before[law][name] if law in before else 0.0) if law in totals else 0.0
            for law, name in zip(laws, ("torque", "torque", "coefficient"), strict=True)
        )
        if not faster > 0.0:
            continue
        if laws[0] in before and less < 0.0:
            follows = (
                abs(less + more) < AS_MUCH * -less if laws[1] in totals else _drag(judge, held, fit(), laws) > -ALIKE
            )
            if follows:
                rest = judge.held([item for item in held.found if item.key not in laws[:2]])
                gone = tuple(
                    Rejected(effect, f"joint_{at}", GROWS) for effect, at in laws[:2] if (effect, at) in totals
                )
                return replace(rest, no_law=_growing(joint), dropped=(*held.dropped_but(rest), *rest.dropped, *gone))
        if _drag(judge, held, fit(), laws[2:]) > SAYS_MORE:
            return replace(held, no_law=_growing(joint))
    return held


def _growing(joint: int) -> NoLaw:
    return NoLaw(joint, GROWS_SAID.format(joint=joint))


def _drag(judge: Judge, held: Held, fit: Refined, laws: Collection[tuple[str, int]]) -> float:
    """How much more what goes with the square of a joint's speed says than these laws of it, in log evidence.

    Args:
        judge: Of all runs.
        held: The findings.
        fit: Of all of them.
        laws: Of one joint, among them.
    """
    part, whiten = judge.whole, judge.whiten
    parts = blocks(part.evidence)
    others = [item for item in held.found if item.key not in laws]
    left, slope = whiten(part.residual({})), np.zeros((len(fit.left), 0))
    if others:
        rest = refined(part, whiten, others, parts)
        left, slope = rest.left, rest.slope
    i = next(at for _, at in laws) - 1
    drag = whiten(torque_column(part, i, [run.dq[:, i] * np.abs(run.dq[:, i]) for run in part.evidence.runs]))
    sigma = spread(fit.left, parts)
    slope = np.column_stack([drag, slope]) / sigma[:, None]
    left = left / sigma
    left = left - slope @ np.linalg.lstsq(slope, left, rcond=None)[0]
    return 0.5 * (float(np.sum((fit.left / sigma) ** 2)) - float(left @ left))
