"""Poses and Jacobians of some frames of a MuJoCo state, read in compiled code out of MuJoCo's own memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from hqp_rp.core.kernels.row_kinds import BODY_ROW, DOF_ROW, FRAME_ROW, TREE_HEADER
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.frames import Frames, Point

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_WORLD_AXES = np.eye(3)
_WORLD_AXES.setflags(write=False)


class FrameMemory:
    """Where MuJoCo keeps what poses and Jacobians of some frames are made from.

    MuJoCo's arrays stay where they are while the state lives, so their addresses are taken once. Only numbers are read from
    them: a model whose lengths or masses are changed in place is followed.

    Args:
        model, data: the model and a state of it. frames: numbers of bodies, of sites after the bodies, or None for the centre
            of mass. mass: of the moving bodies, kg.

    Attributes:
        tree: as `hqp_rp.core.kernels.tree` takes it. bodies: rows of the room that it needs.
    """

    def __init__(self, model: Any, data: Any, frames: Sequence[int | None], mass: float) -> None:
        from hqp_rp.core.kernels.tree import tree_frames

        self._kernel = tree_frames
        total = np.array([mass])
        # Whoever reads by address must keep the memory.
        self._kept = (model, data, total)
        self.bodies = int(model.nbody)
        self.tree = _tree(model, data, frames, total)
        self._room = np.empty((self.bodies, 4))

    def read(self, rotations: FloatArray, origins: FloatArray, jacobians: FloatArray) -> None:
        """Fill rotations (F, 3, 3), origins (F, 3) and jacobians (F, 6, nv); what is always zero is left as it is."""
        self._kernel(self.tree, rotations, origins, jacobians, self._room)


class MujocoFrames(Frames):
    """The frames of a `MujocoRobot`, from its private state. Raises `RobotError` for a name that it does not have."""

    def __init__(self, robot: MujocoRobot, names: tuple[str | Point, ...]) -> None:
        super().__init__(robot, names)
        self._arm_of = robot._unchanged_arm
        self._memory = robot._memory_of(names)
        self.tree, self.bodies, self.q = self._memory.tree, self._memory.bodies, robot._qpos

    def read(self) -> None:
        """Fill the arrays for the robot's current configuration."""
        self._memory.read(self.rotations, self.origins, self.jacobians)

    def many(self, q: FloatArray, threads: int | None = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `Frames.many`; of a robot made from an arm, by the arm's compiled kinematics."""
        arm = self._arm_of()
        if arm is None or not self.names or not set(self.names) <= set(arm.frame_names):
            return super().many(q, threads)
        found = [arm.kinematics(q, str(name), threads=threads) for name in self.names]
        return tuple(np.stack([of_one[k] for of_one in found], axis=1) for k in range(3))  # type: ignore[return-value]


def _tree(model: Any, data: Any, numbers: Sequence[int | None], mass: FloatArray) -> IntArray:
    """The description that `hqp_rp.core.kernels.tree` reads."""
    moving = [body for body in range(model.nbody - 1, 0, -1) if model.body_treeid[body] >= 0]
    dofs_at = TREE_HEADER + FRAME_ROW * len(numbers)
    bodies_at = dofs_at + DOF_ROW * model.nv
    end = bodies_at + BODY_ROW * len(moving)
    frames: list[int] = []
    chains: list[int] = []
    for number in numbers:
        if number is None:
            frames += [0, 0, end, end]
            continue
        if number < model.nbody:
            body, rotation, origin = number, _row(data.xmat, number), _row(data.xpos, number)
        else:
            site = number - int(model.nbody)
            body = int(model.site_bodyid[site])
            rotation, origin = _row(data.site_xmat, site), _row(data.site_xpos, site)
        chain = _chain(model, body)
        frames += [rotation, origin, end, end + len(chain)]
        chains += chain
        end += len(chain)
    bodies = [
        number
        for body in moving
        for number in (body, int(model.body_parentid[body]), _row(model.body_mass, body), _row(data.xipos, body))
    ]
    header = [len(numbers), dofs_at, bodies_at, len(moving), _row(mass, 0)]
    return np.array([*header, *frames, *_dofs(model, data), *bodies, *chains], dtype=np.int64)


def _row(array: Any, i: int) -> int:
    """The address of an entry or a row."""
    return int(array.__array_interface__["data"][0]) + i * int(array.strides[0])


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


def _dofs(model: Any, data: Any) -> list[int]:
    """Axis, its stride, anchor, whether it turns, and body of each dof."""
    found: list[int] = []
    for j in range(model.njnt):
        kind, body = int(model.jnt_type[j]), int(model.jnt_bodyid[j])
        anchor = _row(data.xanchor, j)
        if kind == _FREE:
            for i in range(3):
                found += [_row(_WORLD_AXES, i), 8, anchor, 0, body]
        if kind in (_FREE, _BALL):  # about the axes of the body, the columns of its rotation
            for i in range(3):
                found += [_row(data.xmat, body) + 8 * i, 24, anchor, 1, body]
        else:
            found += [_row(data.xaxis, j), 8, anchor, int(kind != _SLIDE), body]
    return found
