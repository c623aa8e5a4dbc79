"""Which solver lets the Sawyer track a force in a corner of two stiff walls, X before everything else? The paper's 5.1."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar

from hqp_rp.control.force import ForceReference
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._interaction import LOWER_AXES, Case, Experiment, Interaction, first_axis_cases, turn

AS_PRINTED = 1.0 / (2.0 * math.pi**2)
"""Hz, of sin(t / pi)."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerForceTracking(Interaction):
    """The paper's 5.1: force control everywhere, x first, y, z and the orientation second, in a corner of two walls.

    F_d = 30 + 5 sin(t / pi) N in x and in y, (54), 0 elsewhere, where nothing is touched. The ball starts at rest, touching
    both walls without force. Both levels are `ForceReference`s: reverse priority then is (42), and any other solver its
    classical counterpart. See `Interaction` for cases, settings and measured figures; "near singular" is where the second
    level is about to lose the direction (-0.89, -0.36, -0.16) of y, z, rx (and a little of the rest) beside the first, so
    the force in y asks for much joint motion.

    Args:
        amplitude: N, >= 0. frequencies: Hz, > 0 and at least one: F_d = 30 + the sum of amplitude sin(2 pi f t). The default is
            (54) as printed, one period in 19.7 s; (0.5,) is sin(pi t), which the print may mean as well.

    Also measured: "drift z [m]" and "orientation error [rad]", how far the tool has come from its start.
    """

    name: ClassVar[str] = "sawyer_force_tracking"
    question: ClassVar[str] = (
        "Which solver tracks the force across one wall while the force across another, of lower priority, comes with it?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Interaction.cannot_tell,
        "One period of the desired force takes 19.7 s; a shorter case shows its beginning, from 30 N at t = 0.",
    )

    amplitude: float = 5.0
    frequencies: tuple[float, ...] = (AS_PRINTED,)

    def __post_init__(self) -> None:
        self._require("amplitude", lambda value: value >= 0.0, ">= 0")
        if not self.frequencies or not all(0.0 < f < math.inf for f in self.frequencies):
            raise SettingError(
                f"frequencies of {self.name} is {self.frequencies!r}; give one or more, in Hz, each > 0."
            )
        super().__post_init__()

    def desired(self, t: float) -> float:
        """N: F_d in x and in y."""
        return 30.0 + self.amplitude * sum(math.sin(2.0 * math.pi * f * t) for f in self.frequencies)

    def cases(self) -> tuple[Case, ...]:
        return first_axis_cases()

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {"x": float(position[0]), "y": float(position[1])}

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains = self.gains(case, "xy")
        first = ForceReference(
            "tool", gains.M_d[:1], gains.B_d[:1], axes=("x",), recovery=self.recovery, name="force x"
        )
        lower = ForceReference(
            "tool", gains.M_d[1:], gains.B_d[1:], axes=LOWER_AXES, recovery=self.recovery, name="force y, z and torque"
        )
        R_0, p_0 = robot.pose("tool")

        def update(t: float) -> None:
            first.force = [self.desired(t)]
            lower.force = [self.desired(t), 0.0, 0.0, 0.0, 0.0]

        def errors(t: float, robot: Robot) -> Mapping[str, float]:
            R, p = robot.pose("tool")
            return {"drift z [m]": float(p[2] - p_0[2]), "orientation error [rad]": turn(R, R_0)}

        return Experiment(
            self.stack(first, lower), update, lambda t: {"x": self.desired(t), "y": self.desired(t)}, errors
        )
