"""What a law of another form than the real one's leaves: no second cause is named for it.

Real laws are not those of the catalogue to the last part: friction may be another one there than back, a spring may
stiffen on its way, a damper yield with speed, a gear's error come twice a turn as well. For every finding these are
columns, the change of the residual for as much of each as is plain; no more of them is taken out of what is left, with
another finding at its joint and without. And what all findings leave may be theirs alone: then no cause is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .beyond import CONSTANT, KNEE, LIMIT, SECOND, SPRINGS, WAVES, by_catalogue, cut_softly
from .evidence import coefficients
from .found import Found, rows_of
from .inverse import Said
from .nuisances import Whitening
from .problem import BODIES, Problem

Vector = NDArray[np.float64]

# the part of a law that may go with direction, with its own size, and twice as often; how large a gear's error may be
# that comes half as often; and what its amount makes up for
ASIDE, BENT, TWICE, HALF, AMOUNT = 0.25, 0.4, 0.5, 4.0, 0.5
# by what part of a wave over a joint's whole way its cycles may be off
CYCLES_OFF = 0.125
# friction, that may be another one there than back
FRICTION = ("coulomb_friction", "stribeck_friction", "viscous_friction", "load_friction", "hysteresis")
# laws that may go with another power of themselves
_POWERS: dict[str, tuple[float, ...]] = {
    "viscous_friction": (2.0,),
    "stribeck_friction": (0.25, 0.5, 2.0),
    "joint_spring": (2.0, 3.0),
    "torque_constant": (2.0,),
}
# how much there is of laws that a database knows a part of: what is found is of another form with all of it
_HOW_MUCH = {
    "coulomb_friction": "torque",
    "stribeck_friction": "torque",
    "viscous_friction": "coefficient",
    "load_friction": "coefficient",
}
# over which parts of a limit it may come softly, and by which part of it that is known as much
KNEES, NEAR_LIMIT = (0.03, 0.1), 0.02
# what changes where arms are, and so what they weigh on joints
GEOMETRY = ("kinematic_error", "base_tilt")
# a gear's, which inertia takes by the square of how often it comes
ERROR = "transmission_error"
# what is said of a law that is so
ASIDE_SAID = "is not the same both ways"
DRIVEN_SAID = "is another one where it drives than where it is driven"
BENT_SAID = "goes with another power of what it goes with"
TWICE_SAID, HALF_SAID = "comes twice as often as well", "comes half as often as well"
STIFFENS_SAID = "stiffens as it is wound up"
SOFTLY_SAID = "is felt before it is reached"
DROOPS_SAID = "gives ever less of what it is asked for"
# and of an effect whose law goes beyond the catalogue's
BEYOND_SAID = {
    **dict.fromkeys(SPRINGS, STIFFENS_SAID),
    LIMIT: SOFTLY_SAID,
    CONSTANT: DROOPS_SAID,
    **dict.fromkeys(WAVES, TWICE_SAID),
}


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """Another form of a finding's law.

    Attributes:
        said: What is then said of it: "<effect> at <place> ..."; "" where only its amount or its phase is another one.
        column: The change of the residual for as much of it as is plain, in units of noise, shape (N,).
        within: How much of that there may be.
        law: What the law then says more at its joint, in every run, shape (M,): a wave as it goes round, others in
            torque [SI]; () where the law is not asked for it.
    """

    said: str
    column: Vector
    within: tuple[float, float] = (-1.0, 1.0)
    law: tuple[Vector, ...] = ()


def is_wave(item: Found) -> bool:
    """Whether a finding's law goes round with a position."""
    return "cycles" in item.row.values


def beyond_forms(
    problem: Problem, whiten: Whitening, found: Sequence[Found], k: int
) -> Callable[[Vector], Vector] | None:
    """What takes out of a rest all that laws of other findings at the joint of finding k may leave; None: no such.

    Args:
        problem: The runs.
        whiten: Their nuisances, which are out of the rest already.
        found: Findings: those that say more than the k-th does at its joint may have laws of other forms; where that
            is a body, at a joint that bears it.
        k: Its place.
    """
    bears = _bears(problem, found[k])
    others = [
        j for j, one in enumerate(found) if j != k and effect_named(one.effect).key == "joint" and one.at in bears
    ]
    if not others:
        return None
    every, without = problem.spoken(rows_of(found)), _without(problem, found, k)
    larger = [
        j for j in others if _size(every, _bare(problem, found, j), found[j].at) > _size(every, without, found[j].at)
    ]
    forms = [form for j in larger for form in forms_of(problem, found, j, every)]
    if not forms:
        return None
    slope = whiten(np.column_stack([form.column for form in forms]))

    def beyond(left: Vector) -> Vector:
        return np.asarray(left + slope @ _amounts(forms, slope, left), dtype=np.float64)

    return beyond


def _bears(problem: Problem, item: Found) -> Collection[int]:
    """Joints, from 1, at which laws of another form may say what a finding does."""
    if item.effect == "torque_limit":
        # where a drive stands at its limit no law of another form says so
        return ()
    if item.effect in BODIES:
        return range(1, (item.at or problem.database.n) + 1)
    if item.effect in GEOMETRY:
        # which turns what every joint bears
        return range(1, problem.database.n + 1)
    return (item.at,) if effect_named(item.effect).key == "joint" else ()


@dataclass(frozen=True, slots=True, eq=False)
class Forms:
    """Other forms of all findings' laws, as much of each as some runs tell.

    Attributes:
        forms: Each with the place of its finding.
        own: How much of those that are but another amount or phase of a law, where it has no other form, shape (f,).
        amounts: How much of each, shape (f,).
    """

    forms: Sequence[tuple[int, Form]]
    own: Vector
    amounts: Vector

    @staticmethod
    def of(problem: Problem, whiten: Whitening, found: Sequence[Found], left: Vector) -> Forms | None:
        """As much of them as takes most of what these findings leave of these runs; None where none has any."""
        forms = list(_every_form(problem, found))
        if not forms:
            return None
        slope = whiten(np.column_stack([form.column for _, form in forms]))
        same = np.array([not form.said for _, form in forms])
        own = np.zeros(len(forms))
        own[same] = _amounts([form for _, form in forms if not form.said], slope[:, same], left)
        return Forms(forms, own, _amounts([form for _, form in forms], slope, left))

    def beyond(
        self, problem: Problem, whiten: Whitening, found: Sequence[Found], left: Vector
    ) -> tuple[Vector, Vector]:
        """What as much of them leaves of what these findings leave of other runs, without other forms and with them."""
        slope = whiten(np.column_stack([form.column for _, form in _every_form(problem, found)]))
        return left + slope @ self.own, left + slope @ self.amounts

    @property
    def largest(self) -> tuple[int, str]:
        """Place of the finding whose law has another form most clearly, and what is said of it."""
        sizes = [
            abs(amount) * float(np.linalg.norm(form.column)) if form.said else -1.0
            for amount, (_, form) in zip(self.amounts, self.forms, strict=True)
        ]
        place, form = self.forms[int(np.argmax(sizes))]
        return place, form.said


def other_forms(problem: Problem, found: Sequence[Found]) -> list[tuple[int, Form]]:
    """Every other form of the findings' laws, with the place of its finding."""
    return [(k, form) for k, form in _every_form(problem, found) if form.said]


def law_along(problem: Problem, found: Sequence[Found], k: int, row: EffectRow) -> list[Vector]:
    """What a finding's law says at its joint in every run with another row, shape (M,): as in Form.law."""
    i = found[k].at - 1
    if is_wave(found[k]):
        amplitude, cycles, phase = (row.values[name] for name in ("amplitude", "cycles", "phase"))
        return [amplitude * np.sin(cycles * run.q[:, i] + phase) for run in problem.evidence.runs]
    other = [*found[:k], replace(found[k], row=row), *found[k + 1 :]]
    return [one.tau[:, i] for one in problem.spoken(rows_of(other))]


def have_other_forms(problem: Problem, found: Sequence[Found]) -> set[tuple[str, int]]:
    """Keys of the findings whose law may have another form."""
    return {found[k].key for k, form in _every_form(problem, found) if form.said}


def _every_form(problem: Problem, found: Sequence[Found]) -> Iterator[tuple[int, Form]]:
    every = problem.spoken(rows_of(found))
    for k, item in enumerate(found):
        if effect_named(item.effect).key == "joint":
            for form in forms_of(problem, found, k, every):
                yield k, form


def _amounts(forms: Sequence[Form], slope: Vector, left: Vector) -> Vector:
    """How much of each form leaves least, shape (f,)."""
    optimize: Any = import_module("scipy.optimize")
    least, most = np.array([form.within for form in forms]).T
    return np.asarray(optimize.lsq_linear(slope, -left, bounds=(least, most)).x, dtype=np.float64)


def _without(problem: Problem, found: Sequence[Found], k: int) -> list[Said]:
    return problem.spoken(rows_of([one for j, one in enumerate(found) if j != k]))


def _bare(problem: Problem, found: Sequence[Found], k: int) -> list[Said]:
    """Without a finding and without what the database knows of its law at its joint."""
    item = found[k]
    if item.effect not in _HOW_MUCH or problem.row_at(item.effect, item.at, {}) is None:
        return _without(problem, found, k)
    nothing = replace(item, row=EffectRow(item.at, {**item.row.values, _HOW_MUCH[item.effect]: 0.0}))
    return problem.spoken(rows_of([*found[:k], nothing, *found[k + 1 :]]))


def made_by(problem: Problem, found: Sequence[Found], k: int, every: Sequence[Said]) -> list[Vector]:
    """Torque that a finding makes at its joint in every run, with what the database knew of its law, shape (M,)."""
    i = found[k].at - 1
    return [one.tau[:, i] - other.tau[:, i] for one, other in zip(every, _bare(problem, found, k), strict=True)]


def _size(every: Sequence[Said], without: Sequence[Said], at: int) -> float:
    """Mean square of the torque that a finding makes at its joint."""
    made = np.concatenate([(one.tau - other.tau)[:, at - 1] for one, other in zip(every, without, strict=True)])
    return float(np.mean(made**2))


def forms_of(problem: Problem, found: Sequence[Found], k: int, every: Sequence[Said]) -> list[Form]:
    """Other forms of a finding's law, and its own amount, that makes up for them."""
    item, evidence = found[k], problem.evidence
    if is_wave(item):
        return _waves(problem, found, k)
    if item.effect == "torque_limit":
        return _limits(problem, found, k)
    i = item.at - 1
    made = made_by(problem, found, k, every)
    # runs that do not excite it have the same forms, of nothing
    most = max(float(np.max(np.abs(one), initial=0.0)) for one in made) or 1.0
    forms: list[Form] = []

    def shaped(said: str, torques: Sequence[Vector], up_to: float = 1.0) -> None:
        forms.append(Form(said, torque_column(problem, i, torques), (-1.0, up_to), tuple(torques)))

    if item.effect in FRICTION:
        both = zip(evidence.runs, made, strict=True)
        shaped(ASIDE_SAID, [ASIDE * np.sign(run.dq[:, i]) * one for run, one in both])
    if item.effect == "load_friction":
        # a gear loses less where it drives than where it is driven
        drives = [np.sign(one.tau_link[:, i]) for one in every]
        shaped(DRIVEN_SAID, [ASIDE * side * np.abs(one) for side, one in zip(drives, made, strict=True)])
    for power in _POWERS.get(item.effect, ()):
        # a damper yields; what grows faster than speed is drag, and no damper
        bent = [BENT * most * np.sign(one) * np.abs(one / most) ** power for one in made]
        shaped(BENT_SAID, bent, 0.0 if item.effect == "viscous_friction" else 1.0)
    if forms:
        shaped("", [AMOUNT * one for one in made])
    return forms


def _limits(problem: Problem, found: Sequence[Found], k: int) -> list[Form]:
    """A limit that is felt before it is reached, and a little more or less of it; none where nobody asks for torque."""
    item, i = found[k], found[k].at - 1
    asked = [one.u for one in _without(problem, found, k)]
    if any(one is None for one in asked):
        return []
    top = item.row.values["torque"]
    wanted = [one[:, i] for one in asked if one is not None]
    cut = [cut_softly(one, top, item.row.values.get(KNEE, 0.0)) for one in wanted]
    forms: list[Form] = []
    for knee in KNEES:
        less = [hard - cut_softly(x, top, knee) for hard, x in zip(cut, wanted, strict=True)]
        forms.append(Form(SOFTLY_SAID, torque_column(problem, i, less, ("u",)), (0.0, 1.0)))
    more = NEAR_LIMIT * top
    change = [np.clip(x, -top, top) - np.clip(x, -top - more, top + more) for x in wanted]
    return [*forms, Form("", torque_column(problem, i, change, ("u",)))]


def _waves(problem: Problem, found: Sequence[Found], k: int) -> list[Form]:
    """A wave's second harmonic, or what it is that of, another amplitude and phase of its own, and its cycles.

    Each by its two quadratures. A second harmonic that no law has pulls at the cycles found. Of a gear's error
    inertia makes the harmonic four times as large, so that it may be the part that was found, unless both were.
    """
    item = found[k]
    values = by_catalogue(item.row).values
    nothing = problem.misfit(rows_of([one for j, one in enumerate(found) if j != k]))

    def row(part: float, cycles: float, phase: float) -> EffectRow:
        changed = {"amplitude": part * values["amplitude"], "cycles": cycles, "phase": phase}
        return EffectRow(item.at, {**values, **changed})

    def wave(part: float, cycles: float, phase: float) -> Vector:
        other = replace(item, row=row(part, cycles, phase))
        return problem.misfit(rows_of([*found[:k], other, *found[k + 1 :]])) - nothing

    def other(said: str, part: float, cycles: float, phase: float) -> Form:
        law = law_along(problem, found, k, row(part, cycles, phase))
        return Form(said, wave(part, cycles, phase), law=tuple(law))

    quadratures = (0.0, 0.5 * np.pi)
    may_be_second = item.effect == ERROR and not item.row.values.get(SECOND, 0.0)
    c, phase = values["cycles"], values["phase"]
    off = CYCLES_OFF * 2.0 * np.pi / max(float(problem.way()[item.at - 1]), 1e-6)
    return [
        *(other(TWICE_SAID, TWICE, 2.0 * c, quadrature) for quadrature in quadratures),
        *(other(HALF_SAID, HALF, 0.5 * c, quadrature) for quadrature in quadratures if may_be_second),
        *(Form("", wave(AMOUNT, c, quadrature)) for quadrature in quadratures),
        Form("", wave(1.0, c + off, phase) - wave(1.0, c, phase)),
    ]


def torque_column(problem: Problem, i: int, torques: Sequence[Vector], names: Sequence[str] = ("tau", "u")) -> Vector:
    """The change of the residual for more torque at a joint in every run, of that which moves it or of these."""
    evidence = problem.evidence
    parts: list[dict[str, list[Vector]]] = []
    for run, mask, torque in zip(evidence.runs, evidence.masks, torques, strict=True):
        change = {name: np.zeros(values.shape) for name, values in mask.items()}
        for name in names:
            if name in change:
                change[name][:, i] = -torque
        parts.append(coefficients(run, change, mask))
    return evidence.weighed(parts)
