"""mbexport simulate: a run on disk as the contract has it."""

from __future__ import annotations

import csv

import pytest
from ruamel.yaml import YAML


def read(folder):
    log = YAML(typ="safe").load((folder / "log.yaml").read_text())
    with (folder / "data.csv").open() as file:
        rows = list(csv.DictReader(file))
    return log, rows


def test_a_run_is_written(mbexport, tmp_path):
    run = tmp_path / "run-01"
    answer = mbexport(
        "simulate", "planar2r", "--backend", "mjcf", "--motion", "hold", "--duration", "0.05", "--rate", "200",
        "--level", "compliant", "-o", run, "--json",
    )  # fmt: skip
    assert answer.status == 0
    facts = answer.json()
    assert (facts["engine"], facts["level"], facts["output"]) == ("MuJoCo", "compliant", str(run))
    log, rows = read(run)
    assert log["control"] == {"mode": "motion"}
    assert log["simulation"]["effects"] == ["joint_compliance", "rotor_inertia"]
    assert [float(row["t"]) for row in rows] == pytest.approx([k / 200 for k in range(11)])
    expected = ["t"] + [
        f"{s}_{i}" for s in ("q_cmd", "dq_cmd", "ddq_cmd", "q", "dq", "q_link", "tau", "tau_link") for i in (1, 2)
    ]
    assert list(rows[0]) == [*expected, "ee_x", "ee_y", "ee_z", "ee_qw", "ee_qx", "ee_qy", "ee_qz"]
    # hanging on its springs: the arm side is below the motor side
    assert abs(float(rows[0]["q_link_1"]) - float(rows[0]["q_1"])) > 1e-6


def test_the_same_run_has_the_same_bytes_and_nothing_is_written_over(mbexport, content, tmp_path):
    words = ("simulate", "pendulum", "--backend", "urdf", "--motion", "excitation", "--duration", "0.02", "-o")
    assert mbexport(*words, tmp_path / "a").status == 0
    assert mbexport(*words, tmp_path / "b").status == 0
    assert content(tmp_path / "a") == content(tmp_path / "b")
    again = mbexport(*words, tmp_path / "a")
    assert again.status == 2
    assert "--force" in again.err


def test_a_run_is_a_motion_and_its_log_a_controller(mbexport, tmp_path):
    (tmp_path / "pd.yaml").write_text("control: {mode: pd, kp: [50], kd: [5], rate: 500}\nnoise: {q: 1.0e-3}\n")
    first = tmp_path / "first"
    words = ("simulate", "pendulum", "--backend", "mjcf", "--duration", "0.1", "--rate", "100")
    assert mbexport(*words, "--motion", "excitation", "--control", tmp_path / "pd.yaml", "-o", first).status == 0
    again = mbexport(*words, "--motion", first, "--control", first / "log.yaml", "-o", tmp_path / "second")
    assert again.status == 0
    (log, rows), (log_again, rows_again) = read(first), read(tmp_path / "second")
    assert log["control"] == log_again["control"]
    assert log["control"]["rate"] == 500
    for a, b in zip(rows, rows_again, strict=True):
        assert float(a["q_1"]) == pytest.approx(float(b["q_1"]), abs=1e-6)


def test_noise_is_that_of_the_log_and_of_the_seed(mbexport, tmp_path):
    (tmp_path / "pd.yaml").write_text("control: {mode: motion}\nnoise: {q: 1.0e-3}\n")
    words = ("simulate", "pendulum", "--backend", "mjcf", "--motion", "hold", "--duration", "0.2", "--noise")
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        done = mbexport(*words, "--control", tmp_path / "pd.yaml", "--seed", seed, "-o", tmp_path / name)
        assert done.status == 0
    a, b, c = ([float(row["q_1"]) for row in read(tmp_path / name)[1]] for name in "abc")
    assert a == b != c
    mean = sum(a) / len(a)
    assert (sum((x - mean) ** 2 for x in a) / len(a)) ** 0.5 == pytest.approx(1e-3, rel=0.3)
    assert read(tmp_path / "a")[0]["noise"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--backend", "mujoco", "--motion", "hold"], "mjcf"),
        (["--backend", "mjcf", "--motion", "grecca"], "greca"),
        (["--backend", "mjcf", "--motion", "greca"], "one joint"),
        (["--backend", "mjcf", "--motion", "hold", "--duration", "0"], "above 0"),
        (["--backend", "mjcf", "--motion", "hold", "--rate", "-5"], "above 0"),
        (["--backend", "mjcf", "--motion", "hold", "--noise"], "--control"),
        (["--backend", "mjcf", "--motion", "hold", "--control", "bad.yaml"], "kp"),
        (["--backend", "mjcf", "--motion", "hold", "--control", "none.yaml"], "none.yaml"),
    ],
)
def test_wrong_words_exit_2_and_write_nothing(mbexport, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("mode: pd\nkp: [1, 2]\nkd: [1]\n")
    answer = mbexport("simulate", "pendulum", *words, "-o", "run")
    assert answer.status == 2
    assert said in answer.err
    assert not (tmp_path / "run").exists()


def test_a_motion_out_of_limits_is_told(mbexport, tmp_path):
    robot = tmp_path / "wheel"
    robot.mkdir()
    (robot / "robot.yaml").write_text("name: wheel\n")
    (robot / "kinematics.dat").write_text("arm alpha a theta d\n1 0 0.1 0 0\n")
    (robot / "inertia.dat").write_text("arm mass x y z Ixx Iyy Izz\n1 1 0 0 0 0.1 0.1 0.1\n")
    (robot / "joints.dat").write_text("joint lower upper\n1 -0.5 0.5\n")
    (robot / "motions").mkdir()
    (robot / "motions" / "far.dat").write_text("t q1\n0 0\n0.1 0.4\n0.2 0.6\n0.3 0.4\n")
    answer = mbexport("simulate", robot, "--backend", "mjcf", "--motion", "far", "-o", tmp_path / "run")
    assert answer.status == 0
    assert "joint_1 leaves its limits" in answer.out


@pytest.mark.parametrize("feedforward", ["gravity", "inverse_dynamics"])
def test_a_controller_does_not_know_what_only_with_effects_says(mbexport, tmp_path, feedforward):
    """The load sags by what it weighs over kp; one that log.yaml declares, or the database has, does not."""
    stiff = f"control: {{mode: pd, kp: [400], kd: [30], rate: 1000, feedforward: {feedforward}}}\n"
    (tmp_path / "pd.yaml").write_text(stiff)
    (tmp_path / "known.yaml").write_text(stiff + "payload: {mass: 2.0}\n")
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "payload.dat").write_text("robot mass\nrobot 2.0\n")
    (tmp_path / "aside.dat").write_text("t q1\n" + "".join(f"{0.1 * k:.1f} 0.7\n" for k in range(11)))
    words = ("simulate", "pendulum", "--backend", "mjcf", "--motion", tmp_path / "aside.dat", "--rate", "100")

    def sag(folder, *more):
        assert mbexport(*words, "-o", tmp_path / folder, *more).status == 0
        _, rows = read(tmp_path / folder)
        return float(rows[-1]["q_1"]) - float(rows[-1]["q_cmd_1"]), float(rows[-1]["tau_1"])

    unknown, asked = sag("a", "--control", tmp_path / "pd.yaml", "--with-effects", tmp_path / "more")
    none, alone = sag("b", "--control", tmp_path / "pd.yaml")
    known, told = sag("c", "--control", tmp_path / "known.yaml")
    assert abs(none) < 1e-3
    assert abs(known) < 1e-3
    assert abs(unknown) > 5e-3
    # what the controller was not told of it bears by kp
    assert unknown * -400.0 == pytest.approx(asked - alone, rel=0.05)
    assert asked == pytest.approx(told, rel=0.05)
