"""How far a gap shrinks, on a pendulum that rubs and whose gains are not what they should be."""

from __future__ import annotations

import numpy as np
import pytest
from pendulums import pendulum_run

from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis.how_far import Fold, how_far
from mbexport.core.diagnosis.search import Found
from mbexport.core.effects import EffectRow

DATABASE = load("pendulum")
RUN = pendulum_run("pd", lambda t, q, dq: 0.4 * dq + 0.25 * np.tanh(dq / 2e-3))


def found(effect, **values):
    return Found(effect, 1, EffectRow(1, FrozenMap(values)), 0.0)


VISCOUS, DRY = found("viscous_friction", coefficient=0.4), found("coulomb_friction", torque=0.25)


def test_the_right_effects_take_the_gap_and_each_its_part():
    answer, overlays = how_far(DATABASE, "rigid", [Fold((VISCOUS, DRY), (RUN,))], "mjcf", ("mjcf", "urdf"))
    assert answer.shrinks_by == pytest.approx(1.0, abs=0.05)
    assert answer.ci95 is not None and answer.ci95[0] <= answer.shrinks_by <= answer.ci95[1]
    assert [one.effect for one in answer.by_effect] == ["viscous_friction", "coulomb_friction"]
    assert sum(one.shrinks_by for one in answer.by_effect) == pytest.approx(answer.shrinks_by)
    assert all(one.shrinks_by > 0.2 for one in answer.by_effect)
    assert answer.backends["urdf"] == pytest.approx(answer.backends["mjcf"], abs=1e-3)
    # without the last one there is what the first one took
    assert answer.without["coulomb_friction joint_1"] == pytest.approx(answer.by_effect[0].shrinks_by)
    assert answer.without["viscous_friction joint_1"] < answer.shrinks_by - 0.2
    assert answer.before["q"] > 20.0 * answer.noise["q"]
    # its friction begins to hold otherwise than ours
    assert answer.after["q"] < 5.0 * answer.noise["q"]
    (overlay,) = overlays
    assert overlay.held_out
    assert (
        np.abs(overlay.measured["q"] - overlay.before["q"]).max()
        > np.abs(overlay.measured["q"] - overlay.after["q"]).max()
    )


def test_a_wrong_effect_makes_it_worse_and_says_so():
    answer, _ = how_far(DATABASE, "rigid", [Fold((found("viscous_friction", coefficient=3.0),), (RUN,))], "mjcf")
    assert answer.shrinks_by is not None and answer.shrinks_by < 0.0


def test_no_gap_does_not_shrink():
    quiet = pendulum_run("pd", seed=4)
    answer, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS,), (quiet,))], "mjcf")
    assert answer.shrinks_by is None
    assert answer.ci95 is None
    assert answer.by_effect == ()


def test_an_engine_that_refuses_is_named():
    answer, _ = how_far(DATABASE, "rigid", [Fold((VISCOUS, DRY), (RUN,))], "mjcf", ("mjcf", "adams"))
    assert set(answer.refused) == {"adams"}
    assert answer.refused["adams"]


def test_a_part_of_the_findings_that_cannot_be_simulated_costs_no_answer(monkeypatch):
    """Dry friction alone is refused here; its share is in that of both."""
    from mbexport.core.diagnosis import how_far as module
    from mbexport.core.errors import RefusedError

    real = module.resimulated

    def refusing(robot, *rest):
        if robot.effects == ("coulomb_friction",):
            raise RefusedError("the motion is no longer finite")
        return real(robot, *rest)

    monkeypatch.setattr(module, "resimulated", refusing)
    answer, _ = how_far(DATABASE, "rigid", [Fold((DRY, VISCOUS), (RUN,))], "mjcf")
    assert answer.shrinks_by == pytest.approx(1.0, abs=0.05)
    assert [one.shrinks_by for one in answer.by_effect] == pytest.approx([0.0, answer.shrinks_by])
    assert answer.without["viscous_friction joint_1"] is None
    assert answer.without["coulomb_friction joint_1"] is not None
