"""What can be told apart on a case's runs, by the generator's own engine.

    python benchmarks/blind/apart.py BANK/tune     writes BANK/tune/apart/<id>.json; what is there stays

The gap of an effect is what the true robot does less what it would do without that effect, the tolerances' draw and the
other effects being the same. Another effect at a place is ALIKE where the best of it, over its parameters, leaves less
than `ALIKE` of the gap's energy; every channel that was recorded (speeds aside) counts in units of its noise floor.

"fitted" is how much of the gap the runs show that a fit may see: the held-out run is not among them. "together" are
those that alone show the same as all effects of the case: a load says whatever an arm's inertia and its encoder's
offset do on a pendulum.

How the other is fitted: the robot is led along the true motion, and what each effect then asks of the drives is a
column a parameter. Where drives follow the command (mode motion), or where torque is compared (mode unknown), that is
the gap itself. Under a controller the robot gives way to it: M dd + kd d' + kp d = -columns, ticks of the controller,
M the robot's along its motion; in mode torque the same with gains of zero, anew every half second, as it is compared.
The truth goes the same way, so that what is left of a structural twin is nothing. Laws that are not linear in their
parameters: the best of a grid, over what the generator draws from and some more (a Stribeck speed above half of the
fastest would be Coulomb's law, a hysteresis of no width too). Springs and play give way at rest first; those that come
near are then integrated, and fitted by least squares.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bodies import (
    PRISMATIC,
    REVOLUTE,
    Extras,
    Robot,
    build_chain,
    inverse_dynamics,
    mass_and_bias,
    node_frames,
    place_nodes,
)
from design import Judge, as_simulated, law_of
from motions import through
from numba import njit
from scipy.optimize import least_squares, lsq_linear
from world import COLUMN, World, sampled, simulate, substeps_needed, world_of

ALIKE = 0.01
# which springs and plays are integrated: those that at rest leave less than this, beside what swings less than that
NEAR, NEAR_SWINGING = 0.4, 0.95
# frequencies at which springs are let swing before [Hz]
SWINGS = (3.0, 5.0, 8.0, 12.0, 20.0)
INTEGRATED = 3
# what swings and is in no catalogue
SWINGING = ("outside_mount", "outside_slosh")
# steps a tick from which a spring is so hard that it gives nothing
MOST_SUBSTEPS = 100
# columns of geometry are of a milliradian or a millimetre, and stay within what is small
MOST = dict.fromkeys(("kinematic_error", "base_tilt", "encoder_offset"), 300.0)
# of the candidates that leave less than this, a record is kept
KEPT = 0.5
# rigid bodies are followed at this rate [Hz]; signals are compared at it
RATE = 100.0
WINDOW = 0.5
SLIPS = 8
INERTIAL = ("mass", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
KINEMATIC = ("alpha", "a", "theta", "d", "beta")


@njit(cache=True)
def giving_way(inverse, kp, kd, push, h, window):
    """Answer (m, n, k) of a controlled robot to torques (m, n, k) that act on it from one tick to the next.

    inverse (m, n, n): of the mass matrix; window: ticks after which it begins anew, 0: never.
    """
    m, n, k = push.shape
    out, rate = np.zeros_like(push), np.zeros_like(push)
    x, v, force = np.zeros((n, k)), np.zeros((n, k)), np.zeros((n, k))
    for t in range(m):
        if window and t % window == 0:
            x[:] = 0.0
            v[:] = 0.0
        out[t], rate[t] = x, v
        for i in range(n):
            for c in range(k):
                force[i, c] = push[t, i, c] - kp[i] * x[i, c] - kd[i] * v[i, c]
        for i in range(n):
            for j in range(n):
                a = inverse[t, i, j]
                for c in range(k):
                    # a held force moves it by h^2 / 2 within the tick
                    gain = h * a * force[j, c]
                    v[i, c] += gain
                    x[i, c] -= 0.5 * h * gain
            for c in range(k):
                x[i, c] += h * v[i, c]
    return out, rate


@njit(cache=True)
def slipping(theta, width):
    """Force (m,) of eight Maxwell-slip elements of level 1 together that slide after `width` in the mean."""
    elements = np.zeros(SLIPS)
    out = np.zeros(len(theta))
    for t in range(1, len(theta)):
        for s in range(SLIPS):
            top = (s + 1) / (SLIPS * (SLIPS + 1) / 2)
            elements[s] += (theta[t] - theta[t - 1]) / width / SLIPS
            elements[s] = min(top, max(-top, elements[s]))
            out[t] += elements[s]
    return out


@njit(cache=True)
def swinging(load, inertia, stiffness, damping, h):
    """Deflection (m,) of a spring with a mass under a load (m,), from its equilibrium; instants h apart."""
    out = np.zeros(len(load))
    x, v = -load[0] / stiffness, 0.0
    parts = 20
    step = h / parts
    for t in range(len(load)):
        out[t] = x
        if t + 1 < len(load):
            for p in range(parts):
                now = load[t] + (load[t + 1] - load[t]) * p / parts
                v -= step * (now + stiffness * x + damping * v) / inertia[t]
                x += step * v
    return out


@njit(cache=True)
def matrices(chain, q, v, driven):
    """Mass matrices (m, n, n) of the driven nodes along a motion (m, N)."""
    n = len(driven)
    out = np.zeros((len(q), n, n))
    for k in range(len(q)):
        M, _ = mass_and_bias(chain, q[k], v[k])
        for i in range(n):
            for j in range(n):
                out[k, i, j] = M[driven[i], driven[j]]
    return out


@njit(cache=True)
def jacobians(chain, q, driven, tool):
    """Of the tool's position along a motion: (m, 3, n); no hidden nodes."""
    n = len(driven)
    out = np.zeros((len(q), 3, n))
    R, p = np.zeros((q.shape[1], 3, 3)), np.zeros((q.shape[1], 3))
    for k in range(len(q)):
        place_nodes(chain, q[k], R, p)
        last = q.shape[1] - 1
        for i in range(n):
            j = driven[i]
            z = R[j, :, 2]
            if chain.kind[j] == 1:
                out[k, :, i] = z
            else:
                lever = R[last] @ tool + p[last] - p[j]
                out[k, 0, i] = z[1] * lever[2] - z[2] * lever[1]
                out[k, 1, i] = z[2] * lever[0] - z[0] * lever[2]
                out[k, 2, i] = z[0] * lever[1] - z[1] * lever[0]
    return out


@dataclass
class Asked:
    """What an effect asks along a run, arrays (m, n, k) at the ticks, one column a parameter; None: nothing.

    drive: torque of the drives; extra: torque that the controller or motor gives beside (reported tells whether it is
    in the reported torque); bias: on the reported torque alone; link: of the arms' positions; passed: behind the gear;
    tip (m, 3, k).
    """

    drive: np.ndarray | None = None
    extra: np.ndarray | None = None
    reported: bool = True
    bias: np.ndarray | None = None
    link: np.ndarray | None = None
    passed: np.ndarray | None = None
    tip: np.ndarray | None = None


class Track:
    """One run: the reported motion of the true robot, and the robot without the effect along it."""

    def __init__(self, scene: Scene, row: dict) -> None:
        recipe, self.scene = scene.recipe, scene
        self.law = law_of(recipe, row)
        self.seconds = row["duration"]
        self.true = simulate(as_simulated(recipe), scene.truth, self.law, self.seconds)
        self.rate = recipe["control"]["rate"]
        m = len(self.true.q)
        self.t = np.arange(m) / self.rate
        self.cmd = sampled(self.law, m, self.rate)[:2]
        if scene.mode == "motion":
            self.led, (self.q, self.dq, self.ddq) = self.law, sampled(self.law, m, self.rate)
        else:
            self.q, self.dq = self.true.q, self.true.dq
            self.ddq = np.gradient(self.dq, 1.0 / self.rate, axis=0)
            self.led = through(np.stack([self.q, self.dq, self.ddq]), 1.0 / self.rate)
        self.base = self.along(scene.without)
        step = max(1, round(self.rate / RATE))
        self.thin = np.arange(0, m, step)
        self.tau = self.true.tau - scene.truth.torque_bias
        chain, driven, _, (_, tool) = build_chain(scene.without.robot)
        self.chain, self.node = chain, len(chain.kind) - 1
        self.points = tuple(values[self.thin] for values in (self.q - scene.without.encoder, self.dq, self.ddq))
        index = np.array(driven)
        mass = matrices(chain, self.points[0], np.zeros_like(self.points[0]), index)
        self.arm_mass = mass
        rotors = np.diag(scene.without.drives[:, COLUMN["inertia"]])
        self.inverse = self.spread(np.linalg.inv(mass + rotors).reshape(len(mass), -1)).reshape(m, *mass.shape[1:])
        self.jacobian = jacobians(chain, self.points[0], index, tool[:3, 3].copy())
        self.tip = tool[:3, 3]

    def along(self, world: World):
        """Signals of a robot whose drives follow the reported motion."""
        recipe = self.scene.recipe
        imposed = {**recipe, "control": {**recipe["control"], "mode": "motion", "feedforward": "none"}}
        return simulate(imposed, world, self.led, self.seconds)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """From the thin instants to the ticks, (m, k)."""
        return np.stack([np.interp(self.t, self.t[self.thin], column) for column in values.T], axis=1)

    def asked_by(self, world: World) -> Asked:
        """What a whole robot asks more than the one without the effect, integrated; k = 1."""
        s, b = self.along(world), self.base
        bias = world.torque_bias - self.scene.without.torque_bias
        return Asked(
            drive=(s.tau - world.torque_bias - b.tau + self.scene.without.torque_bias)[:, :, None],
            bias=np.broadcast_to(bias, s.tau.shape)[:, :, None],
            link=(s.q_link - b.q_link)[:, :, None],
            passed=(s.tau_link - b.tau_link)[:, :, None],
            tip=(s.ee[:, :, 3] - b.ee[:, :, 3])[:, :, None],
        )

    def shown(self, asked: Asked) -> np.ndarray:
        """What the channels show of it in units of their noise, thin instants, (N, k)."""
        scene, thin = self.scene, self.thin
        mode, control = scene.mode, scene.recipe["control"]
        some = next(v for v in (asked.drive, asked.extra, asked.bias) if v is not None)
        m, n, k = len(self.t), scene.n, some.shape[2]
        none = np.zeros((m, n, k))
        drive = none if asked.drive is None else asked.drive
        extra = none if asked.extra is None else asked.extra
        link = none if asked.link is None else asked.link
        passed = none if asked.passed is None else asked.passed
        tip = np.zeros((m, 3, k)) if asked.tip is None else asked.tip
        bias = none if asked.bias is None else asked.bias
        way = rate = none
        tau = drive - extra
        if mode in ("pd", "torque"):
            loose = mode == "torque"
            kp, kd = (np.zeros(n) if loose else np.array(control[name]) for name in ("kp", "kd"))
            window = round(WINDOW * self.rate) if loose else 0
            way, rate = giving_way(self.inverse, kp, kd, np.ascontiguousarray(extra - drive), 1.0 / self.rate, window)
            tau = -kp[:, None] * way - kd[:, None] * rate + (extra if asked.reported else none)
            if loose:
                tau = none
        # the drives follow in motion, and there a motor's constant does not act
        elif mode == "motion":
            tau = drive
        parts = []
        for name, floor in scene.floors.items():
            if name == "q":
                values = way[thin]
            elif name == "q_link":
                values = (way + link)[thin]
            elif name == "tau":
                values = (tau + bias)[thin]
            elif name == "ee":
                values = tip[thin]
                if mode in ("pd", "torque"):
                    values = values + self.jacobian @ way[thin]
            else:
                values = passed[thin]
                if mode in ("pd", "torque"):
                    values = values + self.arm_mass @ np.gradient(rate, 1.0 / self.rate, axis=0)[thin]
            parts.append((values / floor[None, :, None]).reshape(-1, k))
        return np.concatenate(parts)

    def bodies(self, robot: Robot, *, moved: np.ndarray | None = None) -> Asked:
        """What other rigid bodies (or a shifted reported motion, (n,)) ask; k = 1."""
        chain, _, _, (_, tool) = build_chain(robot, Extras(load=self.scene.without.extras.load))
        q, dq, ddq = self.points
        mine = q if moved is None else q + moved
        torque = inverse_dynamics(chain, mine, dq, ddq) - self.rigid()
        frames, old = node_frames(chain, mine, self.node), node_frames(self.chain_loaded(), q, self.node)
        tip = frames[:, :, :3] @ tool[:3, 3] + frames[:, :, 3] - old[:, :, :3] @ self.tip - old[:, :, 3]
        link = np.zeros_like(q) if moved is None else np.broadcast_to(moved, q.shape)
        spread = [self.spread(values)[:, :, None] for values in (torque, tip, link)]
        return Asked(drive=spread[0], passed=spread[0], tip=spread[1], link=spread[2])

    def chain_loaded(self):
        return build_chain(self.scene.without.robot, Extras(load=self.scene.without.extras.load))[0]

    def rigid(self) -> np.ndarray:
        """Torque of the rigid robot without the effect, thin instants."""
        if not hasattr(self, "_rigid"):
            self._rigid = inverse_dynamics(self.chain_loaded(), *self.points)
        return self._rigid

    def shaken(self, extras: Extras, node: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """How torques of all nodes answer to the motion of one node, thin instants: (of position, speed, acceleration
        (m, N) each), the torques themselves, the tip's velocity per speed of the node (m, 3)."""
        extras = Extras(extras.bearings, extras.bends, None, self.scene.without.extras.load, None)
        chain, driven, _, (tool_node, tool) = build_chain(self.scene.without.robot, extras)
        N = len(chain.kind)
        motion = [np.zeros((len(self.thin), N)) for _ in range(3)]
        for have, values in zip(motion, self.points, strict=True):
            have[:, driven] = values
        base = inverse_dynamics(chain, *motion)

        def answer(order: int, step: float) -> np.ndarray:
            other = [values.copy() for values in motion]
            other[order][:, node] += step
            return (inverse_dynamics(chain, *other) - base) / step

        tips = []
        for step in (0.0, 1.0e-6):
            other = motion[0].copy()
            other[:, node] += step
            frames = node_frames(chain, other, tool_node)
            tips.append(frames[:, :, :3] @ tool[:3, 3] + frames[:, :, 3])
        tip = (tips[1] - tips[0]) / 1.0e-6
        return answer(0, 1.0e-5), answer(1, 1.0e-4), answer(2, 1.0), base, tip

    def gives(self, answers, driven: list[int], shift: np.ndarray, joint: int | None) -> Asked:
        """What a small shift (m thin,) of one node asks of the drives; `joint`: the one whose arm it is."""
        of_place, of_speed, of_push, _, lever = answers
        h = float(self.t[self.thin[1]] - self.t[self.thin[0]])
        first = np.gradient(shift, h)
        second = np.gradient(first, h)
        torque = of_place * shift[:, None] + of_speed * first[:, None] + of_push * second[:, None]
        torque = self.spread(torque[:, driven])[:, :, None]
        link = np.zeros((len(self.t), len(driven), 1))
        if joint is not None:
            link[:, joint, 0] = np.interp(self.t, self.t[self.thin], shift)
        tip = self.spread(lever * shift[:, None])[:, :, None]
        return Asked(drive=torque, passed=torque, link=link, tip=tip)


class Scene:
    """A case's runs, its true robot, and the same without one of its effects, or another robot."""

    def __init__(
        self,
        recipe: dict,
        index: int | None,
        rows: list[dict] | None = None,
        without: World | None = None,
        judge: Judge | None = None,
    ) -> None:
        self.recipe, self.mode = recipe, recipe["control"]["mode"]
        self.others = [e for k, e in enumerate(recipe["effects"]) if k != index]
        self.truth = world_of(recipe, recipe["effects"], drawn=recipe["drawn"])
        self.without = self.world([]) if without is None else without
        self.n = self.truth.robot.n
        # many simulations, of the robot as it is known
        judge = judge or Judge(recipe)
        floors, at = {}, 0
        for name in judge.channels():
            size = 3 if name == "ee" else self.n
            floors[name] = judge.floor[at : at + size]
            at += size
        kept = {"torque": set(floors) - {"tau"}, "unknown": {"tau"}}.get(self.mode, set(floors))
        self.floors = {name: floor for name, floor in floors.items() if name in kept}
        self.paths = [Track(self, row) for row in rows or recipe["runs"]]
        if index is None:
            return
        self.effect = recipe["effects"][index]
        self.asks = self.asked_by(self.effect)
        self.gap = self.shown(self.asks)[:, 0]
        self.energy = float(self.gap @ self.gap)

    def world(self, effects: list[dict]) -> World:
        return world_of(self.recipe, [*self.others, *effects], drawn=self.recipe["drawn"])

    def shown(self, asked: list[Asked]) -> np.ndarray:
        return np.concatenate([path.shown(a) for path, a in zip(self.paths, asked, strict=True)])

    def asked_by(self, effect: dict) -> list[Asked]:
        """What an effect with its numbers asks, its law integrated along the motion; k = 1."""
        acting = self.acting(effect)
        if acting is not None:
            return acting
        return self.asked_by_law([effect])

    def asked_by_law(self, effects: list[dict]) -> list[Asked]:
        """What effects ask that change no torque but by the motion, their laws integrated along it; k = 1."""
        world = self.world(effects)
        return [path.asked_by(world) for path in self.paths]

    def asked_torque(self, number: int) -> np.ndarray:
        """What the effect that was taken out asks of the drives of one run, (m, n)."""
        asked = self.asks[number]
        parts = [v[:, :, 0] for v in (asked.drive, None if asked.extra is None else -asked.extra) if v is not None]
        return np.sum(parts, axis=0)

    def fitted(self) -> float:
        """Energy of the gap, in units of noise at RATE, in the runs that a fit may see: all but the last."""
        seen = zip(self.paths[:-1], self.asks[:-1], strict=True)
        return sum(float(np.sum(np.square(path.shown(asked)))) for path, asked in seen)

    def acting(self, effect: dict) -> list[Asked] | None:
        """Effects that change what controller and motor give, with their numbers; None for all others."""
        name, i, p = effect["effect"], effect["at"] - 1, effect["parameters"]
        out = []
        for path in self.paths:
            extra = np.zeros((len(path.t), self.n, 1))
            if name == "torque_constant":
                tau = path.tau[:, i]
                extra[:, i, 0] = tau * (p["gain"] / np.sqrt(1.0 + 2.0 * p.get("droop", 0.0) * tau**2) - 1.0)
            elif name == "controller_gain":
                error, speed = (a[:, i] - b[:, i] for a, b in zip(path.cmd, (path.q, path.dq), strict=True))
                kp, kd = (self.recipe["control"][key][i] for key in ("kp", "kd"))
                # the recorded error is the one with the other gains
                extra[:, i, 0] = (p.get("kp", 1.0) - 1.0) * kp * error + (p.get("kd", 1.0) - 1.0) * kd * speed
            elif name == "delay":
                asked = path.true.tau_cmd
                extra[:, :, 0] = late(asked, p["time"] * path.rate) - asked
            elif name == "torque_limit":
                asked = path.true.tau_cmd[:, i]
                extra[:, i, 0] = path.tau[:, i] - asked
            elif name == "outside_motor_lag":
                tau = path.tau[:, i]
                given, state = np.zeros_like(tau), tau[0]
                share = 1.0 - math.exp(-1.0 / (path.rate * p["time"]))
                for k, asked in enumerate(tau):
                    given[k] = state
                    state += share * (asked - state)
                extra[:, i, 0] = given - tau
            else:
                return None
            out.append(Asked(extra=extra, reported=name not in ("torque_constant", "outside_motor_lag")))
        return out

    def left(self, columns: np.ndarray, most: float = math.inf) -> tuple[float, np.ndarray]:
        """(share of the gap's energy that the best combination of columns leaves, its factors, none above `most`)."""
        scale = np.linalg.norm(columns, axis=0)
        good = scale > 0.0
        factors = np.zeros(columns.shape[1])
        if not good.any() or self.energy == 0.0:
            return 1.0, factors
        unit = columns[:, good] / scale[good]
        values, vectors = np.linalg.eigh(unit.T @ unit)
        kept = values > 1.0e-12 * values[-1]
        turned = (vectors[:, kept].T @ (unit.T @ self.gap)) / values[kept]
        factors[good] = vectors[:, kept] @ turned / scale[good]
        if np.max(np.abs(factors)) > most:
            q, r = np.linalg.qr(columns)
            factors = lsq_linear(r, q.T @ self.gap, bounds=(-most, most)).x
        rest = self.gap - columns @ factors
        return float(rest @ rest) / self.energy, factors


def late(values: np.ndarray, ticks: float) -> np.ndarray:
    """Held values (m, n), some ticks later: of the torque that acts within a tick its mean."""
    whole, part = int(ticks), ticks - int(ticks)
    index = np.arange(len(values))
    now, before = (values[np.maximum(index - whole - k, 0)] for k in (0, 1))
    return (1.0 - part) * now + part * before


def signs(speed: np.ndarray, scale: float) -> np.ndarray:
    """Direction of a motion, (m,): at rest the last one, before any none."""
    moving = np.abs(speed) > 1.0e-5 * scale
    last = np.maximum.accumulate(np.where(moving, np.arange(len(speed)), -1))
    return np.where(last >= 0, np.sign(speed[np.maximum(last, 0)]), 0.0)


# ------------------------------------------------------------------------------------------------------- the candidates


def joint_column(path: Track, i: int, values: np.ndarray) -> np.ndarray:
    """(m, n, k) with values (m, k) at joint i."""
    values = values[:, None] if values.ndim == 1 else values
    out = np.zeros((len(path.t), path.scene.n, values.shape[1]))
    out[:, i] = values
    return out


def drives(scene: Scene, i: int, law) -> np.ndarray:
    """Columns of a torque at joint i's drive, law(path) -> (m,) or (m, k)."""
    return scene.shown([Asked(drive=joint_column(path, i, law(path))) for path in scene.paths])


def stacked(asked: list[Asked]) -> Asked:
    """Columns of several as one."""

    def together(name: str):
        parts = [getattr(a, name) for a in asked]
        return None if parts[0] is None else np.concatenate(parts, axis=2)

    return Asked(
        **{name: together(name) for name in ("drive", "extra", "bias", "link", "passed", "tip")},
        reported=asked[0].reported,
    )


def with_arm(scene: Scene, i: int, effect: str, name: str) -> Robot:
    """The robot without the effect and one number of an arm changed; moments and tensors with a mass, which an arm may
    have none of."""
    step = {name: 1.0e-3} if effect == "kinematic_error" else {"mass": 1.0, name: 1.0}
    return scene.world([{"effect": effect, "at": i + 1, "parameters": step, "form": 0}]).robot


def candidates(scene: Scene):
    """(effect, at, columns (N, k)) one by one; grids yield several of one name. What gives way comes from `giving`."""
    n, control = scene.n, scene.recipe["control"]
    robot = scene.without.robot
    speed = np.max([np.max(np.abs(path.dq), axis=0) for path in scene.paths], axis=0)
    acting = scene.mode not in ("motion", "unknown")
    commanded = scene.mode == "pd"
    for i in range(n):
        at, slide = i + 1, 0.1 if robot.prismatic[i] else 1.0
        fast = max(float(speed[i]), 1.0e-6)

        def side(path, i=i, slide=slide):
            return signs(path.dq[:, i], slide)

        yield "coulomb_friction", at, drives(scene, i, side)
        yield "viscous_friction", at, drives(scene, i, lambda path, i=i: path.dq[:, i])
        for share in (0.02, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5):
            yield (
                "stribeck_friction",
                at,
                drives(
                    scene,
                    i,
                    lambda p, i=i, v=share * fast, side=side: side(p) * np.exp(-((p.dq[:, i] / v) ** 2)),
                ),
            )
        yield (
            "load_friction",
            at,
            drives(scene, i, lambda path, i=i, side=side: side(path) * np.abs(path.base.tau_link[:, i])),
        )
        for width in (0.003, 0.006, 0.01, 0.017, 0.03):
            wide = width * slide
            yield "hysteresis", at, drives(scene, i, lambda path, i=i, w=wide: slipping(path.q[:, i].copy(), w))
        yield "rotor_inertia", at, drives(scene, i, lambda path, i=i: path.ddq[:, i])
        yield from periodic(scene, i, slide)
        pulls = [joint_column(p, i, np.stack([p.base.q_link[:, i], np.ones(len(p.t))], axis=1)) for p in scene.paths]
        yield "joint_spring", at, scene.shown([Asked(drive=pull, passed=pull) for pull in pulls])
        if "tau" in scene.floors:
            ones = [Asked(bias=joint_column(path, i, np.ones(len(path.t)))) for path in scene.paths]
            yield "torque_offset", at, scene.shown(ones)
        if scene.mode != "motion":
            own = [Asked(extra=joint_column(p, i, p.tau[:, i]), reported=False) for p in scene.paths]
            yield "torque_constant", at, scene.shown(own)
        if commanded:
            kp, kd = control["kp"][i], control["kd"][i]
            errors = [
                np.stack([kp * (p.cmd[0] - p.q)[:, i], kd * (p.cmd[1] - p.dq)[:, i]], axis=1) for p in scene.paths
            ]
            asked = [Asked(extra=joint_column(p, i, e)) for p, e in zip(scene.paths, errors, strict=True)]
            yield "controller_gain", at, scene.shown(asked)
            top = max(float(np.max(np.abs(p.tau[:, i]))) for p in scene.paths)
            for share in (0.4, 0.55, 0.7, 0.8, 0.87, 0.93, 0.97):
                cut = [
                    joint_column(p, i, np.clip(p.tau[:, i], -share * top, share * top) - p.tau[:, i])
                    for p in scene.paths
                ]
                yield "torque_limit", at, scene.shown([Asked(extra=c) for c in cut])
        if scene.mode != "torque":
            moved = np.zeros(n)
            moved[i] = -1.0e-3
            yield "encoder_offset", at, scene.shown([path.bodies(robot, moved=moved) for path in scene.paths])
        for effect, names in (("link_inertia", INERTIAL), ("kinematic_error", KINEMATIC)):
            columns = []
            for path in scene.paths:
                columns.append(stacked([path.bodies(with_arm(scene, i, effect, name)) for name in names]))
            shown = scene.shown(columns)
            yield effect, at, shown
            if effect == "link_inertia" and i == n - 1:
                yield "payload", 0, shown
        yield from gear_errors(scene, i)
    tilts = []
    for path in scene.paths:
        parts = [
            path.bodies(scene.world([{"effect": "base_tilt", "at": 0, "parameters": p, "form": 0}]).robot)
            for p in ({"roll": 1.0e-3}, {"pitch": 1.0e-3})
        ]
        tilts.append(stacked(parts))
    yield "base_tilt", 0, scene.shown(tilts)
    if commanded and acting:
        for time in (0.001, 0.003, 0.006, 0.012):
            asked = [
                Asked(extra=(late(p.true.tau_cmd, time * p.rate) - p.true.tau_cmd)[:, :, None]) for p in scene.paths
            ]
            yield "delay", 0, scene.shown(asked)


def periodic(scene: Scene, i: int, slide: float):
    """Laws of the angle: the cycles that are best in torque are tried in the channels."""
    scale = 1.0 if slide == 1.0 else 20.0
    theta = np.concatenate([path.q[path.thin, i] for path in scene.paths])
    wide = max(float(np.ptp(theta)), 1.0e-6)
    cycles = np.arange(2.0, 80.0, min(1.0, max(0.1, 1.5 / wide / scale))) * scale
    asked = np.concatenate([scene.asked_torque(k)[path.thin, i] for k, path in enumerate(scene.paths)])
    power = [
        np.linalg.norm(np.linalg.lstsq(np.stack([np.sin(c * theta), np.cos(c * theta)], 1), asked, rcond=None)[0])
        for c in cycles
    ]
    for c in cycles[np.argsort(power)[-3:]]:
        for near in (c - 0.25 * (cycles[1] - cycles[0]), c, c + 0.25 * (cycles[1] - cycles[0])):
            waves = [np.stack([np.sin(near * p.q[:, i]), np.cos(near * p.q[:, i])], axis=1) for p in scene.paths]
            asked_by = [Asked(drive=joint_column(p, i, w)) for p, w in zip(scene.paths, waves, strict=True)]
            yield "torque_ripple", i + 1, scene.shown(asked_by)


def errors(path: Track, answers, i: int, cycles: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """A gear's error as sine and cosine of joint i's angle: (wave, torques of all drives) each, thin instants."""
    angle = cycles * path.q[path.thin, i]
    v, a = path.dq[path.thin, i] * cycles, path.ddq[path.thin, i] * cycles
    size = 1.0e-3
    out = []
    for wave, slope in ((np.sin(angle), np.cos(angle)), (np.cos(angle), -np.sin(angle))):
        first, second = slope * v, slope * a - wave * v * v
        torque = answers[0] * wave[:, None] + answers[1] * first[:, None] + answers[2] * second[:, None]
        # no power is lost: what is passed acts on the motor by the error's slope too
        torque[:, i] += cycles * slope * answers[3][:, i]
        out.append((size * wave, size * torque))
    return out


def gear_errors(scene: Scene, i: int):
    """(effect, at, columns) of a gear's error: the cycles that are best in joint i's torque are tried in channels."""
    robot, driven = scene.without.robot, list(range(scene.n))
    shaken = [path.shaken(Extras(), i) for path in scene.paths]
    scale = 20.0 if robot.prismatic[i] else 1.0
    theta = np.concatenate([path.q[path.thin, i] for path in scene.paths])
    asked = np.concatenate([scene.asked_torque(k)[path.thin, i] for k, path in enumerate(scene.paths)])
    cycles = np.arange(2.0, 80.0, min(2.0, max(0.25, 1.5 / max(float(np.ptp(theta)), 1.0e-6) / scale))) * scale
    power = []
    for c in cycles:
        waves = [errors(path, answers, i, c) for path, answers in zip(scene.paths, shaken, strict=True)]
        columns = np.concatenate([np.stack([torque[:, i] for _, torque in both], axis=1) for both in waves])
        columns /= np.linalg.norm(columns, axis=0) + 1.0e-300
        power.append(float(np.linalg.norm(columns.T @ asked)))
    step = float(cycles[1] - cycles[0])
    for c in cycles[np.argsort(power)[-2:]]:
        for near in (c - step / 3.0, c, c + step / 3.0):
            parts = []
            for path, answers in zip(scene.paths, shaken, strict=True):
                both = []
                for wave, torque in errors(path, answers, i, near):
                    given = path.gives(answers, driven, wave, i)
                    given.drive = path.spread(torque)[:, :, None]
                    both.append(given)
                parts.append(stacked(both))
            yield "transmission_error", i + 1, scene.shown(parts)


def giving(scene: Scene, i: int):
    """(effect, at, names of its stiffnesses, columns, deflections per unit of their factors at the largest load, and
    whether these are free) of what gives way under its load: play; compliance, bearings that tilt or shift, and bending
    arms at rest, and swinging at some frequencies."""
    robot = scene.without.robot
    load = max(float(np.max(np.abs(p.base.tau_link[:, i]))) for p in scene.paths) + 1.0e-9
    wanted = [("joint_compliance", ("stiffness",), Extras())]
    if not robot.prismatic[i]:
        tilts, shifts = ([(kind, axis) for axis in range(count)] for kind, count in ((REVOLUTE, 2), (PRISMATIC, 3)))
        wanted.append(("joint_compliance_6d", ("krx", "kry"), Extras(bearings={i: tilts})))
        wanted.append(("joint_compliance_6d", ("kx", "ky", "kz"), Extras(bearings={i: shifts})))
    if np.linalg.norm(robot.arms[i].transform()[:3, 3]) > 0.05:
        wanted.append(("link_flexibility", ("ku", "kv"), Extras(bends={i: 0.5})))
    unit = 1.0e-3
    for name, stiffnesses, extras in wanted:
        _, joints, hidden, _ = build_chain(robot, extras)
        own = name == "joint_compliance"
        nodes = [i] if own else [node for node, _, _ in hidden]
        shaken = [[path.shaken(extras, node) for node in nodes] for path in scene.paths]
        if own:
            loads = [answers[0][3][:, i] for answers in shaken]
            top = max(float(np.max(np.abs(values))) for values in loads) + 1.0e-12
            columns = [
                path.gives(answers[0], joints, -0.5 * unit * np.tanh(50.0 * values / top), i)
                for path, answers, values in zip(scene.paths, shaken, loads, strict=True)
            ]
            yield "backlash", i + 1, ("gap",), scene.shown(columns), np.array([unit]), True
        for frequency in (None, *SWINGS):
            parts, size = [], np.full(len(nodes), unit)
            if frequency:
                k = np.array(
                    [
                        np.median(np.concatenate([answers[c][2][:, node] for answers in shaken]))
                        * (2.0 * math.pi * frequency) ** 2
                        for c, node in enumerate(nodes)
                    ]
                )
                size = load / k
            for path, answers in zip(scene.paths, shaken, strict=True):
                columns = []
                for c, node in enumerate(nodes):
                    pull = answers[c][3][:, node].copy()
                    if frequency:
                        h = float(path.t[path.thin[1]])
                        damping = 0.1 * float(k[c]) / (2.0 * math.pi * frequency)
                        shift = swinging(pull, answers[c][2][:, node].copy(), float(k[c]), damping, h)
                    else:
                        shift = -pull * unit / load
                    columns.append(path.gives(answers[c], joints, shift, i if own else None))
                parts.append(stacked(columns))
            yield name, i + 1, stiffnesses, scene.shown(parts), size, frequency is None


def integrated(scene: Scene, effect: str, at: int, names: tuple[str, ...], begin: np.ndarray) -> float:
    """What the best spring or play of a place leaves, its law integrated along the motion; `names`: of its stiffnesses;
    `begin`: a first guess of what it gives way by at the largest load [rad or m]."""
    i = at - 1
    load = max(float(np.max(np.abs(p.base.tau_link[:, i]))) for p in scene.paths) + 1.0e-9
    wall = math.log(0.02 if not scene.without.robot.prismatic[i] else 0.002)
    low, high = np.full(len(begin), -14.0), np.full(len(begin), wall)
    first = np.log(np.maximum(begin, 1.0e-8))
    if effect != "backlash":
        # how long the spring's damper takes [s], as a power of 10
        low, high, first = np.append(low, -5.0), np.append(high, -1.0), np.append(first, -2.7)

    def made(x: np.ndarray) -> dict:
        if effect == "backlash":
            return {"gap": math.exp(x[0])}
        k = load / np.exp(x[:-1])
        b = k * 10.0 ** x[-1]
        if effect == "joint_compliance":
            return {"stiffness": float(k[0]), "damping": float(b[0])}
        dampings = ["b" + name[1:] for name in names]
        numbers = dict(zip((*names, *dampings), (*k.tolist(), *b.tolist()), strict=True))
        return numbers if effect == "joint_compliance_6d" else {**numbers, "at": 0.5}

    fastest = np.max([np.max(np.abs(path.dq), axis=0) for path in scene.paths], axis=0)

    def rest(x: np.ndarray) -> np.ndarray:
        spring = {"effect": effect, "at": at, "parameters": made(x), "form": 0}
        if substeps_needed(scene.world([spring]), scene.recipe["control"]["rate"], fastest) > MOST_SUBSTEPS:
            # as good as rigid
            return -scene.gap / math.sqrt(scene.energy)
        asked = scene.asked_by(spring)
        with np.errstate(over="ignore", invalid="ignore"):
            values = (scene.shown(asked)[:, 0] - scene.gap) / math.sqrt(scene.energy)
        return np.where(np.isfinite(values), np.clip(values, -1.0e3, 1.0e3), 1.0e3)

    start = np.clip(first, low + 1.0e-6, high - 1.0e-6)
    return float(2.0 * least_squares(rest, start, bounds=(low, high), max_nfev=15, diff_step=0.03).cost)


def looked_at(recipe: dict, index: int) -> dict:
    """What else could be the cause of what one effect of a case does: {"alike": [...], "near": {...}, "own": share}."""
    scene = Scene(recipe, index)
    near: dict[tuple[str, int], float] = {}
    for effect, at, columns in candidates(scene):
        left, factors = scene.left(columns, MOST.get(effect, math.inf))
        # a limit that adds torque, a delay that is none
        if effect in ("torque_limit", "delay") and factors[0] < 0.0:
            continue
        near[effect, at] = min(left, near.get((effect, at), 1.0))
    own = (scene.effect["effect"], scene.effect["at"])
    begins: dict[tuple[str, int, tuple[str, ...]], tuple[float, np.ndarray]] = {}
    for i in range(scene.n):
        for effect, at, names, columns, sizes, free in giving(scene, i):
            left, factors = scene.left(columns)
            if np.max(factors) <= 0.0:
                continue
            if left < begins.get((effect, at, names), (1.0,))[0]:
                begins[effect, at, names] = left, sizes * factors if free else sizes
            near[effect, at] = min(left, near.get((effect, at), 1.0))
    # where the right spring is not near at rest, others need not be
    reach = max(NEAR, near.get(own, 1.0) + 0.1) if own[0] in {effect for effect, *_ in begins} else NEAR
    reach = NEAR_SWINGING if own[0] in SWINGING else reach
    first = sorted((left, key) for key, (left, _) in begins.items() if key[:2] != own and left < reach)
    for left, key in first[:INTEGRATED]:
        near[key[:2]] = min(left, near[key[:2]], integrated(scene, *key, begins[key][1]))
    others = {key: left for key, left in near.items() if key != own}
    alike = sorted((left, effect, at) for (effect, at), left in others.items() if left < ALIKE)
    return {
        "effect": own[0],
        "at": place(*own),
        "own": near.get(own),
        "rms": math.sqrt(scene.energy / len(scene.gap)),
        "fitted": scene.fitted(),
        "alike": [{"effect": effect, "at": place(effect, at), "left": left} for left, effect, at in alike],
        "near": [
            {"effect": effect, "at": place(effect, at), "left": left}
            for (effect, at), left in sorted(others.items(), key=lambda item: item[1])
            if ALIKE <= left < KEPT
        ][:8],
    }


def alike_together(recipe: dict, rows: list[dict]) -> None:
    """Adds to every row of several effects what alone shows the same as all of them: "together".

    Alike is what leaves less than `ALIKE` of the energy of each of their gaps, and not of all together.
    """
    scene = Scene(recipe, None, without=world_of(recipe, [], drawn=recipe["drawn"]))
    scene.others = []
    acting = [asked for effect in recipe["effects"] if (asked := scene.acting(effect)) is not None]
    laws = [effect for effect in recipe["effects"] if scene.acting(effect) is None]
    asked = [*([scene.asked_by_law(laws)] if laws else []), *acting]
    scene.asks = asked[0]
    scene.gap = np.sum([scene.shown(one)[:, 0] for one in asked], axis=0)
    scene.energy = float(scene.gap @ scene.gap)
    least = min(row["rms"] for row in rows) ** 2 * len(scene.gap)
    near: dict[tuple[str, int], float] = {}
    for effect, at, columns in candidates(scene):
        left, factors = scene.left(columns, MOST.get(effect, math.inf))
        if effect in ("torque_limit", "delay") and factors[0] < 0.0:
            continue
        near[effect, at] = min(left * scene.energy / least, near.get((effect, at), math.inf))
    for row in rows:
        row["together"] = [
            {"effect": effect, "at": place(effect, at), "left": left}
            for (effect, at), left in sorted(near.items(), key=lambda item: item[1])
            if left < ALIKE
        ]


def place(effect: str, at: int) -> str:
    """As a diagnosis names it."""
    if at == 0:
        return "robot"
    return f"{'arm' if effect in ('link_inertia', 'kinematic_error', 'link_flexibility') else 'joint'}_{at}"


def told_apart(bank: Path, name: str) -> list[dict]:
    """What is alike for each effect of a case, looked at once and kept beside the truth."""
    kept = bank / "apart" / f"{name}.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    recipe = json.loads((bank / "sealed" / f"{name}.json").read_text())
    result = [looked_at(recipe, index) for index in range(len(recipe["effects"]))]
    if len(result) > 1:
        alike_together(recipe, result)
    kept.parent.mkdir(parents=True, exist_ok=True)
    half = kept.with_suffix(".half")
    half.write_text(json.dumps(result, indent=1) + "\n")
    half.replace(kept)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path)
    options = parser.parse_args()
    for path in sorted((options.bank / "sealed").glob("*.json")):
        for row in told_apart(options.bank, path.stem):
            others = ", ".join(f"{o['effect']} {o['at']}" for o in row["alike"])
            print(f"{path.stem} {row['effect']} {row['at']}: {others or 'like no other'}", flush=True)


if __name__ == "__main__":
    main()
