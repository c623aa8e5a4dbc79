"""Mass matrix and bias torque of any robot, written into arrays that are read again and again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray

_READ = "_read_dynamics"


def dynamics_reader(robot: Any) -> Callable[[FloatArray, FloatArray, FloatArray], None]:
    """What writes M(q) (nv, nv) and h(q, v) + g(q) (nv,) of a robot into arrays: `read(v, M, bias)`, for v (nv,).

    They are what `mass_matrix()` and `bias(v)` of the robot return at that moment. A robot of the library may write both at
    once by a method `_read_dynamics`, which counts as long as neither a subclass nor the object states one of them in another
    way.

    Reading raises `RobotError` where they are not real numbers of that shape.
    """

    def read_each(v: FloatArray, mass_matrix: FloatArray, bias: FloatArray) -> None:
        _write(robot, "mass_matrix()", robot.mass_matrix(), mass_matrix)
        _write(robot, "bias(v)", robot.bias(v), bias)

    kind = type(robot)
    if not _reads_what_it_states(kind):
        return read_each
    own, members = getattr(robot, "__dict__", {}), (kind.mass_matrix, kind.bias)

    def read(v: FloatArray, mass_matrix: FloatArray, bias: FloatArray) -> None:
        if "bias" in own or "mass_matrix" in own or (kind.mass_matrix, kind.bias) != members:
            read_each(v, mass_matrix, bias)
        else:
            robot._read_dynamics(v, mass_matrix, bias)

    return read


def _reads_what_it_states(kind: type) -> bool:
    """Whether the class that states M or the bias last also says how both are read."""
    for stated in map(vars, kind.__mro__):
        if not stated.keys().isdisjoint((_READ, "mass_matrix", "bias")):
            return _READ in stated
    return False


def _write(robot: Any, name: str, given: ArrayLike, out: FloatArray) -> None:
    found = np.asarray(given)
    if found.shape != out.shape or found.dtype.kind not in "fiu":
        raise RobotError(
            f"{name} of {robot!r} is an array {found.shape} of {found.dtype}; it must be {out.shape} of real numbers."
        )
    out[...] = found
