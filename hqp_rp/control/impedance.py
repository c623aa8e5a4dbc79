"""Impedance control: a reference that follows a motion and yields to contact like a mass with damper and spring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import ANGULAR_AXES, TWIST_AXES, WORLD, finite_vector, pose
from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.control.reference import Feedback, Reference
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class ImpedanceReference(Reference):
    """Follow a motion, softly: `M_d (X'' - X_d'') + B_d (X' - X_d') + K_d (X - X_d) = -F_e`; the level's rate is X'.

    F_e is the force that the robot exerts on its environment. With one such reference at each of two levels, "reverse
    priority" gives the paper's (47), read with J_1 J_2^+ in front of the second integral, as (30) has it. State, integration,
    anti-windup and start are those of `Reference`; between two steps X_d'' is held, so X_d moves on a parabola.

    The deviation X - X_d is, along the chosen axes, p - p* of the frame's origin and log(R R*^T), the rotation vector that
    takes the target to the frame; on rotational axes X' is the angular velocity. The free response (X_d at rest, F_e = 0)
    never gains energy where the robot has the velocity it is sent: on linear axes exactly; on all three rotational axes
    with one stiffness, M_d a multiple of the identity and world axes, exactly for the continuous law however large the
    angle, because d(|e|^2)/dt = 2 e^T omega; for other rotational K_d or moving axes, for small angles. The deviation
    jumps where the angle is pi: keep targets less than half a turn away.

    Args:
        frame: name of the frame.
        target: X_d: (R*, p*) as `robot.pose` returns it (R* may be a quaternion (w, x, y, z); p* (3,) in m), a homogeneous
            matrix (4, 4) from target to world, or p* alone when no rotational axis is chosen.
        M_d: inertia, positive definite, kg and kg m^2: one number, (m,) numbers of a diagonal, or a matrix (m, m).
        B_d: damping, positive semidefinite, N s/m and N m s/rad, in the same ways.
        K_d: stiffness, positive semidefinite, N/m and N m/rad, in the same ways.
        axes: any of "x", "y", "z", "rx", "ry", "rz", in the order the rows shall have.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        target_velocity: (6,) X_d' in world axes, m/s of the target's origin, then rad/s; None means 0.
        target_acceleration: (6,) X_d'' in world axes, m/s^2, then rad/s^2; None means 0.
        feedback: which velocity is damped, "measured" or "commanded"; see `Reference`.
        recovery: s, >= 0, time constant of the anti-windup; None for none.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> impedance".

    `target`, `target_velocity` and `target_acceleration` may be set at every step.

    Raises:
        SettingError: M_d, B_d or K_d that is not symmetric positive (semi)definite; a value of the wrong shape, not
            finite or out of its range; a target that is no pose; an axis that does not exist.

    Source: equations (43)-(47) of the paper; Hogan 1985.
    """

    __slots__ = ("_acceleration", "_target", "_velocity")

    _kind = "impedance"

    def __init__(
        self,
        frame: str,
        target: tuple[ArrayLike, ArrayLike] | ArrayLike,
        M_d: ArrayLike,
        B_d: ArrayLike,
        K_d: ArrayLike,
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
            self._kind,
            axes=axes,
            expressed_in=expressed_in,
            feedback=feedback,
            recovery=recovery,
            weight=weight,
            name=name,
        )
        self._law = AdmittanceLaw(self.size, M_d, B_d, K_d, owner=repr(self.name))
        self.target = target
        self.target_velocity = target_velocity
        self.target_acceleration = target_acceleration

    @property
    def target(self) -> tuple[FloatArray, FloatArray]:
        """(R* (3, 3), p* (3,) in m); whatever the constructor takes may be assigned."""
        return self._target

    @target.setter
    def target(self, value: tuple[ArrayLike, ArrayLike] | ArrayLike) -> None:
        what = f"the target of {self.name!r}"
        if not (isinstance(value, tuple | list) and len(value) == 2) and np.shape(value) == (3,):
            turning = [axis for axis in self._axes if axis in ANGULAR_AXES]
            if turning:
                raise SettingError(f"{what} is a position, and {turning} are chosen too; give a pose (R, p).")
            value = (np.eye(3), value)
        self._target = pose(value, what)

    @property
    def target_velocity(self) -> FloatArray | None:
        """(6,) X_d' in world axes, m/s and rad/s, or None for a target at rest."""
        return self._velocity

    @target_velocity.setter
    def target_velocity(self, value: ArrayLike | None) -> None:
        what = f"the target_velocity of {self.name!r}"
        self._velocity = None if value is None else finite_vector(value, 6, what, "m/s and rad/s")

    @property
    def target_acceleration(self) -> FloatArray | None:
        """(6,) X_d'' in world axes, m/s^2 and rad/s^2, or None for 0."""
        return self._acceleration

    @target_acceleration.setter
    def target_acceleration(self, value: ArrayLike | None) -> None:
        what = f"the target_acceleration of {self.name!r}"
        self._acceleration = None if value is None else finite_vector(value, 6, what, "m/s^2 and rad/s^2")

    def deviation(self, robot: Robot) -> FloatArray:
        """(m,) X - X_d along the axes, in m and rad: actual minus desired."""
        R, p = (np.eye(3), np.zeros(3)) if self._frame == WORLD else robot.pose(self._frame)
        R_target, p_target = self._target
        both = np.empty(6)
        both[:3] = p - p_target
        both[3:] = rotation_log(R.dot(R_target.T))
        return self._along(robot, both)

    def energy(self, robot: Robot) -> float:
        """Kinetic and spring energy of the law at the present deviation and at V - X_d', in J."""
        return self._law.energy(self.deviation(robot), self._V - self._desired(robot, self._velocity))

    def _desired(self, robot: Robot, vector: FloatArray | None) -> FloatArray:
        return np.zeros(self.size) if vector is None else self._along(robot, vector)

    def _terms(self, robot: Robot, contact: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        velocity, acceleration = (self._desired(robot, vector) for vector in (self._velocity, self._acceleration))
        return -contact, self.deviation(robot), velocity, acceleration
