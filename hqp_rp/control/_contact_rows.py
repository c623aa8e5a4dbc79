"""What the contacts of a torque stack contribute on one robot: where their forces act, how they move, which forces may pass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.control._checks import WORLD
from hqp_rp.control._rotations import skew
from hqp_rp.control.contact import Contact
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import frames_of
from hqp_rp.robot.robot import Robot


class ContactRows:
    """The contacts on one robot.

    Args:
        robot, contacts: whose.

    Attributes, after `read`:
        jacobian: (F, nv), F forces: the velocity of every point, in the axes of its contact, is `jacobian @ v`; forces f (F,) act
            on the joints as `jacobian.T @ f`.
        motion: (R, nv) and motion_rate: (R,): the rows `motion @ a = motion_rate` of all contacts; zero rows for open ones.
        motion_degree: (R,) activation of each of these rows.
        cones: (C, F) constant; cone_lower, cone_upper: (C,).
        spans: the forces of each contact, as slices of F; motion_spans: its motion rows, as slices of R.
        axes: (contacts, 3, 3) of each contact to the world.
    """

    def __init__(self, robot: Robot, contacts: Sequence[Contact]) -> None:
        self.robot, self.contacts = robot, tuple(contacts)
        names = dict.fromkeys(name for contact in contacts for name in (contact.frame, contact.on) if name != WORLD)
        self._names = tuple(names)
        self._frames = frames_of(robot, self._names)
        number = {name: i for i, name in enumerate(names)}
        self._pairs = [(number[contact.frame], number.get(contact.on, -1)) for contact in contacts]
        n = robot.nv
        self.spans, forces = _spans([contact.size for contact in contacts])
        self._bases = [contact.motion_basis() for contact in contacts]
        self.motion_spans, rows = _spans([len(basis) for basis in self._bases])
        self.jacobian, self.motion = np.zeros((forces, n)), np.zeros((rows, n))
        self.motion_rate, self.motion_degree = np.zeros(rows), np.ones(rows)
        self.axes = np.tile(np.eye(3), (len(contacts), 1, 1))
        self._versions: list[int] = []
        self.cones, self.cone_lower, self.cone_upper = np.zeros((0, forces)), np.zeros(0), np.zeros(0)

    def read(self, v: FloatArray) -> None:
        """Bring everything up to date at the robot's configuration and the velocity v (nv,)."""
        if self._versions != [contact._version for contact in self.contacts]:
            self._set_up_cones()
        if not self.contacts:
            return
        frames = self._frames
        frames.read()
        twists, biases = frames.motion(v)
        for k, (contact, (a, b)) in enumerate(zip(self.contacts, self._pairs, strict=True)):
            J, R = frames.jacobians[a], frames.rotations[a]
            twist, bias = twists[a], biases[a]
            surface = np.eye(3) if b < 0 else frames.rotations[b]
            if b >= 0:  # seen from the surface, at the place of the frame's origin
                arm = frames.origins[a] - frames.origins[b]
                omega, across = twists[b, 3:], skew(arm)
                carried = frames.jacobians[b].copy()
                carried[:3] -= across @ carried[3:]
                carried_bias = biases[b].copy()
                carried_bias[:3] += np.cross(omega, twists[a, :3] - twists[b, :3]) - across @ carried_bias[3:]
                J, twist, bias = J - carried, twist - carried @ v, bias - carried_bias
            axes = self.axes[k] = contact.axes(surface)
            levers = contact.points @ R.T
            into = axes.T
            self.jacobian[self.spans[k]] = np.concatenate([into @ (J[:3] - skew(lever) @ J[3:]) for lever in levers])
            rows, basis = self.motion_spans[k], self._bases[k]
            if contact.activation == 0.0:
                self.motion[rows], self.motion_rate[rows] = 0.0, 0.0
                continue
            wanted = -bias - contact.kd * twist
            if len(basis) == 6:
                self.motion[rows], self.motion_rate[rows] = J, wanted
            else:
                # In axes that turn with the frame: what holds a point that is not the origin still as the frame turns about it.
                wanted[:3] += np.cross(twists[a, 3:], twist[:3])
                local = np.hstack((basis[:, :3] @ R.T, basis[:, 3:] @ R.T))
                self.motion[rows], self.motion_rate[rows] = local @ J, local @ wanted

    def _set_up_cones(self) -> None:
        blocks, lower, upper = [], [], []
        for contact, span in zip(self.contacts, self.spans, strict=True):
            G, low, up = contact.cone_rows()
            k = len(contact.points)
            block = np.zeros((k * len(G), self.jacobian.shape[0]))
            block[:, span] = np.kron(np.eye(k), G)
            blocks.append(block)
            lower.append(np.tile(low, k))
            upper.append(np.tile(up, k))
        if blocks:
            self.cones = np.concatenate(blocks)
            self.cone_lower, self.cone_upper = np.concatenate(lower), np.concatenate(upper)
        for contact, rows in zip(self.contacts, self.motion_spans, strict=True):
            self.motion_degree[rows] = contact.activation
        self._versions = [contact._version for contact in self.contacts]


def _spans(sizes: Sequence[int]) -> tuple[list[slice], int]:
    ends = np.cumsum([0, *sizes]).tolist()
    return [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)], ends[-1]
