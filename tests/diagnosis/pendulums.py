"""Runs of the built-in pendulum out of its equation of motion; nothing of the package moves it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from mbexport.core.control import Control
from mbexport.core.recording import Run

Vector = NDArray[np.float64]

# mass, center of mass, length, inertia about the axis: examples/robots/pendulum
MASS, CENTER, LENGTH = 1.2, 0.45, 0.5
INERTIA = 8.0e-3 + MASS * CENTER**2
WEIGHT = MASS * 9.81 * CENTER
KP, KD = 60.0, 4.0
NOISE = {"q": 2.0e-5, "tau": 0.01, "q_link": 2.0e-5}
# steps between two ticks
FINE = 3


def command(t: Vector | float) -> tuple[Vector, Vector, Vector]:
    """Two sines that begin at rest, with their derivatives."""
    x = np.asarray(t, dtype=float)
    q = 0.6 * (1.0 - np.cos(2.1 * x)) + 0.25 * (1.0 - np.cos(5.3 * x))
    dq = 0.6 * 2.1 * np.sin(2.1 * x) + 0.25 * 5.3 * np.sin(5.3 * x)
    ddq = 0.6 * 2.1**2 * np.cos(2.1 * x) + 0.25 * 5.3**2 * np.cos(5.3 * x)
    return q, dq, ddq


def friction_free(t: float, q: float, dq: float) -> float:
    """No torque."""
    return 0.0


def _stepped(
    t: float, q: float, dq: float, held: float, against: Callable[[float, float, float], float]
) -> tuple[float, float]:
    """One step of Heun's method of order three."""
    h = 1.0e-3 / FINE

    def bend(s: float, x: float, v: float) -> float:
        return (held - WEIGHT * math.sin(x) - against(s, x, v)) / INERTIA

    a = bend(t, q, dq)
    v, b = dq + h * a / 3.0, bend(t + h / 3.0, q + h * dq / 3.0, dq + h * a / 3.0)
    w = dq + 2.0 * h * b / 3.0
    c = bend(t + 2.0 * h / 3.0, q + 2.0 * h * v / 3.0, w)
    return q + h * (dq + 3.0 * w) / 4.0, dq + h * (a + 3.0 * c) / 4.0


def pendulum_run(
    mode: str = "pd",
    against: Callable[[float, float, float], float] = friction_free,
    *,
    seed: int = 0,
    duration: float = 4.0,
    rate: float = 250.0,
    late: float = 0.0,
    stamps: Vector | None = None,
    noise: dict[str, float] | None = None,
    every: int = 1,
    coarse: int = 0,
    torque_late: float = 0.0,
    delay: int = 0,
    gives: Callable[[float], float] = float,
) -> Run:
    """What the pendulum's sensors say; its controller ticks at 1 kHz and holds its torque.

    Args:
        mode: Control mode.
        against: Torque against the motion at (t, q, dq).
        seed: Of the noise.
        duration: [s].
        rate: Of the record [Hz].
        late: By how much the measured signals come after their stamps [s].
        stamps: Times instead of uniform ones.
        noise: Standard deviations.
        every: Ticks for which a command stays what it is.
        coarse: Semi-implicit Euler moves it, with so many steps a tick; 0: to fourth order.
        torque_late: By how much the torque alone comes after its stamps [s].
        delay: By how many of the steps between two ticks, FINE of them, the drive's torque is late.
        gives: Torque that its motor gives where it is asked for one [N m].
    """
    sigma = NOISE if noise is None else noise
    ticks = np.arange(round(duration * 1000) + 1) / 1000.0
    q_cmd, dq_cmd, ddq_cmd = command(ticks)
    tau, asked_for = np.empty_like(ticks), np.empty_like(ticks)
    states = np.empty((len(ticks), 2))
    q = dq = 0.0
    for k, t in enumerate(ticks.tolist()):
        if mode == "motion":
            q, dq = float(q_cmd[k]), float(dq_cmd[k])
            states[k] = q, dq
            tau[k] = INERTIA * ddq_cmd[k] + WEIGHT * math.sin(q) + against(t, q, dq)
            continue
        states[k] = q, dq
        told = k - k % every
        asked_for[k] = gives(KP * (float(q_cmd[told]) - q) + KD * (float(dq_cmd[told]) - dq))
        tau[k] = held = asked_for[max(0, (FINE * k - delay) // FINE)]
        for _ in range(coarse):
            dq += 1.0e-3 / coarse * (held - WEIGHT * math.sin(q) - against(t, q, dq)) / INERTIA
            q += 1.0e-3 / coarse * dq
        for part in range(0 if coarse else FINE):
            acts = asked_for[max(0, (FINE * k + part - delay) // FINE)]
            q, dq = _stepped(t + part * 1.0e-3 / FINE, q, dq, acts, against)
    t = np.arange(int(duration * rate) + 1) / rate if stamps is None else stamps
    random = np.random.default_rng(seed)
    at = np.clip(t - late, 0.0, None)
    place = np.interp(at, ticks, states[:, 0])
    held = tau[np.floor(np.clip(at - torque_late, 0.0, duration) * 1000 + 1e-6).astype(int)]
    signals = {
        "q": place[:, None] + sigma["q"] * random.normal(size=(len(t), 1)),
        "tau": held[:, None] + sigma["tau"] * random.normal(size=(len(t), 1)),
    }
    asked = command(t)
    if mode == "torque":
        signals["tau_cmd"] = tau[np.floor(t * 1000 + 1e-6).astype(int)][:, None]
    elif mode != "unknown":
        signals["q_cmd"], signals["dq_cmd"] = asked[0][:, None], asked[1][:, None]
    control = Control("pd", (KP,), (KD,)) if mode == "pd" else Control(mode)
    stated = {"q": np.array([sigma["q"]]), "tau": np.array([sigma["tau"]])}
    return Run("swing", t, signals, control, stated, (), {}, "", (), rate)


def late_by(late: float) -> tuple[Callable[[float, float, float], float], dict[int, float]]:
    """What takes the torque away that is held now and gives the one of a while ago [s] instead, and what it has kept.

    Returns:
        The torque against the motion, and its memory, to be cleared before each run.
    """
    past: dict[int, float] = {}

    def against(t: float, q: float, dq: float) -> float:
        tick = int(t * 1000.0 + 1.0e-6)
        asked = command(tick / 1000.0)
        past.setdefault(tick, KP * (float(asked[0]) - q) + KD * (float(asked[1]) - dq))
        return past[tick] - past.get(int(np.floor((t - late) * 1000.0 + 1.0e-6)), past[0])

    return against, past


def without_torque(run: Run) -> Run:
    """A late drive's run without the torque of its record, which is the controller's and not what acted."""
    return replace(run, signals={name: values for name, values in run.signals.items() if name != "tau"})


def standing_run() -> Run:
    """A pendulum in mode unknown that stands but for 0.8 s from 2 s on, and bears nothing but its weight."""
    t = np.arange(5001) / 1000.0
    u = np.clip((t - 2.0) / 0.8, 0.0, 1.0)
    q = 0.4 + 0.7 * (10 * u**3 - 15 * u**4 + 6 * u**5)
    ddq = 0.7 * (60 * u - 180 * u**2 + 120 * u**3) / 0.8**2
    random = np.random.default_rng(7)
    tau = INERTIA * ddq + WEIGHT * np.sin(q) + NOISE["tau"] * random.normal(size=len(t))
    signals = {"q": (q + NOISE["q"] * random.normal(size=len(t)))[:, None], "tau": tau[:, None]}
    noise = {name: np.array([NOISE[name]]) for name in signals}
    return Run("standing", t, signals, Control("unknown"), noise, (), {}, "", (), 1000.0)


def noisy_loop(
    sigma: dict[str, float],
    *,
    loud: bool = True,
    heard: bool = True,
    slope: float = 0.95,
    every: int = 1,
    seed: int = 3,
) -> Run:
    """What the sensors say of a pendulum whose controller acts on what they say.

    Args:
        sigma: Standard deviations of "q", of this correlation with itself a tick later, and of "dq" and "tau", white.
        loud: Whether there is any noise.
        heard: Whether the controller acts on it.
        slope: The correlation.
        every: Ticks a row.
        seed: Of the noise.
    """
    random = np.random.default_rng(seed)
    ticks = np.arange(4001) / 1000.0
    asked, rate, _ = command(ticks)
    white = random.normal(size=len(ticks))
    slow = lfilter([math.sqrt(1.0 - slope**2)], [1.0, -slope], white)
    noise = loud * np.column_stack([sigma["q"] * slow, sigma["dq"] * random.normal(size=len(ticks))])
    q = dq = 0.0
    rows = np.empty((len(ticks), 3))
    for k, t in enumerate(ticks.tolist()):
        seen, fast = (q, dq) + heard * noise[k]
        tau = KP * (asked[k] - seen) + KD * (rate[k] - fast)
        rows[k] = q + noise[k, 0], dq + noise[k, 1], tau + loud * sigma["tau"] * random.normal()
        for part in range(FINE):
            q, dq = _stepped(t + part * 1.0e-3 / FINE, q, dq, tau, friction_free)
    t = ticks[::every]
    signals = dict(zip(("q", "dq", "tau"), rows[::every].T[:, :, None], strict=True))
    signals |= {"q_cmd": asked[::every, None], "dq_cmd": rate[::every, None]}
    stated = {name: np.array([value]) for name, value in sigma.items()}
    return Run("swing", t, signals, Control("pd", (KP,), (KD,)), stated, (), {}, "", (), 1000.0 / every)


def soft_run(
    stiffness: float,
    damping: float,
    *,
    gap: float = 0.0,
    stiffening: float = 0.0,
    weight: float = WEIGHT,
    seed: int = 0,
    noisy: bool = True,
    duration: float = 4.0,
    rate: float = 250.0,
) -> Run:
    """What the sensors say of a pendulum that hangs behind a spring from a motor that goes as it is told.

    Args:
        stiffness, damping: Of the spring [N m/rad, N m s/rad].
        gap: Clearance before it [rad]; its damper never pulls.
        stiffening: By what part it is stiffer at a stretch of 1 rad, by the square of it [1/rad^2].
        weight: Moment of the weight, held out straight [N m].
        seed: Of the noise.
        noisy: Whether there is any.
        duration: [s].
        rate: Of the record [Hz].
    """
    t = np.arange(int(duration * rate) + 1) / rate

    def asked(s: Vector | float) -> tuple[Vector, Vector]:
        """Position and speed, of which even the acceleration begins at nothing."""
        x = 5.3 * np.asarray(s, dtype=float)
        return 0.4 * (1.0 - np.cos(x)) ** 2, 0.4 * 5.3 * 2.0 * (1.0 - np.cos(x)) * np.sin(x)

    def passed(s: Vector | float, q: Vector, dq: Vector) -> Vector:
        theta, dtheta = asked(s)
        stretch = theta - q
        beyond = np.sign(stretch) * np.maximum(np.abs(stretch) - 0.5 * gap, 0.0)
        torque = stiffness * beyond * (1.0 + stiffening * beyond**2) + damping * (dtheta - dq)
        return torque if gap == 0.0 else np.where(torque * beyond > 0.0, torque, 0.0)

    def bend(s: float, y: Vector) -> Vector:
        return np.array([y[1], (passed(s, y[0], y[1]) - weight * np.sin(y[0])) / INERTIA])

    # no step of which jumps over a contact
    longest = 0.5 / np.sqrt(stiffness / INERTIA) if gap else np.inf
    q, dq = solve_ivp(bend, (0.0, t[-1]), [0.0, 0.0], "DOP853", t, rtol=1e-9, atol=1e-11, max_step=longest).y
    random = np.random.default_rng(seed)
    exact = {"q": asked(t)[0], "tau": passed(t, q, dq)} | ({"q_link": q} if gap else {})
    signals = {name: (one + noisy * NOISE[name] * random.normal(size=len(t)))[:, None] for name, one in exact.items()}
    noise = {name: np.array([NOISE[name]]) for name in exact}
    return Run("swing", t, signals, Control("motion"), noise, (), {}, "", (), rate)


def ringing_run(stiffness: float, damping: float, rotor: float, *, seed: int = 0, duration: float = 4.0) -> Run:
    """What the sensors say of a pendulum that hangs behind a spring from a controlled motor.

    Args:
        stiffness, damping: Of the spring [N m/rad, N m s/rad].
        rotor: The motor's moment of inertia [kg m^2].
        seed: Of the noise.
        duration: [s].
    """
    ticks = np.arange(round(duration * 1000) + 1) / 1000.0
    q_cmd, dq_cmd, _ = command(ticks)
    parts = 10
    h = 1.0e-3 / parts
    q = dq = theta = dtheta = 0.0
    rows = np.empty((len(ticks), 2))
    for k in range(len(ticks)):
        held = KP * (q_cmd[k] - theta) + KD * (dq_cmd[k] - dtheta)
        rows[k] = theta, held
        for _ in range(parts):
            # Stoermer's and Verlet's steps, which take no energy from what rings
            passed = stiffness * (theta - q) + damping * (dtheta - dq)
            dtheta += h * (held - passed) / rotor
            dq += h * (passed - WEIGHT * math.sin(q)) / INERTIA
            theta, q = theta + h * dtheta, q + h * dq
    return _controlled(ticks, {"q": rows[:, 0], "tau": rows[:, 1]}, seed)


def rattling_run(
    gap: float, rotor: float, *, seed: int = 0, duration: float = 3.0, rate: float = 500.0, side: float = 0.0
) -> Run:
    """What the sensors say of a weightless pendulum behind play, whose motor is controlled; contacts as effects.md has.

    Args:
        gap: The whole clearance [rad].
        rotor: The motor's moment of inertia [kg m^2].
        seed: Of the noise.
        duration: [s].
        rate: Of the record [Hz].
        side: Where the arm stands at first, from -1 to 1 across its clearance.
    """
    ticks = np.arange(round(duration * 1000) + 1) / 1000.0
    q_cmd, dq_cmd, _ = command(ticks)
    both = rotor * INERTIA / (rotor + INERTIA)
    stiffness = both * (2.0 * math.pi * 500.0) ** 2
    damping = 2.0 * 0.15 * math.sqrt(stiffness * both)
    parts = 40
    h = 1.0e-3 / parts
    dq = theta = dtheta = 0.0
    q = 0.5 * side * gap
    rows = np.empty((len(ticks), 3))
    for k in range(len(ticks)):
        held = KP * (q_cmd[k] - theta) + KD * (dq_cmd[k] - dtheta)
        rows[k] = theta, held, q
        for _ in range(parts):
            stretch = theta - q
            beyond = math.copysign(max(abs(stretch) - 0.5 * gap, 0.0), stretch)
            push = stiffness * beyond + damping * (dtheta - dq) if beyond else 0.0
            passed = push if push * beyond > 0.0 else 0.0
            dtheta += h * (held - passed) / rotor
            dq += h * passed / INERTIA
            theta, q = theta + h * dtheta, q + h * dq
    return _controlled(ticks, {"q": rows[:, 0], "tau": rows[:, 1], "q_link": rows[:, 2]}, seed, round(1000.0 / rate))


def _controlled(ticks: Vector, exact: dict[str, Vector], seed: int, every: int = 1) -> Run:
    """What sensors say at every so many ticks of what is at all of them, of a pendulum that is told to go as `command`.

    Args:
        ticks: Of its controller [s].
        exact: Signal -> its values at them.
        seed: Of the noise.
        every: Ticks a row.
    """
    random = np.random.default_rng(seed)
    asked, rate, _ = command(ticks)
    signals = {name: values + NOISE[name] * random.normal(size=len(ticks)) for name, values in exact.items()}
    rows = {name: values[::every, None] for name, values in (signals | {"q_cmd": asked, "dq_cmd": rate}).items()}
    stated = {name: np.array([NOISE[name]]) for name in exact}
    return Run("swing", ticks[::every], rows, Control("pd", (KP,), (KD,)), stated, (), {}, "", (), 1000.0 / every)
