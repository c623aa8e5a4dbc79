"""Joints that follow others: what a model says with `<mimic>` or a joint `<equality>`, as rows."""

from __future__ import annotations

import numpy as np

from hqp_rp.control._checks import joint_indices
from hqp_rp.control._coordinates import plain_coordinates
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.coupling import Coupling
from hqp_rp.robot.robot import Robot


class JointCoupling:
    """`v_j - p'(q_s - s_0) v_s = -gain * (q_j - j_0 - p(q_s - s_0))` for every joint j that follows a joint s by p.

    p is a polynomial. The right-hand side takes out what the configuration has drifted by, or starts with.

    Args:
        couplings: what to hold; None means all that the robot's model states (`robot.couplings`).
        gain: 1/s, >= 0.
        name: default "joint coupling".

    Raises:
        SettingError: a gain out of its range.
        RobotError: when it meets a robot without couplings, or without such joints.
    """

    __slots__ = ("_bound", "_couplings", "_gain", "_name", "_resolved")

    def __init__(
        self, couplings: tuple[Coupling, ...] | None = None, *, gain: float = 1.0, name: str = "joint coupling"
    ) -> None:
        if not isinstance(gain, int | float) or not 0.0 <= gain < np.inf:
            raise SettingError(f"the gain of {name!r} is {gain!r}; it must be a finite number >= 0, in 1/s.")
        self._name, self._gain, self._couplings = name, float(gain), couplings
        self._bound: Robot | None = None
        self._resolved: list[tuple[int, int, int, int, Coupling]] = []

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One equality row for each coupling: G (m, nv), lower (m,) = upper (m,), rad/s or m/s; dt and v are not needed."""
        if robot is not self._bound:
            self._bind(robot)
        G, rhs = np.zeros((len(self._resolved), robot.nv)), np.zeros(len(self._resolved))
        q = robot.q
        for i, (own, own_q, source, source_q, coupling) in enumerate(self._resolved):
            s = q[source_q] - coupling.reference if source >= 0 else 0.0
            powers = s ** np.arange(len(coupling.coefficients))
            G[i, own] = 1.0
            if source >= 0:
                slopes = np.arange(1, len(coupling.coefficients)) * coupling.coefficients[1:]
                G[i, source] = -float(slopes @ powers[:-1])
            rhs[i] = -self._gain * (q[own_q] - coupling.own - float(np.dot(coupling.coefficients, powers)))
        return G, rhs, rhs

    def row_names(self, robot: Robot) -> list[str]:
        """Who follows whom."""
        return [f"{coupling.joint} after {coupling.source}" for *_, coupling in self._resolved]

    def _bind(self, robot: Robot) -> None:
        owner = f"limit {self._name!r}"
        couplings = getattr(robot, "couplings", ()) if self._couplings is None else self._couplings
        if not couplings:
            raise RobotError(f"{owner}: the robot's model couples no joints; leave the limit out, or give couplings.")
        coordinates, resolved = plain_coordinates(robot), []
        for coupling in couplings:
            own = int(joint_indices(robot, [coupling.joint], owner)[0])
            source = -1 if coupling.source is None else int(joint_indices(robot, [coupling.source], owner)[0])
            resolved.append((own, int(coordinates[own]), source, int(coordinates[source]), coupling))
        self._resolved, self._bound = resolved, robot

    def __repr__(self) -> str:
        return f"JointCoupling({self._name!r})"
