"""Make the blind bank: robots with something missing in their model, and what it is under seal.

    python benchmarks/blind/generate.py BANK --set tune --count nothing=30 --count single=60 ... [--workers 1]
    python benchmarks/blind/generate.py BANK --sample        (a few tiny cases, for the suite)

Writes BANK/<set>/cases/<id>/{robot/, runs/run-01, runs/run-02, holdout/run-03} and, in a tree of its own,
BANK/<set>/sealed/<id>.json. Cases that are there stay as they are; the same command writes the same bytes.
Nothing of mbexport is imported: a robot is its tables' text, and kinematics, dynamics, laws and integrator are here.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from design import CATALOGUE, CLASSES, ROBOTS, case_id, recipe_of, true_world
from equivalent import stated
from record import data_file, database_files, log_file, measured, write_bytes

COUNTS = {
    "dev": {"nothing": 10, "single": 23},
    "tune": {"nothing": 20, "single": 24, "pair": 6, "triple": 2, "outside": 6, "numerical": 4, "positions": 6},
    "report": {
        "nothing": 300, "single": 207, "pair": 100, "triple": 40, "outside": 100, "numerical": 100, "positions": 115,
    },
}  # fmt: skip
# (class, index, seconds a run) of the small sample, all pendulums: nothing, a friction, an offset, an outsider
SAMPLE = (
    ("nothing", 4, 1.5),
    ("single", CATALOGUE.index("viscous_friction") + 10 * len(CATALOGUE), 1.5),
    ("single", CATALOGUE.index("torque_offset") + 9 * len(CATALOGUE), 1.5),
    ("outside", 4, 3.0),
)


def write_case(bank: Path, which: str, group: str, index: int, duration: float | None = None) -> tuple[str, float]:
    """Write one case and its truth unless they are there; (id, seconds it took)."""
    begin = time.perf_counter()
    name = case_id(which, group, index)
    sealed = bank / which / "sealed" / f"{name}.json"
    if sealed.is_file():
        return name, 0.0
    recipe = recipe_of(which, group, index, duration)
    folder = bank / which / "cases" / name
    half = folder.with_name(f".{name}.half")
    shutil.rmtree(half, ignore_errors=True)
    for path, text in database_files(recipe).items():
        write_bytes(half / "robot" / path, text.encode())
    truths = []
    for number, row in enumerate(recipe["runs"], start=1):
        columns, truth = measured(recipe, row)
        if not all(np.isfinite(c).all() for c in columns.values()):
            raise RuntimeError(f"{group} {index}: run {number} is not finite")
        truths.append(truth)
        place = half / ("holdout" if number == len(recipe["runs"]) else "runs") / f"run-{number:02d}"
        file, content = data_file(columns, recipe["sensors"]["csv"])
        write_bytes(place / file, content)
        write_bytes(place / "log.yaml", log_file(recipe).encode())
    recipe["stated"] = stated(recipe, true_world(recipe), truths)
    shutil.rmtree(folder, ignore_errors=True)
    half.rename(folder)
    sealed.parent.mkdir(parents=True, exist_ok=True)
    temporary = sealed.with_suffix(".half")
    temporary.write_text(json.dumps(recipe, indent=1, sort_keys=True) + "\n")
    temporary.replace(sealed)
    return name, time.perf_counter() - begin


def job(arguments: tuple) -> tuple[str, str, float]:
    bank, which, group, index, duration = arguments
    try:
        name, seconds = write_case(bank, which, group, index, duration)
    except RuntimeError as problem:
        return group, f"left out: {problem}", 0.0
    return group, name, seconds


def span(entry: str) -> tuple[str, range]:
    """Which cases of a class: "single=60" are the first 60, "single=60:80" the 20 behind them."""
    group, _, numbers = entry.partition("=")
    begin, _, end = numbers.rpartition(":")
    return group, range(int(begin or 0), int(end))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path)
    parser.add_argument("--set", dest="which", choices=sorted(COUNTS), default="tune")
    parser.add_argument(
        "--count",
        action="append",
        default=[],
        metavar="CLASS=[FROM:]TO",
        help="instead of the set's own counts; FROM leaves out the cases before it",
    )
    parser.add_argument("--robot", action="append", default=[], choices=ROBOTS, help="only cases of this robot")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--sample", action="store_true", help="the small sample of the suite, and nothing else")
    options = parser.parse_args()
    if options.sample:
        jobs = [(options.bank, "sample", group, index, seconds) for group, index, seconds in SAMPLE]
    else:
        spans = {group: range(count) for group, count in COUNTS[options.which].items()}
        if options.count:
            spans = dict(map(span, options.count))
        unknown = set(spans) - set(CLASSES)
        if unknown:
            parser.error(f"no class {', '.join(sorted(unknown))}; there are {', '.join(CLASSES)}")
        jobs = [(options.bank, options.which, g, i, None) for g in CLASSES for i in spans.get(g, ())]
        jobs = [j for j in jobs if not options.robot or ROBOTS[j[3] % len(ROBOTS)] in options.robot]
        # all classes grow together, so that a bank which is stopped early is one
        jobs.sort(key=lambda j: ((j[3] - spans[j[2]].start) / len(spans[j[2]]), j[2]))
    with ProcessPoolExecutor(options.workers) as pool:
        for number, (group, name, seconds) in enumerate(pool.map(job, jobs), start=1):
            print(f"{number}/{len(jobs)} {group} {name} {seconds:.1f} s", flush=True)


if __name__ == "__main__":
    main()
