"""Dry friction against its exact solution: under a held torque a rotor moves by parabolas between turns and stops."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.effects import EffectRow
from mbexport.core.motion import from_table
from mbexport.core.simulation import backend_named, backend_names, simulate

ENGINES = [name for name in backend_names() if backend_named(name).runs]
# of examples/robots/pendulum about its axis
INERTIA = 8.0e-3 + 1.2 * 0.45**2
KP, KD, TICK = 60.0, 4.0, 1.0e-3
TIMES = np.arange(3001) * TICK
LAW = from_table(TIMES, (0.6 * (1.0 - np.cos(2.1 * TIMES)) + 0.25 * (1.0 - np.cos(5.3 * TIMES)))[:, None])


def exact(friction):
    """Positions and speeds at the ticks of a rotor that turns and stops where its speed is zero, and nowhere else."""
    at, speed, out = 0.0, 0.0, []
    wanted = LAW.at(TIMES)
    for q, dq in zip(wanted[0][:, 0], wanted[1][:, 0], strict=True):
        out.append((at, speed))
        torque, left = KP * (q - at) + KD * (dq - speed), TICK
        while left > 0.0 and (speed != 0.0 or abs(torque) > friction):
            push = (torque - math.copysign(friction, speed or torque)) / INERTIA
            # until it stands, or the tick is over
            time = min(left, -speed / push) if push * speed < 0.0 else left
            at, speed = at + speed * time + 0.5 * push * time**2, 0.0 if time < left else speed + push * time
            left -= time
    return np.array(out)


# the bristle that holds a joint gives 5e-6 rad, and a stop or a turn is late by the time of its damping, a millisecond
@pytest.mark.parametrize("friction", [0.1, 2.0])
@pytest.mark.parametrize("engine", ENGINES)
def test_friction_turns_where_the_speed_does(engine, friction):
    # about a vertical axis no gravity acts
    pendulum = replace(load("pendulum"), gravity=(0.0, 0.0, 0.0))
    robot = assembled(pendulum, {"coulomb_friction": (EffectRow(1, {"torque": friction}),)})
    control = Control("pd", (KP,), (KD,), "none", 1.0 / TICK)
    run = simulate(robot, engine, LAW, control, nominal=assembled(pendulum, {}), rate=1.0 / TICK)
    q, dq = exact(friction)[: len(run.t)].T
    # an integrator of first order has errors of its own
    near = 4.0e-5 if backend_named(engine).order == 1 else 1.0e-5
    assert np.sqrt(np.mean((run.joints["q"][:, 0] - q) ** 2)) < near
    assert np.sqrt(np.mean((run.joints["dq"][:, 0] - dq) ** 2)) < 20.0 * near
