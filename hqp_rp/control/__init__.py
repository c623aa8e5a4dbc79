"""Tasks, limits and the stack that turns them into a prioritized problem at every control step."""

from __future__ import annotations

from hqp_rp.control.acceleration_stack import AccelerationStack
from hqp_rp.control.activation import BlendedSolution, blend, ramp
from hqp_rp.control.angular_momentum_task import AngularMomentumTask
from hqp_rp.control.center_of_mass_task import CenterOfMassTask
from hqp_rp.control.collision_limit import CollisionLimit
from hqp_rp.control.command import Command, Mode
from hqp_rp.control.cone_limit import ConeLimit
from hqp_rp.control.contact import Contact
from hqp_rp.control.contact_force_task import ContactForceTask
from hqp_rp.control.force import ForceReference
from hqp_rp.control.frame_speed_limit import FrameSpeedLimit
from hqp_rp.control.half_space_limit import HalfSpaceLimit
from hqp_rp.control.hybrid import HybridReference
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.control.interaction_controller import InteractionController
from hqp_rp.control.inverse_dynamics import InverseDynamics
from hqp_rp.control.joint_coupling import JointCoupling
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.joint_limit_potential import JointLimitPotential
from hqp_rp.control.limit import Limit, VelocityLimit
from hqp_rp.control.locked_joints import LockedJoints
from hqp_rp.control.look_at_task import LookAtTask
from hqp_rp.control.motion_runner import MotionRunner
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.pointing_task import PointingTask
from hqp_rp.control.pose_limit import PoseLimit
from hqp_rp.control.pose_task import PoseTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.reference import Reference
from hqp_rp.control.relative_pose_task import RelativePoseTask
from hqp_rp.control.stack import Stack
from hqp_rp.control.support_polygon_limit import SupportPolygonLimit
from hqp_rp.control.task import FeedbackTask, Task
from hqp_rp.control.torque_controller import TorqueCommand, TorqueController
from hqp_rp.control.torque_limit import TorqueLimit
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.control.torque_task import TorqueTask
from hqp_rp.control.twist_task import TwistTask
from hqp_rp.control.wrench import Wrench, WrenchSensor
from hqp_rp.core.conflict import Conflict

__all__ = [
    "AccelerationStack",
    "AngularMomentumTask",
    "BlendedSolution",
    "CenterOfMassTask",
    "CollisionLimit",
    "Command",
    "ConeLimit",
    "Conflict",
    "Contact",
    "ContactForceTask",
    "FeedbackTask",
    "ForceReference",
    "FrameSpeedLimit",
    "HalfSpaceLimit",
    "HybridReference",
    "ImpedanceReference",
    "InteractionController",
    "InverseDynamics",
    "JointCoupling",
    "JointLimit",
    "JointLimitPotential",
    "Limit",
    "LockedJoints",
    "LookAtTask",
    "Mode",
    "MotionRunner",
    "OrientationTask",
    "PointingTask",
    "PoseLimit",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "Reference",
    "RelativePoseTask",
    "Stack",
    "SupportPolygonLimit",
    "Task",
    "TorqueCommand",
    "TorqueController",
    "TorqueLimit",
    "TorqueStack",
    "TorqueTask",
    "TwistTask",
    "VelocityLimit",
    "Wrench",
    "WrenchSensor",
    "blend",
    "ramp",
]
