"""Everything that a user gets, as digests, one a line: run in processes of its own by test_same_everywhere.py."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import locale
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

EFFECTS = ("coulomb_friction", "delay", "hysteresis", "joint_compliance", "rotor_inertia", "torque_ripple", "payload")


def emissions() -> Iterator[tuple[str, str | bytes]]:
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
            for file, content in {**emission.files, **emission.packed}.items():
                yield f"{name} {robot.level} {file}", content
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


def studies() -> Iterator[tuple[str, str | bytes]]:
    """A small study as it is written: table, indices, picture and page."""
    from mbexport.core.database import load
    from mbexport.core.report.study import write_study
    from mbexport.core.study import plan_study, results_of, run_study

    study = plan_study(
        load("planar2r"),
        ["joint_compliance.stiffness@all=0.5:2", "inertia.mass[kg]@arm_1=-0.1:1"],
        level="compliant",
        motion="hold",
        duration=0.01,
        sampling="morris",
        count=16,
        seed=5,
    )
    folder = Path("study")
    write_study(results_of(study, run_study(study, folder, workers=1)), folder)
    for path in sorted(folder.iterdir()):
        # the record by which a study goes on is in the order in which its variants were done
        if not path.name.startswith("finished-"):
            yield f"study {path.name}", path.read_bytes()


def diagnoses() -> Iterator[tuple[str, str]]:
    """A diagnosis as it is written: verdict, page and tables, from the example that the tests share."""
    from mbexport.core.build import build
    from mbexport.core.control import default_pd
    from mbexport.core.database import FrozenMap, load, with_effects
    from mbexport.core.diagnosis.written import files_of
    from mbexport.core.effects import EffectRow
    from mbexport.core.motion import motion_named
    from mbexport.core.report.diagnosis_page import diagnosis_page
    from mbexport.core.simulation import simulate

    spec = importlib.util.spec_from_file_location("shared", Path(__file__).parents[1] / "conftest.py")
    assert spec is not None and spec.loader is not None
    shared = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(shared)
    bare = replace(load("imece2013"), effects=FrozenMap())
    rows = {"coulomb_friction": (EffectRow(2, FrozenMap(shared.FRICTION)),)}
    nominal, corrected = build(bare), with_effects(bare, rows)
    motion, control = motion_named(nominal, "greca"), default_pd(nominal)
    before, after = (simulate(robot, "mjcf", motion, control, duration=0.5, rate=250.0, nominal=nominal)
                     for robot in (nominal, build(corrected)))  # fmt: skip
    measured = after.with_noise({"q": [2e-5] * 6, "tau": [0.3] * 6, "ee": [2e-5]}, 3)
    found = shared.explained.__wrapped__((corrected, rows, measured, before, after))
    for file, text in files_of(found, diagnosis_page(found)).items():
        yield f"diagnosis {file}", text


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
    for part in (emissions, runs, reports, studies, diagnoses, databases):
        for name, content in part():
            raw = content.encode() if isinstance(content, str) else content
            print(f"{name}\t{hashlib.sha256(raw).hexdigest()}")
    print(f"decimal point\t{locale.localeconv()['decimal_point']}", file=sys.stderr)


if __name__ == "__main__":
    main()
