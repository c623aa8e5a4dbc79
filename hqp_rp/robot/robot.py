"""The robot protocols: what the rest of the library needs to know of a robot, whatever library computes it."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from hqp_rp.core.problem import FloatArray


@runtime_checkable
class Robot(Protocol):
    """A kinematic tree at a configuration. `update(q)` sets it; every other method speaks of that configuration.

    Velocities are (nv,) tangent vectors in the library's own convention for q (nq,); for arms of hinge and slide joints
    nq = nv and v = dq/dt. Lengths in m, angles in rad, masses in kg.

    Attributes:
        nq, nv: sizes of configuration and velocity.
        joint_names: names of the joints, in the order of v.
        frame_names: every frame that `pose` and `jacobian` take.
        lower, upper: (nv,) joint position limits by velocity index; infinite where there is none.
        velocity_limit: (nv,) largest |v|; infinite where there is none.
        neutral: (nq,) the model's own reference configuration.
    """

    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def frame_names(self) -> tuple[str, ...]: ...
    @property
    def lower(self) -> FloatArray: ...
    @property
    def upper(self) -> FloatArray: ...
    @property
    def velocity_limit(self) -> FloatArray: ...
    @property
    def neutral(self) -> FloatArray: ...
    @property
    def q(self) -> FloatArray:
        """(nq,) the configuration of the last `update`."""
        ...

    def update(self, q: FloatArray) -> None:
        """Set the configuration (nq,) and compute the kinematics. Raises `RobotError` on a wrong size or a NaN."""
        ...

    def pose(self, frame: str) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) from frame to world and origin (3,) of `frame` in the world."""
        ...

    def jacobian(self, frame: str) -> FloatArray:
        """(6, nv): linear velocity of the frame's origin over angular velocity, both in world axes, per unit v."""
        ...

    def center_of_mass(self) -> FloatArray:
        """(3,) centre of mass of the whole robot in the world."""
        ...

    def center_of_mass_jacobian(self) -> FloatArray:
        """(3, nv) velocity of the centre of mass in world axes, per unit v."""
        ...

    def mass_matrix(self) -> FloatArray:
        """(nv, nv) joint-space inertia matrix, rotor inertia (armature) included."""
        ...

    def gravity(self) -> FloatArray:
        """(nv,) generalized gravity torque g(q) in M(q) a + h(q, v) + g(q) = tau."""
        ...

    def integrate(self, q: FloatArray, v: FloatArray, dt: float) -> FloatArray:
        """(nq,) configuration reached from q by the constant velocity v during dt seconds."""
        ...

    def difference(self, q0: FloatArray, q1: FloatArray) -> FloatArray:
        """(nv,) velocity that leads from q0 to q1 in one second."""
        ...


@runtime_checkable
class DynamicRobot(Robot, Protocol):
    """What accelerations and torques need besides: `AccelerationStack` and `TorqueStack` ask for it when they first use it.

    v (nv,) and a = v-dot (nv,) are in the library's own convention: of a free joint, MuJoCo has the linear velocity in world
    axes and the angular one in body axes, Pinocchio both in body axes; v-dot is the rate of these numbers.

    Attributes:
        effort_limit: (nv,) the greatest |torque| that the model states of its motors, N m or N; infinite where none is stated.
    """

    @property
    def effort_limit(self) -> FloatArray: ...

    def bias(self, v: FloatArray) -> FloatArray:
        """(nv,) h(q, v) + g(q) in M(q) a + h(q, v) + g(q) = tau: Coriolis, centrifugal and gravity torques."""
        ...

    def inverse_dynamics(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """(nv,) tau = M(q) a + h(q, v) + g(q), armature included; no friction, damping, contacts or constraints."""
        ...

    def bias_acceleration(self, frame: str, v: FloatArray) -> FloatArray:
        """(6,) Jdot v: acceleration of the frame's origin over angular acceleration at v-dot = 0, without gravity."""
        ...

    def center_of_mass_bias_acceleration(self, v: FloatArray) -> FloatArray:
        """(3,) acceleration of the centre of mass at v-dot = 0, without gravity; of the same bodies as `center_of_mass`."""
        ...
