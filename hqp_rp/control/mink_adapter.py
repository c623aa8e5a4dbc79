"""mink's tasks and limits as they are, as rows on the velocity: a mink user lists them in the levels of a `Stack`.

The rows are those of `hqp_rp.control._displacement`. This module imports mink; whoever has a mink object has mink.
"""

from __future__ import annotations

from typing import Any

import mink
import mujoco
from mink.tasks.task import BaseTask

from hqp_rp.control._displacement import Configurations, DisplacementLimit, DisplacementTask
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot.robot import Robot


class MinkTask(DisplacementTask):
    """Rows of a mink task: `cost * A v = -cost * gain * error / dt`; rows of zero cost are dropped.

    The cost, gain and target of the mink task may be changed at any time; the next step sees them. The Jacobian is mink's
    own, for frame tasks the derivative of the logarithm of SE(3), expressed in the body frame.

    Args:
        item: a `mink.Task`.

    Raises:
        SettingError: a mink task that is not of the form A dq = -alpha e (such as an inertia-weighted regularization).
    """

    __slots__ = ()
    library = "mink"
    errors = (mink.MinkError,)
    rates = (mink.DofFreezingTask,)

    def __init__(self, item: BaseTask, configurations: Configurations) -> None:
        if not isinstance(item, mink.Task):
            raise SettingError(
                f"the mink task {type(item).__name__} is an objective without rows A dq = -gain * error, so it cannot be a "
                "level; leave it out, and give the level damping instead."
            )
        super().__init__(item, configurations)


class MinkLimit(DisplacementLimit):
    """Rows of a mink limit: `G v <= h / dt`, without a lower bound; none where mink calls the limit inactive.

    Args:
        item: a `mink.Limit`.
    """

    __slots__ = ()
    library = "mink"
    errors = (mink.MinkError,)

    def _inequalities(self, configuration: Any, dt: float) -> tuple[Any, Any] | None:
        G, h = self._item.compute_qp_inequalities(configuration, dt)
        return None if G is None or h is None else (G, h)


class MinkConfigurations(Configurations):
    """The `mink.Configuration` of a robot that is made of a MuJoCo model."""

    __slots__ = ()

    def _made_for(self, robot: Robot) -> mink.Configuration:
        model = getattr(robot, "model", None)
        if not isinstance(model, mujoco.MjModel):
            raise RobotError(
                f"mink tasks and limits need a robot that MuJoCo computes; this one is a {type(robot).__name__}. "
                "Load it as hqp_rp.robot.MujocoRobot."
            )
        return mink.Configuration(model)

    def _move(self, configuration: mink.Configuration, robot: Robot) -> None:
        poses = getattr(robot, "mocap_poses", None)
        if poses is not None and configuration.model.nmocap:
            configuration.data.mocap_pos[:], configuration.data.mocap_quat[:] = poses
        configuration.update(robot.q)


def adapt(item: Any, configurations: dict[str, Configurations]) -> MinkTask | MinkLimit | None:
    """The adapter of a mink task or limit, or None for anything else; all share `configurations["mink"]`."""
    own = configurations.setdefault("mink", MinkConfigurations())
    if isinstance(item, BaseTask):
        return MinkTask(item, own)
    if isinstance(item, mink.Limit):
        return MinkLimit(item, own)
    return None
