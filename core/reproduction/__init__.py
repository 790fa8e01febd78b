"""The study of IMECE2013-64815 done again: its figures, its statements, and what ours says to each."""

from .reproduction import Reproduction, reproduce
from .statements import Statement, statements

__all__ = ["Reproduction", "Statement", "reproduce", "statements"]
