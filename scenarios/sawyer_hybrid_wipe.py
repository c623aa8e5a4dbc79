"""Which solver keeps the Sawyer pressing while it wipes along a wall, through a singularity of the orientation beneath?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hqp_rp.control.hybrid import HybridReference
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._crossing import turned_about
from hqp_rp.scenarios._interaction import (
    DAMPED,
    PAPER,
    REGULAR,
    SINGULAR,
    Case,
    Experiment,
    Interaction,
    Place,
    pose_errors,
)
from hqp_rp.scenarios.sawyer_crossing import SawyerCrossing

_NEWTON_STEPS = 8


@dataclasses.dataclass(frozen=True, slots=True)
class Wipe:
    """References at the ends of the control periods, t_0 = 0, ..., t_N = T; every array has N + 1 rows.

    q: (., n) rad, the joint path. position: (., 3) m, its tool positions, all with the same x. rotation: (., 3, 3).
    velocity, acceleration: (., 6) of both in world axes: m/s and rad/s, m/s^2 and rad/s^2.
    """

    q: FloatArray
    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerHybridWipe(Interaction):
    """Hybrid impedance on three levels: force across the wall, a path along it, and the tool's orientation.

    Level 1 presses with F_d = `force` across x (a `HybridReference` with S = 0), level 2 follows y and z (S = 1), level 3
    the orientation (impedance): the paper's (48)-(53). The references come from a joint path

        q(t) = on the wall, nearest to q_c + s(t) d,       s(t) = -reach cos(pi t / T)

    where "on the wall" moves along the gradient of the tool's x until x is what it is at q_c. So y, z and orientation can
    be met together, but for a turn of the orientation by `demand` cos^2 about one axis in the middle half of the path.

    - "near singular": q_c, d and the axis are `SawyerCrossing`'s: at T / 2 the orientation can no longer turn about that
      axis beside x, y, z, and the turn asks for more than there is, for a while.
    - "regular": q_c is the arm's neutral posture, d the joint direction that moves the tool along y alone, the axis x.

    See `Interaction` for gains, settings and measured figures.

    Args:
        force: N, > 0. reach: rad, > 0. demand: rad, >= 0.

    Also measured: "position error y [m]", "position error z [m]" and "orientation error [rad]", against the references.
    """

    name: ClassVar[str] = "sawyer_hybrid_wipe"
    question: ClassVar[str] = (
        "Which solver keeps pressing and stays on the path when the orientation below them passes a singularity?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Interaction.cannot_tell,
        "By default the wall has no friction: wiping itself takes no force.",
        "One path, at one speed; a singular one goes through one configuration.",
    )

    force: float = 30.0
    reach: float = 0.4
    demand: float = 0.03

    def __post_init__(self) -> None:
        for name in ("force", "reach"):
            self._require(name, lambda value: value > 0.0, "> 0")
        self._require("demand", lambda value: value >= 0.0, ">= 0")
        super().__post_init__()

    def cases(self) -> tuple[Case, ...]:
        center, direction, axis = SawyerCrossing().crossing()
        places = (
            Place(REGULAR, np.array(sawyer().neutral)),
            Place(SINGULAR, center, direction, axis),
        )
        return tuple(self.case_at(gains, place) for gains in (PAPER, DAMPED) for place in places)

    def case_at(self, gains: str, place: Place) -> Case:
        if place.approach is not None and place.direction is not None:
            direction, axis = place.approach / norm(place.approach), place.direction / norm(place.direction)
        else:
            axis = np.array((1.0, 0.0, 0.0))
            moved = np.asarray(np.linalg.pinv(sawyer().jacobian(place.q, "tool"))[:, 1], dtype=np.float64)
            direction = moved / norm(moved)
        case = Case(gains, place.name, place.q, place.q, direction, axis)
        return dataclasses.replace(case, q=self.wipe(case).q[0])

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {"x": float(position[0])}

    def wipe(self, case: Case) -> Wipe:
        """The references of a case."""
        arm, steps = self.arm(), self.periods()
        center, direction, axis = case.middle, case.direction, case.axis
        assert center is not None and direction is not None and axis is not None  # noqa: PT018
        share = np.arange(steps + 1) / steps
        q: FloatArray = center - self.reach * np.cos(math.pi * share)[:, None] * direction
        wall = arm.pose(center, "tool")[1][0]
        for _ in range(_NEWTON_STEPS):
            gradient = arm.jacobian(q, "tool")[:, 0]
            miss = arm.pose(q, "tool")[1][:, 0] - wall
            q = q - (miss / (gradient**2).sum(axis=1))[:, None] * gradient
        from_middle = 2.0 * (share - 0.5)
        height = np.where(np.abs(from_middle) < 0.5, self.demand * np.cos(math.pi * from_middle) ** 2, 0.0)
        turn = turned_about(axis, height)
        path_rotation, position = arm.pose(q, "tool")
        twist = np.einsum("kij,kj->ki", arm.jacobian(q, "tool"), self._rate(q))
        velocity = twist.copy()
        velocity[:, 3:] = self._rate(height)[:, None] * axis + np.einsum("kij,kj->ki", turn, twist[:, 3:])
        return Wipe(q, position, turn @ path_rotation, velocity, self._rate(velocity))

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains, wipe, period = self.gains(case, "x"), self.wipe(case), self.period
        start = (wipe.rotation[0], wipe.position[0])
        M, B, K, back = gains.M_d, gains.B_d, gains.K_d, self.recovery
        press = HybridReference(
            "tool", start, M[:1], B[:1], K[:1], [0.0], self.force, axes=("x",), recovery=back, name="force x"
        )
        follow = HybridReference(
            "tool", start, M[1:3], B[1:3], K[1:3], [1.0, 1.0], axes=("y", "z"), recovery=back, name="path y, z"
        )
        point = ImpedanceReference(
            "tool", start, M[3:], B[3:], K[3:], axes=("rx", "ry", "rz"), recovery=back, name="orientation"
        )

        def pose(t: float) -> tuple[FloatArray, FloatArray]:
            k = min(round(t / period), len(wipe.q) - 1)
            return wipe.rotation[k], wipe.position[k]

        def update(t: float) -> None:
            k = min(round(t / period), len(wipe.q) - 1)
            for reference in (follow, point):
                reference.target = pose(t)
                reference.target_velocity = wipe.velocity[k]
                reference.target_acceleration = wipe.acceleration[k]

        return Experiment(
            self.stack(press, follow, point),
            update,
            lambda t: {"x": self.force},
            lambda t, robot: pose_errors(robot, pose(t), "yz"),
        )

    def _rate(self, values: FloatArray) -> FloatArray:
        """The time derivative of a series over the control periods, by central differences."""
        rate: FloatArray = np.gradient(values, self.period, axis=0, edge_order=2)
        return rate
