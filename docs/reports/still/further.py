"""The price within reach, a humanoid, torques, and times: the short runs of this report, as rows of tables."""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from measure import (
    ACCELERATIONS,
    ARMS,
    BEYOND,
    GAINS,
    QUIET,
    RULE,
    RULES,
    SOLVER,
    STILL,
    STRICT,
    drive,
    factor,
    least,
    levels_of,
    robot_of,
    targets,
)
from scipy.spatial.transform import Rotation

import hqp_rp
import hqp_rp.scenarios.humanoid_stand_reach as standing
from hqp_rp import (
    CenterOfMassTask,
    Contact,
    ContactForceTask,
    ErrorDamping,
    JointLimit,
    LookAtTask,
    PoseTask,
    PositionTask,
    PostureTask,
    Stack,
    TorqueController,
    TorqueStack,
    VariableDamping,
)
from hqp_rp.robot.named import named_robot


def loops() -> Iterator[list[str]]:
    """The second level's loop at rest, as still_at_the_limit.md derives it, without and with the level's own damping."""
    dt, gain = 0.001, 5.0
    for arm, target in (("Sawyer", 0), ("Sawyer", 1), ("Sawyer", 4), ("Panda-like arm", 0), ("Panda-like arm", 4)):
        robot = robot_of(arm)
        levels = levels_of(robot, targets(arm)[target], gain, 0.1)
        first, second = RULES[STRICT](ARMS[arm], dt, gain)
        stack = Stack(levels, [JointLimit()], damping=[factor(first), factor(second), None])
        drive(robot, stack, dt, 6.0)
        _, sigma, Vt = np.linalg.svd(levels[0].jacobian(robot))
        w, N = Vt[2], Vt[3:].T
        J = levels[1].jacobian(robot)
        rate = gain * levels[1].error(robot)
        D, d, _ = stack.problem(robot, dt, np.zeros(robot.nv)).damping_rows
        zeta = d[: robot.nv] / D[0, 0]
        error = levels[0].error(robot)
        turning = N.T @ curvature(robot, levels[0], error / np.linalg.norm(error)) @ N
        pull, mu = abs(float(w @ J.T @ rate)), second * float(np.linalg.norm(rate))
        row = [arm, f"{1e3 * BEYOND[target]:g}", f"{sigma[2]:.2g}", f"{first * abs(float(w @ zeta)):.2g}"]
        for damped in (0.0, 0.2 * mu, mu):
            square = N.T @ J.T @ J @ N + damped * np.eye(N.shape[1])
            loop = dt * np.linalg.pinv(square) @ turning * pull / sigma[2]
            row.append(f"{np.abs(np.linalg.eigvals(loop)).max():.2g}")
        yield row


def curvature(robot: Any, task: Any, n: np.ndarray) -> np.ndarray:
    """(nv, nv) m: how n^T J of the task falls where the joints move, by central differences."""
    q, h, columns = robot.q.copy(), 1e-5, []
    for direction in np.eye(robot.nv):
        ends = []
        for side in (1.0, -1.0):
            robot.update(robot.integrate(q, side * direction, h))
            ends.append(n @ task.jacobian(robot))
        columns.append((ends[0] - ends[1]) / (2.0 * h))
    robot.update(q)
    K = -np.array(columns)
    return 0.5 * (K + K.T)


def within_reach() -> Iterator[list[str]]:
    """A place 0.33 m away, turned by one rad: what the damping costs where it is not needed."""
    one_rad = Rotation.from_rotvec([0.3, 0.8, -0.52]).as_matrix()
    dt, gain = 0.002, 5.0
    for arm, reach in ARMS.items():
        robot = robot_of(arm)
        for rule, factors in RULES.items():
            first, second = factors(reach, dt, gain)
            robot.update(robot.neutral)
            place = robot.pose("tool")[1] + [-0.15, 0.25, 0.15]
            levels = levels_of(robot, place, gain, 0.1)
            levels[1].target = one_rad @ robot.pose("tool")[0]
            stack = Stack(levels, [JointLimit(acceleration=20.0)], damping=[factor(first), factor(second), None])
            errors = lambda: [float(np.linalg.norm(task.error(robot))) for task in levels[:2]]  # noqa: B023, E731
            _, seen = drive(robot, stack, dt, 12.0, errors)
            off = np.array(seen) > 1e-3
            late = [f"{dt * (np.flatnonzero(column)[-1] + 1):.2f}" for column in off.T]
            yield [arm, rule, *late, f"{1e3 * seen[-1][0]:.1g}", f"{1e3 * seen[-1][1]:.1g}"]


def one_level() -> Iterator[list[str]]:
    """Position above posture with the least damping."""
    dt = 0.001
    for arm, reach in ARMS.items():
        robot, quiet, lost = robot_of(arm), [], []
        for target, gain, acceleration in itertools.product(range(len(BEYOND)), GAINS, ACCELERATIONS):
            position, _, posture = levels_of(robot, targets(arm)[target], gain, 0.1)
            damping = [factor(reach * dt), None]
            stack = Stack([position, posture], [JointLimit(acceleration=acceleration)], damping=damping)
            hardest, _ = drive(robot, stack, dt, 10.0 if gain == 1.0 else 6.0)
            quiet.append(float(hardest[-round(QUIET / dt) :].max()))
            lost.append(1e3 * (float(np.linalg.norm(position.error(robot))) - least(arm)[target]))
        kept = sum(value < STILL for value in quiet)
        yield [arm, f"{kept}/{len(quiet)}", f"{max(quiet):.2g}", f"{max(lost):.2f}"]


def humanoid() -> Iterator[list[str]]:
    """Feet, balance, a hand asked for a metre too much, gaze, posture."""
    bent = {"hip_pitch": -0.5, "knee": 1.0, "ankle_pitch": -0.5, "elbow": -1.2}
    reach, gain = 0.7, 5.0
    for rule, dt, posture in (
        ("not damped", 0.001, 0.5),
        ("reach dt, 10 reach dt", 0.001, 0.5),
        (RULE, 0.001, 0.5),
        (RULE, 0.005, 0.5),
        (RULE, 0.005, 5.0),
        (STRICT, 0.001, 0.5),
    ):
        first, second = RULES[rule](reach, dt, gain)
        robot = named_robot("humanoid")
        q = robot.neutral.copy()
        for joint, angle in bent.items():
            for side in ("left", "right"):
                q[robot.joint_names.index(f"{side}_{joint}") + robot.nq - robot.nv] = angle
        robot.update(q)
        feet = [PoseTask(f"{side}_sole", robot.pose(f"{side}_sole"), gain=10.0) for side in ("left", "right")]
        middle = robot.center_of_mass()
        hand = PositionTask("right_grip", robot.pose("right_grip")[1] + [1.0, 0.1, 0.3], gain=gain)
        gaze = LookAtTask("head", hand.target, axis="x", gain=gain)
        levels = [feet, CenterOfMassTask(middle, axes="xy", gain=5.0), hand, gaze, PostureTask(q, gain=posture)]
        limits = [JointLimit(velocity={"*": 3.0}, acceleration={"*": 30.0})]
        damping = [None, None, factor(first), factor(second), None]
        hardest, _ = drive(robot, Stack(levels, limits, damping=damping), dt, 5.0)
        moved = np.linalg.norm((robot.center_of_mass() - middle)[:2])
        off = [1e3 * float(np.linalg.norm(hand.error(robot))), 1e3 * float(moved)]
        last = hardest[-round(1.0 / dt) :].max()
        yield [rule, f"{1e3 * dt:g}", f"{posture:g}", f"{last:.2g}", f"{off[0]:.0f}", f"{off[1]:.2f}"]


def torques() -> Iterator[list[str]]:
    """The stack of torque.md with its hand asked for 0.9 m, on an ideal robot."""
    for damping, posture_gain in (
        (None, 4.0),
        (ErrorDamping(0.01), 4.0),
        (ErrorDamping(0.01, power=1), 4.0),
        (ErrorDamping(0.003, power=1), 4.0),
        (ErrorDamping(0.003, power=1), 2.0),
        (ErrorDamping(0.001, power=1), 4.0),
        (ErrorDamping(0.001, power=1), 2.0),
        (ErrorDamping(0.001, power=1), 0.5),
    ):
        robot = named_robot("humanoid")
        robot.update(robot.neutral)
        corners = [[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)]
        soles = [Contact(f"{side}_sole", points=corners, friction=0.6) for side in ("left", "right")]
        hand = PositionTask("left_hand", robot.pose("left_hand")[1] + [0.9, 0.0, 0.0], gain=5.0)
        posture = PostureTask(robot.neutral, joints=range(6, robot.nv), gain=posture_gain)
        most = np.concatenate([np.full(6, np.inf), np.full(robot.nv - 6, 100.0)])
        stack = TorqueStack(
            [
                CenterOfMassTask(robot.center_of_mass(), axes="xy", gain=6.0),
                hand,
                [posture, ContactForceTask(soles, each=True, weight=0.1)],
            ],
            [JointLimit(acceleration=most)],
            contacts=soles,
            torque=150.0,
            damping=[None, damping, None],
        )
        controller = TorqueController(stack, SOLVER)
        v, dt, sent = np.zeros(robot.nv), 0.002, []
        for _ in range(2000):
            command = controller.step(robot, dt, v)
            assert command.solution is not None
            v = v + dt * command.solution.require()[: robot.nv]
            robot.update(robot.integrate(robot.q, v, dt))
            sent.append(command.torque)
        change = np.abs(np.diff(sent[-250:], axis=0)).max()
        off = 1e3 * float(np.linalg.norm(hand.error(robot)))
        yield [str(damping), f"{posture_gain:g}", f"{off:.0f}", f"{np.abs(v).max():.1g}", f"{change:.1g}"]


def _of_power(own: int, factor: float, power: int) -> ErrorDamping:
    """The scenario's damping at a power of one's own."""
    return ErrorDamping(factor, power=own)


def stands() -> Iterator[list[str]]:
    """`humanoid_stand_reach`: the same in MuJoCo, on soles with friction."""
    for factor_of, power in ((0.01, 2), (0.01, 1), (0.003, 1), (0.001, 1), (0.0002, 1)):
        # The scenario has a factor for power 1 alone.
        standing.ErrorDamping = functools.partial(_of_power, power)  # type: ignore[misc, assignment]
        try:
            scenario = standing.HumanoidStandReach(hand_damping=factor_of)
            steps = list(scenario.steps(hqp_rp.get_solver(SOLVER), 0))
        finally:
            standing.ErrorDamping = ErrorDamping  # type: ignore[misc]

        def column(name: str, steps: list[Any] = steps) -> np.ndarray:
            return np.array([step.measured[name] for step in steps])

        out = [step.measured["hand error [m]"] for step in steps if 1.8 < step.parameter < 2.0]
        fell = bool(column("tilt [rad]").max() > 1.0)
        row = ["", "", ""] if fell else [f"{1e3 * np.mean(out):.0f}", f"{1e3 * column('slip [m]').max():.1f}", ""]
        row[2] = "fell" if fell else f"{column('tilt [rad]').max():.2f}"
        yield [str(ErrorDamping(factor_of, power=power)), *row]


def times() -> Iterator[list[str]]:
    """Least time of a solve of one step of the Sawyer far from its target, all taking turns in one process."""
    robot = robot_of("Sawyer")
    levels = levels_of(robot, targets("Sawyer")[0], 5.0, 0.1)
    first, second = RULES[RULE](ARMS["Sawyer"], 0.001, 5.0)
    kinds = {
        "not damped": [None, None, None],
        "`ErrorDamping` on level 1": [factor(first), None, None],
        "`ErrorDamping` on levels 1 and 2": [factor(first), factor(second), None],
        "`VariableDamping(0.1, 0.1)` on levels 1 and 2": [VariableDamping(0.1, 0.1), VariableDamping(0.1, 0.1), None],
    }
    limits, dt = [JointLimit(acceleration=20.0)], 0.001
    stacks = {name: Stack(levels, limits, damping=damping) for name, damping in kinds.items()}
    settled = Stack(levels, limits, damping=kinds["`ErrorDamping` on levels 1 and 2"])
    drive(robot, settled, dt, 6.0)
    solvers = {name: hqp_rp.get_solver(name) for name in (SOLVER, "qp_cascade")}
    best: dict[tuple[str, str], float] = {}
    for _ in range(300):
        for kind, stack in stacks.items():
            for name, solver in solvers.items():
                problem = stack.problem(robot, dt, np.zeros(robot.nv))
                begin = time.perf_counter()
                solver.solve(problem)
                took = time.perf_counter() - begin
                best[kind, name] = min(took, best.get((kind, name), np.inf))
    base = best["not damped", SOLVER]
    for kind in kinds:
        yield [
            kind,
            *(f"{best[kind, name] / base:.1f}" for name in solvers),
            *(f"{1e6 * best[kind, name]:.0f}" for name in solvers),
        ]
