"""A bound on how fast a frame moves and turns."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import WORLD, frame_name, frame_point, real_array
from hqp_rp.control._rotations import point_jacobian
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_GOLDEN = 0.5 * (1.0 + math.sqrt(5.0))
_FACES = np.array(
    [(0, 1, _GOLDEN), (0, 1, -_GOLDEN), (1, _GOLDEN, 0), (1, -_GOLDEN, 0), (_GOLDEN, 0, 1), (-_GOLDEN, 0, 1)]
) / math.hypot(1.0, _GOLDEN)
"""Unit normals of the faces of a regular dodecahedron, one of each opposite pair."""
_INNER = math.sqrt((5.0 + 2.0 * math.sqrt(5.0)) / 15.0)
"""The radius of the ball within a regular dodecahedron over that of the ball around it, 0.7947."""


class FrameSpeedLimit:
    """Bound the speed of a point of a frame and its angular speed: two-sided rows that are always feasible (v = 0).

    One number s bounds the length of the velocity, |J v| <= s, by the regular dodecahedron within that ball::

        -c s <= n_i^T J v <= c s,   i = 1 ... 6,   c = 0.7947

    Linear rows hold no ball exactly; these never let it be passed, and allow at least 0.79 s in every direction. Three numbers
    bound each axis by itself, -s_i <= (R_f^T J v)_i <= s_i, R_f the axes of `expressed_in`.

    Args:
        frame: name of the frame.
        linear: m/s, > 0: one number for the length, or (3,) for each axis, infinite for none; None bounds nothing.
        angular: rad/s, likewise, of the angular velocity.
        point: (3,) m, the point meant, in the frame's own axes; None means its origin.
        expressed_in: whose axes the three numbers refer to: "world", the frame itself, or any other frame.
        name: default "<frame> speed".

    Raises:
        SettingError: neither linear nor angular given, or a value of the wrong shape or not > 0.
    """

    __slots__ = ("_angular", "_expressed_in", "_frame", "_linear", "_name", "_point")

    row_unit: ClassVar[str] = "m/s or rad/s"

    def __init__(
        self,
        frame: str,
        linear: ArrayLike | None = None,
        angular: ArrayLike | None = None,
        *,
        point: ArrayLike | None = None,
        expressed_in: str = WORLD,
        name: str = "",
    ) -> None:
        self._frame, self._expressed_in = frame_name(frame, "frame"), frame_name(expressed_in, "expressed_in")
        self._name = name or f"{frame} speed"
        if linear is None and angular is None:
            raise SettingError(f"{self._name!r} bounds nothing; give linear in m/s or angular in rad/s.")
        self._linear, self._angular = self._bound(linear, "linear", "m/s"), self._bound(angular, "angular", "rad/s")
        self._point = frame_point(point, self._name)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the limit uses."""
        return (self._frame, self._expressed_in)

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The directions' rows (m, nv), and their least and greatest speeds (m,); dt and v are not needed."""
        J, rotation = robot.jacobian(self._frame), np.eye(3)
        if self._expressed_in != WORLD:
            rotation = robot.pose(self._expressed_in)[0]
        linear = J[:3]
        if self._point.any():
            linear = point_jacobian(J, robot.pose(self._frame)[0] @ self._point)
        parts = [(linear, self._linear), (J[3:], self._angular)]
        rows = [(rotation.T if len(bound) == 3 else _FACES) @ half for half, bound in parts if bound is not None]
        bounds = np.concatenate([bound for _, bound in parts if bound is not None])
        return np.concatenate(rows), -bounds, bounds

    def row_names(self, robot: Robot) -> list[str]:
        """Which speed, the frame, and the axis; the faces that stand for one length all alike."""
        names = []
        for what, bound in (("linear", self._linear), ("angular", self._angular)):
            if bound is not None:
                of = [f"along {axis}" for axis in "xyz"] if len(bound) == 3 else [""] * len(bound)
                speed = "speed" if what == "linear" else "angular speed"
                names += [f"{speed} of {self._frame} {which}".rstrip() for which in of]
        return names

    def _bound(self, value: ArrayLike | None, which: str, unit: str) -> FloatArray | None:
        """(6,) for the faces, (3,) for axes, or None."""
        if value is None:
            return None
        what = f"{which} of {self._name!r}"
        bound = real_array(value, what)
        if bound.shape not in ((), (3,)) or not (bound > 0.0).all() or (bound.ndim == 0 and math.isinf(bound)):
            raise SettingError(
                f"{what} is {bound.tolist()}; it must be > 0 in {unit}: one finite number for the length, or 3 for the axes."
            )
        return np.full(len(_FACES), _INNER * float(bound)) if bound.ndim == 0 else bound

    def __repr__(self) -> str:
        return f"FrameSpeedLimit({self._name!r})"
