"""Parts of a run: what leads up to one acts on in it, and is compared nowhere."""

from dataclasses import replace

import numpy as np
import pytest
from pendulums import pendulum_run, soft_run

from mbexport.core.database import load
from mbexport.core.diagnosis.blocks import Blocks
from mbexport.core.diagnosis.compared import compared, residuals
from mbexport.core.diagnosis.gap import gap_of
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.resimulate import resimulated_once
from mbexport.core.diagnosis.unseen import in_parts
from mbexport.core.effects import EffectRow

PENDULUM = load("pendulum")
# away from a part's begin no filter feels what was before it [s]
AWAY = 0.5


def spoiled(run):
    """The run with torques far off long before what is compared."""
    tau = run.signals["tau"].copy()
    tau[run.t < run.since - AWAY] += 30.0
    return replace(run, signals={**run.signals, "tau": tau})


def robot(run):
    return robot_of(PENDULUM, "rigid", run)


def left_of(run):
    return residuals(run, resimulated_once(robot(run), robot(run), run, "mjcf"), robot(run))


def gap(run):
    return gap_of([left_of(run)], [noise_floor(PENDULUM, "rigid", run)], [run], robot(run))


@pytest.mark.parametrize("mode", ["pd", "motion", "torque", "unknown"])
def test_what_leads_up_to_a_part_is_not_compared(mode):
    part = in_parts(pendulum_run(mode, seed=1))[2]
    loud = spoiled(part)
    one, other = (problem(PENDULUM, "rigid", [run]) for run in (part, loud))
    assert np.abs(one.residual({}) - other.residual({})).max() < 1e-3
    for values in compared(loud, robot(loud)).values():
        assert np.isnan(values[~part.judged]).all()
        assert np.isfinite(values[part.judged]).any()
    before, after = gap(part), gap(loud)
    assert after.chance == pytest.approx(before.chance, rel=1e-3)
    assert [band.share for band in after.where.bands] == pytest.approx([band.share for band in before.where.bands])


def test_a_part_that_is_cut_itself_keeps_what_is_others_to_judge():
    first, second = in_parts(pendulum_run(seed=1, duration=1.8))
    inner = in_parts(second)
    assert sum(int(part.judged.sum()) for part in inner) == second.judged.sum()
    rows = np.concatenate([part.signals["tau"][part.judged] for part in inner])
    assert np.array_equal(rows, second.signals["tau"][second.judged])
    assert not np.isin(first.signals["tau"], rows).any()


def test_a_part_has_as_many_blocks_of_time_as_it_lasts():
    part = in_parts(pendulum_run(seed=1))[2]
    blocks = Blocks.of([left_of(part)], [noise_floor(PENDULUM, "rigid", part)], [part])
    lengths = blocks.each.counts["q"][:, 0]
    assert lengths.sum() == part.judged.sum()
    assert lengths.max() - lengths.min() <= 2


def test_a_part_rings_on_as_the_whole_run_does():
    """Begun at rest it would not: what is left then is many times the noise."""
    part = in_parts(soft_run(60.0, 0.01))[2]
    alone = replace(
        part,
        t=part.t[part.judged] - part.since,
        signals={name: values[part.judged] for name, values in part.signals.items()},
        since=0.0,
    )
    springs = {"joint_compliance": (EffectRow(1, {"stiffness": 60.0, "damping": 0.01}),)}
    on, anew = (np.mean(problem(PENDULUM, "rigid", [run]).residual(springs) ** 2) for run in (part, alone))
    assert on < 1.0
    assert anew > 1000.0
