"""Small robot models for the tests, and what is needed to compare two conventions."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot import DHArm, MujocoRobot, planar_arm, sawyer

ARMS: tuple[DHArm, ...] = (sawyer(), *(planar_arm(n, gravity=(1.0, -9.0, 3.0)) for n in range(1, 8)))

# A fixed body with mass, a free base, a hinge and a slide on one body with anchors and references, a ball joint on an
# unnamed body, a name borne by a body and a site, gravity of its own.
MIXED_MJCF = """
<mujoco model="mixed">
  <option gravity="1 0 -5"/>
  <worldbody>
    <body name="fixed" pos="0 0 2" euler="10 20 30"><geom size=".2" mass="3"/><site name="both" pos="1 0 0"/></body>
    <body name="base" pos="1 2 3" euler="10 20 30">
      <freejoint name="float"/>
      <geom type="box" size=".1 .2 .3" mass="2"/>
      <body name="arm" pos="0 0 1" euler="40 5 6">
        <joint name="hinge" axis="0 1 .3" pos=".1 .2 .3" ref="30" range="-20 90" armature=".3"/>
        <joint name="slide" type="slide" axis="1 .5 0" ref=".2" range="-1 1"/>
        <geom type="capsule" size=".1 .2" pos=".1 0 0"/>
        <site name="mark" pos=".1 .2 .3" euler="0 30 0"/>
        <body pos=".1 .2 .3">
          <joint type="ball" pos=".1 0 .1"/>
          <geom size=".1"/>
          <body name="both"><joint name="last" axis="1 0 0"/><geom size=".1" pos=".3 .2 .1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
# Where quaternions start in q of the mixed model, in either library.
MIXED_QUATERNIONS = (3, 9)

_INERTIA = '<inertia ixx=".1" iyy=".2" izz=".15" ixy=".01" ixz="0" iyz=".02"/>'
URDF = f"""
<robot name="two">
  <link name="base"><inertial><mass value="5"/>{_INERTIA}</inertial></link>
  <link name="upper"><inertial><origin xyz="0 .1 .1" rpy=".1 .2 .3"/><mass value="1"/>{_INERTIA}</inertial></link>
  <link name="fore"><inertial><origin xyz="0 0 .2"/><mass value="2"/>{_INERTIA}</inertial></link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/><origin xyz="0 0 1" rpy=".3 0 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="9"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore"/><axis xyz="0 .6 .8"/><origin xyz="0 0 1"/>
  </joint>
  <joint name="tool" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0 .1 .5" rpy="0 0 1"/></joint>
</robot>
"""


def mixed_configurations(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """One random configuration of the mixed model as MuJoCo's q and as Pinocchio's."""
    q = rng.normal(size=14)
    for start in MIXED_QUATERNIONS:
        q[start : start + 4] /= np.linalg.norm(q[start : start + 4])
    other = q.copy()
    for start in MIXED_QUATERNIONS:
        other[start : start + 4] = np.roll(q[start : start + 4], -1)
    return q, other


def free_base_change(robot: MujocoRobot, base: str) -> FloatArray:
    """(nv, nv) T of `v_mujoco = T v_pinocchio`: the free base's linear velocity in world axes from its own axes."""
    change = np.eye(robot.nv)
    change[:3, :3] = robot.pose(base)[0]
    return change
