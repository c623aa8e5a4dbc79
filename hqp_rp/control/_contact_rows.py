"""What the contacts of a torque stack are on one robot: arrays from which native code makes their rows at every step."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.control._checks import WORLD
from hqp_rp.control.contact import Contact
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import frames_of
from hqp_rp.robot.robot import Robot


class ContactRows:
    """The contacts on one robot.

    Args:
        robot, contacts: whose.

    Attributes:
        forces: F, how many unknown forces there are. rows: R, how many motion rows.
        spans: the forces of each contact, as slices of F; motion_spans: its motion rows, as slices of R.
        arrays: what `_native.TorqueRows` takes of them; they stay where they are.
        cones (C, F), cone_lower, cone_upper (C,): friction and unilateral contact, N. degrees: (R,) activation of
        each motion row.
    """

    def __init__(self, robot: Robot, contacts: Sequence[Contact]) -> None:
        self.contacts = tuple(contacts)
        names = dict.fromkeys(name for contact in contacts for name in (contact.frame, contact.on) if name != WORLD)
        self._frames = frames_of(robot, tuple(names))
        number = {name: i for i, name in enumerate(names)}
        self.spans, self.forces = _spans([contact.size for contact in contacts])
        bases = [contact.motion_basis() for contact in contacts]
        self.motion_spans, self.rows = _spans([len(basis) for basis in bases])
        table = [
            (number[c.frame], number.get(c.on, -1), len(c.points), span.start, len(basis), rows.start)
            for c, basis, span, rows in zip(contacts, bases, self.spans, self.motion_spans, strict=True)
        ]
        padded = np.zeros((len(contacts), 6, 6))
        for own, basis in zip(padded, bases, strict=True):
            own[: len(basis)] = basis
        frames = self._frames
        self._twists, self._biases = np.zeros((len(names), 6)), np.zeros((len(names), 6))
        self._axes, self._kd = np.zeros((len(contacts), 3, 3)), np.zeros(len(contacts))
        self._activation, self.degrees = np.ones(len(contacts)), np.ones(self.rows)
        self.arrays: dict[str, Any] = {
            "contacts": np.array(table, dtype=np.int64).reshape(-1, 6),
            "points": np.concatenate([np.zeros((0, 3)), *(contact.points for contact in contacts)]),
            "bases": padded,
            "axes": self._axes,
            "kd": self._kd,
            "activation": self._activation,
            "rotations": frames.rotations,
            "origins": frames.origins,
            "jacobians": frames.jacobians,
            "twists": self._twists,
            "biases": self._biases,
        }
        self._versions: list[int] | None = None
        self.fading = False
        self._set_up()

    def read(self, v: FloatArray) -> bool:
        """Bring frames, cones and activations up to date for the velocity v (nv,); whether cones or activations changed."""
        changed = self._versions != [contact._version for contact in self.contacts]
        if changed:
            self._set_up()
        if self.contacts:
            self._frames.read()
            self._frames.motion(v, self._twists, self._biases)
        return changed

    def _set_up(self) -> None:
        blocks, lower, upper = [np.zeros((0, self.forces))], [np.zeros(0)], [np.zeros(0)]
        for k, (contact, span) in enumerate(zip(self.contacts, self.spans, strict=True)):
            G, low, up = contact.cone_rows()
            points = len(contact.points)
            block = np.zeros((points * len(G), self.forces))
            block[:, span] = np.kron(np.eye(points), G)
            blocks.append(block)
            lower.append(np.tile(low, points))
            upper.append(np.tile(up, points))
            self._axes[k], self._kd[k], self._activation[k] = contact.axes(np.eye(3)), contact.kd, contact.activation
            self.degrees[self.motion_spans[k]] = contact.activation
        self.cones = np.concatenate(blocks)
        self.cone_lower, self.cone_upper = np.concatenate(lower), np.concatenate(upper)
        self.fading = bool(((self._activation > 0.0) & (self._activation < 1.0)).any())
        self._versions = [contact._version for contact in self.contacts]


def _spans(sizes: Sequence[int]) -> tuple[list[slice], int]:
    ends = np.cumsum([0, *sizes]).tolist()
    return [slice(a, b) for a, b in itertools.pairwise(ends)], ends[-1]
