"""Pinocchio models made through Pinocchio's own model interface: of a `DHArm`, and of a compiled MuJoCo model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.dh import DHArm

if TYPE_CHECKING:
    import mujoco


def arm_model(arm: DHArm) -> Any:
    """The `pinocchio.Model` of an arm: joints `joint1 ... jointn`, body frames `link1 ... linkn`, frame `tool`."""
    model = pin.Model()
    model.name = arm.name
    model.gravity = pin.Motion(np.array(arm.gravity), np.zeros(3))
    joint = 0
    for i, link in enumerate(arm.links):
        joint = model.addJoint(
            joint,
            pin.JointModelRZ(),
            pin.SE3(link.rotation, link.position),
            link.joint,
            np.array([np.inf]),
            np.array([arm.velocity_limit[i]]),
            np.array([arm.lower[i]]),
            np.array([arm.upper[i]]),
        )
        model.appendBodyToJoint(joint, pin.Inertia(link.mass, link.center, link.inertia), pin.SE3.Identity())
        model.addFrame(pin.Frame(link.name, joint, 0, pin.SE3.Identity(), pin.FrameType.BODY), False)
    rotation, position = arm.tool_placement
    model.addFrame(pin.Frame("tool", joint, 0, pin.SE3(rotation, position), pin.FrameType.OP_FRAME), False)
    model.armature = np.array(arm.armature)
    model.damping = np.array(arm.damping)
    return model


def model_from_mujoco(source: mujoco.MjModel, joint_names: tuple[str, ...]) -> tuple[Any, list[tuple[int, Any]]]:
    """The `pinocchio.Model` of a compiled MuJoCo model: the same tree, inertias, armature, limits and gravity.

    With it, of each body the joint that carries it, and its placement in that joint's frame.

    Hinges and slides keep their coordinate (the reference angle is put into the placement), several joints of one body
    become joints in a row, unnamed bodies stay. Equality constraints, tendons and actuators have no counterpart.
    """
    import mujoco

    model = pin.Model()
    model.name = bytes(source.names).split(b"\0", 1)[0].decode()
    off = source.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    model.gravity = pin.Motion(np.zeros(3) if off else source.opt.gravity.copy(), np.zeros(3))
    carriers = [(0, pin.SE3.Identity())]
    for i in range(1, source.nbody):
        joint, placement = carriers[source.body_parentid[i]]
        placement = placement * _se3(source.body_quat[i], source.body_pos[i])
        first = int(source.body_jntadr[i])
        for j in range(first, first + int(source.body_jntnum[i])):
            joint, placement = _add_joint(model, source, j, joint, placement, joint_names[j])
        carriers.append((joint, placement))
        rotation = _se3(source.body_iquat[i], np.zeros(3)).rotation
        inertia = rotation @ np.diag(source.body_inertia[i]) @ rotation.T
        inertia = pin.Inertia(float(source.body_mass[i]), source.body_ipos[i].copy(), inertia)
        model.appendBodyToJoint(joint, inertia, placement)
        if source.body(i).name:
            model.addFrame(pin.Frame(source.body(i).name, joint, 0, placement, pin.FrameType.BODY), False)
    for s in range(source.nsite):
        if source.site(s).name:
            joint, placement = carriers[source.site_bodyid[s]]
            placement = placement * _se3(source.site_quat[s], source.site_pos[s])
            model.addFrame(pin.Frame(source.site(s).name, joint, 0, placement, pin.FrameType.OP_FRAME), False)
    model.armature = source.dof_armature.copy()
    model.damping = np.array(source.dof_damping).reshape(source.nv, -1)[:, 0].copy()
    return model, carriers


def configuration_from_mujoco(source: mujoco.MjModel, qpos: FloatArray) -> FloatArray:
    """(nq,) Pinocchio's configuration for MuJoCo's `qpos`: quaternions (w, x, y, z) become (x, y, z, w)."""
    import mujoco

    q = np.array(qpos, dtype=np.float64)
    skip = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
    for j in range(source.njnt):
        if int(source.jnt_type[j]) in skip:
            start = int(source.jnt_qposadr[j]) + skip[int(source.jnt_type[j])]
            q[start : start + 4] = np.roll(q[start : start + 4], -1)
    return q


def _add_joint(model: Any, source: mujoco.MjModel, j: int, parent: int, placement: Any, name: str) -> tuple[int, Any]:
    """Add MuJoCo's joint j behind `placement`; returns the joint and the body's placement in the joint's frame."""
    import mujoco

    kind = mujoco.mjtJoint(int(source.jnt_type[j]))
    if kind == mujoco.mjtJoint.mjJNT_FREE:
        return model.addJoint(parent, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name), pin.SE3.Identity()
    anchor = pin.SE3(np.eye(3), source.jnt_pos[j].copy())
    if kind == mujoco.mjtJoint.mjJNT_BALL:
        return model.addJoint(parent, pin.JointModelSpherical(), placement * anchor, name), anchor.inverse()
    axis = source.jnt_axis[j].copy()
    reference = float(source.qpos0[source.jnt_qposadr[j]])
    if kind == mujoco.mjtJoint.mjJNT_HINGE:
        joint, zero = pin.JointModelRevoluteUnaligned(axis), pin.SE3(pin.exp3(-reference * axis), np.zeros(3))
    else:
        joint, zero = pin.JointModelPrismaticUnaligned(axis), pin.SE3(np.eye(3), -reference * axis)
    limited = bool(source.jnt_limited[j])
    lower, upper = source.jnt_range[j] if limited else (-np.inf, np.inf)
    index = model.addJoint(
        parent,
        joint,
        placement * anchor * zero,
        name,
        np.array([np.inf]),
        np.array([np.inf]),
        np.array([lower]),
        np.array([upper]),
    )
    return index, anchor.inverse()


def _se3(quaternion: FloatArray, position: FloatArray) -> Any:
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), np.array(position))
