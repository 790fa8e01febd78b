"""What Numba keeps on disk is of the text that is compiled, its helpers' in other files included."""

import subprocess
import sys
from pathlib import Path

OUTER = "from helping import helps\n\n\ndef outer(x):\n    return helps(x) + 1.0\n"
HELPS = "TIMES = 3.0\n\n\ndef helps(x):\n    return TIMES * x\n"
RUN = """
import helping, outer
from mbexport.core.simulation.compiled import as_it_stands, compile_text

as_it_stands(helping.helps)
function = compile_text(outer.outer)
print(function(2.0), sum(function.stats.cache_hits.values()))
"""


def said(folder: Path, run: str = RUN) -> tuple[float, int]:
    command = [sys.executable, "-c", run]
    value, hits = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.split()
    return float(value), int(hits)


def test_a_helper_that_changes_in_another_file_is_compiled_anew(tmp_path):
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "helping.py").write_text(HELPS)
    assert said(tmp_path) == (7.0, 0)
    assert said(tmp_path) == (7.0, 1)
    (tmp_path / "helping.py").write_text(HELPS.replace("3.0", "4.0"))
    assert said(tmp_path) == (9.0, 0)
    (tmp_path / "helping.py").write_text(HELPS.replace("TIMES * x", "TIMES * x * x"))
    assert said(tmp_path) == (13.0, 0)


GLUE = """
from numba import types
from numba.extending import intrinsic


def _helps(typing, x):
    def generate(context, builder, signature, args):
        return builder.fmul(args[0], context.get_constant(types.float64, 3.0))

    return types.float64(types.float64), generate


helps = intrinsic(_helps)
"""


def test_what_a_decorator_made_in_another_file_is_compiled_anew_too(tmp_path):
    """Calls of MuJoCo by address are such; and the same text is the same in every process."""
    run = RUN.replace("as_it_stands(helping.helps)\n", "")
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "helping.py").write_text(GLUE)
    assert said(tmp_path, run) == (7.0, 0)
    assert said(tmp_path, run) == (7.0, 1)
    (tmp_path / "helping.py").write_text(GLUE.replace("float64, 3.0", "float64, 4.0"))
    assert said(tmp_path, run) == (9.0, 0)
