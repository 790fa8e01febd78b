"""The catalogue of effects: built-in ones are the files of this package, others come by entry points."""

from __future__ import annotations

import inspect
import pkgutil
from functools import cache
from importlib import import_module

from .. import plugins
from ..errors import PluginError
from .effect import Column, Effect, EffectRow, Law, LawFunction, in_order, with_drive, with_stage

__all__ = [
    "Column",
    "Effect",
    "EffectRow",
    "Law",
    "LawFunction",
    "catalogue",
    "effect_named",
    "in_order",
    "with_drive",
    "with_stage",
]


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


def catalogue() -> tuple[str, ...]:
    """Names of all effects, sorted; no plugin is imported."""
    return tuple(sorted({*_built_in(), *plugins.names(plugins.EFFECTS)}))


@cache
def effect_named(name: str) -> Effect:
    """The effect of that name.

    Raises:
        PluginError: Unknown, broken, or a plugin claims a built-in name.
    """
    built_in = _built_in().get(name)
    outside = name in plugins.names(plugins.EFFECTS)
    if built_in is not None and outside:
        raise PluginError(f"effect {name!r} is built in, and a plugin claims the same name; uninstall the plugin.")
    if built_in is not None:
        return built_in
    if not outside:
        raise PluginError(f"no effect {name!r}; installed: {', '.join(catalogue())}.")
    made = plugins.load(plugins.EFFECTS, name)
    effect = made() if isinstance(made, type) else made
    if not isinstance(effect, Effect) or effect.name != name:
        raise PluginError(f"entry point {name!r} in {plugins.EFFECTS} is no mbexport Effect of that name: {effect!r}.")
    return effect
