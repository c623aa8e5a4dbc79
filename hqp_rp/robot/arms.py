"""The arms of the library as `DHArm` data: the paper's Sawyer, one like the Panda, a planar arm of any number of joints."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hqp_rp.core.errors import RobotError
from hqp_rp.robot.dh import DHArm

# kg, right_l0 ... right_l6, and rad/s, right_j0 ... right_j6, of Rethink Robotics' sawyer_description
# (urdf/sawyer_base.urdf.xacro).
_SAWYER_LINK_MASS = (5.3213, 4.505, 1.745, 2.5097, 1.1136, 1.5625, 0.3292)
_SAWYER_VELOCITY = (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545)


def sawyer(total_mass: float = 11.0) -> DHArm:
    """The 7-joint Sawyer of the paper: Table 1's rows, 11 kg in all, links as capsules.

    Table 1 is read in the standard (distal) convention: then joint 1 is vertical through the origin and joint 2
    horizontal, 0.317 m above and 0.081 m beside it, as on the robot, whose manufacturer's URDF has the same lengths
    (0.317, 0.081, 0.1925, 0.4, 0.1685, 0.4, 0.1363). Read in the proximal (Craig) convention, the first row would tilt
    and shift joint 1 itself. The signs and the last alpha are the table's; the tool is its frame 7.

    What the paper does not give, and is chosen here:

    - link masses: `total_mass` (the paper's 11 kg) shared in proportion to the manufacturer's link masses;
    - capsule radii: the manufacturer's collision primitives; inertias follow as those of uniform capsules;
    - velocity limits: the manufacturer's URDF (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545 rad/s);
    - armature 0.1 (joints 1-4) and 0.02 kg m^2 (5-7), servo gains 500, 500, 300, 300, 100, 100, 50 N m s/rad, viscous
      friction a thousandth of the gain, so that a velocity servo settles within 0.1 % of its command;
    - neutral (0, pi/2, 0, -pi/2, 0, pi/2, 0): elbow up, approach axis along +x, tool at (0.453, -0.497, 0.717) m, where
      the smallest singular value of the Jacobian is 0.187.

    Position limits are the table's [-pi, pi]. Args: total_mass, kg, > 0.

    Source: Table 1 of the paper; link masses and velocity limits from Rethink Robotics' sawyer_description.
    """
    gain = (500.0, 500.0, 300.0, 300.0, 100.0, 100.0, 50.0)
    half = math.pi / 2.0
    return DHArm(
        name="sawyer",
        d=(0.317, -0.1925, 0.4, -0.1685, 0.4, -0.1363, 0.13375),
        a=(-0.081, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        alpha=(-half, half, -half, half, -half, half, half),
        lower=(-math.pi,),
        upper=(math.pi,),
        velocity_limit=_SAWYER_VELOCITY,
        mass=tuple(total_mass * share / math.fsum(_SAWYER_LINK_MASS) for share in _SAWYER_LINK_MASS),
        radius=(0.07, 0.07, 0.06, 0.06, 0.045, 0.06, 0.05),
        armature=(0.1, 0.1, 0.1, 0.1, 0.02, 0.02, 0.02),
        damping=tuple(1e-3 * kv for kv in gain),
        servo_gain=gain,
        neutral=(0.0, half, 0.0, -half, 0.0, half, 0.0),
    )


def panda_like() -> DHArm:
    """Kinematics and limits of Franka Emika's Panda without a gripper. Inertias are not published: each link counts as 2 kg.

    The manufacturer's rows are in the proximal (Craig) convention, (a, alpha) of row i + 1 standing where the distal one has
    those of row i: read so here, with the flange as the tool.

    Source: Franka Control Interface documentation, "Robot and interface specifications", DH parameters and limits.
    """
    half = math.pi / 2.0
    return DHArm(
        name="panda_like",
        d=(0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.107),
        a=(0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088, 0.0),
        alpha=(-half, half, half, -half, half, half, 0.0),
        lower=(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        upper=(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
        velocity_limit=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
        mass=(2.0,),
        radius=(0.06,),
        neutral=(0.0, -0.25 * math.pi, 0.0, -0.75 * math.pi, 0.0, half, 0.25 * math.pi),
    )


def planar_arm(
    n_joints: int,
    link_length: float | Sequence[float] = 0.4,
    *,
    link_mass: float | Sequence[float] = 1.0,
    radius: float = 0.04,
    joint_limit: float = math.pi,
    velocity_limit: float | Sequence[float] = 3.0,
    gravity: Sequence[float] = (0.0, 0.0, -9.81),
) -> DHArm:
    """An arm of `n_joints` parallel joints about z, moving in the plane z = 0 and stretched along x at q = 0.

    Tool position: `x = sum_i l_i cos(q_1 + ... + q_i)`, `y = sum_i l_i sin(q_1 + ... + q_i)`.

    Args:
        n_joints: at least 1. link_length: m, > 0, one for all or one per link. link_mass: kg, the same way.
        radius: m, of the capsules. joint_limit: rad, limits are [-joint_limit, joint_limit].
        velocity_limit: rad/s. gravity: m/s^2; the default is across the plane and loads no joint, (0, -9.81, 0) makes
            the plane vertical.

    Armature 0.01 kg m^2, servo gain 200 N m s/rad, friction 0.2 N m s/rad. Neutral: every joint at 0.3 rad (or at
    half its limit where that is less), away from the stretched singularity.

    Raises:
        RobotError: n_joints below 1, or a number that is not allowed; it names the field.
    """
    if isinstance(n_joints, bool) or not isinstance(n_joints, int) or n_joints < 1:
        raise RobotError(f"n_joints is {n_joints!r}; it must be an integer of at least 1.")
    lengths = (
        [float(link_length)] * n_joints if isinstance(link_length, int | float) else [float(x) for x in link_length]
    )
    if len(lengths) != n_joints or not all(math.isfinite(length) and length > 0.0 for length in lengths):
        raise RobotError(
            f"link_length is {link_length!r}; it must be one number > 0, or {n_joints} of them, one for each link."
        )
    return DHArm(
        name=f"planar{n_joints}",
        d=(0.0,) * n_joints,
        a=tuple(lengths),
        alpha=(0.0,) * n_joints,
        lower=(-joint_limit,),
        upper=(joint_limit,),
        velocity_limit=(velocity_limit,) if isinstance(velocity_limit, int | float) else tuple(velocity_limit),
        mass=(link_mass,) if isinstance(link_mass, int | float) else tuple(link_mass),
        radius=(radius,),
        armature=(0.01,),
        damping=(0.2,),
        servo_gain=(200.0,),
        gravity=tuple(gravity),  # type: ignore[arg-type]
        neutral=(min(0.3, 0.5 * joint_limit),),
    )
