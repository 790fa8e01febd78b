"""The control and noise parts of a log.yaml: what they say, and what is wrong with them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from mbexport.core.control import Control, read_control, read_noise
from mbexport.core.errors import RunFileError

LOG = """\
control:
  mode: pd
  kp: [100, 2.0e2]
  kd: [1.5, .5]
  feedforward: gravity
  rate: 500
  torque_limit: [10, .inf]
noise: {q: 1.0e-5, tau: [0.5, 0.25], ee: 5.0e-5}
payload: {mass: 2}
"""
PD = Control("pd", (100.0, 200.0), (1.5, 0.5), "gravity", 500.0, (10.0, math.inf))


def written(folder: Path, text: str) -> Path:
    path = folder / "log.yaml"
    path.write_text(text)
    return path


def test_reads_a_log(tmp_path: Path) -> None:
    path = written(tmp_path, LOG)
    assert read_control(path, 2) == PD
    assert read_noise(path, 2) == {"q": (1.0e-5, 1.0e-5), "tau": (0.5, 0.25), "ee": (5.0e-5,)}


def test_reads_the_control_part_alone(tmp_path: Path) -> None:
    assert read_control(written(tmp_path, "mode: motion\n"), 3) == Control()
    assert read_control(written(tmp_path, "{mode: torque, rate: 2000}\n"), 3) == Control("torque", rate=2000.0)


@pytest.mark.parametrize("control", [PD, Control(), Control("torque", rate=250.0), Control("unknown")])
def test_mapping_and_back(control: Control) -> None:
    assert Control.from_mapping(control.to_mapping(), 2) == control


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("control: {mode: pid, kp: [1, 2], kd: [1, 2]}", r"log\.yaml:1, column control\.mode, value 'pid'.*motion, pd"),
        ("control:\n  mode: pd\n  kp: [1]\n  kd: [1, 2]", r"yaml:3, column control\.kp, value '\[1\.0\]'.*list of 2"),
        ("control:\n  mode: pd\n  kd: [1, 2]", r"yaml:1, column control\.kp: mode pd needs kp: 2 gains"),
        ("control: {mode: pd, kp: [1, x], kd: [1, 2]}", r"control\.kp.*list of 2 numbers"),
        ("control: {mode: pd, kp: [1, -2], kd: [1, 2]}", r"value '-2\.0': joint 2: must be 0 or more, and finite"),
        ("control: {mode: pd, kp: [1, .inf], kd: [1, 2]}", r"value 'inf': joint 2: must be 0 or more, and finite"),
        ("control: {mode: motion, rate: 0}", r"control\.rate, value '0\.0': must be a number of Hz above 0"),
        ("control: {mode: motion, rate: 1.0e9}", "1000000 or less"),
        ("control: {mode: motion, rate: fast}", r"control\.rate, value 'fast'"),
        ("control: {mode: motion, feedfoward: gravity}", r"unknown key \(did you mean feedforward\?\)"),
        ("control: {mode: motion, feedforward: full}", r"value 'full': must be one of none, gravity, inverse_dynamics"),
        ("control: {mode: torque, torque_limit: [-1, 1]}", r"control\.torque_limit, value '-1\.0': joint 1"),
        ("control: {kp: [1, 2]}", r"control\.mode: control must be a mapping that says its mode"),
        ("control: pd", "a mapping that says its mode"),
        ("noise: {q: 1}", "there is no control part"),
        ("[1, 2]", "must be a mapping"),
        ("a: [1", r"log\.yaml:\d.*no YAML"),
        ("", "must be a mapping"),
        ("control: !!python/object:os.system {}", "tag .* is not read"),
        ("control: &a [*a]", "alias"),
    ],
)
def test_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RunFileError, match=message):
        read_control(written(tmp_path, text), 2)


def test_all_problems_at_once(tmp_path: Path) -> None:
    text = "control:\n  mode: pd\n  kp: [1]\n  rate: -1\n  wings: 2\n"
    with pytest.raises(RunFileError) as caught:
        read_control(written(tmp_path, text), 2)
    assert [(p.column, p.line) for p in caught.value.problems] == [
        ("control.wings", 5),
        ("control.kp", 3),
        ("control.kd", 1),
        ("control.rate", 4),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("control: {mode: motion}", "there is no noise part"),
        ("noise: {qq: 1}", r"unknown channel \(did you mean q\?\)"),
        ("noise: {q: [1, 2, 3]}", r"noise\.q.*list of 2 numbers"),
        ("noise: {tau: -1}", r"noise\.tau, value '-1\.0': joint 1: must be 0 or more"),
        ("noise: {ee: [1, 2]}", r"noise\.ee.*list of 1 number"),
    ],
)
def test_what_is_wrong_with_noise(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RunFileError, match=message):
        read_noise(written(tmp_path, text), 2)


def test_file_that_is_not_there_or_no_text(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match=r"none\.yaml: there is no such file"):
        read_control(tmp_path / "none.yaml", 2)
    (tmp_path / "log.yaml").write_bytes(b"control: \xff")
    with pytest.raises(RunFileError, match="not text in UTF-8"):
        read_control(tmp_path / "log.yaml", 2)
