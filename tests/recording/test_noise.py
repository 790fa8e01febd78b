"""Noise under a motion: its size, colour and quantisation, from records whose noise is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from mbexport.core.control import Control
from mbexport.core.recording import Run, known_together, noise_of
from mbexport.core.recording.noise import quantisation

RATE = 1000.0
SIGMA = {"q": 2.0e-5, "tau": 0.5}
SEEDS = range(3)


def swing(t, random):
    return sum(random.normal() / k * np.sin(0.4 * np.pi * k * t + random.uniform(0.0, 6.0)) for k in range(1, 6))


def triangle(t, random):
    """Constant speed with sharp reversals."""
    period, width = random.uniform(0.8, 2.5), 30
    sign = np.where((t / period) % 1.0 < 0.5, 1.0, -1.0)
    blended = np.convolve(np.pad(sign, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), "valid")
    return np.cumsum(1.5 * blended) / RATE


def point_to_point(t, random):
    q, last = [], 0.0
    while sum(map(len, q)) < len(t):
        s = np.linspace(0.0, 1.0, int(random.uniform(0.4, 1.2) * RATE))
        goal = random.uniform(-1.0, 1.0)
        rest = np.full(int(random.uniform(0.0, 0.3) * RATE), goal)
        q += [last + (goal - last) * (10 * s**3 - 15 * s**4 + 6 * s**5), rest]
        last = goal
    return np.concatenate(q)[: len(t)]


def coloured(m, slope, random):
    """AR(1) noise of variance 1."""
    return lfilter([np.sqrt(1.0 - slope**2)], [1.0, -slope], random.normal(size=m + 500))[500:]


def memory(ar):
    """Correlation of an autoregression with itself a sample later."""
    x = lfilter([1.0], np.concatenate([[1.0], -ar]), np.concatenate([[1.0], np.zeros(5000)]))
    return (x[1:] @ x[:-1]) / (x @ x)


def recorded(motion, slope=0.0, step=0.0, seed=0, duration=8.0):
    """A run of two joints whose friction jumps at reversals, with noise; `step` in sigmas."""
    random = np.random.default_rng(seed)
    t = np.arange(int(duration * RATE)) / RATE
    signals = {"q_cmd": [], "q": [], "tau": []}
    for _ in range(2):
        q = motion(t, random)
        dq = np.gradient(q, t)
        tau = 5.0 * np.gradient(dq, t) + 30.0 * np.cos(q) + 12.0 * np.tanh(dq / 1e-3) + 8.0 * dq
        signals["q_cmd"].append(q)
        for name, value in (("q", lfilter([0.05], [1.0, -0.95], q - q[0]) + q[0]), ("tau", tau)):
            noisy = value + SIGMA[name] * coloured(len(t), slope, random)
            size = step * SIGMA[name]
            signals[name].append(np.round(noisy / size) * size if size else noisy)
    return run_of(t, {name: np.column_stack(values) for name, values in signals.items()})


def run_of(t, signals, noise=None):
    return Run("run", t, signals, Control("pd"), noise or {}, (), {}, "", (), RATE)


@pytest.mark.parametrize("motion", [swing, triangle, point_to_point])
@pytest.mark.parametrize("step", [0.0, 1.0])
def test_white_noise_within_a_tenth(motion, step):
    runs = [recorded(motion, step=step, seed=seed) for seed in SEEDS]
    for name, sigma in SIGMA.items():
        found = [noise_of(run, name) for run in runs]
        sizes = np.concatenate([noise.sigma for noise in found]) / sigma / np.sqrt(1.0 + step**2 / 12.0)
        for noise in found:
            assert noise.step == pytest.approx(step * sigma, rel=1e-6)
            assert not noise.stated
        assert np.median(sizes) == pytest.approx(1.0, abs=0.03)
        assert np.quantile(np.abs(sizes - 1.0), 0.8) < 0.1


@pytest.mark.parametrize("motion", [swing, triangle, point_to_point])
@pytest.mark.parametrize("step", [0.0, 0.5])
def test_slow_noise_within_a_fifth(motion, step):
    runs = [recorded(motion, 0.95, step, seed) for seed in SEEDS]
    for name, sigma in SIGMA.items():
        found = [noise_of(run, name) for run in runs]
        sizes = np.concatenate([noise.sigma for noise in found]) / sigma / np.sqrt(1.0 + step**2 / 12.0)
        assert np.median(sizes) == pytest.approx(1.0, abs=0.2)
        if step == 0.0:
            assert np.median([memory(noise.ar[0]) for noise in found]) == pytest.approx(0.95, abs=0.04)


def stirred(run, seed, loud=4.0):
    """The run with what its motion stirs up in the torque, slow and loud."""
    random = np.random.default_rng(seed)
    loud = loud * SIGMA["tau"] * np.column_stack([coloured(len(run.t), 0.97, random) for _ in range(2)])
    return run_of(run.t, {**run.signals, "tau": run.signals["tau"] + loud})


def test_a_sensor_that_is_white_in_one_run_is_white_in_another():
    calm, other = recorded(swing, seed=1), stirred(recorded(swing, seed=2), 3)
    assert (noise_of(other, "tau").sigma > 2.0 * SIGMA["tau"]).all()
    for one in known_together([calm, other]):
        np.testing.assert_allclose(noise_of(one, "tau").sigma, SIGMA["tau"], rtol=0.1)
        assert np.abs(noise_of(one, "tau").ar).sum(axis=1).max() < 0.2


def test_a_stated_size_says_nothing_of_colour_and_a_run_that_is_white_does():
    stated = {"tau": np.full(2, SIGMA["tau"])}
    calm, other = recorded(swing, seed=1), stirred(recorded(swing, seed=2), 3, 1.0)
    runs = [replace(one, noise=stated) for one in (calm, other)]
    assert noise_of(runs[1], "tau").slow.all()
    for one in known_together(runs):
        assert not noise_of(one, "tau").slow.any()
        np.testing.assert_array_equal(noise_of(one, "tau").sigma, stated["tau"])


def test_of_three_runs_that_draw_on_slow_noise_the_one_in_the_middle_knows_it():
    runs = [recorded(swing, 0.95, seed=seed) for seed in (1, 4)]
    louder = stirred(recorded(swing, 0.95, seed=2), 3, 1.5)
    *_, told = known_together([*runs, louder])
    assert (noise_of(louder, "tau").sigma > 1.5 * SIGMA["tau"]).all()
    np.testing.assert_allclose(noise_of(told, "tau").sigma, SIGMA["tau"], rtol=0.3)
    # but what is far louder in two of them is their motions'
    far = [stirred(recorded(swing, 0.95, seed=seed), seed + 9, 8.0) for seed in (3, 4)]
    *_, quiet = known_together([*far, runs[0]])
    np.testing.assert_allclose(noise_of(quiet, "tau").sigma, SIGMA["tau"], rtol=0.3)


def test_runs_beside_each_other_tell_a_slow_colour_better():
    alone, together = [], []
    for first in range(0, 18, 3):
        long = [recorded(swing, 0.95, seed=first + k) for k in range(3)]
        runs = [run_of(run.t[:1000], {name: x[:1000] for name, x in run.signals.items()}) for run in long]
        for one, other in zip(runs, known_together(runs), strict=True):
            for name, sigma in SIGMA.items():
                alone += np.log(noise_of(one, name).sigma / sigma).tolist()
                together += np.log(noise_of(other, name).sigma / sigma).tolist()
    assert np.std(together) < 0.8 * np.std(alone)
    assert abs(np.mean(together)) < 0.15


def test_what_is_slow_in_all_runs_stays_slow_and_other_gains_are_other_loops():
    slow, slower = recorded(swing, 0.95, seed=1), stirred(recorded(swing, 0.95, seed=2), 3, 1.5)
    _, together = known_together([slow, slower])
    alone = noise_of(slower, "tau").sigma
    np.testing.assert_allclose(noise_of(together, "tau").sigma, alone, rtol=0.3)
    assert (noise_of(together, "tau").sigma > 1.3 * noise_of(slow, "tau").sigma).all()
    # but what is far louder than it is elsewhere is its motion's
    quiet, louder = known_together([slow, stirred(recorded(swing, 0.95, seed=2), 3, 6.0)])
    np.testing.assert_allclose(noise_of(louder, "tau").sigma, noise_of(quiet, "tau").sigma, rtol=0.3)
    assert memory(noise_of(louder, "tau").ar[0]) == pytest.approx(0.95, abs=0.04)
    stiff = replace(recorded(swing, seed=1), control=Control("pd", kp=(9.0, 9.0), kd=(1.0, 1.0)))
    _, alone = known_together([stiff, stirred(recorded(swing, seed=2), 3)])
    assert alone.beside == ()


def test_the_colour_whitens():
    """What the model predicts is taken out: the innovations of a resting sensor have no memory."""
    random = np.random.default_rng(3)
    t = np.arange(8000) / RATE
    x = lfilter([1.0], [1.0, -0.6, -0.2], random.normal(size=8000))
    run = run_of(t, {"q": np.column_stack([x, random.normal(size=8000)])})
    noise = noise_of(run, "q")
    innovations = lfilter(np.concatenate([[1.0], -noise.ar[0]]), [1.0], x)[50:]
    left = [np.corrcoef(innovations[:-k], innovations[k:])[0, 1] for k in range(1, 6)]
    assert np.abs(left).max() < 0.05
    assert noise.sigma[0] == pytest.approx(x.std(), rel=0.1)
    assert not noise.ar[1].any()


def at_five_hertz(noise, channel):
    """Power density of an estimated channel near 5 Hz."""
    impulse = np.concatenate([[1.0], np.zeros(5000)])
    answer = lfilter([1.0], np.concatenate([[1.0], -noise.ar[channel]]), impulse)
    turn = np.exp(-2j * np.pi * 5.0 / RATE * np.arange(len(answer)))
    return noise.sigma[channel] ** 2 * abs(answer @ turn) ** 2 / (answer @ answer)


@pytest.mark.parametrize("step", [0.0, 2.0])
def test_slow_noise_is_known_where_motions_are(step):
    """Below the frequencies at which it is seen, what a coarse sensor rounds away included."""
    true = (1.0 - 0.95**2) / abs(1.0 - 0.95 * np.exp(-2j * np.pi * 5.0 / RATE)) ** 2
    ratios = []
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        t = np.arange(4000) / RATE
        motion = np.column_stack([np.sin((1.0 + 0.1 * k) * t) for k in range(6)])
        noisy = motion + 1e-4 * np.column_stack([coloured(4000, 0.95, random) for _ in range(6)])
        if step:
            noisy = np.round(noisy / (step * 1e-4)) * step * 1e-4
        noise = noise_of(run_of(t, {"q_cmd": motion, "q": noisy}), "q")
        ratios += [at_five_hertz(noise, k) / (1e-8 * (true + step**2 / 12.0)) for k in range(6)]
    assert 0.6 < np.median(ratios) < 1.6
    assert np.quantile(ratios, 0.05) > 0.4


@pytest.mark.parametrize(("motion", "step"), [(point_to_point, 0.0), (point_to_point, 1.0), (swing, 0.0), (swing, 1.0)])
def test_a_known_size_tells_the_colour(motion, step):
    """Where motions are, noise is known to a fifth of its power: what is seen above them is its only free part."""
    true = (1.0 - 0.95**2) / abs(1.0 - 0.95 * np.exp(-2j * np.pi * 5.0 / RATE)) ** 2 + step**2 / 12.0
    for seed in SEEDS:
        run = recorded(motion, 0.95, step, seed)
        whole = np.hypot(1.0, step / np.sqrt(12.0))
        noise = {name: np.full(2, whole * sigma) for name, sigma in SIGMA.items()}
        for name, sigma in SIGMA.items():
            found = noise_of(run_of(run.t, run.signals, noise), name)
            assert [at_five_hertz(found, k) for k in range(2)] == pytest.approx([sigma**2 * true] * 2, rel=0.2)


@pytest.mark.parametrize("size", [0.0, 3.0, 30.0])
def test_steps_that_slow_noise_rarely_crosses_make_it_no_less_slow(size):
    """What coarse steps make of it is not white, so that its high frequencies lack what white steps would have."""
    true = (1.0 - 0.95**2) / abs(1.0 - 0.95 * np.exp(-2j * np.pi * 5.0 / RATE)) ** 2 + 2.0**2 / 12.0
    stated = {"tau": np.full(3, np.hypot(1.0, 2.0 / np.sqrt(12.0)))}
    ratios = []
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        t = np.arange(4000) / RATE
        q = np.sin(np.outer(t, [2.0, 2.1, 2.2]))
        noisy = size * np.cos(2.0 * t)[:, None] + np.column_stack([coloured(4000, 0.95, random) for _ in range(3)])
        run = run_of(t, {"q_cmd": q, "q": q, "tau": 2.0 * np.round(noisy / 2.0)}, stated)
        ratios += [at_five_hertz(noise_of(run, "tau"), k) / true for k in range(3)]
    assert 0.6 < np.median(ratios) < 1.4
    assert min(ratios) > 0.4


@pytest.mark.parametrize("wrong", [0.4, 3.0])
def test_a_stated_size_that_the_record_contradicts_makes_white_noise_no_slower(wrong):
    run = recorded(swing)
    stated = {name: np.full(2, wrong * sigma) for name, sigma in SIGMA.items()}
    for name in SIGMA:
        found = noise_of(run_of(run.t, run.signals, stated), name)
        assert found.sigma == pytest.approx(stated[name])
        assert not found.slow.any()


def test_a_channel_of_another_colour_keeps_its_own():
    random = np.random.default_rng(5)
    t = np.arange(4000) / RATE
    motion = np.sin(np.outer(t, [1.0, 1.1, 1.2, 1.3]))
    slow = [coloured(4000, 0.95, random) for _ in range(3)]
    q = motion + 1e-4 * np.column_stack([*slow, random.normal(size=4000)])
    noise = noise_of(run_of(t, {"q_cmd": motion, "q": q}), "q")
    assert np.abs(noise.ar[3]).max() < 0.2
    assert noise.ar[:3, 0].min() > 0.85


def test_a_stated_sigma_is_kept_and_its_colour_estimated():
    run = recorded(swing, 0.95)
    stated = run_of(run.t, run.signals, {"tau": np.array([0.7, 0.8])})
    noise = noise_of(stated, "tau")
    assert noise.stated
    assert noise.sigma.tolist() == [0.7, 0.8]
    assert noise.ar[0, 0] > 0.8
    coarse = run_of(
        run.t, {**run.signals, "tau": np.round(run.signals["tau"] / 6.0) * 6.0}, {"tau": np.array([0.7] * 2)}
    )
    assert noise_of(coarse, "tau").sigma == pytest.approx([6.0 / np.sqrt(12.0)] * 2)


def test_a_resting_coarse_sensor_has_its_steps_noise():
    t = np.arange(4000) / RATE
    q = np.round(np.column_stack([0.3 * np.sin(2 * t) * (t < 1.0), np.sin(t)]) / 1e-3) * 1e-3
    noise = noise_of(run_of(t, {"q": q}), "q")
    assert noise.step == pytest.approx(1e-3, rel=1e-6)
    assert (noise.sigma >= 1e-3 / np.sqrt(12.0)).all()
    assert (noise.sigma < 1.5e-3 / np.sqrt(12.0)).all()


def test_a_fast_motion_hides_no_steps():
    random = np.random.default_rng(5)
    t = np.arange(1000) / 250.0
    fast = 1.2 * np.sin(2.0 * t) + 0.4 * np.sin(7.0 * t)
    rough = np.round((fast + 1e-5 * random.normal(size=len(t))) / 1e-5) * 1e-5
    assert np.quantile(np.diff(np.unique(rough)), 0.02) > 1.5e-5
    assert quantisation(rough) == pytest.approx(1e-5, rel=1e-6)
    assert quantisation(fast + 1e-5 * random.normal(size=len(t))) == 0.0


def test_a_ramp_at_one_speed_is_no_quantisation():
    random = np.random.default_rng(1)
    ramp = 2.0 * np.arange(150) / 250.0
    assert quantisation(ramp + 1e-5 * random.normal(size=len(ramp))) == 0.0
    # as it is of one that stays at values or leaps over some
    assert quantisation(np.round(ramp / 0.01) * 0.01) == pytest.approx(0.01)
    assert quantisation(np.round(ramp / 0.005) * 0.005) == pytest.approx(0.005)


def test_without_noise_there_is_next_to_none():
    run = recorded(swing)
    smooth = run_of(run.t, {"q_cmd": run.signals["q_cmd"], "q": run.signals["q_cmd"]})
    assert (noise_of(smooth, "q").sigma < 1e-7).all()


def test_lost_samples_and_missing_channels_do_not_matter():
    run = recorded(swing)
    tau = run.signals["tau"].copy()
    tau[1000:1500, 0] = np.nan
    tau[::777, 0] = np.nan
    tau[:, 1] = np.nan
    noise = noise_of(run_of(run.t, {**run.signals, "tau": tau}), "tau")
    assert noise.sigma[0] == pytest.approx(0.5, rel=0.1)
    assert noise.sigma[1] == 0.0


@pytest.mark.parametrize("motion", [swing, triangle])
@pytest.mark.parametrize("slope", [0.0, 0.95])
@pytest.mark.parametrize("uneven", ["rows missing", "sampled unevenly"])
def test_steps_of_time_that_differ_are_no_noise(motion, slope, uneven):
    """A row of twelve is missing, or samples are taken up to a third of a step early or late."""
    for seed in SEEDS:
        random = np.random.default_rng(100 + seed)
        fine = recorded(motion, seed=seed)
        if uneven == "rows missing":
            there = random.uniform(size=len(fine.t)) > 1.0 / 12.0
            t, clean = fine.t[there], fine.signals["q_cmd"][there]
        else:
            t = fine.t + random.uniform(-0.3, 0.3, len(fine.t)) / RATE
            clean = np.column_stack([np.interp(t, fine.t, column) for column in fine.signals["q_cmd"].T])
        noise = np.column_stack([coloured(len(t), slope, random) for _ in range(2)])
        q = clean + SIGMA["q"] * noise
        found = noise_of(run_of(t, {"q_cmd": clean, "q": q}), "q")
        assert found.sigma == pytest.approx([SIGMA["q"]] * 2, rel=0.35 if slope else 0.15)


def test_stamps_that_scatter_by_a_hundredth_of_a_step_are_no_noise():
    """A fast joint goes five times its sensor's noise in that time."""
    random = np.random.default_rng(7)
    t = (np.arange(4000) + random.uniform(-0.01, 0.01, 4000)) / RATE
    motion = np.column_stack([np.sin(3.0 * t), 1.1 * np.sin(2.5 * t)])
    q = motion + 2e-6 * random.normal(size=motion.shape)
    noise = noise_of(run_of(t, {"q_cmd": motion, "q": q}), "q")
    assert noise.sigma == pytest.approx([2e-6] * 2, rel=0.1)
    assert not noise.slow.any()


def test_noise_of_the_tool():
    random = np.random.default_rng(0)
    t = np.arange(6000) / RATE
    turn = Rotation.from_rotvec(random.normal(size=(6000, 3)) * 1e-3) * Rotation.from_rotvec(
        np.column_stack([np.sin(t), 0.0 * t, np.cos(t)])
    )
    ee = np.column_stack([np.sin(t), np.cos(t), 0.0 * t]) + random.normal(size=(6000, 3)) * [1e-5, 2e-5, 3e-5]
    signals = {"q": np.sin(t)[:, None], "ee": ee, "ee_rot": np.roll(turn.as_quat(), 1, axis=1)}
    run = run_of(t, signals)
    assert noise_of(run, "ee").sigma == pytest.approx([1e-5, 2e-5, 3e-5], rel=0.1)
    assert noise_of(run, "ee_rot").sigma == pytest.approx([1e-3], rel=0.1)


def test_a_short_run_is_no_error():
    t = np.arange(40) / RATE
    noise = noise_of(run_of(t, {"q": np.sin(t)[:, None]}), "q")
    assert noise.sigma.shape == (1,)
