"""Remake `robots.npz`: the Jacobians of real robots that the robot families of the set are built from.

    python -m hqp_rp.problems.robots --humanoid .../apptronik_apollo/apptronik_apollo.xml

Numbers that are there are published and stay as they are; what is new is added, and the largest difference told.
`--replace` writes all anew, for a new major version. A robot library's last bit depends on the machine, so these numbers are
kept and the problems are made from them. Loading the set, or remaking it, needs this file and no robot.
"""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.errors import RobotError
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.problems.recipe import Draw
from hqp_rp.robot.arms import sawyer

if TYPE_CHECKING:
    from hqp_rp.robot.robot import Robot

SNAPSHOT = pathlib.Path(__file__).with_name("robots.npz")
"""Arrays by "robot/configuration/what": q, Jacobians (rows, n) in world axes, velocity limits."""

SIGMAS = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-11, 1e-12, 1e-13)
"""What sigma_min of the Sawyer's orientation rows beside its position rows is led to, relative to their norm."""

SHOULDER = 0.3  # m, of each Sawyer of the dual arm from the middle; chosen here

HUMANOID_FRAMES = {
    "left_foot": "l_foot_link",
    "right_foot": "r_foot_link",
    "left_hand": "l_wrist_pitch_link",
    "right_hand": "r_wrist_pitch_link",
    "torso": "torso_link",
}

Snapshot = dict[str, FloatArray]


def sawyer_arrays(q: FloatArray) -> Snapshot:
    """q (7,) and the tool's Jacobian (6, 7)."""
    return {"q": q, "tool": sawyer().jacobian(q)}


def dual_arm_arrays(q: FloatArray) -> Snapshot:
    """Two Sawyers side by side, q (14,) left before right: Jacobians (6, 14) of the left tool, of the right tool, and of
    the right tool relative to the left one, in the left tool's axes.

    Relative: `R_l^T (v_r - v_l + [p_r - p_l] w_l)` over `R_l^T (w_r - w_l)`, with [p] w = p x w.
    """
    arm = sawyer()
    (R, p_left), (_, p_right) = arm.pose(q[:7]), arm.pose(q[7:])
    left, right = np.zeros((6, 14)), np.zeros((6, 14))
    left[:, :7], right[:, 7:] = arm.jacobian(q[:7]), arm.jacobian(q[7:])
    gap = p_right - p_left - np.array([0.0, 2.0 * SHOULDER, 0.0])
    linear = right[:3] - left[:3] + np.cross(gap, left[3:], axisb=0, axisc=0)
    return {"q": q, "left": left, "right": right, "relative": np.vstack([R.T @ linear, R.T @ (right[3:] - left[3:])])}


def humanoid_arrays(robot: Robot, q: FloatArray) -> Snapshot:
    """q (nq,), Jacobians (6, nv) of `HUMANOID_FRAMES` and "com" (3, nv) of the centre of mass."""
    robot.update(q)
    arrays = {name: robot.jacobian(frame) for name, frame in HUMANOID_FRAMES.items()}
    return {"q": q, **arrays, "com": robot.center_of_mass_jacobian()}


def humanoid_configurations(robot: Robot) -> Iterator[FloatArray]:
    """The neutral pose, and three with the base turned and every joint moved by up to a quarter of its range."""
    yield robot.neutral
    lower, upper = robot.lower[6:], robot.upper[6:]  # behind the floating base, whose position has 7 numbers
    for s in range(3):
        draw = Draw(300 + s)
        turn = np.zeros(robot.nv)
        turn[3:6] = draw.grid(3, 0.25)
        q = robot.integrate(robot.neutral, turn, 1.0)
        q[7:] = np.clip(q[7:] + 0.25 * draw.grid(len(lower)) * (upper - lower), lower, upper)
        yield q


def crossing(sigmas: Sequence[float] = SIGMAS) -> Iterator[tuple[float, FloatArray]]:
    """(sigma, q): the Sawyer near an algorithmic singularity of tool orientation beside tool position, found by search.

    q = q* + (sigma / rate) * approach to first order in sigma; the problems state the sigma that they have.
    """
    from hqp_rp.control.orientation_task import OrientationTask
    from hqp_rp.control.position_task import PositionTask
    from hqp_rp.control.singularities import search_singularities
    from hqp_rp.control.stack import Stack
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_arm(sawyer())
    stack = Stack([PositionTask("tool", np.zeros(3)), OrientationTask("tool", np.eye(3))])
    found = search_singularities(robot, stack, level=1, kinds=(Singularity.ALGORITHMIC,), starts=32)
    best = max(found, key=lambda place: min(place.own_sigma, place.earlier_sigma))
    for sigma in sigmas:
        yield sigma, best.q + (sigma / best.approach_rate) * best.approach


def arms() -> Snapshot:
    """The part of the snapshot that needs no model file: Sawyer and dual arm."""
    found: Snapshot = {"sawyer/velocity_limit": np.array(sawyer().velocity_limit)}
    for s in range(3):
        found |= _keyed(f"sawyer/{s}", sawyer_arrays(Draw(100 + s).grid(7, 2.0)))
        found |= _keyed(f"dual_arm/{s}", dual_arm_arrays(Draw(200 + s).grid(14, 2.0)))
    found |= _keyed("sawyer/zero", sawyer_arrays(np.zeros(7)))
    for sigma, q in crossing():
        found |= _keyed(f"sawyer/sigma{sigma:.0e}", sawyer_arrays(q))
    return found


def torque_problems() -> Iterator[tuple[str, Problem]]:
    """(label, problem): one step of a Sawyer that is commanded by torques, moving, at three configurations.

    x is the joint acceleration, rad/s^2, and, in contact, the force of the tool's contact over 100 N.
    """
    from hqp_rp.control.contact import Contact
    from hqp_rp.control.joint_limit import JointLimit
    from hqp_rp.control.orientation_task import OrientationTask
    from hqp_rp.control.position_task import PositionTask
    from hqp_rp.control.posture_task import PostureTask
    from hqp_rp.control.torque_stack import TorqueStack
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_arm(sawyer())
    for s in range(3):
        draw = Draw(400 + s)
        q, v = robot.neutral + draw.grid(7, 0.25), draw.grid(7, 0.5)
        robot.update(q)
        place = robot.pose("tool")[1]
        position = PositionTask("tool", place + draw.grid(3, 0.125), gain=10.0)
        orientation = OrientationTask("tool", np.eye(3), gain=10.0)
        posture = PostureTask(robot.neutral, gain=5.0)
        limit = JointLimit(acceleration=50.0)
        contact = Contact("tool", tangent=[0.0, 1.0, 0.0], friction=0.5, max_force=100.0, kd=20.0)
        cases: dict[str, tuple[list[object], dict[str, object]]] = {
            "free": ([position, orientation, posture], {"metric": "inertia", "torque": np.inf}),
            "limits": ([position, orientation, posture], {"limits": [limit], "torque": 60.0}),
            "contact": ([orientation, posture], {"contacts": [contact], "torque": 60.0}),
        }
        for label, (levels, settings) in cases.items():
            stack = TorqueStack(levels, **settings)  # type: ignore[arg-type]
            yield f"{label}_q{s}", stack.problem(robot, 0.002, v)


def torque() -> Snapshot:
    """The part of the snapshot that holds whole problems, as `hqp_rp.save_problem` names their arrays."""
    found: Snapshot = {}
    for label, problem in torque_problems():
        arrays = {"matrix": problem.matrix, "lower": problem.lower, "upper": problem.upper}
        arrays["offsets"] = problem.offsets.astype(np.float64)
        if problem.hard is not None:
            arrays |= {"hard_A": problem.hard.A, "hard_lower": problem.hard.lower, "hard_upper": problem.hard.upper}
        if problem.metric is not None:
            arrays["metric"] = problem.metric
        found |= _keyed(f"torque/{label}", arrays)
    return found


def humanoid(path: pathlib.Path) -> Snapshot:
    """The part of the snapshot that comes from Apollo's model file: the neutral pose and three around it."""
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_file(path)
    absent = set(HUMANOID_FRAMES.values()) - set(robot.frame_names)
    if absent:
        raise RobotError(f"{path} has no frame {', '.join(sorted(absent))}; give apptronik_apollo.xml.")
    found: Snapshot = {}
    for s, q in enumerate(humanoid_configurations(robot)):
        found |= _keyed(f"humanoid/{s}", humanoid_arrays(robot, q))
    return found


def load_snapshot() -> Snapshot:
    """The kept numbers."""
    with np.load(SNAPSHOT, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def main(arguments: Sequence[str] | None = None) -> None:
    """The command: remake `robots.npz`; without a humanoid's file its part is kept as it is."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.problems.robots", description=__doc__)
    parser.add_argument("--humanoid", type=user_path, help="apptronik_apollo.xml, with its meshes beside it")
    parser.add_argument("--replace", action="store_true", help="replace the numbers that are published too")
    given = parser.parse_args(arguments)
    old = load_snapshot() if SNAPSHOT.exists() else {}
    if given.humanoid is None:
        body = {name: array for name, array in old.items() if name.startswith("humanoid/")}
    else:
        body = humanoid(given.humanoid)
    new = arms() | torque() | body
    both = set(old) & set(new)
    apart = max(
        (float(np.abs(old[name] - new[name]).max()) for name in both if old[name].shape == new[name].shape), default=0.0
    )
    if not given.replace:
        new = new | old
    np.savez_compressed(SNAPSHOT, **new)  # type: ignore[arg-type]
    print(f"{SNAPSHOT.name}: {len(new)} arrays, {len(both)} of them there before; largest difference {apart:.1e}")


def _keyed(prefix: str, arrays: Snapshot) -> Snapshot:
    return {f"{prefix}/{name}": array for name, array in arrays.items()}


if __name__ == "__main__":
    main()
