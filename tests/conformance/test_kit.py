"""The suite itself: it finds what is planted, expects what is declared, and lists what is refused."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from mbexport import Emission, MachineState, RefusedError
from mbexport.backends.pinocchio_engine import PinocchioEngine
from mbexport.backends.urdf import UrdfBackend
from mbexport.core.agreement.samples import SAMPLED
from mbexport.core.agreement.scenarios import SCENARIOS, scenarios
from mbexport.core.build import build
from mbexport.core.conformance.check import ConformanceError
from mbexport.core.conformance.checks import checks
from mbexport.core.conformance.robots import SEEDS, random_database
from mbexport.core.conformance.subject import Subject
from mbexport.core.conformance.together import ELASTIC, ROBOTS, RUNS
from mbexport.core.database import built_in, check, load, write

SUITE = ("--pyargs", "mbexport.core.conformance")


def rewritten(emission: Emission, change) -> Emission:
    """The emission with the text of its main file changed."""
    return replace(emission, files={**emission.files, emission.main: change(emission.files[emission.main])})


def number_by_number(text: str, change) -> str:
    return re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda match: change(float(match[0])), text)


class Rounding(UrdfBackend):
    """Writes seven digits."""

    def emit(self, robot, program):
        emission = super().emit(robot, program)
        files = {name: number_by_number(text, lambda x: f"{x:.7g}") for name, text in emission.files.items()}
        return replace(emission, files=files)


class WithoutProducts(UrdfBackend):
    """Loses products of inertia in silence."""

    def emit(self, robot, program):
        lost = re.compile(r'i(xy|xz|yz)="[^"]*"')
        return rewritten(super().emit(robot, program), lambda text: lost.sub(r'i\1="0.0"', text))


class Restless(UrdfBackend):
    """Never emits the same twice."""

    count = itertools.count()

    def emit(self, robot, program):
        return rewritten(super().emit(robot, program), lambda text: text + f"<!-- {next(self.count)} -->\n")


class Silent(UrdfBackend):
    """Says nothing of springs."""

    def emit(self, robot, program):
        emission = super().emit(robot, program)
        kept = tuple(c for c in emission.concepts if not c.datum.startswith("joint_compliance"))
        return replace(emission, concepts=kept)


class Astray(UrdfBackend):
    """Writes beside its folder."""

    def emit(self, robot, program):
        emission = super().emit(robot, program)
        return replace(emission, files={**emission.files, "../notes.txt": "mine"})


class Anonymous(UrdfBackend):
    """Does not say whose numbers these are."""

    def emit(self, robot, program):
        return super().emit(replace(robot, source_hash=""), program)


class Unordered(UrdfBackend):
    """Depends on the seed of hashes."""

    def emit(self, robot, program):
        return rewritten(super().emit(robot, program), lambda text: text + f"<!-- {hash(robot.name)} -->\n")


class Mute(UrdfBackend):
    """Refuses without a reason that anyone could use."""

    def refusal(self, robot, program):
        return "no."


class Unfaithful(UrdfBackend):
    """Says that it refuses hysteresis, and does where it is."""

    def refusal(self, robot, program):
        rubs = any(stage.drive.slips for stage in robot.stages)
        return "hysteresis is nothing for me." if rubs else super().refusal(robot, program)


def with_engine(kind):
    class Loading(UrdfBackend):
        def load(self, emission):
            return kind(emission)

    return Loading


class Lagging(PinocchioEngine):
    """Takes each torque a call later."""

    def hold(self, torque):
        super().hold(getattr(self, "_late", torque))
        self._late = np.array(torque)


class Keeping(PinocchioEngine):
    """Remembers how it was pushed before."""

    def reset(self, state, imposed):
        before = self.command.copy()
        super().reset(state, imposed)
        self.command[:] = before
        self.drives.stick_anchor[:] += before * 1e-6


class Unbent(PinocchioEngine):
    """Begins every run with hysteresis unbent."""

    def reset(self, state, imposed):
        super().reset(replace(state, slips=None), imposed)


class Sharing(PinocchioEngine):
    """Every engine of the process moves under the torque of the last one that was asked."""

    common = 0.0

    def hold(self, torque):
        Sharing.common = float(np.max(torque)) + self.n
        super().hold(torque)

    def advance(self, duration, steps):
        self.command[0] = Sharing.common
        super().advance(duration, steps)


class Lending(PinocchioEngine):
    """Hands out its own arrays."""

    def state(self):
        state = super().state()
        if self._imposed is None:
            q, dq, theta, dtheta = self._start_state
            return MachineState(state.t, q, dq, theta, dtheta)
        return state


class Blunt(PinocchioEngine):
    """Counts a step too few."""

    def advance(self, duration, steps):
        super().advance(duration * (steps - 1) / steps if steps > 1 else duration, steps)


class Heavy(PinocchioEngine):
    """Counts the rotors among the arms."""

    def mass_matrix(self, q):
        return super().mass_matrix(q) + np.diag(self.motor_inertia())


class Enduring(PinocchioEngine):
    """Goes on with whatever it has."""

    def _not_finite(self, t):
        return FloatingPointError("not finite")


PLANTED = [
    ("digits-planar2r", Rounding, "13"),
    ("statics-scara", WithoutProducts, None),
    ("statics-imece2013", WithoutProducts, "mass_matrix"),
    ("emission-planar2r", Restless, "emitted twice"),
    ("concepts-planar2r", Silent, "joint_compliance.stiffness"),
    ("emission-planar2r", Astray, "outside"),
    ("emission-planar2r", Anonymous, "hash of its source"),
    ("elsewhere", Unordered, "other bytes"),
    ("statics-planar2r", Mute, "names no effect"),
    ("rigid_loop-planar2r", with_engine(Lagging), "rigid_loop"),
    ("behaviour-forgets", with_engine(Keeping), "after a reset"),
    ("behaviour-bent", with_engine(Unbent), "begins with"),
    ("behaviour-alone", with_engine(Sharing), "beside another robot"),
    ("behaviour-copies", with_engine(Lending), "writes on the arrays"),
    ("behaviour-pieces", with_engine(Blunt), "s it is"),
    ("statics-pendulum", with_engine(Heavy), "mass_matrix"),
    ("behaviour-not_finite", with_engine(Enduring), "FloatingPointError"),
]


@pytest.mark.parametrize(("check_id", "kind", "says"), PLANTED, ids=lambda value: getattr(value, "__name__", None))
def test_a_planted_fault_is_found(check_id, kind, says):
    subject = Subject(kind(), duration=0.1)
    if says is None:
        # nothing is lost where nothing is
        checks()[check_id].run(subject)
        return
    with pytest.raises(ConformanceError, match=re.escape(says)):
        checks()[check_id].run(subject)


def test_a_refusal_by_name_counts_and_is_told():
    refusals = checks()["effect-hysteresis"].run(Subject(Unfaithful(), duration=0.05))
    assert refusals
    assert all("hysteresis" in reason for reason in refusals)
    with pytest.raises(RefusedError):
        Subject(Unfaithful()).emission(build(load_sampled("hysteresis")))


def load_sampled(name: str):
    from mbexport.core.agreement.samples import sampled

    return sampled(load("planar2r"), [name])


def test_the_suite_has_everything(monkeypatch):
    """Every built-in robot, scenario and effect; every scenario on every robot that has it, and no other."""
    # which path it is does not matter, and finding one takes seconds
    monkeypatch.setattr("mbexport.core.agreement.scenarios._path", lambda robot, calm, *_: (calm, "exercise"))
    assert set(ROBOTS) == set(built_in())
    assert set(RUNS) == set(SCENARIOS)
    assert {entry.case for entry in checks().values() if entry.name == "effect"} == set(SAMPLED)
    for name in built_in():
        robot = build(load(name))
        has = {scenario.name for scenario in scenarios(robot, tuple(SCENARIOS), 1.0)}
        assert has == {scenario for scenario, robots in RUNS.items() if name in robots}, name
        assert any(stage.drive.spring for stage in robot.stages) == (name in ELASTIC)


def test_random_robots_are_robots(tmp_path):
    kinds = set()
    for seed in SEEDS:
        database = random_database(seed)
        assert database == random_database(seed)
        write(database, tmp_path / str(seed))
        assert load(tmp_path / str(seed)) == database
        assert not [problem for problem in check(tmp_path / str(seed)) if problem.severity == "error"]
        kinds |= {joint.kind for joint in database.joints}
    assert kinds == {"revolute", "prismatic"}


CONFTEST = """
from dataclasses import replace

import pytest
from mbexport.backends.urdf import UrdfBackend

class Mine(UrdfBackend):
    name = "mine"
    def refusal(self, robot, program):
        slips = any(stage.drive.slips for stage in robot.stages)
        return "hysteresis is not for this engine." if slips else super().refusal(robot, program)
    def emit(self, robot, program):
        emission = super().emit(robot, program)
        if robot.name == "pendulum":
            emission = replace(emission, files={{**emission.files, "empty.txt": ""}})
        return emission

@pytest.fixture(scope="session")
def backend_under_test():
    return Mine()

@pytest.fixture(scope="session")
def declared_limits():
    return {limits!r}
"""


def suite(tmp_path, run_pytest, limits: Mapping[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    (tmp_path / "conftest.py").write_text(CONFTEST.format(limits=limits))
    return run_pytest(tmp_path, *SUITE, *words)


def test_declared_limits_are_strict_expected_failures(tmp_path, run_pytest):
    """One that is declared and there, one that is refused by name, one that is declared and is no limit any more."""
    limits = {"emission-pendulum": "an empty file", "concepts-pendulum": "was mended long ago"}
    cases = "emission-pendulum or concepts-pendulum or emission-planar2r or effect-hysteresis"
    done = suite(tmp_path, run_pytest, limits, "-rxX", "-k", cases, "--duration", "0.05")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed, 2 passed" in done.stdout
    assert "1 xfailed" in done.stdout
    assert "declared: an empty file" in done.stdout
    assert "[XPASS(strict)] declared: was mended long ago" in done.stdout
    assert "effect-hysteresis: hysteresis is not for this engine." in done.stdout


@pytest.mark.parametrize(
    ("limits", "words", "says"),
    [
        ({"statics-mars": "too far"}, (), "'statics-mars', and there is no such check"),
        ({"statics-pendulum": " "}, (), "no reason for 'statics-pendulum'"),
        ({}, ("--backend", "urdf"), "--backend is 'urdf', the fixture `backend_under_test` gives 'mine'"),
    ],
)
def test_what_is_declared_wrongly_is_told(tmp_path, run_pytest, limits, words, says):
    done = suite(tmp_path, run_pytest, limits, "-k", "behaviour-words", *words)
    assert done.returncode == 4
    assert says in done.stdout + done.stderr


def test_without_a_backend_there_is_nothing_to_try(tmp_path, run_pytest):
    for words, says in (((), "--backend NAME"), (("--backend", "mjfc"), "did you mean 'mjcf'")):
        done = run_pytest(tmp_path, *SUITE, "-k", "behaviour-words", *words)
        assert done.returncode == 4
        assert says in done.stdout + done.stderr


def test_others_see_nothing_of_it(tmp_path, run_pytest):
    """No option and no import of ours in a run of pytest that is about something else."""
    (tmp_path / "test_other.py").write_text(
        "import sys\ndef test_it():\n    assert 'mbexport.core.conformance.hooks' not in sys.modules\n"
        "    assert 'numpy' not in sys.modules\n"
    )
    (tmp_path / "conftest.py").write_text("def pytest_addoption(parser):\n    parser.addoption('--backend')\n")
    done = run_pytest(tmp_path, "--backend", "theirs", "-p", "no:hypothesispytest")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_checks_need_no_pytest():
    code = (
        "import sys; sys.modules['pytest'] = None; "
        "from mbexport.core.conformance.checks import checks; print(len(checks()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == str(len(checks())), done.stderr
