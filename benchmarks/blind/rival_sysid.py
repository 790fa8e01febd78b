"""MuJoCo's own `mujoco.sysid`: armature, damping and frictionloss of every joint that moves, by its own optimizer.

Mode pd: the controller is made of actuators, and positions and torques under it are compared, in units of their noise
floor. Other modes: the torque drives the model in windows of half a second, each begun from the smoothed measurement,
and positions are compared. Steps are ticks of the controller. Intervals are its own `calculate_intervals`.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from given import Given, Number, Vector

from mbexport.core.control.controller import feedforward_along
from mbexport.core.diagnosis.prepare import Prepared
from mbexport.core.diagnosis.resimulate import held_torque
from mbexport.core.recording import Run

ATTRIBUTES = {"rotor_inertia": "armature", "viscous_friction": "damping", "coulomb_friction": "frictionloss"}
WINDOW = 0.5
# of a free torque [Hz]
RATE = 1000.0
ITERATIONS = 15
# steps of differences, and where a number begins that is nominally on its bound, in units of its scale
DIFFERENCE, OFF_BOUND = 1.0e-4, 0.01
MOST = 3.0
# joints slower than this in the mean stand [rad/s or m/s]
STANDS = 1.0e-3
SETTLING = 50


def is_there() -> bool:
    """Whether what `mujoco.sysid` needs beside MuJoCo is installed: without it the module is empty."""
    return hasattr(import_module("mujoco.sysid"), "optimize")


def fitted(case: Given) -> tuple[Number, ...]:
    """The numbers of every joint that moves."""
    sysid: Any = import_module("mujoco.sysid")
    # it warns of sensors of the exported model that the runs do not have
    logging.getLogger("absl").setLevel(logging.ERROR)
    spec: Any = mujoco.MjSpec.from_string(case.mjcf)
    control = case.runs[0].control
    held = control.mode in ("pd", "torque")
    spec.option.timestep = 1.0 / (control.rate if held else RATE)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    names = [f"joint_{i + 1}" for i in range(case.n)]
    stiff = [joint for joint in spec.joints if joint.frictionloss > 0.0]
    for joint in spec.joints:
        # friction as the exported model has it elsewhere, or as hard as the step lets it be
        joint.solref_friction[:2] = stiff[0].solref_friction[:2] if stiff else [2.0 * spec.option.timestep, 1.0]
        joint.solimp_friction[:3] = [0.99, 0.999, 1.0e-4]
    if control.mode == "pd":
        for i, name in enumerate(names):
            under_control(spec.actuator(name), control.kp[i], control.kd[i], spec.option.timestep)
    model: Any = spec.compile()
    noise, columns = case.sigma("tau"), columns_of(case.motions)
    parameters = sysid.ParameterDict()
    for i, name in enumerate(names):
        if columns["viscous_friction"][i] < STANDS:
            continue
        torque = max(float(np.sqrt(np.mean([np.mean(m.measured["tau"][:, i] ** 2) for m in case.motions]))), noise[i])
        for effect, attribute in ATTRIBUTES.items():
            nominal, scale = float(getattr(model, f"dof_{attribute}")[i]), torque / columns[effect][i]
            parameters.add(scaled(sysid, effect, name, nominal, scale))
    sequences = [sysid.ModelSequences(*row, allow_missing_sensors=True) for row in chunks(sysid, case, spec, model)]
    compare = Compared(model, case.sigma("q"), noise if control.mode == "pd" else None)
    residual = sysid.build_residual_fn(
        models_sequences=sequences, modify_residual=compare, n_threads=1, resample_true=False
    )
    found, result = sysid.optimize(
        parameters,
        residual,
        "mujoco",
        verbose=False,
        output=io.StringIO(),
        max_iters=ITERATIONS,
        x_scale="jac",
        eps=DIFFERENCE,
        xtol=1.0e-4,
    )
    left, _, _ = residual(result.x, found)
    _, halves = sysid.calculate_intervals(left, result.jac)
    numbers: list[Number] = []
    for (key, parameter), half in zip(found.items(), halves, strict=True):
        effect, name = key.split()
        i = names.index(name)
        nominal, scale = float(getattr(model, f"dof_{ATTRIBUTES[effect]}")[i]), parameter.scale
        change = float(parameter.value[0]) * scale
        shows = abs(change) * columns[effect][i] / noise[i]
        numbers.append(Number(effect, i + 1, nominal, max(0.0, nominal + change), float(half) * scale, float(shows)))
    return tuple(numbers)


def columns_of(motions: Sequence[Prepared]) -> dict[str, Vector]:
    """Root mean square of what each number is multiplied by, along the runs, (n,)."""
    speeds, pushes = (np.concatenate([getattr(m, name) for m in motions]) for name in ("dq", "ddq"))
    moving = np.abs(speeds) > STANDS
    return {
        "rotor_inertia": np.sqrt(np.mean(pushes**2, axis=0)),
        "viscous_friction": np.sqrt(np.mean(speeds**2, axis=0)),
        "coulomb_friction": np.sqrt(np.mean(moving, axis=0)),
    }


def scaled(sysid: Any, effect: str, joint: str, nominal: float, scale: float) -> Any:
    """A parameter as its change in units of `scale`, what makes as much torque as there is."""
    attribute = ATTRIBUTES[effect]

    def put(spec: Any, parameter: Any) -> None:
        value = max(0.0, nominal + float(parameter.value[0]) * scale)
        have = getattr(spec.joint(joint), attribute)
        if np.ndim(have):
            have[0] = value
        else:
            setattr(spec.joint(joint), attribute, value)

    parameter = sysid.Parameter(f"{effect} {joint}", 0.0, -nominal / scale, MOST, modifier=put)
    parameter.value[:] = OFF_BOUND if nominal == 0.0 else 0.0
    parameter.scale = scale
    return parameter


def under_control(actuator: Any, kp: float, kd: float, h: float) -> None:
    """Make an actuator of a controller whose torque is held for a step h: kp (q_cmd - q) + kd (dq_cmd - dq).

    The positions of Euler's steps are half a step ahead of the speeds: q - h dq / 2 is exact for a held torque.
    """
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.biasprm[:3] = [0.0, -kp, -kd + 0.5 * h * kp]


def chunks(sysid: Any, case: Given, spec: Any, model: Any) -> list[tuple[Any, ...]]:
    """Arguments of `ModelSequences`: a run under its controller, or windows of it under its torque."""
    out: list[tuple[Any, ...]] = []
    h = float(model.opt.timestep)
    for number, (run, motion) in enumerate(zip(case.runs, case.motions, strict=True)):
        if run.control.mode == "pd":
            times = np.arange(int(run.duration / h + 1.0e-6) + 2) * h
            begin, controls = commanded(case, run, model, times)
            out.append(sequence(sysid, spec, model, str(number), run, times, controls, begin, np.zeros(case.n)))
            continue
        for start in np.arange(0.0, run.duration - 0.5 * WINDOW, WINDOW):
            times = start + np.arange(int(WINDOW / h) + 2) * h
            if run.control.mode == "torque":
                controls = held_torque(run, times)
            else:
                good = np.isfinite(run.signals["tau"]).all(axis=1)
                controls = between(times, run.t[good], run.signals["tau"][good])
            q, dq = (between(np.array([start]), motion.t, values)[0] for values in (motion.q, motion.dq))
            out.append(sequence(sysid, spec, model, f"{number} {start!r}", run, times, controls, q, dq))
    return out


def commanded(case: Given, run: Run, model: Any, times: Vector) -> tuple[Vector, Vector]:
    """(where the model settles under the controller (n,), what its actuators are told (m, n))."""
    kp, kd = np.array(run.control.kp), np.array(run.control.kd)
    q_cmd, dq_cmd, ddq_cmd = run.motion().at(np.minimum(times, run.duration))
    ahead = feedforward_along(case.robot, run.control, q_cmd, dq_cmd, ddq_cmd)
    data: Any = mujoco.MjData(model)
    data.qpos[:] = q_cmd[0]
    for _ in range(SETTLING):
        mujoco.mj_forward(model, data)
        data.qpos[:] = q_cmd[0] + (ahead[0] - data.qfrc_bias) / kp
    return np.array(data.qpos), kp * q_cmd + kd * dq_cmd + ahead


def sequence(
    sysid: Any,
    spec: Any,
    model: Any,
    name: str,
    run: Run,
    times: Vector,
    controls: Vector,
    q: Vector,
    dq: Vector,
) -> tuple[Any, ...]:
    """One stretch of a run, its time from 0."""
    h = times[1] - times[0]
    state = sysid.create_initial_state(model, q + 0.5 * h * dq, dq)
    rows = (run.t >= times[0]) & (run.t < times[-2])
    measured = np.hstack([run.signals["q"], run.signals["tau"]])[rows]
    begin = times[0]
    return (
        name,
        spec,
        name,
        state,
        sysid.TimeSeries(times - begin, controls),
        sysid.TimeSeries(run.t[rows] - begin, measured),
    )


class Compared:
    """Measured less simulated positions, and torques where a controller gives them, in units of noise."""

    def __init__(self, model: Any, position_noise: Vector, torque_noise: Vector | None) -> None:
        self.position_noise, self.torque_noise = position_noise, torque_noise
        sensors = [model.sensor(f"joint_{i + 1}_torque").adr[0] for i in range(model.nv)]
        self.torques = np.array(sensors)

    def __call__(
        self, params: Any, predicted: Any, measured: Any, model: Any, everything: bool, *, state: Vector, **_: Any
    ) -> tuple[Vector, Any, Any]:
        n, h = model.nv, model.opt.timestep
        q = state[:, 1 : 1 + n] - 0.5 * h * state[:, 1 + n : 1 + 2 * n]
        parts = [(measured.data[:, :n] - between(measured.times, state[:, 0], q)) / self.position_noise]
        if self.torque_noise is not None:
            # a rollout's sensors are those of the step's begin
            tau = between(measured.times, state[:, 0] - h, predicted.data[:, self.torques])
            parts.append((measured.data[:, n:] - tau) / self.torque_noise)
        return np.nan_to_num(np.hstack(parts)), measured, measured


def between(times: Vector, grid: Vector, values: Vector) -> Vector:
    """Linear interpolation of columns, (k, n)."""
    return np.stack([np.interp(times, grid, column) for column in values.T], axis=1)
