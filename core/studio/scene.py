"""The robot, its frames and its tip's paths in a viser scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics import reach
from ..representation import Pose, Robot, Shape
from .paths import Paths
from .session import View

Array = NDArray[np.float64]

RIGID = (0, 114, 178)
REAL = (213, 94, 0)
_GHOST = (120, 150, 175)
_GHOST_OPACITY = 0.28
# thinner than the robot, so that surfaces that all but coincide do not shine through each other
_GHOST_SCALE = 0.96
_RIGID_WIDTH, _REAL_WIDTH = 5.0, 2.5
# the longest error is drawn as this part of the reach where nothing else is said
_DRAWN_PART = 0.06
_LARGEST_DRAWN = 1000.0
# of a cylinder
_SIDES = 48


@dataclass(frozen=True, slots=True)
class Shown:
    """What of the scene is to be seen.

    Attributes:
        frames: Veitschegger-Wu frames of the arms, the base and the tool, with names.
        joints: Axes of the joints at their real places.
        ghost: The robot without any effect.
        magnification: How much larger errors are drawn; 0: so that they are seen.
    """

    frames: bool = False
    joints: bool = False
    ghost: bool = True
    magnification: float = 0.0


class Scene:
    """Nodes of one robot; all of them hang on its base."""

    def __init__(self, server: Any, robot: Robot, folder: Path | None) -> None:
        """An empty scene for a robot.

        Args:
            server: A viser server.
            robot: As built; its size gives everything else its size.
            folder: Folder that its meshes are relative to.
        """
        self._scene, self._folder = server.scene, folder
        self._size = max(reach(robot), 0.1)
        self._drawn: Robot | None = None
        self._arms: list[Any] = []
        self._ghosts: list[Any] = []
        self._frames: list[Any] = []
        self._axes: list[Any] = []
        self._shapes: list[Any] = []
        self._paths: tuple[Paths | None, float] = (None, 0.0)
        self._begin(server, robot)

    def _begin(self, server: Any, robot: Robot) -> None:
        size = self._size
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        place = robot.base
        self._scene.add_grid(
            "/floor",
            width=4.0 * size,
            height=4.0 * size,
            cell_size=0.1 * size,
            section_size=0.5 * size,
            cell_color=(226, 230, 234),
            section_color=(200, 206, 213),
            position=place.xyz,
        )
        self._base = self._scene.add_frame("/base", show_axes=False)
        camera = server.initial_camera
        middle = np.array(place.xyz) + np.array([0.25, 0.0, 0.35]) * size
        camera.look_at = tuple(middle)
        camera.position = tuple(middle + np.array([0.75, -1.15, 0.55]) * size)
        camera.fov = 0.8

    def show(self, view: View, shown: Shown) -> float:
        """Draw a view; how much larger its errors are drawn."""
        if view.robot is not self._drawn:
            self._draw(view.robot)
        posture = view.posture
        _place(self._arms, posture.arms)
        _place(self._ghosts, posture.rigid_arms)
        base = np.eye(4)
        _place(self._frames, [base, *posture.arms, posture.tool])
        _place(self._axes, posture.joints)
        moved = bool(np.linalg.norm(posture.error) > 0.0)
        for node in self._ghosts:
            node.visible = shown.ghost and moved
        for node in self._frames:
            node.visible = shown.frames
        for node in self._axes:
            node.visible = shown.joints
        factor = shown.magnification or self._magnification(view)
        self._draw_paths(view.paths, factor)
        start = posture.rigid_tool[:3, 3]
        self._draw_error(start, start + factor * posture.error)
        return factor

    def _magnification(self, view: View) -> float:
        """1, 2 or 5 times a power of ten that makes the largest error well seen."""
        largest = float(np.linalg.norm(view.posture.error))
        if view.paths is not None:
            largest = max(largest, float(view.paths.distance.max()))
        if largest <= 0.0:
            return 1.0
        wanted = min(max(_DRAWN_PART * self._size / largest, 1.0), _LARGEST_DRAWN)
        power = 10.0 ** np.floor(np.log10(wanted))
        return float(next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= wanted))

    def _draw(self, robot: Robot) -> None:
        """Shapes and frames of a robot, anew."""
        for node in [*self._shapes, *self._arms, *self._ghosts, *self._frames, *self._axes]:
            node.remove()
        # a base that tilts takes all with it that is told in the base: the robot, the one without effects, the paths
        self._base.position, self._base.wxyz = robot.base.xyz, robot.base.quaternion()
        scene, size = self._scene, self._size
        self._shapes, self._arms, self._ghosts = [], [], []
        for stage in robot.stages:
            name = stage.arm.name
            self._arms.append(scene.add_frame(f"/base/{name}", show_axes=False))
            self._ghosts.append(scene.add_frame(f"/base/{name}_rigid", show_axes=False))
            for count, shape in enumerate(stage.arm.shapes):
                colour = (round(255 * shape.rgba[0]), round(255 * shape.rgba[1]), round(255 * shape.rgba[2]))
                opacity = None if shape.rgba[3] >= 1.0 else shape.rgba[3]
                self._add_shape(f"/base/{name}/{count}", shape, colour, opacity)
                self._add_shape(f"/base/{name}_rigid/{count}", shape, _GHOST, _GHOST_OPACITY, _GHOST_SCALE)
        names = ["base", *(stage.arm.name for stage in robot.stages), "tool"]
        length = 0.09 * size
        self._frames = [
            scene.add_frame(
                f"/base/frame_{name}",
                axes_length=length,
                axes_radius=0.045 * length,
                origin_radius=0.09 * length,
                origin_color=(90, 98, 108),
            )
            for name in names
        ]
        # the tool's name would cover the last arm's
        same = robot.tool == Pose()
        for name in names:
            text = "" if same and name == names[-2] else f"{names[-2]}, tool" if same and name == "tool" else name
            if not text:
                continue
            self._shapes.append(
                scene.add_label(
                    f"/base/frame_{name}/name",
                    text.replace("_", " "),
                    position=(0.25 * length, 0.25 * length, 0.6 * length),
                    font_screen_scale=0.8,
                )
            )
        self._axes = []
        for stage in robot.stages:
            node = scene.add_frame(f"/base/{stage.joint.name}", show_axes=False)
            reach_of_axis = 0.16 * size
            ends = np.array([[[0.0, 0.0, -reach_of_axis], [0.0, 0.0, reach_of_axis]]])
            self._shapes.append(
                scene.add_line_segments(
                    f"/base/{stage.joint.name}/axis", ends, (20, 24, 28), thickness=2.0, thickness_units="screen"
                )
            )
            self._shapes.append(
                scene.add_label(
                    f"/base/{stage.joint.name}/name",
                    stage.joint.name.replace("_", " "),
                    position=(0.0, 0.0, reach_of_axis),
                    font_screen_scale=0.8,
                )
            )
            self._axes.append(node)
        self._drawn = robot

    def _add_shape(
        self, name: str, shape: Shape, colour: tuple[int, int, int], opacity: float | None, scale: float = 1.0
    ) -> None:
        scene = self._scene
        place: dict[str, Any] = {"position": shape.in_arm.xyz, "wxyz": shape.in_arm.quaternion()}
        look: dict[str, Any] = {**place, "color": colour, "opacity": opacity, "scale": scale, "cast_shadow": False}
        if shape.kind == "box":
            node = scene.add_box(name, dimensions=shape.size, **look)
        elif shape.kind == "cylinder":
            node = scene.add_mesh_simple(name, *_cylinder(shape.size[0], shape.size[1]), **look)
        elif shape.kind == "sphere":
            node = scene.add_icosphere(name, radius=shape.size[0], **look)
        else:
            mesh = _mesh(shape.mesh, self._folder)
            if mesh is None:
                return
            vertices = np.asarray(mesh.vertices) * np.array(shape.size)
            node = scene.add_mesh_simple(name, vertices, np.asarray(mesh.faces), flat_shading=True, **look)
        self._shapes.append(node)

    def _draw_paths(self, paths: Paths | None, factor: float) -> None:
        if self._paths == (paths, factor):
            return
        self._paths = (paths, factor)
        for name, colour, width in (("rigid", RIGID, _RIGID_WIDTH), ("real", REAL, _REAL_WIDTH)):
            if paths is None:
                points = np.zeros((1, 2, 3))
            else:
                line = paths.rigid if name == "rigid" else paths.magnified(factor)
                points = np.stack([line[:-1], line[1:]], axis=1)
            self._scene.add_line_segments(
                f"/base/path_{name}",
                points,
                colour,
                thickness=width,
                thickness_units="screen",
                visible=paths is not None,
            )

    def _draw_error(self, start: Array, end: Array) -> None:
        """The tip's error as an arrow."""
        length = float(np.linalg.norm(end - start))
        thin = 0.004 * self._size
        self._scene.add_arrows(
            "/base/error",
            np.array([[start, end]]),
            REAL,
            shaft_radius=thin,
            head_radius=2.5 * thin,
            head_length=min(6.0 * thin, 0.5 * length),
            visible=length > 2.0 * thin,
        )


def _place(nodes: Sequence[Any], frames: Sequence[Array] | Array) -> None:
    for node, frame in zip(nodes, frames, strict=True):
        pose = Pose.from_matrix(frame)
        node.position, node.wxyz = pose.xyz, pose.quaternion()


def _cylinder(radius: float, length: float) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (4 m + 2, 3) and triangles of a cylinder about z.

    Sides and ends share no vertices, so that each is shaded smoothly by itself.
    """
    m = _SIDES
    angles = 2.0 * np.pi * np.arange(m) / m
    ring = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(m, 0.5 * length)])
    mirrored = ring * (1.0, 1.0, -1.0)
    vertices = np.vstack([ring, mirrored, ring, mirrored, [[0.0, 0.0, 0.5 * length], [0.0, 0.0, -0.5 * length]]])
    k = np.arange(m)
    after = (k + 1) % m
    faces = np.vstack(
        [
            np.column_stack([k, m + k, after]),
            np.column_stack([after, m + k, m + after]),
            np.column_stack([2 * m + k, 2 * m + after, np.full(m, 4 * m)]),
            np.column_stack([3 * m + after, 3 * m + k, np.full(m, 4 * m + 1)]),
        ]
    )
    return vertices, faces


def _mesh(file: str, folder: Path | None) -> Any:
    """A mesh of the database; None where it cannot be read: the robot is seen without it."""
    trimesh: Any = import_module("trimesh")
    try:
        return trimesh.load((folder or Path()) / file, force="mesh", skip_materials=True)
    # trimesh raises the last where a file is of a kind that it does not read
    except (OSError, ValueError, TypeError, KeyError, IndexError, NotImplementedError):
        return None
