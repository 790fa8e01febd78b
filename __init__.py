"""mbexport: one robot database, every simulator, one answer.

    import mbexport

    robot = mbexport.build(mbexport.load("imece2013"), level="compliant")
    run = mbexport.simulate(robot, "mjcf", motion="greca")
    run.dataset().tip.plot.line(x="t")

Names are imported when they are first used, so that `import mbexport` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .core.agreement import agree
    from .core.build import build
    from .core.database import load
    from .core.effects import Effect
    from .core.export import export
    from .core.importing import import_model
    from .core.simulation import Backend, simulate

_HOMES = {
    "Backend": "core.simulation",
    "Effect": "core.effects",
    "agree": "core.agreement",
    "build": "core.build",
    "export": "core.export",
    "import_model": "core.importing",
    "load": "core.database",
    "simulate": "core.simulation",
}

__all__ = ["Backend", "Effect", "agree", "build", "export", "import_model", "load", "simulate"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mbexport' has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
