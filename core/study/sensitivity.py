"""What the tip's error owes to which parameter.

Samples are analysed by SALib: Sobol indices by Saltelli's scheme (Saltelli et al., 2010), elementary effects (Morris,
1991), first-order indices of any samples by random balance designs (Tarantola et al., 2006; Plischke, 2010). On a full
grid the same indices are plain sums over its levels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .design import MORRIS_LEVELS, Design, problem_of, salib
from .figures import TIP

Array = NDArray[np.float64]
Method = Literal["sobol", "morris", "rbd_fast", "grid"]

# harmonics of rbd_fast, and the fewest samples from which it says anything
HARMONICS = 10
FEWEST = 65
FEWEST_BLOCKS = 4
# share of the mean below which a figure does not vary
CONSTANT = 1.0e-12


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How one figure depends on the parameters that vary.

    Attributes:
        figure: Name of the figure.
        method: How it was found.
        parameters: Names, in the order of the study.
        values: Name of an index to its value a parameter. "first": share of the variance that the parameter explains
            alone; "total": with all that it does together with others; "mean_effect", "spread_effect": mean magnitude
            and spread of the change of the figure over the parameter's whole range (Morris) [m]; "..._ci": half width
            of the 95 % interval.
        note: Why there are none, or what they leave out; "" else.
    """

    figure: str
    method: Method
    parameters: tuple[str, ...]
    values: Mapping[str, tuple[float, ...]]
    note: str = ""

    @property
    def ranking(self) -> str:
        """Name of the index by which parameters are sorted; "" where there is none."""
        return next((name for name in ("total", "mean_effect", "first") if name in self.values), "")


def sensitivities(design: Design, figures: Mapping[str, Array]) -> tuple[Sensitivity, ...]:
    """Of the tip's error: root mean square, maximum, end.

    Args:
        design: The variants.
        figures: Name to values, shape (m,); nan where a variant failed.
    """
    return tuple(sensitivity(design, name, figures[name]) for name in TIP)


def sensitivity(design: Design, name: str, y: Array) -> Sensitivity:
    """How a figure y (m,) depends on the parameters; nan where a variant failed."""
    free = design.free
    names = tuple(design.parameters[i].name for i in free)
    method = _method(design)
    kept, left_out = _kept(design, y)
    note = ""
    if left_out:
        what = {"sobol": "blocks", "morris": "trajectories"}.get(design.sampling, "variants")
        note = f"{left_out} of {len(y) // design.block} {what} are left out, for a variant in them failed"
    fewest = {"sobol": FEWEST_BLOCKS, "morris": FEWEST_BLOCKS, "rbd_fast": FEWEST, "grid": 1}[method]
    if not free:
        return Sensitivity(name, method, names, {}, "nothing varies")
    if len(kept) // design.block < fewest:
        why = f"{len(kept)} variants that ran are too few for {method}; it needs {fewest * design.block}"
        return Sensitivity(name, method, names, {}, why)
    values = y[kept]
    if np.ptp(values) <= CONSTANT * np.max(np.abs(values)):
        return Sensitivity(name, method, names, {}, "no variant differs")
    found = _analysed(design, method, kept, values)
    return Sensitivity(
        name, method, names, {index: tuple(map(float, numbers)) for index, numbers in found.items()}, note
    )


def _method(design: Design) -> Method:
    if design.sampling in ("sobol", "morris", "grid"):
        return design.sampling
    return "rbd_fast"


def _kept(design: Design, y: Array) -> tuple[NDArray[np.int64], int]:
    """Numbers of the variants that can be analysed, shape (k,), and how many blocks are left out."""
    ran = np.isfinite(y).reshape(-1, design.block).all(axis=1)
    return np.flatnonzero(np.repeat(ran, design.block)), int((~ran).sum())


def _analysed(design: Design, method: Method, kept: NDArray[np.int64], y: Array) -> Mapping[str, Any]:
    if method == "grid":
        return _of_grid(design, kept, y)
    problem = problem_of([design.parameters[i] for i in design.free])
    unit = design.unit[kept]
    # SALib takes the seed 0 for none
    seed = design.seed + 1
    if method == "sobol":
        found = salib("analyze.sobol").analyze(problem, y, calc_second_order=False, seed=seed)
        return {"first": found["S1"], "first_ci": found["S1_conf"], "total": found["ST"], "total_ci": found["ST_conf"]}
    if method == "morris":
        found = salib("analyze.morris").analyze(problem, unit, y, num_levels=MORRIS_LEVELS, seed=seed)
        return {
            "mean_effect": found["mu_star"],
            "mean_effect_ci": found["mu_star_conf"],
            "spread_effect": found["sigma"],
        }
    found = salib("analyze.rbd_fast").analyze(problem, unit, y, M=HARMONICS, seed=seed)
    return {"first": found["S1"], "first_ci": found["S1_conf"]}


def _of_grid(design: Design, kept: NDArray[np.int64], y: Array) -> Mapping[str, Any]:
    """Variance of the means over each level, and mean of the variance within each combination of the others."""
    variance = float(np.var(y))
    first: list[float] = []
    total: list[float] = []
    for i in design.free:
        levels = design.values[kept, i]
        others = np.delete(design.values[kept], i, axis=1)
        first.append(_variance_of_means(levels[:, None], y) / variance)
        total.append(1.0 - _variance_of_means(others, y) / variance)
    return {"first": first, "total": total}


def _variance_of_means(keys: Array, y: Array) -> float:
    """Variance of the means of y (m,) over equal rows of the keys (m, k), each weighted by its number."""
    if keys.shape[1] == 0:
        return 0.0
    _, group = np.unique(keys, axis=0, return_inverse=True)
    count = np.bincount(group.ravel())
    means = np.bincount(group.ravel(), weights=y) / count
    return float(np.sum(count * (means - y.mean()) ** 2) / len(y))


def level_means(design: Design, i: int, y: Array) -> tuple[Array, Array]:
    """Levels of parameter i of a grid, and the mean of y (m,) at each, shapes (k,); failed variants left out."""
    ran = np.isfinite(y)
    levels, group = np.unique(design.values[ran, i], return_inverse=True)
    return levels, np.bincount(group.ravel(), weights=y[ran]) / np.bincount(group.ravel())
