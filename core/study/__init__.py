"""Parametric studies: many variants of one robot, and what the tip's error owes to which parameter."""

from .design import Design, Sampling, design
from .parameter import Parameter, parse_vary
from .results import Results, results_of
from .run import run_study
from .study import Study, plan_study

__all__ = [
    "Design",
    "Parameter",
    "Results",
    "Sampling",
    "Study",
    "design",
    "parse_vary",
    "plan_study",
    "results_of",
    "run_study",
]
