"""What a simulated robot records: labelled arrays in memory, a run (log.md) on disk."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import write_whole
from ..representation import JointKind
from ..signals import JOINT_SIGNALS, POSITION_SIGNALS, TURN_SIGNALS, joint_unit
from .backend import Vector

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A run of a simulated robot.

    Attributes:
        t: Times [s], shape (m,).
        joints: Signal name of log.md without its number -> values, shape (m, n); SI, radians.
        tool_in_base: Pose of the tool centre point, shape (m, 4, 4).
        kinds: "revolute" or "prismatic" of each joint.
        facts: How it was made: robot, level, backend, engine, version, integrator, step, control, notes.
        warnings: What a user should know: limits left, saturation.
    """

    t: Vector
    joints: Mapping[str, Vector]
    tool_in_base: Vector
    kinds: tuple[JointKind, ...]
    facts: Mapping[str, Any]
    warnings: tuple[str, ...] = field(default=())

    @property
    def tip(self) -> Vector:
        """Position of the tool centre point in the base [m], shape (m, 3)."""
        return self.tool_in_base[:, :3, 3]

    def with_noise(self, sigma: Mapping[str, Sequence[float]], seed: int = 0) -> Trace:
        """The same run with white Gaussian noise on what sensors report.

        Args:
            sigma: Signal (q, dq, q_link, tau, tau_link, ee [m], ee_rot [rad]) to standard deviations, one a joint
                (ee's: one).
            seed: The same seed gives the same noise.
        """
        from scipy.spatial.transform import Rotation

        joints, tool = dict(self.joints), self.tool_in_base.copy()
        for number, signal in enumerate(("q", "dq", "q_link", "tau", "ee", "ee_rot", "tau_link")):
            if signal not in sigma:
                continue
            # a stream a channel: noise on one does not change another's
            random = np.random.default_rng([seed, number])
            if signal == "ee":
                tool[:, :3, 3] += random.normal(size=(len(self.t), 3)) * sigma[signal][0]
            elif signal == "ee_rot":
                turn = Rotation.from_rotvec(random.normal(size=(len(self.t), 3)) * sigma[signal][0])
                tool[:, :3, :3] = turn.as_matrix() @ tool[:, :3, :3]
            else:
                joints[signal] = joints[signal] + random.normal(size=joints[signal].shape) * np.array(sigma[signal])
        stated = {signal: list(values) for signal, values in sigma.items()}
        return replace(self, joints=joints, tool_in_base=tool, facts={**self.facts, "noise": stated, "seed": seed})

    def columns(self) -> dict[str, Vector]:
        """Columns of the run's data file in the order of log.md, each of shape (m,)."""
        columns: dict[str, Vector] = {"t": self.t}
        for signal in JOINT_SIGNALS:
            if signal in self.joints:
                for i in range(len(self.kinds)):
                    columns[f"{signal}_{i + 1}"] = self.joints[signal][:, i]
        from scipy.spatial.transform import Rotation

        xyzw = Rotation.from_matrix(self.tool_in_base[:, :3, :3]).as_quat()
        xyzw = xyzw * np.where(xyzw[:, 3:] < 0, -1.0, 1.0)
        pose = np.hstack([self.tip, xyzw[:, 3:], xyzw[:, :3]])
        columns.update(zip(POSITION_SIGNALS + TURN_SIGNALS, pose.T, strict=True))
        return columns

    def dataset(self) -> xarray.Dataset:
        """The run as labelled arrays: dimensions t, joint, axis; units as attributes."""
        import xarray

        names = [f"joint_{i + 1}" for i in range(len(self.kinds))]
        data: dict[str, Any] = {}
        for signal, values in self.joints.items():
            unit = [joint_unit(signal, kind) for kind in self.kinds]
            data[signal] = (("t", "joint"), values, {"units": unit[0] if len(set(unit)) == 1 else unit})
        data["tip"] = (("t", "axis"), self.tip, {"units": "m"})
        return xarray.Dataset(
            data, {"t": ("t", self.t, {"units": "s"}), "joint": names, "axis": ["x", "y", "z"]}, dict(self.facts)
        )

    def files(self) -> dict[str, str]:
        """The run's files: log.yaml and data.csv."""
        from ruamel.yaml import YAML

        columns = self.columns()
        table = np.column_stack(list(columns.values()))
        lines = [",".join(columns), *(",".join(map(repr, row)) for row in table.tolist())]
        log: dict[str, Any] = {"control": self.facts["control"]}
        for key in ("noise", "payload"):
            if key in self.facts:
                log[key] = self.facts[key]
        skipped = ("control", "noise", "payload")
        log["source"] = "simulated by mbexport"
        log["simulation"] = {key: value for key, value in self.facts.items() if key not in skipped}
        if self.warnings:
            log["warnings"] = list(self.warnings)
        text = io.StringIO()
        YAML().dump(log, text)
        return {"log.yaml": text.getvalue(), "data.csv": "\n".join(lines) + "\n"}

    def write(self, folder: Path | str, *, force: bool = False) -> tuple[Path, ...]:
        """Write the run as log.md has it, whole or not at all."""
        return write_whole(Path(folder), self.files(), force=force)
