"""How long the commands that people wait for take, as whole processes: median of several after a warm-up.

python benchmarks/startup.py
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPEATS = 7
# command, and what it may take at most [s]
COMMANDS = {
    "mbexport --help": (("--help",), 0.3),
    "mbexport --to urdf imece2013": (("--to", "urdf", "imece2013"), 0.8),
    "mbexport --to all imece2013": (("--to", "all", "imece2013"), 1.5),
}


def seconds(arguments: tuple[str, ...], folder: Path) -> float:
    """Wall time of one process [s]."""
    program = Path(sys.executable).with_name("mbexport")
    began = time.perf_counter()
    subprocess.run([program, *arguments], check=True, capture_output=True, cwd=folder)
    return time.perf_counter() - began


def main() -> None:
    """Print a line a command."""
    print(f"{'command':<32} {'median [s]':>10} {'fastest':>8} {'slowest':>8} {'goal':>6}")
    for name, (arguments, goal) in COMMANDS.items():
        times: list[float] = []
        for _ in range(REPEATS + 1):
            with tempfile.TemporaryDirectory() as folder:
                times.append(seconds(arguments, Path(folder)))
        counted = times[1:]
        print(f"{name:<32} {statistics.median(counted):>10.3f} {min(counted):>8.3f} {max(counted):>8.3f} {goal:>6.1f}")


if __name__ == "__main__":
    main()
