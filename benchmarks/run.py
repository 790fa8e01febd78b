"""The benchmarks that end within minutes, one after the other, each with its table: what `make bench` runs.

    python benchmarks/run.py [NAME ...]

Without a name: startup, steps, pieces, scaling, sweep, agreement on two robots and diagnosis. Each is a process of its
own, so that none warms the next one up. Exit status 1 where one fails.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
# name -> arguments that keep it short
QUICK = {
    "startup": (),
    "steps": (),
    "pieces": (),
    "scaling": (),
    "sweep": ("40",),
    "agreement": ("pendulum", "planar2r"),
    "diagnosis": (),
}


def main() -> None:
    """Run what is asked for, in order."""
    names = sys.argv[1:] or list(QUICK)
    unknown = [name for name in names if name not in QUICK]
    if unknown:
        sys.exit(f"there is no benchmark {unknown[0]!r} here; choose from {', '.join(QUICK)}.")
    failed: list[str] = []
    for name in names:
        words = [f"{name}.py", *QUICK[name]]
        print(f"\n== {' '.join(words)}", flush=True)
        done = subprocess.run([sys.executable, str(HERE / words[0]), *words[1:]], check=False)
        if done.returncode:
            failed.append(name)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
