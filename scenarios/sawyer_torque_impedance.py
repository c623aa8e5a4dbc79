"""Impedance at the level of torques: is the tool the mass, damper and spring that were asked for, and does it stay passive?"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np

from hqp_rp.control._checks import TWIST_AXES
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios._contact import ContactArm
from hqp_rp.scenarios._interaction import PAPER, Case, Interaction
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse
from hqp_rp.scenarios.scenario import Step


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerTorqueImpedance(SawyerPushResponse):
    """`sawyer_push_response` with the torque loop: (47) before integration, as accelerations of two levels, by
    inverse dynamics.

    A wrench pushes the tool for half of the time and lets go; the ideal is the law itself, as there. Also measured:

        "energy [J]": of the law at the arm's own deviation and twist, e'^T M_d e' / 2 + e^T K_d e / 2, all six axes;
        "energy gained [J]": by how much it has risen above its smallest value since the push ended, 0 before: the free
            response of a passive law never gains;
        "work [J]": done by the push since the start.

    Each family of solvers answers the same problem: null-space and reverse priority, operational space and the projected
    torques among them; `metric="inertia"` states it in the inertia, which the last two are made for.

    Args: as of `SawyerPushResponse` and `Interaction`, with inner_loop="torque".
    """

    name: ClassVar[str] = "sawyer_torque_impedance"
    question: ClassVar[str] = (
        "With torques in the place of velocity servos: is the tool the mass, damper and spring that were asked for, and does "
        "its free response stay passive?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "The model in the controller is the simulated one: no error of inertia, friction or gravity, and the torque is what is "
        "commanded. On a real arm these decide.",
        "The push and the force reading are exact, but for the noise of seeds other than 0; it is compensated as read.",
        "The push is a step of all six components; other shapes weigh frequencies differently.",
        "No limit is in the problem: closed forms take part.",
    )

    inner_loop: str = "torque"
    metric: str = "inertia"
    period: float = 0.001
    substeps: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner_loop != "torque":
            raise SettingError(
                f"inner_loop of {self.name} is {self.inner_loop!r}; it must be torque: sawyer_push_response has the other."
            )

    def cases(self) -> tuple[Case, ...]:
        """The paper's numbers at both starts: without a wall the other gains are the same."""
        return tuple(case for case in super().cases() if case.gains == PAPER)

    def quick(self) -> Self:
        """A sixth of the duration."""
        return dataclasses.replace(self, duration=max(self.duration / 6.0, 2.0 * self.period))

    def run_case(self, case: Case, contact: ContactArm, solver: Solver, seed: int) -> Iterator[Step]:
        gains = self.gains(case, "")
        law = AdmittanceLaw(6, gains.M_d, gains.B_d, gains.K_d)
        half, least, work = 0.5 * self.periods() * self.period, np.inf, 0.0
        robot, data = contact.robot, contact.robot.data
        for step in Interaction.run_case(self, case, contact, solver, seed):
            if not step.measured:  # the solver refuses: nothing has moved
                yield step
                return
            twist = robot.jacobian("tool") @ data.qvel
            deviation: FloatArray = np.array([step.measured[f"deviation {axis}"] for axis in TWIST_AXES])
            energy = law.energy(deviation, twist)
            work += self.period * float(self.push(step.parameter) @ twist)
            gained = 0.0
            if step.parameter >= half:
                least = min(least, energy)
                gained = energy - least
            more = {"energy [J]": energy, "energy gained [J]": gained, "work [J]": work}
            yield dataclasses.replace(step, measured={**step.measured, **more})
