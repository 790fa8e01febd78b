"""Robots with chosen effects, and integrators of equations that stand in the tests, without any kernel of ours."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.motion import from_table, hold
from mbexport.core.representation import FrictionModel
from mbexport.core.simulation import simulate
from mbexport.core.simulation.backend import MachineState


def rows_of(name, table):
    defaults = {column.name: column.default for column in effect_named(name).columns}
    return tuple(EffectRow(at, {**defaults, **values}) for at, values in sorted(table.items()))


@pytest.fixture(scope="session")
def robot_with():
    """robot_with("pendulum", backlash={1: {"gap": 0.01}}, ...): a built-in robot with these effects and no others."""

    def make(name, *, smooth=None, **tables):
        database = load(name)
        effects = FrozenMap({effect: rows_of(effect, table) for effect, table in tables.items()})
        friction = database.friction if smooth is None else FrictionModel("smooth", smooth)
        return build(replace(database, effects=effects, levels=FrozenMap({}), friction=friction))

    return make


@pytest.fixture(scope="session")
def swing():
    """A quintic from rest to rest, as a motion law and as a formula: q, dq, ddq at t."""

    def make(start, end, duration):
        start, end = np.array(start, dtype=float), np.array(end, dtype=float)
        zeros = np.zeros((2, len(start)))
        law = from_table([0.0, duration], np.array([start, end]), zeros, zeros)

        def formula(t):
            u = min(t / duration, 1.0)
            way = end - start
            return (
                start + way * (10 * u**3 - 15 * u**4 + 6 * u**5),
                way * (30 * u**2 - 60 * u**3 + 30 * u**4) / duration,
                way * (60 * u - 180 * u**2 + 120 * u**3) / duration**2,
            )

        return law, formula

    return make


@pytest.fixture(scope="session")
def released():
    """released(robot, q, backend=..., duration=...): let go from rest, without motor torque."""

    def run(robot, q, *, theta=None, backend="urdf", duration=0.5, step=1.0e-4, rate=1000.0):
        q = np.array(q, dtype=float)
        theta = q.copy() if theta is None else np.array(theta, dtype=float)
        start = MachineState(0.0, q, np.zeros_like(q), theta, np.zeros_like(q))
        law = hold(q, duration)
        torque = np.zeros((int(duration * 1000) + 2, len(q)))
        control = Control("torque", rate=1000.0)
        return simulate(
            robot, backend, law, control, duration=duration, step=step, rate=rate, start=start, torque=torque
        )

    return run


@pytest.fixture(scope="session")
def sampled_loop():
    """Integrates x' = f(t, x, tau) with DOP853, tau held between the ticks of a controller, switched a delay later.

    Returns the states (ticks, len(x)) at the ticks, and the torque that acts just after each.
    """

    def run(f, x0, controller, rate, duration, delay=0.0, tolerance=1e-11):
        ticks = np.arange(round(duration * rate) + 1) / rate
        instants = sorted({*ticks.tolist(), *[t for t in (ticks + delay).tolist() if t <= duration]})
        x = np.array(x0, dtype=float)
        commanded = [np.atleast_1d(controller(0.0, x))]
        acting = commanded[0]
        states, torques = [], []
        for j, t in enumerate(instants):
            on_tick = t in ticks
            if on_tick and states:
                commanded.append(np.atleast_1d(controller(t, x)))
            late = int(np.floor((t - delay) * rate + 1e-6))
            if late >= 0:
                acting = commanded[min(late, len(commanded) - 1)]
            if on_tick:
                states.append(x.copy())
                torques.append(acting)
            if j + 1 < len(instants):
                span = (t, instants[j + 1])
                held = acting
                found = solve_ivp(
                    lambda s, y, held=held: f(s, y, held), span, x, method="DOP853", rtol=tolerance, atol=1e-13
                )
                x = found.y[:, -1]
        return np.array(states), np.array(torques)

    return run


class Pendulum:
    """The built-in pendulum by hand: inertia about its axis and the moment of its weight; 0 hangs down."""

    inertia = 8.0e-3 + 1.2 * 0.45**2
    weight = 1.2 * 9.81 * 0.45

    def gravity(self, q):
        return self.weight * np.sin(q)


class Planar2r:
    """The built-in two rods by hand (Spong's textbook form)."""

    m1, m2, l1, c1, c2, i1, i2 = 2.4, 1.2, 0.5, 0.25, 0.2, 0.05024, 0.01612
    g = 9.81

    def mass_matrix(self, q):
        m, c = self.m2, np.cos(q[1])
        a = self.i2 + m * (self.c2**2 + self.l1 * self.c2 * c)
        b = self.i1 + self.m1 * self.c1**2 + self.i2 + m * (self.l1**2 + self.c2**2 + 2 * self.l1 * self.c2 * c)
        return np.array([[b, a], [a, self.i2 + m * self.c2**2]])

    def bias(self, q, dq):
        h = self.m2 * self.l1 * self.c2 * np.sin(q[1])
        far = self.m2 * self.c2 * self.g * np.cos(q[0] + q[1])
        near = (self.m1 * self.c1 + self.m2 * self.l1) * self.g * np.cos(q[0])
        return np.array([-h * (2 * dq[0] * dq[1] + dq[1] ** 2) + near + far, h * dq[0] ** 2 + far])


@pytest.fixture(scope="session")
def pendulum():
    return Pendulum()


@pytest.fixture(scope="session")
def planar2r():
    return Planar2r()


@pytest.fixture(scope="session")
def lagrangian():
    """Accelerations of bodies whose frames are any function of coordinates, by Lagrange's equations.

    Frames are differentiated by complex steps, the mass matrix by differences; nothing recursive, no joints.
    """

    def make(bodies, gravity, potential=lambda x: 0.0 * x[..., 0]):
        """bodies: (mass, com, tensor about it, frame(x): (..., n) -> (..., 4, 4)); potential(x): springs [J]."""
        tiny = 1e-30

        def jacobians(x):
            """Of each body, at many states x (..., n): mass, velocities (..., 3, n) and turning of its center."""
            steps = x[..., None, :] + 1j * tiny * np.eye(x.shape[-1])
            for mass, com, tensor, frame in bodies:
                place = np.real(frame(x + 0j))[..., :3, :3]
                slope = np.imag(frame(steps)) / tiny
                linear = np.moveaxis(slope[..., :3, :3] @ com + slope[..., :3, 3], -1, -2)
                spin = slope[..., :3, :3] @ np.swapaxes(place, -1, -2)[..., None, :, :]
                angular = np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], axis=-2)
                yield mass, linear, angular, place @ tensor @ np.swapaxes(place, -1, -2)

        def mass_matrix(x):
            return sum(
                m * np.swapaxes(jv, -1, -2) @ jv + np.swapaxes(jw, -1, -2) @ tensor @ jw
                for m, jv, jw, tensor in jacobians(x)
            )

        def forces(x):
            """Of weight and springs, shape (n,)."""
            weight = sum(m * jv.T @ gravity for m, jv, _, _ in jacobians(x))
            return weight - np.imag(potential(x + 1j * tiny * np.eye(len(x)))) / tiny

        def acceleration(x, v, extra):
            n, h = len(x), 1e-5
            around = mass_matrix(x + h * np.concatenate([np.eye(n), -np.eye(n)]))
            slopes = (around[:n] - around[n:]) / (2 * h)
            coriolis = np.einsum("kij,k,j->i", slopes, v, v) - 0.5 * np.einsum("kij,i,j->k", slopes, v, v)
            return np.linalg.solve(mass_matrix(x), forces(x) - coriolis + extra)

        return acceleration, mass_matrix, forces

    return make


@pytest.fixture(scope="session")
def matrices():
    """Turns about an axis (0, 1, 2) and shifts, (..., 4, 4), of real or complex numbers."""

    def turn(axis, angle):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        angle = np.asarray(angle)
        matrix = np.zeros((*angle.shape, 4, 4), dtype=complex)
        matrix[..., axis, axis] = matrix[..., 3, 3] = 1.0
        matrix[..., j, j] = matrix[..., k, k] = np.cos(angle)
        matrix[..., j, k], matrix[..., k, j] = -np.sin(angle), np.sin(angle)
        return matrix

    def shift(*xyz):
        x, y, z = np.broadcast_arrays(*xyz)
        matrix = np.zeros((*x.shape, 4, 4), dtype=complex)
        matrix[...] = np.eye(4)
        matrix[..., 0, 3], matrix[..., 1, 3], matrix[..., 2, 3] = x, y, z
        return matrix

    return turn, shift
