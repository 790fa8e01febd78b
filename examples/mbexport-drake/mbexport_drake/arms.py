"""The rigid bodies of an SDF file in a Drake plant, and what the file says of the drives."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ForceElementIndex, PrismaticSpring, RevoluteSpring

from mbexport import RefusedError


class Arms:
    """A plant in which nothing acts on the joints by itself.

    Attributes:
        plant: The plant, in continuous time.
        place: Of each joint, base to tool, in Drake's vectors, shape (n,).
        damping: What the file says, shape (n,).
        rotors: Inertia of the rotors in the file, 0 where there is none, shape (n,).
        springs: Stiffness and rest of the springs on the joints in the file, two of shape (n,).
    """

    def __init__(self, text: str, name: str, joints: Sequence[str], gravity: Sequence[float]) -> None:
        """Read a file.

        Args:
            text: Its text.
            name: Its name, for messages.
            joints: Names of the joints, base to tool.
            gravity: In the world [m/s^2].

        Raises:
            RefusedError: Drake cannot read it, or it has other joints.
        """
        self.plant = MultibodyPlant(0.0)
        log = logging.getLogger("drake")
        level = log.level
        # it warns of friction and limits, which runs do not leave to it
        log.setLevel(logging.ERROR)
        try:
            Parser(self.plant).AddModelsFromString(text, "sdf")
            found = [self.plant.GetJointByName(joint) for joint in joints]
            self.damping = np.array([joint.default_damping() for joint in found])
            for joint in found:
                joint.set_default_damping(0.0)
                joint.set_position_limits([-np.inf], [np.inf])
            self.plant.mutable_gravity_field().set_gravity_vector(gravity)
            self.plant.Finalize()
        except RuntimeError as error:
            raise RefusedError(f"Drake refuses {name}: {' '.join(str(error).split())}") from error
        finally:
            log.setLevel(level)
        if self.plant.num_velocities() != len(joints):
            raise RefusedError(f"{name} has {self.plant.num_velocities()} degrees of freedom, not {len(joints)}.")
        self.place = np.array([joint.velocity_start() for joint in found])
        self._order = np.concatenate([self.place, len(joints) + self.place])
        rotors = {motor.joint().name(): motor.default_reflected_inertia() for motor in self._motors()}
        self.rotors = np.array([rotors.get(joint, 0.0) for joint in joints])
        springs = {spring.joint().name(): (spring.default_stiffness(), _rest(spring)) for spring in self._springs()}
        self.springs = np.array([springs.get(joint, (0.0, 0.0)) for joint in joints]).T

    def silence(self, context, *, rotors: bool) -> None:
        """Take out of a context what is among the drives' torques: springs, and rotors if wanted."""
        for spring in self._springs():
            spring.SetStiffness(context, 0.0)
        for motor in self._motors() if rotors else ():
            motor.SetRotorInertia(context, 0.0)

    def in_drakes_order(self, q, dq) -> np.ndarray:
        """A state of the joints, base to tool, as Drake has it, shape (2 n,)."""
        state = np.empty(2 * len(self.place))
        state[self._order] = np.concatenate([q, dq])
        return state

    def in_our_order(self, state) -> tuple[np.ndarray, np.ndarray]:
        """Positions and speeds of the joints, base to tool."""
        ordered = state[self._order]
        return ordered[: len(self.place)], ordered[len(self.place) :]

    def _motors(self):
        return [self.plant.get_joint_actuator(index) for index in self.plant.GetJointActuatorIndices()]

    def _springs(self):
        elements = [self.plant.get_force_element(ForceElementIndex(i)) for i in range(self.plant.num_force_elements())]
        return [element for element in elements if isinstance(element, RevoluteSpring | PrismaticSpring)]


def _rest(spring: RevoluteSpring | PrismaticSpring) -> float:
    turns = isinstance(spring, RevoluteSpring)
    return spring.default_nominal_angle() if turns else spring.default_nominal_position()
