"""Open truth and diagnoses of a bank, and write what was right: counts with Wilson 95 % intervals, as one table.

    python benchmarks/blind/score.py BANK/tune OUT [OUT...] [--quick [--shrinkage]]

Each OUT is as diagnose.py or head_to_head.py wrote it, and is a column of the table. Adds to the first OUT: score.md
with the figures and how reliable its probabilities are, score.json with the same and every finding beside its
probability, and cases.md with a line a case. What can be told apart is apart.py's to say, and looked up beside the
truth; --quick leaves out what is not there yet, and the true shrinkage unless --shrinkage asks for it. One effect named
in the place of another is simulated by the generator's engine, with the numbers it was given: where it leaves less of
the gap than effects do that are alike, it is. A case that was tried and gave no diagnosis counts as wrong.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import statistics
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

NAMELESS = {"verdict": "none", "which": [], "how_far": {}}
# a claim of shrinkage is right within
CLOSE = 0.05
NOISE_FLOOR = 1.2
SECONDS = 60.0
SMALL_SET = 2
# energy of a gap in units of noise below which no fit has ten nats to tell it by, whatever else it knows
LEAST = 20.0
SIX_JOINTS = ("imece2013", "puma560")
# edges of the bins in which probabilities are held against how often they are right
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)


def wilson(right: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    p = right / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def difference(some: list[bool], others: list[bool]) -> str:
    """Share of others less share of some in points, with its interval (Newcombe 1998, out of Wilson's)."""
    if not some or not others:
        return "no case"
    p, q = (sum(answers) / len(answers) for answers in (some, others))
    (low_p, high_p), (low_q, high_q) = (wilson(sum(answers), len(answers)) for answers in (some, others))
    low = q - p - math.hypot(q - low_q, high_p - p)
    high = q - p + math.hypot(high_q - q, p - low_p)
    return f"{100 * (q - p):+.1f} points [{100 * low:+.1f}, {100 * high:+.1f}] ({len(others)} against {len(some)})"


Name = tuple[str, str]


@dataclass
class Case:
    """One case with its truth opened.

    Attributes:
        name: Its folder.
        truth, said: What was sealed, what the diagnosis says.
        apart: For each true effect what apart.py says of it; None: not looked at.
        seconds: What the diagnosis took.
        shrinks: (true shrinkage, gap before in units of noise); None: not asked for.
        same: Whether the one effect that was named shows, with its numbers, the same as the true one.
    """

    name: str
    truth: dict
    said: dict
    apart: list[dict] | None
    seconds: float
    shrinks: tuple[float, float] | None = None
    same: bool = False
    wanted: list[Name] = field(default_factory=list)
    named: list[Name] = field(default_factory=list)
    sets: list[set[Name]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.wanted = [(e["effect"], e["at"]) for e in self.truth["stated"]]
        for finding in self.said["which"]:
            own = (finding["effect"], finding["at"])
            others = {(o["effect"], o["at"]) for o in finding.get("indistinguishable_from") or []}
            self.named.append(own)
            self.sets.append({own, *others})

    @property
    def group(self) -> str:
        return self.truth["case"]["class"]

    @property
    def weak(self) -> bool:
        return self.truth["strength"] == "weak"

    @property
    def white(self) -> bool:
        return self.truth["sensors"]["colour"] == 0.0

    @property
    def torque(self) -> bool:
        return "tau" in self.truth["sensors"]["channels"]

    @property
    def classes(self) -> list[set[Name]]:
        """The names that are right for each true effect: its own, and those that would show the same."""
        same = self.named if self.same else []
        if self.apart is None:
            return [{name, *self.one_body(name), *same} for name in self.wanted]
        return [
            {(row["effect"], row["at"]), *((o["effect"], o["at"]) for o in row["alike"]), *same} for row in self.apart
        ]

    @property
    def together(self) -> set[Name]:
        """Names that alone show the same as all true effects."""
        return {(o["effect"], o["at"]) for row in self.apart or () for o in row.get("together", ())}

    def one_body(self, name: Name) -> set[Name]:
        """The other name of what hangs at the last arm, with any motion: a load, or that arm's inertia."""
        arms = (self.truth.get("drawn") or {}).get("arms", ())
        body = {("payload", "robot"), ("link_inertia", f"arm_{len(arms)}")}
        return body if name in body else set()

    @property
    def distinct(self) -> bool:
        """Whether each true effect is like no other."""
        return all(len(names) == 1 for names in self.classes)

    @property
    def seen(self) -> bool:
        """Whether the runs that a fit may see show every true effect."""
        return all(row.get("fitted", LEAST) >= LEAST for row in self.apart or ())

    @property
    def exact(self) -> bool:
        """Every true effect named, and nothing else."""
        return sorted(self.named) == sorted(self.wanted)

    @property
    def exact_as_far(self) -> bool:
        """One finding for every true effect, by its name or one that shows the same; or one that does so for all."""
        if len(self.named) == 1 and self.named[0] in self.together:
            return True
        left = list(self.named)
        for names in sorted(self.classes, key=len):
            match = next((name for name in left if name in names), None)
            if match is None:
                return False
            left.remove(match)
        return not left

    @property
    def in_sets(self) -> bool:
        """Every true effect among the names of a finding."""
        return all(any(name in names for names in self.sets) for name in self.wanted)

    def right(self, name: Name) -> bool:
        """Whether a name is one of a true effect's."""
        return any(name in names for names in (*self.classes, self.together))

    @property
    def lawful(self) -> bool:
        """The catalogue's own laws alone."""
        return all(e["exact"] for e in self.truth["stated"])

    @property
    def open(self) -> bool:
        """Called unexplained, or partly."""
        return self.said["verdict"] in ("unexplained", "partly_explained")

    def covers(self) -> list[bool]:
        """Whether the 95 % interval of each number of a rightly named effect holds the truth."""
        out = []
        for effect in self.truth["stated"]:
            for finding in self.said["which"]:
                if (finding["effect"], finding["at"]) != (effect["effect"], effect["at"]) or not effect["scored"]:
                    continue
                for name, value in effect["total"].items():
                    interval = (finding["parameters"].get(name) or {}).get("ci95")
                    if interval and None not in interval:
                        # a phase is an angle: of all that are the same, the nearest
                        turns = round((sum(interval) / 2.0 - value) / math.tau) if name == "phase" else 0
                        out.append(interval[0] <= value + math.tau * turns <= interval[1])
        return out

    @property
    def over_floor(self) -> float | None:
        """Held-out gap after in units of the noise floor, root mean square over the signals."""
        held = (self.said.get("how_far") or {}).get("holdout") or {}
        after, noise = held.get("after") or {}, held.get("floor") or held.get("noise") or {}
        parts = [(after[name] / noise[name]) ** 2 for name in after if noise.get(name) and after[name] is not None]
        return math.sqrt(statistics.fmean(parts)) if parts else None

    @property
    def claimed(self) -> float | None:
        """The shrinkage that the diagnosis claims."""
        return ((self.said.get("how_far") or {}).get("holdout") or {}).get("shrinks_by")


@dataclass(frozen=True)
class Figure:
    """A line of the table: a share of answers, or a number of its own."""

    name: str
    goal: str
    answers: list[bool] | None = None
    text: str = ""

    def shown(self) -> str:
        if self.answers is None:
            return self.text
        if not self.answers:
            return "no case"
        yes, count = sum(self.answers), len(self.answers)
        low, high = wilson(yes, count)
        return f"{yes} of {count}: {yes / count:.1%} [{low:.1%}, {high:.1%}]"

    def data(self) -> dict:
        if self.answers is None:
            return {"text": self.text}
        return {
            "yes": sum(self.answers),
            "of": len(self.answers),
            "wilson95": wilson(sum(self.answers), len(self.answers)),
        }


def middle(values: Iterable[float], digits: int = 2) -> str:
    """Median, and the largest."""
    values = sorted(values)
    if not values:
        return "no case"
    return f"median {statistics.median(values):.{digits}f}, most {values[-1]:.{digits}f} ({len(values)})"


def figures(cases: list[Case]) -> list[Figure]:
    """The whole table."""
    group: dict[str, list[Case]] = {}
    for case in cases:
        group.setdefault(case.group, []).append(case)

    def of(*names: str) -> list[Case]:
        return [case for name in names for case in group.get(name, [])]

    plain = [c for c in of("single") if not c.weak]
    bare = [c for c in of("positions") if not c.weak]
    weak = [c for c in of("single", "positions") if c.weak]
    seen = [c for c in of("single", "positions") if not c.weak]
    several = of("pair", "triple")
    catalogued = [*seen, *several]
    foreign = of("outside")
    distinct_foreign = [c for c in foreign if c.distinct]
    # as positions alone are recorded, but for the torque
    beside = [c for c in plain if c.torque and c.truth["control"]["mode"] == "pd"]
    sets = [names for c in seen for names in c.sets]
    far = [(c, size) for c in catalogued if c.exact_as_far and (size := c.over_floor) is not None]
    over_floor = [size for _, size in far]
    truly = [(c, c.shrinks[0]) for c in cases if c.shrinks is not None]
    # who names nothing claims nothing
    off = [abs(said - true) for c, true in truly if c.named and (said := c.claimed) is not None]
    worse = [true < 0.0 for c, true in truly if c.claimed is not None and c.named]

    def named_right(cases: list[Case]) -> list[bool]:
        return [c.exact for c in cases if c.distinct]

    out = [
        Figure("single effect: effect and place right, where it is like no other", "95 %", named_right(plain)),
        Figure("... and the fitted runs show it", "", named_right([c for c in plain if c.seen])),
        Figure("... by its name or one that shows the same, all", "", [c.exact_as_far for c in plain]),
    ]
    out += [
        Figure(f"... {robot}", "", [c.exact_as_far for c in plain if c.truth["robot"] == robot])
        for robot in sorted({c.truth["robot"] for c in plain})
    ]
    out += [
        Figure("... " + words, "", [c.exact_as_far for c in plain if test(c)])
        for words, test in (
            ("strong", lambda c: c.truth["strength"] == "strong"),
            ("medium", lambda c: c.truth["strength"] == "medium"),
            ("the catalogue's own law", lambda c: c.lawful),
            ("another form of the law", lambda c: not c.lawful),
            ("white noise", lambda c: c.white),
            ("AR(0.95) noise", lambda c: not c.white),
            *(
                (f"mode {m}", lambda c, m=m: c.truth["control"]["mode"] == m)
                for m in ("pd", "motion", "torque", "unknown")
            ),
        )
    ]
    out += [
        Figure(
            "positions alone: effect and place right, where it is like no other", "5 points less", named_right(bare)
        ),
        Figure("positions alone: ... and the fitted runs show it", "", named_right([c for c in bare if c.seen])),
        Figure("... the same with torque, mode pd", "", named_right(beside)),
        Figure("... less that with torque", "-5 points", text=difference(named_right(beside), named_right(bare))),
        Figure("positions alone: by its name or one that shows the same, all", "", [c.exact_as_far for c in bare]),
        Figure("single effect: truth in the reported set", "99 %", [c.in_sets for c in plain]),
        Figure("... where the fitted runs show it", "", [c.in_sets for c in plain if c.seen]),
        Figure("positions alone: truth in the reported set", "", [c.in_sets for c in bare]),
        Figure("size of reported sets", "median 2", text=middle((len(names) for names in sets), 0)),
        Figure("... sets of two names or one", "", [len(names) <= SMALL_SET for names in sets]),
        Figure("called unexplained or partly, wrongly", "5 %", [c.open for c in catalogued]),
        Figure("... of the catalogue's own laws", "", [c.open for c in catalogued if c.lawful]),
        Figure("called no_gap, wrongly", "", [c.said["verdict"] == "no_gap" for c in catalogued]),
        Figure("nothing missing: an effect named (false alarm)", "1 %", [bool(c.named) for c in of("nothing")]),
        Figure("nothing missing: verdict no_gap", "", [c.said["verdict"] == "no_gap" for c in of("nothing")]),
        Figure(
            "not in the catalogue: called unexplained or partly, where like no effect of it",
            "90 %",
            [c.open for c in distinct_foreign],
        ),
        Figure("not in the catalogue: verdict explained", "", [c.said["verdict"] == "explained" for c in foreign]),
        Figure("barely visible: a wrong name", "2 %", [any(not c.right(n) for n in c.named) for c in weak]),
        Figure("barely visible: named right", "", [c.exact_as_far for c in weak]),
        Figure("pairs: exact, by names or such as show the same", "80 %", [c.exact_as_far for c in of("pair")]),
        Figure("pairs: findings that are right", "95 %", [c.right(n) for c in of("pair") for n in c.named]),
        Figure("triples: exact, by names or such as show the same", "", [c.exact_as_far for c in of("triple")]),
        Figure("triples: findings that are right", "", [c.right(n) for c in of("triple") for n in c.named]),
        Figure(
            "pairs and triples: true effects in a set",
            "",
            [name in set().union(*c.sets) for c in several for name in c.wanted],
        ),
    ]
    for words, lawful in (("the catalogue's own laws", True), ("other forms", False)):
        for noise, white in (("white", True), ("AR(0.95)", False)):
            chosen = [c for c in [*seen, *weak, *several] if c.lawful == lawful and c.white == white]
            goal = "92 to 98 %"
            out.append(
                Figure(
                    f"95 % intervals hold the truth: {words}, {noise} noise",
                    goal,
                    [x for c in chosen for x in c.covers()],
                )
            )
    out += [
        Figure(
            "right ones: held-out gap within 1.2 times the noise floor",
            "all",
            [size <= NOISE_FLOOR for size in over_floor],
        ),
        Figure("... that, of the catalogue's own laws", "", [size <= NOISE_FLOOR for c, size in far if c.lawful]),
        Figure("... its size", "1.2", text=middle(over_floor)),
        Figure("... its size, of the catalogue's own laws", "", text=middle(size for c, size in far if c.lawful)),
        Figure("claimed against true shrinkage within 5 points", "all", [x <= CLOSE for x in off]),
        Figure("... how far off", "0.05", text=middle(off, 3)),
        Figure("made worse, truly, by what was found", "", worse),
        Figure("numerical suspects named as physics", "0", [bool(c.named) for c in of("numerical")]),
        Figure("took 60 s or less", "all", [c.seconds <= SECONDS for c in cases]),
        Figure(
            "... of robots with six joints",
            "all",
            [c.seconds <= SECONDS for c in cases if c.truth["robot"] in SIX_JOINTS],
        ),
        Figure("seconds a case", "", text=middle((c.seconds for c in cases), 1)),
        Figure("tried and gave no diagnosis", "0", [c.said["verdict"] == "none" for c in cases]),
    ]
    return out


@dataclass(frozen=True)
class Claim:
    """A finding beside the truth.

    Attributes:
        case, group: Where it was said.
        name: Its effect and place.
        probability: What the diagnosis gave it.
        right: Whether its name, or one that it says cannot be told from it, is a true effect's.
    """

    case: str
    group: str
    name: Name
    probability: float
    right: bool


def claims(cases: list[Case]) -> list[Claim]:
    """Every finding that has a probability."""
    return [
        Claim(case.name, case.group, name, finding["probability"], any(case.right(one) for one in names))
        for case in cases
        for finding, name, names in zip(case.said["which"], case.named, case.sets, strict=True)
        if finding.get("probability") is not None
    ]


def reliability(found: list[Claim]) -> list[list[str]]:
    """Rows of a table: probabilities of a bin, their mean, and how many of the findings are right.

    Apart: robots with a true effect of the catalogue, and all, where every name on one that has none is wrong.
    """
    known = [one for one in found if one.group in ("single", "positions", "pair", "triple")]
    rows = []
    for low, high in itertools.pairwise(BINS):
        row = [f"{low!r} to {high!r}"]
        for some in (known, found):
            chosen = [one for one in some if low <= one.probability < high or one.probability == high == BINS[-1]]
            mean = f"{statistics.fmean(one.probability for one in chosen):.3f}" if chosen else ""
            row += [mean, Figure("", "", [one.right for one in chosen]).shown()]
        rows.append(row)
    # mean square of probability less truth
    brier = [
        f"{statistics.fmean((one.probability - one.right) ** 2 for one in some):.4f}" if some else ""
        for some in (known, found)
    ]
    rows.append(["Brier score", brier[0], "", brier[1], ""])
    return rows


def opened(bank: Path, out: Path, *, quick: bool, shrinkage: bool) -> list[Case]:
    """All cases of a bank that were tried, what was looked up of them, and their true shrinkage if it is asked for."""
    cases = []
    for path in sorted((bank / "sealed").glob("*.json")):
        record, report = out / path.name, out / path.stem / "diagnosis.json"
        if not record.is_file():
            continue
        truth = json.loads(path.read_text())
        said = json.loads(report.read_text()) if report.is_file() else NAMELESS
        apart = looked_up(bank, path.stem, truth, quick=quick)
        shrinks = None
        if shrinkage and said.get("how_far") and truth["case"]["class"] not in ("nothing", "numerical"):
            from shrinkage import true_shrinkage

            shrinks = true_shrinkage(truth, said["which"])
        same = shows_the_same(truth, said["which"], apart)
        cases.append(Case(path.stem, truth, said, apart, json.loads(record.read_text())["seconds"], shrinks, same))
    return cases


def shows_the_same(truth: dict, found: list[dict], apart: list[dict] | None) -> bool:
    """Whether one effect named in the place of another leaves next to nothing of the gap, with its numbers.

    The best-fitting one leaves no more than that; apart.py's fits may miss it where springs ring and arms bounce.
    """
    case = Case("", truth, {"which": found}, apart, 0.0)
    if len(found) != 1 or len(case.wanted) != 1 or case.right(case.named[0]):
        return False
    from apart import ALIKE
    from shrinkage import left_by

    return left_by(truth, found) < ALIKE


def looked_up(bank: Path, name: str, truth: dict, *, quick: bool) -> list[dict] | None:
    """What can be told apart from each true effect."""
    if not quick:
        from apart import told_apart

        return told_apart(bank, name)
    if (bank / "apart" / f"{name}.json").is_file():
        return json.loads((bank / "apart" / f"{name}.json").read_text())
    return None if truth["effects"] else []


def line(case: Case) -> str:
    """One case as a row."""
    truth = case.truth
    what = "; ".join(f"{e} {at}" for e, at in case.wanted) or truth["numerical"] or "nothing"
    also = "; ".join(
        " ".join(n) for names, own in zip(case.classes, case.wanted, strict=False) for n in sorted(names - {own})
    )
    found = "; ".join(
        f"{e} {at}" + (f" (or {', '.join(' '.join(n) for n in sorted(s - {(e, at)}))})" if len(s) > 1 else "")
        for (e, at), s in zip(case.named, case.sets, strict=True)
    )
    shrinks = "" if case.shrinks is None or case.claimed is None else f"{case.claimed:.2f} / {case.shrinks[0]:.2f}"
    over = "" if case.over_floor is None else f"{case.over_floor:.2f}"
    cells = [
        case.name, case.group, truth["robot"], truth["control"]["mode"], truth["strength"] or "", what, also, found,
        case.said["verdict"], shrinks, over, f"{case.seconds:.0f}",
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def markdown(heads: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path)
    parser.add_argument("out", type=Path, nargs="+")
    parser.add_argument("--quick", action="store_true", help="nothing that has to be simulated first")
    parser.add_argument("--shrinkage", action="store_true", help="with --quick: the true shrinkage nevertheless")
    options = parser.parse_args()
    columns = []
    for out in options.out:
        cases = opened(options.bank, out, quick=options.quick, shrinkage=options.shrinkage or not options.quick)
        columns.append((out.name, cases, figures(cases)))
    rows = []
    for figure in columns[0][2]:
        same = [next((f for f in table if f.name == figure.name), figure) for _, _, table in columns]
        if any(f.shown() != "no case" for f in same):
            rows.append([figure.name, figure.goal, *(f.shown() for f in same)])
    heads = ["figure", "goal", *(f"{name} ({len(cases)} cases)" for name, cases, _ in columns)]
    first = options.out[0]
    found = claims(columns[0][1])
    bins = ["probability", "mean, an effect of the catalogue", "right", "mean, all cases", "right"]
    text = f"{markdown(heads, rows)}\n{markdown(bins, reliability(found))}"
    (first / "score.md").write_text(text)
    data = {
        "figures": {name: {f.name: f.data() for f in table} for name, _, table in columns},
        "findings": [asdict(one) for one in found],
    }
    (first / "score.json").write_text(json.dumps(data, indent=1) + "\n")
    names = [
        "case", "class", "robot", "mode", "strength", "truth", "shows the same", "named", "verdict",
        "shrinks: claimed / true", "over the floor", "s",
    ]  # fmt: skip
    body = [line(case) for case in columns[0][1]]
    (first / "cases.md").write_text(markdown(names, []) + "\n".join(body) + "\n")
    print(text, end="")


if __name__ == "__main__":
    main()
