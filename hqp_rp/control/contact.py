"""A contact: where a frame of the robot touches the world or another frame, and which forces may pass there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import WORLD, frame_name, positive_number, real_array
from hqp_rp.control._rotations import skew
from hqp_rp.control.pointing_task import unit_vector
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray

CONES = ("pyramid", "box")

_OPPOSITE = 1e-12  # sine of the angle to -z below which the normal is -z itself
_ALONG = 1e-6  # sine of the angle to the normal below which a tangent is none


class Contact:
    """Points of a frame that rest on a surface, each with a force f = (f_x, f_y, f_z) in the axes of the contact, N.

    f is what the surface does to the frame; z is the normal, out of the surface, and x and y are those of `on`, of the world
    for instance, turned with its z the shortest way to the normal (`axes`): on flat ground f is in the axes of the world. The
    forces of a contact are unknowns of a `TorqueStack`, with hard rows at each point::

        cone="pyramid"  cos(t) f_x + sin(t) f_y <= mu cos(pi / edges) f_z    t = 2 pi i / edges, i = 1, ..., edges
        cone="box"      |f_x| <= mu nominal_force / sqrt(2), |f_y| as well
                        min_force s <= f_z <= max_force s                    s: the activation

    The pyramid lies within Coulomb's cone |f_xy| <= mu f_z: what it allows does not slip. The box holds to that as long as
    f_z is at least `nominal_force`; it is for a surface that is pressed with a known force.

    The contact moves as its surface does. In the rows of the twist V = (velocity of the frame's origin, angular velocity),
    seen from the surface, that its points determine (3 of a single point, 5 of points on a line, 6 of others)::

        d/dt V = -kd V

    Args:
        frame: the frame that rests.
        points: (k, 3) or (3,) m, in the frame's own axes: corners of a sole, the tip of a finger. None is its origin.
        on: "world", or the frame that it rests on: an object that the robot holds, a body of its own.
        normal: (3,) out of the surface, in the axes of `on`; any length but zero.
        tangent: (3,) in the axes of `on`, what x shall point along as far as the surface lets it; any length but zero, not
            along the normal. None: x as above.
        friction: mu > 0. cone: "pyramid" or "box". edges: of the pyramid, >= 3. nominal_force: N, > 0, of one point; for a box.
        min_force, max_force: N, of one point, 0 <= min_force <= max_force.
        kd: 1/s, >= 0: how fast what is left of a motion of the contact dies out.
        name: default "<frame> contact".

    `activation`, `normal`, `friction`, `min_force` and `max_force` may be set at every step. x and y turn as little as the
    normal does, except where the normal comes near -z of `on`, as under a ceiling or a tray: there give a `tangent`.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range.

    Source: Wieber, Tedrake and Kuindersma 2016 for unilateral contact and its friction pyramid in inverse dynamics.
    """

    __slots__ = (
        "_activation",
        "_cone",
        "_edges",
        "_frame",
        "_friction",
        "_kd",
        "_max_force",
        "_min_force",
        "_name",
        "_nominal_force",
        "_normal",
        "_on",
        "_points",
        "_tangent",
        "_version",
    )

    def __init__(
        self,
        frame: str,
        *,
        points: ArrayLike | None = None,
        on: str = WORLD,
        normal: ArrayLike = (0.0, 0.0, 1.0),
        tangent: ArrayLike | None = None,
        friction: float = 0.7,
        cone: str = "pyramid",
        edges: int = 4,
        nominal_force: float | None = None,
        min_force: float = 0.0,
        max_force: float = math.inf,
        kd: float = 20.0,
        name: str = "",
    ) -> None:
        self._frame, self._on = frame_name(frame, "frame"), frame_name(on, "on")
        if frame == on:
            raise SettingError(f"frame and on are both {frame!r}; a frame cannot rest on itself.")
        self._name = name or f"{frame} contact"
        self._version = 0
        self._normal: FloatArray
        self._friction: float
        self._points = self._checked_points(points)
        if cone not in CONES:
            raise SettingError(f"the cone of {self._name!r} is {cone!r}; choose one of {', '.join(CONES)}.")
        self._cone = cone
        if not isinstance(edges, int) or isinstance(edges, bool) or edges < 3:
            raise SettingError(f"the edges of {self._name!r} are {edges!r}; give an integer of at least 3.")
        self._edges = edges
        if (nominal_force is None) is (cone == "box"):
            raise SettingError(
                f"nominal_force of {self._name!r} is {nominal_force!r}; a box needs it, in N, and a pyramid has none."
            )
        self._nominal_force = (
            0.0 if nominal_force is None else positive_number(nominal_force, f"the nominal_force of {self._name!r}")
        )
        kd_given = real_array(kd, f"the kd of {self._name!r}")
        if kd_given.ndim or not 0.0 <= float(kd_given) < math.inf:
            raise SettingError(f"the kd of {self._name!r} is {kd!r}; it must be a finite number >= 0, in 1/s.")
        self._kd = float(kd_given)
        self._min_force, self._max_force, self._activation = 0.0, math.inf, 1.0
        self._tangent = None if tangent is None else unit_vector(tangent, f"the tangent of {self._name!r}")
        self.normal, self.friction = normal, friction
        self.max_force = max_force
        self.min_force = min_force

    def _checked_points(self, points: ArrayLike | None) -> FloatArray:
        what = f"points of {self._name!r}"
        array = np.zeros((1, 3)) if points is None else np.atleast_2d(real_array(points, what))
        if array.ndim != 2 or array.shape[1] != 3 or not len(array) or not np.isfinite(array).all():
            raise SettingError(f"{what} have shape {array.shape}; give (k, 3) finite numbers in m, k at least 1.")
        array.flags.writeable = False
        return array

    @property
    def name(self) -> str:
        """What reports and errors call the contact."""
        return self._name

    @property
    def frame(self) -> str:
        """The frame that rests."""
        return self._frame

    @property
    def on(self) -> str:
        """What it rests on: "world" or a frame."""
        return self._on

    @property
    def points(self) -> FloatArray:
        """(k, 3) m, in the frame's own axes."""
        return self._points

    @property
    def cone(self) -> str:
        """ "pyramid" or "box"."""
        return self._cone

    @property
    def edges(self) -> int:
        """How many faces the pyramid has."""
        return self._edges

    @property
    def nominal_force(self) -> float:
        """N, of one point; of a box."""
        return self._nominal_force

    @property
    def kd(self) -> float:
        """1/s."""
        return self._kd

    @property
    def size(self) -> int:
        """How many unknowns its forces are: 3 k."""
        return 3 * len(self._points)

    @property
    def normal(self) -> FloatArray:
        """(3,) unit vector out of the surface, in the axes of `on`."""
        return self._normal

    @normal.setter
    def normal(self, value: ArrayLike) -> None:
        normal = unit_vector(value, f"the normal of {self._name!r}")
        if self._tangent is not None and np.linalg.norm(np.cross(normal, self._tangent)) < _ALONG:
            raise SettingError(
                f"the normal of {self._name!r} is {normal.tolist()}, along its tangent {self._tangent.tolist()}, so that x has "
                "no direction in the surface; give a tangent that lies nearer to it."
            )
        self._set("_normal", normal)

    @property
    def tangent(self) -> FloatArray | None:
        """(3,) unit vector in the axes of `on` that x follows, or None."""
        return self._tangent

    @property
    def friction(self) -> float:
        """mu, > 0."""
        return self._friction

    @friction.setter
    def friction(self, value: float) -> None:
        self._set("_friction", positive_number(value, f"the friction of {self._name!r}"))

    @property
    def min_force(self) -> float:
        """N, the least normal force of one point."""
        return self._min_force

    @min_force.setter
    def min_force(self, value: float) -> None:
        given = real_array(value, f"the min_force of {self._name!r}")
        if given.ndim or not 0.0 <= float(given) <= self._max_force or not math.isfinite(float(given)):
            raise SettingError(
                f"the min_force of {self._name!r} is {value!r}; it must be finite and between 0 and max_force, "
                f"{self._max_force:g} N."
            )
        self._set("_min_force", float(given))

    @property
    def max_force(self) -> float:
        """N, the greatest normal force of one point."""
        return self._max_force

    @max_force.setter
    def max_force(self, value: float) -> None:
        given = real_array(value, f"the max_force of {self._name!r}")
        if given.ndim or not float(given) >= self._min_force or float(given) == 0.0:
            raise SettingError(
                f"the max_force of {self._name!r} is {value!r}; it must be > 0 and at least min_force, {self._min_force:g} N."
            )
        if self._activation < 1.0:
            self._require_finite(float(given))
        self._set("_max_force", float(given))

    @property
    def activation(self) -> float:
        """s in [0, 1]: 1 for a contact that holds, 0 for one that is open and has neither force nor rows.

        Between, its forces are at most s max_force, and `TorqueController` blends the torques with and without its motion
        rows: where s goes through [0, 1] without a jump, so do the torques. Needs a finite `max_force`.
        """
        return self._activation

    @activation.setter
    def activation(self, value: float) -> None:
        given = real_array(value, f"the activation of {self._name!r}")
        if given.ndim or not 0.0 <= float(given) <= 1.0:
            raise SettingError(f"the activation of {self._name!r} is {value!r}; it must be a number in [0, 1].")
        if float(given) < 1.0:
            self._require_finite(self._max_force)
        self._set("_activation", float(given))

    def _set(self, name: str, value: float | FloatArray) -> None:
        """Rows are made anew where something is another than before."""
        if not np.array_equal(getattr(self, name, np.nan), np.asarray(value)):
            setattr(self, name, value)
            self._version += 1

    def _require_finite(self, max_force: float) -> None:
        if not math.isfinite(max_force):
            raise SettingError(
                f"{self._name!r} has no max_force, so that its force cannot fade with its activation; give max_force, in N, of "
                "one point."
            )

    def axes(self, surface: FloatArray) -> FloatArray:
        """(3, 3) columns x, y, z of the contact in the world, for the rotation (3, 3) of `on`.

        A force f in the axes of the contact is `contact.axes(R_on) @ f` in the world. In the axes of `on`, with the normal n::

            tangent None   I + [k]x + [k]x^2 / (1 + n_z),   k = z x n       the shortest rotation that takes z to n
            tangent t      x = (t - n n^T t) / |t - n n^T t|,   y = n x x

        The first is I for n = (0, 0, 1), is a smooth function of n, and jumps at n = -z alone, as every choice must
        somewhere: there x stays and y is -y. The second jumps at n = +-t alone, where it is refused.
        """
        axes: FloatArray = surface @ _axes_with(self._normal, self._tangent)
        return axes

    def cone_rows(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """G (r, 3), lower (r,) and upper (r,) of `lower <= G f <= upper` at one point, as they are now; the last row is f_z."""
        mu, s = self._friction, self._activation
        if self._cone == "box":
            bound = mu * self._nominal_force / math.sqrt(2.0)
            bound = bound if s > 0.0 else 0.0
            G, lower, upper = np.eye(3), np.array([-bound, -bound, 0.0]), np.array([bound, bound, 0.0])
        else:
            angle = 2.0 * math.pi * np.arange(1, self._edges + 1) / self._edges
            least = -mu * math.cos(math.pi / self._edges)
            sides = np.stack((np.cos(angle), np.sin(angle), np.full(self._edges, least)), axis=1)
            G = np.vstack((sides, [0.0, 0.0, 1.0]))
            lower, upper = np.full(len(G), -math.inf), np.zeros(len(G))
        lower[-1] = self._min_force * s
        upper[-1] = self._max_force * s if s > 0.0 else 0.0
        return G, lower, upper

    def motion_basis(self) -> FloatArray:
        """B (r, 6), orthonormal rows: what of the twist in the frame's axes the points determine; r is 3, 5 or 6."""
        velocities = np.vstack([np.hstack((np.eye(3), -skew(point))) for point in self._points])
        _, sigma, Vt = np.linalg.svd(velocities)
        rank = int((sigma > 1e-9 * sigma[0]).sum())
        return np.eye(6) if rank == 6 else np.ascontiguousarray(Vt[:rank])

    def __repr__(self) -> str:
        return f"Contact({self._name!r}, {len(self._points)} points, activation {self._activation:g})"


def _axes_with(n: FloatArray, tangent: FloatArray | None) -> FloatArray:
    """(3, 3) columns x, y, z = n in the axes of the surface, as `Contact.axes` says."""
    if tangent is not None:
        x = tangent - n * (n @ tangent)
        x /= np.linalg.norm(x)
        return np.stack((x, np.cross(n, x), n), axis=1)
    square = float(n[0] * n[0] + n[1] * n[1])  # (1 + n_z) (1 - n_z)
    if n[2] < 0.0 and square < _OPPOSITE**2:
        return np.diag([1.0, -1.0, -1.0])
    K = skew(np.array([-n[1], n[0], 0.0]))
    axes: FloatArray = np.eye(3) + K + K @ K * ((1.0 - n[2]) / square if n[2] < 0.0 else 1.0 / (1.0 + n[2]))
    return axes
