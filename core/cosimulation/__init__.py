"""Co-simulation: a controller and a robot with a solver each, that hear of each other at communication points only."""

from .controller import ContinuousController
from .coupling import CoupledRun, Coupling, run_coupled
from .loop import Loop, loop_of
from .monolithic import Reference, run_monolithic
from .study import CouplingStudy, Measured, measure

__all__ = [
    "ContinuousController",
    "CoupledRun",
    "Coupling",
    "CouplingStudy",
    "Loop",
    "Measured",
    "Reference",
    "loop_of",
    "measure",
    "run_coupled",
    "run_monolithic",
]
