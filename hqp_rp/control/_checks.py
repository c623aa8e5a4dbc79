"""What tasks, limits and stacks demand of the values they are given; each failure is one error with its remedy."""

from __future__ import annotations

import fnmatch
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.control._rotations import nearest_rotation, quaternion_to_matrix
from hqp_rp.core import _native
from hqp_rp.core._native import is_finite
from hqp_rp.core.errors import RobotError, SettingError, unknown_name
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

Rows: TypeAlias = slice | NDArray[np.int64]

ORTHONORMAL_TOLERANCE = 1e-6
"""How far R^T R may be from the identity, or the norm of a quaternion from 1, before it is refused."""

WORLD = "world"
LINEAR_AXES = ("x", "y", "z")
ANGULAR_AXES = ("rx", "ry", "rz")
TWIST_AXES = (*LINEAR_AXES, *ANGULAR_AXES)


def real_array(value: ArrayLike, what: str) -> FloatArray:
    """A float64 copy of `value`, C-contiguous; refuses what is ragged or not real."""
    try:
        raw = np.asarray(value)
    except ValueError as error:
        raise SettingError(f"{what} is ragged: every row must have the same length ({error}).") from None
    if raw.dtype.kind not in "fiu":
        shown = repr(value) if np.size(raw) < 20 else f"an array of {raw.dtype}"
        raise SettingError(f"{what} is {shown}; it must hold real numbers (float64).")
    return np.array(raw, dtype=np.float64, order="C")


def finite_vector(value: ArrayLike, size: int, what: str, unit: str) -> FloatArray:
    """A read-only finite vector (size,)."""
    vector = real_array(value, what)
    if vector.shape != (size,):
        raise SettingError(f"{what} has shape {vector.shape}; it must be {size} numbers in {unit}, shape ({size},).")
    if not is_finite(vector):
        _refuse_not_finite(vector, what)
    vector.flags.writeable = False
    return vector


def checked_motion(value: ArrayLike, robot: Robot, what: str, unit: str) -> FloatArray:
    """A velocity or acceleration (nv,) of a robot, finite and C-contiguous; the array itself where it is so."""
    vector = _native.finite_numbers(value, robot.nv)
    if vector is not None:
        return vector
    try:
        array = np.asarray(value)
        rounded = array if array.dtype.kind == "c" else np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise SettingError(f"{what} is {value!r}; it must be {robot.nv} numbers in {unit}.") from None
    if rounded.dtype.kind == "c" or rounded.shape != (robot.nv,) or not is_finite(rounded):
        raise SettingError(f"{what} is {rounded.tolist()}; it must be {robot.nv} finite numbers in {unit}.")
    return rounded


def rotation(value: Any, what: str) -> FloatArray:
    """A read-only rotation matrix (3, 3), from one, from a unit quaternion (w, x, y, z), or from an object that has one.

    Objects are SciPy's `Rotation`, mink's `SO3` and Pinocchio's `Quaternion`, whatever order they keep their numbers in.
    """
    array = real_array(_matrix_of(value), what)
    _refuse_not_finite(array, what)
    if array.shape == (4,):
        norm = float(np.linalg.norm(array))
        if abs(norm - 1.0) > ORTHONORMAL_TOLERANCE:
            raise SettingError(
                f"{what} = {array.tolist()} is a quaternion of norm {norm:.9g}; it must have norm 1 within "
                f"{ORTHONORMAL_TOLERANCE:g}, in the order (w, x, y, z). Divide it by its norm."
            )
        matrix = quaternion_to_matrix(array / norm)
    elif array.shape == (3, 3):
        deviation = float(np.abs(array.T @ array - np.eye(3)).max())
        if deviation > ORTHONORMAL_TOLERANCE:
            raise SettingError(
                f"{what} is not a rotation: R^T R is {deviation:.3g} away from the identity "
                f"(at most {ORTHONORMAL_TOLERANCE:g}). Orthonormalize it, or give a unit quaternion (w, x, y, z)."
            )
        if float(np.linalg.det(array)) < 0.0:
            raise SettingError(f"{what} is a reflection: its determinant is -1, a rotation has +1. Flip one axis.")
        matrix = nearest_rotation(array) if deviation > 1e-14 else array
    else:
        raise SettingError(
            f"{what} has shape {array.shape}; give a rotation matrix (3, 3) or a unit quaternion (4,) in the order "
            "(w, x, y, z)."
        )
    matrix.flags.writeable = False
    return matrix


def pose(value: Any, what: str) -> tuple[FloatArray, FloatArray]:
    """(R, p) from such a pair, as `robot.pose` returns it, from a homogeneous matrix (4, 4), or from an object that has one.

    Objects are mink's `SE3`, Pinocchio's `SE3`, and SciPy's `RigidTransform`.
    """
    value = _homogeneous_of(value)
    if isinstance(value, tuple | list) and len(value) == 2:
        return rotation(value[0], f"the rotation of {what}"), finite_vector(value[1], 3, f"the position of {what}", "m")
    matrix = real_array(value, what)
    if matrix.shape != (4, 4):
        raise SettingError(
            f"{what} has shape {matrix.shape}; give a pair (rotation, position), as robot.pose(frame) returns it, or a "
            "homogeneous matrix (4, 4)."
        )
    _refuse_not_finite(matrix, what)
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise SettingError(f"{what} has the last row {matrix[3].tolist()}; a homogeneous matrix ends in [0, 0, 0, 1].")
    return rotation(matrix[:3, :3], f"the rotation of {what}"), finite_vector(
        matrix[:3, 3], 3, f"the position of {what}", "m"
    )


def position(value: Any, what: str) -> FloatArray:
    """(3,) m, or the position of an object of a library for poses."""
    given = _homogeneous_of(value)
    return pose(given, what)[1] if given is not value else finite_vector(value, 3, what, "m")


def _matrix_of(value: Any) -> Any:
    """The matrix of an object of a library for rotations or poses; other values as they are."""
    for name in ("as_matrix", "toRotationMatrix"):
        method = getattr(value, name, None)
        if callable(method):
            return method()
    return value


def _homogeneous_of(value: Any) -> Any:
    """A matrix (4, 4) of an object of a library for poses; other values as they are."""
    homogeneous = getattr(value, "homogeneous", None)
    return _matrix_of(value) if homogeneous is None else homogeneous


def per_row(value: ArrayLike, rows: int | None, what: str, *, positive: bool) -> float | FloatArray:
    """A number for all rows or one for each of `rows` (None: not known yet), finite and >= 0 (> 0 when `positive`)."""
    array = real_array(value, what)
    if array.ndim > 1 or (array.ndim == 1 and rows is not None and len(array) != rows):
        each = "one for each row" if rows is None else f"one for each of the {rows} rows"
        raise SettingError(f"{what} has shape {array.shape}; give one number, or {each}.")
    allowed = "> 0" if positive else ">= 0"
    bad = np.flatnonzero(~(np.isfinite(array) & ((array > 0) if positive else (array >= 0))))
    if bad.size:
        remedy = " To leave a row out, leave it out of `axes` or `joints`." if positive else ""
        raise SettingError(f"{what} is {array.tolist()}; it must be finite and {allowed}.{remedy}")
    if array.ndim == 0:
        return float(array)
    array.flags.writeable = False
    return array


def positive_number(value: object, what: str) -> float:
    """A finite number > 0."""
    if type(value) is float and 0.0 < value < math.inf:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0.0 < float(value) < math.inf:
        raise SettingError(f"{what} is {value!r}; it must be a finite number > 0.")
    return float(value)


def frame_name(value: object, what: str) -> str:
    """A frame's name; whether the robot has it is seen when the robot is there."""
    if not isinstance(value, str) or not value:
        raise SettingError(f"{what} is {value!r}; it must be the name of a frame, one of robot.frame_names.")
    return value


def frame_point(value: ArrayLike | None, owner: str) -> FloatArray:
    """The point (3,) of a frame that is meant, in m and in the frame's own axes; None is its origin."""
    return finite_vector(np.zeros(3) if value is None else value, 3, f"the point of {owner!r}", "m")


def axis_rows(axes: str | Sequence[str], valid: tuple[str, ...], what: str) -> tuple[tuple[str, ...], Rows]:
    """The chosen axes in the order given, and their row indices (a slice when they are consecutive)."""
    chosen = tuple(axes) if not isinstance(axes, str) else ((axes,) if axes in valid else tuple(axes))
    if not chosen:
        raise SettingError(f"{what} chooses no axis; valid: {', '.join(valid)}.")
    for axis in chosen:
        if axis not in valid:
            raise SettingError(f"{what} = {axes!r}: there is no axis {axis!r}; valid: {', '.join(valid)}.")
    if len(set(chosen)) < len(chosen):
        raise SettingError(f"{what} = {axes!r} names an axis twice; give each axis once.")
    indices = [valid.index(axis) for axis in chosen]
    if indices == list(range(indices[0], indices[0] + len(indices))):
        return chosen, slice(indices[0], indices[0] + len(indices))
    return chosen, np.array(indices, dtype=np.int64)


def axis_numbers(axes: Sequence[str]) -> list[int]:
    """The place of each axis in `TWIST_AXES`, 0 to 5."""
    return [TWIST_AXES.index(axis) for axis in axes]


def check_frames(robot: Robot, frames: Iterable[str], owner: str) -> None:
    """Raise `RobotError` for the first of `frames` that the robot does not have."""
    known = set(robot.frame_names)
    for name in frames:
        if name == WORLD or name in known:
            continue
        try:
            robot.pose(name)  # an adapter may know a frame by more names than it lists
        except RobotError as error:
            raise RobotError(f"{owner}: {error}") from None
        except LookupError:
            raise RobotError(f"{owner}: {unknown_name('frame', name, known)}") from None


def joint_indices(robot: Robot, joints: Iterable[str | int], owner: str, *, distinct: bool = True) -> NDArray[np.int64]:
    """Velocity indices of joints given by name, by a pattern of names such as "left_*", or by velocity index.

    In the order given, none twice; or, where they need not be `distinct`, each once in ascending order.
    """
    found: list[int] = []
    for joint in joints:
        if isinstance(joint, str):
            found.extend(_named(robot, joint, owner))
        elif isinstance(joint, bool) or not isinstance(joint, int | np.integer):
            raise RobotError(
                f"{owner}: {joint!r} is no joint; give a name, a pattern such as 'left_*', or a velocity index, 0 to "
                f"{robot.nv - 1}."
            )
        elif 0 <= joint < robot.nv:
            found.append(int(joint))
        else:
            raise RobotError(f"{owner}: there is no velocity index {joint}; valid: 0 to {robot.nv - 1}.")
    if not distinct:
        found = sorted(set(found))
    if len(set(found)) < len(found):
        raise RobotError(f"{owner}: a joint is given twice in {list(joints)!r}; give each joint once.")
    return np.array(found, dtype=np.int64)


def driven_indices(robot: Robot) -> NDArray[np.int64]:
    """Velocity indices of what the robot drives: all, but for a robot's own `unactuated`."""
    unactuated = getattr(robot, "unactuated", ())
    return np.setdiff1d(np.arange(robot.nv), np.asarray(unactuated, dtype=np.int64))


def is_pattern(joint: object) -> bool:
    """Whether this is a pattern of joint names: shell wildcards *, ?, [...]."""
    return isinstance(joint, str) and any(sign in joint for sign in "*?[")


def _named(robot: Robot, joint: str, owner: str) -> list[int]:
    """Velocity indices of the hinges and slides of that name or pattern."""
    names = robot.joint_names
    widths = getattr(robot, "joint_widths", (1,) * len(names))
    starts = [0, *itertools.accumulate(widths)]
    if starts[-1] != robot.nv:
        raise RobotError(
            f"{owner}: this robot does not say which velocities the joint {joint!r} has (joint_widths); give velocity indices."
        )
    if joint not in names and is_pattern(joint):
        matching = [i for i, name in enumerate(names) if widths[i] == 1 and fnmatch.fnmatchcase(name, joint)]
        if not matching:
            raise RobotError(f"{owner}: no hinge or slide matches {joint!r}; the joints are {', '.join(names)}.")
        return [starts[i] for i in matching]
    if joint not in names:
        raise RobotError(f"{owner}: {unknown_name('joint', joint, names)}")
    i = names.index(joint)
    if widths[i] == 0:
        raise RobotError(
            f"{owner}: the joint {joint!r} has no velocity of its own (its library moves it with another joint); name the "
            "joint that it follows."
        )
    if widths[i] != 1:
        raise RobotError(
            f"{owner}: the joint {joint!r} has {widths[i]} velocities, so its name has no single index; give velocity indices "
            f"{starts[i]} to {starts[i + 1] - 1}."
        )
    return [starts[i]]


def _refuse_not_finite(array: FloatArray, what: str) -> None:
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        index = ", ".join(str(int(i)) for i in bad[0])
        raise SettingError(f"{what}[{index}] is {array[tuple(bad[0])]}; every entry must be finite.")
