"""Mass matrix and bias torque of any robot, written into arrays that are read again and again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray

_READ, _STATED = "read_dynamics", ("mass_matrix", "bias")


def dynamics_reader(robot: Any) -> Callable[[FloatArray, FloatArray, FloatArray], None]:
    """What writes M(q) (nv, nv) and h(q, v) + g(q) (nv,) of a robot into arrays: `read(v, M, bias)`, for v (nv,).

    The robot's own `read_dynamics`, unless a subclass or the object itself has another `mass_matrix` or `bias`, which then
    count; else those two. Reading raises `RobotError` where they return another shape.
    """
    if _own_is_meant(robot):
        own: Callable[[FloatArray, FloatArray, FloatArray], None] = robot.read_dynamics
        return own

    def read(v: FloatArray, mass_matrix: FloatArray, bias: FloatArray) -> None:
        for name, given, out in (("mass_matrix()", robot.mass_matrix(), mass_matrix), ("bias(v)", robot.bias(v), bias)):
            if given.shape != out.shape:
                raise RobotError(f"{name} of {robot!r} has shape {given.shape}; it must be {out.shape}.")
            out[...] = given

    return read


def _own_is_meant(robot: Any) -> bool:
    """Whether who states M and the bias last also says how they are read."""
    names = {_READ, *_STATED}
    for stated in (getattr(robot, "__dict__", {}), *(vars(kind) for kind in type(robot).__mro__)):
        if names & stated.keys():
            return _READ in stated
    return False
