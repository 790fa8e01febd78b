"""What a log.yaml says beside its controller counts, or is refused: nothing is passed over in silence."""

import csv
import math

import pytest

from mbexport.core.cli import main
from mbexport.core.control import read_locked, read_payload
from mbexport.core.errors import RunFileError


def simulated(tmp_path, name, log):
    """(exit status, rows of the run) of a short run under a log.yaml."""
    path = tmp_path / f"{name}.yaml"
    path.write_text(log)
    run = tmp_path / name
    arguments = [
        "simulate",
        "planar2r",
        "--backend",
        "urdf",
        "--motion",
        "hold",
        "--level",
        "rigid",
        "--duration",
        "0.01",
    ]
    with pytest.raises(SystemExit) as stop:
        main([*arguments, "--control", str(path), "-o", str(run)])
    rows = list(csv.DictReader((run / "data.csv").open())) if run.exists() else []
    return stop.value.code, rows


def test_a_declared_payload_hangs_there(tmp_path):
    code, bare = simulated(tmp_path, "bare", "control: {mode: motion}\n")
    assert code == 0
    code, loaded = simulated(tmp_path, "loaded", "control: {mode: motion}\npayload: {mass: 2.0}\n")
    assert code == 0
    # 2 kg at the tip of the second arm, whose frame stands at its end
    added = float(loaded[0]["tau_2"]) - float(bare[0]["tau_2"])
    lever = float(bare[0]["ee_x"]) - 0.5 * math.cos(float(bare[0]["q_link_1"]))

    assert abs(added) == pytest.approx(2.0 * 9.81 * abs(lever), rel=1e-9)


def test_locked_joints_are_refused(tmp_path, capsys):
    code, rows = simulated(tmp_path, "locked", "control: {mode: motion}\nlocked: [1]\n")
    assert code == 1
    assert not rows
    assert "locked" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["payload: 3", "payload: {mas: 3}", "payload: {mass: -1}", "payload: {mass: heavy}"])
def test_a_wrong_payload_is_one_error(tmp_path, text):
    path = tmp_path / "log.yaml"
    path.write_text(text)
    with pytest.raises(RunFileError, match="payload"):
        read_payload(path)


@pytest.mark.parametrize("text", ["locked: 1", "locked: [0]", "locked: [one]", "locked: [1.5]"])
def test_wrong_locked_joints_are_one_error(tmp_path, text):
    path = tmp_path / "log.yaml"
    path.write_text(text)
    with pytest.raises(RunFileError, match="locked"):
        read_locked(path)
