"""How every effect does by itself at every place, for the joint-by-effect map."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .contender import LOUD
from .diagnosis import Score
from .fit import linear
from .placed import place_of
from .state import Search


def scores(state: Search, found: Mapping[tuple[str, int], float]) -> tuple[Score, ...]:
    """What each effect at each place takes of the gap by itself, by its signature, and how probable it is.

    An amount of it is asked for that leaves least energy of the whole gap; which cause is the likeliest is another
    question, that the search answers.

    Args:
        state: A search that has ended.
        found: Probability of each finding.
    """
    nothing = state.whiten(state.problem.residual({}))
    whole, count = float(nothing @ nothing), len(nothing)
    # of pure noise nothing is taken
    energy = max(whole - count, LOUD * np.sqrt(2.0 * count))
    shares: dict[tuple[str, int], float] = {}
    for hypothesis in (contender.hypothesis for contender in state.first):
        ahead, slope = state.signatures[hypothesis.effect, hypothesis.at, hypothesis.form]
        left = linear(nothing + ahead, slope, hypothesis.scale, hypothesis.lower).left
        share = float(np.clip((whole - left @ left) / energy, 0.0, 1.0))
        shares[hypothesis.key] = max(share, shares.get(hypothesis.key, 0.0))
    return tuple(
        Score(effect, place_of(effect, at), share, found.get((effect, at), 0.0))
        for (effect, at), share in sorted(shares.items())
    )
