"""What `mbexport cosimulate` writes and says."""

import json

import pytest

from mbexport.core.cli import main

WORDS = ("cosimulate", "planar2r", "--backend", "urdf", "--motion", "excitation", "--level", "rigid",
         "--duration", "0.02", "--interval", "0.002", "--interval", "0.001", "--order", "1", "--memory")  # fmt: skip


@pytest.fixture
def called(capsys):
    """called(words...): exit status and what was printed."""

    def call(*words):
        try:
            main([str(word) for word in words])
            status = 0
        except SystemExit as ended:
            status = ended.code or 0
        printed = capsys.readouterr()
        assert "Traceback" not in printed.err
        return status, printed.out, printed.err

    return call


def test_results_are_written_the_same_bytes_again(called, tmp_path):
    status, out, _ = called(*WORDS, "-o", tmp_path / "a")
    assert status == 0
    assert "a communication step of 2 ms takes the tip" in out
    assert "  extrapolated, order 1: order " in out
    assert called(*WORDS, "-o", tmp_path / "b", "--json")[0] == 0
    files = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert sorted(files) == ["cosimulation.html", "cosimulation.json", "errors.csv", "errors.svg"]
    assert files == {path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()}
    facts = json.loads(files["cosimulation.json"])
    assert facts["schema"] == "mbexport-cosimulation/1"
    assert [(row["order"], row["memory"], row["interval"]) for row in facts["measured"]] == [
        (order, memory, interval) for memory in (False, True) for order in (1,) for interval in (0.002, 0.001)
    ]
    rows = files["errors.csv"].decode().splitlines()
    assert len(rows) == 5
    assert float(rows[1].split(",")[3]) == facts["measured"][0]["largest"]
    assert b"extrapolated, order 1, memory" in files["cosimulation.html"]
    status, _, err = called(*WORDS, "-o", tmp_path / "a")
    assert status == 2
    assert "--force" in err


@pytest.mark.parametrize(
    ("more", "status", "said"),
    [
        (["--interval", "0.0007"], 2, "whole multiples"),
        (["--lag", "-1"], 2, "lag of -1.0 s"),
        (["--signals", "signals.yaml"], 2, "--controller"),
        (["--backend", "fmu"], 1, "emitted only"),
        (["--backend", "gazebo"], 2, "gazebo"),
    ],
)
def test_wrong_use_is_told_in_one_message(more, status, said, called, tmp_path):
    found, _, err = called(*WORDS, *more, "-o", tmp_path / "out")
    assert found == status
    assert said in err
    assert not (tmp_path / "out").exists()


def test_a_loop_that_nothing_holds_together_is_a_no(called, tmp_path):
    words = ("cosimulate", "planar2r", "--backend", "urdf", "--motion", "excitation", "--level", "rigid")
    status, out, _ = called(*words, "--duration", "0.6", "--interval", "0.06", "--order", "2", "-o", tmp_path / "out")
    assert status == 1
    assert "no communication step holds the loop together" in out
    assert (tmp_path / "out" / "cosimulation.html").is_file()
