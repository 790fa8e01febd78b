"""What would run text as code, or make objects of bytes, stands nowhere in the code but in the places named here."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULES = [
    ROOT / "__init__.py",
    *(path for top in ("core", "backends", "templates") for path in sorted((ROOT / top).rglob("*.py"))),
]

BUILTINS = {"eval", "exec", "compile", "__import__", "execfile"}
LIBRARIES = {
    "cPickle", "cloudpickle", "code", "codeop", "dill", "joblib", "jsonpickle", "marshal", "pickle", "runpy", "shelve",
    "yaml",
}  # fmt: skip
# module or object, and what of it is not asked for
ATTRIBUTES = {
    "os": {"system", "popen", "execv", "execve", "execl", "execlp", "execvp", "spawnl", "spawnv", "startfile"},
    "np": {"load"},
    "numpy": {"load"},
    "pd": {"read_pickle", "eval"},
    "pandas": {"read_pickle", "eval"},
    "builtins": BUILTINS,
}
XML = {"xml.etree.ElementTree", "xml.dom.minidom", "xml.dom.pulldom", "lxml", "lxml.etree", "xml.etree"}

ROUND_TRIP = "YAML() of round trips, which makes objects"

# file, what: why it may
ALLOWED = {
    ("backends/script.py", "exec"): "runs the script that this program has just emitted",
    ("backends/script.py", "compile"): "the same",
    ("backends/mujoco_engine.py", "xml.etree.ElementTree"): "takes the meshes out of a model that was emitted here",
    ("core/simulation/trace.py", ROUND_TRIP): "writes only",
}


def findings(text: str, file: str) -> set[tuple[str, str]]:
    """(file, what) of everything in a module that could execute what it reads."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.partition(".")[0] in LIBRARIES}
            found |= {alias.name for alias in node.names if alias.name in XML}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            if node.module.partition(".")[0] in LIBRARIES or node.module in XML:
                found.add(node.module)
            if node.module in ATTRIBUTES:
                found |= {alias.name for alias in node.names if alias.name in ATTRIBUTES[node.module]}
        elif isinstance(node, ast.Name) and node.id in BUILTINS:
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in ATTRIBUTES.get(node.value.id, ()):
                found.add(f"{node.value.id}.{node.attr}")
        elif isinstance(node, ast.keyword):
            if node.arg in {"shell", "allow_pickle"} and not _is_false(node.value):
                found.add(f"{node.arg}=")
            if node.arg == "typ" and not (isinstance(node.value, ast.Constant) and node.value.value == "safe"):
                found.add("typ=")
        elif isinstance(node, ast.Call) and _named(node.func) == "YAML" and not node.keywords:
            found.add(ROUND_TRIP)
        if isinstance(node, ast.Call) and _named(node.func) == "import_module" and node.args:
            name = node.args[0]
            if isinstance(name, ast.Constant) and str(name.value).partition(".")[0] in LIBRARIES:
                found.add(str(name.value))
    return {(file, what) for what in found}


def _named(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _is_false(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is False


def test_nothing_that_is_read_can_execute():
    found: set[tuple[str, str]] = set()
    for path in MODULES:
        found |= findings(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())
    assert found == set(ALLOWED)


@pytest.mark.parametrize(
    "text",
    [
        "eval(text)",
        "x = exec\nx(text)",
        "import pickle",
        "from pickle import loads",
        "import yaml",
        "from os import system",
        "import os\nos.system('x')",
        "subprocess.run(words, shell=True)",
        "subprocess.run(words, shell=wanted)",
        "np.load(path)",
        "numpy.load(path, allow_pickle=True)",
        "pd.read_pickle(path)",
        "YAML()",
        "YAML(typ='unsafe')",
        "ruamel.yaml.YAML(typ='rt')",
        "__import__('os')",
        "import_module('marshal')",
        "from xml.etree import ElementTree",
        "import xml.dom.minidom",
    ],
)
def test_what_would_is_found(text: str):
    assert findings(text, "x.py")


@pytest.mark.parametrize(
    "text", ["YAML(typ='safe', pure=True)", "subprocess.run(words)", "re.compile(text)", "json.loads(text)"]
)
def test_what_would_not_is_not(text: str):
    assert not findings(text, "x.py")
