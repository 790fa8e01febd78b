"""Commands that a person would give: rich sums of sines, moves from pose to pose with rests, slow drifts, poor ones."""

from __future__ import annotations

import math

import numpy as np
from bodies import Robot
from integrate import Command

SPACING = 0.02
KINDS = ("rich", "moves", "slow", "single", "small")


def command(robot: Robot, kind: str, seed: int, duration: float, inertia: np.ndarray) -> Command:
    """A motion from rest within the joints' limits; `inertia` (n,) bounds accelerations through the joints' effort."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / SPACING) + 2) * SPACING
    samples = np.zeros((3, len(t), robot.n))
    chosen = int(rng.integers(robot.n))
    for i in range(robot.n):
        low, high = room(robot, i)
        fastest = 0.65 * (robot.velocity[i] if math.isfinite(robot.velocity[i]) else 3.0)
        effort = robot.effort[i] if math.isfinite(robot.effort[i]) else 10.0 * inertia[i]
        hardest = min(0.45 * effort / inertia[i], 12.0 if not robot.prismatic[i] else 8.0)
        scale = {"rich": 1.0, "moves": 1.0, "slow": 0.12, "single": 1.0, "small": 0.3}[kind]
        if kind == "single" and i != chosen:
            scale = 0.0
        if kind == "moves":
            samples[:, :, i] = moves(rng, t, low, high, fastest, hardest)
        else:
            samples[:, :, i] = waves(rng, t, low, high, scale * fastest, hardest, slow=kind == "slow", size=scale)
    return through(samples)


def room(robot: Robot, i: int) -> tuple[float, float]:
    """Where joint i may go: around its home, inside of nine tenths of its range."""
    reach = 0.09 if robot.prismatic[i] else 1.3
    low, high = robot.home[i] - reach, robot.home[i] + reach
    if math.isfinite(robot.lower[i]):
        margin = 0.05 * (robot.upper[i] - robot.lower[i])
        low, high = max(low, robot.lower[i] + margin), min(high, robot.upper[i] - margin)
    return low, high


def waves(rng, t, low, high, fastest, hardest, *, slow, size) -> np.ndarray:
    """A sum of sines that begins at rest, (3, m)."""
    band = (0.08, 0.35) if slow else (0.15, 1.4)
    f = np.sort(rng.uniform(*band, size=4))
    a = rng.uniform(0.4, 1.0, size=4) / f
    phase = rng.uniform(0.0, 2.0 * math.pi, size=4)
    w = 2.0 * math.pi * f
    angle = np.outer(t, w) + phase
    x, dx, ddx = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w * w)
    ramp = min(0.8, 0.25 * t[-1])
    u = np.clip((t - 0.1) / ramp, 0.0, 1.0)
    g = u**3 * (10 - 15 * u + 6 * u**2)
    dg = 30 * u**2 * (1 - u) ** 2 / ramp
    ddg = 60 * u * (1 - u) * (1 - 2 * u) / ramp**2
    x0 = math.sin(float(phase[0])) * 0.0
    y = np.array([x0 + g * x, dg * x + g * dx, ddg * x + 2 * dg * dx + g * ddx])
    amplitude = min(
        0.5 * (high - low) / np.max(np.abs(y[0])),
        fastest / np.max(np.abs(y[1])),
        hardest / np.max(np.abs(y[2])),
    ) * (1.0 if size in (0.0, 1.0) or slow else size)
    if size == 0.0:
        amplitude = 0.0
    swing = amplitude * np.max(np.abs(y[0]))
    center = rng.uniform(low + swing, max(high - swing, low + swing + 1.0e-9))
    y *= amplitude
    y[0] += center
    return y


def moves(rng, t, low, high, fastest, hardest) -> np.ndarray:
    """Quintic moves between random places with rests between, some fast, some slow, (3, m)."""
    y = np.zeros((3, len(t)))
    now, begin = rng.uniform(low, high), float(rng.uniform(0.1, 0.4))
    y[0] = now
    while begin < t[-1]:
        goal = rng.uniform(low, high)
        way = goal - now
        speed = fastest * float(rng.choice([1.0, 0.5, 0.15]))
        length = max(1.875 * abs(way) / speed, math.sqrt(5.7735 * abs(way) / hardest), 0.1)
        if length > 2.0:
            goal, length = now + way * 2.0 / length, 2.0
            way = goal - now
        u = np.clip((t - begin) / length, 0.0, 1.0)
        moving = t >= begin
        y[0, moving] = (now + way * u**3 * (10 - 15 * u + 6 * u**2))[moving]
        y[1, moving] = (way * 30 * u**2 * (1 - u) ** 2 / length)[moving]
        y[2, moving] = (way * 60 * u * (1 - u) * (1 - 2 * u) / length**2)[moving]
        now, begin = goal, begin + length + float(rng.uniform(0.05, 0.5))
    return y


def through(samples: np.ndarray, spacing: float = SPACING) -> Command:
    """Quintics through positions, speeds and accelerations (3, m, n) at knots `spacing` seconds apart."""
    (q0, v0, a0), (q1, v1, a1) = samples[:, :-1], samples[:, 1:]
    h = spacing
    d = q1 - q0 - h * v0 - 0.5 * h * h * a0
    e = v1 - v0 - h * a0
    f = a1 - a0
    c3 = (10 * d - 4 * h * e + 0.5 * h * h * f) / h**3
    c4 = (-15 * d + 7 * h * e - h * h * f) / h**4
    c5 = (6 * d - 3 * h * e + 0.5 * h * h * f) / h**5
    return Command(spacing, np.ascontiguousarray(np.stack([q0, v0, 0.5 * a0, c3, c4, c5], axis=-1)))
