"""Joints that follow others: what a model says with `<mimic>` or a joint `<equality>`, as rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hqp_rp.control._checks import joint_indices
from hqp_rp.control._coordinates import plain_coordinates
from hqp_rp.control._row_names import velocity_units
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.coupling import Coupling
from hqp_rp.robot.robot import Robot


class JointCoupling:
    """`v_j - p'(q_s - s_0) v_s = -gain * (q_j - j_0 - p(q_s - s_0))` for every joint j that follows a joint s by p.

    p is a polynomial. The right-hand side takes out what the configuration has drifted by, or starts with, in no less than
    one step; joints that are both locked while they are apart contradict it. A joint whose position is no coordinate of
    q (a continuous joint in Pinocchio) has a straight p, and 0 on the right.

    Args:
        couplings: what to hold, each a `hqp_rp.robot.Coupling` or a mapping of its fields; None means all that the robot's
            model states (`robot.couplings`).
        gain: 1/s, >= 0; 0 holds the velocities only.
        name: default "joint coupling".

    Raises:
        SettingError: a gain out of its range, or something that is no coupling.
        RobotError: when it meets a robot without couplings, or without such joints.
    """

    __slots__ = ("_bound", "_couplings", "_gain", "_name", "_resolved")

    def __init__(
        self,
        couplings: Sequence[Coupling | Mapping[str, Any]] | None = None,
        *,
        gain: float = 1.0,
        name: str = "joint coupling",
    ) -> None:
        if isinstance(gain, bool) or not isinstance(gain, int | float) or not 0.0 <= gain < np.inf:
            raise SettingError(f"the gain of {name!r} is {gain!r}; it must be a finite number >= 0, in 1/s.")
        self._name, self._gain = name, float(gain)
        self._couplings = None if couplings is None else _checked(couplings, name)
        self._bound: Robot | None = None
        self._resolved: list[tuple[int, int, int, int, Coupling]] = []

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    @property
    def couplings(self) -> tuple[Coupling, ...] | None:
        """What it holds; None means all that the robot's model states."""
        return self._couplings

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One equality row for each coupling: G (m, nv), lower (m,) = upper (m,), rad/s or m/s; v is not needed."""
        if robot is not self._bound:
            self._bind(robot)
        G, rhs = np.zeros((len(self._resolved), robot.nv)), np.zeros(len(self._resolved))
        q, gain = robot.q, min(self._gain, 1.0 / dt)
        for i, (own, own_q, source, source_q, coupling) in enumerate(self._resolved):
            s = q[source_q] - coupling.reference if source_q >= 0 else 0.0
            powers = s ** np.arange(len(coupling.coefficients))
            G[i, own] = 1.0
            if source >= 0:
                slopes = np.arange(1, len(coupling.coefficients)) * coupling.coefficients[1:]
                G[i, source] = -float(slopes @ powers[:-1])
            if own_q >= 0 and (source < 0 or source_q >= 0):
                rhs[i] = -gain * (q[own_q] - coupling.own - float(np.dot(coupling.coefficients, powers)))
        return G, rhs, rhs

    def row_names(self, robot: Robot) -> list[str]:
        """Who follows whom."""
        if robot is not self._bound:
            self._bind(robot)
        return [f"{coupling.joint} after {coupling.source}" for *_, coupling in self._resolved]

    def row_units(self, robot: Robot) -> list[str]:
        """Of the joints that follow: rad/s, or m/s of what slides."""
        if robot is not self._bound:
            self._bind(robot)
        units = velocity_units(robot)
        return [units[own] for own, *_ in self._resolved]

    def _bind(self, robot: Robot) -> None:
        owner = f"limit {self._name!r}"
        couplings = getattr(robot, "couplings", ()) if self._couplings is None else self._couplings
        if not couplings:
            raise RobotError(f"{owner}: the robot's model couples no joints; leave the limit out, or give couplings.")
        coordinates, resolved = plain_coordinates(robot), []
        for coupling in couplings:
            own = int(joint_indices(robot, [coupling.joint], owner)[0])
            source = -1 if coupling.source is None else int(joint_indices(robot, [coupling.source], owner)[0])
            source_q = -1 if source < 0 else int(coordinates[source])
            if source >= 0 and source_q < 0 and any(coupling.coefficients[2:]):
                raise RobotError(
                    f"{owner}: {coupling.joint!r} follows {coupling.source!r} by a curve, but the position of the latter is no "
                    "coordinate of q in this library; give two coefficients (offset, multiplier)."
                )
            resolved.append((own, int(coordinates[own]), source, source_q, coupling))
        self._resolved, self._bound = resolved, robot

    def __repr__(self) -> str:
        return f"JointCoupling({self._name!r})"


def _checked(couplings: Any, name: str) -> tuple[Coupling, ...]:
    fields = [field.name for field in dataclasses.fields(Coupling)]
    given = list(couplings) if isinstance(couplings, list | tuple) else []
    if not given or not all(isinstance(coupling, Coupling | Mapping) for coupling in given):
        raise SettingError(
            f"the couplings of {name!r} are {couplings!r}; give Couplings, or mappings of {', '.join(fields)}."
        )
    for coupling in given:
        if isinstance(coupling, Mapping) and not {"joint", "coefficients"} <= set(coupling) <= set(fields):
            raise SettingError(
                f"the couplings of {name!r} hold {dict(coupling)!r}; it must have joint and coefficients, and may have source, "
                "own, reference."
            )
    return tuple(one if isinstance(one, Coupling) else Coupling(**{"source": None, **one}) for one in given)
