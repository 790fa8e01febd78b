"""The page of an agreement: whole in one file, the same each time, and nothing a name could break out of."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from defusedxml.ElementTree import fromstring

from mbexport.core.agreement import agree
from mbexport.core.report import Section, agreement_page, page
from mbexport.core.simulation import backend_named

QUANTITIES = ["tool_position", "mass_matrix", "gravity", "rigid_loop", "compliant_motion", "convergence"]


@pytest.fixture(scope="module")
def answer():
    return agree("planar2r", ["urdf", "mjcf", "pybullet"], quantities=QUANTITIES, duration=0.1)


@pytest.fixture(scope="module")
def html(answer):
    return agreement_page(answer)


class Reader(HTMLParser):
    """Balance of tags, and every address the page would load or lead to."""

    VOID = frozenset({"meta", "img", "br", "link", "input", "hr"})

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.images, self.text = [], [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                self.addresses.append(value)
            assert not name.startswith("on"), "no script on the page"
        assert tag != "script"
        if tag == "img":
            self.images.append(dict(attrs))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(html):
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    return reader


def test_it_is_whole_in_one_file(html):
    reader = read(html)
    assert reader.addresses and all(address.startswith("data:image/svg+xml;base64,") for address in reader.addresses)
    assert "@import" not in html and "url(" not in html.split("</style>")[0]
    for image in reader.images:
        picture = base64.b64decode(image["src"].partition(",")[2])
        assert fromstring(picture).tag.endswith("svg") and image["alt"]
        # the picture itself loads nothing either
        assert not re.findall(rb'(?:href|src)="(?!#)[^"]', picture)


def test_it_says_yes_first_and_shows_every_quantity(html, answer):
    text = " ".join(read(html).text)
    assert text.index("all agree") < text.index("In a sentence") < text.index("Every quantity")
    assert answer.sentences[0] in " ".join(text.split())
    for word in (
        "mass matrix",
        "gravity torque",
        "tool path",
        "deflection of the joints",
        "PyBullet",
        "order",
    ):
        assert word in text
    assert len(read(html).images) == 4


def test_the_same_answer_gives_the_same_bytes(html, answer):
    assert agreement_page(answer) == html


def test_without_runs_there_are_no_empty_pictures():
    answer = agree("pendulum", ["urdf"], quantities=["gravity", "mass_matrix"])
    reader = read(agreement_page(answer))
    assert len(reader.images) == 1 and "First-order integrators" not in "".join(reader.text)


def test_a_disagreement_comes_first(answer):
    class Faulty(type(backend_named("urdf"))):
        def emit(self, robot, program):
            return super().emit(replace(robot, gravity=(0.0, 0.0, 9.81)), program)

    wrong = agree("planar2r", [Faulty(), "mjcf"], quantities=["gravity", "mass_matrix"])
    text = " ".join(" ".join(read(agreement_page(wrong)).text).split())
    assert "they do not agree" in text and "gravity is (0, 0, 9.81) instead of (0, 0, -9.81)" in text
    assert text.index("gravity is (0, 0, 9.81)") < text.index("Every quantity")


def test_names_do_not_break_out(answer):
    evil = '<img src=x onerror="alert(1)">'
    changed = replace(
        answer, robot=evil, level=evil, notes=(evil,), left_out=(replace_omission(evil),), effects=(evil,)
    )
    html = agreement_page(changed)
    assert "<img src=x" not in html and html.count("&lt;img src=x") >= 4
    read(html)


def replace_omission(text):
    from mbexport.core.agreement import Omission

    return Omission(text, text, text)


def test_a_section_with_nothing_to_show_is_left_out():
    class Nothing(Section):
        template = "why.html.j2"

        def values(self):
            return {}

    assert "<section" not in page("nothing", [Nothing()])
