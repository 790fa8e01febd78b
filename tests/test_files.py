"""What is written appears whole or not at all, whatever breaks in between."""

from pathlib import Path

import pytest

from mbexport.core.errors import UsageError
from mbexport.core.files import insist_on_room, write_whole

FILES = {"a.txt": "new a", "sub/b.txt": "new b", "c.bin": b"new c"}


def tree(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(params=[OSError(28, "No space left on device"), KeyboardInterrupt()], ids=["disk", "interrupt"])
def breaking(request, monkeypatch):
    """Moving the second file into its place fails."""
    moves = []
    original = Path.replace

    def replace(self, target):
        # what is put back afterwards must work
        if Path(target).name == "b.txt" and not moves:
            moves.append(target)
            raise request.param
        return original(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    return request.param


def test_files_appear(tmp_path):
    write_whole(tmp_path / "new", FILES)
    assert tree(tmp_path / "new") == {"a.txt": b"new a", "sub/b.txt": b"new b", "c.bin": b"new c"}


def test_a_broken_write_leaves_no_folder(tmp_path, breaking):
    with pytest.raises((UsageError, KeyboardInterrupt)):
        write_whole(tmp_path / "new", FILES)
    assert not (tmp_path / "new").exists()


def test_a_broken_write_puts_back_what_was_there(tmp_path, breaking):
    (tmp_path / "sub").mkdir()
    for name in FILES:
        (tmp_path / name).write_text("old")
    with pytest.raises((UsageError, KeyboardInterrupt)):
        write_whole(tmp_path, FILES, force=True)
    assert tree(tmp_path) == dict.fromkeys(FILES, b"old")


def test_nothing_is_written_over_unasked(tmp_path):
    (tmp_path / "c.bin").write_text("old")
    with pytest.raises(UsageError, match=r"c\.bin exists already"):
        write_whole(tmp_path, FILES)
    assert tree(tmp_path) == {"c.bin": b"old"}
    write_whole(tmp_path, FILES, force=True)
    assert tree(tmp_path)["c.bin"] == b"new c"


def test_a_place_where_nothing_can_be_written_is_refused_before_the_work(tmp_path):
    (tmp_path / "notes").write_text("a file")
    insist_on_room(tmp_path / "new" / "deep", ("a.txt",), force=False)
    with pytest.raises(UsageError, match=r"notes is no folder"):
        insist_on_room(tmp_path / "notes" / "here", ("a.txt",), force=True)


@pytest.mark.parametrize("name", ["../out.txt", "/out.txt", "sub/../../out.txt"])
def test_no_path_leaves_the_folder(tmp_path, name):
    with pytest.raises(UsageError, match="outside"):
        write_whole(tmp_path / "in", {name: "x"})
    assert not (tmp_path / "in").exists()


def test_files_go_with_the_write_or_stay(tmp_path, breaking):
    (tmp_path / "old.txt").write_text("old")
    with pytest.raises((UsageError, KeyboardInterrupt)):
        write_whole(tmp_path, FILES, without=["old.txt"])
    assert tree(tmp_path) == {"old.txt": b"old"}
    write_whole(tmp_path, FILES, without=["old.txt"])
    assert set(tree(tmp_path)) == {"a.txt", "sub/b.txt", "c.bin"}
