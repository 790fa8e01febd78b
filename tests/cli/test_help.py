"""Help, versions and wrong use, without any work being done."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from mbexport.core.cli import VERBS

# what takes long to load and belongs to the verb that needs it
HEAVY = {
    "exudyn", "matplotlib", "mujoco", "numba", "pandas", "pinocchio", "pint", "pybullet", "rich", "scipy", "xarray",
}  # fmt: skip


def loaded_by(*words: str) -> set[str]:
    """Which heavy modules a command loads, in a process of its own."""
    code = (
        "import json, sys\n"
        "from mbexport.core.cli import main\n"
        "try:\n    main(sys.argv[1:])\n"
        "except SystemExit:\n    pass\n"
        "print('\\n' + json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    )
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1])) & HEAVY


def test_help_names_every_verb_with_an_example(mbexport):
    answer = mbexport("--help")
    assert answer.status == 0
    for verb in VERBS:
        assert f"  {verb} " in answer.out
    assert "mbexport --to urdf" in answer.out
    assert mbexport("-h").out == answer.out


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(mbexport, verb):
    answer = mbexport(verb, "--help")
    assert answer.status == 0
    assert f"mbexport {verb}" in answer.out or "mbexport --to" in answer.out
    assert "Example" in answer.out
    assert "--json" in answer.out


def test_version(mbexport):
    from importlib.metadata import version

    assert mbexport("--version").out == f"mbexport {version('mbexport')}\n"


def test_the_package_runs_as_its_script_does(mbexport):
    def module(*words: str) -> tuple[int, str, str]:
        done = subprocess.run([sys.executable, "-m", "mbexport", *words], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    assert module("--version") == (0, mbexport("--version").out, "")
    assert module("chek", "imece2013") == (2, "", mbexport("chek", "imece2013").err)


def test_help_loads_nothing_heavy():
    assert loaded_by("--help") == set()


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_a_verb_loads_nothing_heavy(verb):
    assert loaded_by(verb, "--help") == set()


def test_export_of_a_urdf_loads_no_engine(tmp_path):
    assert loaded_by("--to", "urdf", "imece2013", "-o", str(tmp_path / "out")) == set()
    assert (tmp_path / "out" / "imece2013.urdf").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["chek", "imece2013"], "chek"),
        (["check"], "ROBOT"),
        (["check", "imece2013", "--nonsense"], "--nonsense"),
        (["list", "motors"], "motors"),
        (["export", "imece2013"], "--to"),
        (["simulate", "imece2013", "--backend", "mjcf", "--motion", "hold"], "--output"),
        (["simulate", "imece2013", "--backend", "mjcf", "--motion", "hold", "-o", "x", "--duration", "long"], "long"),
    ],
)
def test_wrong_use_exits_2_with_one_message(mbexport, words, said):
    answer = mbexport(*words)
    assert answer.status == 2
    assert said in answer.err
    assert not answer.out


def test_no_words_is_help(mbexport):
    answer = mbexport()
    assert answer.status in (0, 2)
    assert "Usage: mbexport" in answer.out + answer.err
