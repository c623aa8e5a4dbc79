"""Does one hybrid level press across a tilted wall and follow a line along it? The paper's 4.3, (48)-(52), S not diagonal."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hqp_rp.control.hybrid import HybridReference
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._contact import axis_turned
from hqp_rp.scenarios._interaction import Case, Experiment, Interaction, first_axis_cases, turn


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerTiltedWipe(Interaction):
    """Force and position mixed in one level: the wall's normal is n = (cos `tilt`, sin `tilt`, 0), and S = I - n n^T.

    Level 1 (x, y, z) presses with `force` along n and follows a line in the wall, there and back over `travel`; level 2 keeps
    the orientation. The ball starts at rest and touches the wall without force.

    Args:
        force: N, > 0. tilt: rad. travel: m, >= 0.

    Also measured: "position error along [m]", "position error z [m]", both in the wall, and "orientation error [rad]".
    """

    name: ClassVar[str] = "sawyer_tilted_wipe"
    question: ClassVar[str] = (
        "Does one level hold a force across a tilted wall and a path along it, with S not diagonal?"
    )

    force: float = 30.0
    tilt: float = 0.6
    travel: float = 0.08

    def __post_init__(self) -> None:
        self._require("force", lambda value: value > 0.0, "> 0")
        self._require("tilt", lambda value: True, "")
        self._require("travel", lambda value: value >= 0.0, ">= 0")
        super().__post_init__()

    def cases(self) -> tuple[Case, ...]:
        return first_axis_cases()

    def turned(self) -> float:
        return self.tilt

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {"x": float(axis_turned("x", self.tilt) @ position)}

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains = self.gains(case, "")
        n, along = axis_turned("x", self.tilt), axis_turned("y", self.tilt)
        start = robot.pose("tool")
        M, K = gains.M_d, gains.K_d
        B = np.diag(gains.B_d[:3])
        B += (self.gains(case, "x").B_d[0] - gains.B_d[0]) * np.outer(n, n)
        S = np.eye(3) - np.outer(n, n)
        back = self.recovery
        press = HybridReference(
            "tool",
            start,
            M[:3],
            B,
            K[:3],
            S,
            self.force * n,
            axes=("x", "y", "z"),
            recovery=back,
            name="press and follow",
        )
        point = ImpedanceReference(
            "tool", start, M[3:], gains.B_d[3:], K[3:], axes=("rx", "ry", "rz"), recovery=back, name="orientation"
        )
        w = 2.0 * math.pi / (self.periods() * self.period)
        half = 0.5 * self.travel

        def target(t: float) -> FloatArray:
            position: FloatArray = start[1] + half * (1.0 - math.cos(w * t)) * along
            return position

        def update(t: float) -> None:
            press.target = start[0], target(t)
            press.target_velocity = np.concatenate((half * w * math.sin(w * t) * along, np.zeros(3)))
            press.target_acceleration = np.concatenate((half * w**2 * math.cos(w * t) * along, np.zeros(3)))

        def errors(t: float, robot: Robot) -> Mapping[str, float]:
            R, p = robot.pose("tool")
            miss = p - target(t)
            return {
                "position error along [m]": float(along @ miss),
                "position error z [m]": float(miss[2]),
                "orientation error [rad]": turn(R, start[0]),
            }

        return Experiment(self.stack(press, point), update, lambda t: {"x": self.force}, errors)
