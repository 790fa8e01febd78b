"""The forms in which each effect of the catalogue could be there, with amounts that are plain for the robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..effects import Column, effect_named
from .beyond import DROOP, KNEE
from .hypothesis import TENSOR, Hypothesis, Values, clamped, defaults
from .orders import orders_of
from .plain import rests
from .problem import Problem
from .scales import Scales, nearly_all

Vector = NDArray[np.float64]

# delays are looked for up to this one [s], and within this part of each tick
LONGEST_DELAY = 0.02
WITHIN = 0.98
# where a spring rests that pulls nearly alike along a joint's way, in such ways, or farther
FAR_AWAY = 5.0
# width of the knee, in limits, of one that is felt before it is reached
SOFT_KNEE = 0.1
Form = Callable[[Problem, Scales, str, int, "Values | None"], list[Hypothesis]]


def _added(
    name: str,
    at: int,
    known: Values | None,
    scale: Mapping[str, float],
    *,
    form: str = "",
    fixed: Values | None = None,
) -> Hypothesis:
    """Numbers that add to a row's columns."""
    start = (known or defaults(name)) | (fixed or {})
    columns = tuple(scale)
    least = {column.name: column.minimum for column in effect_named(name).columns}

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for column, b in zip(columns, beta.tolist(), strict=True):
            out[column] = max(start[column] + b, least[column])
        return out

    lower = np.array([least[column] - start[column] for column in columns])
    # with numbers held that say how it goes, it is one of many forms
    return Hypothesis(name, at, form, values, np.array(list(scale.values())), lower, curved=bool(fixed))


def _torque(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"torque": scales.torque[at - 1]})]


def _viscous(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"coefficient": scales.torque[at - 1] / scales.speed[at - 1]})]


def _load(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"coefficient": 0.3})]


def _rotor(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"inertia": scales.inertia[at - 1]})]


def _stribeck(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    speeds = [known["velocity"]] if known else [part * scales.speed[at - 1] for part in (0.05, 0.15, 0.4)]
    return [
        _added(name, at, known, {"torque": scales.torque[at - 1]}, form=f"vs {v:.3g}", fixed={"velocity": v})
        for v in speeds
    ]


def _gain(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """A constant, or one that droops where the torque is high, of which a fit begins without."""
    steady = _added(name, at, known or {"gain": 1.0}, {"gain": 0.2})

    def drooping(beta: Vector) -> Values | None:
        values = steady.values(beta[:1])
        return values | {DROOP: float(beta[1])} if values and beta[1] > 0.0 else values

    scale = np.array([*steady.scale, 0.1 / max(float(scales.torque[at - 1]), 1e-9) ** 2])
    return [steady, Hypothesis(name, at, "droops", drooping, scale, np.array([*steady.lower, 0.0]))]


def _controller(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"kp": 0.2, "kd": 0.2})]


def _encoder(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"offset": 0.02 if _revolute(problem, at) else 0.02 * scales.length})]


def _delay(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """From the middle of each tick: what a torque reports jumps where a delay becomes another whole number of them."""
    if known:
        return [_added(name, at, known, {"time": 0.001})]
    tick = 1.0 / min(run.run.control.rate for run in problem.evidence.runs)
    forms: list[Hypothesis] = []
    for number in range(max(1, round(LONGEST_DELAY / tick))):
        middle = (number + 0.5) * tick

        def values(beta: Vector, middle: float = middle) -> Values | None:
            aside = WITHIN * 0.5 * tick
            return {"time": middle + min(max(float(beta[0]), -aside), aside)}

        forms.append(
            Hypothesis(
                name,
                at,
                f"tick {number + 1}",
                values,
                np.array([0.5 * tick]),
                np.array([-0.5 * tick]),
                alone=False,
                curved=True,
            )
        )
    return forms


def _limit(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """A limit just below the largest torque: where there is one, the torque stays there, or comes near it."""
    given = [run.run.signals.get("tau", run.run.signals.get("tau_cmd")) for run in problem.evidence.runs]
    # what the motion takes, where nobody says what the motors gave
    largest = max(scales.peak[at - 1] if one is None else nearly_all(one[:, at - 1]) for one in given)
    if largest <= 0.0 or (known and known["torque"] <= largest):
        return []

    def cut(beta: Vector) -> Values | None:
        return {"torque": max(largest - float(beta[0]), 1e-9)}

    def soft(beta: Vector) -> Values | None:
        # felt at once, and come to nowhere
        return {"torque": max((1.0 + SOFT_KNEE) * largest - float(beta[0]), 1e-9), KNEE: SOFT_KNEE}

    scale = np.array([0.2 * largest])
    return [
        Hypothesis(name, at, form, values, scale, np.array([-more * largest]), alone=False, curved=True)
        for form, values, more in (("", cut, 0.05), ("soft", soft, 0.5))
    ]


def _spring(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """-k (q - rest): linear in k and k rest. One that does not pull back pulls from far away, softly."""
    k0 = known["stiffness"] if known else 0.0
    m0 = k0 * known["rest"] if known else 0.0

    def values(beta: Vector) -> Values | None:
        m = m0 + float(beta[1])
        k = max(k0 + float(beta[0]), abs(m) / far)
        return {"stiffness": k, "rest": m / k if m else 0.0}

    torque, way = scales.torque[at - 1], scales.way[at - 1]
    far = max(FAR_AWAY * float(way), rests(problem, at))
    scale, lower = np.array([torque / way, torque]), np.array([-k0, -np.inf])
    return [Hypothesis(name, at, "", values, scale, lower, carried=True)]


def _compliance(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """1/K is what the gap is linear in; damping of a tenth of the critical one unless it is known."""
    inertia = scales.inertia[at - 1]
    torque = scales.torque[at - 1]
    gives = 1.0 / known["stiffness"] if known else 0.0
    forms: list[Hypothesis] = []
    for size in (1e-4, 1e-3, 1e-2):
        start = max(size / torque, 1e-12)

        def values(beta: Vector, start: float = start) -> Values | None:
            k = 1.0 / max(gives + start + float(beta[0]), 1e-12)
            b = known["damping"] if known else 0.1 * 2.0 * math.sqrt(k * inertia)
            return {"stiffness": k, "damping": b}

        forms.append(
            Hypothesis(
                name, at, f"{size:g}", values, np.array([start]), np.array([-0.9 * start]), alone=False, curved=True
            )
        )
    return forms


def _bearing(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Six directions that give; each starts soft enough to be seen, hard enough to be near nothing."""
    force, lever = scales.weight[at - 1], scales.lever[at - 1]
    angles = {"krx", "kry", "krz"}
    names = ["kx", "ky", "kz", "krx", "kry", "krz"]
    own = "krz" if _revolute(problem, at) else "kz"
    names.remove(own)
    start = known or defaults(name)
    give = {k: (1e-4 / (force * lever) if k in angles else 1e-4 * lever / force) for k in names}

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for k, b in zip(names, beta.tolist(), strict=True):
            before = 0.0 if math.isinf(start[k]) else 1.0 / start[k]
            soft = before + b
            if soft > 1e-3 * give[k]:
                out[k] = 1.0 / soft
                damping = "b" + k[1:]
                if start[damping] == 0.0:
                    out[damping] = 2e-3 * out[k]
        return out

    scale = np.array([30.0 * give[k] for k in names])
    return [Hypothesis(name, at, "", values, scale, np.zeros(len(names)), curved=True)]


def _bend(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    start = known or defaults(name)
    give = 1e-3 / (scales.weight[at - 1] * scales.lever[at - 1])
    columns = ("ku", "kv")

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for k, b in zip(columns, beta.tolist(), strict=True):
            before = 1.0 / start[k] if known else 0.0
            # an arm that bends about one axis only is next to rigid about the other
            out[k] = 1.0 / max(before + b, 1e-3 * give)
            if not known:
                out["b" + k[1:]] = 2e-3 * out[k]
        return out

    return [Hypothesis(name, at, "", values, np.array([5.0 * give] * 2), np.zeros(2), curved=True)]


def giving(scales: Scales, name: str, at: int) -> list[Hypothesis]:
    """What gives before a clamped output: a spring, or clearance before one; linear in the stiffness."""
    way = scales.way[at - 1]
    stiffness = {"stiffness": scales.torque[at - 1] / way}
    if name == "joint_compliance":
        return [_added(name, at, None, stiffness, form="clamped")]
    if name == "backlash":
        contact = {"stiffness": 0.0, "damping": 0.0}
        return [
            _added(name, at, None, stiffness, form=f"clamped {part:g}", fixed=contact | {"gap": part * way})
            for part in (0.2, 0.4, 0.6, 0.8)
        ]
    return []


def _backlash(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    start = known or defaults(name)
    size = 2e-3 if _revolute(problem, at) else 2e-3 * scales.length
    if clamped(problem, at):
        # of the motor's way there
        size = 0.2 * float(scales.way[at - 1])
    forms: list[Hypothesis] = []
    # a good gear's play is a minute of arc
    for part in (0.1, 0.3, 1.0, 3.0):

        def values(beta: Vector, part: float = part) -> Values | None:
            return start | {"gap": max((start["gap"] if known else 0.0) + part * size + float(beta[0]), 0.0)}

        forms.append(
            Hypothesis(
                name,
                at,
                f"{part:g}",
                values,
                np.array([part * size]),
                np.array([-0.9 * part * size]),
                alone=False,
                curved=True,
            )
        )
    return forms


def _loop(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Hysteresis: at a given way to slip, linear in the torque."""
    forms: list[Hypothesis] = []
    way = scales.way[at - 1]
    torque = scales.torque[at - 1]
    for part in (3e-3, 2e-2, 1e-1, 4e-1):
        slip = part * way

        def values(beta: Vector, slip: float = slip) -> Values | None:
            f = (known["torque"] if known else 0.0) + float(beta[0])
            f = max(f, 1e-9 * torque)
            return {"torque": f, "stiffness": f / slip, "slips": known["slips"] if known else 8.0}

        forms.append(Hypothesis(name, at, f"{part:g}", values, np.array([torque]), np.zeros(1), curved=True))
    return forms


def _wave(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """amplitude sin(cycles theta + phase), linear in its two quadratures; cycles from the residual's orders."""
    cycles = [known["cycles"]] if known else orders_of(problem, scales, at, second=name == "transmission_error")
    size = scales.torque[at - 1] if name == "torque_ripple" else 0.0
    forms: list[Hypothesis] = []
    for c in cycles:
        plain = size or scales.torque[at - 1] / (
            scales.inertia[at - 1] * (c * scales.speed[at - 1]) ** 2 + scales.torque[at - 1]
        )
        a0, b0 = (
            (known["amplitude"] * math.cos(known["phase"]), known["amplitude"] * math.sin(known["phase"]))
            if known
            else (0.0, 0.0)
        )

        def values(beta: Vector, c: float = c, a0: float = a0, b0: float = b0) -> Values | None:
            a, b = a0 + float(beta[0]), b0 + float(beta[1])
            return {"amplitude": math.hypot(a, b), "cycles": c, "phase": math.atan2(b, a)}

        free = np.array([-np.inf, -np.inf])
        forms.append(Hypothesis(name, at, f"{c:.4g}", values, np.array([plain, plain]), free, curved=True))
    return forms


def _payload(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """A body at the last arm: mass and first moments of a point, then its moments, beside one that is there already."""
    m, x = _load_scale(problem, scales), 0.3 * scales.length
    start = known or defaults(name)

    def point(beta: Vector) -> Values | None:
        mass = start["mass"] + float(beta[0])
        if mass <= 1e-9:
            return dict(defaults(name))
        first = [start["mass"] * start[axis] + float(b) for axis, b in zip("xyz", beta[1:4], strict=True)]
        return start | {"mass": mass} | {axis: value / mass for axis, value in zip("xyz", first, strict=True)}

    def body(beta: Vector) -> Values | None:
        values = point(beta[:4])
        if values is None or values["mass"] <= 1e-9:
            return values
        return values | {c: values[c] + float(b) for c, b in zip(TENSOR, beta[4:], strict=True)}

    def ball(beta: Vector) -> Values:
        return start | {c: start[c] + float(beta[0]) for c in TENSOR[:3]}

    lower = np.array([-start["mass"], *[-np.inf] * 3])
    mass, tensor = np.array([m, m * x, m * x, m * x]), np.full(len(TENSOR), m * x * x)
    free = np.full(len(TENSOR), -np.inf)
    forms = [
        Hypothesis(name, 0, "point", point, mass, lower, carried=True),
        Hypothesis(name, 0, "body", body, np.append(mass, tensor), np.append(lower, free), carried=True),
    ]
    if start["mass"] > 0.0:
        # what hangs there is as thick as it is wide, before it is known better
        least = np.array([-min(start[c] for c in TENSOR[:3])])
        forms.append(Hypothesis(name, 0, "ball", ball, np.array([start["mass"] * x * x]), least))
    return forms


def _load_scale(problem: Problem, scales: Scales) -> float:
    return max(problem.database.inertias[-1].mass, 0.1 * scales.mass)


def _arm(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Ten parameters, and mass with first moments alone."""
    m = max(problem.database.inertias[at - 1].mass, 0.05 * scales.mass)
    x = 0.2 * scales.length
    masses = {"mass": m, "mx": m * x, "my": m * x, "mz": m * x}
    tensor: dict[str, float] = dict.fromkeys(TENSOR, m * x * x)
    return [
        _added(name, at, known, masses, form="mass"),
        _added(name, at, known, tensor, form="tensor"),
        _added(name, at, known, masses | tensor, form="all"),
    ]


def _kinematic(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    angle, length = 0.01, 0.01 * scales.length
    forms = [
        _added(name, at, known, {column: angle if column in ("alpha", "theta", "beta") else length}, form=column)
        for column in ("alpha", "a", "theta", "d", "beta")
    ]
    every = {"alpha": angle, "a": length, "theta": angle, "d": length, "beta": angle}
    forms.append(_added(name, at, known, every, form="all"))
    row = problem.row_at(name, at, {})
    middle = row.values if row else defaults(name)
    return [replace(form, values=partial(_near, problem, middle, form.values)) for form in forms]


def _near(
    problem: Problem, middle: Mapping[str, float], values: Callable[[Vector], Values | None], beta: Vector
) -> Values | None:
    """Numbers of an arm that is still that arm."""
    out = values(beta) or {}
    far = any(abs(value - middle[column]) > problem.farthest(column) for column, value in out.items())
    return None if far else out


def _tilt(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"roll": 0.02, "pitch": 0.02})]


def plugin(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """An effect of somebody else's: each column that must be given, by its unit; several values of the others."""
    effect = effect_named(name)
    free = [column for column in effect.columns if column.default is None]
    if not free:
        free = [effect.columns[0]]
    # a place without a joint of its own takes the largest
    i = at - 1 if effect.key == "joint" else int(np.argmax(scales.torque))
    units = {
        "N*m": scales.torque[i],
        "N": scales.torque[i],
        "rad": 1e-3 * scales.way[i],
        "m": 1e-3 * scales.way[i],
        "rad/s": scales.speed[i],
        "m/s": scales.speed[i],
        "N*m*s/rad": scales.torque[i] / scales.speed[i],
        "N*m/rad": scales.torque[i] / scales.way[i],
        "kg*m^2": scales.inertia[i],
        "kg": scales.mass,
        "s": 0.005,
    }

    def plain(column: Column) -> float:
        return float(units.get(column.unit.split("|")[0], 0.1))

    first, *others = free
    amounts = {first.name: plain(first)}
    forms: list[Hypothesis] = []
    for part in (0.1, 1.0, 10.0) if others else (1.0,):
        fixed = {column.name: part * plain(column) for column in others}
        forms.append(_added(name, at, known, amounts, form=f"{part:g}" if others else "", fixed=fixed))
    return forms


def _revolute(problem: Problem, at: int) -> bool:
    return problem.database.joints[at - 1].kind == "revolute"


FORMS: dict[str, Form] = {
    "backlash": _backlash,
    "base_tilt": _tilt,
    "controller_gain": _controller,
    "coulomb_friction": _torque,
    "delay": _delay,
    "encoder_offset": _encoder,
    "hysteresis": _loop,
    "joint_compliance": _compliance,
    "joint_compliance_6d": _bearing,
    "joint_spring": _spring,
    "kinematic_error": _kinematic,
    "link_flexibility": _bend,
    "link_inertia": _arm,
    "load_friction": _load,
    "payload": _payload,
    "rotor_inertia": _rotor,
    "stribeck_friction": _stribeck,
    "torque_constant": _gain,
    "torque_limit": _limit,
    "torque_offset": _torque,
    "torque_ripple": _wave,
    "transmission_error": _wave,
    "viscous_friction": _viscous,
}
