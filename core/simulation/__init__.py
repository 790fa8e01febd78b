"""Running robots: the contract of backends, the drives' equations, runs and what they record."""

from .backend import Backend, Concept, Emission, Engine, MachineState, Program, Status
from .backends import backend_named, backend_names
from .run import simulate
from .trace import Trace

__all__ = [
    "Backend",
    "Concept",
    "Emission",
    "Engine",
    "MachineState",
    "Program",
    "Status",
    "Trace",
    "backend_named",
    "backend_names",
    "simulate",
]
