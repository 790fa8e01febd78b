"""The installed backends by name; nothing is imported until one is asked for."""

from __future__ import annotations

from functools import cache

from .. import plugins
from ..errors import PluginError
from .backend import Backend


def backend_names() -> tuple[str, ...]:
    """Names of all backends, sorted."""
    return plugins.names(plugins.BACKENDS)


@cache
def backend_named(name: str) -> Backend:
    """The backend of that name.

    Raises:
        PluginError: Unknown, broken, or claimed twice.
    """
    made = plugins.load(plugins.BACKENDS, name)
    backend = made() if isinstance(made, type) else made
    if not isinstance(backend, Backend) or backend.name != name:
        raise PluginError(f"entry point {name!r} in {plugins.BACKENDS} is no mbexport Backend of that name: {made!r}.")
    return backend
