"""What a torque stack is on one robot: what is driven, where contacts are, and arrays that are written at every step."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.control._checks import check_frames, finite_vector, joint_indices
from hqp_rp.control._contact_rows import ContactRows
from hqp_rp.control._rows_in_words import torque_rows_in_words
from hqp_rp.control.contact import Contact
from hqp_rp.control.contact_force_task import ContactForceTask
from hqp_rp.control.inverse_dynamics import InverseDynamics
from hqp_rp.control.limit import per_joint
from hqp_rp.control.torque_task import TorqueTask
from hqp_rp.core import _native
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.dynamics import dynamics_reader
from hqp_rp.robot.robot import Robot


class TorqueRows:
    """The rows of a `TorqueStack` on one robot; arguments as of the stack.

    Attributes:
        robot: whose. driven (d,), passive, limited: velocity indices: with a torque, without (not what the robot does not
            move), and those of `driven` whose torque is limited. limit: (d,) N m or N.
        contacts: their rows. mass_matrix (nv, nv), bias (nv,): of the last `fill`.
        offsets: (p + 1,) where levels begin among their rows. hard_rows: how many are above them. hard_names: names those.
    """

    offsets: IntArray
    hard_rows: int
    hard_names: functools.partial[Any]

    def __init__(
        self,
        robot: Robot,
        contacts: Sequence[Contact],
        driven: Sequence[str] | None,
        torque: FloatArray | dict[str, float] | None,
        force_unit: float,
    ) -> None:
        missing = [name for name in ("bias", "bias_acceleration") if not hasattr(robot, name)]
        if missing:
            raise RobotError(
                f"a {type(robot).__name__} has no method {missing[0]}(), which inverse dynamics needs; use a MujocoRobot or a "
                "PinocchioRobot."
            )
        for contact in contacts:
            check_frames(robot, [contact.frame, contact.on], f"{contact.name!r}")
        self.robot, self._given, self._force_unit = robot, tuple(contacts), force_unit
        others = np.asarray(getattr(robot, "unactuated", ()), dtype=np.int64)
        self.driven = _driven(robot, driven, others)
        self.passive = np.setdiff1d(np.arange(robot.nv), [*self.driven.tolist(), *others.tolist()])
        own = getattr(robot, "effort_limit", None)
        default = np.full(robot.nv, math.inf) if own is None else own
        self.limit = per_joint(torque, default, robot, "torque")[self.driven]
        self.limited = self.driven[self.limit < math.inf]
        self.contacts = ContactRows(robot, contacts)
        if not contacts:
            self.contacts.arrays["jacobians"] = np.zeros((0, 6, robot.nv))
        # Written at every step; what a problem keeps of them is copied.
        self.mass_matrix, self.bias = np.empty((robot.nv, robot.nv)), np.empty(robot.nv)
        self._read_dynamics = dynamics_reader(robot)
        self._native = _native.TorqueRows(
            {
                **self.contacts.arrays,
                "mass_matrix": self.mass_matrix,
                "bias": self.bias,
                "passive": self.passive,
                "driven": self.driven,
                "limited": self.limited,
                "limit": self.limit[self.limit < math.inf],
            },
            self.contacts.forces,
            force_unit,
        )
        self._index_of = {id(c): span for c, span in zip(contacts, self.contacts.spans, strict=True)}
        self._laid_out: tuple[IntArray, IntArray] | None = None
        self._force_places: list[tuple[ContactForceTask | TorqueTask, slice]] = []

    def read(self, v: FloatArray, motion_offsets: tuple[IntArray, IntArray]) -> bool:
        """Bring the contacts up to date; whether rows must be laid out anew, for these offsets of the rows on accelerations."""
        changed = self.contacts.read(v)
        return changed or motion_offsets is not self._laid_out

    def lay_out(
        self,
        motion_offsets: tuple[IntArray, IntArray],
        motion_levels: Sequence[int],
        levels: int,
        force_items: Sequence[tuple[int, ContactForceTask | TorqueTask]],
        limits: Sequence[tuple[int, Any]],
        limit_counts: Sequence[int],
    ) -> None:
        """Say where all rows stand: hard ones, contacts, then each level's rows on accelerations and on forces.

        Args:
            motion_offsets: of the rows on accelerations: where their levels begin, without and with hard rows above them.
            motion_levels: which levels have such rows. levels: how many there are. force_items: level and task of each task
                on forces. limits, limit_counts: the hard items of the rows on accelerations, and how many rows each has.
        """
        # Of this robot and these rows, whatever the stack meets before somebody asks.
        hard = self.passive, self.limited, self._given, self._force_unit, limits, limit_counts
        self.hard_names = functools.partial(torque_rows_in_words, self.robot, *hard)
        ends, below = motion_offsets
        contacts, counts, hard_rows = self.contacts, np.diff(ends).tolist(), int(below[1])
        first = len(self.passive) + len(self.limited) + len(contacts.cones)
        places = list(range(first, first + hard_rows))
        self.hard_rows = at = first + hard_rows
        motion_place = at
        offsets = [0]
        if self._given:
            at += contacts.rows
            offsets.append(contacts.rows)
        own = dict(zip(motion_levels, counts, strict=True))
        self._force_places = []
        for k in range(levels):
            m = own.get(k, 0)
            places += range(at, at + m)
            at += m
            for level, item in force_items:
                if level == k:
                    m = item.size if isinstance(item, ContactForceTask) else len(self.driven)
                    self._force_places.append((item, slice(at, at + m)))
                    at += m
            offsets.append(at - self.hard_rows)
        self.offsets = np.array(offsets, dtype=np.int64)
        cones = contacts.cones, contacts.cone_lower, contacts.cone_upper
        self._native.place(*cones, np.array(places, dtype=np.int64), motion_place, at)
        self._degrees = np.ones(at - self.hard_rows)
        if self._given:
            self._degrees[: contacts.rows] = contacts.degrees
        self._kept_forces: dict[int, tuple[int, FloatArray, FloatArray]] = {}
        self._laid_out = motion_offsets

    def fill(
        self, v: FloatArray, applied: Any, given: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, InverseDynamics]:
        """Matrix, lower and upper of all rows, and how answers become torques.

        Args:
            v: (nv,) velocity. applied: as of `TorqueStack.problem`. given (m, nv), lower and upper (m,): rows on accelerations.
        """
        robot = self.robot
        self._read_dynamics(v, self.mass_matrix, self.bias)
        if applied is not None:
            self.bias -= finite_vector(applied, robot.nv, "applied", "N m or N")
        made = self._native.rows(given, lower, upper)
        if made is None:
            raise ProblemError(f"The mass matrix or the bias torque of {robot!r} is not finite at this q and v.")
        matrix, lower, upper, torque_map, offset, jacobian = made
        for item, place in self._force_places:
            A, b = self._force_rows(item, torque_map, offset)
            matrix[place] = A
            lower[place] = upper[place] = b
        degrees = self._degrees if self.contacts.fading else None
        dynamics = InverseDynamics(
            torque_map, offset, self.driven, self.limit, robot.nv, self._force_unit, jacobian, degrees
        )
        return matrix, lower, upper, dynamics

    def holding_torque(self, v: FloatArray, braking: float) -> FloatArray:
        """(d,) as `TorqueStack.holding_torque`, for a finite v (nv,)."""
        robot, contacts = self.robot, self.contacts
        torque = np.array(robot.gravity())
        if len(self.passive) and contacts.forces:
            if contacts.read(np.zeros(robot.nv)):
                self._laid_out = None  # the next problem lays its rows out anew
            jacobian = self._native.points()
            closed = np.concatenate([np.full(c.size, c.activation > 0.0) for c in self._given])
            carrying = jacobian[:, self.passive].T * closed
            forces = np.linalg.lstsq(carrying, torque[self.passive], rcond=1e-9)[0]
            forces[2::3] = np.maximum(forces[2::3], 0.0)
            torque -= jacobian.T @ forces
        torque -= braking * np.diag(robot.mass_matrix()) * v
        torque = torque[self.driven]
        cut = np.clip(np.where(np.isfinite(torque), torque, 0.0), -self.limit, self.limit)
        cut.flags.writeable = False
        return cut

    def _force_rows(
        self, item: ContactForceTask | TorqueTask, torque_map: FloatArray, offset: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Rows on x, and what they should be, of a task on forces or torques."""
        if isinstance(item, ContactForceTask):
            kept = self._kept_forces.get(id(item))
            if kept is None or kept[0] != item._version:
                forces = self.contacts.forces
                A, b = item.rows(self._index_of, forces)
                n = torque_map.shape[1]
                matrix = np.zeros((len(b), n))
                matrix[:, n - forces :] = A
                kept = self._kept_forces[id(item)] = item._version, matrix, b / self._force_unit
            return kept[1], kept[2]
        d = len(offset)
        for what, value in (("target", np.asarray(item.target)), ("weight", np.asarray(item.weight))):
            if value.ndim and len(value) != d:
                raise SettingError(f"the {what} of {item.name!r} has {len(value)} numbers; {d} velocities are driven.")
        weight = np.broadcast_to(np.asarray(item.weight, dtype=np.float64), (d,))
        return weight[:, None] * torque_map, weight * (item.target - offset)


def _driven(robot: Robot, names: Sequence[str] | None, others: IntArray) -> IntArray:
    """Velocity indices of the driven joints: those named, or all but free joints and `others`, which nobody drives."""
    if names is None:
        starts = np.cumsum([0, *getattr(robot, "joint_widths", (1,) * len(robot.joint_names))])
        free = [i for start, end in itertools.pairwise(starts) if end - start == 6 for i in range(start, end)]
        driven = np.setdiff1d(np.arange(robot.nv), [*free, *others.tolist()])
    else:
        driven = np.asarray(joint_indices(robot, list(names), "driven"), dtype=np.int64)
    if not len(driven):
        raise RobotError("no velocity of this robot is driven: it has no joint but free ones; name the driven joints.")
    return np.ascontiguousarray(driven, dtype=np.int64)
