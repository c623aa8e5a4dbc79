"""The joint-limit potential (8): what to do with the freedom that all levels leave."""

from __future__ import annotations

from typing import Literal

import numpy as np

from hqp_rp.control._checks import per_row
from hqp_rp.control._coordinates import coordinate_index, joint_positions
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.warned import warn
from hqp_rp.robot.robot import Robot


class JointLimitPotential:
    """How far the joints are from the middle of their ranges, as a function to descend: the potential (8).

    ::

        H(q) = 1/k sum_i ((q_i - mid_i) / (mid_i - max_i))^2,      dH/dq_i = 2/k (q_i - mid_i) / (mid_i - max_i)^2

    over the k joints with two finite limits; the others do not count. H is 0 in the middle and 1 where every joint is at a
    limit. `velocity` = -gain dH/dq fills the free vector of `solve(problem, solver, secondary=...)`.

    The paper prints (8) without the square and without 1/k. That sum has a constant gradient, -1/(max_i - mid_i): it drives
    every joint towards one end of its range instead of away from both. form="printed" computes it as it stands; the default
    is the squared form that it is taken from.

    Args:
        gain: 1/s times rad^2 or m^2, >= 0.
        form: "squared" (default) or "printed".

    Raises:
        SettingError: a gain that is negative or not finite; a form that does not exist.
        RobotError: when it meets a robot without any joint that has two finite limits.

    Source: equation (8) of the paper; Liegeois, "Automatic supervisory control of the configuration and behavior of
    multibody mechanisms", IEEE Transactions on Systems, Man, and Cybernetics, 1977.
    """

    __slots__ = ("_bound", "_coordinates", "_form", "_gain", "_mid", "_scale")

    def __init__(self, gain: float = 1.0, form: Literal["squared", "printed"] = "squared") -> None:
        if np.ndim(gain) != 0:
            raise SettingError(f"the gain of a joint-limit potential is {gain!r}; give one number.")
        self._gain = per_row(gain, None, "the gain of a joint-limit potential", positive=False)
        if form not in ("squared", "printed"):
            raise SettingError(f"the form of a joint-limit potential is {form!r}; valid: 'squared', 'printed'.")
        self._form = form
        self._bound: Robot | None = None
        self._coordinates: IntArray | None = None
        self._mid = self._scale = np.empty(0)

    def value(self, robot: Robot) -> float:
        """H, dimensionless, at the robot's current configuration."""
        ratio = self._ratio(robot)
        return float(ratio.sum()) if self._form == "printed" else float(ratio @ ratio) / np.count_nonzero(self._scale)

    def gradient(self, robot: Robot) -> FloatArray:
        """dH/dq (nv,), 1/rad or 1/m; 0 at joints that do not count."""
        ratio = self._ratio(robot)
        if self._form == "printed":
            return self._scale.copy()
        gradient: FloatArray = (2.0 / np.count_nonzero(self._scale)) * ratio * self._scale
        return gradient

    def velocity(self, robot: Robot) -> FloatArray:
        """-gain dH/dq (nv,), rad/s or m/s: the free vector zeta-dot of (5), (10) and (11)."""
        return -self._gain * self.gradient(robot)

    def _ratio(self, robot: Robot) -> FloatArray:
        """(q - mid) / (mid - max), (nv,); 0 at joints that do not count."""
        if robot is not self._bound:
            self._bind(robot)
        ratio: FloatArray = (joint_positions(robot.q, self._coordinates) - self._mid) * self._scale
        return ratio

    def _bind(self, robot: Robot) -> None:
        lower, upper = robot.lower, robot.upper
        counts = np.isfinite(lower) & np.isfinite(upper) & (lower < upper)
        if not counts.any():
            raise RobotError(
                "a joint-limit potential needs a joint with two finite position limits; this robot has none."
            )
        balls = getattr(robot, "limited_balls", ())
        if balls:
            warn(
                f"joint-limit potential: the ball joint {balls[0]!r} has a range, which the potential leaves out: it counts "
                "hinges and slides only."
            )
        self._coordinates = coordinate_index(robot, "joint-limit potential")
        self._mid, self._scale = np.zeros(robot.nv), np.zeros(robot.nv)
        self._mid[counts] = (lower[counts] + upper[counts]) / 2.0
        self._scale[counts] = -2.0 / (upper[counts] - lower[counts])
        self._bound = robot

    def __repr__(self) -> str:
        return f"JointLimitPotential(gain={self._gain:g}, form={self._form!r})"
