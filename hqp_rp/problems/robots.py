"""Remake `robots.npz`: the Jacobians of real robots that the robot families of the set are built from.

    python -m hqp_rp.problems.robots --humanoid .../apptronik_apollo/apptronik_apollo.xml

A robot library's last bit depends on the machine, so these numbers are kept and the problems are made from them: the command
adds what is missing, and leaves what is there unless `--anew` is given. Loading the set, or remaking it, needs this file and
no robot.
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

TORQUE_STATES = 3
"""States of the Sawyer whose inverse dynamics are kept."""

Snapshot = dict[str, FloatArray]


def sawyer_arrays(q: FloatArray) -> Snapshot:
    """q (7,) and the tool's Jacobian (6, 7)."""
    return {"q": q, "tool": sawyer().jacobian(q)}


def inertia_array(q: FloatArray) -> FloatArray:
    """The Sawyer's joint-space inertia M(q) (7, 7), kg m^2, symmetric to the last bit."""
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_arm(sawyer())
    robot.update(q)
    M = robot.mass_matrix()
    return 0.5 * (M + M.T)


def torque_arrays(q: FloatArray, v: FloatArray, aims: FloatArray) -> Snapshot:
    """What a `TorqueStack` asks of the Sawyer at q, v (7,): levels position, orientation, posture as matrix (13, 7) and target
    (13,), and the torques' rows: lower <= M v-dot <= upper (7,), limits less gravity and Coriolis torques h.

    aims (13,): feedforward accelerations of the three tasks. The limit of each joint is 0.7 of the torque that the answer
    without limits needs, at least 1.2 of what v-dot = 0 needs, on multiples of 2^-10 N m.
    """
    from hqp_rp.control.orientation_task import OrientationTask
    from hqp_rp.control.position_task import PositionTask
    from hqp_rp.control.posture_task import PostureTask
    from hqp_rp.control.torque_stack import TorqueStack
    from hqp_rp.core.solver import get_solver
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    rotation, position = robot.pose("tool")
    tasks = [
        PositionTask("tool", position.copy(), gain=4.0),
        OrientationTask("tool", rotation.copy(), gain=4.0),
        PostureTask(robot.neutral, gain=2.0),
    ]
    robot.update(q)
    stack = TorqueStack(tasks, torque=np.inf)
    problem = stack.problem(robot, 0.001, v)
    target = problem.lower + aims
    free = Problem.from_stacked(problem.matrix, target, target, problem.offsets)
    M, h = robot.mass_matrix(), robot.inverse_dynamics(v, np.zeros(robot.nv))
    need = M @ get_solver("null_space").solve(free).require() + h
    limit = np.ceil(np.maximum(0.7 * np.abs(need), 1.2 * np.abs(h)) * 2.0**10) * 2.0**-10
    return {
        "q": q,
        "v": v,
        "aims": aims,
        "matrix": np.array(problem.matrix),
        "target": target,
        "torque_rows": M,
        "torque_lower": -limit - h,
        "torque_upper": limit - h,
    }


def torque_states() -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """(q, v, aims) of each state."""
    for s in range(TORQUE_STATES):
        draw = Draw(400 + s)
        yield draw.grid(7, 2.0), draw.grid(7), draw.grid(13, 4.0)


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
        found[f"sawyer/{s}/inertia"] = inertia_array(found[f"sawyer/{s}/q"])
        found |= _keyed(f"dual_arm/{s}", dual_arm_arrays(Draw(200 + s).grid(14, 2.0)))
    found |= _keyed("sawyer/zero", sawyer_arrays(np.zeros(7)))
    for sigma, q in crossing():
        found |= _keyed(f"sawyer/sigma{sigma:.0e}", sawyer_arrays(q))
    for s, state in enumerate(torque_states()):
        found |= _keyed(f"torque/{s}", torque_arrays(*state))
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
    parser.add_argument(
        "--anew", action="store_true", help="replace kept numbers too, which changes published problems"
    )
    given = parser.parse_args(arguments)
    old = load_snapshot() if SNAPSHOT.exists() else {}
    if given.humanoid is None:
        body = {name: array for name, array in old.items() if name.startswith("humanoid/")}
    else:
        body = humanoid(given.humanoid)
    new = arms() | body
    both = set(old) & set(new)
    apart = max(
        (float(np.abs(old[name] - new[name]).max()) for name in both if old[name].shape == new[name].shape), default=0.0
    )
    if not given.anew:
        new |= old  # a published problem is never changed
    np.savez_compressed(SNAPSHOT, **new)  # type: ignore[arg-type]
    print(f"{SNAPSHOT.name}: {len(new)} arrays, {len(both)} of them there before; largest difference {apart:.1e}")


def _keyed(prefix: str, arrays: Snapshot) -> Snapshot:
    return {f"{prefix}/{name}": array for name, array in arrays.items()}


if __name__ == "__main__":
    main()
