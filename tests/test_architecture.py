"""The house's one-way flow, read from the imports of every module: docs/architecture.md, as a test.

Imports for type checking only count too: a name that a module mentions is a name that it depends on.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# what stands on what: a part imports parts of lower numbers, and itself
LEVELS = [
    {"errors"},
    {"representation", "files", "data_file", "parallel", "plugins", "rendering"},
    {"effects", "kinematics", "shapes", "signals"},
    {"database"},
    {"importing", "build", "expansion", "motion"},
    {"control"},
    {"recording"},
    {"simulation"},
    {"export"},
    {"agreement", "cosimulation"},
    {"diagnosis", "conformance", "reproduction", "study"},
    {"fleet"},
    {"report", "studio"},
    {"cli"},
]
LEVEL = {part: number for number, parts in enumerate(LEVELS) for part in parts}

# what a backend may know: the robot, the contract it fulfils, and helpers of the same or a lower level
FOR_BACKENDS = {
    "build",
    "control",
    "effects",
    "errors",
    "kinematics",
    "motion",
    "rendering",
    "representation",
    "simulation",
}


def modules(top: str) -> list[Path]:
    return sorted((ROOT / top).rglob("*.py"))


def dotted(path: Path) -> list[str]:
    """Parts of a module's name within the package, without a trailing __init__."""
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imported(path: Path, text: str | None = None) -> list[list[str]]:
    """Names of modules of the package that a module imports, from the package's root on.

    `from .x import y` counts as x.y: y may be a module.
    """
    package = dotted(path) if path.name == "__init__.py" else dotted(path)[:-1]
    found: list[list[str]] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8") if text is None else text)):
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
            found += [name[1:] for name in names if name[0] == "mbexport"]
        elif isinstance(node, ast.ImportFrom):
            module = node.module.split(".") if node.module else []
            if node.level == 0:
                if module[0] != "mbexport":
                    continue
                base = module[1:]
            else:
                base = package[: len(package) - node.level + 1] + module
            found += [[*base, alias.name] for alias in node.names]
    return found


def part_of(name: list[str]) -> str:
    """The part of core that a module belongs to."""
    return name[1]


def wrong_imports(path: Path, text: str | None = None) -> list[str]:
    """Imports of a module of core that go up or out, as sentences."""
    own = part_of(dotted(path)) if len(dotted(path)) > 1 else "errors"
    wrong: list[str] = []
    for name in imported(path, text):
        if name[0] != "core":
            wrong.append(f"{path.relative_to(ROOT)} imports {'.'.join(name)}, which is outside of core")
            continue
        other = part_of(name)
        if other == own:
            continue
        if other not in LEVEL or own not in LEVEL:
            wrong.append(f"{path.relative_to(ROOT)}: {own} or {other} has no level in this test")
        elif LEVEL[other] >= LEVEL[own]:
            wrong.append(f"{path.relative_to(ROOT)} ({own}) imports {'.'.join(name)} ({other}), which stands above it")
    return wrong


def test_every_part_of_core_has_a_level():
    parts = {path.stem for path in (ROOT / "core").glob("*.py")} - {"__init__"}
    parts |= {path.name for path in (ROOT / "core").iterdir() if (path / "__init__.py").is_file()}
    assert parts <= set(LEVEL), "give the new part a level here and a line in docs/architecture.md"


def test_the_page_names_every_part():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    parts = {
        path.name for path in (ROOT / "core").iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()
    }
    for part in parts - {"__init__.py"}:
        assert f"`core/{part}`" in page or f"`core/{part}/`" in page, part


@pytest.mark.parametrize("path", modules("core"), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_core_imports_downwards(path):
    assert wrong_imports(path) == []


def entry_point_modules() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    targets = project["project"]["entry-points"]["mbexport.backends"].values()
    return {target.partition(":")[0].rpartition(".")[2] for target in targets}


def wrong_backend_imports(path: Path, text: str | None = None) -> list[str]:
    others = entry_point_modules() - {path.stem}
    wrong: list[str] = []
    for name in imported(path, text):
        if name[0] == "backends" and len(name) > 1 and name[1] in others:
            wrong.append(f"{path.name} imports the backend {name[1]}; what two need stands in a file of its own")
        elif name[0] == "core" and part_of(name) not in FOR_BACKENDS:
            wrong.append(f"{path.name} imports {'.'.join(name)}; a backend knows the contract and the robot only")
    return wrong


@pytest.mark.parametrize("path", modules("backends"), ids=lambda path: path.name)
def test_backends_know_the_contract_and_not_each_other(path):
    assert wrong_backend_imports(path) == []


def test_the_fifth_voice_imports_nothing_of_ours():
    assert imported(ROOT / "core" / "agreement" / "reference.py") == []


def test_the_representation_speaks_no_engines_words():
    words = ("mujoco", "mjcf", "urdf", "pybullet", "bullet", "exudyn", "pinocchio", "drake")
    for path in modules("core/representation"):
        code = ast.dump(ast.parse(_without_docstrings(path.read_text(encoding="utf-8")))).lower()
        assert not [word for word in words if word in code], path.name


def _without_docstrings(text: str) -> str:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if (
            isinstance(body, list)
            and body
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
            body[0].value = ast.Constant(value=None)
    return ast.unparse(tree)


# the guard itself, on planted faults
def test_an_import_that_goes_up_is_found():
    path = ROOT / "core" / "effects" / "coulomb_friction.py"
    assert wrong_imports(path, "from ..simulation.run import simulate")
    assert wrong_imports(path, "from ...backends import mjcf")
    assert wrong_imports(path, "import mbexport.core.cli.common")
    assert not wrong_imports(path, "from ..representation import Robot\nfrom .effect import Effect\nimport math")


def test_a_backend_that_knows_another_is_found():
    path = ROOT / "backends" / "mjcf.py"
    assert wrong_backend_imports(path, "from .urdf import UrdfBackend")
    assert wrong_backend_imports(path, "from ..core.database import load")
    assert not wrong_backend_imports(path, "from .common import concepts_of\nfrom ..core.simulation import Backend")
