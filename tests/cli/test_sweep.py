"""mbexport sweep: a study on disk, and one message for wrong use."""

from __future__ import annotations

import re

import pytest

K = "joint_compliance.stiffness"
SHORT = ("--level", "compliant", "--motion", "hold", "--duration", "0.01", "--workers", "1")


def test_a_study_is_written(mbexport, content, tmp_path):
    words = ("sweep", "planar2r", "--vary", f"{K}@joint_1=0.5:2:3", "--vary", f"{K}[SI]@joint_2=500,900", *SHORT, "-o")
    answer = mbexport(*words, tmp_path / "study", "--json")
    assert answer.status == 0
    summary = answer.json()
    assert (summary["variants"], summary["failed"]) == (6, 0)
    assert [one["method"] for one in summary["sensitivity"]] == ["grid"] * 3
    assert summary["sensitivity"][0]["parameters"] == [f"{K}@joint_1", f"{K}@joint_2"]
    files = content(tmp_path / "study")
    assert {name for name in files if not name.startswith("finished-")} == {
        "study.json", "variants.parquet", "sensitivity.json", "study.png", "report.html",
    }  # fmt: skip
    page = files["report.html"].decode()
    assert page.count("data:image/svg+xml;base64,") == 1
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", page)
    assert f"{K}@joint_1" in page
    again = mbexport(*words, tmp_path / "study")
    assert again.status == 0
    assert "6 variants, 0 failed" in again.out
    assert "tip_rms (grid, total): " + f"{K}@joint_1" in again.out
    assert content(tmp_path / "study") == files
    other = mbexport(*words, tmp_path / "study", "--rate", "500")
    assert other.status == 2
    assert "holds another study (it differs in rate)" in other.err
    assert content(tmp_path / "study") == files


def test_a_study_of_which_nothing_runs_says_no(mbexport, tmp_path):
    answer = mbexport(
        "sweep", "planar2r", "--vary", "inertia.Izz[SI]@arm_1=0.06,0.07", *SHORT, "-o", tmp_path / "study"
    )
    assert answer.status == 1
    assert "2 variants, 2 failed" in answer.out
    assert "no body can have this inertia" in answer.out
    assert (tmp_path / "study" / "report.html").is_file()


def test_samples_of_whole_blocks_are_told(mbexport, tmp_path):
    answer = mbexport("sweep", "planar2r", "--vary", f"{K}@all=0.5:2", "--sample", "sobol", "--count", 40, *SHORT,
                      "-o", tmp_path / "study")  # fmt: skip
    assert answer.status == 0
    assert "sobol: 32 variants make whole blocks of 4" in answer.out
    assert "tip_max (sobol, total): " in answer.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vary", "nonsense"), "NAME.COLUMN@PLACE=FROM:TO"),
        (("--vary", f"{K}@joint_9=0.5:2:3"), "joint_1, joint_2"),
        (("--vary", f"{K}@joint_1=0.5:2"), "needs a count"),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--count", "5"), "--count is for samples"),
        (
            ("--vary", f"{K}@joint_1=0.5:2:3", "--level", "compliant", "--with", "joint_compliance"),
            "exclude each other",
        ),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--backend", "nonsense"), "nonsense"),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--motion", "nonsense"), "no motion 'nonsense'"),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--workers", "0"), "--workers 0"),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--sample", "nonsense"), "nonsense"),
        (("--vary", f"{K}@joint_1=0.5:2:3", "--control", "nowhere.yaml"), "nowhere.yaml"),
        ((), "--vary"),
    ],
)
def test_wrong_use_is_one_message_and_writes_nothing(mbexport, content, tmp_path, words, message):
    answer = mbexport("sweep", "planar2r", *words, "-o", tmp_path / "study")
    assert answer.status == 2
    assert message in answer.err
    assert content(tmp_path) == {}
