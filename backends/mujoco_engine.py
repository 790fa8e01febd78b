"""An emitted MJCF file running in MuJoCo."""

from __future__ import annotations

import copy
import logging
import math
import xml.etree.ElementTree as ET
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import RefusedError
from ..core.simulation.backend import Emission, MachineState, Vector
from ..core.simulation.by_address import Book
from . import mujoco_callback as at
from .common import sheet_of
from .driven import DrivenEngine
from .mjcf_text import ARM_SPRING_SUFFIX, MOTOR_SUFFIX
from .mujoco_call import address_of
from .mujoco_follow import Followed, compiled_follow, timestep_of
from .mujoco_poses import posed, tools_at

if TYPE_CHECKING:
    from ..core.control import PdTable
    from ..core.simulation.timeline import Rows, Timeline

_mujoco: Any = import_module("mujoco")
_step: Any = _mujoco.mj_step
_log = logging.getLogger(__name__)


class MujocoEngine(DrivenEngine):
    """MuJoCo with RK4. Limits, contacts and its soft friction are off; the drives' laws are the common ones.

    Where all drives are linear and moved by torque MuJoCo does them by itself. Else the callback gives their torques
    and MuJoCo's own springs and dampers are off. Statics come from a second model, without armature.
    """

    def __init__(self, emission: Emission) -> None:
        """Load an emission.

        Raises:
            RefusedError: MuJoCo cannot hold the model.
        """
        sheet = sheet_of(emission).drives
        # compiling a model may warn already
        _keep_warnings_out_of_files()
        model = _loaded(emission.files[emission.main], emission.main)
        off = _mujoco.mjtDisableBit
        for bit in (off.mjDSBL_AUTORESET, off.mjDSBL_CONSTRAINT, off.mjDSBL_CONTACT, off.mjDSBL_SENSOR):
            model.opt.disableflags |= int(bit)
        model.jnt_actfrclimited[:] = 0
        super().__init__(sheet)
        self._model = model
        self._data = _mujoco.MjData(model)
        self._option = model.opt
        self._position, self._speed = self._data.qpos, self._data.qvel
        names = sheet.joints
        # every joint has one coordinate, so that a joint's number is its coordinate's
        self._arm = np.array([model.joint(name).id for name in names], dtype=np.int64)
        motors = [name + MOTOR_SUFFIX if soft else name for name, soft in zip(names, self.elastic, strict=True)]
        self._motor = np.array([model.joint(name).id for name in motors], dtype=np.int64)
        driven = np.array([not drive.passive for drive in sheet.drives])
        if [model.actuator(k).name for k in range(model.nu)] != [n for n, d in zip(names, driven, strict=True) if d]:
            raise RefusedError(f"{emission.main}: its actuators must be the joints' motors, in the joints' order.")
        self._driven = np.flatnonzero(driven)
        self._all_driven = bool(driven.all())
        if self._all_driven:
            # the held torques stand in MuJoCo's own array
            self.command = self._data.ctrl
        self._soft = self.elastic.astype(float)
        self._rigid = not self.elastic.any()
        self._read_drives(names)
        table = self.drives.table
        self._linear = len(table.kinds) == 0 and len(table.slip_level) == 0 and not table.half_gap.any()
        # in a serial chain every coordinate's row of the mass matrix is full up to the diagonal
        rows = model.M_rowadr.astype(np.int64)
        self._entries = rows[np.maximum.outer(self._arm, self._arm)] + np.minimum.outer(self._arm, self._arm)
        self._native = {
            name: getattr(model, name).copy() for name in ("jnt_stiffness", "dof_damping", "tendon_stiffness")
        }
        self._armature = model.dof_armature.copy()
        self._clock = np.zeros(2)
        self._book = self._written_book(rows)
        self._called = self._mixed = False
        self._callback: Any = None
        self._address: int = self._data._address
        self._followed: Followed | None = None
        self._step = 0.0
        self._statics = copy.copy(model)
        self._statics.dof_armature[:] = 0.0
        self._still = _mujoco.MjData(self._statics)
        self._torques = np.zeros(model.nv)
        base, tool = int(model.body("base").id), int(model.site("tool").id)
        self._posed = posed(self._statics, self._still, self._arm, base, tool)

    def _read_drives(self, names: tuple[str, ...]) -> None:
        """What the model says of the drives counts, not what the sheet beside it does."""
        model, table = self._model, self.drives.table
        table.inertia[:] = model.dof_armature[self._motor]
        table.damping[:] = model.dof_damping[self._motor]
        table.gain[self._driven] = model.actuator_gear[:, 0]
        table.stiffness[:] = np.where(self.elastic, model.jnt_stiffness[self._arm], 0.0)
        table.spring_damping[:] = np.where(self.elastic, model.dof_damping[self._arm], 0.0)
        table.arm_stiffness[:] = np.where(self.elastic, 0.0, model.jnt_stiffness[self._arm])
        table.arm_rest[:] = model.qpos_spring[self._arm]
        for i, name in enumerate(names):
            tendon = _mujoco.mj_name2id(model, _mujoco.mjtObj.mjOBJ_TENDON, name + ARM_SPRING_SUFFIX)
            if tendon >= 0:
                table.arm_stiffness[i] = model.tendon_stiffness[tendon]
                sign = model.wrap_prm[model.tendon_adr[tendon]]
                table.arm_rest[i] = sign * model.tendon_lengthspring[tendon, 0]

    def _written_book(self, rows: Any) -> Book:
        n, data = self.n, self._data
        book = Book(self.drives)
        book.entries[at.DOFS] = self._model.nv
        book.entries[at.ELASTIC] = int(self.elastic.sum())
        order = np.argsort(~self.elastic, kind="stable").astype(np.int64)
        for place, array in (
            (at.CLOCK, self._clock),
            (at.POSITION, data.qpos),
            (at.SPEED, data.qvel),
            (at.COMMAND, self.command),
            (at.APPLIED, data.qfrc_applied),
            (at.BIAS, data.qfrc_bias),
            (at.MASS, data.M),
            (at.ARMATURE, self._model.dof_armature),
            (at.ROWS, rows),
            (at.MOTOR, self._motor),
            (at.ARM, self._arm),
            (at.ORDERED, order),
            *((place, np.zeros(n * n)) for place in (at.MATRIX, at.FACTOR)),
            *((place, np.zeros(n)) for place in (at.VECTOR, at.ACCELERATION, at.ARM_BIAS, at.TORQUE)),
        ):
            book.put(place, array)
        return book

    def _all_followed(self) -> Followed | None:
        """What compiled code needs to go through a controlled run; None where it cannot."""
        timestep = timestep_of(self._model)
        if timestep is None or not self._all_driven:
            return None
        calls = self._book.entries[at.CALLS : at.CALLS + 1]
        return Followed(
            *(address_of("mj_step"), self._model._address, self._address),
            *(timestep, self._clock, calls, self._position, self._speed, self._motor, self._arm, self.command),
            *(np.zeros(self.n) for _ in range(5)),
        )

    def tool_in_base(self, q: Vector) -> Vector:
        """As the contract says."""
        return self.tools_in_base(q[np.newaxis])[0]

    def tools_in_base(self, q: Vector) -> Vector:
        """As the contract says, in compiled code."""
        return tools_at(self._posed, q)

    def mass_matrix(self, q: Vector) -> Vector:
        """As the contract says."""
        self._pose(q)
        _mujoco.mj_crb(self._statics, self._still)
        return np.array(self._still.M[self._entries])

    def bias(self, q: Vector, dq: Vector) -> Vector:
        """As the contract says."""
        return self.inverse_dynamics(q, dq, np.zeros(self.n))

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """As the contract says."""
        self._pose(q)
        data = self._still
        data.qvel[:] = 0.0
        data.qvel[self._arm] = dq
        data.qacc[:] = 0.0
        data.qacc[self._arm] = ddq
        _mujoco.mj_comVel(self._statics, data)
        _mujoco.mj_rne(self._statics, data, 1, self._torques)
        return self._torques[self._arm]

    def hold(self, torque: Vector) -> None:
        """As the contract says."""
        self._evaluated = False
        self.command[:] = torque
        if not self._all_driven:
            self._data.ctrl[:] = self.command[self._driven]

    def _pose(self, q: Vector) -> None:
        """The arms at q, motor sides and springs apart: deflections alone move them."""
        data = self._still
        data.qpos[:] = 0.0
        data.qpos[self._arm] = q
        _mujoco.mj_kinematics(self._statics, data)
        _mujoco.mj_comPos(self._statics, data)

    def _start(self, state: MachineState) -> None:
        model, data, motion = self._model, self._data, self._imposed
        self._called = not self._linear or motion is not None
        for name, values in self._native.items():
            getattr(model, name)[:] = 0.0 if self._called else values
        model.dof_armature[:] = self._armature
        if motion is not None:
            # an imposed motor side may weigh anything but nothing
            weightless = self._motor[self.elastic & (self._armature[self._motor] == 0.0)]
            model.dof_armature[weightless] = 1.0
        _mujoco.mj_resetData(model, data)
        self._put(state)
        data.time = state.t
        self._book.impose(motion)
        self._mixed = motion is not None and not self.elastic.all()
        self._book.entries[at.MIXED] = self._mixed
        if self._called:
            way = "motion" if motion is not None else "load" if self.drives.needs_load else "torque"
            self._book.entries[at.WAY] = at.WAYS.index(way)
            self._callback = at.callback()

    def _put(self, state: MachineState) -> None:
        data = self._data
        data.qpos[self._arm] = state.q - np.where(self.elastic, state.theta, 0.0)
        data.qvel[self._arm] = state.dq - np.where(self.elastic, state.dtheta, 0.0)
        data.qpos[self._motor[self.elastic]] = state.theta[self.elastic]
        data.qvel[self._motor[self.elastic]] = state.dtheta[self.elastic]

    def _integrate(self, duration: float, steps: int) -> None:
        step = duration / steps
        if step != self._step:
            self._option.timestep = self._step = step
        if self._called:
            if self._mixed:
                # rounding of the rigid joints' imposed motion starts anew
                self._put(self.state())
            self._book.entries[at.CALLS] = 0
            self._clock[0] = self._t
            self._clock[1] = step
            seat = at.take_seat(self._address, self._book.address, self._callback)
            try:
                _step(self._model, self._data, steps)
            finally:
                at.leave_seat(seat, self._callback)
        else:
            _step(self._model, self._data, steps)
        # what is no number spreads to all coordinates of a chain within a step
        if not math.isfinite(self._speed.item(0)):
            raise self._not_finite(self._t + duration)

    def follow(self, timeline: Timeline, law: PdTable, offsets: Vector, rows: Rows) -> bool:
        """As the contract says.

        Raises:
            RefusedError: The state is no longer finite.
        """
        self._followed = self._followed or self._all_followed()
        if self._followed is None:
            return False
        seat = at.take_seat(self._address, self._book.address, self._callback) if self._called else None
        try:
            broken, self._t = compiled_follow()(self._followed, self._t, offsets, timeline, law, rows)
        finally:
            if seat is not None:
                at.leave_seat(seat, self._callback)
        self._step, self._evaluated, self._seen = 0.0, False, None
        if broken >= 0:
            raise self._not_finite(self._t)
        return True

    def _integrated(self) -> MachineState:
        position, speed = self._position, self._speed
        if self._rigid:
            return MachineState(self._t, position.copy(), speed.copy(), position.copy(), speed.copy())
        theta, dtheta = position.take(self._motor), speed.take(self._motor)
        q, dq = position.take(self._arm), speed.take(self._arm)
        q += self._soft * theta
        dq += self._soft * dtheta
        return MachineState(self._t, q, dq, theta, dtheta)


def _loaded(text: str, name: str) -> Any:
    try:
        return _mujoco.MjModel.from_xml_string(_without_meshes(text))
    except ValueError as error:
        reason = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())
        raise RefusedError(f"MuJoCo refuses {name}: {reason}.") from error


def _without_meshes(text: str) -> str:
    """The model without its meshes, which are only looked at, and whose files need not be there for a run."""
    if "<mesh " not in text:
        return text
    root = ET.fromstring(text)
    for parent in root.iter():
        for child in [child for child in parent if child.tag == "mesh" or child.get("type") == "mesh"]:
            parent.remove(child)
    return ET.tostring(root, encoding="unicode")


def _keep_warnings_out_of_files() -> None:
    """MuJoCo writes its warnings into MUJOCO_LOG.TXT in the working directory unless someone takes them."""
    if _mujoco.get_mju_user_warning() is None:
        _mujoco.set_mju_user_warning(_log.debug)
