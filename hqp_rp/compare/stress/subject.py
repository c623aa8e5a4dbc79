"""What is stressed: a robot and its stack, as every worker makes them for itself."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pathlib
import pickle
import warnings
from typing import Any, TypeAlias

import numpy as np

from hqp_rp.control._sampling import Sampler
from hqp_rp.control.limit import Limit
from hqp_rp.control.stack import Stack
from hqp_rp.control.stack_file import StackFile, load_stack, parse_stack
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot.robot import Robot
from hqp_rp.robot.robot_source import RobotSource

RobotLike: TypeAlias = "str | os.PathLike[str] | RobotSource | Robot"
StackLike: TypeAlias = "str | os.PathLike[str] | StackFile | Stack"

_SAMPLED = 4  # configurations whose problems stand for a robot and a stack
_DECIMALS = 9


@dataclasses.dataclass(frozen=True)
class FileSubject:
    """A robot file (or name) and a stack file, read by every worker.

    Attributes:
        source: the robot. text: of the stack file. origin: what errors call it. dt: s, or None.
    """

    source: RobotSource
    text: str
    origin: str
    dt: float | None

    @property
    def model(self) -> str:
        """What reports call the robot."""
        return self.source.model

    def build(self) -> tuple[Robot, Stack]:
        """The robot and the stack, made anew."""
        robot = self.source.robot()
        return robot, parse_stack(self.text, self.origin).stack(robot)

    def description(self) -> dict[str, Any]:
        """What tells this subject from others, for the manifest of a run."""
        path = pathlib.Path(self.source.model)
        content = hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.is_file() else "one of the library's own"
        said = {key: repr(value) for key, value in self.source.changed.items()}
        return {"model": self.model, "model content": content, "robot": said, "stack": self.text, "dt": self.dt}


@dataclasses.dataclass(frozen=True)
class ObjectSubject:
    """A robot and a stack that were built in Python, as one pickle that every worker is given.

    Attributes:
        model: what reports call the robot. text, origin: the stack in words. dt: s, or None.
        content: digest of the problems that they make, the same in every process. data: the pickle.
    """

    model: str
    text: str
    origin: str
    dt: float | None
    content: str
    data: bytes = dataclasses.field(compare=False, repr=False)

    def build(self) -> tuple[Robot, Stack]:
        """The robot and the stack, made anew."""
        robot, stack = pickle.loads(self.data)
        return robot, stack

    def description(self) -> dict[str, Any]:
        """What tells this subject from others, for the manifest of a run."""
        return {"model": self.model, "stack": self.text, "dt": self.dt, "robot and stack": self.content}


Subject: TypeAlias = FileSubject | ObjectSubject


def subject_of(robot: RobotLike | None, stack: StackLike, dt: float | None = None) -> Subject:
    """The subject that these are; the given robot and stack are not moved about.

    Args:
        robot: a `Robot`; a `RobotSource`, file or name; or None for the one that the stack file says.
        stack: a `Stack`; a `StackFile`, the path or the name of one.
        dt: s; None takes the stack file's.

    Raises:
        SettingError: neither says a robot, a stack with limits without dt, or one that cannot be pickled.
        RobotError: something else in the robot's place.
        FileError and others, as `load_stack`.
    """
    file = None if isinstance(stack, Stack) else stack if isinstance(stack, StackFile) else _loaded(stack)
    if file is not None:
        dt = file.dt if dt is None else dt
        if robot is None or isinstance(robot, str | os.PathLike):
            return FileSubject(file.robot_source(robot), file.text, file.origin, dt)
        if isinstance(robot, RobotSource):
            return FileSubject(robot, file.text, file.origin, dt)
    if robot is None:
        raise SettingError("robot is None, and a Stack does not say on which robot; give one.")
    if isinstance(robot, str | os.PathLike):
        robot = RobotSource(os.fspath(robot))
    title = robot.model if isinstance(robot, RobotSource) else str(getattr(robot, "name", "") or type(robot).__name__)
    built = robot.robot() if isinstance(robot, RobotSource) else robot
    if not isinstance(built, Robot):
        raise RobotError(
            f"robot is a {type(built).__name__}; give a robot with the methods of hqp_rp.robot.Robot, a RobotSource, an MJCF "
            "or URDF file, or the name of a robot."
        )
    own = stack if isinstance(stack, Stack) else file.stack(built)  # type: ignore[union-attr]
    if dt is None and (own.limits or any(_needs_dt(item) for items in own.levels for item in items)):
        raise SettingError(
            f"{own!r} holds limits or mink tasks, which need the time step: give dt, in s, such as dt=0.01."
        )
    text = repr(own) if file is None else file.text
    data = _pickled(built, own)
    return ObjectSubject(title, text, repr(own) if file is None else file.origin, dt, _content(data, dt), data)


def _loaded(stack: object) -> StackFile:
    if not isinstance(stack, str | os.PathLike):
        raise SettingError(
            f"stack is a {type(stack).__name__}; give a Stack, a StackFile, or the path or name of a stack file."
        )
    return load_stack(stack)


def _needs_dt(item: object) -> bool:
    return isinstance(item, Limit) or any(kind.__module__.startswith("mink.") for kind in type(item).__mro__)


def _pickled(robot: Robot, stack: Stack) -> bytes:
    import cloudpickle  # also takes classes of a script and functions without a name

    try:
        data: bytes = cloudpickle.dumps((robot, stack))
        pickle.loads(data)
    except Exception as error:  # whatever the classes of others raise
        raise SettingError(
            f"{stack!r} on this robot cannot be handed to worker processes, since it cannot be pickled "
            f"({type(error).__name__}: {error}); keep open files, locks and simulations out of tasks, limits and robots."
        ) from error
    return data


def _content(data: bytes, dt: float | None) -> str:
    """A digest of the joint limits and of the problems at a few configurations, rounded: two pickles of the same differ."""
    robot, stack = pickle.loads(data)
    sampler, rest = Sampler(robot), np.zeros(robot.nv)
    together = hashlib.sha256(repr((robot.joint_names, stack.names, dt)).encode())
    arrays = [robot.lower, robot.upper, robot.velocity_limit]
    for i in range(_SAMPLED):
        robot.update(sampler.uniform(np.random.default_rng(i)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # said where the test begins
            problem = stack.problem(robot, dt, rest, rest)
        arrays += [problem.matrix, problem.lower, problem.upper, problem.offsets]
        if problem.hard is not None:
            arrays += [problem.hard.A, problem.hard.lower, problem.hard.upper]
        together.update(repr(problem.damping).encode())
    for array in arrays:
        together.update((np.round(np.asarray(array, dtype=np.float64), _DECIMALS) + 0.0).tobytes())
    return together.hexdigest()[:16]
