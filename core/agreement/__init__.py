"""Do all engines run the same robot? Every voice against every other, with gates, and who is wrong in words."""

from .agree import agree
from .agreement import Agreement, Omission, Voice
from .compare import Figure, Order
from .culprit import Finding
from .gates import GATES, Gate

__all__ = ["GATES", "Agreement", "Figure", "Finding", "Gate", "Omission", "Order", "Voice", "agree"]
