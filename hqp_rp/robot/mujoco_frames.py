"""Poses and Jacobians of some frames of a MuJoCo state, read natively out of MuJoCo's own memory."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import Frames, Point

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)


def kinematics_of(
    model: Any, data: Any, frames: Sequence[int | None], mass: float, bodies: Collection[int]
) -> _native.Kinematics:
    """What reads poses and Jacobians of some frames where MuJoCo keeps what they are made from.

    MuJoCo's arrays stay where they are while the state lives, and are kept alive. Only numbers are read from them: a model
    whose lengths or masses are changed in place is followed.

    Args:
        model, data: the model and a state of it. frames: numbers of bodies, of sites after the bodies, or None for the centre
            of mass. mass: of the bodies that count for it, kg. bodies: their numbers.
    """
    table: list[tuple[int, int]] = []
    chains: list[list[int]] = []
    for number in frames:
        if number is None:
            table.append((-1, 0))
            chains.append([])
        elif number < model.nbody:
            table.append((0, number))
            chains.append(_chain(model, number))
        else:
            site = number - int(model.nbody)
            table.append((1, site))
            chains.append(_chain(model, int(model.site_bodyid[site])))
    leaves_first = sorted(bodies, reverse=True)
    moving = [(body, int(model.body_parentid[body]), (_chain(model, body) or [-1])[0]) for body in leaves_first]
    names = ("xmat", "xpos", "site_xmat", "site_xpos", "xanchor", "xaxis", "xipos")
    state = {name: getattr(data, name) for name in names} | {"body_mass": model.body_mass, "kept": (model, data)}
    arrays = (np.array(rows, dtype=np.int64).reshape(-1, width) for rows, width in ((table, 2), (_dofs(model), 6)))
    frame_table, dof_table = arrays
    body_table = np.array(moving, dtype=np.int64).reshape(-1, 3)
    return _native.Kinematics(frame_table, chains, dof_table, body_table, mass, state)


class MujocoFrames(Frames):
    """The frames of a `MujocoRobot`, from its private state. Raises `RobotError` for a name that it does not have."""

    def __init__(self, robot: MujocoRobot, names: tuple[str | Point, ...]) -> None:
        super().__init__(robot, names)
        self._arm_of = robot._unchanged_arm
        self.kinematics, self.q = robot._kinematics_of(names), robot._qpos

    def read(self) -> None:
        """Fill the arrays for the robot's current configuration."""
        assert self.kinematics is not None
        self.kinematics.read(self.rotations, self.origins, self.jacobians)

    def motion(self, v: FloatArray, twists: FloatArray, biases: FloatArray) -> None:
        """As `Frames.motion`."""
        assert self.kinematics is not None
        self.kinematics.motion(v, twists, biases)

    def many(self, q: FloatArray, threads: int | None = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `Frames.many`; of a robot made from an arm, by the arm's own kinematics."""
        arm = self._arm_of()
        if arm is None or not self.names or not set(self.names) <= set(arm.frame_names):
            return super().many(q, threads)
        found = [arm.kinematics(q, str(name), threads=threads) for name in self.names]
        return tuple(np.stack([of_one[k] for of_one in found], axis=1) for k in range(3))  # type: ignore[return-value]


def _chain(model: Any, body: int) -> list[int]:
    """The dofs that move a body, the nearest first."""
    while body and not model.body_dofnum[body]:
        body = int(model.body_parentid[body])
    if not body:
        return []
    chain = []
    dof = int(model.body_dofadr[body] + model.body_dofnum[body]) - 1
    while dof >= 0:
        chain.append(dof)
        dof = int(model.dof_parentid[dof])
    return chain


def _dofs(model: Any) -> list[tuple[int, int, int, int, int, int]]:
    """Of each dof its axis, joint, whether it turns, body, the dof below it and the one with which its axis turns (-1: none).

    Axes: 0 ... 2 of the world, 3 ... 5 a column of the body's rotation, 6 the joint's own.
    """
    found: list[tuple[int, int, int, int, int, int]] = []
    for j in range(model.njnt):
        kind, body = int(model.jnt_type[j]), int(model.jnt_bodyid[j])
        parent = [int(model.dof_parentid[i]) for i in range(len(found), len(found) + 6) if i < model.nv]
        if kind == _FREE:
            found += [(i, j, 0, body, parent[i], -1) for i in range(3)]
        if kind in (_FREE, _BALL):
            last = len(found) + 2
            parent = [int(model.dof_parentid[i]) for i in range(len(found), last + 1)]
            found += [(3 + i, j, 1, body, parent[i], last) for i in range(3)]
        else:
            found.append((6, j, int(kind != _SLIDE), body, parent[0], parent[0]))
    return found
