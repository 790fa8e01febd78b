"""mbexport against MuJoCo's own `sysid` and plain least squares on the same cases, in one table.

    python benchmarks/blind/head_to_head.py BANK/tune DIAGNOSED OUT [--workers 1] [--limit 8] [--quick]

DIAGNOSED is what diagnose.py wrote. Every case with a motor torque is fitted by the rivals, which see the same runs
and the known model as MJCF that mbexport emits (rival_sysid.py, rival_regressor.py); what they call a cause is said in
given.py. All corrected robots are simulated along the held-out runs by the same engine. OUT/<rival>/<id>/ gets what a
diagnosis would say, OUT/<rival>/<id>.json the seconds; what is there stays. Only score.py opens the truth. Then
head_to_head.md and head_to_head.json: the cases that all three tried.

Seconds: mbexport's are those of diagnose.py, with reading and the simulations of how far the gap shrinks; a rival's are
reading, export and fit alone.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import rival_regressor
import rival_sysid
from given import LEVEL, Given, Number, Rows, given, rows_of
from score import Case, Figure, markdown, middle, opened

from mbexport.core.diagnosis.blocks import Blocks, Sums
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.errors import MbexportError

ENGINE = "mjcf"
RIVALS: dict[str, Callable[[Given], tuple[Number, ...]]] = {
    "sysid": rival_sysid.fitted,
    "regressor": rival_regressor.fitted,
}
# what every rival has a parameter for
THEIRS = set(rival_sysid.ATTRIBUTES) & set(rival_regressor.EFFECTS)
# a correction that leaves so much more than there was made it worse
WORSE = 1.02


def fit(case: Path, out: Path) -> str:
    """All rivals on one case; a line on how it went."""
    missing = [name for name in RIVALS if not (out / name / f"{case.name}.json").is_file()]
    if not missing:
        return f"{case.name} is there"
    begin, spent = time.perf_counter(), time.process_time()
    known = given(case)
    reading, spent = time.perf_counter() - begin, time.process_time() - spent
    if known is None:
        return f"{case.name} has no torque"
    before = unseen(known, {})
    words = []
    for name in missing:
        begin, busy = time.perf_counter(), time.process_time()
        try:
            numbers, said, code = RIVALS[name](known), "", 0
        # what an engine or a decomposition says of a fit that ran away
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            numbers, said, code = (), str(error), 1
        seconds, cpu = reading + time.perf_counter() - begin, spent + time.process_time() - busy
        if code == 0:
            write(out / name / case.name / "diagnosis.json", diagnosis(known, numbers, before))
        write(out / name / f"{case.name}.json", {"exit": code, "seconds": seconds, "cpu": cpu, "said": said})
        words.append(f"{name} {seconds:.1f} s ({cpu:.1f} s of processor)")
    return f"{case.name} {', '.join(words)}"


def unseen(known: Given, rows: Rows) -> Sums | None:
    """What is left on the held-out runs with rows replaced or added; None where the engine refuses the robot."""
    database, runs = known.database, known.holdout
    nominal = [robot_of(database, LEVEL, run) for run in runs]
    try:
        left = [
            residuals(run, resimulated(robot_of(database, LEVEL, run, rows), robot, run, ENGINE), robot)
            for run, robot in zip(runs, nominal, strict=True)
        ]
    except MbexportError:
        return None
    return Blocks.of(left, [noise_floor(database, LEVEL, run) for run in runs], runs).together()


def diagnosis(known: Given, numbers: tuple[Number, ...], before: Sums | None) -> dict:
    """What a rival found, as diagnosis.json says it. It has no word for what it cannot explain."""
    which = [number.finding() for number in sorted(numbers, key=lambda one: -one.shows) if number.named]
    after = unseen(known, rows_of(numbers))
    held: dict = {"before": {}, "after": {}, "noise": {}, "shrinks_by": None}
    if before is not None and after is not None:
        held["before"] = {name: before.rms(name) for name in before.signals}
        held["noise"] = {name: before.noise(name) for name in before.signals}
        held["after"] = {name: after.rms(name) for name in after.signals}
        if before.gap() > 0.0:
            held["shrinks_by"] = float(1.0 - after.gap() / before.gap())
    return {
        "verdict": "explained" if which else "no_gap",
        "which": which,
        "how_far": {"holdout": held},
        "numbers": [
            {"effect": one.effect, "joint": one.joint, "nominal": one.nominal, "value": one.value, "half": one.half,
             "shows": one.shows}
            for one in numbers
        ],
    }  # fmt: skip


def write(path: Path, data: dict) -> None:
    """A file that is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_suffix(".half")
    half.write_text(json.dumps(data, indent=1) + "\n")
    half.replace(path)


# ---------------------------------------------------------------------------------------------------------- the table


def table(cases: list[Case]) -> list[Figure]:
    """All lines of one tool, from the cases as it answered them."""

    def of(*groups: str) -> list[Case]:
        return [c for c in cases if c.group in groups]

    single = [c for c in of("single") if not c.weak]
    weak = [c for c in of("single") if c.weak]
    several = of("pair", "triple")
    answered = [c for c in cases if c.said["verdict"] != "none"]
    common = [c for c in single if c.wanted[0][0] in THEIRS]
    out = [
        Figure("single effect: it and its place named, and nothing else", "", [c.exact_as_far for c in single]),
        Figure("... where every rival has a parameter for it", "", [c.exact_as_far for c in common]),
        Figure("single effect: among the names", "", [c.in_sets for c in single]),
        Figure("single effect: a wrong name", "", [wrong(c) for c in single]),
        Figure("barely visible: a wrong name", "", [wrong(c) for c in weak]),
        Figure("nothing missing: an effect named", "", [bool(c.named) for c in of("nothing")]),
        Figure("numerical suspects: an effect named", "", [bool(c.named) for c in of("numerical")]),
        Figure("not in the catalogue: said so", "", [c.open for c in of("outside")]),
        Figure("not in the catalogue: an effect named", "", [bool(c.named) for c in of("outside")]),
        Figure("pairs: exact", "", [c.exact_as_far for c in of("pair")]),
        Figure("triples: exact", "", [c.exact_as_far for c in of("triple")]),
        Figure("pairs and triples: names that are right", "", [c.right(n) for c in several for n in c.named]),
        Figure("pairs and triples: a wrong name", "", [wrong(c) for c in several]),
    ]
    for words, chosen in (
        ("single effect", single),
        ("pairs and triples", several),
        ("nothing missing", of("nothing")),
    ):
        for signal, long in (("tau", "torque"), ("q", "position")):
            before, after = (held_out(chosen, signal, when) for when in ("before", "after"))
            text = "no case" if not after else f"{median(before)} -> {median(after)} ({len(after)})"
            out.append(Figure(f"held-out {long} error in units of noise, median: {words}", "", text=text))
        pairs = [(b, a) for b, a in zip(total(chosen, "before"), total(chosen, "after"), strict=True)]
        out.append(Figure(f"... made worse on held-out runs: {words}", "", [a > WORSE * b for b, a in pairs]))
    out.append(Figure("held-out simulation refused", "", [not held(c).get("after") for c in answered]))
    out.append(Figure("no answer", "", [c.said["verdict"] == "none" for c in cases]))
    out.append(Figure("seconds a case", "", text=middle((c.seconds for c in cases), 1)))
    return out


def wrong(case: Case) -> bool:
    return any(not case.right(name) for name in case.named)


def held(case: Case) -> dict:
    return (case.said.get("how_far") or {}).get("holdout") or {}


def held_out(cases: Iterable[Case], signal: str, when: str) -> list[float]:
    """Root mean square of a signal on held-out runs in units of its noise, of the cases that have it."""
    found = []
    for case in cases:
        value, noise = (held(case).get(key, {}).get(signal) for key in (when, "noise"))
        if value is not None and noise:
            found.append(value / noise)
    return found


def total(cases: Iterable[Case], when: str) -> list[float]:
    """Over all signals, root of the mean square in units of noise; of the cases that were simulated."""
    found = []
    for case in cases:
        values, noise = held(case).get(when) or {}, held(case).get("noise") or {}
        parts = [(values[name] / noise[name]) ** 2 for name in values if noise.get(name)]
        if parts:
            found.append(math.sqrt(statistics.fmean(parts)))
    return found


def median(values: list[float]) -> str:
    return f"{statistics.median(values):.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path)
    parser.add_argument("diagnosed", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=int, help="only the first so many cases of those that were diagnosed")
    parser.add_argument("--quick", action="store_true", help="nothing that has to be simulated first (see score.py)")
    options = parser.parse_args()
    if not rival_sysid.is_there():
        parser.error("mujoco.sysid needs more than MuJoCo: pip install 'mbexport[benchmarks]'")
    tried = [path for path in sorted((options.bank / "cases").iterdir()) if not path.name.startswith(".")]
    tried = [path for path in tried if (options.diagnosed / f"{path.name}.json").is_file()][: options.limit]
    with ProcessPoolExecutor(options.workers) as pool:
        for line in pool.map(fit, tried, [options.out] * len(tried)):
            print(line, flush=True)
    places = {"mbexport": options.diagnosed, **{name: options.out / name for name in RIVALS}}
    answers = {
        name: opened(options.bank, place, quick=options.quick, shrinkage=False) for name, place in places.items()
    }
    common = set.intersection(*({case.name for case in cases} for cases in answers.values()))
    columns = {name: table([case for case in cases if case.name in common]) for name, cases in answers.items()}
    rows = [[figure.name, *(t[k].shown() for t in columns.values())] for k, figure in enumerate(columns["mbexport"])]
    rows = [row for row in rows if set(row[1:]) != {"no case"}]
    text = markdown([f"{len(common)} cases with torque", *columns], rows)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "head_to_head.md").write_text(text)
    data = {
        "cases": sorted(common),
        "figures": {name: {figure.name: figure.data() for figure in figures} for name, figures in columns.items()},
    }
    write(options.out / "head_to_head.json", data)
    print(text, end="")


if __name__ == "__main__":
    main()
