"""A diagnosis in words: the same sentences on the terminal, on the page and in a notebook."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

from .diagnosis import Diagnosis, Finding, Parameter, Rival

# of play, what is left of whose gap nothing could say
BOUNCES_SAID = "lets its arm bounce, each time another way"
TURNS_SAID = "builds up in another way as its joint turns"
SIGNALS = {
    "tau": "motor torque",
    "tau_link": "torque behind the gear",
    "q": "position",
    "dq": "speed",
    "q_link": "arm-side position",
    "ee": "tool position",
    "ee_rot": "tool orientation",
}
PHASES = {
    "reversal": "at reversals",
    "standstill": "at standstill",
    "constant_speed": "at constant speed",
    "acceleration": "under acceleration",
}
# who laws are called after, by a plugin's effects too
_PEOPLE = {"coulomb": "Coulomb", "stribeck": "Stribeck"}
_EFFECTS = {
    "joint_compliance_6d": "joint compliance in six directions",
    "load_friction": "load-dependent friction",
}
_OF = {
    "q": "the position",
    "dq": "the speed",
    "ddq": "the acceleration",
    "tau": "the torque",
    "q_cmd": "the commanded position",
    "dq_cmd": "the commanded speed",
    "q_link": "the arm-side position",
    "tau_link": "the torque behind the gear",
}
_CHANNEL = re.compile(r"([a-z_]+)_(\d+)")
# unit -> smaller or larger ones, with the value from which on each is used
_SCALES: dict[str, tuple[tuple[float, float, str], ...]] = {
    "rad": ((0.1, 1.0, "rad"), (1e-4, 1e-3, "mrad"), (0.0, 1e-6, "\u00b5rad")),
    "m": ((0.1, 1.0, "m"), (1e-4, 1e-3, "mm"), (0.0, 1e-6, "\u00b5m")),
    "s": ((0.1, 1.0, "s"), (0.0, 1e-3, "ms")),
    **{
        unit: ((1e6, 1e6, f"M{unit}"), (1e4, 1e3, f"k{unit}"), (0.0, 1.0, unit))
        for unit in ("N", "N*m", "N/m", "N*m/rad", "N*s/m", "N*m*s/rad")
    },
}
# parameters that a sentence has room for; the page has a table of all of them
IN_A_SENTENCE = 3
# part of a gap whose cause is known and that is not left for want of exactness
MUCH = 0.25
# and one that would be told as 0 %
NEXT_TO_NOTHING = 0.005
_SURE = 0.9995


def effect_in_words(effect: str) -> str:
    """An effect's name for people: "coulomb_friction" is Coulomb friction."""
    return _EFFECTS.get(effect) or " ".join(_PEOPLE.get(word, word) for word in effect.split("_"))


def place_in_words(at: str) -> str:
    """A place for people: "joint_2" is joint 2."""
    return at.replace("_", " ")


def cause_in_words(effect: str, at: str) -> str:
    """An effect at its place; what the whole robot has stands alone."""
    return effect_in_words(effect) if at == "robot" else f"{effect_in_words(effect)} at {place_in_words(at)}"


def capitalised(text: str) -> str:
    """The text as a sentence begins."""
    return text[:1].upper() + text[1:]


def listed(words: Iterable[str]) -> str:
    """a, b and c."""
    parts = list(words)
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else ""


def percent(share: float) -> str:
    """A share as per cent; 100 only where it is all."""
    value = 100.0 * share
    return f"{value:.1f} %" if 99.5 <= value < 99.95 else f"{value:z.0f} %"


def probability_in_words(probability: float) -> str:
    """A probability as per cent; certainty is not claimed."""
    return "over 99.9 %" if probability > _SURE else percent(probability)


def plain_unit(unit: str) -> str:
    """A unit as print has it: N*m is N m, kg*m^2 is kg m²."""
    return unit.replace("*", " ").replace("^2", "\u00b2").replace("^3", "\u00b3")


def _scaled(unit: str, size: float) -> tuple[float, str]:
    """Factor and name of the unit that suits numbers of a size."""
    for least, factor, name in _SCALES.get(unit, ()):
        if size >= least:
            return factor, plain_unit(name)
    return 1.0, plain_unit(unit)


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit, both as people read them."""
    factor, name = _scaled(unit, abs(value))
    return f"{_figure(value / factor, digits)} {name}".rstrip()


def _figure(value: float, digits: int) -> str:
    """A number with so many digits, and none of an exponent where it reads well without."""
    if value == 0.0 or not math.isfinite(value):
        return "0" if value == 0.0 else "infinite"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if decimals > 6 or decimals < -4:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(decimals, 0)}f}"


def estimate(parameter: Parameter) -> tuple[str, str, str]:
    """Value, interval and unit of a parameter: with as many digits as its interval deserves."""
    low, high = parameter.ci95
    sizes = [abs(x) for x in (parameter.value, low, high) if math.isfinite(x)]
    factor, unit = _scaled(parameter.unit, max(sizes, default=0.0))
    half = 0.5 * (high - low) / factor
    if not math.isfinite(half) or half <= 0.0:
        value, *ends = (_figure(x / factor, 3) for x in (parameter.value, low, high))
    else:
        decimals = min(max(1 - math.floor(math.log10(half)), 0), 9)
        value, *ends = (f"{x / factor:z.{decimals}f}" for x in (parameter.value, low, high))
    return value, f"{ends[0]} to {ends[1]}", unit


def parameters_in_words(parameters: Mapping[str, Parameter]) -> str:
    """The parameters that say most, with intervals: "torque 12.1 N m (95 % interval 11.7 to 12.5)"."""
    said = [
        name for name, found in parameters.items() if found.value and not found.ci95[0] <= 0.0 <= found.ci95[1]
    ] or list(parameters)
    texts: list[str] = []
    for name in said[:IN_A_SENTENCE]:
        value, interval, unit = estimate(parameters[name])
        texts.append(f"{name} {value} {unit}".rstrip() + f" (95 % interval {interval})")
    more = len(parameters) - len(texts)
    return listed(texts) + (f", and {more} more" if more else "")


def finding_in_words(finding: Finding) -> str:
    """One sentence: what, where, how much, how surely."""
    what = capitalised(cause_in_words(finding.effect, finding.at))
    how_sure = f"probability {probability_in_words(finding.probability)}"
    if not finding.parameters:
        return f"{what}, {how_sure}."
    return f"{what}: {parameters_in_words(finding.parameters)}, {how_sure}."


def rivals_in_words(rivals: Iterable[Rival]) -> list[str]:
    """A sentence a reason: what these runs cannot tell from the finding."""
    reasons: dict[str, list[str]] = {}
    for rival in rivals:
        reasons.setdefault(rival.because.strip().rstrip("."), []).append(cause_in_words(rival.effect, rival.at))
    return [
        f"It may as well be {_either(names)}: {because}."
        if because
        else f"It may as well be {_either(names)}."
        for because, names in reasons.items()
    ]  # fmt: skip


def _either(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def variable_in_words(variable: str) -> str:
    """What the gap depends on: "sign(dq_2)" is the direction joint 2 moves in, "abs(tau_1)" the size of its torque."""
    direction = re.fullmatch(r"sign\(dq(?:_cmd)?_(\d+)\)", variable)
    if direction:
        return f"the direction of motion of joint {direction[1]}"
    size = re.fullmatch(r"abs\((.*)\)", variable)
    channel = _CHANNEL.fullmatch(size[1] if size else variable)
    if channel and channel[1] in _OF:
        return f"{'the size of ' if size else ''}{_OF[channel[1]]} of joint {channel[2]}"
    return "time" if variable == "t" else variable


def verdict_in_words(diagnosis: Diagnosis) -> str:
    """The verdict as the end of a headline that begins with the robot's name."""
    shown = [_cause_or_its_like(found) for found in diagnosis.which[:IN_A_SENTENCE]]
    more = len(diagnosis.which) - IN_A_SENTENCE
    causes = listed([*shown, f"{more} more"] if more > 0 else shown)
    return {
        "no_gap": "no gap above the noise",
        "explained": f"the gap comes from {causes}",
        "partly_explained": f"part of the gap comes from {causes}",
        "unexplained": "there is a gap, and no effect of the catalogue explains it",
    }[diagnosis.verdict]


def _cause_or_its_like(found: Finding) -> str:
    """A finding's name, not more certain than it is."""
    name, others = cause_in_words(found.effect, found.at), found.indistinguishable_from
    if not others:
        return name
    return f"{name} (or {cause_in_words(others[0].effect, others[0].at) if len(others) == 1 else 'what looks like it'})"


def where_in_words(diagnosis: Diagnosis) -> str:
    """Where the gap lies, in one sentence; "" where there is none."""
    where = diagnosis.where
    joints = sorted(where.joints.items(), key=lambda item: -item[1].share)
    if diagnosis.verdict == "no_gap" or not joints or joints[0][1].share <= 0.0:
        return ""
    first = listed(
        f"{place_in_words(name)} ({percent(found.share)})" for name, found in joints[:2] if found.share > 0.1
    )
    text = f"The gap lies mostly at {first or place_in_words(joints[0][0])}"
    when = max(where.when, key=lambda phase: phase.share, default=None)
    if when is not None and when.share > 0.0:
        text += f", {PHASES.get(when.phase, 'in ' + when.phase.replace('_', ' '))} ({percent(when.share)} of it)"
    if where.depends_on:
        text += f"; it goes with {variable_in_words(where.depends_on[0].variable)}"
    return text + "."


def unseen_runs(diagnosis: Diagnosis) -> str:
    """What the gain was measured on."""
    if diagnosis.holdout:
        return f"the held-out {'run' if len(diagnosis.holdout) == 1 else 'runs'} {listed(diagnosis.holdout)}"
    return "blocks of the run, each left out in turn" if len(diagnosis.runs) == 1 else "each run, left out in turn"


def how_far_in_words(diagnosis: Diagnosis) -> str:
    """How far the gap shrinks, in one sentence; "" where nothing was found."""
    how_far = diagnosis.how_far
    if not diagnosis.which:
        return ""
    if how_far.shrinks_by is None:
        return (
            "How far the gap shrinks cannot be said: on runs that no fit saw it is not above twice its own standard "
            "error."
        )
    if how_far.shrinks_by < 0.0:
        return (
            f"On runs that no fit saw the gap grows by {percent(-how_far.shrinks_by)}: these effects do not help there."
        )
    interval = ""
    if how_far.ci95 is not None:
        low, high = map(percent, how_far.ci95)
        interval = f" (95 % interval {low.removesuffix(' %')} to {high})"
    text = f"With {'it' if len(diagnosis.which) == 1 else 'them'} in the model the gap shrinks by "
    return f"{text}{percent(how_far.shrinks_by)}{interval} on runs that no fit saw."


def open_in_words(diagnosis: Diagnosis) -> str:
    """What is left, in one sentence; "" where that is nothing."""
    rest = diagnosis.unexplained
    looks = rest.looks_like.strip().rstrip(".")
    if diagnosis.verdict == "no_gap" or rest.share <= 0.0:
        # what evidence tells of a cause, be it no louder than noise
        return f"Not explained: {looks}; what was found leaves no more than noise of it." if looks else ""
    joints = [name for name, share in sorted(rest.joints.items(), key=lambda item: -item[1]) if share > 0.1][:2]
    at = f", most of it at {listed(place_in_words(name) for name in joints)}" if joints else ""
    if diagnosis.verdict == "explained":
        if rest.share < NEXT_TO_NOTHING:
            return "Left in the corrected model: less than 1 % of the gap's energy."
        if looks.endswith(BOUNCES_SAID):
            return (
                f"Left in the corrected model: {percent(rest.share)} of the gap's energy{at}. An arm that bounces in "
                "its play goes another way each time: robots with nearly the same play come as far apart in simulation."
            )
        if rest.share > MUCH:
            return (
                f"Left in the corrected model: {percent(rest.share)} of the gap's energy{at}. Its cause is known, and "
                f"no law of the catalogue says all of it: {looks}."
            )
        at += ", no more than a law leaves whose form is not quite the real one's"
    return f"Not explained: {percent(rest.share)} of the gap's energy{at}{'; it looks like ' + looks if looks else ''}."


def left_out_in_words(diagnosis: Diagnosis) -> str:
    """Which data were left out, in one sentence; "" where none were."""
    count = len(diagnosis.left_out)
    if not count:
        return ""
    reasons = listed(dict.fromkeys(item.reason.replace("_", " ") for item in diagnosis.left_out))
    return f"Bad samples were left out in {count} {'place' if count == 1 else 'places'}: {reasons}."


def summary(diagnosis: Diagnosis) -> str:
    """The verdict in a few plain lines."""
    lines = [f"{diagnosis.robot}: {verdict_in_words(diagnosis)}"]
    if diagnosis.verdict == "no_gap":
        lines.append("  The model predicts these runs as well as their noise allows; nothing is to blame.")
    lines.append(f"  {where_in_words(diagnosis)}")
    for found in diagnosis.which:
        lines.append(f"  {finding_in_words(found)}")
        lines += [f"    {sentence}" for sentence in rivals_in_words(found.indistinguishable_from)]
    lines += [f"  {text(diagnosis)}" for text in (how_far_in_words, open_in_words)]
    if diagnosis.next_experiment is not None:
        lines.append(f"  Next: {diagnosis.next_experiment.why.strip().rstrip('.')}.")
    lines.append(f"  {left_out_in_words(diagnosis)}")
    lines += [f"  Note: {note}" for note in diagnosis.notes]
    return "\n".join(line for line in lines if line.strip())
