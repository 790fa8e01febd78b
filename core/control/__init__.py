"""Controllers: what a log.yaml says of them, and the torques they give."""

from .control import Control, read_control, read_locked, read_noise, read_payload
from .controller import Controller
from .gains import default_pd
from .log_file import LogFile, read_log

__all__ = [
    "Control",
    "Controller",
    "LogFile",
    "default_pd",
    "read_control",
    "read_locked",
    "read_log",
    "read_noise",
    "read_payload",
]
