"""Every effect has its picture, made by the code, and its section; what a picture's heavy frame claims is so."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mbexport.core.effects import built_in_names

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures" / "signatures"
LARGEST = 60_000
# one of each kind
DRAWN = ("joint_spring", "encoder_offset", "kinematic_error", "controller_gain")
# what is a smooth curve of one variable
CURVES = ("joint_spring", "viscous_friction", "rotor_inertia", "joint_compliance", "base_tilt")


@pytest.fixture(scope="module")
def signatures(script):
    return script("make_signatures")


@pytest.mark.parametrize("effect", built_in_names())
def test_every_effect_has_a_section_and_a_picture(effect):
    page = (ROOT / "docs" / "signatures.md").read_text(encoding="utf-8")
    sections = re.findall(rf"^### {effect}\n(.*?)(?=^#|\Z)", page, re.MULTILINE | re.DOTALL)
    assert len(sections) == 1
    assert f"![{effect}](pictures/signatures/{effect}.png)" in sections[0]
    assert re.search(r"^See: \S", sections[0], re.MULTILINE) and re.search(r"^Alike: \S", sections[0], re.MULTILINE)
    assert (PICTURES / f"{effect}.png").stat().st_size < LARGEST


def test_no_picture_is_of_nothing(signatures):
    assert set(signatures.SIGNATURES) == set(built_in_names())
    assert {path.name for path in PICTURES.iterdir()} == {f"{effect}.png" for effect in built_in_names()}
    assert set(signatures.KINDS) == {signatures.SIGNATURES[effect].kind for effect in DRAWN}


@pytest.mark.parametrize("effect", DRAWN)
def test_pictures_are_drawn(signatures, png_size, tmp_path, effect):
    path = tmp_path / f"{effect}.png"
    signatures.draw(effect, path)
    assert png_size(path) == png_size(PICTURES / path.name)


@pytest.mark.parametrize("effect", CURVES)
def test_slow_and_fast_are_one_curve_where_the_frame_says_so(signatures, effect):
    signature = signatures.SIGNATURES[effect]
    reported, other = {"torque": ("tau", None), "twist": ("q", "q_link")}[signature.kind]
    places, shown = [], []
    for _, _, pair in signatures.swings(effect, signature):
        before = pair.given.joints[other] if other else pair.absent.joints[reported]
        places.append(signatures.variables(pair))
        shown.append(signatures.late((pair.given.joints[reported] - before)[:, 0]))
    values = np.concatenate(shown)
    for number in range(4):
        variable = np.concatenate([place[number] for place in places])
        fit = np.polynomial.Polynomial.fit(variable, values, 9)
        off = np.max(np.abs(fit(variable) - values)) / np.ptp(values)
        assert (off < 0.03) == (number in signature.telling), (number, off)
