"""The centre of mass kept above a support polygon."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._approach import Approach, margin_of
from hqp_rp.control._checks import frame_name, real_array
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_LEAST_AREA = 1e-10  # m^2


class SupportPolygonLimit:
    """Keep the centre of mass c above the convex hull of points on the ground: one row for each edge, in m/s.

    With an edge from a to b, counter-clockwise, n its unit normal pointing out, all in the world's x and y, and the distance
    d = n . (a - c_xy) - margin, negative outside::

        -n^T J_c,xy v >= -phi(d)                        d >= 0
        -n^T J_c,xy v >=  min(phi(|d|), return_speed)   d < 0

    with phi as in `HalfSpaceLimit`. Quasi-static balance on level ground without other contacts. Points that are given on
    frames are where these frames are now, and are taken to rest: hold the feet at an earlier level or as hard rows. The
    number of rows is that of the hull's edges and may change as the points move.

    Args:
        points: (k, 2) or (k, 3) in the world, m; or a mapping from the name of a frame to its points (k, 3) in its own axes,
            such as the corners of each foot. Three at least that span an area.
        margin: m, >= 0, by which every edge is drawn in.
        gain: 1/s, > 0. A step of more than 1/gain takes 1/dt instead.
        deceleration: A, m/s^2, > 0, infinite by default. return_speed: m/s, > 0.
        name: default "support polygon".

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; points of the world without area.
        RobotError: at a configuration where points on frames span no area.

    Source: the static stability margin of McGhee and Frank 1968, as velocity dampers of Faverjon and Tournassoud 1987.
    """

    __slots__ = ("_approach", "_margin", "_name", "_on_frames", "_polygon")

    row_unit: ClassVar[str] = "m/s"

    def __init__(
        self,
        points: ArrayLike | Mapping[str, ArrayLike],
        *,
        margin: float = 0.0,
        gain: float = 5.0,
        deceleration: float = math.inf,
        return_speed: float = 0.1,
        name: str = "support polygon",
    ) -> None:
        self._name = name
        self._on_frames: dict[str, FloatArray] | None = None
        self._polygon: FloatArray | None = None
        if isinstance(points, Mapping):
            self._on_frames = {
                frame_name(frame, "the points' frame"): self._checked(own, (3,), f"the points on {frame!r} of {name!r}")
                for frame, own in points.items()
            }
            if sum(len(own) for own in self._on_frames.values()) < 3:
                raise SettingError(
                    f"the points of {name!r} are fewer than 3, which span no area; give the feet's corners."
                )
        else:
            self._polygon = convex_hull(self._checked(points, (2, 3), f"the points of {name!r}")[:, :2])
            if self._polygon is None:
                raise SettingError(
                    f"the points of {name!r} span no area; give three at least that are not in one line."
                )
        self._margin = margin_of(margin, name)
        self._approach = Approach(gain, deceleration, return_speed, name)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the limit uses."""
        return tuple(self._on_frames or ())

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """-n^T J_c,xy (m, nv), the least rates (m,) in m/s and infinity (m,); v is not needed."""
        normals, distances = self._edges(robot)
        least = self._approach.least_rate(distances - self._margin, dt)
        return -normals @ robot.center_of_mass_jacobian()[:2], least, np.full(len(least), math.inf)

    def polygon(self, robot: Robot) -> FloatArray:
        """(m, 2) corners in the world, m, counter-clockwise."""
        if self._polygon is not None:
            return self._polygon
        assert self._on_frames is not None
        placed = []
        for frame, own in self._on_frames.items():
            rotation, origin = robot.pose(frame)
            placed.append((own @ rotation.T + origin)[:, :2])
        polygon = convex_hull(np.concatenate(placed))
        if polygon is None:
            raise RobotError(f"limit {self._name!r}: the points on {', '.join(self._on_frames)} span no area here.")
        return polygon

    def distance(self, robot: Robot) -> float:
        """m, the least distance from the centre of mass to an edge, negative outside; the margin is not taken off."""
        return float(self._edges(robot)[1].min())

    def row_names(self, robot: Robot) -> list[str]:
        """The ends of each edge, m."""
        corners = self.polygon(robot)
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        return [f"edge ({a[0]:.3g}, {a[1]:.3g}) - ({b[0]:.3g}, {b[1]:.3g})" for a, b in ends]

    def _edges(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Normals (m, 2) that point out, and distances (m,) of the centre of mass within."""
        corners = self.polygon(robot)
        along = np.roll(corners, -1, axis=0) - corners
        normals = np.stack((along[:, 1], -along[:, 0]), axis=1) / np.linalg.norm(along, axis=1)[:, None]
        return normals, np.einsum("ij,ij->i", normals, corners - robot.center_of_mass()[:2])

    def _checked(self, points: ArrayLike, widths: tuple[int, ...], what: str) -> FloatArray:
        array = real_array(points, what)
        if array.ndim != 2 or array.shape[1] not in widths or not np.isfinite(array).all():
            shapes = " or ".join(f"(k, {width})" for width in widths)
            raise SettingError(f"{what} have shape {array.shape}; they must be finite, in m, of shape {shapes}.")
        return array

    def __repr__(self) -> str:
        return f"SupportPolygonLimit({self._name!r})"


def convex_hull(points: FloatArray) -> FloatArray | None:
    """(m, 2) corners of the convex hull of points (k, 2), counter-clockwise; None where they span no area.

    Source: Andrew 1979, Another efficient algorithm for convex hulls in two dimensions.
    """
    ordered = np.unique(points, axis=0).tolist()

    def half(some: list[list[float]]) -> list[list[float]]:
        chain: list[list[float]] = []
        for p in some:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    corners = np.array(half(ordered) + half(ordered[::-1])).reshape(-1, 2)
    x, y = corners.T
    area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return corners if area > _LEAST_AREA else None


def _turn(a: list[float], b: list[float], c: list[float]) -> float:
    """Twice the signed area of the triangle a, b, c."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
