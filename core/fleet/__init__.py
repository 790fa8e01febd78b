"""A fleet: many robots and their runs diagnosed alike, into one table and one page."""

from .cases import Case, cases_in
from .results import Fleet, fleet_of
from .run import plan_fleet, run_fleet
from .work import Diagnosing, Outcome

__all__ = ["Case", "Diagnosing", "Fleet", "Outcome", "cases_in", "fleet_of", "plan_fleet", "run_fleet"]
