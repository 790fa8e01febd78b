"""Controllers: what a log.yaml says of them, and the torques they give."""

from .control import Control, read_control
from .controller import Controller
from .gains import default_pd
from .log_file import LogFile, read_log
from .log_parts import read_locked, read_noise, read_payload
from .pd_law import PdTable
from .unit_controller import UnitController, check_unit
from .unit_file import ControllerUnit, read_unit
from .unit_signals import Signals, read_signals

__all__ = [
    "Control",
    "Controller",
    "ControllerUnit",
    "LogFile",
    "PdTable",
    "Signals",
    "UnitController",
    "check_unit",
    "default_pd",
    "read_control",
    "read_locked",
    "read_log",
    "read_noise",
    "read_payload",
    "read_signals",
    "read_unit",
]
