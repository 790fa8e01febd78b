"""Which variants a study runs: a grid, or samples of the ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from .parameter import Parameter

Array = NDArray[np.float64]
Sampling = Literal["grid", "random", "lhs", "sobol", "morris"]
SAMPLINGS: tuple[str, ...] = get_args(Sampling)

MOST_VARIANTS = 1_000_000
MORRIS_LEVELS = 4
_FEWEST_BLOCKS = {"sobol": 8, "morris": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """The variants of a study.

    Attributes:
        sampling: How they were chosen.
        seed: Of the samples; 0 for a grid.
        parameters: What varies.
        unit: Samples: the free parameters of each variant in [0, 1], shape (m, free); grid: shape (m, 0).
        values: All parameters of each variant, SI, shape (m, k).
        block: Variants that are analysed together (sobol, morris); 1 else.
    """

    sampling: Sampling
    seed: int
    parameters: tuple[Parameter, ...]
    unit: Array
    values: Array
    block: int

    @property
    def free(self) -> tuple[int, ...]:
        """Numbers of the parameters that are not the same in all variants, from 0."""
        return tuple(i for i, parameter in enumerate(self.parameters) if not parameter.fixed)

    def __len__(self) -> int:
        return len(self.values)


def design(
    parameters: Sequence[Parameter], sampling: Sampling = "grid", count: int | None = None, seed: int = 0
) -> Design:
    """The variants of a study; the same for the same arguments.

    Args:
        parameters: What varies.
        sampling: "grid": all combinations, the last parameter fastest. "random"; "lhs": Latin hypercube; "sobol":
            Saltelli's scheme on a scrambled Sobol sequence, N (k + 2) variants of k free parameters; "morris":
            N (k + 1).
        count: Of variants; sobol takes the nearest power of two as N, morris the nearest whole number. Not for a grid.
        seed: Of the samples.

    Raises:
        UsageError: What does not fit together.
    """
    names = [parameter.name for parameter in parameters]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise UsageError(f"{repeated} is varied twice; give it once.")
    if not parameters:
        raise UsageError("nothing varies; give --vary.")
    if sampling == "grid":
        return _grid(tuple(parameters), count)
    return _samples(tuple(parameters), sampling, count, seed)


def _grid(parameters: tuple[Parameter, ...], count: int | None) -> Design:
    if count is not None:
        raise UsageError("--count is for samples; a grid has its counts in the ranges, FROM:TO:COUNT.")
    for parameter in parameters:
        if not (parameter.listed or parameter.fixed or parameter.count):
            raise UsageError(f"{parameter.name}: a grid needs a count, FROM:TO:COUNT, or a list of values.")
    steps = [parameter.grid() for parameter in parameters]
    total = math.prod(len(x) for x in steps)
    if total > MOST_VARIANTS:
        raise UsageError(
            f"the grid has {total} variants, more than {MOST_VARIANTS}; take fewer steps, or --sample lhs --count N."
        )
    meshes = np.meshgrid(*steps, indexing="ij")
    x = np.stack([mesh.ravel() for mesh in meshes], axis=1)
    return Design("grid", 0, parameters, np.zeros((total, 0)), x * _scales(parameters), 1)


def _samples(parameters: tuple[Parameter, ...], sampling: Sampling, count: int | None, seed: int) -> Design:
    free = [parameter for parameter in parameters if not parameter.fixed]
    if not free:
        raise UsageError(f"--sample {sampling} needs a parameter with a range, FROM:TO.")
    listed = next((parameter for parameter in free if parameter.listed), None)
    if listed is not None:
        raise UsageError(f"{listed.name}: --sample {sampling} takes a range FROM:TO, not a list of values.")
    if count is None:
        raise UsageError(f"--sample {sampling} needs --count, the number of variants.")
    if not 1 <= count <= MOST_VARIANTS:
        raise UsageError(f"--count {count}: it must be from 1 to {MOST_VARIANTS}.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must not be below 0.")
    problem = problem_of(free)
    block = {"sobol": len(free) + 2, "morris": len(free) + 1}.get(sampling, 1)
    # what comes last needs it too
    salib("analyze")
    if sampling == "random":
        unit = np.random.default_rng(seed).uniform(size=(count, len(free)))
    elif sampling == "lhs":
        unit = salib("sample.latin").sample(problem, count, seed=seed)
    else:
        blocks = count / block
        if blocks < _FEWEST_BLOCKS[sampling]:
            raise UsageError(
                f"--sample {sampling} of {len(free)} parameters needs --count {block * _FEWEST_BLOCKS[sampling]} or "
                f"more, not {count}."
            )
        if sampling == "sobol":
            n = 2 ** round(math.log2(blocks))
            unit = salib("sample.sobol").sample(problem, n, calc_second_order=False, seed=seed)
        else:
            unit = salib("sample.morris").sample(problem, round(blocks), num_levels=MORRIS_LEVELS, seed=seed)
    unit = np.ascontiguousarray(unit, dtype=np.float64)
    x = np.empty((len(unit), len(parameters)))
    columns = iter(unit.T)
    for i, parameter in enumerate(parameters):
        x[:, i] = parameter.low if parameter.fixed else parameter.spread(next(columns))
    return Design(sampling, seed, parameters, unit, x * _scales(parameters), block)


def _scales(parameters: Sequence[Parameter]) -> Array:
    return np.array([parameter.scale for parameter in parameters])


def problem_of(free: Sequence[Parameter]) -> dict[str, Any]:
    """The parameters as SALib wants them, each in [0, 1]."""
    return {"num_vars": len(free), "names": [parameter.name for parameter in free], "bounds": [[0.0, 1.0]] * len(free)}


def salib(module: str) -> Any:
    """A module of SALib, which only studies with samples need.

    Raises:
        UsageError: It is not installed.
    """
    try:
        return import_module(f"SALib.{module}")
    except ImportError as error:
        raise UsageError("samples and their indices need SALib: pip install 'mbexport[study]'") from error
