"""The MuJoCo model of a `DHArm`: capsules, velocity servos, a tool site."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from hqp_rp.core.errors import RobotError
from hqp_rp.robot.dh import DHArm


def arm_spec(arm: DHArm, *, timestep: float = 0.001, gravity_compensation: bool = True) -> mujoco.MjSpec:
    """The editable MuJoCo model of `arm`; add a wall or a camera to it, then compile it or use `MujocoRobot.from_spec`.

    - Bodies `link1 ... linkn`, centred at their joints `joint1 ... jointn`, hold the capsule `link1 ... linkn` and the
      arm's own inertia; the site `tool` is on the last link. Angles are in rad.
    - Velocity servos `joint1 ... jointn`: torque = servo_gain (ctrl - dq/dt), ctrl in rad/s, clipped to the velocity
      limits; armature and viscous damping as in the arm. Without load a servo reaches 1 / (1 + damping / servo_gain) of
      its command.
    - With `gravity_compensation` the weight of the links is cancelled by passive forces, as a robot's own controller
      does: a velocity servo alone would sag by gravity / servo_gain. `MujocoRobot.gravity` is not affected.
    - Integrator `implicitfast`, in which servos and damping are implicit: stable for any gain.
    - The arm's capsules collide with everything else in the model, but not with each other.

    Args:
        arm: the arm. timestep: s, > 0. gravity_compensation: see above.

    Raises:
        RobotError: a time step that is not a positive number.
    """
    if not (isinstance(timestep, int | float) and math.isfinite(timestep) and timestep > 0.0):
        raise RobotError(f"timestep is {timestep!r}; it must be a finite number of seconds > 0.")
    spec = mujoco.MjSpec()
    spec.modelname = arm.name
    spec.compiler.degree = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.option.timestep = timestep
    spec.option.gravity = arm.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody
    for i, link in enumerate(arm.links):
        body = body.add_body(name=link.name, pos=link.position, quat=_quaternion(link.rotation))
        body.explicitinertial = True
        body.mass = link.mass
        body.ipos = link.center
        inertia = link.inertia
        body.fullinertia = [inertia[r, c] for r, c in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        body.gravcomp = 1.0 if gravity_compensation else 0.0
        body.add_joint(
            name=link.joint,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 0.0, 1.0],
            range=[arm.lower[i], arm.upper[i]],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            armature=arm.armature[i],
            damping=[arm.damping[i], 0.0, 0.0],
        )
        _add_shape(body, link.name, link.end, link.radius)
        servo = spec.add_actuator(name=link.joint, target=link.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_velocity(kv=arm.servo_gain[i])
        servo.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
        servo.ctrlrange = [-arm.velocity_limit[i], arm.velocity_limit[i]]
    rotation, position = arm.tool_placement
    body.add_site(name="tool", pos=position, quat=_quaternion(rotation), size=[0.01, 0.01, 0.01])
    spec.add_key(name="neutral", qpos=list(arm.neutral))
    return spec


def _add_shape(body: mujoco.MjsBody, name: str, end: np.ndarray, radius: float) -> None:
    # contype 1 against conaffinity 2: the arm meets geoms with MuJoCo's default bits, and never itself.
    shape = {"name": name, "contype": 1, "conaffinity": 2}
    if np.any(end):
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        body.add_geom(type=kind, fromto=[0.0, 0.0, 0.0, *end], size=[radius, 0.0, 0.0], **shape)
    else:
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0], **shape)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion
