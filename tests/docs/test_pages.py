"""The pages themselves: links that lead somewhere, generated parts that are current, nothing unfinished."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
LARGEST_PICTURE = 300_000
WIDEST = 120


def prose(text: str) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^(`{3,}|~{3,}).*?^\1$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as the usual hosts make them."""
    return {
        re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in HEADING.findall(prose(text))
    }


def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in LINK.findall(prose(text)):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), f"{page.name}: {target}"
        assert path.is_relative_to(ROOT), f"{page.name}: {target} leaves the project"
        if anchor:
            assert anchor in anchors(path.read_text(encoding="utf-8")), f"{page.name}: {target}"


def test_every_page_is_linked_from_the_index():
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    linked = set(LINK.findall(index))
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "README.md" or page.name in linked, page.name


def test_pictures_are_small_and_shown():
    shown = {
        (page.parent / target).resolve()
        for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
        for target in LINK.findall(page.read_text(encoding="utf-8"))
    }
    for picture in (ROOT / "docs" / "pictures").rglob("*.png"):
        assert picture in shown, f"{picture.name} is on no page"
        assert picture.stat().st_size <= LARGEST_PICTURE, picture.name


def test_nothing_is_left_open(page):
    text = page.read_text(encoding="utf-8")
    for word in ("TODO", "TBD", "FIXME", "XXX", "lorem", "coming soon", "to be filled", "/work/", "/tmp/", "/home/"):
        assert word.lower() not in text.lower(), f"{page.name}: {word}"


@pytest.fixture(scope="session")
def generate(script):
    return script("generate")


def test_drawings_are_drawn(script, png_size, tmp_path):
    for name, draw in script("make_pictures").PICTURES_OF.items():
        draw(tmp_path / name)
        assert png_size(tmp_path / name) == png_size(ROOT / "docs" / "pictures" / name)


def test_generated_parts_are_current(page, generate):
    text = page.read_text(encoding="utf-8")
    assert text == generate.filled(text), f"{page.name} is out of date: run python docs/generate.py"


def test_every_generator_is_used(generate):
    used = {name for page in (ROOT / "docs").glob("*.md") for name in re.findall(r"generated: (\w+)", page.read_text())}
    assert used == set(generate.REGIONS)


def test_notes_are_of_columns_that_exist(generate):
    columns = {(table.name, c.name) for table in generate.FIXED_TABLES for c in table.columns}
    columns |= {(effect.name, c.name) for effect in generate.built_in_effects() for c in effect.columns}
    assert set(generate.NOTES) <= columns


def test_a_stale_page_would_be_found(generate):
    text = "<!-- generated: tables -->\nold\n<!-- end -->\n"
    assert "Ixx" in generate.filled(text)
    assert generate.filled(generate.filled(text)) == generate.filled(text)


def test_the_settings_page_names_every_key():
    from mbexport.core.database.settings import SETTINGS

    text = (ROOT / "docs" / "database.md").read_text(encoding="utf-8")
    for key in SETTINGS:
        assert f"| `{key}` |" in text, key
