"""Run `mbexport diagnose` over the cases of a bank, as processes, and nothing else: the truth is not opened.

    python benchmarks/blind/diagnose.py BANK/tune/cases OUT [--workers 2] [--backend mjcf]

OUT/<id>/ gets what the diagnosis writes, OUT/<id>.json the exit code and the seconds it took. What is there stays.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SECONDS = 900.0


def diagnose(case: Path, out: Path, backend: str, program: str) -> str:
    """One case; a line on how it went."""
    record = out / f"{case.name}.json"
    if record.is_file():
        return f"{case.name} is there"
    runs = [str(path) for path in sorted((case / "runs").iterdir())]
    held = [word for path in sorted((case / "holdout").iterdir()) for word in ("--holdout", str(path))]
    command = [program, "diagnose", str(case / "robot"), *runs, *held, "-o", str(out / case.name), "--backend", backend]
    begin = time.perf_counter()
    try:
        done = subprocess.run([*command, "--force"], capture_output=True, text=True, timeout=SECONDS, check=False)
        code, said = done.returncode, done.stderr[-2000:]
    except subprocess.TimeoutExpired:
        code, said = 124, f"not done after {SECONDS!r} s"
    seconds = time.perf_counter() - begin
    half = record.with_suffix(".half")
    half.write_text(json.dumps({"exit": code, "seconds": seconds, "said": said}, indent=1) + "\n")
    half.replace(record)
    return f"{case.name} exit {code} after {seconds:.1f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--backend", default="mjcf")
    parser.add_argument("--program", default="mbexport")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cases = sorted(path for path in options.cases.iterdir() if not path.name.startswith("."))
    with ThreadPoolExecutor(options.workers) as pool:
        for line in pool.map(lambda case: diagnose(case, options.out, options.backend, options.program), cases):
            print(line, flush=True)


if __name__ == "__main__":
    main()
