"""mbexport demo: all of it on the built-in robot, in one go."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import PluginError, RefusedError, UsageError
from .common import force_option, json_option, on_terminal, print_json

if TYPE_CHECKING:
    from ..control import Control
    from ..database import Database
    from ..motion import MotionLaw
    from ..representation import Robot
    from ..simulation import Trace

ROBOT = "imece2013"
LEVEL = "compliant"
MOTION = "greca"
# the record of the runs [Hz]; the integration is far finer
RATE = 250.0
SCHEMA = "mbexport-demo/1"


@click.command("demo", epilog="\b\nExample:\n  mbexport demo -o demo --force")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default=Path("demo"), show_default=True, help="Folder."
)
@force_option
@json_option
def command(output: Path, force: bool, as_json: bool) -> None:
    """All of it on the built-in robot: check, export, simulate in every engine, compare, draw."""
    if not force and output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise UsageError(f"{output} exists already; choose another place or give --force.")
    from ..files import insist_on_room, write_whole

    insist_on_room(output, (), force=force)
    story = Story(quiet=as_json)
    summary = story.tell()
    write_whole(output, {**story.files, "summary.json": json.dumps(summary, indent=1) + "\n"}, force=force)
    if as_json:
        print_json(summary)
    else:
        click.echo(f"\nwritten to {output}: {', '.join(sorted({name.split('/')[0] for name in story.files}))}")
    if not summary["agreement"]["agreed"]:
        sys.exit(1)


@dataclass(slots=True)
class Story:
    """What the demo does, in order; files are collected and written at the end, whole or not at all.

    Attributes:
        quiet: Print nothing on the way.
        robot: A robot that has compliance.
        backends: Who takes part; () is everyone installed.
        duration: Of the runs [s]; None: the motion's, and agreement's own.
        files: Relative path to content.
        left_out: Backend to why it could not take part.
    """

    quiet: bool
    robot: str = ROBOT
    backends: tuple[str, ...] = ()
    duration: float | None = None
    files: dict[str, str | bytes] = field(default_factory=dict[str, "str | bytes"])
    left_out: dict[str, str] = field(default_factory=dict[str, str])

    def say(self, title: str, text: str) -> None:
        """A line for people."""
        if not self.quiet:
            click.echo(f"{title:<12}{text}")

    def tell(self) -> dict[str, Any]:
        """Do everything; the numbers as plain data."""
        began = time.perf_counter()
        from ..build import build
        from ..control import default_pd
        from ..database import load
        from ..motion import motion_named
        from ..report.demo_picture import draw

        database = load(self.robot)
        self._check(database)
        rigid, compliant = build(database, "rigid"), build(database, LEVEL)
        motion = motion_named(rigid, MOTION, database)
        engines = self._export(compliant, motion)
        self.say("motion", f"{MOTION}: a Greek key with right-angled corners, {motion.duration!r} s")
        loop = default_pd(compliant, feedforward="gravity")
        runs = {
            "rigid": self._run("rigid", rigid, engines, motion, None),
            "compliant": self._run("compliant", compliant, engines, motion, None),
            "closed_loop": self._run("closed_loop", compliant, engines, motion, loop),
        }
        tips = self._tips(runs)
        self._dummy(compliant, database.dummy_inertia)
        self.files["tip.png"] = draw(runs)
        agreement = self._agree(database, engines)
        self.say("time", f"{time.perf_counter() - began:.0f} s")
        return {
            "schema": SCHEMA,
            "robot": database.name,
            "source_hash": database.content_hash(),
            "level": LEVEL,
            "engines": {name: dict(trace.facts) for name, trace in runs["compliant"].items()},
            "left_out": self.left_out,
            "tip": tips,
            "notes": list(compliant.notes),
            "agreement": agreement,
        }

    def _check(self, database: Database) -> None:
        from ..database import check

        problems = Counter(problem.severity for problem in check(self.robot))
        self.say("robot", f"{database.name}: {database.n} joints; {database.source}")
        self.say("check", f"{problems['error']} wrong, {problems['warning']} suspicious")

    def _export(self, robot: Robot, motion: MotionLaw) -> list[str]:
        """Models of all backends, and the names of those that can be run."""
        from ..export import concept_report, emit
        from ..simulation import backend_named, backend_names

        able: list[str] = []
        for name in self.backends or backend_names():
            try:
                backend = backend_named(name)
                emission = emit(robot, backend, motion)
            except (PluginError, RefusedError) as error:
                self.left_out[name] = str(error)
                self.say("left out", f"{name}: {error}")
                continue
            if backend.runs:
                able.append(name)
            for path, content in {**emission.files, **emission.packed}.items():
                self.files[f"models/{name}/{path}"] = content
            self.files[f"models/{name}/{robot.name}.concepts.json"] = concept_report(robot, emission)
            counts = Counter(concept.status for concept in emission.concepts)
            told = ", ".join(f"{counts[s]} {s}" for s in ("exact", "approximated", "impossible") if counts[s])
            self.say("export", f"{emission.main:<22} {backend.engine + ' ' + backend.version():<18} data: {told}")
        if not able:
            raise RefusedError("no backend can run: " + "; ".join(f"{k}: {v}" for k, v in self.left_out.items()))
        return able

    def _run(
        self, kind: str, robot: Robot, engines: Sequence[str], motion: MotionLaw, control: Control | None
    ) -> dict[str, Trace]:
        """One run in every engine."""
        from ..simulation import simulate

        runs: dict[str, Trace] = {}
        for name in engines:
            progress = not self.quiet and on_terminal()
            trace = simulate(robot, name, motion, control, duration=self.duration, rate=RATE, progress=progress)
            runs[name] = trace
            for path, text in trace.files().items():
                self.files[f"runs/{kind}-{name}/{path}"] = text
        return runs

    def _tips(self, runs: dict[str, dict[str, Trace]]) -> dict[str, Any]:
        """How far the tip leaves the rigid path, and how far apart the engines are [m]."""
        import numpy as np

        from ..report.demo_picture import NAMES, of_high_order, worst_apart

        rigid = next(iter(runs["rigid"].values()))
        facts: dict[str, Any] = {}
        for kind, engines in runs.items():
            apart, pair = worst_apart(engines)
            away = np.linalg.norm(next(iter(engines.values())).tip - rigid.tip, axis=1)
            facts[kind] = {
                "from_rigid_largest": float(away.max()),
                "from_rigid_mean": float(away.mean()),
                "engines_apart": float(apart.max()),
                "worst_pair": pair,
            }
            self.say("run", f"{NAMES[kind]} in {', '.join(engines)}")
            if kind != "rigid":
                self.say(
                    "", f"the tip leaves the rigid path by {1e3 * away.mean():.1f} mm, at most {1e3 * away.max():.1f}"
                )
            if pair:
                self.say("", f"engines at most {apart.max():.1e} m apart ({pair})")
            accurate = of_high_order(engines)
            if 1 < len(accurate) < len(engines):
                among = float(worst_apart(accurate)[0].max())
                facts[kind]["engines_of_high_order_apart"] = among
                self.say("", f"without those of first order {among:.1e} m")
        return facts

    def _dummy(self, robot: Robot, fraction: float) -> None:
        dummies = [stage.joint.name for stage in robot.stages if stage.drive.dummy]
        if dummies:
            self.say(
                "closed loop",
                f"the paper gives no rotor inertias: the motor sides of its {len(dummies)} elastic joints are dummy",
            )
            self.say("", f"parts with {fraction!r} of the arm's diagonal mass-matrix entry at home (dummy_inertia of")
            self.say("", "robot.yaml); imposed motion does not depend on it, the closed loop does")

    def _agree(self, database: Database, engines: Sequence[str]) -> dict[str, Any]:
        """Whether the engines agree, with the report."""
        from ..agreement import agree
        from ..agreement.agree import DURATION
        from ..agreement.quantities import STATICS
        from ..agreement.scenarios import SCENARIOS
        from ..report import agreement_page

        # errors over the step take as long as all the rest, and `mbexport agree` shows them
        wanted = (*STATICS, *SCENARIOS)
        answer = agree(database, engines, LEVEL, quantities=wanted, duration=min(self.duration or DURATION, DURATION))
        self.files["agreement/agreement.json"] = json.dumps(answer.to_json(), indent=1) + "\n"
        self.files["agreement/agreement.html"] = agreement_page(answer)
        self.say("agreement", answer.sentences[0])
        for sentence in answer.sentences[1:]:
            self.say("", sentence)
        return {"agreed": answer.agreed, "sentences": list(answer.sentences)}
