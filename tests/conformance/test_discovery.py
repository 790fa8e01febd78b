"""Plugins of strangers: found without an import, listed with their reason where they are broken, harmless to others."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from mbexport.core import plugins
from mbexport.core.errors import PluginError
from mbexport.core.simulation import backend_named

BACKENDS, EFFECTS = plugins.BACKENDS, plugins.EFFECTS

GOOD_EFFECT = '''
from mbexport import Column, Effect, Law

def drag(p, t, theta, dtheta, q, dq, load):
    """p dtheta."""
    return p[0] * dtheta

class Drag(Effect):
    """A drag of one's own."""
    name = "{name}"
    key = "joint"
    columns = (Column("coefficient", "N*m*s/rad|N*s/m"),)
    laws = (Law("resistance", drag),)
'''
GOOD_BACKEND = """
from mbexport.backends.urdf import UrdfBackend

class Other(UrdfBackend):
    name = "{name}"
    engine = "Other"
"""
# module text, group, name, object; what its reason says
BROKEN = {
    "broken_import": ("import no_such_engine_anywhere\n", BACKENDS, "broken_import", "B", "no_such_engine_anywhere"),
    "broken_syntax": ("def (:\n", BACKENDS, "broken_syntax", "B", "SyntaxError"),
    "leaves": ("raise SystemExit(7)\n", BACKENDS, "leaves", "B", "SystemExit"),
    "no_class": ("B = 3\n", BACKENDS, "no_class", "B", "is no mbexport Backend"),
    "wrong_class": ("class B: pass\n", BACKENDS, "wrong_class", "B", "is no mbexport Backend"),
    "no_attribute": ("", BACKENDS, "no_attribute", "B", "AttributeError"),
    "abstract": ("from mbexport import Backend as B\n", BACKENDS, "abstract", "B", "cannot be made"),
    "misnamed": (GOOD_BACKEND.format(name="another"), BACKENDS, "misnamed", "Other", "calls itself 'another'"),
    "orderless": (GOOD_BACKEND.format(name="orderless") + "    order = 0\n", BACKENDS, "orderless", "Other", "order"),
    "ungraded": (
        GOOD_BACKEND.format(name="ungraded") + "    gate_class = 'C'\n",
        BACKENDS,
        "ungraded",
        "Other",
        "A or B",
    ),
    "engineless": (
        GOOD_BACKEND.format(name="engineless")
        + "    def version(self):\n        from importlib.metadata import version\n        return version('nowhere')\n",
        BACKENDS,
        "engineless",
        "Other",
        "PackageNotFoundError",
    ),
    "raises": ("raise RuntimeError('on a bad day')\n", EFFECTS, "raises", "E", "on a bad day"),
    "keyless": (GOOD_EFFECT.format(name="keyless") + "    key = 'wrist'\n", EFFECTS, "keyless", "Drag", "its key is"),
    "columnless": (
        GOOD_EFFECT.format(name="columnless") + "    columns = ['a']\n",
        EFFECTS,
        "columnless",
        "Drag",
        "tuple of Column",
    ),
    "kindless": (
        GOOD_EFFECT.format(name="kindless") + "    laws = (Law('heat', drag),)\n",
        EFFECTS,
        "kindless",
        "Drag",
        "of kind 'heat'",
    ),
}


def distribution(site: Path, name: str, points: Mapping[str, Mapping[str, str]], modules: Mapping[str, str]) -> None:
    """What an installer leaves of a distribution."""
    info = site / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [
        line for group, claims in points.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in claims.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    for module, text in modules.items():
        (site / f"{module}.py").write_text(text)


def one(site: Path, group: str, name: str, text: str, what: str) -> None:
    distribution(site, f"dist-{name}", {group: {name: f"{name}_module:{what}"}}, {f"{name}_module": text})


@pytest.fixture
def site(tmp_path, monkeypatch) -> Path:
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    return folder


def test_names_import_nothing(site):
    one(site, BACKENDS, "loud", "raise RuntimeError('imported')\n", "B")
    assert "loud" in plugins.names(BACKENDS)
    assert "loud_module" not in sys.modules


@pytest.mark.parametrize("case", [case for case, entry in BROKEN.items() if case != "engineless"])
def test_a_broken_plugin_is_one_clear_error(site, case):
    from mbexport.core.effects import effect_named

    text, group, name, what, says = BROKEN[case]
    one(site, group, name, text, what)
    with pytest.raises(PluginError, match=name) as caught:
        (backend_named if group == BACKENDS else effect_named)(name)
    assert says in str(caught.value)


def test_the_cause_is_chained(site):
    one(site, BACKENDS, "chained", "import no_such_engine_anywhere\n", "B")
    with pytest.raises(PluginError, match=r"dist-chained 1\.0, chained_module:B") as caught:
        plugins.load(BACKENDS, "chained")
    assert isinstance(caught.value.__cause__, ModuleNotFoundError)


def test_a_missing_plugin_is_told_with_what_there_is():
    with pytest.raises(PluginError, match="did you mean 'mjcf'") as caught:
        plugins.load(BACKENDS, "mjfc")
    assert "urdf" in str(caught.value)


def test_a_target_that_is_none(site):
    distribution(site, "dist-garbled", {BACKENDS: {"garbled": "no target!"}}, {})
    with pytest.raises(PluginError, match="garbled"):
        plugins.load(BACKENDS, "garbled")


def test_two_strangers_that_claim_one_name_are_both_told(site):
    for owner in ("first", "second"):
        distribution(
            site,
            owner,
            {BACKENDS: {"coveted": f"{owner}_m:Other"}},
            {f"{owner}_m": GOOD_BACKEND.format(name="coveted")},
        )
    with pytest.raises(PluginError, match=r"first 1\.0 \(first_m:Other\) and second 1\.0 \(second_m:Other\)"):
        plugins.load(BACKENDS, "coveted")
    told = [report for report in plugins.report(BACKENDS) if report.name == "coveted"]
    assert [report.distribution for report in told] == ["first 1.0", "second 1.0"]
    assert all("claimed by" in (report.problem or "") for report in told)


def test_one_distribution_seen_twice_is_no_rival(site, tmp_path, monkeypatch):
    for folder in (site, tmp_path / "again"):
        distribution(
            folder, "twice", {BACKENDS: {"twice": "twice_m:Other"}}, {"twice_m": GOOD_BACKEND.format(name="twice")}
        )
        monkeypatch.syspath_prepend(folder)
    assert plugins.load(BACKENDS, "twice").name == "twice"


def test_a_builtin_backend_keeps_its_name(site):
    distribution(
        site, "aaa-usurper", {BACKENDS: {"urdf": "usurper:Other"}}, {"usurper": "raise RuntimeError('imported')\n"}
    )
    assert plugins.load(BACKENDS, "urdf").__module__ == "mbexport.backends.urdf"
    told = {report.distribution: report.problem for report in plugins.report(BACKENDS) if report.name == "urdf"}
    assert "the built-in one is used" in told["aaa-usurper 1.0"]
    assert [problem for owner, problem in told.items() if owner.startswith("mbexport ")] == [None]
    assert "usurper" not in sys.modules


def test_a_builtin_effect_keeps_its_name(site):
    from mbexport.core.effects import effect_named, effect_reports

    distribution(site, "thief", {EFFECTS: {"delay": "thief_m:Drag"}}, {"thief_m": GOOD_EFFECT.format(name="delay")})
    assert type(effect_named("delay")).__module__ == "mbexport.core.effects.delay"
    (told,) = [report for report in effect_reports() if report.name == "delay"]
    assert "built in" in told.problem


def test_metadata_that_cannot_be_read_hides_no_other(site):
    one(site, BACKENDS, "healthy", GOOD_BACKEND.format(name="healthy"), "Other")
    distribution(site, "garbage", {BACKENDS: {"x": "y:z"}}, {})
    (site / "garbage-1.0.dist-info" / "entry_points.txt").write_text(f"[{BACKENDS}]\nnot an entry point\n")
    assert "healthy" in plugins.names(BACKENDS)
    assert backend_named("healthy").engine == "Other"
    (told,) = [report for report in plugins.report(BACKENDS) if report.distribution == "garbage 1.0"]
    assert "entry_points.txt" in told.problem


def test_a_distribution_without_metadata(site):
    one(site, BACKENDS, "nameless", GOOD_BACKEND.format(name="nameless"), "Other")
    (site / "dist_nameless-1.0.dist-info" / "METADATA").unlink()
    assert backend_named("nameless").engine == "Other"
    assert any(report.name == "nameless" and report.problem is None for report in plugins.report(BACKENDS))


def test_a_robot_whose_effect_is_broken_says_why(site, tmp_path):
    from mbexport.core.database import load
    from mbexport.core.errors import DatabaseError

    one(site, EFFECTS, "sour", "raise RuntimeError('went sour')\n", "E")
    robot = tmp_path / "robot"
    (robot / "effects").mkdir(parents=True)
    (robot / "robot.yaml").write_text("name: small\n")
    (robot / "kinematics.dat").write_text("arm alpha a theta d\n1 0 1 0 0\n")
    (robot / "inertia.dat").write_text("arm mass x y z Ixx Iyy Izz\n1 1 0 0 0 1 1 1\n")
    load(robot)
    (robot / "effects" / "sour.dat").write_text("joint a\n1 1\n")
    with pytest.raises(DatabaseError, match="went sour"):
        load(robot)


def test_the_program_lists_all_and_works(tmp_path):
    """Everything at once, as a user has it: a healthy plugin, every broken one, rivals, and the built-in ones."""
    site = tmp_path / "site"
    for text, group, name, what, _ in BROKEN.values():
        one(site, group, name, text, what)
    one(site, BACKENDS, "healthy", GOOD_BACKEND.format(name="healthy"), "Other")
    one(site, EFFECTS, "drag", GOOD_EFFECT.format(name="drag"), "Drag")
    distribution(
        site,
        "usurper",
        {BACKENDS: {"urdf": "usurper:Other"}, EFFECTS: {"coulomb_friction": "usurper:E"}},
        {"usurper": "raise SystemExit(3)\n"},
    )
    listed = _mbexport(site, "list", "backends", "--json")
    rows = {(row["name"], row["distribution"]): row for row in json.loads(listed)["backends"]}
    assert rows["healthy", "dist-healthy 1.0"]["engine"] == "Other"
    assert "built in" in rows["urdf", "usurper 1.0"]["problem"]
    own = {name for (name, owner), row in rows.items() if owner.startswith("mbexport ") and "problem" not in row}
    assert {"urdf", "mjcf", "exudyn", "pybullet"} <= own
    effects = json.loads(_mbexport(site, "list", "effects", "--json"))["effects"]
    assert next(row for row in effects if row["name"] == "drag")["law"] == "A drag of one's own."
    assert len([row for row in effects if row["name"] == "coulomb_friction"]) == 2
    for case, (_, group, name, _, says) in BROKEN.items():
        among = rows.values() if group == BACKENDS else effects
        (row,) = [row for row in among if row["name"] == name]
        assert says in row["problem"], case
    _mbexport(site, "--to", "urdf", "--to", "healthy", "planar2r", "-o", tmp_path / "out")
    assert (tmp_path / "out" / "urdf" / "planar2r.urdf").is_file()


def _mbexport(site: Path, *words: object) -> str:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, "-c", "from mbexport.core.cli import main; main()", *map(str, words)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout
