"""Which solver lets the Sawyer come up to a stiff wall, meet it and rest on it with 30 N? The paper's 5.2."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

from hqp_rp.control.force import ForceReference
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._interaction import LOWER_AXES, Case, Experiment, Interaction, first_axis_cases, pose_errors


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerWallContact(Interaction):
    """The paper's 5.2: approach, contact and rest against a wall across x, the force in x first, all other axes second.

    The ball starts at rest, `gap` in front of the wall, and the force level, F_d = `force`, drives it there. The second
    level is impedance: y, z and the orientation are to stay where they were. With "reverse priority" this is (47) with a
    first level without spring; any other solver is its classical counterpart. See `Interaction` for cases, settings and
    measured figures. "near singular": the approach moves the arm along a place where the second level is about to lose a
    direction beside the first.

    Args:
        gap: m, > 0. force: N, > 0.

    Also measured: "position error y [m]", "position error z [m]" and "orientation error [rad]", against the start.
    """

    name: ClassVar[str] = "sawyer_wall_contact"
    question: ClassVar[str] = "Which solver brings the tool against a stiff wall and to rest with the desired force?"
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Interaction.cannot_tell,
        "One speed of approach, which the force law itself makes: a robot that knows where the wall is would slow down.",
    )

    gap: float = 0.01
    force: float = 30.0

    def __post_init__(self) -> None:
        for name in ("gap", "force"):
            self._require(name, lambda value: value > 0.0, "> 0")
        super().__post_init__()

    def cases(self) -> tuple[Case, ...]:
        return first_axis_cases()

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {"x": float(position[0]) + self.gap}

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains = self.gains(case, "x")
        first = ForceReference(
            "tool", gains.M_d[:1], gains.B_d[:1], self.force, axes=("x",), recovery=self.recovery, name="force x"
        )
        start = robot.pose("tool")
        lower = ImpedanceReference(
            "tool",
            start,
            gains.M_d[1:],
            gains.B_d[1:],
            gains.K_d[1:],
            axes=LOWER_AXES,
            recovery=self.recovery,
            name="impedance y, z and orientation",
        )
        return Experiment(
            self.stack(first, lower),
            lambda t: None,
            lambda t: {"x": self.force},
            lambda t, robot: pose_errors(robot, start, "yz"),
        )
