"""Every limit of docs/trust.md: what is just as large is read as far as it makes sense, what is one larger is refused.

What would take seconds at its real size (half a million values of YAML, say) is tried at a smaller one.
"""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mbexport.core import data_file
from mbexport.core.control import unit_file
from mbexport.core.data_file import LARGEST_DATA, LONGEST_LINE, column_names, read_columns
from mbexport.core.database import check, load, sources, yaml_tree
from mbexport.core.database import table as tables
from mbexport.core.database.problems import MOST, Problems
from mbexport.core.database.settings import LARGEST_MESH, LONGEST_TEXT
from mbexport.core.database.sources import MOST_FILES
from mbexport.core.database.table import LARGEST_FILE, MOST_COLUMNS, parse_table, read_text
from mbexport.core.database.yaml_tree import DEEPEST, LARGEST_YAML, parse_yaml
from mbexport.core.errors import DatabaseError, InputError, ModelFileError, RunFileError, UsageError
from mbexport.core.importing import import_model, mjcf_settings, xml_file
from mbexport.core.importing.mjcf_settings import INCLUDES
from mbexport.core.importing.xml_file import parse_xml, read_file
from mbexport.core.study import design, parse_vary
from mbexport.core.study.design import MOST_VARIANTS

Small = Callable[..., Path]


def sparse(path: Path, size: int) -> Path:
    """A file of zeros that takes no room."""
    with path.open("wb") as stream:
        stream.truncate(size)
    return path


def told(path: Path) -> str:
    """All that is wrong with a database."""
    return "\n".join(problem.message for problem in check(path) if problem.severity == "error")


# tables


@pytest.mark.parametrize("largest", [LARGEST_FILE, LARGEST_YAML])
def test_bytes_of_a_text(largest: int, tmp_path: Path):
    for size, says in ((largest, "zero byte"), (largest + 1, f"has {largest + 1} bytes; it may have {largest}")):
        problems = Problems()
        assert read_text(sparse(tmp_path / "file", size), "file", problems, largest) is None
        assert says in problems.found[0].message


def test_the_files_of_a_database_have_the_limits_of_texts(small: Small):
    folder = small()
    sparse(folder / "joints.dat", LARGEST_FILE + 1)
    assert f"it may have {LARGEST_FILE}" in told(folder)
    folder = small(name="other")
    sparse(folder / "robot.yaml", LARGEST_YAML + 1)
    assert f"it may have {LARGEST_YAML}" in told(folder)


def test_rows_of_a_table(monkeypatch):
    monkeypatch.setattr(tables, "MOST_ROWS", 100)
    for count, whole in ((100, True), (101, False)):
        problems = Problems()
        table = parse_table("t\n" + "1\n" * count, "long.dat", problems)
        assert (table is not None) == whole == (not problems.found)


def test_columns_of_a_table():
    for count, whole in ((MOST_COLUMNS, True), (MOST_COLUMNS + 1, False)):
        problems = Problems()
        header = " ".join(f"c{i}" for i in range(count))
        table = parse_table(f"{header}\n{'1 ' * count}\n", "wide.dat", problems)
        assert (table is not None) == whole == (not problems.found)


@pytest.mark.parametrize("row", ["[{}]", "{{{}}}"], ids=["lists", "mappings"])
def test_rows_and_columns_of_a_table_in_yaml(row: str, small: Small, monkeypatch):
    monkeypatch.setattr(sources, "MOST_ROWS", 3)
    monkeypatch.setattr(sources, "MOST_COLUMNS", 4)
    names = ["joint", "torque", *(f"c{i}" for i in range(3))]

    def said(rows: int, columns: int) -> str:
        cells = names[:columns] if row == "[{}]" else [f"{name}: 1" for name in names[:columns]]
        table = "".join(f"  - {row.format(', '.join(cells))}\n" for _ in range(rows))
        return told(small({"robot.yaml": f"name: small\ncoulomb_friction:\n{table}"}, f"robot-{rows}-{columns}"))

    assert "may have" not in said(3, 4)
    assert "more than 3 rows" in said(4, 4)
    assert "columns; a table may have" in said(3, 5)


# YAML


def test_values_of_yaml(monkeypatch):
    monkeypatch.setattr(yaml_tree, "MOST_NODES", 20)
    # the list is a value too
    for count, whole in ((19, True), (20, False)):
        problems = Problems()
        tree = parse_yaml(f"[{', '.join('0' * count)}]", "file", problems)
        assert (tree is not None) == whole == (not problems.found)
    # ten more for each alias, and the list around them
    for aliases, whole in ((0, True), (1, False)):
        problems = Problems()
        anchored = f"&a [{', '.join('0' * 9)}]"
        tree = parse_yaml(f"[{', '.join([anchored, *['*a'] * aliases])}]", "file", problems)
        assert (tree is not None) == whole == (not problems.found)


def test_levels_of_yaml():
    for depth, whole in ((DEEPEST, True), (DEEPEST + 1, False)):
        problems = Problems()
        tree = parse_yaml("[" * depth + "]" * depth, "file", problems)
        assert (tree is not None) == whole
        assert whole or f"deeper than {DEEPEST}" in problems.found[0].message


# the other limits of databases


def test_files_in_a_folder(small: Small):
    folder = small()
    for i in range(MOST_FILES - len(list(folder.iterdir()))):
        (folder / f"note-{i}.txt").touch()
    assert load(folder).n == 2
    (folder / "one-more.txt").touch()
    assert f"{MOST_FILES + 1} files; it may hold {MOST_FILES}" in told(folder)


def test_characters_of_a_text(small: Small):
    assert len(load(small({"robot.yaml": f"name: small\nsource: {'x' * LONGEST_TEXT}\n"})).source) == LONGEST_TEXT
    longer = small({"robot.yaml": f"name: small\nsource: {'x' * (LONGEST_TEXT + 1)}\n"}, "longer")
    assert f"it may have {LONGEST_TEXT}" in told(longer)


def test_bytes_of_a_mesh(small: Small):
    folder = small({"visuals.yaml": "1:\n  - {kind: mesh, mesh: arm.stl}\n"})
    sparse(folder / "arm.stl", LARGEST_MESH)
    assert load(folder).visuals[0][0].mesh == "arm.stl"
    sparse(folder / "arm.stl", LARGEST_MESH + 1)
    assert f"it may have {LARGEST_MESH}" in told(folder)


@pytest.mark.parametrize("faults", [MOST, MOST + 1, MOST + 100])
def test_faults_that_are_told(faults: int, small: Small):
    rows = "\n".join("1 x" for _ in range(faults))
    with pytest.raises(DatabaseError) as caught:
        load(small({"motions/m.dat": f"t q1\n{rows}\n"}))
    problems = caught.value.problems
    assert len(problems) == min(2 + 2 * faults, MOST + 1)
    assert ("the others are not listed" in problems[-1].message) == (2 + 2 * faults > MOST)


# models


def test_bytes_of_a_model(tmp_path: Path):
    path = sparse(tmp_path / "model.urdf", xml_file.LARGEST_FILE)
    assert len(read_file(path, path.name)) == xml_file.LARGEST_FILE
    sparse(path, xml_file.LARGEST_FILE + 1)
    with pytest.raises(ModelFileError, match="is larger than 16 MiB"):
        read_file(path, path.name)


def test_elements_of_a_model(monkeypatch):
    monkeypatch.setattr(xml_file, "MOST_ELEMENTS", 100)
    inner = "<a/>" * 99
    assert sum(1 for _ in parse_xml(f"<robot>{inner}</robot>".encode(), "model").walk()) == 100
    with pytest.raises(ModelFileError, match="more than 100"):
        parse_xml(f"<robot>{inner}<a/></robot>".encode(), "model")


def test_levels_of_a_model():
    deepest = xml_file.DEEPEST
    assert parse_xml(("<a>" * deepest + "</a>" * deepest).encode(), "model").tag == "a"
    with pytest.raises(ModelFileError, match=f"nested deeper than {deepest}"):
        parse_xml(("<a>" * (deepest + 1) + "</a>" * (deepest + 1)).encode(), "model")


def model_with_includes(folder: Path, count: int, content: str = "") -> Path:
    """A pendulum beside that many included files."""
    for i in range(count):
        (folder / f"{i}.xml").write_text(f"<mujocoinclude>{content}</mujocoinclude>")
    includes = "".join(f'<include file="{i}.xml"/>' for i in range(count))
    body = '<worldbody><body name="b"><joint/><geom size="0.1"/></body></worldbody>'
    (folder / "model.xml").write_text(f'<mujoco model="m">{includes}{body}</mujoco>')
    return folder / "model.xml"


def test_includes_of_a_model(tmp_path: Path):
    assert import_model(model_with_includes(tmp_path, INCLUDES)).database.n == 1
    with pytest.raises(ModelFileError, match="too much is included"):
        import_model(model_with_includes(tmp_path, INCLUDES + 1))


def test_elements_of_all_included_files_together(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(mjcf_settings, "MOST_ELEMENTS", 109)
    # 5 of the model itself, 2 includes, and a root of each
    half = "<sensor/>" * 50
    assert import_model(model_with_includes(tmp_path, 2, half)).database.n == 1
    with pytest.raises(ModelFileError, match="too much is included"):
        import_model(model_with_includes(tmp_path, 2, half + "<sensor/>"))


# runs


@pytest.mark.parametrize("name", ["data.csv", "data.parquet"])
def test_bytes_of_a_run(name: str, tmp_path: Path):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
    for size, says in ((LARGEST_DATA, "no table of numbers|more than"), (LARGEST_DATA + 1, f"may have {LARGEST_DATA}")):
        with pytest.raises(RunFileError, match=says):
            column_names(sparse(tmp_path / name, size))


@pytest.mark.parametrize("name", ["data.csv", "data.parquet"])
@pytest.mark.parametrize("limit", ["MOST_SAMPLES", "MOST_CELLS"])
def test_rows_and_numbers_of_a_run(name: str, limit: str, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(data_file, limit, 10 if limit == "MOST_SAMPLES" else 20)
    for rows in (10, 11):
        path = tmp_path / name
        if name == "data.csv":
            path.write_text("t,q_1\n" + "0,0\n" * rows)
        else:
            pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
            parquet.write_table(pa.table({"t": np.zeros(rows), "q_1": np.zeros(rows)}), path)
        if rows == 10:
            assert len(read_columns(path, ["t", "q_1"])["t"]) == rows
        else:
            with pytest.raises(RunFileError, match="has 11 rows"):
                read_columns(path, ["t", "q_1"])


def test_a_line_of_a_run(tmp_path: Path):
    path = tmp_path / "data.csv"
    header = "t,q_1,"
    path.write_text(header + "," * (LONGEST_LINE - len(header)) + "\n0,0,0\n")
    assert column_names(path)[:2] == ("t", "q_1")
    path.write_text(header + "," * (LONGEST_LINE + 1 - len(header)) + "\n0,0,0\n")
    with pytest.raises(RunFileError, match=f"more than {LONGEST_LINE} bytes"):
        column_names(path)


# controllers' units


def unit_of(path: Path, **sizes: int) -> Path:
    """An archive whose entries say that they unfold to so many bytes; "description" is the unit's own."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(unit_file.DESCRIPTION, '<fmiModelDescription fmiVersion="3.0"/>')
        for name in sizes:
            if name != "description":
                archive.writestr(name, "x")
        for entry in archive.infolist():
            name = "description" if entry.filename == unit_file.DESCRIPTION else entry.filename
            entry.file_size = sizes.get(name, entry.file_size)
    return path


@pytest.mark.parametrize(
    ("sizes", "says"),
    [
        ({"description": 40, "a": unit_file.LARGEST_ARCHIVE - 40}, "it is of FMI 3.0|cannot be read"),
        ({"description": 40, "a": unit_file.LARGEST_ARCHIVE - 39}, f"it may have {unit_file.LARGEST_ARCHIVE}"),
        ({"description": unit_file.LARGEST_DESCRIPTION}, "it is of FMI 3.0|cannot be read"),
        ({"description": unit_file.LARGEST_DESCRIPTION + 1}, f"it may have {unit_file.LARGEST_DESCRIPTION}"),
    ],
)
def test_bytes_of_a_unit(sizes: dict[str, int], says: str, tmp_path: Path):
    pytest.importorskip("fmpy")
    with pytest.raises(InputError, match=says):
        unit_file.read_unit(unit_of(tmp_path / "c.fmu", **sizes), 1)


def test_a_unit_that_holds_one_name_twice(tmp_path: Path):
    pytest.importorskip("fmpy")
    path = tmp_path / "c.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(unit_file.DESCRIPTION, '<fmiModelDescription fmiVersion="3.0"/>')
        for _ in range(2):
            with warnings.catch_warnings(action="ignore"):
                archive.writestr("a", "x")
        for entry in archive.infolist()[1:]:
            entry.file_size = unit_file.LARGEST_ARCHIVE // 2
    with pytest.raises(InputError, match=f"it may have {unit_file.LARGEST_ARCHIVE}"):
        unit_file.read_unit(path, 1)


# studies


def test_variants_of_a_study(small: Small):
    database = load(small())

    def variants(first: int, second: int) -> int:
        texts = (f"inertia.mass@arm_1=0.5:2:{first}", f"inertia.mass@arm_2=0.5:2:{second}")
        return len(design([parameter for text in texts for parameter in parse_vary(text, database)]))

    assert variants(1000, MOST_VARIANTS // 1000) == MOST_VARIANTS
    with pytest.raises(UsageError, match=f"more than {MOST_VARIANTS}"):
        variants(1000, MOST_VARIANTS // 1000 + 1)
    parameters = parse_vary("inertia.mass@arm_1=0.5:2", database)
    with pytest.raises(UsageError, match=f"from 1 to {MOST_VARIANTS}"):
        design(parameters, "random", MOST_VARIANTS + 1)
