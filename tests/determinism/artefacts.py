"""Everything that a user gets, as digests, one a line: run in processes of its own by test_same_everywhere.py."""

from __future__ import annotations

import hashlib
import json
import locale
import sys
from collections.abc import Iterator
from pathlib import Path

EFFECTS = ("coulomb_friction", "delay", "hysteresis", "joint_compliance", "rotor_inertia", "torque_ripple", "payload")


def emissions() -> Iterator[tuple[str, str]]:
    """Models and scripts in every format, with their concept reports."""
    from mbexport.core.agreement.samples import sampled
    from mbexport.core.build import build
    from mbexport.core.database import load
    from mbexport.core.errors import RefusedError
    from mbexport.core.export import concept_report, emit
    from mbexport.core.motion import excitation
    from mbexport.core.simulation import backend_named, backend_names

    robots = [build(load(name)) for name in ("imece2013", "puma560", "scara")]
    robots.append(build(sampled(load("planar2r"), EFFECTS)))
    for name in backend_names():
        for robot in robots:
            try:
                emission = emit(robot, backend_named(name), excitation(robot, duration=1.0))
            except RefusedError as error:
                yield f"{name} {robot.name} {robot.level}", str(error)
                continue
            for file, text in emission.files.items():
                yield f"{name} {robot.level} {file}", text
            yield f"{name} {robot.name} {robot.level} concepts", concept_report(robot, emission)


def runs() -> Iterator[tuple[str, str]]:
    """What simulated robots record."""
    from mbexport.core.build import build
    from mbexport.core.control import default_pd
    from mbexport.core.database import load
    from mbexport.core.motion import excitation
    from mbexport.core.simulation import simulate

    robot = build(load("planar2r"))
    for name in ("exudyn", "mjcf", "pybullet", "urdf"):
        run = simulate(robot, name, excitation(robot), default_pd(robot), duration=0.01)
        noisy = run.with_noise({"q": [1e-5] * robot.n, "tau": [0.5] * robot.n}, seed=3)
        for file, text in noisy.files().items():
            yield f"{name} run {file}", text


def reports() -> Iterator[tuple[str, str]]:
    """The agreement as data and as a page."""
    from mbexport.core.agreement import agree
    from mbexport.core.report import agreement_page

    answer = agree(
        "pendulum",
        ["urdf", "pybullet", "mjcf"],
        quantities=["tool_position", "mass_matrix", "rigid_loop"],
        duration=0.05,
    )
    yield "agreement.json", json.dumps(answer.to_json())
    yield "agreement.html", agreement_page(answer)


def databases() -> Iterator[tuple[str, str]]:
    """What is written of a database, and what is said of bad ones."""
    from mbexport.core.database import built_in, load, write
    from mbexport.core.errors import DatabaseError

    for name in built_in():
        for form in (name, f"{name}.yaml"):
            target = Path("written") / form
            write(load(name), target)
            for path in sorted(target.rglob("*")) if target.is_dir() else [target]:
                if path.is_file():
                    yield f"{form} {path.name}", path.read_text(encoding="utf-8")
    bad = Path("bad")
    bad.mkdir()
    (bad / "robot.yaml").write_text(
        "name: bad\ngravvity: 1\nlevels: {a: [none, nothing], b: [neither]}\n", encoding="utf-8"
    )
    (bad / "kinematics.dat").write_text("arm alpha b a c theta\n1 0 0 x 0 0\n", encoding="utf-8")
    try:
        load(bad)
    except DatabaseError as error:
        yield "problems", str(error)


def main() -> None:
    """Print what there is, with a digest of it; the process speaks the language that it is told to."""
    locale.setlocale(locale.LC_ALL, "")
    for part in (emissions, runs, reports, databases):
        for name, text in part():
            print(f"{name}\t{hashlib.sha256(text.encode()).hexdigest()}")
    print(f"decimal point\t{locale.localeconv()['decimal_point']}", file=sys.stderr)


if __name__ == "__main__":
    main()
