"""Open truth and diagnoses of a bank, and write what was right: counts with Wilson 95 % intervals.

    python benchmarks/blind/score.py BANK/tune OUT    (OUT as diagnose.py wrote it; adds score.json, score.txt)

Places and names count as they were sealed: cases where two candidates cannot be told apart are not taken out, so the
figures for single effects are lower bounds.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections import defaultdict
from pathlib import Path


def wilson(right: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    p = right / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def judged(truth: dict, said: dict) -> dict[str, bool | None]:
    """Questions that a case answers with yes or no; None where it does not ask them."""
    group = truth["case"]["class"]
    wanted = {(e["effect"], e["at"]) for e in truth["stated"]}
    found = said["which"]
    names = {(f["effect"], f["at"]) for f in found}
    sets = names | {(o["effect"], o["at"]) for f in found for o in f.get("indistinguishable_from", [])}
    if group in ("nothing", "numerical"):
        return {"effect named": bool(found), "verdict no_gap": said["verdict"] == "no_gap"}
    if group == "outside":
        return {
            "unexplained or partly": said["verdict"] in ("unexplained", "partly_explained"),
            "called explained": said["verdict"] == "explained",
        }
    return {
        "exact": names == wanted,
        "truth in reported set": wanted <= sets,
        "a wrong name": bool(names - wanted),
        "called unexplained": said["verdict"] == "unexplained",
        "called no_gap": said["verdict"] == "no_gap",
    }


def covered(truth: dict, said: dict) -> list[bool]:
    """Whether each 95 % interval of a rightly named effect holds the truth."""
    out = []
    for effect in truth["stated"]:
        for finding in said["which"]:
            if (finding["effect"], finding["at"]) != (effect["effect"], effect["at"]) or not effect["scored"]:
                continue
            for name, value in effect["total"].items():
                interval = finding["parameters"].get(name, {}).get("ci95")
                if interval:
                    out.append(interval[0] <= value <= interval[1])
    return out


def share(answers: list[bool]) -> dict:
    low, high = wilson(sum(answers), len(answers))
    return {"yes": sum(answers), "of": len(answers), "share": sum(answers) / len(answers), "wilson95": [low, high]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    answers: dict[tuple[str, str], list[bool]] = defaultdict(list)
    sizes: list[int] = []
    calibration: dict[int, list[bool]] = defaultdict(list)
    seconds: list[float] = []
    missing = 0
    for path in sorted((options.bank / "sealed").glob("*.json")):
        truth = json.loads(path.read_text())
        report = options.out / path.stem / "diagnosis.json"
        if not report.is_file():
            missing += 1
            continue
        said = json.loads(report.read_text())
        seconds.append(json.loads((options.out / path.name).read_text())["seconds"])
        group = truth["case"]["class"]
        slices = [
            group,
            f"{group}, {truth['robot']}",
            f"{group}, noise {'AR' if truth['sensors']['colour'] else 'white'}",
        ]
        if truth["strength"]:
            slices.append(f"{group}, {truth['strength']}")
        if group in ("single", "positions", "outside"):
            slices.append(f"{group}, {truth['effects'][0]['effect']}")
        for question, answer in judged(truth, said).items():
            for part in slices:
                answers[part, question].append(bool(answer))
        form = "catalogue" if all(e["exact"] for e in truth["stated"]) else "other"
        for part in (*slices, f"{group}, {form} law"):
            answers[part, "interval covers"] += covered(truth, said)
        wanted = {(e["effect"], e["at"]) for e in truth["stated"]}
        for finding in said["which"]:
            others = finding.get("indistinguishable_from", [])
            sizes.append(1 + len(others))
            named = {(finding["effect"], finding["at"]), *((o["effect"], o["at"]) for o in others)}
            calibration[min(9, int(10 * finding["probability"]))].append(bool(named & wanted))
    table = {f"{part}: {question}": share(a) for (part, question), a in sorted(answers.items()) if a}
    result = {
        "cases": len(seconds),
        "without a diagnosis": missing,
        "table": table,
        "size of reported sets": {"median": statistics.median(sizes) if sizes else None, "of": len(sizes)},
        "probability": {f"{k / 10}-{(k + 1) / 10}": share(a) for k, a in sorted(calibration.items())},
        "seconds": {"median": statistics.median(seconds), "most": max(seconds)} if seconds else None,
    }
    (options.out / "score.json").write_text(json.dumps(result, indent=1) + "\n")
    lines = [f"{len(seconds)} cases, {missing} without a diagnosis"]
    for name, s in (*table.items(), *((f"probability {k}: right", v) for k, v in result["probability"].items())):
        low, high = s["wilson95"]
        lines.append(f"{name:70} {s['yes']:4d} / {s['of']:4d}  {s['share']:6.1%}  [{low:.1%}, {high:.1%}]")
    lines += [f"{name}: {result[name]}" for name in ("size of reported sets", "seconds")]
    text = "\n".join(lines) + "\n"
    (options.out / "score.txt").write_text(text)
    print(text, end="")


if __name__ == "__main__":
    main()
