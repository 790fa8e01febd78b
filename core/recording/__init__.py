"""Recorded runs: read as they come, bad samples found and named, the noise of every channel known."""

from .noise import ChannelNoise, known_together, noise_of, steps_of
from .read import read_run, read_runs
from .run import LeftOut, Run

__all__ = ["ChannelNoise", "LeftOut", "Run", "known_together", "noise_of", "read_run", "read_runs", "steps_of"]
