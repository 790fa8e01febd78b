"""The catalogue of effects: built-in ones are the files of this package, others come by entry points."""

from __future__ import annotations

import inspect
import pkgutil
from dataclasses import replace
from functools import cache
from importlib import import_module
from typing import Any, cast

from .. import plugins
from ..errors import PluginError
from ..representation import TERM_KINDS
from .effect import Column, Effect, EffectRow, Law, LawFunction, in_order, with_drive, with_drives, with_stage

__all__ = [
    "Column",
    "Effect",
    "EffectRow",
    "Law",
    "LawFunction",
    "built_in_names",
    "catalogue",
    "effect_named",
    "effect_reports",
    "in_order",
    "law_named",
    "with_drive",
    "with_drives",
    "with_stage",
]


# of a representation.Term
MOST_PARAMETERS = 8


@cache
def _built_in() -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(__path__):
        for _, member in inspect.getmembers(import_module(f"{__name__}.{module.name}"), inspect.isclass):
            if (
                issubclass(member, Effect)
                and member.__module__ == f"{__name__}.{module.name}"
                and hasattr(member, "name")
            ):
                found[member.name] = member()
    return found


def built_in_names() -> tuple[str, ...]:
    """Names of the effects of this distribution, sorted."""
    return tuple(sorted(_built_in()))


def catalogue() -> tuple[str, ...]:
    """Names of all effects, sorted; no plugin is imported."""
    return tuple(sorted({*_built_in(), *plugins.names(plugins.EFFECTS)}))


@cache
def effect_named(name: str) -> Effect:
    """The effect of that name; a built-in one keeps its name, whoever else claims it.

    Raises:
        PluginError: Unknown, broken, claimed by two plugins, or against the contract of effects.
    """
    built_in = _built_in().get(name)
    if built_in is not None:
        return built_in
    if name not in plugins.names(plugins.EFFECTS):
        raise PluginError(f"no effect {name!r}; installed: {', '.join(catalogue())}.")
    effect = plugins.made(plugins.EFFECTS, name, Effect)
    assert isinstance(effect, Effect)
    fault = _fault(effect)
    if fault is not None:
        raise PluginError(f"{name!r} in {plugins.EFFECTS} ({type(effect).__module__}): {fault}")
    return effect


def law_named(effect: str, law: str) -> Law:
    """The law of an effect to which a `representation.Term` points by both their names.

    Raises:
        PluginError: No such effect, or it has no law of that name.
    """
    laws = effect_named(effect).laws
    found = next((entry for entry in laws if entry.name == law), None)
    if found is None:
        known = ", ".join(entry.name for entry in laws) or "none"
        raise PluginError(f"the effect {effect!r} gives a drive the law {law!r}, which it has not; its laws: {known}.")
    return found


def effect_reports() -> tuple[plugins.PluginReport, ...]:
    """Every effect that another distribution brings, each with its own problem."""
    return tuple(
        report if report.problem else replace(report, problem=_problem(report.name))
        for report in plugins.report(plugins.EFFECTS, reserved=_built_in())
    )


def _problem(name: str) -> str | None:
    try:
        effect_named(name)
    except PluginError as error:
        return str(error)
    return None


def _fault(effect: Effect) -> str | None:
    """What of an outside effect is against the contract."""
    if getattr(effect, "key", None) not in ("joint", "arm", "robot"):
        return f"its key is {getattr(effect, 'key', None)!r}; it must be joint, arm or robot."
    for what, kind in (("columns", Column), ("laws", Law)):
        parts: Any = getattr(effect, what, None)
        if not isinstance(parts, tuple) or not all(isinstance(part, kind) for part in cast("tuple[Any, ...]", parts)):
            return f"its {what} must be a tuple of {kind.__name__}, not {parts!r}."
    if effect.laws and len(effect.columns) > MOST_PARAMETERS and type(effect).apply is Effect.apply:
        return f"it has {len(effect.columns)} columns; a law takes {MOST_PARAMETERS} parameters at most."
    for law in effect.laws:
        if law.kind not in TERM_KINDS:
            return f"its law {law.name} is of kind {law.kind!r}; known: {', '.join(TERM_KINDS)}."
    return None
