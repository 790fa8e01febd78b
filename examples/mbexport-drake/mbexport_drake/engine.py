"""An emitted SDF file, with the sheet beside it, running in Drake."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from mbexport import DrivenEngine, Emission, MachineState
from mbexport.backends.common import sheet_of
from mbexport.core.simulation.imposed import imposed_acceleration, rigid_joint_torques

from .arms import Arms

SCHEME = "runge_kutta5"
# what the integrator is begun with [s]; each advance says its own
LONGEST = 0.1
# a boundary that is rounded up must not cost a step of its own
STRETCH = 1.0 + 1e-9


class DrakeEngine(DrivenEngine):
    """Drake's rigid bodies; what the drives do to them is a system of its own in the diagram.

    Damping and rotors of rigid joints and springs on the arms are what the SDF file says; all else is the sheet's.
    """

    def __init__(self, emission: Emission) -> None:
        """Load an emission.

        Raises:
            RefusedError: Drake cannot read the file.
        """
        sheet = sheet_of(emission)
        super().__init__(sheet.drives)
        self._emission, self._gravity_in_world = emission, sheet.gravity
        self._arms = self._read()
        arms, table = self._arms, self.drives.table
        table.damping[:] = np.where(self.elastic, table.damping, arms.damping)
        table.inertia[:] = np.where(self.elastic, table.inertia, arms.rotors)
        table.arm_stiffness[:], table.arm_rest[:] = arms.springs
        self._plant = arms.plant
        self._context = self._plant.CreateDefaultContext()
        arms.silence(self._context, rotors=True)
        self._some_rigid = not self.elastic.all()
        # one that torque moves and one whose motor sides follow a motion, made when they are needed
        self._machines: dict[bool, Machine] = {}

    def _read(self) -> Arms:
        emission = self._emission
        return Arms(emission.files[emission.main], emission.main, self.drives.sheet.joints, self._gravity_in_world)

    # statics, of the arms alone

    def _put(self, q, dq=None) -> None:
        still = np.zeros(self.n)
        self._plant.SetPositionsAndVelocities(self._context, self._arms.in_drakes_order(q, still if dq is None else dq))

    def tool_in_base(self, q):
        """As the contract says."""
        self._put(q)
        base, tool = (self._plant.GetFrameByName(name) for name in ("base", "tool"))
        return self._plant.CalcRelativeTransform(self._context, base, tool).GetAsMatrix4()

    def mass_matrix(self, q):
        """As the contract says."""
        self._put(q)
        place = self._arms.place
        return self._plant.CalcMassMatrix(self._context)[np.ix_(place, place)]

    def bias(self, q, dq):
        """As the contract says."""
        self._put(q, dq)
        torque = self._plant.CalcBiasTerm(self._context) - self._plant.CalcGravityGeneralizedForces(self._context)
        return torque[self._arms.place]

    def inverse_dynamics(self, q, dq, ddq):
        """As the contract says."""
        self._put(q, dq)
        plant, place = self._plant, self._arms.place
        acceleration = np.zeros(self.n)
        acceleration[place] = ddq
        torque = plant.CalcInverseDynamics(self._context, acceleration, MultibodyForces(plant))
        return (torque - plant.CalcGravityGeneralizedForces(self._context))[place]

    # a run

    def hold(self, torque) -> None:
        """As the contract says."""
        super().hold(torque)
        self._machine.changed()

    def _start(self, state: MachineState) -> None:
        moved = self._imposed is None
        if moved not in self._machines:
            self._machines[moved] = Machine(self, self._read(), moved)
        self._machine = self._machines[moved]
        self._machine.reset(state)

    def _integrate(self, duration: float, steps: int) -> None:
        try:
            self._machine.advance(duration, steps)
        except RuntimeError as error:
            # Drake's own word for a state that it cannot go on from
            raise self._not_finite(self._t) from error
        if not np.isfinite(np.concatenate(self._machine.coordinates())).all():
            raise self._not_finite(self._t + duration)

    def _integrated(self) -> MachineState:
        return MachineState(self._t, *self._sides(*self._machine.coordinates()))

    def _sides(self, x, v):
        """q, dq, theta, dtheta from the coordinates; where motion is imposed, theta and dtheta do not count."""
        n = self.n
        q, dq, theta, dtheta = x[:n].copy(), v[:n].copy(), x[:n].copy(), v[:n].copy()
        if len(x) > n:
            theta[self.elastic], dtheta[self.elastic] = x[n:], v[n:]
        return q, dq, theta, dtheta

    def torques(self, t: float, x, v, accept: bool = False):
        """Torques of the drives on the coordinates: of the arms, then of the motor sides that move freely."""
        drives, n = self.drives, self.n
        out = np.zeros(len(x))
        if self._imposed is not None:
            theta, dtheta, ddtheta = np.empty((3, n))
            self._motion_at(t, self._imposed_table, theta, dtheta, ddtheta)
            drives.theta[:], drives.dtheta[:] = theta, dtheta
            drives.coordinate_torques(t, x, v, self.command, out, accept)
            if self._some_rigid:
                wanted = imposed_acceleration(x, v, theta, dtheta, ddtheta)
                out = rigid_joint_torques(self.mass_matrix(x), self.bias(x, v), out, ~self.elastic, wanted)
        elif drives.needs_load:
            q, dq, theta, dtheta = self._sides(x, v)
            matrix, bias = self.mass_matrix(q), self.bias(q, dq)
            drives.evaluate_loaded(t, q, dq, theta, dtheta, self.command, matrix, bias, accept=accept)
            driving = drives.motor_torque(self.command)
            out[:n] = np.where(self.elastic, drives.transmitted, driving) + drives.on_arm
            out[n:] = driving[self.elastic]
        else:
            drives.coordinate_torques(t, x, v, self.command, out, accept)
        return out


class Machine:
    """The arms and the drives in one diagram, with the simulator that runs it."""

    def __init__(self, engine: DrakeEngine, arms: Arms, moved: bool) -> None:
        """Wire it; `moved` by torque, so that the motor sides of elastic joints move freely."""
        builder = DiagramBuilder()
        self._plant = builder.AddSystem(arms.plant)
        self._drives = builder.AddSystem(DriveSystem(engine, arms, moved))
        builder.Connect(self._plant.get_state_output_port(), self._drives.GetInputPort("arms"))
        builder.Connect(self._drives.GetOutputPort("torques"), self._plant.get_applied_generalized_force_input_port())
        self._simulator = Simulator(builder.Build())
        self._integrator = ResetIntegratorFromFlags(self._simulator, SCHEME, LONGEST)
        self._integrator.set_fixed_step_mode(True)
        self._context = self._simulator.get_mutable_context()
        self._of_arms = self._plant.GetMyMutableContextFromRoot(self._context)
        self._of_drives = self._drives.GetMyMutableContextFromRoot(self._context)
        # imposed motion takes whatever torque it takes, so rotors do not count there
        arms.silence(self._of_arms, rotors=not moved)
        self._engine, self._arms, self._moved = engine, arms, moved

    def reset(self, state: MachineState) -> None:
        """Put a state in."""
        self._context.SetTime(state.t)
        self._plant.SetPositionsAndVelocities(self._of_arms, self._arms.in_drakes_order(state.q, state.dq))
        if self._moved:
            elastic = self._engine.elastic
            self._of_drives.SetContinuousState(np.concatenate([state.theta[elastic], state.dtheta[elastic]]))
        self._integrator.set_maximum_step_size(LONGEST)
        self._simulator.Initialize()

    def changed(self) -> None:
        """What the drives do has changed at the state that is, which Drake cannot know."""
        now = self._plant.GetPositionsAndVelocities(self._of_arms)
        self._plant.SetPositionsAndVelocities(self._of_arms, now)

    def coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of arms and free motor sides, and their speeds."""
        return self._drives.coordinates(self._plant.GetPositionsAndVelocities(self._of_arms), self._of_drives)

    def advance(self, duration: float, steps: int) -> None:
        """Integrate over a duration [s] in that many equal steps."""
        begin = self._context.get_time()
        self._integrator.set_maximum_step_size(STRETCH * duration / steps)
        if not self._engine.drives.remembers:
            self._simulator.AdvanceTo(begin + duration)
            return
        for k in range(steps):
            t = begin + (k + 1) * duration / steps
            self._simulator.AdvanceTo(t)
            self._engine.torques(t, *self.coordinates(), accept=True)
            self.changed()


class DriveSystem(LeafSystem):
    """From the state of the arms to the torques of the drives; its own state are motor sides that move freely."""

    def __init__(self, engine: DrakeEngine, arms: Arms, moved: bool) -> None:
        """See Machine."""
        super().__init__()
        self._engine, self._arms, self._n = engine, arms, engine.n
        self._motors = int(engine.elastic.sum()) if moved else 0
        self._inertia = engine.drives.table.inertia[engine.elastic]
        self._input = self.DeclareVectorInputPort("arms", 2 * self._n)
        if self._motors:
            self.DeclareContinuousState(self._motors, self._motors, 0)
        self.DeclareVectorOutputPort("torques", self._n, self._torques_on_arms)

    def coordinates(self, state_of_arms, context):
        """Positions of arms and free motor sides, and their speeds, from Drake's own order."""
        q, dq = self._arms.in_our_order(state_of_arms)
        if not self._motors:
            return q, dq
        motors = context.get_continuous_state_vector().CopyToVector()
        return np.concatenate([q, motors[: self._motors]]), np.concatenate([dq, motors[self._motors :]])

    def _torques_on_arms(self, context, output) -> None:
        x, v = self.coordinates(self._input.Eval(context), context)
        ordered = np.zeros(self._n)
        ordered[self._arms.place] = self._engine.torques(context.get_time(), x, v)[: self._n]
        output.SetFromVector(ordered)

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:  # noqa: N802 (Drake's name)
        """Speeds and accelerations of the motor sides."""
        if self._motors:
            x, v = self.coordinates(self._input.Eval(context), context)
            torques = self._engine.torques(context.get_time(), x, v)[self._n :]
            derivatives.get_mutable_vector().SetFromVector(np.concatenate([v[self._n :], torques / self._inertia]))
