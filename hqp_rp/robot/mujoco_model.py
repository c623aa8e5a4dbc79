"""What a compiled MuJoCo model says of itself: name, limits, where its quaternions are, its geometry."""

from __future__ import annotations

import mujoco
import numpy as np

from hqp_rp.core.problem import FloatArray
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


def position_limits(model: mujoco.MjModel) -> tuple[FloatArray, FloatArray]:
    """(nv,) lower and upper position limits by velocity index, infinite where there is none; read-only."""
    lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    for j in range(model.njnt):
        if model.jnt_limited[j] and int(model.jnt_type[j]) in scalar:
            lower[model.jnt_dofadr[j]], upper[model.jnt_dofadr[j]] = model.jnt_range[j]
    return frozen(lower), frozen(upper)
