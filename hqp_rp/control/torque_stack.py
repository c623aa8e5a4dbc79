"""Inverse dynamics as a prioritized problem: accelerations and contact forces, with torques within their limits."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import checked_motion, positive_number
from hqp_rp.control._refusal import outline
from hqp_rp.control._stack_metric import MetricOnRobot, StackMetric
from hqp_rp.control._stack_warnings import at_once, at_once_on, warn_of_brakes
from hqp_rp.control._torque_rows import TorqueRows
from hqp_rp.control.acceleration_stack import AccelerationStack
from hqp_rp.control.contact import Contact
from hqp_rp.control.contact_force_task import ContactForceTask
from hqp_rp.control.inverse_dynamics import InverseDynamics
from hqp_rp.control.limit import PerJoint, checked_per_joint
from hqp_rp.control.torque_task import TorqueTask
from hqp_rp.core.damping import LevelDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.row_names import ROW_NAMES
from hqp_rp.robot.robot import Robot

_DYNAMICS = "inverse dynamics"
CONTACTS = "contacts"
_FORCES = (ContactForceTask, TorqueTask)


class TorqueStack:
    """Levels of tasks for a robot that is commanded by torques: inverse dynamics with contacts, as a prioritized problem.

    The unknown is x = (v-dot (nv,), f / force_unit), f the forces of all contacts' points; the torques are eliminated::

        M v-dot + h = S^T tau + J_c^T f            equation of motion; S picks the driven velocities

    Hard rows, in this order: the equation of motion of the velocities that are not driven (a floating base, an object that is
    held); |tau| <= torque of the driven ones; friction and unilateral contact at each point (`Contact`); and `limits`, which
    bound the velocity after the step as in `AccelerationStack`, joint positions, velocities and accelerations in a box that is
    never empty. The first level, "contacts", is the motion of the contacts; then come those that are given. Any solver that
    takes hard rows solves it::

        stack = TorqueStack([com, hand, [posture, even]], [JointLimit(acceleration={"*": 50.0})], contacts=[left, right])
        robot.update(q)
        problem = stack.problem(robot, dt, v)
        x = hqp_rp.solve(problem, "hierarchical_active_set").require()
        tau = stack.dynamics(problem).torque(x)

    `TorqueController` does this at every step, and has a torque when no answer comes.

    Contacts are the first level and not hard rows, since a contact may be asked for what limits and friction do not allow, as
    after an impact: then it moves as little as possible. Limits on positions and torques are both hard: where the torque at
    hand cannot stop a joint in time they contradict each other, and the solver says INFEASIBLE. Give `JointLimit` an
    acceleration that the torques can deliver, or list it as the first level.

    Args:
        levels: one entry for each level, most important first: a task, or a sequence of tasks whose rows are
            stacked. Everything that `AccelerationStack` takes, and `ContactForceTask` and `TorqueTask`.
        limits: hard, as in `AccelerationStack`.
        contacts: every `Contact` that there may be; one that is open has `activation` 0.
        torque: N m or N, > 0: one number, (nv,) numbers or a mapping by joint name or pattern; None takes the robot's own
            `effort_limit`. Infinite for none.
        driven: names or patterns of the driven joints; None means all but free joints and what the robot lists as
            `unactuated`.
        names, damping: one for each of `levels`, as in `AccelerationStack`. A damped level is damped in x: forces in
            force_unit.
        metric: as in `Stack`, of v-dot; forces in force_unit keep the plain norm.
        force_unit: N, > 0: what counts as much as 1 rad/s^2 in the least norm of x, and in damping. Levels that determine x,
            such as a posture and evenly shared forces, leave it nothing to decide.
        kd: 1/s, > 0, of tasks that state a velocity alone, those of mink and pink among them, as in `AccelerationStack`: the
            gain of a task of mink or pink should be at most kd dt / 4, and a greater one is warned of.

    Raises:
        SettingError: an item that is none of these, a force task on a contact that is not among `contacts`, or a value out of
            its range.

    Warns:
        UserWarning: torque limits beside a hard `JointLimit` without an acceleration, which asks for stops within one step;
            once, when the stack is made, or where the limits are the model's own when it first meets the robot.

    Source: Saab, Ramos, Keith, Mansard, Soueres and Fourquet 2013; Herzog et al. 2016 for eliminating the torques.
    """

    def __init__(
        self,
        levels: Sequence[Any],
        limits: Sequence[Any] = (),
        *,
        contacts: Sequence[Contact] = (),
        torque: PerJoint = None,
        driven: Sequence[str] | None = None,
        names: Sequence[str] | None = None,
        damping: LevelDamping | Sequence[LevelDamping | None] | None = None,
        metric: StackMetric = None,
        force_unit: float = 100.0,
        kd: float = 20.0,
    ) -> None:
        if not isinstance(levels, list | tuple) or not levels:
            raise SettingError(f"levels is {levels!r}; give a list with at least one level, most important first.")
        if not isinstance(contacts, list | tuple) or not all(isinstance(contact, Contact) for contact in contacts):
            raise SettingError(f"contacts is {contacts!r}; give a list of Contact, empty for none.")
        if len({id(contact) for contact in contacts}) < len(contacts):
            raise SettingError("contacts holds the same Contact twice; give each once.")
        self._contacts = tuple(contacts)
        self._levels = tuple(tuple(level) if isinstance(level, list | tuple) else (level,) for level in levels)
        own = {id(contact) for contact in contacts}
        self._force_items: list[tuple[int, ContactForceTask | TorqueTask]] = []
        motion, self._motion_levels = [], []
        for k, level in enumerate(self._levels):
            if not level:
                raise SettingError(f"level {k + 1} is empty; give it at least one task, or leave the level out.")
            forces = [item for item in level if isinstance(item, _FORCES)]
            for item in forces:
                self._force_items.append((k, item))
                for contact in item.contacts if isinstance(item, ContactForceTask) else ():
                    if id(contact) not in own:
                        raise SettingError(
                            f"level {k + 1}: {item.name!r} is about {contact.name!r}, which is not among the stack's contacts."
                        )
            others = [item for item in level if not isinstance(item, _FORCES)]
            if others:
                motion.append(others)
                self._motion_levels.append(k)
        if not motion:
            raise SettingError("levels holds no task on the motion; give at least a PostureTask.")
        policies: list[Any] = list(damping) if isinstance(damping, list | tuple) else [damping] * len(self._levels)
        if len(policies) != len(self._levels):
            raise SettingError(
                f"damping has {len(policies)} entries for {len(self._levels)} levels; give one policy or None for each, or one "
                "for all."
            )
        self._motion = AccelerationStack(motion, limits, damping=[policies[k] for k in self._motion_levels], kd=kd)
        for k in range(len(self._levels)):
            if policies[k] is not None and k not in self._motion_levels:
                raise SettingError(f"level {k + 1} holds forces alone, which need no damping; give None for it.")
        self._damping = tuple(policies)
        self._metric = MetricOnRobot(metric)
        self._names = self._level_names(names)
        self._all_names = (CONTACTS, *self._names) if self._contacts else self._names
        self._torque = checked_per_joint(torque, "torque")
        self._driven_names = None if driven is None else tuple(driven)
        self._force_unit = positive_number(force_unit, "force_unit")
        self._warned = False
        unbraked = at_once(self._motion.limits) if self._torque_is_bounded else None
        if unbraked is not None:
            warn_of_brakes(unbraked)
            self._warned = True
        self._on: TorqueRows | None = None

    def _level_names(self, names: Sequence[str] | None) -> tuple[str, ...]:
        if names is None:
            # Tasks of mink and pink are named by their adapters.
            given = [item for k in self._motion_levels for item in self._levels[k] if not isinstance(item, _FORCES)]
            names_of = {id(item): own.name for item, (_, own) in zip(given, self._motion._items, strict=True)}
            return tuple(
                " + ".join(str(names_of.get(id(item)) or item.name) for item in level) for level in self._levels
            )
        if isinstance(names, str) or len(names) != len(self._levels):
            raise SettingError(f"names is {names!r}; give one name for each of the {len(self._levels)} levels.")
        return tuple(str(name) for name in names)

    @property
    def levels(self) -> tuple[tuple[Any, ...], ...]:
        """The items of each level as they were given."""
        return self._levels

    @property
    def limits(self) -> tuple[Any, ...]:
        """The hard limits as they were given."""
        return self._motion.limits

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts as they were given."""
        return self._contacts

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each level of a problem: "contacts" first where there are contacts."""
        return self._all_names

    def problem(
        self, robot: Robot, dt: float, v: ArrayLike, a: ArrayLike | None = None, *, applied: ArrayLike | None = None
    ) -> Problem:
        """The prioritized problem at the robot's current configuration and velocity.

        Args:
            robot: at its current configuration; `robot.update(q)` sets it. It needs the methods of dynamics that `MujocoRobot`
                and `PinocchioRobot` have.
            dt: > 0, s, for how long the torques will be held; limits look ahead by it.
            v: (nv,) velocity, rad/s or m/s. a: (nv,) acceleration before this step; for limits on jerks only.
            applied: (nv,) N m or N, generalized forces that are known to act beside torques and contacts, such as J^T of a
                measured wrench on the robot, or friction: M v-dot + h = S^T tau + J_c^T f + applied. None for none.

        Raises:
            SettingError: dt, v or a missing or out of range.
            RobotError: a frame or joint that the robot does not have; a robot without the methods of dynamics.
            ProblemError: rows that are not finite; it names the level and the item.
        """
        motion = self._motion
        rows = motion._rows
        if rows is None or rows.robot is not robot:
            rows = motion._meet(robot)
        if v is None:
            raise SettingError("torques need the velocity: problem(robot, dt, v); zeros for a robot at rest.")
        if type(dt) is not float or dt != motion._dt:
            dt = motion._checked_dt(dt)
        velocity = checked_motion(v, robot, "v", "rad/s or m/s")
        given, given_lower, given_upper, policies = motion._filled(rows, robot, dt, velocity, a)
        on = self._on
        if on is None or on.robot is not robot:
            on = self._meet(robot)
        offsets = motion._offsets
        if on.read(velocity, offsets):
            on.lay_out(offsets, self._motion_levels, len(self._levels), self._force_items, motion._hard, rows.counts)
        matrix, lower, upper, dynamics = on.fill(velocity, applied, given, given_lower, given_upper)
        return Problem.from_rows(
            matrix,
            lower,
            upper,
            on.offsets,
            self._all_names,
            on.hard_rows,
            not motion._two_sided,
            None if policies is None else self._policies(policies),
            None if self._metric.stated is None else self._metric_on(on),
            {_DYNAMICS: dynamics, ROW_NAMES: on.hard_names},
        )

    @property
    def _torque_is_bounded(self) -> bool:
        """Whether a torque limit was given; the model's own are known on the robot only."""
        given = list(self._torque.values()) if isinstance(self._torque, dict) else self._torque
        return given is not None and bool(np.isfinite(given).any())

    def _outline(self, n: int) -> Problem:
        """What is known of every problem of this stack before there is a robot, as a problem of n unknowns."""
        bounded = self._torque_is_bounded
        limits = self._motion._hard
        names = (
            ["joint torque"] if bounded else [c.name for c in self._contacts] or [str(item.name) for _, item in limits]
        )
        return outline(
            n,
            self._all_names,
            two_sided=self._motion._two_sided,
            hard=names[0] if names else "",
            wide=bounded or any(contact.cone == "pyramid" for contact in self._contacts),
            damping=self._policies(self._motion.damping),
            metric=self._metric.kind,
        )

    def dynamics(self, problem: Problem) -> InverseDynamics:
        """How answers to a problem of this class become torques. Raises `SettingError` for any other problem."""
        found = (problem.kept or {}).get(_DYNAMICS)
        if not isinstance(found, InverseDynamics):
            raise SettingError(
                "this problem was not made by TorqueStack.problem, or was copied; take the one it returned."
            )
        return found

    def holding_torque(self, robot: Robot, v: ArrayLike, braking: float) -> FloatArray:
        """(d,) what compensates gravity and brakes, within the limits; always finite, whatever v is.

        ::

            tau = S (g - J_c^T f - braking diag(M) v)      f: least squares of what carries the passive velocities, f_z >= 0
        """
        on = self._on
        if on is None or on.robot is not robot:
            on = self._meet(robot)
        velocity = np.zeros(robot.nv)
        with contextlib.suppress(TypeError, ValueError):
            given = np.asarray(v, dtype=np.float64)
            velocity = np.where(np.isfinite(given), given, 0.0) if given.shape == velocity.shape else velocity
        return on.holding_torque(velocity, braking)

    def _metric_on(self, on: TorqueRows) -> FloatArray:
        nv = on.robot.nv
        whole = np.eye(nv + on.contacts.forces)
        whole[:nv, :nv] = on.mass_matrix if isinstance(self._metric.stated, str) else self._metric.on(on.robot)
        return whole

    def _policies(self, motion: Sequence[LevelDamping | None]) -> tuple[LevelDamping | None, ...]:
        policies: list[LevelDamping | None] = [None] * len(self._levels)
        for k, policy in zip(self._motion_levels, motion, strict=True):
            policies[k] = policy
        return (None, *policies) if self._contacts else tuple(policies)

    def _meet(self, robot: Robot) -> TorqueRows:
        """What makes the rows on this robot."""
        on = TorqueRows(robot, self._contacts, self._driven_names, self._torque, self._force_unit)
        found = None if self._warned else at_once_on(self._motion.limits, robot, on.limited)
        if found is not None:
            warn_of_brakes(*found)
            self._warned = True
        self._on = on
        return on

    def __reduce__(self) -> tuple[Any, ...]:
        arguments = {
            "contacts": self._contacts,
            "torque": self._torque,
            "driven": self._driven_names,
            "names": self._names,
            "damping": list(self._damping),
            "metric": self._metric.stated,
            "force_unit": self._force_unit,
            "kd": self._motion._kd,
        }
        return _rebuilt, (self._levels, self._motion.limits, arguments)

    def __repr__(self) -> str:
        contacts = f", {len(self._contacts)} contacts" if self._contacts else ""
        return f"TorqueStack({' > '.join(self.names)}{contacts})"


def _rebuilt(levels: Sequence[Any], limits: Sequence[Any], arguments: dict[str, Any]) -> TorqueStack:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # said where the stack was made
        return TorqueStack(levels, limits, **arguments)
