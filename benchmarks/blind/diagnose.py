"""Diagnose the cases of a bank with `mbexport.diagnose`, and nothing else: the truth is not opened.

    python benchmarks/blind/diagnose.py BANK/tune/cases OUT [--workers 2] [--backend mjcf] [--only ID ...]

OUT/<id>/diagnosis.json is what the diagnosis says, OUT/<id>.json whether it came to an end (exit 0) and the seconds it
took, reading included, in one engine and without pictures. What is there stays; what takes too long is given up.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

SECONDS = 900


def diagnose(case: Path, out: Path, backend: str) -> str:
    """One case; a line on how it went."""
    record = out / f"{case.name}.json"
    if record.is_file():
        return f"{case.name} is there"
    import mbexport
    from mbexport.core.errors import MbexportError

    def give_up(*_: object) -> None:
        raise TimeoutError(f"not done after {SECONDS} s")

    signal.signal(signal.SIGALRM, give_up)
    signal.alarm(SECONDS)
    code, said = 0, ""
    begin = time.perf_counter()
    try:
        found = mbexport.diagnose(case / "robot", case / "runs", case / "holdout", backend=backend, backends=[backend])
        write(out / case.name / "diagnosis.json", found.to_json())
    except (MbexportError, TimeoutError) as error:
        code, said = 2, str(error)
    except Exception:
        # a fault of ours is a case without an answer, and no reason to stop
        code, said = 1, traceback.format_exc()
    finally:
        signal.alarm(0)
    seconds = time.perf_counter() - begin
    write(record, {"exit": code, "seconds": seconds, "said": said})
    return f"{case.name} exit {code} after {seconds:.1f} s"


def write(path: Path, data: dict) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_suffix(".half")
    half.write_text(json.dumps(data, indent=1) + "\n")
    half.replace(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--backend", default="mjcf")
    parser.add_argument("--only", nargs="+", default=[], metavar="ID", help="these cases and no others")
    options = parser.parse_args()
    # cores are shared out by cases
    os.environ["OMP_NUM_THREADS"] = "1"
    cases = sorted(path for path in options.cases.iterdir() if not path.name.startswith("."))
    cases = [case for case in cases if not options.only or case.name in options.only]
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [pool.submit(diagnose, case, options.out, options.backend) for case in cases]
        for number, job in enumerate(jobs, start=1):
            print(f"{number}/{len(jobs)} {job.result()}", flush=True)


if __name__ == "__main__":
    main()
