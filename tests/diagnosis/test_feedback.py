"""What a controller makes of its sensors' noise, against pendulums whose controller does or does not hear it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import noisy_loop

from mbexport.core.database import load
from mbexport.core.diagnosis.evidence import gather
from mbexport.core.diagnosis.feedback import followed, hears, sensors_alone, told
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.sensed import noise_in
from mbexport.core.recording.noise import known_together, noise_of

DATABASE = load("pendulum")
# speeds shake the torque more than its sensor does
SIGMA = {"q": 5.0e-6, "dq": 0.02, "tau": 0.03}


def test_a_torque_follows_the_noise_that_its_controller_hears():
    assert followed(noisy_loop(SIGMA)) == pytest.approx([1.0], abs=0.1)
    assert followed(noisy_loop(SIGMA, heard=False)) == pytest.approx([0.0], abs=0.1)
    assert told(noisy_loop(SIGMA, heard=False)) is None
    run = noisy_loop(SIGMA)
    without = replace(run, signals={name: values for name, values in run.signals.items() if name != "dq"})
    assert followed(without) is None


def test_an_arm_that_rings_hears_no_noise():
    """Its torque follows what is recorded, too: all of a motion that is there, and nothing of the sensors' noise."""
    run = noisy_loop({"q": 5.0e-6, "dq": 0.001, "tau": 0.03}, heard=False)
    turn = 2.0 * np.pi * 0.4 * 0.5 * run.rate
    rings = (1.0e-4 * np.exp(-run.t) * np.sin(turn * run.t))[:, None]
    faster = np.gradient(rings[:, 0], run.t)[:, None]
    moved = {"q": rings, "dq": faster, "tau": -run.control.kp[0] * rings - run.control.kd[0] * faster}
    shaken = replace(run, signals={name: values + moved.get(name, 0.0) for name, values in run.signals.items()})
    assert np.std(moved["tau"]) > 3.0 * np.std(np.array(run.control.kd) * 0.001)
    assert hears(shaken) == pytest.approx(0.0, abs=0.2)
    assert told(shaken) is None


def test_a_controller_hears_all_its_sensors_or_none():
    runs = [noisy_loop(SIGMA, heard=seed == 0, seed=seed) for seed in range(3)]
    assert told(runs[0]) is not None
    # its runs beside it know better: what looks so in one alone is something else
    assert told(known_together(runs)[0]) is None


def test_a_torque_that_is_many_times_what_feedback_makes_is_another():
    run = noisy_loop(SIGMA)
    louder = replace(run, signals={**run.signals, "tau": 10.0 * run.signals["tau"]})
    assert hears(louder) == pytest.approx(10.0, abs=1.0)
    assert told(louder) is None


def test_a_torque_has_its_steps_without_what_its_loop_scatters_too():
    """They are most of a slow sensor's high band: it was taken for white."""
    step = 0.5 * SIGMA["tau"]
    run = noisy_loop(SIGMA)
    rounded = replace(run, signals={**run.signals, "tau": np.round(run.signals["tau"] / step) * step})
    alone = sensors_alone(rounded)
    assert np.std(alone.signals["tau"] - rounded.signals["tau"]) > step
    assert noise_of(alone, "tau").step == pytest.approx([step])


def test_a_torque_sensor_is_known_behind_what_its_loop_scatters():
    run = noisy_loop(SIGMA)
    assert noise_in(replace(run, noise={}), "tau").sigma == pytest.approx([SIGMA["tau"]], rel=0.1)
    left = sensors_alone(run).signals["tau"][:, 0]
    assert np.std(np.diff(left, 4)) == pytest.approx(np.sqrt(70.0) * SIGMA["tau"], rel=0.05)


@pytest.mark.parametrize(("every", "off"), [(1, 0.25), (2, 0.25), (4, 0.6)])
@pytest.mark.parametrize("heard", [True, False])
def test_a_perfect_model_leaves_noise_of_unit_size(every, off, heard):
    runs = [noisy_loop(SIGMA, heard=heard, every=every, seed=seed) for seed in range(4)]
    evidence = gather(runs, [robot_of(DATABASE, "rigid", run) for run in runs])
    left = evidence.residual(evidence.nominals)
    for signal in ("tau", "u"):
        found = np.concatenate([left[c.first : c.last] for c in evidence.channels if c.signal == signal])
        assert np.mean(found**2) == pytest.approx(1.0, abs=off)
