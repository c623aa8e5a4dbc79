"""mink's tasks and limits as they are, as rows on the velocity: a mink user lists them in the levels of a `Stack`.

mink solves for the displacement dq = v dt and weighs its tasks against each other. A task with error e(q), Jacobian
de/dq = A, gain alpha and cost w contributes w (A dq + alpha e); here the same rows read `w A v = -w alpha e / dt`, and the
level says what comes first. A limit `G dq <= h` reads `G v <= h / dt`.

This module imports mink; whoever has a mink object has mink.
"""

from __future__ import annotations

from typing import Any

import mink
import mujoco
import numpy as np
from mink.tasks.task import BaseTask

from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class MinkTask:
    """Rows of a mink task: `cost * A v = -cost * gain * error / dt`; rows of zero cost are dropped.

    The cost, gain and target of the mink task may be changed at any time; the next step sees them. The Jacobian is mink's
    own, for frame tasks the derivative of the logarithm of SE(3), expressed in the body frame.

    Args:
        task: a `mink.Task`.

    Raises:
        SettingError: a mink task that is not of the form A dq = -alpha e (such as an inertia-weighted regularization).

    Its `lm_damping` is that of the level it stands in, mu = lm_damping |w alpha e|^2, unless `Stack(damping=...)` gives that
    level another.
    """

    __slots__ = ("_configurations", "_task")

    def __init__(self, task: BaseTask, configurations: Configurations) -> None:
        if not isinstance(task, mink.Task):
            raise SettingError(
                f"the mink task {type(task).__name__} is an objective without rows A dq = -gain * error, so it cannot be a "
                "level; leave it out, and give the level damping instead."
            )
        self._task = task
        self._configurations = configurations

    @property
    def name(self) -> str:
        """The frame of the mink task and its class."""
        frame = getattr(self._task, "frame_name", None)
        return f"mink {type(self._task).__name__}" + ("" if frame is None else f" {frame}")

    @property
    def lm_damping(self) -> float:
        """mink's Levenberg-Marquardt damping of this task."""
        return float(self._task.lm_damping)

    def evaluate(self, robot: Robot, dt: float) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,), scaled by the cost; m is the number of rows of nonzero cost."""
        task, configuration = self._task, self._configurations.at(robot)
        try:
            A = np.asarray(task.compute_jacobian(configuration), dtype=np.float64)
            error = np.asarray(task.compute_error(configuration), dtype=np.float64)
        except mink.MinkError as problem:
            raise SettingError(f"{self.name}: {str(problem).rstrip('.')}. Set it up as mink asks for.") from problem
        # Read after the error: some tasks set their cost while they compute it.
        cost = np.broadcast_to(np.asarray(task.cost, dtype=np.float64), error.shape)
        rate = error * (-task.gain / dt)
        if (cost == 1.0).all():
            return A, rate
        kept = cost != 0.0
        if not kept.all():
            A, rate, cost = A[kept], rate[kept], cost[kept]
        return cost[:, None] * A, cost * rate


class MinkLimit:
    """Rows of a mink limit: `G v <= h / dt`, without a lower bound.

    Args:
        limit: a `mink.Limit`.
    """

    __slots__ = ("_configurations", "_limit")

    def __init__(self, limit: mink.Limit, configurations: Configurations) -> None:
        self._limit = limit
        self._configurations = configurations

    @property
    def name(self) -> str:
        """The class of the mink limit."""
        return f"mink {type(self._limit).__name__}"

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """G (m, nv), lower (m,) all -inf, upper (m,); no rows where mink calls the limit inactive."""
        try:
            G, h = self._limit.compute_qp_inequalities(self._configurations.at(robot), dt)
        except mink.MinkError as problem:
            raise SettingError(f"{self.name}: {problem}") from problem
        if G is None or h is None:
            return np.empty((0, robot.nv)), np.empty(0), np.empty(0)
        return np.asarray(G, dtype=np.float64), np.full(len(h), -np.inf), np.asarray(h, dtype=np.float64) / dt


class Configurations:
    """The `mink.Configuration` of the robot that a stack works on, brought up to date once per problem."""

    __slots__ = ("_configuration", "_fresh", "_robot")

    def __init__(self) -> None:
        self._robot: Robot | None = None
        self._configuration: mink.Configuration | None = None
        self._fresh = False

    def expire(self) -> None:
        """Say that the robot may have moved."""
        self._fresh = False

    def at(self, robot: Robot) -> mink.Configuration:
        """The configuration at `robot.q`. Raises `RobotError` for a robot that is not made of a MuJoCo model."""
        configuration = self._configuration
        if configuration is None or robot is not self._robot:
            model = getattr(robot, "model", None)
            if not isinstance(model, mujoco.MjModel):
                raise RobotError(
                    f"mink tasks and limits need a robot that MuJoCo computes; this one is a {type(robot).__name__}. "
                    "Load it as hqp_rp.robot.MujocoRobot."
                )
            configuration = self._configuration = mink.Configuration(model)
            self._robot, self._fresh = robot, False
        if not self._fresh:
            poses = getattr(robot, "mocap_poses", None)
            if poses is not None and configuration.model.nmocap:
                configuration.data.mocap_pos[:], configuration.data.mocap_quat[:] = poses
            configuration.update(robot.q)
            self._fresh = True
        return configuration


def adapt(item: Any, configurations: Configurations) -> MinkTask | MinkLimit | None:
    """The adapter of a mink task or limit, or None for anything else."""
    if isinstance(item, BaseTask):
        return MinkTask(item, configurations)
    if isinstance(item, mink.Limit):
        return MinkLimit(item, configurations)
    return None
