"""Finding plugins without importing them: names() imports nothing, load() imports one, report() tries each.

A broken plugin is reported with its reason and hides no other.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from .errors import PluginError

BACKENDS = "mbexport.backends"
EFFECTS = "mbexport.effects"


@dataclass(frozen=True, slots=True)
class PluginReport:
    """What is known of one entry point.

    Attributes:
        name: Name of the entry point.
        distribution: Distribution that declares it, with its version.
        target: "module:object".
        problem: Why it cannot be used; None where it can.
    """

    name: str
    distribution: str
    target: str
    problem: str | None


def _points(group: str) -> list[EntryPoint]:
    return sorted(entry_points(group=group), key=lambda point: (point.name, _origin(point), point.value))


def _origin(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown distribution"


def names(group: str) -> tuple[str, ...]:
    """Names claimed in a group, sorted; nothing is imported."""
    return tuple(sorted({point.name for point in _points(group)}))


def load(group: str, name: str) -> object:
    """The object that one entry point names.

    Raises:
        PluginError: No such name, two claims on it, or its import fails; the cause is chained.
    """
    points = [point for point in _points(group) if point.name == name]
    if not points:
        known = names(group)
        near = difflib.get_close_matches(name, known, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise PluginError(f"{group} has no {name!r}{hint} Installed: {', '.join(known) or 'none'}.")
    if len({point.value for point in points}) > 1:
        claims = " and ".join(f"{_origin(point)} ({point.value})" for point in points)
        raise PluginError(f"{name!r} in {group} is claimed by {claims}; uninstall one of them.")
    point = points[0]
    try:
        return point.load()
    except Exception as error:
        raise PluginError(
            f"{name!r} in {group} ({_origin(point)}, {point.value}) cannot be loaded: {type(error).__name__}: {error}"
        ) from error


def report(group: str) -> tuple[PluginReport, ...]:
    """Every claim in a group, loaded one by one, each with its own problem."""
    reports: list[PluginReport] = []
    for point in _points(group):
        problem: str | None = None
        try:
            load(group, point.name)
        except PluginError as error:
            problem = str(error)
        reports.append(PluginReport(point.name, _origin(point), point.value, problem))
    return tuple(reports)
