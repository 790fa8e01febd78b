"""Do all engines run the same robot? Every voice against every other, with gates, and who is wrong in words."""

from .agreement import Agreement, Omission, Voice, agree
from .compare import Figure, Order
from .culprit import Finding
from .gates import GATES, Gate

__all__ = ["GATES", "Agreement", "Figure", "Finding", "Gate", "Omission", "Order", "Voice", "agree"]
