"""One prioritized robot task stack, every hierarchical controller, and the truth about each."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hqp_rp.core.damping import (
    ConstantDamping,
    Damping,
    ErrorDamping,
    LevelDamping,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import (
    FileError,
    HqpError,
    MissingExtraError,
    NoSolutionError,
    ProblemError,
    RobotError,
    SettingError,
    UnknownNameError,
    WorkLimitError,
)
from hqp_rp.core.extras import require, require_report
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, all_solvers, get_solver, solve

if TYPE_CHECKING:
    from hqp_rp import problems
    from hqp_rp.compare.stress.stress import stress
    from hqp_rp.control.acceleration_stack import AccelerationStack
    from hqp_rp.control.angular_momentum_task import AngularMomentumTask
    from hqp_rp.control.catalogue import Catalogue, find_singularities
    from hqp_rp.control.center_of_mass_task import CenterOfMassTask
    from hqp_rp.control.collision_limit import CollisionLimit
    from hqp_rp.control.command import Command, Mode
    from hqp_rp.control.cone_limit import ConeLimit
    from hqp_rp.control.contact import Contact
    from hqp_rp.control.contact_force_task import ContactForceTask
    from hqp_rp.control.frame_speed_limit import FrameSpeedLimit
    from hqp_rp.control.half_space_limit import HalfSpaceLimit
    from hqp_rp.control.joint_coupling import JointCoupling
    from hqp_rp.control.joint_limit import JointLimit
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
    from hqp_rp.control.relative_pose_task import RelativePoseTask
    from hqp_rp.control.stack import Stack
    from hqp_rp.control.support_polygon_limit import SupportPolygonLimit
    from hqp_rp.control.task import Task
    from hqp_rp.control.torque_controller import TorqueController
    from hqp_rp.control.torque_limit import TorqueLimit
    from hqp_rp.control.torque_stack import TorqueStack
    from hqp_rp.control.torque_task import TorqueTask
    from hqp_rp.control.twist_task import TwistTask
    from hqp_rp.core.batch import BatchSolution, solve_batch
    from hqp_rp.core.certificate import Certificate, certify
    from hqp_rp.core.conflict import Conflict
    from hqp_rp.core.derivative import NotDifferentiableError, ProblemGradient, SolutionDerivative, jvp, vjp
    from hqp_rp.core.diagnostics import LevelReport, Singularity, diagnose
    from hqp_rp.core.distance import Distance, distance
    from hqp_rp.core.io import load_problem, save_problem
    from hqp_rp.core.truth import Truth, truth
    from hqp_rp.robot.model_file import load_robot

__version__ = "0.1.0"

__all__ = [
    "AccelerationStack",
    "AngularMomentumTask",
    "BatchSolution",
    "Catalogue",
    "CenterOfMassTask",
    "Certificate",
    "CollisionLimit",
    "Command",
    "ConeLimit",
    "Conflict",
    "ConstantDamping",
    "Contact",
    "ContactForceTask",
    "Damping",
    "Distance",
    "ErrorDamping",
    "FileError",
    "FrameSpeedLimit",
    "HalfSpaceLimit",
    "HqpError",
    "JointCoupling",
    "JointLimit",
    "Level",
    "LevelDamping",
    "LevelReport",
    "Limit",
    "LockedJoints",
    "LookAtTask",
    "ManipulabilityDamping",
    "MissingExtraError",
    "Mode",
    "MotionRunner",
    "NoDamping",
    "NoSolutionError",
    "NotDifferentiableError",
    "NumericalFiltering",
    "OrientationTask",
    "PointingTask",
    "PoseLimit",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "Problem",
    "ProblemError",
    "ProblemGradient",
    "RelativePoseTask",
    "RobotError",
    "SettingError",
    "Singularity",
    "Solution",
    "SolutionDerivative",
    "Solver",
    "Stack",
    "Status",
    "SupportPolygonLimit",
    "Task",
    "TorqueController",
    "TorqueLimit",
    "TorqueStack",
    "TorqueTask",
    "Truncation",
    "Truth",
    "TwistTask",
    "UnknownNameError",
    "VariableDamping",
    "VelocityLimit",
    "WorkLimitError",
    "all_solvers",
    "certify",
    "diagnose",
    "distance",
    "find_singularities",
    "get_solver",
    "jvp",
    "load_problem",
    "load_robot",
    "problems",
    "save_problem",
    "solve",
    "solve_batch",
    "stress",
    "truth",
    "vjp",
]

# `import hqp_rp` stays light: what needs more than numpy is imported when it is first used.
_LAZY = {
    "AngularMomentumTask": "control.angular_momentum_task",
    "TorqueTask": "control.torque_task",
    "TorqueStack": "control.torque_stack",
    "TorqueController": "control.torque_controller",
    "ContactForceTask": "control.contact_force_task",
    "Contact": "control.contact",
    "AccelerationStack": "control.acceleration_stack",
    "Catalogue": "control.catalogue",
    "find_singularities": "control.catalogue",
    "CenterOfMassTask": "control.center_of_mass_task",
    "CollisionLimit": "control.collision_limit",
    "Command": "control.command",
    "Mode": "control.command",
    "ConeLimit": "control.cone_limit",
    "FrameSpeedLimit": "control.frame_speed_limit",
    "HalfSpaceLimit": "control.half_space_limit",
    "JointCoupling": "control.joint_coupling",
    "JointLimit": "control.joint_limit",
    "Limit": "control.limit",
    "VelocityLimit": "control.limit",
    "LockedJoints": "control.locked_joints",
    "LookAtTask": "control.look_at_task",
    "MotionRunner": "control.motion_runner",
    "OrientationTask": "control.orientation_task",
    "PointingTask": "control.pointing_task",
    "PoseLimit": "control.pose_limit",
    "PoseTask": "control.pose_task",
    "PositionTask": "control.position_task",
    "PostureTask": "control.posture_task",
    "RelativePoseTask": "control.relative_pose_task",
    "Stack": "control.stack",
    "SupportPolygonLimit": "control.support_polygon_limit",
    "Task": "control.task",
    "TorqueLimit": "control.torque_limit",
    "TwistTask": "control.twist_task",
    "BatchSolution": "core.batch",
    "solve_batch": "core.batch",
    "Certificate": "core.certificate",
    "certify": "core.certificate",
    "Conflict": "core.conflict",
    "Distance": "core.distance",
    "distance": "core.distance",
    "NotDifferentiableError": "core.derivative",
    "ProblemGradient": "core.derivative",
    "SolutionDerivative": "core.derivative",
    "jvp": "core.derivative",
    "vjp": "core.derivative",
    "LevelReport": "core.diagnostics",
    "Singularity": "core.diagnostics",
    "diagnose": "core.diagnostics",
    "load_problem": "core.io",
    "save_problem": "core.io",
    "Truth": "core.truth",
    "truth": "core.truth",
    "load_robot": "robot.model_file",
    "stress": "compare.stress.stress",
}

# The package that a name needs, asked for in the name that the user wrote.
_NEEDS = {
    "Distance": ("hqp_rp.distance", "flint"),
    "distance": ("hqp_rp.distance", "flint"),
    "Truth": ("hqp_rp.truth", "flint"),
    "truth": ("hqp_rp.truth", "flint"),
    "load_robot": ("hqp_rp.load_robot", "mujoco"),
}


def __getattr__(name: str) -> Any:
    if name == "problems":
        return importlib.import_module("hqp_rp.problems")
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp' has no attribute {name!r}")
    if name in _NEEDS:
        require(*_NEEDS[name])
    if name == "stress":
        require_report("hqp_rp.stress")
    return getattr(importlib.import_module(f"hqp_rp.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
