"""What a film shows of an arm at a wall, drawn by MuJoCo: the arm, the wall where it is touched, and force arrows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._contact import BALL_RADIUS, ContactArm

ARROW = 0.15 / 30.0
"""m per N."""
MOST = 4.0
"""Of the desired force: what is larger leaves the chart, and its arrow grows no more."""
COLOURS = {"x": "#0072B2", "y": "#009E73", "z": "#CC79A7"}
"""Axis -> the colour of its force, in arrows and curves."""

WHOLE, NEAR = (300, 220), (180, 180)
"""Height and width in pixels of the picture of the whole arm and of the close-up."""

_ARM, _BALL, _WALL = (0.70, 0.73, 0.77, 1.0), (0.95, 0.45, 0.0, 1.0), (0.56, 0.42, 0.26, 0.5)
_FOOT, _WISH, _PAPER = (0.35, 0.37, 0.40, 1.0), (0.28, 0.28, 0.28, 1.0), (1.0, 1.0, 1.0, 1.0)
_LAST_LINK = 0.5 * BALL_RADIUS  # m; as thick as it is, it would hide the ball
_PATCH, _AROUND, _THICK = 0.09, 0.06, 0.004  # m: least half size of a wall, room around the path, half its thickness
_LIMB = 0.08  # m, around the joints, of what the arm's links take
_FOOT_SIZE, _FOOT_PLACE = np.array((0.11, 0.1, 0.0)), np.array((0.0, 0.0, -0.1))  # m: radius and half height
_BELOW = np.array((0.0, 0.0, -0.035))  # m, from the arrow of a force to that of the desired one
_RADII = (0.012, 0.006)  # m, of arrows in the two pictures
_ONE, _TWO = (76.0, -14.0), (45.0, -55.0)  # degrees: a wall is seen almost along it, a corner from above
_IDENTITY = np.eye(3)


class Stage:
    """An arm, its walls and two cameras, for all runs that start the same way; a context manager that holds two renderers.

    Args:
        contact: an arm for drawing only; its model's colours and shapes are changed.
        paths: for each run, (k, n) joint angles in rad; what they reach is in the picture.
        most: axis of each wall -> the largest force that an arrow shows, N. wish: the same for the desired force.
    """

    def __init__(
        self,
        contact: ContactArm,
        paths: Sequence[FloatArray],
        most: Mapping[str, float],
        wish: Mapping[str, float],
    ) -> None:
        self._model, self._data = contact.robot.model, contact.robot.data
        self._surface = {axis: float(self._model.geom(f"wall {axis}").pos["xyz".index(axis)]) for axis in most}
        self._across = np.array([axis in most for axis in "xyz"])
        self._most = most
        self._dress()
        joints, tools = self._reach(paths)
        self._patches = [self._patch(axis, tools) for axis in most]
        view = _ONE if len(most) == 1 else _TWO
        corners = [center + sign * half for center, half in self._patches for sign in (-1.0, 1.0)]
        tips = [self._touch(axis, tool) + self._arrow(axis, most[axis]) for axis in most for tool in tools]
        self._whole = _camera([*joints, *corners, *tips, 2.0 * _FOOT_PLACE], view, WHOLE, _LIMB)
        around = [sign * _AROUND * row for row in _IDENTITY for sign in (-1.0, 1.0)]
        tips = [self._arrow(axis, 1.1 * wish[axis]) for axis in most]
        self._near = _camera([*around, *tips], view, NEAR, 0.0)
        self._offset = np.array(self._near.lookat)

    def __enter__(self) -> Self:
        self._renderers = [mujoco.Renderer(self._model, *size) for size in (WHOLE, NEAR)]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for renderer in self._renderers:
            renderer.close()

    def pictures(self, q: FloatArray, force: Mapping[str, float], wish: Mapping[str, float]) -> list[FloatArray]:
        """The whole arm and the close-up, (height, width, 3) bytes, at q (n,), rad, with arrows for the forces, N."""
        self._place(q)
        tool = np.array(self._data.site("tool").xpos)
        corner = tool + _AROUND
        for axis in self._surface:
            corner = np.minimum(corner, self._touch(axis, corner))
        # The close-up stays with the wall until the ball is so far away that it would be lost.
        self._near.lookat[:] = np.where(self._across, corner, tool) + self._offset
        found = []
        around = [self._patch(axis, [tool]) for axis in self._surface]
        views = ((self._whole, self._patches), (self._near, around))
        for renderer, (camera, patches), radius in zip(self._renderers, views, _RADII, strict=True):
            renderer.update_scene(self._data, camera)
            _decorate(renderer.scene, camera, patches)
            for axis in self._surface:
                start = self._touch(axis, tool)
                for value, place, colour in (
                    (wish[axis], start + _BELOW, _WISH),
                    (force[axis], start, _rgba(COLOURS[axis])),
                ):
                    if value > 0.0:
                        tip = place + self._arrow(axis, min(value, self._most[axis]))
                        _add_arrow(renderer.scene, place, tip, radius, colour)
            found.append(renderer.render())
        return found

    def _dress(self) -> None:
        model = self._model
        last = model.geom("ball").bodyid[0]
        for i in range(model.ngeom):
            name = model.geom(i).name
            model.geom_rgba[i] = _BALL if name == "ball" else _ARM
            if not model.geom_bodyid[i]:
                model.geom_rgba[i] = 0.0  # a plane is drawn around the world's origin; `_patches` are drawn instead
            elif model.geom_bodyid[i] == last and name != "ball":
                model.geom_size[i, 0] = _LAST_LINK
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.4, 0.6

    def _place(self, q: FloatArray) -> None:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)

    def _reach(self, paths: Sequence[FloatArray]) -> tuple[list[FloatArray], list[FloatArray]]:
        """Positions (3,) of the joints and of the tool, some along each path."""
        joints, tools = [], []
        for path in paths:
            for q in path[np.linspace(0, len(path) - 1, 16).astype(int)]:
                self._place(q)
                joints += [np.array(position) for position in self._data.xpos[1:]]
                tools.append(np.array(self._data.site("tool").xpos))
        return joints + tools, tools

    def _touch(self, axis: str, tool: FloatArray) -> FloatArray:
        point = tool.copy()
        point["xyz".index(axis)] = self._surface[axis]
        return point

    def _arrow(self, axis: str, force: float) -> FloatArray:
        arrow: FloatArray = ARROW * force * _IDENTITY["xyz".index(axis)]
        return arrow

    def _patch(self, axis: str, tools: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Center and half sizes (3,) of what is drawn of a wall: around the path; in a corner up to the other wall, and not
        so high that the arrows are behind it."""
        low, high = np.min(tools, axis=0), np.max(tools, axis=0)
        center = 0.5 * (low + high)
        half = np.maximum(0.5 * (high - low) + _AROUND, _PATCH)
        low, high = center - half, center + half
        if len(self._surface) > 1:
            high[2] = np.max(tools, axis=0)[2] + 0.5 * BALL_RADIUS
            for other, surface in self._surface.items():
                high["xyz".index(other)] = surface
        i = "xyz".index(axis)
        low[i], high[i] = self._surface[axis], self._surface[axis] + 2.0 * _THICK
        return 0.5 * (low + high), 0.5 * (high - low)


def _decorate(scene: Any, camera: Any, patches: Sequence[tuple[FloatArray, FloatArray]]) -> None:
    """Walls, a foot, and white paper far behind everything."""
    for center, half in patches:
        _add(scene, mujoco.mjtGeom.mjGEOM_BOX, half, center, _IDENTITY, _WALL, 0.15)
    _add(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, _FOOT_SIZE, _FOOT_PLACE, _IDENTITY, _FOOT, 0.0)
    axes = _camera_axes(camera.azimuth, camera.elevation)
    paper = np.array((20.0, 20.0, 0.01))
    _add(scene, mujoco.mjtGeom.mjGEOM_BOX, paper, camera.lookat + 5.0 * axes[2], axes.T, _PAPER, 1.0)


def _add(
    scene: Any, kind: Any, size: FloatArray, place: FloatArray, R: FloatArray, rgba: Sequence[float], emission: float
) -> Any:
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, place, np.ascontiguousarray(R).ravel(), np.array(rgba, dtype=np.float32))
    geom.emission = emission
    scene.ngeom += 1
    return geom


def _add_arrow(scene: Any, start: FloatArray, tip: FloatArray, radius: float, rgba: Sequence[float]) -> None:
    kind = mujoco.mjtGeom.mjGEOM_ARROW
    geom = _add(scene, kind, np.zeros(3), np.zeros(3), _IDENTITY, rgba, 0.2)
    mujoco.mjv_connector(geom, kind, radius, start, tip)


def _camera_axes(azimuth: float, elevation: float) -> FloatArray:
    """(3, 3): right, up and forward of MuJoCo's free camera, in rows; degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    forward = np.array((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
    right = np.array((math.sin(a), -math.cos(a), 0.0))
    return np.array((right, np.cross(right, forward), forward))


def _camera(points: Sequence[FloatArray], view: tuple[float, float], size: tuple[int, int], room: float) -> Any:
    """A camera at `view`, azimuth and elevation, as near as keeps all points (3,), and `room` in m around each, in a picture
    of that height and width."""
    camera = mujoco.MjvCamera()
    axes = _camera_axes(*view)
    seen = np.array(points) @ axes.T
    center = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    right, up, depth = (seen - center).T
    slope = math.tan(math.radians(22.5))  # MuJoCo's field of view is 45 degrees high
    distance = np.maximum((np.abs(up) + room) / slope, (np.abs(right) + room) / (slope * size[1] / size[0])) - depth
    camera.lookat[:], camera.distance = center @ axes, float(distance.max())
    camera.azimuth, camera.elevation = view
    return camera


def _rgba(colour: str) -> tuple[float, ...]:
    return (*(int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)), 1.0)
