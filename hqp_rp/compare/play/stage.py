"""The robot, its ghost and the targets as a scene of viser: what both pages draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from hqp_rp.compare.play.panel import COLORS
from hqp_rp.compare.play.shapes import shapes_of, skeleton_of
from hqp_rp.compare.play.targets import Target
from hqp_rp.core.problem import FloatArray

_OPACITY = (1.0, 0.35)
_SKY = 3.0
_TINT = 0.55  # how much of a robot's colour is that of its solver


class Stage:
    """Draws a model once for each arm, and moves it.

    Args:
        server: a `viser.ViserServer`. model: the robot. q: (nq,) where it stands at first, for the camera.
    """

    def __init__(self, server: Any, model: mujoco.MjModel, q: FloatArray) -> None:
        self._server, self._model = server, model
        self._data = mujoco.MjData(model)
        self._shapes = shapes_of(model) or skeleton_of(model)
        self._bodies: list[dict[int, Any]] = []
        self._gizmos: list[Any] = []
        low, high = self._extent(q)
        self._size = max(float((high - low).max()), 0.1)
        middle = 0.5 * (low + high)
        server.scene.set_up_direction("+z")
        # Light from above and below in place of viser's photograph, and no shadows: where a processor draws, those two
        # take it 20 s before the first picture, in which the page answers nothing.
        server.scene.configure_environment_map(None)
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.add_light_hemisphere(
            "/sky", sky_color=(255, 255, 255), ground_color=(190, 190, 200), intensity=_SKY, position=(0.0, 0.0, 1.0)
        )
        server.scene.add_grid(
            "/floor", width=4.0 * self._size, height=4.0 * self._size, cell_size=0.1, section_size=0.5,
            position=(float(middle[0]), float(middle[1]), min(float(low[2]), 0.0)),
        )  # fmt: skip
        server.initial_camera.look_at = tuple(middle.tolist())
        server.initial_camera.position = tuple((middle + self._size * np.array([0.9, -0.9, 0.5])).tolist())

    def _extent(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Corners (3,) of the box around all that is drawn."""
        self._pose(q)
        corners = [self._data.xpos[1:], *(
            shape.vertices @ self._data.xmat[shape.body].reshape(3, 3).T + self._data.xpos[shape.body]
            for shape in self._shapes
        )]  # fmt: skip
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)

    def _pose(self, q: FloatArray) -> None:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)

    def show(self, q: Sequence[FloatArray]) -> None:
        """Put each arm where it is; an arm more is drawn anew, an arm less taken away."""
        while len(self._bodies) > len(q):
            self._server.scene.remove_by_name(f"/arm{len(self._bodies) - 1}")
            self._bodies.pop()
        while len(self._bodies) < len(q):
            self._bodies.append(self._drawn(len(self._bodies)))
        with self._server.atomic():
            for bodies, own in zip(self._bodies, q, strict=True):
                self._pose(own)
                for body, frame in bodies.items():
                    frame.position, frame.wxyz = self._data.xpos[body].copy(), self._data.xquat[body].copy()

    def _drawn(self, arm: int) -> dict[int, Any]:
        scene, found = self._server.scene, {}
        tint = np.array([int(COLORS[arm][i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        scene.add_frame(f"/arm{arm}", show_axes=False)
        for i, shape in enumerate(self._shapes):
            if shape.body not in found:
                found[shape.body] = scene.add_frame(f"/arm{arm}/body{shape.body}", show_axes=False)
            color = (1.0 - _TINT) * shape.color[:3] + _TINT * tint
            opacity = float(shape.color[3]) * _OPACITY[arm]
            scene.add_mesh_simple(
                f"/arm{arm}/body{shape.body}/{i}",
                shape.vertices,
                shape.faces,
                color=tuple(int(255 * c) for c in color),
                opacity=None if opacity >= 1.0 else opacity,
            )
        return found

    def add_gizmo(
        self, target: Target, place: FloatArray, dragged: Callable[[FloatArray, FloatArray], None] | None
    ) -> None:
        """Something to drag; `dragged` is told position (3,) and quaternion (4,). None: it shows where the target is."""
        name = f"/targets/{len(self._gizmos)}"
        if dragged is None:
            self._gizmos.append(
                self._server.scene.add_frame(name, axes_length=0.12 * self._size, axes_radius=0.005 * self._size)
            )
        else:
            moves, turns = any(target.moves), any(target.turns)
            gizmo = self._server.scene.add_transform_controls(
                name, scale=0.22 * self._size, active_axes=gizmo_axes(target), disable_axes=not moves,
                disable_sliders=not moves, disable_rotations=not turns, depth_test=False,
            )  # fmt: skip
            gizmo.on_update(lambda _: dragged(np.array(gizmo.position), np.array(gizmo.wxyz)))
            self._gizmos.append(gizmo)
        self.put_gizmo(len(self._gizmos) - 1, place)

    def put_gizmo(self, i: int, place: FloatArray) -> None:
        """Put it to position and quaternion (7,); nan leaves the half as it is."""
        gizmo = self._gizmos[i]
        if np.isfinite(place[:3]).all() and np.abs(place[:3] - gizmo.position).max() > 1e-9:
            gizmo.position = place[:3].copy()
        if np.isfinite(place[3:]).all():
            gizmo.wxyz = place[3:].copy()

    def show_gizmos(self, visible: bool) -> None:
        """Whether what can be dragged is to be seen."""
        for gizmo in self._gizmos:
            gizmo.visible = visible


def gizmo_axes(target: Target) -> tuple[bool, bool, bool]:
    """The axes that viser's gizmo must have: those to move along, and of each ring the two that span it."""
    x, y, z = (target.moves[i] or any(turns for j, turns in enumerate(target.turns) if j != i) for i in range(3))
    return x, y, z
