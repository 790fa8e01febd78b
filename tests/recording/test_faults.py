"""Faults planted in runs, each found in its rows; runs without fault, of which nothing is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.kinematics import dynamics, kinematics
from mbexport.core.recording import Run, read_run
from mbexport.core.recording.sensors import bad_samples

M, RATE = 4000, 500.0
PD = "control: {mode: pd, kp: [50, 40], kd: [5, 4], rate: 500}\n"


def swing(t):
    """Two joints that never rest, position, speed and acceleration (3, m, 2)."""
    q = [
        sum(a * np.sin(w * t + p) for a, w, p in part)
        for part in (((0.8, 1.1, 0.3), (0.3, 4.0, 1.0)), ((0.7, 1.7, 2.0), (0.2, 5.3, 0.0)))
    ]
    return with_derivatives(np.column_stack(q), t)


def rest(t):
    """Moves, rests at its furthest, moves back, rests."""
    s = np.clip(np.interp(t, [0.0, 1.0, 3.0, 4.0, 8.0], [0.0, 1.0, 1.0, 0.0, 0.0]), 0.0, 1.0)
    s = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    return with_derivatives(np.column_stack([0.9 * s, -0.4 * s]), t)


def ramps(t):
    """Constant speeds with short blends."""
    corners = np.arange(0.0, 9.0, 1.3)
    q = np.column_stack(
        [np.interp(t, corners, a * (np.arange(len(corners)) % 2)) for a in (1.0, 0.5)],
    )
    width = 25
    blended = [np.convolve(np.pad(column, width, mode="edge"), np.ones(51) / 51, "valid") for column in q.T]
    return with_derivatives(np.column_stack(blended), t)


def still(t):
    """One joint moves, the other is held."""
    q, dq, ddq = swing(t)
    return np.stack(
        [np.column_stack([values[:, 0], 0.0 * t + (0.4 if k == 0 else 0.0)]) for k, values in enumerate((q, dq, ddq))]
    )


def with_derivatives(q, t):
    dq = np.gradient(q, t, axis=0)
    return np.stack([q, dq, np.gradient(dq, t, axis=0)])


@pytest.fixture(scope="module")
def planar(database):
    robot = build(database("planar2r"), "rigid")
    return dynamics(robot), kinematics(robot)


def recorded(planar, motion=swing, noise=1.0, colour=0.0, steps=0.0, seed=0, friction=1.0):
    """Columns of a run of planar2r: friction on top of the nominal torques, a lagging controller."""
    arms, chain = planar
    random = np.random.default_rng(seed)
    t = np.arange(M) / RATE
    q_cmd, dq_cmd, _ = motion(t)
    q = lfilter([0.2], [1.0, -0.8], q_cmd - q_cmd[0], axis=0) + q_cmd[0] if noise else q_cmd
    q, dq, ddq = with_derivatives(q, t)
    tau = arms.inverse_dynamics(q, dq, ddq) + friction * (0.5 * np.tanh(dq / 1e-3) + 0.2 * dq)
    tool = chain.tool_in_base(q)[:, :3, 3]

    def sensor(values, sigma):
        e = random.normal(size=(M + 300, values.shape[1]))
        e = lfilter([np.sqrt(1 - colour**2)], [1.0, -colour], e, axis=0)[300:]
        noisy = values + noise * sigma * e
        return np.round(noisy / (steps * sigma)) * (steps * sigma) if steps else noisy

    signals = {
        "q_cmd": q_cmd,
        "dq_cmd": dq_cmd,
        "q": sensor(q, 2e-5),
        "dq": sensor(dq, 2e-3),
        "q_link": sensor(q, 2e-5),
    }
    signals["tau"] = sensor(tau, 0.02)
    columns = {"t": t} | {f"{name}_{i + 1}": values[:, i] for name, values in signals.items() for i in range(2)}
    return columns | {f"ee_{axis}": values for axis, values in zip("xyz", sensor(tool, 1e-4).T, strict=True)}


def judged(columns, database):
    """A run out of columns, its bad samples found; without the way through a file."""
    signals = {
        name: np.column_stack([columns[f"{name}_{i}"] for i in (1, 2)])
        for name in ("q_cmd", "dq_cmd", "q", "dq", "q_link", "tau")
        if f"{name}_1" in columns
    }
    if "ee_x" in columns:
        signals["ee"] = np.column_stack([columns[f"ee_{axis}"] for axis in "xyz"])
    run = Run("run", columns["t"], signals, Control(), {}, (), {}, "", (), RATE)
    return bad_samples(run, (), database("planar2r"))


def faults(run):
    return {(item.channel, item.reason) for item in run.left_out}


@pytest.mark.parametrize("motion", [swing, rest, ramps, still])
@pytest.mark.parametrize(
    "sensors",
    [
        {"noise": 0.0, "friction": 0.0},
        {},
        {"steps": 1.0},
        {"steps": 20.0},
        {"steps": 200.0},
        {"colour": 0.95},
        {"colour": 0.95, "steps": 2.0},
    ],
    ids=str,
)
def test_nothing_is_said_of_a_clean_run(database, planar, motion, sensors):
    assert judged(recorded(planar, motion, **sensors), database).left_out == ()


@pytest.mark.parametrize("sensors", [{}, {"steps": 5.0}, {"noise": 0.0}], ids=str)
@pytest.mark.parametrize("channel", ["q_1", "q_link_2", "dq_1", "tau_2"])
@pytest.mark.parametrize(("first", "last"), [(1260, 1500), (2900, 3999), (0, 400)])
def test_a_stuck_sensor(database, planar, sensors, channel, first, last):
    columns = recorded(planar, **sensors)
    columns[channel][first : last + 1] = columns[channel][first]
    run = judged(columns, database)
    (fault,) = run.left_out
    assert fault.channel == channel
    extreme = columns[channel][first] in (columns[channel].min(), columns[channel].max())
    assert fault.reason == ("saturated" if extreme else "stuck")
    # neighbours may have the same value by chance
    near = (14 if sensors.get("steps") else 2.5) / RATE
    assert fault.first == pytest.approx((first + 1) / RATE, abs=near)
    assert fault.last == pytest.approx(last / RATE, abs=near)
    signal, _, number = channel.rpartition("_")
    gone = np.isnan(run.signals[signal][:, int(number) - 1])
    assert gone.sum() == fault.samples
    assert gone[first + 3 : last - 2].all()


@pytest.mark.parametrize("channel", ["q_1", "dq_2"])
def test_a_sensor_that_says_one_thing_all_the_time(database, planar, channel):
    columns = recorded(planar)
    columns[channel][:] = 0.25
    run = judged(columns, database)
    assert (channel, "stuck") in faults(run)
    signal, _, number = channel.rpartition("_")
    # nothing of it was measured, not even the first sample
    assert np.isnan(run.signals[signal][:, int(number) - 1]).all()


def test_the_tool_stuck(database, planar):
    columns = recorded(planar)
    for axis in "xyz":
        columns[f"ee_{axis}"][1000:1300] = columns[f"ee_{axis}"][1000]
    run = judged(columns, database)
    assert faults(run) == {("ee", "stuck")}
    assert np.isnan(run.signals["ee"]).all(axis=1).sum() == 299


@pytest.mark.parametrize("sensors", [{}, {"steps": 2.0}, {"noise": 0.0}], ids=str)
@pytest.mark.parametrize(("channel", "share"), [("q_1", 0.7), ("dq_2", 0.6), ("tau_1", 0.5)])
def test_a_saturated_sensor(database, planar, sensors, channel, share):
    columns = recorded(planar, **sensors)
    limit = share * np.abs(columns[channel]).max()
    cut, beside = np.abs(columns[channel]) > limit, np.abs(columns[channel]) < limit
    columns[channel] = np.clip(columns[channel], -limit, limit)
    run = judged(columns, database)
    assert faults(run) == {(channel, "saturated")}
    signal, _, number = channel.rpartition("_")
    gone = np.isnan(run.signals[signal][:, int(number) - 1])
    assert gone[cut].mean() > 0.7
    assert not gone[beside].any()


def test_a_drive_at_its_limit_is_not_a_saturated_sensor(database, planar):
    """The torque is really cut: what is measured of the motion agrees with it."""
    arms, _ = planar
    t = np.arange(M) / RATE
    q_cmd, dq_cmd, _ = swing(t)
    q, dq = q_cmd[0].copy(), dq_cmd[0].copy()
    rows = []
    limit = np.array([30.0, 8.0])
    for k in range(M // 2):
        tau = np.clip(400.0 * (q_cmd[k] - q) + 40.0 * (dq_cmd[k] - dq), -limit, limit)
        rows.append((q, dq, tau))
        for _ in range(2):
            ddq = np.linalg.solve(arms.mass_matrix(q), tau - arms.bias(q, dq))
            dq = dq + ddq * 0.5 / RATE
            q = q + dq * 0.5 / RATE
    q, dq, tau = (np.array(values) for values in zip(*rows, strict=True))
    assert (np.abs(tau) == limit).sum() > 200
    columns = {"t": t[: M // 2]}
    for name, values in (("q_cmd", q_cmd[: M // 2]), ("dq_cmd", dq_cmd[: M // 2]), ("q", q), ("dq", dq), ("tau", tau)):
        columns |= {f"{name}_{i + 1}": values[:, i] for i in range(2)}
    assert judged(columns, database).left_out == ()


def test_lost_samples_are_told(write, database, planar):
    columns = recorded(planar)
    columns["tau_1"][100:150] = np.nan
    columns["q_2"][3000] = np.inf
    columns["ee_x"][7] = np.nan
    run = read_run(write(columns, PD), database("planar2r"))
    assert {(item.channel, item.reason, item.samples) for item in run.left_out} == {
        ("tau_1", "not a number", 50),
        ("q_2", "not a number", 1),
        ("ee", "not a number", 1),
    }
    assert np.isnan(run.signals["q"][3000, 1])


def test_the_same_stamp_twice(write, database, planar):
    columns = recorded(planar)
    columns["t"][500] = columns["t"][499]
    columns["t"][900:903] = columns["t"][899]
    run = read_run(write(columns, PD), database("planar2r"))
    assert [(item.channel, item.reason, item.samples) for item in run.left_out if item.reason == "repeat"] == [
        ("t", "repeat", 4)
    ]
    assert len(run.t) == M - 4
    assert (np.diff(run.t) > 0).all()


@pytest.mark.parametrize("sensors", [{}, {"steps": 2.0}, {"noise": 0.0}], ids=str)
def test_rows_written_twice(write, database, planar, sensors):
    """Every sixteenth row is the one before it, under a stamp of its own."""
    columns = recorded(planar, **sensors)
    copied = np.arange(20, M - 20, 16)
    for name, values in columns.items():
        if name != "t" and "cmd" not in name:
            values[copied] = values[copied - 1]
    run = read_run(write(columns, PD), database("planar2r"))
    assert faults(run) == {("row", "repeat")}
    left = np.isin(copied / RATE, run.t)
    assert left.mean() < 0.05
    assert len(run.t) == M - (~left).sum()


def test_a_logger_that_froze(write, database, planar):
    columns = recorded(planar)
    for name, values in columns.items():
        if name != "t" and "cmd" not in name:
            values[1001:1040] = values[1000]
    run = read_run(write(columns, PD), database("planar2r"))
    assert (("row", "repeat", 39)) in {(item.channel, item.reason, item.samples) for item in run.left_out}


def test_a_gap(write, database, planar):
    columns = {name: np.delete(values, np.s_[700:950]) for name, values in recorded(planar).items()}
    run = read_run(write(columns, PD), database("planar2r"))
    (gap,) = run.left_out
    assert (gap.channel, gap.reason, gap.samples) == ("t", "gap", 250)
    assert (gap.first, gap.last) == pytest.approx((699 / RATE, 950 / RATE))


def test_stamps_that_jitter(write, database, planar):
    columns = recorded(planar)
    columns["t"] = columns["t"] + np.random.default_rng(0).uniform(-0.2, 0.2, M) / RATE
    run = read_run(write(columns, PD), database("planar2r"))
    (jitter,) = run.left_out
    assert (jitter.channel, jitter.reason, jitter.samples) == ("t", "jitter", 0)
    assert run.rate == pytest.approx(RATE, rel=0.02)


def test_stamps_in_whole_microseconds_do_not_jitter(write, database, planar):
    columns = recorded(planar)
    columns["t"] = np.round(np.arange(M) / 600.0, 6)
    assert read_run(write(columns, PD), database("planar2r")).left_out == ()
