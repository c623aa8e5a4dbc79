"""pink's tasks, limits and barriers as they are, as rows on the velocity: a pink user lists them in the levels of a `Stack`.

The rows are those of `hqp_rp.control._displacement`. This module imports pink (the package pin-pink); whoever has a pink
object has pink.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import Barrier, SelfCollisionBarrier
from pink.limits import Limit

from hqp_rp.control._displacement import Configurations, DisplacementLimit, DisplacementTask
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.robot.robot import Robot

# Pinocchio, behind pink, says by a ValueError that a vector has another size than the model asks for.
_ERRORS = (pink.PinkError, ValueError)


class PinkTask(DisplacementTask):
    """Rows of a pink task: `cost * A v = -cost * gain * error / dt`; rows of zero cost are dropped.

    The cost (None means 1), gain and target of the pink task may be changed at any time; the next step sees them. Error and
    Jacobian are pink's own, so a task alone in a level has the answer of `pink.solve_ik`. That includes what the tasks
    leave out, such as the velocities of "root_joint" in a posture, and the sign of `JointVelocityTask`, which in pink 4.4
    asks for minus its target.

    Args:
        item: a `pink.Task`.

    Raises:
        SettingError: a task with a QP objective of its own in place of A dq = -alpha e.
    """

    __slots__ = ()
    library = "pink"
    errors = _ERRORS
    rates = (pink.tasks.JointVelocityTask, pink.tasks.LowAccelerationTask, pink.tasks.ManipulabilityTask)

    def __init__(self, item: Any, configurations: Configurations) -> None:
        if type(item).compute_qp_objective is not pink.Task.compute_qp_objective:
            raise SettingError(
                f"the pink task {type(item).__name__} is an objective without rows A dq = -gain * error: it has a "
                "compute_qp_objective of its own. So it cannot be a level; leave it out, and give the level damping instead."
            )
        super().__init__(item, configurations)


class PinkLimit(DisplacementLimit):
    """Rows of a pink limit: `G v <= h / dt`, without a lower bound; none where pink returns None.

    An `AccelerationLimit` is told the last velocity as pink asks for it, by `set_last_integration`.

    Args:
        item: a `pink.limits.Limit`.

    Raises, when rows are asked for:
        RobotError: a limit made for a model of another size.
        ProblemError: a bound that is no number, as the braking distance of `AccelerationLimit` outside the joint limits.
    """

    __slots__ = ()
    library = "pink"
    errors = _ERRORS

    def _inequalities(self, configuration: Any, dt: float) -> tuple[Any, Any] | None:
        model, ours = getattr(self._item, "model", None), configuration.model
        if model is not None and model is not ours and (model.nq, model.nv) != (ours.nq, ours.nv):
            raise RobotError(
                f"{self.name} was made for a model with nq = {model.nq} and nv = {model.nv}; this robot has nq = {ours.nq} "
                f"and nv = {ours.nv}. Make it from robot.model."
            )
        with np.errstate(invalid="ignore"):
            found: tuple[Any, Any] | None = self._item.compute_qp_inequalities(configuration, dt)
        if found is not None and np.isnan(found[1]).any():
            raise ProblemError(
                f"{self.name}: its bound h[{int(np.argmax(np.isnan(found[1])))}] is nan at this configuration. Outside the "
                "joint limits there is no braking distance to them: bring the robot inside, or use "
                "hqp_rp.control.JointLimit, whose rows lead back."
            )
        return found


class PinkBarrier(DisplacementLimit):
    """Rows of a pink barrier h(q) >= 0 of gain gamma: `dh/dq v >= -gamma f(h)`, f its gain function.

    The rows of `PositionBarrier`, `BodySphericalBarrier` and any barrier that says h and dh/dq are kept exactly: they are
    linear in v. pink keeps rows from an earlier configuration as long as q is near enough (`numpy.allclose`); here they are
    always of the present one. Of a barrier with a `compute_qp_inequalities` of its own, those are the rows.

    Dropped is the barrier's share of pink's objective, r / (2 |dh/dq|^2) |dq - dq_safe|^2, r its `safe_displacement_gain`:
    it is a wish and no limit. pink's own dq_safe are all 0; damping of a level says the same where it is wanted.

    Args:
        item: a `pink.barriers.Barrier`.

    Raises:
        SettingError: a `SelfCollisionBarrier`, which needs a collision model that a `Robot` does not have.
    """

    __slots__ = ()
    library = "pink"
    errors = _ERRORS

    def __init__(self, item: Any, configurations: Configurations) -> None:
        if isinstance(item, SelfCollisionBarrier):
            raise SettingError(
                f"the pink barrier {type(item).__name__} needs pink's collision model, which a robot does not hold; give "
                "hqp_rp.control.CollisionLimit in its place."
            )
        super().__init__(item, configurations)

    def _inequalities(self, configuration: Any, dt: float) -> tuple[Any, Any]:
        barrier = self._item
        if type(barrier).compute_qp_inequalities is not Barrier.compute_qp_inequalities:
            G, h = barrier.compute_qp_inequalities(configuration, dt)
            return dt * G, dt * h
        value = barrier.compute_barrier(configuration)
        rate = [barrier.gain[i] * barrier.gain_function(value[i]) for i in range(barrier.dim)]
        return -barrier.compute_jacobian(configuration), dt * np.array(rate)


class PinkConfigurations(Configurations):
    """The `pink.Configuration` of a robot that is made of a Pinocchio model, with data of its own."""

    __slots__ = ()

    def _made_for(self, robot: Robot) -> Any:
        model: Any = getattr(robot, "model", None)
        if not isinstance(model, pin.Model):
            raise RobotError(
                f"pink tasks, limits and barriers need a robot that Pinocchio computes; this one is a "
                f"{type(robot).__name__}. Load it as hqp_rp.robot.PinocchioRobot."
            )
        return pink.Configuration(model, model.createData(), robot.q, copy_data=False, forward_kinematics=False)

    def _move(self, configuration: Any, robot: Robot) -> None:
        # Quaternions and (cos, sin) of a robot need not be normalized; those of pink must be.
        configuration.update(robot.q if robot.nq == robot.nv else pin.normalize(configuration.model, robot.q))


def adapt(item: Any, configurations: dict[str, Configurations]) -> PinkTask | PinkLimit | PinkBarrier | None:
    """The adapter of a pink task, limit or barrier, or None for anything else; all share `configurations["pink"]`."""
    own = configurations.setdefault("pink", PinkConfigurations())
    if isinstance(item, pink.Task):
        return PinkTask(item, own)
    if isinstance(item, Limit):
        return PinkLimit(item, own)
    if isinstance(item, Barrier):
        return PinkBarrier(item, own)
    return None
