"""The places of a stack that can be dragged: the targets of tasks that bring a frame somewhere."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from hqp_rp.control._rotations import quaternion_to_matrix
from hqp_rp.control.center_of_mass_task import CenterOfMassTask, center_of_mass
from hqp_rp.control.look_at_task import LookAtTask
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.pointing_task import PointingTask
from hqp_rp.control.pose_task import PoseTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.relative_pose_task import RelativePoseTask
from hqp_rp.control.stack import Stack
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_LINEAR, _ANGULAR = ("x", "y", "z"), ("rx", "ry", "rz")


@dataclasses.dataclass(frozen=True, slots=True)
class Target:
    """A place to drag, which one or several tasks bring their frame to.

    Attributes:
        name: what the page calls it: the frame, with its point where that is not the origin, or a look-at task's name.
        frame: the frame that its tasks bring there; for a look-at task, the one that looks.
        tasks: (level, item) of each task in the stack.
        moves, turns: along which of x, y, z it can be moved, and about which turned.
    """

    name: str
    frame: str
    tasks: tuple[tuple[int, int], ...]
    moves: tuple[bool, bool, bool]
    turns: tuple[bool, bool, bool]

    def place(self, stack: Stack) -> tuple[FloatArray | None, FloatArray | None]:
        """Position (3,) in m and rotation (3, 3) of the target, None for the half that no task has."""
        position: FloatArray | None = None
        rotation: FloatArray | None = None
        for level, item in self.tasks:
            task = stack.levels[level][item]
            if isinstance(task, PoseTask):
                return task.target[1], task.target[0]
            if isinstance(task, OrientationTask):
                rotation = task.target
            else:
                position = task.target
        return position, rotation

    def put(self, stack: Stack, position: FloatArray | None = None, quaternion: FloatArray | None = None) -> None:
        """Set position (3,), m, and quaternion (w, x, y, z) of its tasks' targets; None leaves the half as it is."""
        rotation = None if quaternion is None else quaternion_to_matrix(quaternion / np.linalg.norm(quaternion))
        for level, item in self.tasks:
            task = stack.levels[level][item]
            if isinstance(task, PoseTask):
                R, p = task.target
                task.target = (R if rotation is None else rotation, p if position is None else position)
            elif isinstance(task, OrientationTask):
                task.target = task.target if rotation is None else rotation
            elif position is not None:
                task.target = position


def targets_of(stack: Stack) -> tuple[Target, ...]:
    """What can be dragged; tasks on one point of one frame share one target."""
    found: dict[Any, tuple[str, str, list[tuple[int, int]], list[bool], list[bool]]] = {}
    for k, i, task in _tasks(stack):
        if isinstance(task, LookAtTask):
            found[k, i] = (str(task.name), task.frames[0], [(k, i)], [True] * 3, [False] * 3)
        elif isinstance(task, PositionTask | OrientationTask | PoseTask):
            point = () if isinstance(task, OrientationTask) or not task.point.any() else tuple(task.point.tolist())
            # An orientation goes with the first target of its frame, whatever point of it that brings somewhere.
            own = [key for key in found if key[0] == task.frame] if isinstance(task, OrientationTask) else []
            own = own or [key for key in ((task.frame, point),) if key in found]
            key = own[0] if own else (task.frame, point)
            name = task.frame + (f" at {', '.join(f'{x:g}' for x in point)}" if point else "")
            _, _, tasks, moves, turns = found.setdefault(key, (name, task.frame, [], [False] * 3, [False] * 3))
            tasks.append((k, i))
            anywhere = task.expressed_in != "world"
            for axes, names in ((moves, _LINEAR), (turns, _ANGULAR)):
                own_axes = any(axis in task.axes for axis in names)
                axes[:] = [
                    was or axis in task.axes or (anywhere and own_axes) for was, axis in zip(axes, names, strict=True)
                ]
    return tuple(
        Target(name, frame, tuple(tasks), (moves[0], moves[1], moves[2]), (turns[0], turns[1], turns[2]))
        for name, frame, tasks, moves, turns in found.values()
    )


def rest_where_it_is(stack: Stack, robot: Robot) -> None:
    """Set the target of every task to what the robot has at its current configuration.

    Of the library's own tasks; one that looks at a place keeps that place.
    """
    for _, _, task in _tasks(stack):
        if isinstance(task, PostureTask):
            task.target = robot.q
        elif isinstance(task, CenterOfMassTask):
            task.target = center_of_mass(robot, task.bodies, str(task.name))[0]
        elif isinstance(task, PointingTask):
            task.direction = robot.pose(task.frames[0])[0] @ task._basis[:, 2]  # the axis that points
        elif isinstance(task, RelativePoseTask):
            frame, reference = _at(robot, task.frames[0], task.point), _at(robot, task.frames[1])
            task.target = (reference[0].T @ frame[0], reference[0].T @ (frame[1] - reference[1]))
        elif isinstance(task, PositionTask | OrientationTask | PoseTask):
            R, p = _at(robot, task.frame, task.point)
            task.target = p if isinstance(task, PositionTask) else R if isinstance(task, OrientationTask) else (R, p)


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """(4,) unit quaternion (w, x, y, z) of a rotation matrix (3, 3)."""
    quaternion: FloatArray = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation, dtype=np.float64).ravel())
    return quaternion


def _tasks(stack: Stack) -> Iterator[tuple[int, int, Any]]:
    for k, items in enumerate(stack.levels):
        for i, task in enumerate(items):
            yield k, i, task


def _at(robot: Robot, frame: str, point: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    R, p = (np.eye(3), np.zeros(3)) if frame == "world" else robot.pose(frame)
    return R, p if point is None else p + R @ point
