"""The rivals of the diagnosis get a fair chance: they find what they have a parameter for, and name no noise."""

from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.database import FrozenMap

from .pendulums import pendulum_run


@pytest.fixture(params=["rival_regressor", "rival_sysid"])
def rival(bank_module, request):
    if request.param == "rival_sysid":
        # what `mujoco[sysid]` brings beside mujoco
        pytest.importorskip("absl", reason="mujoco.sysid needs the extra `benchmarks`")
        pytest.importorskip("tabulate", reason="mujoco.sysid needs the extra `benchmarks`")
    return bank_module(request.param)


@pytest.fixture
def named(bank_module, rival):
    """What a rival names on two runs of the pendulum with a torque against its motion."""

    def names(**options):
        runs = tuple(pendulum_run(seed=seed, duration=2.0, **options) for seed in (1, 2))
        bare = replace(mbexport.load("pendulum"), effects=FrozenMap())
        return [number for number in rival.fitted(bank_module("given").known(bare, runs, ())) if number.named]

    return names


@pytest.mark.parametrize("mode", ["pd", "unknown"])
def test_a_friction_is_found(named, mode):
    (number,) = named(mode=mode, against=lambda t, q, dq: 0.4 * dq)
    assert (number.effect, number.joint) == ("viscous_friction", 1)
    assert number.value == pytest.approx(0.4, rel=0.05)


def test_noise_is_not_named(named):
    assert named() == []


def test_what_a_rival_found_is_simulated_where_no_fit_saw_it(bank_module):
    one, versus = bank_module("rival_regressor"), bank_module("head_to_head")
    runs = tuple(pendulum_run(seed=seed, duration=2.0, against=lambda t, q, dq: 0.4 * dq) for seed in (1, 2, 3))
    bare = replace(mbexport.load("pendulum"), effects=FrozenMap())
    known = bank_module("given").known(bare, runs[:2], runs[2:])
    said = versus.diagnosis(known, one.fitted(known), versus.unseen(known, {}))
    assert [(one["effect"], one["at"]) for one in said["which"]] == [("viscous_friction", "joint_1")]
    held = said["how_far"]["holdout"]
    assert held["shrinks_by"] > 0.95
    assert held["after"]["q"] < 0.1 * held["before"]["q"]


def test_least_squares_takes_no_column_that_is_not_there(bank_module):
    best = bank_module("rival_regressor").best
    random = np.random.default_rng(1)
    columns = random.normal(size=(400, 4))
    left = 0.5 * columns[:, 1] + 0.1 * random.normal(size=400)
    ((k, change, spread),) = best(columns, left, np.zeros(4))
    assert k == 1
    assert abs(change - 0.5) < 4.0 * spread < 0.05
    # friction that would drive the joint is none
    assert best(columns, -left, np.zeros(4)) == []


def test_the_table_counts_wrong_names_and_what_was_made_worse(bank_module):
    table, case = bank_module("head_to_head").table, bank_module("score").Case
    truth = {
        "case": {"class": "single"}, "strength": "strong", "robot": "scara", "numerical": None,
        "stated": [{"effect": "coulomb_friction", "at": "joint_1", "exact": True, "scored": True, "total": {}}],
        "sensors": {"colour": 0.0, "channels": ["q", "tau"]}, "control": {"mode": "pd"},
    }  # fmt: skip

    def answer(effect, after):
        found = {"effect": effect, "at": "joint_1", "parameters": {}}
        held = {"before": {"tau": 4.0}, "after": {"tau": after}, "noise": {"tau": 2.0}}
        return case("a", truth, {"verdict": "explained", "which": [found], "how_far": {"holdout": held}}, None, 1.0)

    lines = {one.name: one for one in table([answer("coulomb_friction", 2.0), answer("delay", 5.0)])}
    assert lines["single effect: it and its place named, and nothing else"].answers == [True, False]
    assert lines["single effect: a wrong name"].answers == [False, True]
    assert lines["... made worse on held-out runs: single effect"].answers == [False, True]
    assert lines["held-out torque error in units of noise, median: single effect"].text == "2.00 -> 1.75 (2)"
    assert lines["... where every rival has a parameter for it"].answers == [True, False]


def test_what_has_to_be_installed_is_said(bank_module, monkeypatch, tmp_path, capsys):
    """MuJoCo alone has an empty `sysid`."""
    module = bank_module("head_to_head")
    monkeypatch.setattr(module.rival_sysid, "is_there", lambda: False)
    monkeypatch.setattr("sys.argv", ["head_to_head.py", *map(str, (tmp_path, tmp_path, tmp_path))])
    with pytest.raises(SystemExit):
        module.main()
    assert "mbexport[benchmarks]" in capsys.readouterr().err


def test_a_table_is_written_of_what_is_there(bank_module, monkeypatch, tmp_path, capsys):
    """Of a bank without cases it has no rows."""
    module = bank_module("head_to_head")
    monkeypatch.setattr(module.rival_sysid, "is_there", lambda: True)
    for name in ("cases", "sealed"):
        (tmp_path / "bank" / name).mkdir(parents=True)
    monkeypatch.setattr("sys.argv", ["head_to_head.py", *(str(tmp_path / name) for name in ("bank", "out", "rivals"))])
    module.main()
    assert "0 cases with torque | mbexport | sysid | regressor" in capsys.readouterr().out
    assert (tmp_path / "rivals" / "head_to_head.json").is_file()
