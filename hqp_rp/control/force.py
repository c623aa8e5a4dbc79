"""Force control: a reference that moves until the contact force is the desired one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, WORLD
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.control.reference import Feedback, Reference
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class ForceReference(Reference):
    """Track a contact force: `M_d X'' + B_d X' = F_d - F_e`, integrated; the level's rate is X'.

    F_e is the force that the robot exerts on its environment and F_d what it should be, both along the chosen axes: in
    contact at rest F_e = F_d, and in free space the robot moves along F_d until it meets something, at the speed
    B_d^-1 F_d in the end. With one such reference at each of two levels, "reverse priority" gives the paper's (42), and any
    other solver its classical counterpart; more levels, or other tasks among them, need nothing else. State, integration,
    anti-windup and start are those of `Reference`.

    Against an environment of stiffness K_e the law's own motion is that of (37) without M_e and B_e: its damping ratio is
    B_d / (2 sqrt(M_d K_e)). The paper's M_d = 15 kg, B_d = 150 N s/m on 1e5 N/m have 0.06.

    Args:
        frame: name of the frame; forces are taken at its origin.
        M_d: inertia, positive definite, kg and kg m^2: one number, (m,) numbers of a diagonal, or a matrix (m, m).
        B_d: damping, positive semidefinite, N s/m and N m s/rad, in the same ways.
        force: F_d in N and N m, along the axes: (m,), or one number for all.
        axes: any of "x", "y", "z", "rx", "ry", "rz", in the order the rows shall have.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        feedback: which velocity is damped, "measured" or "commanded"; see `Reference`.
        recovery: s, >= 0, time constant of the anti-windup; None for none.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> force".

    `force` may be set at every step.

    Raises:
        SettingError: M_d or B_d that is not symmetric positive (semi)definite; a value of the wrong shape, not finite or
            out of its range; an axis that does not exist.

    Source: equations (35)-(42) of the paper.
    """

    __slots__ = ("_force", "_zero")

    def __init__(
        self,
        frame: str,
        M_d: ArrayLike,
        B_d: ArrayLike,
        force: ArrayLike = 0.0,
        *,
        axes: str | Sequence[str] = TWIST_AXES,
        expressed_in: str = WORLD,
        feedback: Feedback = "measured",
        recovery: float | None = 0.05,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        super().__init__(
            frame,
            "force",
            axes=axes,
            expressed_in=expressed_in,
            feedback=feedback,
            recovery=recovery,
            weight=weight,
            name=name,
        )
        self._law = AdmittanceLaw(self.size, M_d, B_d, owner=repr(self.name))
        self._zero = np.zeros(self.size)
        self.force = force

    @property
    def force(self) -> FloatArray:
        """(m,) F_d, N and N m along the axes: what the robot shall exert on its environment."""
        return self._force

    @force.setter
    def force(self, value: ArrayLike) -> None:
        self._force = self._vector(value, "the force")

    def _terms(self, robot: Robot, contact: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        zero = self._zero
        return self._force - contact, zero, zero, zero
