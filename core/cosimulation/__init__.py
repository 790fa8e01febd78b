"""Co-simulation: a controller and a robot with a solver each, that hear of each other at communication points only."""

from .controller import ContinuousController
from .coupling import CoupledRun, Coupling, run_coupled
from .loop import Loop, loop_of
from .monolithic import OnePiece, run_monolithic
from .partner import Partner
from .reference import Reference
from .study import CouplingStudy, Measured, measure
from .unit import UnitInLoop

__all__ = [
    "ContinuousController",
    "CoupledRun",
    "Coupling",
    "CouplingStudy",
    "Loop",
    "Measured",
    "OnePiece",
    "Partner",
    "Reference",
    "UnitInLoop",
    "loop_of",
    "measure",
    "run_coupled",
    "run_monolithic",
]
