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
        PluginError: Unknown, broken, claimed by two plugins, or against the contract of backends.
    """
    backend = plugins.made(plugins.BACKENDS, name, Backend)
    assert isinstance(backend, Backend)
    fault = contract_fault(backend)
    if fault is not None:
        raise PluginError(f"{name!r} in {plugins.BACKENDS} ({type(backend).__module__}): {fault}")
    return backend


def contract_fault(backend: Backend) -> str | None:
    """What of a backend's own words is against the contract; None where nothing is."""
    for what in ("engine", "integrator"):
        if not isinstance(getattr(backend, what, None), str) or not getattr(backend, what):
            return f"it must name its {what} in words."
    order: object = getattr(backend, "order", None)
    if not isinstance(order, int) or order < 1:
        return f"its order of convergence is {order!r}; it must be 1 or more."
    gate_class: object = getattr(backend, "gate_class", None)
    if gate_class not in ("A", "B"):
        return f"its gate_class is {gate_class!r}; it must be A or B."
    for what in ("largest_step", "stable"):
        value: object = getattr(backend, what)
        if not isinstance(value, int | float) or not value > 0.0:
            return f"its {what} is {value!r}; it must be above 0."
    return None
