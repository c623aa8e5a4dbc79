"""Hybrid impedance control: impedance along some axes, force along the others, in one level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, WORLD, real_array
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.control.impedance import ImpedanceReference
from hqp_rp.control.reference import Feedback
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

PROJECTOR_TOLERANCE = 1e-9
"""How far S - S^T and S - S^2 may be from zero, and S K_d - K_d S relative to the largest entry of K_d."""


class HybridReference(ImpedanceReference):
    """Impedance where S selects, force elsewhere: `M_d D'' + B_d D' + K_d S D = (I - S) F_d - F_e` with D = X - X_d.

    The level's rate is X' = X_d' + D'. Along an axis with S = 1 it is the law of `ImpedanceReference`, along one with
    S = 0 that of `ForceReference` moved along with X_d: give X_d' = 0 there, or the speed of approach. F_e is the force
    that the robot exerts on its environment. With one such reference at each level, "reverse priority" gives the paper's
    (52) and, for N levels, what (53) stands for. State, integration, anti-windup and start are those of `Reference`.

    S must be an orthogonal projector (S = S^T = S^2; mostly a diagonal of 0 and 1), and K_d must not couple what S selects
    with what it does not (S K_d = K_d S). Otherwise the spring K_d S of (48) would not be symmetric, would have no energy,
    and could drive the motion on its own.

    Args:
        frame: name of the frame.
        target: X_d, as in `ImpedanceReference`.
        M_d, B_d, K_d: inertia, damping and stiffness, as in `ImpedanceReference`.
        selection: S: (m,) numbers 0 (force) or 1 (position), or a projector (m, m) along the axes.
        force: F_d in N and N m, along the axes: (m,), or one number for all. What S selects is ignored.
        axes, expressed_in, target_velocity, target_acceleration, feedback, recovery, weight: as in `ImpedanceReference`.
        name: default "<frame> hybrid".

    `selection`, `force`, `target`, `target_velocity` and `target_acceleration` may be set at every step; V is kept when S
    changes, so the rate does not jump.

    Raises:
        SettingError: as `ImpedanceReference`; an S that is no projector or that K_d couples.

    Source: equations (48)-(53) of the paper; Raibert and Craig 1981 for S; Anderson and Spong 1988.
    """

    __slots__ = ("_B_d", "_K_d", "_M_d", "_S", "_force")

    _kind = "hybrid"

    def __init__(
        self,
        frame: str,
        target: tuple[ArrayLike, ArrayLike] | ArrayLike,
        M_d: ArrayLike,
        B_d: ArrayLike,
        K_d: ArrayLike,
        selection: ArrayLike,
        force: ArrayLike = 0.0,
        *,
        axes: str | Sequence[str] = TWIST_AXES,
        expressed_in: str = WORLD,
        target_velocity: ArrayLike | None = None,
        target_acceleration: ArrayLike | None = None,
        feedback: Feedback = "measured",
        recovery: float | None = 0.05,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        super().__init__(
            frame,
            target,
            M_d,
            B_d,
            K_d,
            axes=axes,
            expressed_in=expressed_in,
            target_velocity=target_velocity,
            target_acceleration=target_acceleration,
            feedback=feedback,
            recovery=recovery,
            weight=weight,
            name=name,
        )
        self._M_d, self._B_d, self._K_d = self._law.inertia, self._law.damping, self._law.stiffness
        self.selection = selection
        self.force = force

    @property
    def selection(self) -> FloatArray:
        """(m, m) S, read-only: 1 where position is controlled, 0 where force is; (m,) numbers may be assigned."""
        return self._S

    @selection.setter
    def selection(self, value: ArrayLike) -> None:
        what = f"the selection of {self.name!r}"
        array = real_array(value, what)
        m = self.size
        if array.shape not in ((m,), (m, m)):
            raise SettingError(
                f"{what} has shape {array.shape}; give {m} numbers 0 (force) or 1 (position), or a projector ({m}, {m})."
            )
        S = np.diag(array) if array.ndim == 1 else array
        # A NaN fails the comparison as well.
        if not max(np.abs(S - S.T).max(), np.abs(S @ S - S).max()) <= PROJECTOR_TOLERANCE:
            raise SettingError(
                f"{what} is {array.tolist()}; it must be an orthogonal projector, S = S^T = S^2: 1 where position is "
                "controlled and 0 where force is. To share an axis between the two, use the stiffness."
            )
        K = self._K_d
        coupling = np.abs(S @ K - K @ S).max()
        if coupling > PROJECTOR_TOLERANCE * np.abs(K).max():
            raise SettingError(
                f"{what} does not go with K_d: K_d couples position-controlled with force-controlled directions by "
                f"{coupling:g}, so that K_d S is not symmetric. Set those entries of K_d to 0."
            )
        S.flags.writeable = False
        self._S = S
        # Equal to K_d S, and positive semidefinite in rounded arithmetic as well.
        self._law = AdmittanceLaw(m, self._M_d, self._B_d, S @ K @ S, owner=repr(self.name))

    @property
    def force(self) -> FloatArray:
        """(m,) F_d, N and N m along the axes: what the robot shall exert on its environment where S is 0."""
        return self._force

    @force.setter
    def force(self, value: ArrayLike) -> None:
        self._force = self._vector(value, "the force")

    def _terms(self, robot: Robot, contact: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        spring, deviation, velocity, acceleration = super()._terms(robot, contact)
        return spring + self._force - self._S @ self._force, deviation, velocity, acceleration
