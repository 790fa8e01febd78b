"""Finding plugins without importing them: names() imports nothing, load() imports one, report() tries each.

A broken plugin is reported with its reason and hides no other. What this distribution brings keeps its name, whoever
else claims it; of two others that claim one name none is taken.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points

from .errors import PluginError

BACKENDS = "mbexport.backends"
EFFECTS = "mbexport.effects"
OWN = "mbexport"
"""Name of this distribution."""


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


def _claims(group: str) -> list[EntryPoint]:
    """Every entry point of a group, sorted by name, our own first; nothing is imported."""
    try:
        found: Iterable[EntryPoint] = entry_points(group=group)
    except Exception:
        # one distribution with metadata that cannot be read makes the library's own list fail as a whole
        found, _ = _sifted(group)
    unique = {(point.name, point.value, _origin(point)): point for point in found}
    return [unique[key] for key in sorted(unique, key=lambda key: (key[0], not _is_own(unique[key]), key[2], key[1]))]


def _sifted(group: str) -> tuple[list[EntryPoint], list[PluginReport]]:
    """Entry points of all distributions whose metadata can be read, and a report of those where it cannot."""
    found: list[EntryPoint] = []
    unreadable: list[PluginReport] = []
    for distribution in distributions():
        try:
            found += [point for point in distribution.entry_points if point.group == group]
        except Exception as error:
            if group in (distribution.read_text("entry_points.txt") or ""):
                problem = f"its entry_points.txt cannot be read: {type(error).__name__}: {error}"
                unreadable.append(PluginReport("?", _titled(distribution), "", problem))
    return found, unreadable


def _is_own(point: EntryPoint) -> bool:
    return point.dist is not None and _title(point.dist, "Name") == OWN


def _origin(point: EntryPoint) -> str:
    return _titled(point.dist) if point.dist else "unknown distribution"


def _titled(distribution: Distribution) -> str:
    return f"{_title(distribution, 'Name')} {_title(distribution, 'Version')}"


def _title(distribution: Distribution, what: str) -> str:
    """Name or version; metadata may lack either, or be missing as a whole."""
    try:
        return str(distribution.metadata[what])
    except Exception:
        return "unknown"


def names(group: str) -> tuple[str, ...]:
    """Names claimed in a group, sorted; nothing is imported."""
    return tuple(sorted({point.name for point in _claims(group)}))


def load(group: str, name: str) -> object:
    """The object that one entry point names.

    Raises:
        PluginError: No such name, two claims on it, or its import fails; the cause is chained.
    """
    points = [point for point in _claims(group) if point.name == name]
    if not points:
        known = names(group)
        near = difflib.get_close_matches(name, known, 1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        raise PluginError(f"{group} has no {name!r}{hint} Installed: {', '.join(known) or 'none'}.")
    own = [point for point in points if _is_own(point)]
    rival = _rivals(group, name, own or points)
    if rival:
        raise PluginError(rival)
    return _loaded(group, points[0])


def made(group: str, name: str, kind: type) -> object:
    """The object of a kind that one entry point names, or an instance of the class of that kind that it names.

    Raises:
        PluginError: As `load`; or it is not of that kind, has another name, or cannot be made.
    """
    found = load(group, name)
    try:
        instance = found() if isinstance(found, type) and issubclass(found, kind) else found
    except Exception as error:
        raise PluginError(f"{name!r} in {group}: {found!r} cannot be made: {type(error).__name__}: {error}") from error
    if not isinstance(instance, kind):
        raise PluginError(f"{name!r} in {group} is no mbexport {kind.__name__}: {found!r}.")
    own_name = getattr(instance, "name", None)
    if own_name != name:
        raise PluginError(f"{name!r} in {group} calls itself {own_name!r}; both names must be the same.")
    return instance


def _loaded(group: str, point: EntryPoint) -> object:
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        raise PluginError(
            f"{point.name!r} in {group} ({_origin(point)}, {point.value}) cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error


def _rivals(group: str, name: str, points: list[EntryPoint]) -> str | None:
    if len({point.value for point in points}) < 2:
        return None
    told = " and ".join(f"{_origin(point)} ({point.value})" for point in points)
    return f"{name!r} in {group} is claimed by {told}; uninstall one of them."


def report(group: str, reserved: Iterable[str] = ()) -> tuple[PluginReport, ...]:
    """Every claim in a group, loaded one by one, each with its own problem.

    Args:
        group: Whose claims.
        reserved: Names that are taken without an entry point.
    """
    taken = set(reserved)
    points = _claims(group)
    owned = {point.name for point in points if _is_own(point)}
    reports: list[PluginReport] = []
    try:
        entry_points(group=group)
    except Exception:
        reports += _sifted(group)[1]
    for point in points:
        problem: str | None = None
        if point.name in taken or (point.name in owned and not _is_own(point)):
            problem = (
                f"{point.name!r} is built in, and {_origin(point)} claims the same name; the built-in one is used."
            )
        else:
            try:
                load(group, point.name)
            except PluginError as error:
                problem = str(error)
        reports.append(PluginReport(point.name, _origin(point), point.value, problem))
    return tuple(reports)
