"""Does the paper's study again and puts its pictures and numbers into docs/paper.md.

    python docs/make_paper.py

Writes the regions between `<!-- measured: NAME -->` and `<!-- end -->`, and docs/pictures/paper/.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

from mbexport.core.report.paper_page import drawings
from mbexport.core.reproduction import Reproduction, reproduce, statements

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "paper.md"
PICTURES = DOCS / "pictures" / "paper"
DPI = 100
REGION = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    lines = [header, ("---",) * len(header), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def said(study: Reproduction) -> str:
    """The paper's statements beside ours."""
    rows = [(one.where, one.says, one.ours, one.verdict) for one in statements(study)]
    return table(("where", "the paper", "ours", "verdict"), rows)


def choices(study: Reproduction) -> str:
    """What the paper leaves open, and what was taken."""
    return table(("what", "taken here"), list(study.choices()))


def others(study: Reproduction) -> str:
    """What other choices make of the closed loop."""
    rows = [
        (one.what, f"{1e3 * one.oscillation:.2f}", f"{1e3 * one.in_plane:.2f}") for one in study.closed_loop.choices
    ]
    return table(
        ("along the first key", "tip about its rest, rms [mm]", "off the path in the plane, at most [mm]"), rows
    )


def modes(study: Reproduction) -> str:
    """Oscillations seen after the motion beside the eigenvalues."""
    opened, closed = study.open_loop, study.closed_loop
    named = (
        ("open loop", opened.measured, opened.predicted),
        ("closed loop", closed.measured[0], closed.predicted[0]),
        ("closed loop, Memory", closed.measured[1], closed.predicted[1]),
    )
    rows = [
        (what, f"{a.frequency:.4f}", f"{b.frequency:.4f}", f"{a.damping_ratio:.4f}", f"{b.damping_ratio:.4f}")
        for what, seen, known in named
        for a, b in zip(seen, known, strict=True)
    ]
    return table(("run", "seen [Hz]", "eigenvalue [Hz]", "damping ratio seen", "eigenvalue's"), rows)


def engines(study: Reproduction) -> str:
    """Who took part."""
    rows = [
        (f"`{one['backend']}`", f"{one['engine']} {one['version']}", one["integrator"], f"{1e3 * one['step_s']:.3g}")
        for one in study.engines()
    ]
    return table(("backend", "engine", "integrator", "step [ms]"), rows)


REGIONS: dict[str, Callable[[Reproduction], str]] = {
    "statements": said,
    "choices": choices,
    "others": others,
    "modes": modes,
    "engines": engines,
}


def filled(text: str, study: Reproduction) -> str:
    """The page's text with its measured regions written anew."""
    return REGION.sub(lambda match: f"{match[1]}\n{REGIONS[match[2]](study)}\n{match[3]}", text)


def main() -> None:
    """Run the study; fill the page and draw the pictures."""

    def tell(what: str, done: int, total: int) -> None:
        print(f"{done}/{total} {what}", file=sys.stderr)

    study = reproduce(tell=tell)
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, drawing in drawings(study).items():
        (PICTURES / f"{name}.png").write_bytes(drawing.png(DPI))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), study), encoding="utf-8")


if __name__ == "__main__":
    main()
