"""Of every effect: a law with its source, a check that owes nothing to our kernels, and a command line that runs it."""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from mbexport.core.agreement.samples import SAMPLED, sampled
from mbexport.core.cli import main
from mbexport.core.database import FrozenMap, load, write
from mbexport.core.effects import Law, built_in_names, effect_named, law_named
from mbexport.core.errors import PluginError

CHECKS = ("test_bodies_and_geometry.py", "test_elasticity.py", "test_friction.py", "test_motor_and_sensors.py")
# a year, or the paper
SOURCE = re.compile(r"\b(1[6-9]|20)\d\d\b|IMECE2013-64815")


@pytest.mark.parametrize("name", built_in_names())
def test_its_law_has_a_source(name):
    effect = effect_named(name)
    said = [type(effect).__doc__, *(law.function.__doc__ for law in effect.laws)]
    assert all(said) and any(SOURCE.search(text) for text in said)


def test_a_law_is_found_by_both_names_or_missed_by_them():
    assert law_named("coulomb_friction", "level").kind == "level"
    with pytest.raises(
        PluginError, match="'coulomb_friction' gives a drive the law 'torque', which it has not; its laws"
    ):
        law_named("coulomb_friction", "torque")
    with pytest.raises(PluginError, match="no effect 'sticky'"):
        law_named("sticky", "level")


@pytest.mark.parametrize(
    ("function", "reads"),
    [
        (lambda p, t, theta, dtheta, q, dq, load: p[0] * dtheta + theta, False),
        (lambda p, t, theta, dtheta, q, dq, load: p[0] * (q - p[1]), True),
        (lambda p, t, theta, dtheta, q, dq, load: q * dq, True),
        (lambda p, t, motor, turns, arm, moves, load: p[0] * (turns - moves), True),
    ],
)
def test_a_law_that_reads_the_arm_is_told_by_its_arguments_places(function, reads):
    assert Law("level", function).reads_arm == reads


@pytest.mark.parametrize("name", built_in_names())
def test_it_is_checked_against_equations_of_the_tests(name):
    text = "".join((Path(__file__).parent / file).read_text(encoding="utf-8") for file in CHECKS)
    # as a table of a robot: robot_with(..., name={...}) or {"name": {...}}
    assert re.search(rf'\b{name}=\{{|"{name}": \{{|\b{name}=table', text)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A database with every effect, each a level of its own, beside all of them at once."""
    base = load("planar2r")
    tables = {name: sampled(base, [name]).effects[name] for name in SAMPLED}
    # with joint_compliance the bearing has no spring about its axis
    tables["joint_compliance_6d"] = sampled(base, SAMPLED).effects["joint_compliance_6d"]
    path = tmp_path_factory.mktemp("robot") / "planar2r"
    write(replace(base, effects=FrozenMap(tables), levels=FrozenMap({name: (name,) for name in SAMPLED})), path)
    (path / "pd.yaml").write_text("control: {mode: pd, kp: [300, 100], kd: [15, 5], rate: 1000}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("level", [*SAMPLED, "full"])
def test_the_command_line_runs_it(folder, level, tmp_path, capsys):
    line = ["simulate", str(folder), "--level", level, "--backend", "urdf", "--motion", "hold", "--duration", "0.02"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for number, more in enumerate(([], ["--control", str(folder / "pd.yaml")])):
            try:
                main([*line, *more, "-o", str(tmp_path / f"run-{number}")])
            except SystemExit as end:
                assert not end.code
    told = capsys.readouterr()
    assert "Traceback" not in told.err + told.out
    assert all((tmp_path / f"run-{number}" / "data.csv").stat().st_size > 1000 for number in (0, 1))
