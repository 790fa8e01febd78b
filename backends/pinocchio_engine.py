"""An emitted URDF file, with the sheet beside it, running in Pinocchio."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np

from ..core.errors import RefusedError
from ..core.simulation.backend import Emission, MachineState, Vector
from ..core.simulation.by_address import Book
from . import pinocchio_stages as at
from .common import sheet_of
from .driven import DrivenEngine

_pinocchio: Any = import_module("pinocchio")


class PinocchioEngine(DrivenEngine):
    """Pinocchio's rigid bodies under the classical Runge-Kutta method of order 4 with fixed steps.

    Limits are not enforced. Linear friction is what the file says; springs, rotors, laws and gravity are the sheet's.
    """

    def __init__(self, emission: Emission) -> None:
        """Load an emission.

        Raises:
            RefusedError: Pinocchio cannot read the file.
        """
        sheet = sheet_of(emission)
        super().__init__(sheet.drives)
        model = _loaded(emission.files[emission.main], emission.main)
        names = sheet.drives.joints
        joints = [model.joints[model.getJointId(name)] for name in names]
        if len(joints) != model.nv or any(joint.nv != 1 for joint in joints):
            raise RefusedError(
                f"{emission.main} has {model.nv} degrees of freedom and not those of {len(names)} joints."
            )
        self._place = np.array([joint.idx_v for joint in joints], dtype=np.int64)
        self._first = np.array([joint.idx_q for joint in joints], dtype=np.int64)
        # a joint without limits has cosine and sine for a coordinate
        self._circle = np.array([joint.nq == 2 for joint in joints])
        self.drives.table.damping[:] = model.damping[self._place]
        model.damping = np.zeros(model.nv)
        model.gravity.linear = np.array(sheet.gravity)
        self._arms = model
        self._arms_data = model.createData()
        self._model = model.copy()
        armature = np.zeros(model.nv)
        armature[self._place] = np.where(self.elastic, 0.0, self.drives.table.inertia)
        self._model.armature = armature
        self._data = self._model.createData()
        self._base = model.getFrameId("base")
        self._tool = model.getFrameId("tool")
        self._start_state = np.zeros((4, self.n))
        self._clock = np.zeros(2)
        self._solved = False
        self._configuration = np.zeros(model.nq)
        self._velocity, self._torque = np.zeros(self.n), np.zeros(self.n)
        self._book = self._written_book()

    def _written_book(self) -> Book:
        n = self.n
        book = Book(self.drives)
        book.entries[at.ELASTIC] = int(self.elastic.sum())
        book.entries[at.CONFIGURATION_SIZE] = len(self._configuration)
        for place, array in (
            (at.ORDERED, np.argsort(~self.elastic, kind="stable").astype(np.int64)),
            (at.CLOCK, self._clock),
            (at.COMMAND, self.command),
            (at.START, self._start_state),
            (at.CONFIGURATION, self._configuration),
            (at.VELOCITY, self._velocity),
            (at.TORQUE, self._torque),
            (at.ACCELERATION, self._data.ddq),
            (at.MASS, self._arms_data.M),
            (at.BIAS, self._arms_data.nle),
            (at.FIRST, self._first),
            (at.PLACE, self._place),
            (at.CIRCLE, self._circle.astype(np.int64)),
            *((place, np.zeros((4, n))) for place in (at.SUM, at.SLOPE)),
            *((place, np.zeros((n, n))) for place in (at.MATRIX, at.FACTOR)),
            *((place, np.zeros(n)) for place in (at.VECTOR, at.ARM_BIAS, at.ARM_TORQUE)),
        ):
            book.put(place, array)
        return book

    def tool_in_base(self, q: Vector) -> Vector:
        """As the contract says."""
        data = self._arms_data
        _pinocchio.forwardKinematics(self._arms, data, self._configured(q))
        base = _pinocchio.updateFramePlacement(self._arms, data, self._base)
        tool = _pinocchio.updateFramePlacement(self._arms, data, self._tool)
        return np.array(base.actInv(tool).homogeneous)

    def mass_matrix(self, q: Vector) -> Vector:
        """As the contract says."""
        upper = np.triu(_pinocchio.crba(self._arms, self._arms_data, self._configured(q)))
        matrix = upper + np.triu(upper, 1).T
        return matrix[np.ix_(self._place, self._place)]

    def bias(self, q: Vector, dq: Vector) -> Vector:
        """As the contract says."""
        torque = _pinocchio.nonLinearEffects(self._arms, self._arms_data, self._configured(q), self._tangent(dq))
        return torque[self._place]

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """As the contract says."""
        configuration, velocity, acceleration = self._configured(q), self._tangent(dq), self._tangent(ddq)
        torque = _pinocchio.rnea(self._arms, self._arms_data, configuration, velocity, acceleration)
        return torque[self._place]

    def gravity(self, q: Vector) -> Vector:
        """As the contract says."""
        return _pinocchio.computeGeneralizedGravity(self._arms, self._arms_data, self._configured(q))[self._place]

    def _configured(self, q: Vector) -> Vector:
        """Pinocchio's configuration of joint positions."""
        q = np.asarray(q, dtype=float)
        configuration = np.zeros(self._arms.nq)
        circle = self._circle
        configuration[self._first] = np.where(circle, np.cos(q), q)
        configuration[self._first[circle] + 1] = np.sin(q[circle])
        return configuration

    def _tangent(self, values: Vector) -> Vector:
        """Speeds or accelerations in Pinocchio's order."""
        ordered = np.zeros(self.n)
        ordered[self._place] = values
        return ordered

    def _start(self, state: MachineState) -> None:
        self._start_state[:] = state.q, state.dq, state.theta, state.dtheta
        imposed = self._imposed is not None
        entries = self._book.entries
        self._book.impose(self._imposed)
        self._solved = self.drives.needs_load if not imposed else not self.elastic.all()
        entries[at.SOLVED] = self._solved
        self._begin, self._stage = at.stage_functions(self._solved)

    def _integrate(self, duration: float, steps: int) -> None:
        self._clock[:] = self._t, duration / steps
        address, stage = self._book.address, self._stage
        configuration, velocity, torque = self._configuration, self._velocity, self._torque
        self._begin(address)
        if self._solved:
            crba, bias = _pinocchio.crba, _pinocchio.nonLinearEffects
            model, data = self._arms, self._arms_data
            for _ in range(4 * steps):
                crba(model, data, configuration)
                bias(model, data, configuration, velocity)
                stage(address)
        else:
            aba = _pinocchio.aba
            model, data = self._model, self._data
            for _ in range(4 * steps):
                aba(model, data, configuration, velocity, torque)
                stage(address)
        if not math.isfinite(float(self._start_state.sum())):
            raise self._not_finite(self._t + duration)

    def _integrated(self) -> MachineState:
        q, dq, theta, dtheta = self._start_state.copy()
        return MachineState(self._t, q, dq, theta, dtheta)


def _loaded(text: str, name: str) -> Any:
    try:
        return _pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise RefusedError(f"Pinocchio refuses {name}: {' '.join(str(error).split())}.") from error
