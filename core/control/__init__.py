"""Controllers: what a log.yaml says of them, and the torques they give."""

from .control import Control, read_control, read_log, read_noise
from .controller import Controller
from .gains import default_pd

__all__ = ["Control", "Controller", "default_pd", "read_control", "read_log", "read_noise"]
