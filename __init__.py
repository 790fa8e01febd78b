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
    from .backends.driven import DrivenEngine
    from .core.agreement import agree
    from .core.build import build
    from .core.control import Control
    from .core.database import Database, load
    from .core.diagnosis.named import diagnose
    from .core.effects import Column, Effect, EffectRow, Law, with_drive, with_drives, with_stage
    from .core.errors import InputError, MbexportError, PluginError, RefusedError, UsageError
    from .core.export import export
    from .core.importing import import_model
    from .core.motion import MotionLaw
    from .core.representation import Robot
    from .core.simulation import Backend, Concept, Emission, Engine, MachineState, Program, Trace, simulate
    from .core.simulation.concepts import concepts_of
    from .core.simulation.drive_sheet import DriveSheet
    from .core.simulation.drives import Drives

# where each name stands; the first lines are for users, the others for those who write backends and effects
_HOMES = {
    "agree": "core.agreement",
    "build": "core.build",
    "diagnose": "core.diagnosis.named",
    "export": "core.export",
    "import_model": "core.importing",
    "load": "core.database",
    "simulate": "core.simulation",
    "Backend": "core.simulation",
    "Column": "core.effects",
    "Concept": "core.simulation",
    "Control": "core.control",
    "Database": "core.database",
    "DriveSheet": "core.simulation.drive_sheet",
    "DrivenEngine": "backends.driven",
    "Drives": "core.simulation.drives",
    "Effect": "core.effects",
    "EffectRow": "core.effects",
    "Emission": "core.simulation",
    "Engine": "core.simulation",
    "InputError": "core.errors",
    "Law": "core.effects",
    "MachineState": "core.simulation",
    "MbexportError": "core.errors",
    "MotionLaw": "core.motion",
    "PluginError": "core.errors",
    "Program": "core.simulation",
    "RefusedError": "core.errors",
    "Robot": "core.representation",
    "Trace": "core.simulation",
    "UsageError": "core.errors",
    "concepts_of": "core.simulation.concepts",
    "with_drive": "core.effects",
    "with_drives": "core.effects",
    "with_stage": "core.effects",
}

__all__ = [
    "Backend",
    "Column",
    "Concept",
    "Control",
    "Database",
    "DriveSheet",
    "DrivenEngine",
    "Drives",
    "Effect",
    "EffectRow",
    "Emission",
    "Engine",
    "InputError",
    "Law",
    "MachineState",
    "MbexportError",
    "MotionLaw",
    "PluginError",
    "Program",
    "RefusedError",
    "Robot",
    "Trace",
    "UsageError",
    "agree",
    "build",
    "concepts_of",
    "diagnose",
    "export",
    "import_model",
    "load",
    "simulate",
    "with_drive",
    "with_drives",
    "with_stage",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mbexport' has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
