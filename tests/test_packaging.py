"""What is installed is what stands in the tree: packages, package data, entry points, the licence."""

from __future__ import annotations

import ast
import importlib
import inspect
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from mbexport.core.effects import Effect
from mbexport.core.simulation import Backend

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# folders of the repository that are no part of the program
NOT_INSTALLED = {"tests", "benchmarks", "docs", "build", "dist", "demo"}
# what the repository's root holds
HOUSE = {
    ".ci", ".gitignore", "CHANGELOG.md", "LICENSE", "Makefile", "README.md", "__init__.py", "__main__.py", "backends",
    "benchmarks", "core", "docs", "examples", "py.typed", "pyproject.toml", "templates", "tests",
}  # fmt: skip
GENERATED = {".pyc", ".pyo", ".nbi", ".nbc"}


def own_folders() -> list[Path]:
    """The folders of the program, relative to the root."""
    tops = [p for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith(".") and p.name not in NOT_INSTALLED]
    return [p.relative_to(ROOT) for top in tops for p in (top, *top.rglob("*")) if p.is_dir() and "__" not in p.name]


def package_name(folder: Path) -> str:
    return ".".join(["mbexport", *folder.parts])


def packages_in_tree() -> list[str]:
    # an outside plugin in examples/ is a distribution of its own
    others = {p.parent.relative_to(ROOT) for p in (ROOT / "examples").rglob("pyproject.toml")}
    found = [
        package_name(folder)
        for folder in own_folders()
        if (ROOT / folder / "__init__.py").is_file() and not any(folder.is_relative_to(other) for other in others)
    ]
    return sorted(["mbexport", *found])


def data_of_package(package: str) -> set[Path]:
    """Files that the package's globs select, relative to the root."""
    folder = ROOT.joinpath(*package.split(".")[1:])
    globs = PROJECT["tool"]["setuptools"]["package-data"].get(package, [])
    return {p.relative_to(ROOT) for glob in globs for p in folder.glob(glob) if p.is_file()}


def test_nothing_stray_is_kept():
    """A file that was downloaded beside the tree would be part of every clone."""
    git = shutil.which("git")
    listed = git and subprocess.run([git, "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if not listed or listed.returncode or not listed.stdout:
        pytest.skip("no checkout that git reads")
    kept = listed.stdout.splitlines()
    assert {file.partition("/")[0] for file in kept} == HOUSE


def test_packages_are_those_of_the_tree():
    assert PROJECT["tool"]["setuptools"]["packages"] == packages_in_tree()


def test_every_module_lies_in_a_package():
    packages = set(packages_in_tree())
    for top in ("core", "backends", "templates"):
        for module in (ROOT / top).rglob("*.py"):
            assert package_name(module.parent.relative_to(ROOT)) in packages, f"{module} would not be installed"


def test_what_the_program_reads_is_package_data():
    selected = {path for package in PROJECT["tool"]["setuptools"]["packages"] for path in data_of_package(package)}
    needed = {
        path.relative_to(ROOT)
        for top in ("core", "backends", "templates", "examples/robots")
        for path in (ROOT / top).rglob("*")
        if path.is_file() and path.suffix not in GENERATED | {".py"} and not path.name.startswith(".")
    } | {Path("py.typed")}
    assert needed - selected == set()
    assert Path("examples/robots/imece2013/robot.yaml") in selected
    assert Path("templates/urdf/robot.urdf.j2") in selected


@pytest.mark.parametrize("group", ["mbexport.backends", "mbexport.effects"])
def test_entry_points_name_classes_of_the_tree(group):
    for name, target in PROJECT["project"].get("entry-points", {}).get(group, {}).items():
        module, _, attribute = target.partition(":")
        made = getattr(importlib.import_module(module), attribute)
        assert inspect.isclass(made)
        assert issubclass(made, Backend if group == "mbexport.backends" else Effect)
        assert made.name == name


def test_the_face_offers_what_exists():
    import mbexport

    for name in mbexport.__all__:
        assert callable(getattr(mbexport, name)), name
    assert set(mbexport.__all__) <= set(dir(mbexport))
    with pytest.raises(AttributeError, match="nothing_of_ours"):
        _ = mbexport.nothing_of_ours


def test_dependencies_are_those_imported():
    """Whatever the program imports is the standard library, itself, or declared."""
    declared = {requirement.split(">")[0].split("=")[0].strip() for requirement in PROJECT["project"]["dependencies"]}
    import_names = {"ruamel.yaml": "ruamel", "pin": "pinocchio"}
    declared_imports = {import_names.get(name, name) for name in declared}
    # what declared libraries bring along themselves
    brought = {"llvmlite"}
    # extras that only some users need
    optional = {
        requirement.split(">")[0].split("=")[0]
        for extra in ("parquet", "conformance")
        for requirement in PROJECT["project"]["optional-dependencies"][extra]
    }
    for top in ("core", "backends"):
        for path in (ROOT / top).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                modules: list[str] = []
                if isinstance(node, ast.Import):
                    modules = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    modules = [node.module or ""]
                for module in modules:
                    name = module.split(".")[0]
                    known = name in sys.stdlib_module_names or name in declared_imports | brought | optional
                    assert known, f"{path.relative_to(ROOT)} imports {module}, which pyproject.toml does not declare"


def test_licence_is_the_one_declared():
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert PROJECT["project"]["license"] == "Apache-2.0"
    assert "Apache License" in text
    assert "Version 2.0, January 2004" in text
    assert "END OF TERMS AND CONDITIONS" in text


def test_wheel_holds_templates_and_robots(tmp_path):
    """A wheel built from a copy of the tree (setuptools leaves its traces where it builds)."""
    pytest.importorskip("setuptools", minversion="77")
    source = tmp_path / "source"
    shutil.copytree(
        ROOT,
        source,
        ignore=shutil.ignore_patterns(".*", "__pycache__", "tests", "benchmarks", "build", "demo", "*.egg-info"),
    )
    build = (
        "import sys; from setuptools import build_meta; "
        "sys.stdout.write('wheel: ' + build_meta.build_wheel(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=source, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    with zipfile.ZipFile(tmp_path / done.stdout.rpartition("wheel: ")[2].strip()) as wheel:
        inside = set(wheel.namelist())
    for package in PROJECT["tool"]["setuptools"]["packages"]:
        for path in (*data_of_package(package), *_modules_of(package)):
            assert f"mbexport/{path.as_posix()}" in inside
    assert any(name.endswith("licenses/LICENSE") for name in inside)
    assert not any(name.startswith(("mbexport/tests", "mbexport/docs", "mbexport/benchmarks")) for name in inside)


def _modules_of(package: str) -> list[Path]:
    folder = ROOT.joinpath(*package.split(".")[1:])
    return [path.relative_to(ROOT) for path in folder.glob("*.py")]
