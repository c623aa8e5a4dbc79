"""Does the tool of the Sawyer move as a mass with damper and spring when somebody pushes it? The paper's 4.2, (47)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hqp_rp.control._checks import TWIST_AXES
from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._interaction import Case, Experiment, Interaction, first_axis_cases

FIRST: dict[str, tuple[str, ...]] = {"x": ("x",), "rotation": ("rx", "ry", "rz")}
"""What the first level may be; the second is the rest."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerPushResponse(Interaction):
    """Impedance on two levels, (47), in free space: a wrench pushes the tool for half of the time, then lets go.

    Its components are `push_force` along x, y, z and `push_torque` about them, at once. The ideal is what the law itself does
    under the same wrench, axis by axis: M_d e'' + B_d e' + K_d e = F, solved exactly, e the deviation from the target.

    Args:
        push_force: N. push_torque: N m. first: "x" or "rotation", the axes of the first level; the second has the others.
        travel: m, >= 0, how far the target moves along y and back; 0 for a target at rest.

    Also measured, for each axis A of x, y, z, rx, ry, rz: "deviation A" and "ideal A", m or rad.
    """

    name: ClassVar[str] = "sawyer_push_response"
    question: ClassVar[str] = "Does the tool move as the mass, damper and spring that were asked for when it is pushed?"
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Interaction.cannot_tell,
        "The push is a step of all six components; other shapes weigh frequencies differently.",
    )

    push_force: float = 20.0
    push_torque: float = 2.0
    first: str = "x"
    travel: float = 0.0

    def __post_init__(self) -> None:
        for name in ("push_force", "push_torque"):
            self._require(name, lambda value: True, "")
        self._require("travel", lambda value: value >= 0.0, ">= 0")
        if self.first not in FIRST:
            raise SettingError(f"first of {self.name} is {self.first!r}; it must be one of {', '.join(FIRST)}.")
        super().__post_init__()

    def cases(self) -> tuple[Case, ...]:
        return first_axis_cases()

    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        return {}

    def push(self, t: float) -> FloatArray:
        if t >= 0.5 * self.periods() * self.period:
            return np.zeros(6)
        return np.array([self.push_force] * 3 + [self.push_torque] * 3)

    def ideal(self, gains_law: AdmittanceLaw) -> FloatArray:
        """(N + 1, 6) m and rad: the deviation of the law at the ends of the control periods."""
        deviation, velocity = np.zeros(6), np.zeros(6)
        found = [deviation]
        for k in range(self.periods()):
            mean, velocity = gains_law.advance(deviation, velocity, self.push(k * self.period), self.period)
            deviation = deviation + self.period * mean
            found.append(deviation)
        return np.array(found)

    def experiment(self, case: Case, robot: Robot) -> Experiment:
        gains = self.gains(case, "")
        start = robot.pose("tool")
        axes = FIRST[self.first], tuple(axis for axis in TWIST_AXES if axis not in FIRST[self.first])
        levels = []
        for own in axes:
            rows = [TWIST_AXES.index(axis) for axis in own]
            M, B, K = gains.M_d[rows], gains.B_d[rows], gains.K_d[rows]
            name = f"impedance {' '.join(own)}"
            levels.append(ImpedanceReference("tool", start, M, B, K, axes=own, recovery=self.recovery, name=name))
        ideal = self.ideal(AdmittanceLaw(6, gains.M_d, gains.B_d, gains.K_d))
        w = 2.0 * math.pi / (self.periods() * self.period)
        half = 0.5 * self.travel

        def target(t: float) -> tuple[FloatArray, FloatArray]:
            return start[0], start[1] + np.array((0.0, half * (1.0 - math.cos(w * t)), 0.0))

        def update(t: float) -> None:
            for level in levels:
                level.target = target(t)
                level.target_velocity = (0.0, half * w * math.sin(w * t), 0.0, 0.0, 0.0, 0.0)
                level.target_acceleration = (0.0, half * w**2 * math.cos(w * t), 0.0, 0.0, 0.0, 0.0)

        def errors(t: float, robot: Robot) -> Mapping[str, float]:
            R, p = robot.pose("tool")
            R_target, p_target = target(t)
            deviation = np.concatenate((p - p_target, rotation_log(R @ R_target.T)))
            k = min(round(t / self.period), len(ideal) - 1)
            found = {f"deviation {axis}": float(value) for axis, value in zip(TWIST_AXES, deviation, strict=True)}
            return found | {f"ideal {axis}": float(value) for axis, value in zip(TWIST_AXES, ideal[k], strict=True)}

        return Experiment(self.stack(*levels), update, lambda t: {}, errors)
