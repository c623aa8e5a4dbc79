"""What a compiled MuJoCo model says of itself: name, limits, where its quaternions are, its geometry, its geoms."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.frames import frozen
from hqp_rp.robot.geoms import Geoms, standing_geoms

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


def effort_limits(model: Any) -> FloatArray:
    """(nv,) the greatest |torque| of the motors that the model states, N m or N; infinite for none.

    A joint's `actuatorfrcrange` (a URDF's effort), and of motors on single joints their force or control range times gear.
    """
    limit = np.full(model.nv, np.inf)
    scalar = [
        int(kind) in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)) for kind in model.jnt_type
    ]
    for j in range(model.njnt):
        if scalar[j] and model.jnt_actfrclimited[j]:
            limit[model.jnt_dofadr[j]] = np.abs(model.jnt_actfrcrange[j]).min()
    for i in range(model.nu):
        j, gear = int(model.actuator_trnid[i, 0]), abs(float(model.actuator_gear[i, 0]))
        if int(model.actuator_trntype[i]) != int(mujoco.mjtTrn.mjTRN_JOINT) or not gear or not scalar[j]:
            continue
        force = np.inf
        if model.actuator_forcelimited[i]:
            force = float(np.abs(model.actuator_forcerange[i]).min())
        plain = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_NONE)
        fixed = int(model.actuator_gaintype[i]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        if model.actuator_ctrllimited[i] and plain and fixed:
            control = float(np.abs(model.actuator_ctrlrange[i]).min())
            force = min(force, control * abs(float(model.actuator_gainprm[i, 0])))
        v = int(model.jnt_dofadr[j])
        limit[v] = min(limit[v], force * gear)
    limit[limit == 0.0] = np.inf  # a range of zeros is how a file says nothing
    return limit


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


def geoms_of(model: mujoco.MjModel) -> Geoms:
    """Names, bodies and collision filter of the geoms, as `mj_collision` has them; groups of bits are not looked at."""
    count, body = int(model.ngeom), [int(b) for b in model.geom_bodyid]
    names = [model.geom(i).name for i in range(count)]
    standing = standing_geoms(body, [bool(model.geom_contype[i] or model.geom_conaffinity[i]) for i in range(count)])
    rigid = [int(model.body_weldid[b]) for b in body]
    filtered = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    own: dict[int, list[int]] = {b: [] for b in range(model.nbody)}
    for i, b in enumerate(body):
        own[b].append(i)
    excluded = {
        (min(a, b), max(a, b))
        for signature in model.exclude_signature.tolist()
        for a in own[signature >> 16]
        for b in own[signature & 0xFFFF]
    }
    kinds = model.geom_type
    return Geoms(
        shown=[name or f"geom {i} of {model.body(body[i]).name or 'an unnamed body'}" for i, name in enumerate(names)],
        names={name: i for i, name in enumerate(names) if name},
        bodies={model.body(b).name: tuple(i for i in own[b] if standing[i]) for b in own if model.body(b).name},
        standing=standing,
        rigid=rigid,
        parent=[int(model.body_weldid[model.body_parentid[r]]) if filtered else None for r in rigid],
        excluded=frozenset(excluded),
        planes=frozenset(i for i in range(count) if kinds[i] == mujoco.mjtGeom.mjGEOM_PLANE),
        refused={i: "a height field" for i in range(count) if kinds[i] == mujoco.mjtGeom.mjGEOM_HFIELD},
    )
