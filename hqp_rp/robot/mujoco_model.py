"""What a compiled MuJoCo model says of itself: name, limits, where its quaternions are, its geometry."""

from __future__ import annotations

import mujoco
import numpy as np

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.frames import frozen

# Where the quaternion of a joint starts within its part of q.
_QUATERNION = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}


def quaternions(model: mujoco.MjModel) -> tuple[int, ...]:
    """Where in q each quaternion starts."""
    return tuple(
        int(model.jnt_qposadr[j]) + _QUATERNION[int(model.jnt_type[j])]
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in _QUATERNION
    )


def geometry(model: mujoco.MjModel) -> FloatArray:
    """Every number of the model that poses and Jacobians depend on."""
    parts = ("body_pos", "body_quat", "jnt_pos", "jnt_axis", "site_pos", "site_quat", "qpos0")
    return np.concatenate([getattr(model, part).ravel() for part in parts])


def model_name(model: mujoco.MjModel) -> str:
    """The name of the model."""
    return bytes(model.names).split(b"\0", 1)[0].decode()


def keyframe(model: mujoco.MjModel, name: str) -> FloatArray:
    """(nq,) the configuration of the keyframe of that name. Raises `RobotError`, which lists the ones there are."""
    names = [model.key(i).name for i in range(model.nkey)]
    if not name or name not in names:
        has = ", ".join(sorted(filter(None, names))) or "none"
        raise RobotError(f"The MuJoCo model {model_name(model)!r} has no keyframe {name!r}; it has {has}.")
    return np.array(model.key_qpos[names.index(name)])


def scalar_coordinates(model: mujoco.MjModel) -> IntArray:
    """(nv,) index into q of each hinge's and slide's position, -1 for velocities of other joints."""
    index = np.full(model.nv, -1, dtype=np.int64)
    for j in range(model.njnt):
        if int(model.jnt_type[j]) not in _QUATERNION:
            index[model.jnt_dofadr[j]] = model.jnt_qposadr[j]
    return index


def position_limits(model: mujoco.MjModel) -> tuple[FloatArray, FloatArray]:
    """(nv,) lower and upper position limits by velocity index, infinite where there is none; read-only."""
    lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    for j in range(model.njnt):
        if model.jnt_limited[j] and int(model.jnt_type[j]) in scalar:
            lower[model.jnt_dofadr[j]], upper[model.jnt_dofadr[j]] = model.jnt_range[j]
    return frozen(lower), frozen(upper)
