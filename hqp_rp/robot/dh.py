"""Serial arms from Denavit-Hartenberg rows, as plain data with closed-form kinematics.

A `DHArm` is the one source from which the MuJoCo and the Pinocchio model of an arm are made; its own kinematics are a
third, independent computation of poses and Jacobians, of any number of configurations in one native call.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core import _native
from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.threads import in_shares
from hqp_rp.robot.angles import warn_of_degrees

_PER_JOINT = (
    "d",
    "a",
    "alpha",
    "lower",
    "upper",
    "velocity_limit",
    "mass",
    "radius",
    "armature",
    "damping",
    "servo_gain",
    "neutral",
)


# Configurations that take longer than a thread to start: about half a millisecond.
_WORTH_A_THREAD = 2000


@dataclasses.dataclass(frozen=True)
class Link:
    """One rigid link of a `DHArm`: a solid capsule of uniform density, in the frame centred at its own joint.

    Attributes:
        name, joint: names of the link and of the joint that moves it.
        rotation: (3, 3), position: (3,) m: the link's frame at q = 0 in the previous link's frame (in the world for
            the first); the joint turns about its z axis.
        end: (3,) m, origin of the next joint (of the tool for the last link); the capsule's axis runs from 0 to it.
        radius: m. mass: kg. center: (3,) m, the centre of mass. inertia: (3, 3) kg m^2 about it, in the link's axes.
    """

    name: str
    joint: str
    rotation: FloatArray
    position: FloatArray
    end: FloatArray
    radius: float
    mass: float
    center: FloatArray
    inertia: FloatArray


@dataclasses.dataclass(frozen=True, kw_only=True)
class DHArm:
    """A serial arm of n revolute joints in the standard (distal) DH convention, with primitive links.

    Row i carries frame i-1 to frame i by `Rot_z(q_i) Trans_z(d_i) Trans_x(a_i) Rot_x(alpha_i)`, so joint i turns about
    z of frame i-1, and frame n is the `tool`. The frames of the arm are

        link1 ... linkn   fixed to link i, origin and z axis on joint i (frame i-1 turned by q_i)
        tool              frame n, at the end of the last link

    Every per-joint field is a tuple of n numbers; one number stands for all joints. Link i is a solid capsule from
    joint i to joint i+1 (a sphere where the two coincide).

    Args:
        name: the arm's name, also of the models made from it.
        d, a: m. alpha: rad. The DH rows; their common length sets n.
        lower, upper: rad, joint position limits. velocity_limit: rad/s, > 0.
        mass: kg per link, > 0. radius: m, of each capsule, > 0.
        armature: kg m^2, rotor inertia seen at the joint. damping: N m s/rad, viscous friction of the joint.
        servo_gain: N m s/rad, gain kv of the velocity servo, torque = kv (command - dq/dt).
        gravity: m/s^2 in the world. neutral: rad, the reference configuration, within the limits.

    Raises:
        RobotError: no joint, a field of the wrong length, a number that is not finite or not allowed.

    Warns:
        UserWarning: an alpha of more than a turn, which looks like degrees.

    Source: Denavit and Hartenberg 1955; the distal form as in Siciliano et al., Robotics, 2009, section 2.8.2.
    """

    name: str
    d: tuple[float, ...]
    a: tuple[float, ...]
    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity_limit: tuple[float, ...]
    mass: tuple[float, ...]
    radius: tuple[float, ...]
    armature: tuple[float, ...] = (0.0,)
    damping: tuple[float, ...] = (0.0,)
    servo_gain: tuple[float, ...] = (100.0,)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    neutral: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        sizes = {np.size(getattr(self, field)) for field in ("d", "a", "alpha")}
        n = max(sizes)
        if n < 1:
            raise RobotError(f"arm {self.name!r} has no joint: d, a and alpha are empty.")
        for field in _PER_JOINT:
            object.__setattr__(self, field, _numbers(self.name, field, getattr(self, field), n))
        gravity = _numbers(self.name, "gravity", self.gravity, 3, one_for_all=False)
        object.__setattr__(self, "gravity", gravity)
        for field in ("velocity_limit", "mass", "radius"):
            _require(self, field, lambda value: value > 0.0, "> 0")
        for field in ("armature", "damping", "servo_gain"):
            _require(self, field, lambda value: value >= 0.0, ">= 0")
        warn_of_degrees(f"arm {self.name!r}", [f"alpha[{i}]" for i in range(n)], self.alpha)
        for i, (low, neutral, high) in enumerate(zip(self.lower, self.neutral, self.upper, strict=True)):
            if not low <= neutral <= high:
                raise RobotError(
                    f"arm {self.name!r}: joint {i + 1} has lower {low:g}, neutral {neutral:g}, upper {high:g}; "
                    "it must hold that lower <= neutral <= upper."
                )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.d)

    @property
    def total_mass(self) -> float:
        """kg, all links."""
        return math.fsum(self.mass)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """joint1 ... jointn."""
        return tuple(f"joint{i + 1}" for i in range(self.n))

    @property
    def frame_names(self) -> tuple[str, ...]:
        """link1 ... linkn, tool."""
        return (*(f"link{i + 1}" for i in range(self.n)), "tool")

    @functools.cached_property
    def links(self) -> tuple[Link, ...]:
        """The links from base to tool, with placements and inertias."""
        links = []
        rotation, position = np.eye(3), np.zeros(3)
        for i in range(self.n):
            end = np.array([self.a[i], 0.0, self.d[i]])
            inertia = capsule_inertia(self.mass[i], self.radius[i], end)
            links.append(
                Link(
                    name=f"link{i + 1}",
                    joint=f"joint{i + 1}",
                    rotation=_read_only(rotation),
                    position=_read_only(position),
                    end=_read_only(end),
                    radius=self.radius[i],
                    mass=self.mass[i],
                    center=_read_only(0.5 * end),
                    inertia=_read_only(inertia),
                )
            )
            c, s = math.cos(self.alpha[i]), math.sin(self.alpha[i])
            rotation, position = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]), end
        return tuple(links)

    @property
    def tool_placement(self) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and origin (3,) m of the tool in the last link's frame."""
        c, s = math.cos(self.alpha[-1]), math.sin(self.alpha[-1])
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]), np.array([self.a[-1], 0.0, self.d[-1]])

    def pose(self, q: ArrayLike, frame: str = "tool") -> tuple[FloatArray, FloatArray]:
        """Rotation (..., 3, 3) to the world and origin (..., 3) m of `frame`, for q (..., n) rad.

        Raises `RobotError` on an unknown frame, a wrong last dimension or a value that is not finite.
        """
        return self.kinematics(q, frame)[:2]

    def jacobian(self, q: ArrayLike, frame: str = "tool") -> FloatArray:
        """(..., 6, n) geometric Jacobian of `frame` in world axes, for q (..., n) rad.

        Column k, for every joint k at or before the frame: `[z_k x (p - o_k); z_k]`, with z_k and o_k axis and origin
        of joint k and p the frame's origin; zero for later joints. Linear rows (m/rad) first. Errors as `pose`.
        """
        return self.kinematics(q, frame)[2]

    def kinematics(
        self, q: ArrayLike, frame: str = "tool", *, threads: int | None = 1
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rotation (..., 3, 3), origin (..., 3) m and Jacobian (..., 6, n) of `frame`, for q (..., n) rad, in one call.

        Eight configurations are computed side by side, each of them as if it were alone.

        Args:
            q: (..., n) rad. frame: one of `frame_names`.
            threads: how many share the configurations, at most; None means one for each core.

        Raises `RobotError` as `pose`, and `SettingError` for threads that are no number of threads.
        """
        index = self._index(frame)
        q = self._checked(q)
        Q = q.reshape(-1, self.n)
        rotations, origins = np.empty((len(Q), 3, 3)), np.empty((len(Q), 3))
        jacobians = np.empty((len(Q), 6, self.n))

        def work(span: slice) -> None:
            _native.serial_arm(Q[span], *self._rows, index, rotations[span], origins[span], jacobians[span])

        in_shares(work, len(Q), threads, least=_WORTH_A_THREAD)
        return (
            rotations.reshape(*q.shape[:-1], 3, 3),
            origins.reshape(*q.shape[:-1], 3),
            jacobians.reshape(*q.shape[:-1], 6, self.n),
        )

    @functools.cached_property
    def _rows(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """d, a, cos(alpha), sin(alpha), each (n,)."""
        return np.array(self.d), np.array(self.a), np.cos(self.alpha), np.sin(self.alpha)

    def _index(self, frame: str) -> int:
        names = self.frame_names
        if frame not in names:
            raise RobotError(str(unknown_name(f"frame of arm {self.name!r}", frame, names)))
        return names.index(frame)

    def _checked(self, q: ArrayLike) -> FloatArray:
        values = np.array(q, dtype=np.float64)
        if values.ndim < 1 or values.shape[-1] != self.n:
            raise RobotError(f"q has shape {values.shape}; the arm {self.name!r} takes (..., {self.n}).")
        if not np.isfinite(values).all():
            index = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
            raise RobotError(f"q{list(index)} is {values[index]}; every joint angle must be finite.")
        return values


def capsule_inertia(mass: float, radius: float, axis: FloatArray) -> FloatArray:
    """(3, 3) kg m^2: inertia about the centre of a solid capsule of uniform density.

    Args:
        mass: kg. radius: m. axis: (3,) m, from the centre of one end cap to the other; zero gives a sphere.

    With L = |axis| and the mass split by volume into cylinder m_c and caps m_s: about the axis
    `m_c r^2/2 + 2 m_s r^2/5`, across it `m_c (L^2/12 + r^2/4) + m_s (2 r^2/5 + L^2/4 + 3 L r/8)`.
    """
    length = float(np.linalg.norm(axis))
    caps = mass * (4.0 * radius / 3.0) / (length + 4.0 * radius / 3.0)
    cylinder = mass - caps
    along = cylinder * radius**2 / 2.0 + caps * 0.4 * radius**2
    across = cylinder * (length**2 / 12.0 + radius**2 / 4.0) + caps * (
        0.4 * radius**2 + length**2 / 4.0 + 3.0 * length * radius / 8.0
    )
    if length == 0.0:
        return across * np.eye(3)
    unit = axis / length
    return across * np.eye(3) + (along - across) * np.outer(unit, unit)


def _numbers(arm: str, field: str, value: object, n: int, *, one_for_all: bool = True) -> tuple[float, ...]:
    try:
        array = np.asarray(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        raise RobotError(f"arm {arm!r}: {field} is {value!r}; it must be numbers.") from None
    if array.size == 1 and one_for_all:
        array = np.full(n, array[0])
    if array.size != n:
        raise RobotError(f"arm {arm!r}: {field} has {array.size} numbers; it must have {n}.")
    if not np.isfinite(array).all():
        raise RobotError(f"arm {arm!r}: {field} is {value!r}; every number must be finite.")
    return tuple(array.tolist())


def _require(arm: DHArm, field: str, allowed: Callable[[float], bool], sign: str) -> None:
    for i, value in enumerate(getattr(arm, field)):
        if not allowed(value):
            raise RobotError(f"arm {arm.name!r}: {field} of joint {i + 1} is {value:g}; it must be {sign}.")


def _read_only(array: FloatArray) -> FloatArray:
    array = array.copy()
    array.flags.writeable = False
    return array
