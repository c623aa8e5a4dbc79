"""Names of frames, their poses and Jacobians in arrays, and the checks of configurations: what the robot adapters share."""

from __future__ import annotations

import enum
import fnmatch
import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core import _native
from hqp_rp.core._native import is_finite
from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_FLOAT64 = np.dtype(np.float64)


class FrameTable:
    """Name -> index of every frame that has a name.

    A name borne by two frames of different kind (a body and a site called "hand") is ambiguous alone and is taken as
    "body:hand" or "site:hand". Frames without a name cannot be asked for. A joint frame yields its bare name to a body
    or site of the same name, and is then reached as "joint:NAME".

    Args:
        entries: (kind, name, index) of each frame.
    """

    def __init__(self, entries: Iterable[tuple[str, str, int]]) -> None:
        bearers: dict[str, list[tuple[str, int]]] = {}
        for kind, name, index in entries:
            if name:
                bearers.setdefault(name, []).append((kind, index))
        self.index: dict[str, int] = {}
        self._ambiguous: dict[str, list[str]] = {}
        for name, frames in bearers.items():
            main = [(kind, index) for kind, index in frames if kind != "joint"] or frames
            if len(main) == 1:
                self.index[name] = main[0][1]
                qualified = [entry for entry in frames if entry not in main]
            else:
                self._ambiguous[name] = [f"{kind}:{name}" for kind, _ in main]
                qualified = frames
            for kind, index in qualified:
                self.index[f"{kind}:{name}"] = index

    @property
    def names(self) -> tuple[str, ...]:
        """Every name that is accepted, in the order of the model."""
        return tuple(self.index)

    def error(self, name: object, robot: str) -> RobotError:
        """The error for a name that is not in the table: ambiguous, or unknown with the nearest and all valid ones."""
        if isinstance(name, str) and name in self._ambiguous:
            choices = " or ".join(repr(choice) for choice in self._ambiguous[name])
            return RobotError(f"The frame name {name!r} of {robot} is ambiguous: write {choices}.")
        return RobotError(str(unknown_name(f"frame of {robot}", name, self.index)))


class Point(enum.Enum):
    """A point that is asked for like a frame; its axes are the world's."""

    CENTER_OF_MASS = "centre of mass"


class Frames:
    """Poses and Jacobians of some frames of a robot, in arrays that `read` brings up to date.

    Args:
        robot: any `Robot`. names: of the frames, or `Point.CENTER_OF_MASS`.

    Attributes:
        names: (F,) as given. rotations: (F, 3, 3) to the world. origins: (F, 3) m.
        jacobians: (F, 6, nv), linear over angular velocity, both in world axes, as `Robot.jacobian`; of the centre of
            mass the angular half is 0.
        kinematics: what does the work of `read` natively; None where only Python can.
        q: (nq,) the array in which the robot's library keeps the configuration, or None.
    """

    kinematics: _native.Kinematics | None = None
    q: FloatArray | None = None

    def __init__(self, robot: Robot, names: tuple[str | Point, ...]) -> None:
        self._robot, self.names = robot, names
        self.rotations = np.tile(np.eye(3), (len(names), 1, 1))
        self.origins = np.zeros((len(names), 3))
        self.jacobians = np.zeros((len(names), 6, robot.nv))
        self._real = [(f, name) for f, name in enumerate(names) if not isinstance(name, Point)]
        self._many = getattr(robot, "fill_bias_accelerations", None)  # what tells those of several frames at once

    def read(self) -> None:
        """Fill the arrays for the robot's current configuration. Raises `RobotError` for arrays of a wrong shape."""
        robot = self._robot
        for f, name in enumerate(self.names):
            if isinstance(name, Point):
                self.origins[f] = robot.center_of_mass()
                self.jacobians[f, :3] = robot.center_of_mass_jacobian()
                continue
            rotation, origin = robot.pose(name)
            jacobian = robot.jacobian(name)
            if jacobian.shape != self.jacobians[f].shape or rotation.shape != (3, 3) or origin.shape != (3,):
                raise RobotError(
                    f"{robot!r} gives for the frame {name!r} a rotation {rotation.shape}, an origin {origin.shape} and a "
                    f"Jacobian {jacobian.shape}; they must be (3, 3), (3,) and {self.jacobians[f].shape}."
                )
            self.rotations[f], self.origins[f], self.jacobians[f] = rotation, origin, jacobian

    def motion(self, v: FloatArray, twists: FloatArray, biases: FloatArray) -> None:
        """Fill J v (F, 6) and Jdot v (F, 6), linear over angular in world axes, for v (nv,), after `read`.

        Raises `RobotError` for a robot that does not tell Jdot v.
        """
        self.fill_biases(v, biases)
        np.matmul(self.jacobians, v, out=twists)

    def fill_biases(self, v: FloatArray, biases: FloatArray) -> None:
        """Fill Jdot v (F, 6) alone; as `motion`."""
        robot = self._robot
        if self._many is not None:
            self._many(self._real, v, biases)
        for f, name in enumerate(self.names):
            if isinstance(name, Point):
                biases[f, :3] = _ask(robot, "center_of_mass_bias_acceleration")(v)
            elif self._many is None:
                biases[f] = _ask(robot, "bias_acceleration")(name, v)

    def move_to(self, rotations: FloatArray, origins: FloatArray, jacobians: FloatArray) -> None:
        """Keep poses and Jacobians in these arrays from now on; shapes as of the attributes."""
        for out, own in ((rotations, self.rotations), (origins, self.origins), (jacobians, self.jacobians)):
            out[:] = own
        self.rotations, self.origins, self.jacobians = rotations, origins, jacobians

    def many(self, q: FloatArray, threads: int | None = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same at q (N, nq): rotations (N, F, 3, 3), origins (N, F, 3) and jacobians (N, F, 6, nv).

        One configuration after the other, and the robot is put back; robots with a faster way override it, and use
        `threads` threads. Errors as `Robot.update`.
        """
        robot = self._robot
        shapes = (self.rotations.shape, self.origins.shape, self.jacobians.shape)
        found = tuple(np.empty((len(q), *shape)) for shape in shapes)
        before = robot.q
        try:
            for i, configuration in enumerate(q):
                robot.update(configuration)
                self.read()
                for out, own in zip(found, (self.rotations, self.origins, self.jacobians), strict=True):
                    out[i] = own
        finally:
            robot.update(before)
        return found[0], found[1], found[2]


def frames_of(robot: Robot, names: tuple[str | Point, ...]) -> Frames:
    """The frames in the way that suits the robot: its own `frame_reader(names)` where it has one."""
    own = getattr(robot, "frame_reader", None)
    return Frames(robot, names) if own is None else own(names)


def _ask(robot: Robot, method: str) -> Callable[..., FloatArray]:
    """A method of the robot that only accelerations need. Raises `RobotError` where it has none."""
    found: Callable[..., FloatArray] | None = getattr(robot, method, None)
    if found is None:
        raise RobotError(
            f"a {type(robot).__name__} has no method {method}(), which accelerations need; use a MujocoRobot or "
            "a PinocchioRobot."
        )
    return found


def checked_vector(value: ArrayLike, size: int, what: str) -> FloatArray:
    """`value` as (size,) float64, not copied where it is one. Raises `RobotError` on a wrong size or a NaN."""
    vector = value if type(value) is np.ndarray and value.dtype is _FLOAT64 else np.asarray(value, dtype=np.float64)
    if vector.shape != (size,):
        raise RobotError(f"{what} has shape {vector.shape}; it must be ({size},).")
    if not is_finite(vector):
        i = int(np.flatnonzero(~np.isfinite(vector))[0])
        raise RobotError(f"{what}[{i}] is {vector[i]}; every entry must be finite.")
    return vector


def checked_limit(
    value: ArrayLike | Mapping[str, float], names: tuple[str, ...], widths: tuple[int, ...]
) -> FloatArray:
    """(nv,) velocity limits, read-only: one number for all, (nv,) numbers, or joint name -> number (others infinite).

    A pattern of names ("left_*") stands for the hinges and slides that match it; a name outweighs it.

    Args:
        names, widths: the joints and how many velocities each has.
    """
    nv = sum(widths)
    if isinstance(value, Mapping):
        stated: dict[str, float] = {}
        for name, number in value.items():
            if name not in names:
                scalar = [joint for joint, width in zip(names, widths, strict=True) if width == 1]
                matching = fnmatch.filter(scalar, name) if any(sign in name for sign in "*?[") else []
                if not matching:
                    raise RobotError(f"velocity_limit: {unknown_name('joint', name, names)}")
                stated |= dict.fromkeys(matching, float(number))
        stated |= {name: float(number) for name, number in value.items() if name in names}
        parts = [np.full(width, stated.get(name, math.inf)) for name, width in zip(names, widths, strict=True)]
        limit = np.concatenate(parts) if parts else np.zeros(0)
    else:
        limit = np.array(value, dtype=np.float64)
        limit = np.full(nv, float(limit)) if limit.ndim == 0 else limit
    if limit.shape != (nv,):
        raise RobotError(
            f"velocity_limit has shape {limit.shape}; it must be one number, ({nv},) or a mapping by joint."
        )
    bad = np.flatnonzero(~(limit >= 0.0))
    if bad.size:
        raise RobotError(f"velocity_limit[{bad[0]}] is {limit[bad[0]]}; it must be >= 0 (infinite means none).")
    return frozen(limit)


def require_velocity(v: object) -> None:
    """Raises `RobotError` where v is None, as `Solution.x` is when a solve gave no answer."""
    if v is None:
        raise RobotError(
            "v is None: the solve gave no x; see its Solution.status and message, and hold the last command or stop."
        )


def require_joints(nv: int, robot: str) -> None:
    """Raises `RobotError` for a model that cannot move."""
    if nv < 1:
        raise RobotError(f"In {robot} nothing can move: it has no joint (a URDF can be given floating_base=True).")


def frozen(array: FloatArray) -> FloatArray:
    """The array itself, made read-only."""
    array.setflags(write=False)
    return array
