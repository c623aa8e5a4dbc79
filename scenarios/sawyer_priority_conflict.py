"""What happens to the force when the task below it asks for what the arm cannot reach?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hqp_rp.control.force import ForceReference
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._interaction import (
    DAMPED,
    PAPER,
    REGULAR,
    SINGULAR,
    Case,
    Experiment,
    Interaction,
    Place,
)

# What `find_start(("y", "z"))` returns: q and approach of a singular configuration, rad; and its direction is z.
_SINGULAR = (
    -1.3494946064285918,
    -0.34324414974458184,
    1.1786665477545064,
    0.0,
    0.0,
    0.0,
    2.03616357839031,
)
_APPROACH = (
    0.0,
    0.8954311683842864,
    -0.008118711143336345,
    -0.38896429056833304,
    -0.11130089898532303,
    -0.18562327376451326,
    0.0,
)
_DISTANCE = 0.4  # rad


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerPriorityConflict(Interaction):
    """Force first; then a point along the wall that moves out of reach, midway, and comes back; then the posture.

    Level 1 presses with F_d = `force` across x, level 2 is impedance in y and z, level 3 the posture of the start. The
    target of level 2 moves along one direction e of the wall, X_d(t) = X_0 + h sin^2(pi t / T) e, and from about h / 2 on
    the arm, with x on the wall, cannot follow: it is stretched, and the second level is singular beside the first.

    - "regular": from the arm's neutral posture, e = -y, h = `travel`;
    - "near singular": from a posture 0.4 rad from stretched upwards, e = z (or whichever direction a `Place` loses), h =
      `near_travel`.

    See `Interaction` for gains, settings and measured figures.

    Args:
        force: N, > 0. travel, near_travel: m, > 0. posture_gain: 1/s, >= 0 and posture_gain * period <= 1.

    Also measured: "position error y [m]" and "position error z [m]", against the target, reachable or not.
    """

    name: ClassVar[str] = "sawyer_priority_conflict"
    question: ClassVar[str] = "What happens to the force when the task below it asks for what the arm cannot reach?"
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Interaction.cannot_tell,
        "Where the target is out of reach no solver can follow it; what differs is what the attempt costs.",
    )

    force: float = 30.0
    travel: float = 0.5
    near_travel: float = 0.1
    posture_gain: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("force", "travel", "near_travel"):
            self._require(name, lambda value: value > 0.0, "> 0")
        top = 1.0 / self.period
        self._require("posture_gain", lambda value: 0.0 <= value <= top, f"in [0, 1 / period] = [0, {top:g}]")

    def cases(self) -> tuple[Case, ...]:
        near = Place(SINGULAR, np.array(_SINGULAR), np.array(_APPROACH), np.array((0.0, 1.0)), _DISTANCE)
        places = (Place(REGULAR, np.array(sawyer().neutral)), near)
        return tuple(self.case_at(gains, place) for gains in (PAPER, DAMPED) for place in places)

    def case_at(self, gains: str, place: Place) -> Case:
        axis = np.array((0.0, -1.0, 0.0))
        if place.direction is not None:
            axis = np.concatenate(([0.0], place.direction / norm(place.direction)))
        if place.approach is not None:
            # Towards the singularity, which is the end of the reach, and on.
            arm = self.arm()
            ahead = arm.pose(place.q, "tool")[1] - arm.pose(place.start(), "tool")[1]
            axis = -axis if axis @ ahead < 0.0 else axis
        return Case(gains, place.name, place.start(), axis=axis)

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {"x": float(position[0])}

    def motion(self, case: Case, t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(3,) each: X_d - X_0 in m, its rate in m/s and its acceleration in m/s^2, at t s."""
        assert case.axis is not None
        e, w = case.axis, 2.0 * math.pi / (self.periods() * self.period)
        half = 0.5 * (self.near_travel if case.place == SINGULAR else self.travel)
        return (
            half * (1.0 - math.cos(w * t)) * e,
            half * w * math.sin(w * t) * e,
            half * w**2 * math.cos(w * t) * e,
        )

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains = self.gains(case, "x")
        M, B, K = gains.M_d, gains.B_d, gains.K_d
        back = self.recovery
        press = ForceReference("tool", M[:1], B[:1], self.force, axes=("x",), recovery=back, name="force x")
        start = robot.pose("tool")[1]
        follow = ImpedanceReference(
            "tool", start, M[1:3], B[1:3], K[1:3], axes=("y", "z"), recovery=back, name="impedance y, z"
        )
        posture = PostureTask(robot.q, gain=self.posture_gain)

        def update(t: float) -> None:
            offset, velocity, acceleration = self.motion(case, t)
            follow.target = start + offset
            follow.target_velocity = np.concatenate((velocity, np.zeros(3)))
            follow.target_acceleration = np.concatenate((acceleration, np.zeros(3)))

        def errors(t: float, robot: Robot) -> Mapping[str, float]:
            error = robot.pose("tool")[1] - (start + self.motion(case, t)[0])
            return {"position error y [m]": float(error[1]), "position error z [m]": float(error[2])}

        return Experiment(self.stack(press, follow, posture), update, lambda t: {"x": self.force}, errors)
