import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

HERE = Path(__file__).parent


def load(name, path):
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture(scope="session")
def readers():
    """The reader beside this file, and the machine that it shares with the readers of Adams' files."""
    multibody = load("adams_readers.multibody", HERE.parent / "adams" / "multibody.py")
    return SimpleNamespace(multibody=multibody, Build=load("simscape_reader", HERE / "reader.py").Build)


@pytest.fixture
def octave(tmp_path):
    """Runs statements where an emission's files lie, with stand-ins for Simscape's classes; answers what is printed."""
    program = shutil.which("octave-cli")
    if program is None:
        pytest.skip("Octave is not installed: MATLAB's syntax is checked by it (apt-get install octave)")

    def run(emission, statements):
        for name, text in emission.files.items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        answer = subprocess.run(
            [program, "--norc", "--quiet", "--path", str(HERE / "octave"), "--eval", statements],
            cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
            env={**os.environ, "LC_ALL": "C"},
        )  # fmt: skip
        errors = [line for line in answer.stderr.splitlines() if "ignoring const execution_exception" not in line]
        assert not any(line.startswith(("error", "parse error")) for line in errors), "\n".join(errors)
        return answer.stdout

    return run
