"""Recorded runs of strangers: what they unfold to is known before they are read."""

from __future__ import annotations

import resource
import time
from pathlib import Path

import pytest

from mbexport.core.control import read_control
from mbexport.core.data_file import LONGEST_LINE, MOST_CELLS, MOST_SAMPLES, column_names, read_columns
from mbexport.core.errors import RunFileError
from mbexport.core.motion.tables import read_run_motion

SECONDS = 5.0
MEGABYTES = 200.0


@pytest.fixture
def cheap():
    """What happens within takes little time and memory."""
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
    yield
    assert time.perf_counter() - began < SECONDS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0 < MEGABYTES


def one_problem(path: Path) -> str:
    with pytest.raises(RunFileError) as caught:
        read_run_motion(path, 1)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert str(problem).isprintable()
    return problem.message


def test_ten_million_rows(tmp_path: Path, cheap):
    path = tmp_path / "data.csv"
    with path.open("wb") as stream:
        stream.write(b"t,q_1\n")
        stream.write(b"0,0\n" * 10_000_000)
    assert f"has 10000000 rows; a run may have {MOST_SAMPLES}" in one_problem(path)
    path.unlink()


def test_many_columns_of_many_rows(tmp_path: Path, cheap):
    path = tmp_path / "data.csv"
    columns = 10_000
    path.write_text(",".join(["t", "q_1", *(f"x{i}" for i in range(columns))]) + "\n" + "\n" * 30_000)
    assert f"a run may have {MOST_CELLS} numbers" in one_problem(path)


@pytest.mark.parametrize("name", ["data.csv", "data.parquet"])
def test_a_terabyte(name: str, tmp_path: Path, cheap):
    path = tmp_path / name
    with path.open("wb") as stream:
        stream.truncate(2**40)
    assert str(2**40) in one_problem(path)


@pytest.mark.parametrize("text", [b"t,q_1" + b"," * 2 * LONGEST_LINE, b"t,q_1\n0,0\n0" + b",0" * LONGEST_LINE])
def test_a_line_without_end(text: bytes, tmp_path: Path, cheap):
    path = tmp_path / "data.csv"
    path.write_bytes(text)
    assert "the line has more than" in one_problem(path)


@pytest.mark.parametrize("long", [1, 2, 3])
def test_lines_that_are_long_but_not_too_long(long: int, tmp_path: Path):
    path = tmp_path / "data.csv"
    name = "x" * (LONGEST_LINE // 20 * long)
    path.write_text(f"t,q_1,{'n' * 100_000}\n" + f'0,0,"{name[:1]}"\n' * 2 + f"1,1,{' ' * len(name)}\n")
    assert column_names(path)[:2] == ("t", "q_1")
    assert read_columns(path, ["t", "q_1"])["t"].tolist() == [0.0, 0.0, 1.0]


def test_parquet_that_unfolds(tmp_path: Path, cheap):
    """Some kilobytes of it say a hundred million rows, or texts of a terabyte."""
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "data.parquet"
    rows = 200_000
    with parquet.ParquetWriter(path, pa.schema([("t", pa.int8()), ("q_1", pa.int8())])) as writer:
        zeros = pa.table({"t": pa.array(bytes(rows), pa.int8()), "q_1": pa.array(bytes(rows), pa.int8())})
        for _ in range(MOST_SAMPLES // rows + 1):
            writer.write_table(zeros)
    assert path.stat().st_size < 100_000
    assert f"a run may have {MOST_SAMPLES}" in one_problem(path)

    long = pa.DictionaryArray.from_arrays(pa.array(bytes(100_000), pa.int8()), pa.array(["1" * 1_000_000]))
    parquet.write_table(pa.table({"t": pa.array(range(100_000)), "q_1": long}), path)
    assert path.stat().st_size < 2_000_000
    assert "not numbers" in one_problem(path)

    lists = pa.array([[0.0] * 1000] * 10)
    parquet.write_table(pa.table({"t": pa.array(range(10)), "q_1": lists}), path)
    assert "not numbers" in one_problem(path)


@pytest.mark.parametrize(
    "content", [b"PAR1" * 100, b"PAR1\xff\xff\xff\x7fPAR1", b"\x80\x04\x95\x10pickle", b"PK\x03\x04", b""]
)
def test_parquet_that_is_none(content: bytes, tmp_path: Path):
    pytest.importorskip("pyarrow")
    path = tmp_path / "data.parquet"
    path.write_bytes(content)
    assert "number" in one_problem(path) or "read" in one_problem(path)


def test_what_is_no_file(tmp_path: Path):
    path = tmp_path / "data.csv"
    path.symlink_to("/dev/zero")
    assert "is no file" in one_problem(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("control: !!python/object/apply:os.system [id]\n", "is not read"),
        ("control: &a [*a, *a]\n", "before its anchor"),
        ("a: &a [0, 0, 0, 0, 0, 0, 0, 0]\n" + "\n".join(f"k{i}: &a [{'*a, ' * 9}*a]" for i in range(9)), "unfolds"),
        ("control: {mode: " + "x" * 9_000_000 + "}\n", "bytes"),
    ],
)
def test_a_log_that_would_do_harm(text: str, says: str, tmp_path: Path, cheap):
    path = tmp_path / "log.yaml"
    path.write_text(text)
    with pytest.raises(RunFileError, match=says):
        read_control(path, 1)
