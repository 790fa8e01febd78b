"""The page of a diagnosis: the verdict first and in words, pictures that show what the numbers say, no overflow."""

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from mbexport.core.diagnosis.diagnosis import Dependence, EffectShare, Finding, LeftOutSamples, Parameter, Rival
from mbexport.core.diagnosis.where import candidates
from mbexport.core.diagnosis.words import variable_in_words
from mbexport.core.report.diagnosis_page import DiagnosisAnswer, DiagnosisCause, DiagnosisWhere, diagnosis_page
from mbexport.core.report.diagnosis_pictures import (
    channels,
    envelope,
    shown_overlay,
    variable_values,
    waterfall_picture,
    worst_channels,
    worst_stretch,
)

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


class Reader(HTMLParser):
    """Balance of tags, every address, the text in its order."""

    VOID = frozenset({"meta", "img", "br", "link", "input", "hr"})

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.images, self.texts = [], [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        assert tag != "script" and not any(name.startswith("on") for name, _ in attrs)
        self.addresses += [value for name, value in attrs if name in ("src", "href")]
        if tag == "img":
            self.images.append(dict(attrs))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.texts.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.texts).split())


def read(html):
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    return reader


@pytest.fixture(scope="module")
def pages(explained, no_gap, unexplained):
    return {name: diagnosis_page(d) for name, d in
            (("explained", explained), ("no_gap", no_gap), ("unexplained", unexplained))}  # fmt: skip


def test_it_is_whole_in_one_file(pages):
    for html in pages.values():
        reader = read(html)
        assert reader.addresses and all(text.startswith("data:image/svg+xml;base64,") for text in reader.addresses)
        assert "@import" not in html and "url(" not in html.split("</style>")[0]
        for image in reader.images:
            picture = base64.b64decode(image["src"].partition(",")[2])
            assert fromstring(picture).tag.endswith("svg") and image["alt"]
            assert not re.findall(rb'(?:href|src)="(?!#)[^"]', picture)


def test_the_verdict_comes_first_and_whole(pages):
    text = read(pages["explained"]).text
    said = [
        "the gap comes from Coulomb friction at joint 2 (or what looks like it)",
        "The gap lies mostly at joint 2 (90 %), at reversals (55 % of it); it goes with the direction of",
        "Coulomb friction at joint 2 : torque 12.10 N m (95 % interval 11.70 to 12.50), probability 98 %",
        "It may as well be Stribeck friction at joint 2 or hysteresis at joint 2: joint 2 never moves slower",
        "the gap shrinks by 93 % (95 % interval 91 to 95 %) on runs that no fit saw",
        "The gap, before and after",
        "Motor torque 2.31 N m 0.330 N m 0.310 N m 95 %",
        "Position 0.410 mrad 36.0 \u00b5rad",
        "Why",
        "How far the gap shrinks",
        "pybullet PyBullet is not installed.",
        "Without Coulomb friction at joint 2 0 %",
        "Where the gap lies",
        "The next experiment",
        "Separates Coulomb from Stribeck friction at joint 2",
        "not excited by these runs (6)",
        "tau_3 is stuck from 0.4 to 0.44 s",
    ]
    text = text.replace("\u00a0", " ")
    places = [text.find(words) for words in said]
    assert -1 not in places, said[places.index(-1)]
    assert places == sorted(places)
    assert len(read(pages["explained"]).images) == 5


def test_no_gap_blames_nothing(pages):
    text = read(pages["no_gap"]).text
    assert "no gap above the noise" in text and "Nothing is to blame" in text
    assert "Motor torque 0.305 N m 0.310 N m" in text
    for word in ("Coulomb", "Why", "How far", "Still open", "before"):
        assert word not in text.replace("gap before", ""), word
    assert len(read(pages["no_gap"]).images) == 1


def test_unexplained_says_what_it_looks_like(pages):
    text = read(pages["unexplained"]).text.replace("\u00a0", " ")
    assert "no effect of the catalogue explains it" in text
    assert "Not explained: 100 % of the gap's energy, most of it at joint 2" in text
    assert "it looks like a torque that goes with the direction of motion of joint 2" in text
    assert "What it goes with, and what was tried" in text and "Still open" in text
    assert "How far" not in text and "gap after" not in text


def test_the_map_frames_what_was_found(pages, explained):
    row = re.search(r'<th scope="row">Coulomb friction</th>(.*?)</tr>', pages["explained"], re.DOTALL)[1]
    cells = re.findall(r'<td class="cell ([a-z]*)"[^>]*>(\d*)</td>', row)
    assert cells == [("", "2"), ("found", "97"), ("", "2"), ("", "2"), ("", "2"), ("", "2")]
    assert "Takes next to nothing anywhere: torque offset." in read(pages["explained"]).text
    rivals = (Rival("viscous_friction", "joint_2", "alike"),)
    alike = replace(explained, which=(replace(explained.which[0], indistinguishable_from=rivals),))
    assert 'class="cell alike"' in DiagnosisCause(alike).html()


def test_the_same_diagnosis_gives_the_same_bytes(pages, explained):
    assert diagnosis_page(explained) == pages["explained"]


def test_several_effects_and_a_worse_one_stand_on_the_page(explained):
    more = replace(
        explained,
        verdict="partly_explained",
        which=(
            explained.which[0],
            Finding("payload", "robot", 0.9999, {n: Parameter(1.0, (-1.0, 3.0), "kg") for n in "abcd"}),
            Finding("of_a_plugin", "arm_3", 0.7, {}),
        ),
    )
    text = read(DiagnosisAnswer(more).html() + DiagnosisWhere(more).html()).text.replace("\u00a0", " ")
    causes = "Coulomb friction at joint 2 (or what looks like it), payload and of a plugin at arm 3"
    assert f"part of the gap comes from {causes}" in text
    assert "probability over 99.9 %" in text and "and 1 more" in text
    assert "Still open" in text and "With them in the model" in text


def test_an_effect_that_makes_it_worse_is_drawn_as_such(explained):
    shares = (
        EffectShare("coulomb_friction", "joint_2", 0.7),
        EffectShare("payload", "robot", 0.3),
        EffectShare("of_a_plugin", "arm_3", -0.1),
    )
    drawn = waterfall_picture(replace(explained, how_far=replace(explained.how_far, by_effect=shares)))
    svg = base64.b64decode(drawn.source.partition(",")[2]).decode()
    labels = re.findall(r">([^<>]*%)</text>", svg)
    assert labels == ["100 %", "\u221270 %", "\u221230 %", "+10 %", "10 %"]


def test_what_is_drawn_is_the_worst(explained):
    overlay = shown_overlay(explained)
    ranked = channels(overlay)
    assert (ranked[0].signal, ranked[0].number) == ("tau", 2)
    chosen = worst_channels(overlay)
    assert {channel.signal for channel in chosen} == {"tau", "q", "ee"}
    assert chosen[0].after is not None and np.nanstd(chosen[0].after) < 0.1 * np.nanstd(chosen[0].before)
    # a run that no fit saw goes before one with a larger gap
    louder = replace(overlay, before={"tau": overlay.before["tau"] + 100.0}, held_out=False)
    assert shown_overlay(replace(explained, overlays=(louder, overlay))) is overlay
    assert shown_overlay(replace(explained, overlays=())) is None


def test_the_worst_stretch_is_where_the_gap_is(explained):
    (overlay,) = explained.overlays
    quiet = {"tau": overlay.measured["tau"] - 0.01}
    quiet["tau"][300:350, 1] += 5.0
    begin, end = worst_stretch(channels(replace(overlay, before=quiet))[:1])
    assert begin <= overlay.t[300] and overlay.t[349] <= end
    assert end - begin == pytest.approx(0.5, abs=0.01)


def test_a_curve_keeps_its_peaks_and_its_holes():
    t = np.arange(100_000) * 1e-3
    values = np.sin(t)
    values[54_321] = 9.0
    values[60_000:62_000] = np.nan
    x, y = envelope(t, values)
    assert len(x) < 700 and np.nanmax(y) == 9.0 and np.isnan(y).any()
    assert np.all(np.diff(x) > 0.0)


def test_variables_are_read_without_running_them(explained):
    (overlay,) = explained.overlays
    dq = overlay.measured["dq"][:, 1]
    assert np.array_equal(variable_values("sign(dq_2)", overlay), np.sign(dq))
    both = variable_values("abs(tau_1)*sign(dq_2) - dq_2^2/2", overlay)
    assert np.array_equal(both, np.abs(overlay.measured["tau"][:, 0]) * np.sign(dq) - dq**2 / 2)
    assert variable_values("ddq_2", overlay).shape == dq.shape
    assert variable_values("t", overlay) is overlay.t
    for wrong in ("dq_9", "nonsense", "__import__('os')", "dq_2.shape", "dq_2 if 1 else 2", "(", "sign(dq_2, 3)", "1"):
        assert variable_values(wrong, overlay) is None, wrong


def test_every_variable_a_gap_is_held_against_is_drawn_and_said(explained):
    (overlay,) = explained.overlays
    for variable in candidates(1, 6):
        assert variable_values(variable, overlay) is not None, variable
        assert re.fullmatch(r"time|the (\w|[- ])+ of joint \d", variable_in_words(variable)), variable


def test_a_variable_the_run_does_not_know_is_passed_over(explained):
    foreign = replace(explained.where, depends_on=(Dependence("temperature", 0.99), Dependence("sign(dq_2)", 0.5)))
    alts = [image["alt"] for image in read(DiagnosisCause(replace(explained, where=foreign)).html()).images]
    assert "The gap against the speed of joint 2" in alts


def test_names_do_not_break_out(explained):
    evil = '<img src=x onerror="alert(1)">'
    found = replace(explained.which[0], effect=evil, indistinguishable_from=(Rival(evil, "robot", evil),))
    changed = replace(
        explained, robot=evil, which=(found,), runs=(evil,), notes=(evil,),
        left_out=(LeftOutSamples(evil, evil, evil, evil),),
        next_experiment=replace(explained.next_experiment, why=evil),
        unexplained=replace(explained.unexplained, looks_like=evil, joints={evil: 1.0}), verdict="partly_explained",
        how_far=replace(explained.how_far, refused={evil: evil}, without={f"{evil} joint_2": 0.1}),
    )  # fmt: skip
    html = diagnosis_page(changed)
    assert "<img src=x" not in html and html.count("&lt;img src=x") >= 8
    read(html)


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed, so no page is laid out")
@pytest.mark.parametrize("width", [1100, 500])
def test_nothing_overflows_in_a_browser(pages, tmp_path, width):
    """The page laid out: nothing wider than the window, every picture drawn, no error told."""
    probe = """<script>addEventListener("load", () => { const d = document.documentElement;
      const drawn = [...document.images].filter(i => i.complete && i.naturalWidth > 0).length;
      document.title = `${d.scrollWidth}/${innerWidth}/${drawn}/${document.images.length}`; });</script>"""
    for name in ("explained", "unexplained"):
        page = tmp_path / f"{name}.html"
        page.write_text(pages[name].replace("</head>", probe + "</head>"), encoding="utf-8")
        told = subprocess.run(
            [CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
             f"--window-size={width},900", "--dump-dom", page.as_uri()],
            capture_output=True, text=True, timeout=60, check=True,
        ).stdout  # fmt: skip
        wide, window, drawn, images = map(int, re.search(r"<title>(\d+)/(\d+)/(\d+)/(\d+)</title>", told).groups())
        assert wide <= window and window == width
        assert drawn == images == len(read(pages[name]).images)
