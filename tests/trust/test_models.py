"""URDF and MJCF files of strangers: no entity is expanded, no other file is read but those within the folder."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from mbexport.core.cli import main
from mbexport.core.errors import ModelFileError
from mbexport.core.importing import import_model

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = (
    f'<robot name="r"><link name="&x;"/><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link>'
    '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
)
MJCF = '<mujoco model="&x;"><worldbody><body name="b"><joint/><geom size="0.1"/></body></worldbody></mujoco>'
INNER = "<mujocoinclude><body name='&x;'/></mujocoinclude>"

LAUGHS = "".join(f'<!ENTITY x{i} "{f"&x{i - 1};" * 10}">' for i in range(1, 12))
DECLARATIONS = {
    "a billion laughs": f'<!DOCTYPE robot [<!ENTITY x0 "ha">{LAUGHS}<!ENTITY x "&x11;">]>',
    "one long entity often": f'<!DOCTYPE robot [<!ENTITY x "{"a" * 100_000}">]>',
    "itself": '<!DOCTYPE robot [<!ENTITY x "&x;">]>',
    "a file of the system": '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    "a file without end": '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///dev/zero">]>',
    "another machine": '<!DOCTYPE robot [<!ENTITY x SYSTEM "http://127.0.0.1:9/x">]>',
    "parameters": '<!DOCTYPE robot [<!ENTITY % p SYSTEM "file:///etc/passwd">%p;]>',
    "declarations elsewhere": '<!DOCTYPE robot SYSTEM "file:///dev/zero">',
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("format", ["urdf", "mjcf", "included"])
@pytest.mark.parametrize("case", DECLARATIONS)
def test_entities_are_refused(case: str, format: str, encoding: str, tmp_path: Path):
    body = {"urdf": URDF, "mjcf": MJCF, "included": INNER}[format].replace("&x;", "&x;" * 10)
    path = tmp_path / "model.xml"
    target = tmp_path / "inner.xml" if format == "included" else path
    target.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>{DECLARATIONS[case]}{body}'.encode(encoding))
    if format == "included":
        path.write_text("<mujoco><worldbody><include file='inner.xml'/></worldbody></mujoco>")
    began = time.perf_counter()
    with pytest.raises(ModelFileError, match="document type") as caught:
        import_model(path)
    assert time.perf_counter() - began < 1.0
    assert str(caught.value).startswith(target.name)
    assert "root:" not in str(caught.value)


def test_without_the_declaration_it_is_a_robot(tmp_path: Path):
    """The guard itself: what is refused above is refused for its declaration."""
    for text in (URDF.replace('<link name="&x;"/>', ""), MJCF.replace("&x;", "x")):
        (tmp_path / "model.xml").write_text(text)
        assert import_model(tmp_path / "model.xml").database.n == 1


@pytest.mark.parametrize(
    "where", ["../secret.xml", "a/../../secret.xml", "/etc/passwd", "link.xml", "folder/secret.xml"]
)
def test_includes_stay_in_the_folder(where: str, tmp_path: Path):
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    (folder / "folder").symlink_to(tmp_path)
    (folder / "model.xml").write_text(f'<mujoco><include file="{where}"/></mujoco>')
    with pytest.raises(ModelFileError, match="outside of the model's folder"):
        import_model(folder / "model.xml")


def test_the_command_says_so_and_writes_nothing(tmp_path: Path, capsys):
    (tmp_path / "bomb.urdf").write_text(DECLARATIONS["a billion laughs"] + URDF)
    with pytest.raises(SystemExit) as caught:
        main(["import", str(tmp_path / "bomb.urdf"), "-o", str(tmp_path / "robot")])
    assert caught.value.code == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "document type" in told
    assert not (tmp_path / "robot").exists()


@pytest.mark.parametrize("name", ["../../up", "/etc/passwd", "..", "a\nb", "con.", "x" * 300, "-o", "é", "' or 1"])
def test_a_model_names_no_path(name: str, tmp_path: Path):
    """The robot's name becomes a file's name."""
    text = MJCF.replace("&x;", name.replace("\n", "&#10;").replace("'", "&apos;"))
    (tmp_path / "model.xml").write_text(text, encoding="utf-8")
    made = import_model(tmp_path / "model.xml").database.name
    assert set(made) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_")
    assert 0 < len(made) <= 64
