"""A model of Adams as text: the Solver's dataset and View's command file."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator

from ..core.rendering import comment_line, render
from ..core.representation import Inertia, Pose
from .adams_build import Built
from .adams_drives import number
from .adams_model import Marker, Request, body313

WIDTH = 78
# how often results are written [Hz]
OUTPUT_RATE = 1000.0
# relative error that the integrator may make in a step
ERROR = 1.0e-8


def dataset_text(built: Built, header: Iterable[str]) -> str:
    """The Solver's dataset (.adm)."""
    return render(
        "adams/robot.adm.j2", header=_comments(header), **_values(built, built.model.numbers(), _dataset_lines)
    )


def command_text(built: Built, header: Iterable[str]) -> str:
    """View's command file (.cmd)."""
    return render("adams/robot.cmd.j2", header=_comments(header), **_values(built, built.model.names(), _view_strings))


def run_text(built: Built, file: str) -> str:
    """The Solver's commands that run the dataset (.acf)."""
    return render("adams/run.acf.j2", file=file, duration=plain(built.duration), step=plain(1.0 / OUTPUT_RATE))


def plain(value: float) -> str:
    """A number with all its digits and a point."""
    return number(value).strip("()")


def _comments(header: Iterable[str]) -> list[str]:
    plain_texts = [comment_line(text).encode("ascii", "backslashreplace").decode("ascii") for text in header]
    lines = [line for text in plain_texts for line in textwrap.wrap(text, WIDTH - 2)]
    # a semicolon would begin another statement, an ampersand continue the line
    return [line.replace(";", ",").replace("&", "and") for line in lines]


def _values(built: Built, names: dict[str, str], split: Callable[[str], str]) -> dict[str, object]:
    """What both templates need; `split` breaks long functions."""
    model = built.model

    def text(expression: str) -> str:
        return split(expression.format_map(names))

    def name(marker: Marker) -> str:
        return f".{model.name}.{marker.part}.{marker.name}"

    return {
        "model": model,
        "n": plain,
        "row": _dataset_rows,
        "list": _view_rows,
        "angles": _angles,
        "place": _place,
        "products": _products,
        "slots": _slots,
        "text": text,
        "name": name,
        "duration": built.duration,
        "step": built.step,
        "error": ERROR,
        "outputs": max(1, round(built.duration * OUTPUT_RATE)),
    }


def _products(inertia: Inertia) -> tuple[float, float, float]:
    """Products of inertia xy, xz, yz as Adams has them: plus the integrals, so the tensor's elements negated."""
    return -inertia.xy, -inertia.xz, -inertia.yz


def _angles(pose: Pose) -> str:
    return ", ".join(plain(angle) for angle in body313(pose))


def _place(pose: Pose) -> str:
    return ", ".join(plain(value) for value in pose.xyz)


def _dataset_rows(values: Iterable[float]) -> str:
    # the comma that begins a line also parts its first number from the one before
    return _rows(values, "\n, ")


def _view_rows(values: Iterable[float]) -> str:
    return _rows(values, ",  &\n      ")


def _rows(values: Iterable[float], joint: str) -> str:
    """Numbers, a few a line."""
    texts = [plain(value) for value in values]
    return joint.join(", ".join(texts[k : k + 3]) for k in range(0, len(texts), 3))


def _dataset_lines(expression: str) -> str:
    """An expression over lines that begin with a comma, broken at blanks only."""
    return "\n, ".join(_pieces(expression))


def _view_strings(expression: str) -> str:
    """An expression as strings, which View joins, broken at blanks only."""
    return ",  &\n      ".join(f'"{piece}"' for piece in _spaced(_pieces(expression)))


def _pieces(expression: str) -> list[str]:
    return textwrap.wrap(expression, WIDTH - 12, break_long_words=False, break_on_hyphens=False)


def _spaced(pieces: list[str]) -> Iterator[str]:
    """The pieces with the blanks between them kept, for strings are joined as they are."""
    for count, piece in enumerate(pieces):
        yield f" {piece}" if count else piece


def _slots(request: Request) -> list[tuple[int, str, str]]:
    """(number, name, function) of a request's eight components; the first and fifth are magnitudes elsewhere: free."""
    functions = iter(request.functions.items())
    filled = [("", "") if slot in (1, 5) else next(functions, ("", "")) for slot in range(1, 9)]
    return [(slot, name, function) for slot, (name, function) in enumerate(filled, start=1)]
