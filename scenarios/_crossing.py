"""What the crossing scenarios share: a path through an algorithmic singularity, tracked by a simulated arm in closed loop."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from hqp_rp.control.acceleration_stack import AccelerationStack
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.stack import Stack
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver
from hqp_rp.robot.dh import DHArm
from hqp_rp.scenarios.scenario import Scenario, Step, timed_solve

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

COMMANDS = ("velocity", "acceleration", "torque")
METRICS = ("none", "inertia")
_CASES = (("three levels", 3), ("two levels", 2))
_ERRORS = ("position error [m]", "orientation error [rad]", "posture error [rad]")
_GAINS = ("position_gain", "orientation_gain", "posture_gain")


@dataclasses.dataclass(frozen=True, slots=True)
class Path:
    """References at the ends of the control periods, t_0 = 0, ..., t_N = T; every array has N + 1 rows.

    Attributes:
        time: s. q: (., n) rad and qd: (., n) rad/s, the joint path whose tool positions the first task follows.
        position: (., 3) m and velocity: (., 3) m/s, of the tool.
        rotation: (., 3, 3) and angular_velocity: (., 3) rad/s, of the second task's frame, in world axes.
        demand: (.,) rad, how far that rotation is turned, about the lost axis, beyond the one at q.
    """

    time: FloatArray
    q: FloatArray
    qd: FloatArray
    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    angular_velocity: FloatArray
    demand: FloatArray


@dataclasses.dataclass(frozen=True, kw_only=True)
class Crossing(Scenario):
    """A simulated arm under velocity servos follows a path through an algorithmic singularity of its stack.

    The levels are tool position, orientation of a frame, posture ("three levels"); the same run is then made without
    the posture ("two levels"). With q_c the singular configuration and d the unit vector along which the path crosses
    it, the references are

        q(t) = q_c + o + s(t) d,                      s(t) = -reach cos(pi t / T)
        position(t) = p(q(t)),  rotation(t) = exp(h(t) [u]) R(q(t)),  posture(t) = q(t)
        h(t) = demand cos^2(pi (t - T/2) / w) for |t - T/2| < w/2, else 0,   w = window T

    so that the joint path itself meets every level but for h, and goes through q_c at T/2 when o = 0: a solver that
    follows its references is led through. At q_c the second task can no longer turn about the axis u beside the first:
    R(q_c) is as far as its frame can be turned about u with the tool at p(q_c). With demand > 0 the path asks for more
    than that, for a while, and then comes back. The rates are the references' own plus gain * error.

    At the start of every period the configuration is read from the simulation, the stack is solved, and x is commanded to
    the servos, each clipped to its joint's velocity limit, as a servo would; the problem itself knows no limit, and x is
    what is judged. Without an x the arm is commanded to hold still for that period; a refusal ends the run.

    With command="acceleration" the unknown is v-dot: `AccelerationStack` with kp = gain^2, kd = 2 gain and the references' own
    accelerations, and the servos are sent v + period x, from the v that was measured. With command="torque" the same stack is a
    `TorqueStack` without limits, and x becomes joint torques by inverse dynamics, each cut to `torque_limit`; the servos and
    the viscous friction of the joints are gone. Without an x the arm then brakes and compensates
    gravity. An answer that explodes is then one of accelerations: what the arm makes of it is the measure.

    Seed 0 starts on the path and has o = 0. Every other seed draws o, and the offset of the start from that path, both
    normal with standard deviation `spread` per joint.

    Args:
        duration: T, s; rounded to an even number of periods. period: s between two solves.
        substeps: simulation steps per period.
        reach: rad, half the length of the joint path. demand: rad, >= 0. window: in (0, 1].
        position_gain, orientation_gain, posture_gain: 1/s, >= 0 and gain * period <= 1.
        spread: rad, >= 0. command: "velocity", "acceleration" or "torque". torque_limit: N m, > 0. metric: of the stack, "none"
            or "inertia".

    `Step.parameter` is the time at which the problem is posed. `Step.measured`, at the end of the period it acts for:

        "position error [m]", "orientation error [rad]", "posture error [rad]": norms, of the simulated arm against the
            references; the posture's in "three levels" only;
        "commanded speed [rad/s]": ||x||, as asked for, before the servos clip it (0 without an x);
        "measured speed [rad/s]": ||dq/dt||;
        "servo error [rad/s]": largest |clipped command - dq/dt| of a joint;
        "saturated joints": how many servos clipped their command, or motors their torque;
        with accelerations, "commanded acceleration [rad/s^2]", ||x||, in the place of "commanded speed", and with torques
        "largest torque [N m]", as asked for, in the place of "servo error".

    Raises:
        SettingError: a setting out of its range.
    """

    abscissa: ClassVar[str] = "time (s)"
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "Each solver is judged on the configurations that its own motion leads to; from the crossing on these differ.",
        "One singular configuration, crossed in one direction at one speed with one set of gains: each of these matters.",
        "The servos clip the command joint by joint; a robot that scales the whole vector, or stops, would move "
        "otherwise. The problem itself holds no limit.",
        "Where the path asks for more than the arm can reach, no solver can keep the second level; what differs is what "
        "the attempt costs.",
        "In three levels the posture follows the path through the singularity and wants nothing else: solvers that let "
        "it count against the second level look smoother than they would with a posture of its own. Its full rank also "
        "keeps every matrix that holds it well conditioned: what damping does to such a matrix shows in two levels only.",
        "Gravity is compensated and the servos are ideal but for their own lag: no friction, flexibility, delay or noise.",
    )

    duration: float = 1.2
    period: float = 0.0025
    substeps: int = 2
    reach: float = 0.5
    demand: float = 0.03
    window: float = 0.5
    position_gain: float = 20.0
    orientation_gain: float = 20.0
    posture_gain: float = 2.0
    spread: float = 0.01
    command: str = "velocity"
    torque_limit: float = 80.0
    metric: str = "none"

    def __post_init__(self) -> None:
        if self.command not in COMMANDS:
            raise SettingError(f"command of {self.name} is {self.command!r}; it must be one of {', '.join(COMMANDS)}.")
        if self.metric not in METRICS:
            raise SettingError(f"metric of {self.name} is {self.metric!r}; it must be one of {', '.join(METRICS)}.")
        for name in ("duration", "period", "reach", "torque_limit"):
            self._require(name, lambda value: value > 0.0, "> 0")
        for name in ("demand", "spread"):
            self._require(name, lambda value: value >= 0.0, ">= 0")
        self._require("window", lambda value: 0.0 < value <= 1.0, "in (0, 1]")
        top = 1.0 / self.period
        for name in _GAINS:
            self._require(name, lambda value: 0.0 <= value <= top, f"in [0, 1 / period] = [0, {top:g}]")
        if isinstance(self.substeps, bool) or not isinstance(self.substeps, int) or self.substeps < 1:
            raise SettingError(f"substeps of {self.name} is {self.substeps!r}; it must be an integer of at least 1.")
        if self.duration < 2.0 * self.period:
            raise SettingError(
                f"duration is {self.duration:g} s, period is {self.period:g} s; a run needs at least two periods."
            )

    @property
    def commands_torques(self) -> bool:
        return self.command != "velocity"

    @abc.abstractmethod
    def arm(self) -> DHArm:
        """The arm that is simulated."""

    @abc.abstractmethod
    def crossing(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q_c (n,) rad, d (n,) the unit vector along which the path crosses it, and u (3,) the lost axis."""

    @abc.abstractmethod
    def tasks(self) -> tuple[PositionTask, OrientationTask]:
        """The first and the second level, without references or gains."""

    def periods(self) -> int:
        """Number of control periods of one case; even, so that a control step falls on the middle of the path."""
        return 2 * max(1, round(0.5 * self.duration / self.period))

    def length(self) -> int:
        return len(_CASES) * self.periods()

    def quick(self) -> Self:
        """Control periods four times as long, on the same simulation steps."""
        period = 4.0 * self.period
        gains = {name: min(getattr(self, name), 1.0 / period) for name in _GAINS}
        return dataclasses.replace(
            self, period=period, substeps=4 * self.substeps, duration=max(self.duration, 2.0 * period), **gains
        )

    def path(self, seed: int = 0) -> Path:
        """The references of that seed."""
        arm, (center, direction, axis) = self.arm(), self.crossing()
        steps, T = self.periods(), self.periods() * self.period
        time = np.multiply(self.period, np.arange(steps + 1), dtype=np.float64)
        phase: FloatArray = math.pi * time / T
        offset = np.zeros(arm.n) if seed == 0 else np.random.default_rng(seed).normal(scale=self.spread, size=arm.n)
        q = center + offset - self.reach * np.cos(phase)[:, None] * direction
        qd = self.reach * math.pi / T * np.sin(phase)[:, None] * direction
        return self._references(arm, time, q, qd, axis)

    def _references(self, arm: DHArm, time: FloatArray, q: FloatArray, qd: FloatArray, axis: FloatArray) -> Path:
        tool, frame = (task.frame for task in self.tasks())
        w = self.window * time[-1]
        from_middle = (time - 0.5 * time[-1]) / w
        inside = np.abs(from_middle) < 0.5
        h = np.where(inside, self.demand * np.cos(math.pi * from_middle) ** 2, 0.0)
        hd = np.where(inside, -self.demand * math.pi / w * np.sin(2.0 * math.pi * from_middle), 0.0)
        turn = turned_about(axis, h)
        return Path(
            time=time,
            q=q,
            qd=qd,
            position=arm.pose(q, tool)[1],
            velocity=np.einsum("kij,kj->ki", arm.jacobian(q, tool)[:, :3], qd),
            rotation=turn @ arm.pose(q, frame)[0],
            angular_velocity=hd[:, None] * axis + np.einsum("kil,klj,kj->ki", turn, arm.jacobian(q, frame)[:, 3:], qd),
            demand=h,
        )

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        import mujoco

        from hqp_rp.robot.mujoco_robot import MujocoRobot

        path = self.path(seed)
        robot = MujocoRobot.from_arm(self.arm(), timestep=self.period / self.substeps)
        if self.command == "torque":
            robot.model.actuator_gainprm[:] = robot.model.actuator_biasprm[:] = 0.0
            robot.model.dof_damping[:] = 0.0
        data, limit = robot.data, robot.velocity_limit
        for case, levels in _CASES:
            references = _References(self, robot, path, levels)
            mujoco.mj_resetData(robot.model, data)
            data.qpos[:] = self._start(path, seed)
            mujoco.mj_forward(robot.model, data)
            solver.reset()
            if self.command == "torque":
                yield from self._torques(case, path, references, robot, solver)
                continue
            for k in range(self.periods()):
                v = np.array(data.qvel)
                problem = references.problem(k, data.qpos, v)
                solution, seconds = timed_solve(solver, problem)
                x = solution.x
                if x is None or not np.isfinite(x).all():
                    x = np.zeros(robot.nv)
                else:
                    x = v + self.period * x if self.command == "acceleration" else x
                command = np.clip(x, -limit, limit)
                data.ctrl[:] = command
                mujoco.mj_step(robot.model, data, self.substeps)
                measured = references.errors(k + 1, data.qpos) | _speeds(x, command, data.qvel)
                if self.command == "acceleration":
                    measured["commanded acceleration [rad/s^2]"] = 0.0 if solution.x is None else norm(solution.x)
                yield Step(case, float(path.time[k]), problem, solution, seconds, measured)
                if solution.status is Status.REFUSED:
                    return

    def _torques(
        self, case: str, path: Path, references: _References, robot: MujocoRobot, solver: Solver
    ) -> Iterator[Step]:
        import mujoco

        data = robot.data
        for k in range(self.periods()):
            v = np.array(data.qvel)
            problem = references.problem(k, data.qpos, v)
            solution, seconds = timed_solve(solver, problem)
            x = solution.x
            if x is None or not np.isfinite(x).all():
                torque = references.stack.holding_torque(robot, v, 20.0)
            else:
                torque = references.stack.dynamics(problem).torque(x)
            cut = np.clip(torque, -self.torque_limit, self.torque_limit)
            # The weight that the joints compensate by themselves is taken off again.
            data.qfrc_applied[:] = cut - robot.gravity()
            mujoco.mj_step(robot.model, data, self.substeps)
            measured = references.errors(k + 1, data.qpos) | {
                "commanded acceleration [rad/s^2]": 0.0 if x is None else norm(x),
                "measured speed [rad/s]": norm(data.qvel),
                "largest torque [N m]": float(np.abs(torque).max()),
                "saturated joints": float(np.count_nonzero(cut != torque)),
            }
            yield Step(case, float(path.time[k]), problem, solution, seconds, measured)
            if solution.status is Status.REFUSED or not np.isfinite(data.qpos).all():
                return

    def _start(self, path: Path, seed: int) -> FloatArray:
        # A stream of its own, so that the offset of the path does not depend on it.
        scale = self.spread if seed else 0.0
        start: FloatArray = path.q[0] + np.random.default_rng((seed, 1)).normal(scale=scale, size=path.q.shape[1])
        return start

    def _require(self, name: str, allowed: Callable[[float], bool], sign: str) -> None:
        value = getattr(self, name)
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not number or not allowed(value):
            raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number {sign}.")


class _References:
    """The stack on the robot, with the references of the path written into its tasks."""

    def __init__(self, scenario: Crossing, robot: MujocoRobot, path: Path, levels: int) -> None:
        self._robot, self._path = robot, path
        self._position, self._orientation = scenario.tasks()
        self._position.gain = scenario.position_gain
        self._orientation.gain = scenario.orientation_gain
        self._posture = PostureTask(path.q[0], gain=scenario.posture_gain)
        self._tasks = (self._position, self._orientation, self._posture)[:levels]
        self._command, self._period = scenario.command, scenario.period
        metric = None if scenario.metric == "none" else scenario.metric
        self._stack = Stack(self._tasks, metric=metric)
        self._accelerations = AccelerationStack(self._tasks, metric=metric)
        self.stack = TorqueStack(self._tasks, metric=metric)
        rates = (path.velocity, path.angular_velocity, path.qd)
        self._ahead = [np.gradient(rate, path.time, axis=0) for rate in rates]

    def problem(self, k: int, q: FloatArray, v: FloatArray) -> Problem:
        """What is asked at the time `path.time[k]`, the configuration q (n,) and the velocity v (n,)."""
        self._set(k, q)
        if self._command == "velocity":
            return self._stack.problem(self._robot)
        for task, ahead in zip(self._tasks, self._ahead, strict=False):
            task.feedforward_acceleration = ahead[k]
        if self._command == "acceleration":
            return self._accelerations.problem(self._robot, self._period, v)
        return self.stack.problem(self._robot, self._period, v)

    def errors(self, k: int, q: FloatArray) -> dict[str, float]:
        """By how far q (n,) misses the references of the time `path.time[k]`."""
        self._set(k, q)
        return {
            label: float(np.linalg.norm(task.error(self._robot)))
            for label, task in zip(_ERRORS, self._tasks, strict=False)
        }

    def _set(self, k: int, q: FloatArray) -> None:
        path = self._path
        self._robot.update(q)
        self._position.target, self._position.feedforward = path.position[k], path.velocity[k]
        self._orientation.target, self._orientation.feedforward = path.rotation[k], path.angular_velocity[k]
        self._posture.target, self._posture.feedforward = path.q[k], path.qd[k]


def _speeds(x: FloatArray, command: FloatArray, qd: FloatArray) -> dict[str, float]:
    return {
        "commanded speed [rad/s]": norm(x),
        "measured speed [rad/s]": norm(qd),
        "servo error [rad/s]": float(np.abs(command - qd).max()),
        "saturated joints": float(np.count_nonzero(x != command)),
    }


def turned_about(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """(k, 3, 3) rotations about the unit vector `axis` (3,) by `angle` (k,) rad."""
    x, y, z = axis.tolist()
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    rotation: FloatArray = np.eye(3) + sine * cross + versine * (cross @ cross)
    return rotation
