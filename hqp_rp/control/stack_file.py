"""A stack as a small TOML file: levels of tasks and limits, most important first, hard limits, and on which robot."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import os
import pathlib
import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np

from hqp_rp.control._checks import WORLD, check_frames, frame_point
from hqp_rp.control._stack_metric import MetricOnRobot, StackMetric
from hqp_rp.control.center_of_mass_task import center_of_mass
from hqp_rp.control.stack import Stack
from hqp_rp.core.damping import (
    ConstantDamping,
    ErrorDamping,
    LevelDamping,
    ManipulabilityDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import FileError, HqpError, SettingError, unknown_name, unknown_setting
from hqp_rp.core.paths import user_path
from hqp_rp.robot.robot import Robot
from hqp_rp.robot.robot_source import RobotSource, robot_table

EXAMPLES = pathlib.Path(__file__).with_name("stacks")
"""The folder of the stack files that come with the library."""

TASKS = {
    "position": "position_task.PositionTask",
    "orientation": "orientation_task.OrientationTask",
    "pose": "pose_task.PoseTask",
    "relative_pose": "relative_pose_task.RelativePoseTask",
    "pointing": "pointing_task.PointingTask",
    "look_at": "look_at_task.LookAtTask",
    "posture": "posture_task.PostureTask",
    "twist": "twist_task.TwistTask",
    "center_of_mass": "center_of_mass_task.CenterOfMassTask",
}
"""Type in the file -> the task's class in `hqp_rp.control`; its arguments are the keys of the table."""

LIMITS = {
    "joint": "joint_limit.JointLimit",
    "locked": "locked_joints.LockedJoints",
    "coupling": "joint_coupling.JointCoupling",
    "velocity": "limit.VelocityLimit",
    "torque": "torque_limit.TorqueLimit",
    "half_space": "half_space_limit.HalfSpaceLimit",
    "cone": "cone_limit.ConeLimit",
    "pose": "pose_limit.PoseLimit",
    "frame_speed": "frame_speed_limit.FrameSpeedLimit",
    "support_polygon": "support_polygon_limit.SupportPolygonLimit",
    "collision": "collision_limit.CollisionLimit",
}
"""Type in the file -> the limit's class in `hqp_rp.control`; its arguments are the keys of the table."""

_TOP = ("dt", "metric", "robot", "level", "limit")
_LEVEL = ("name", "damping", "task", "limit")
_DAMPING: dict[str, Any] = {
    "constant": ConstantDamping,
    "error": ErrorDamping,
    "variable": VariableDamping,
    "truncation": Truncation,
    "manipulability": ManipulabilityDamping,
    "filtering": NumericalFiltering,
}


@dataclasses.dataclass(frozen=True)
class StackFile:
    """What a stack file says; which frames and joints there are is seen when it meets a robot.

    Attributes:
        origin: the file's name, for errors. text: its content.
        dt: s, for how long an answer is held; None where the file has no limits.
    """

    origin: str
    text: str
    dt: float | None
    _levels: tuple[tuple[str, tuple[Item, ...]], ...]
    _limits: tuple[Item, ...]
    _damping: tuple[LevelDamping | None, ...] = ()
    _robot: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    _metric: StackMetric = None

    @property
    def has_limits(self) -> bool:
        """Whether there is a limit, hard or at a level."""
        return bool(self._limits) or any(item.kind == "limit" for _, items in self._levels for item in items)

    def robot_source(self, model: str | os.PathLike[str] | None = None, **given: Any) -> RobotSource:
        """The robot that the table [robot] says; what is given here counts before it.

        Raises:
            SettingError: neither says a model, or a key that there is not, or a value of the wrong kind.
            RobotError: arguments for a robot that is no file.
        """
        values = dict(self._robot) | given | ({} if model is None else {"model": os.fspath(model)})
        if "model" not in values:
            raise SettingError(
                f"{self.origin} says no robot: give an MJCF or URDF file or the name of a robot, or write it into the stack "
                'file, under [robot], as model = "FILE".'
            )
        try:
            return RobotSource.of(values)
        except HqpError as error:
            raise error if given or model is not None else _told(error, f"{self.origin}: robot") from None

    def stack(self, robot: Robot) -> Stack:
        """The stack for `robot`. A target that the file leaves out is what the robot has at its neutral configuration.

        The robot is put back where it was.

        Raises:
            RobotError: a frame or joint that the robot does not have, or a size that does not fit it.
            SettingError: a value that a task or limit does not allow.
        """
        before = robot.q
        robot.update(robot.neutral)
        try:
            levels = [[item.build(robot, self.origin) for item in items] for _, items in self._levels]
            limits = [item.build(robot, self.origin) for item in self._limits]
            given = [name for name, _ in self._levels]
            defaults = Stack(levels).names
            names = [a or b for a, b in zip(given, defaults, strict=True)]
            stack = Stack(levels, limits, names=names, damping=self._damping or None, metric=self._metric)
            try:
                rest = np.zeros(robot.nv)
                stack.problem(robot, self.dt, rest, rest)
            except HqpError as error:
                raise _told(error, self.origin) from None
        finally:
            robot.update(before)
        return stack


@dataclasses.dataclass(frozen=True)
class Item:
    """One table of a stack file: a task or a limit, its type, its keys, and where it stands."""

    kind: str
    type: str
    values: Mapping[str, Any]
    where: str

    def build(self, robot: Robot, origin: str) -> Any:
        """The task or limit for this robot, which is at its neutral configuration."""
        where = f"{origin}: {self.where}"
        try:
            values = dict(self.values)
            frames = [values[key] for key in ("frame", "reference", "expressed_in") if key in values]
            check_frames(robot, [frame for frame in frames if isinstance(frame, str)], self.type)
            if "target" in _keys(self) and "target" not in values:
                values["target"] = _neutral_target(self.type, robot, values)
            for key in ("target", "origin"):
                if self.type in ("pose", "relative_pose") and isinstance(values.get(key), dict):
                    values[key] = _pose(values[key], key)
            if self.type == "collision" and isinstance(values.get("pairs"), list):
                values["pairs"] = [tuple(pair) if isinstance(pair, list) else pair for pair in values["pairs"]]
            return _class_of(self)(**values)
        except HqpError as error:
            raise _told(error, where) from None


def load_stack(source: str | os.PathLike[str]) -> StackFile:
    """The stack file at `source`, or the library's own of that name (`sawyer`, `planar4`, `dual_sawyer`, `humanoid`).

    Raises:
        FileError: no such file, or no TOML (with line and column).
        SettingError: a key that there is not, a missing key, or a value of the wrong kind.
        UnknownNameError: an unknown type of task or limit; the message lists the ones there are.
    """
    text = os.fspath(source)
    path = user_path(text)
    if not path.suffix and path.parent == pathlib.Path(".") and not path.exists():
        own = sorted(example.stem for example in EXAMPLES.glob("*.toml"))
        if text not in own:
            raise FileError(
                f"{text}: there is no such stack file; give the path of a TOML file, or one of {', '.join(own)}."
            )
        path = EXAMPLES / f"{text}.toml"
    try:
        content = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such stack file.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: the stack file cannot be read ({error}).") from error
    return parse_stack(content, text, path.parent)


def parse_stack(text: str, origin: str = "the stack", folder: str | os.PathLike[str] = ".") -> StackFile:
    """The stack that this TOML text describes; errors as `load_stack`.

    Args:
        origin: what errors call it. folder: where the relative paths of its [robot] begin.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{origin}: not valid TOML: {error}.") from None
    for key in content:
        if key not in _TOP:
            raise _told(unknown_setting("a stack", key, _TOP), origin)
    levels, damping = [], []
    for k, level in enumerate(_tables(content.get("level", []), f"{origin}: level")):
        where = f"level {k + 1}"
        for key in level:
            if key not in _LEVEL:
                raise _told(unknown_setting("a level", key, _LEVEL), f"{origin}: {where}")
        name = level.get("name", "")
        if not isinstance(name, str):
            raise SettingError(f"{origin}: {where}: name is {name!r}; it must be a string.")
        items = _items(level, "task", where, origin) + _items(level, "limit", where, origin)
        if not items:
            raise SettingError(f"{origin}: {where} is empty; give it a [[level.task]] or a [[level.limit]].")
        levels.append((name, items))
        damping.append(_damping(level.get("damping"), f"{origin}: {where}: damping"))
    if not levels:
        raise SettingError(f"{origin}: there is no level; give at least one [[level]] with a [[level.task]].")
    hard = _items(content, "limit", "hard", origin)
    robot = _robot(content.get("robot", {}), origin, pathlib.Path(folder))
    stack = StackFile(
        origin, text, _dt(content, origin), tuple(levels), hard, tuple(damping), robot, _metric(content, origin)
    )
    if stack.has_limits and stack.dt is None:
        raise SettingError(f"{origin}: limits need the time step; write dt = 0.01 (in s) above the first level.")
    return stack


def _metric(content: Mapping[str, Any], origin: str) -> StackMetric:
    """What `Stack(metric=...)` takes, from a string or a table of weights by joint."""
    metric: StackMetric = content.get("metric")
    try:
        MetricOnRobot(metric)
    except HqpError as error:
        raise _told(error, origin) from None
    return metric


def _robot(values: Any, origin: str, folder: pathlib.Path) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise SettingError(f'{origin}: robot is {values!r}; write a table, [robot], with model = "FILE" below it.')
    try:
        return robot_table(values, folder)
    except HqpError as error:
        raise _told(error, f"{origin}: robot") from None


def _items(table: Mapping[str, Any], kind: str, where: str, origin: str) -> tuple[Item, ...]:
    items = []
    for i, values in enumerate(_tables(table.get(kind, []), f"{origin}: {where}: {kind}")):
        rest = dict(values)
        known = TASKS if kind == "task" else LIMITS
        here = f"{where}, {kind} {i + 1}" if where != "hard" else f"hard limit {i + 1}"
        if "type" not in rest:
            raise SettingError(f"{origin}: {here} has no type; give one of {', '.join(sorted(known))}.")
        kind_of = rest.pop("type")
        if kind_of not in known:
            raise _told(unknown_name(f"type of {kind}", kind_of, known), f"{origin}: {here}")
        item = Item(kind, kind_of, rest, f"{here} ({kind_of})")
        _check_keys(item, origin)
        items.append(item)
    return tuple(items)


def _check_keys(item: Item, origin: str) -> None:
    keys = _keys(item)
    for key in item.values:
        if key not in keys:
            raise _told(unknown_setting(f"{item.kind} {item.type!r}", key, keys), f"{origin}: {item.where}")
    for key, needed in keys.items():
        if needed and key != "target" and key not in item.values:
            raise SettingError(f"{origin}: {item.where} has no {key}; a {item.kind} of type {item.type!r} needs it.")


def _keys(item: Item) -> dict[str, bool]:
    """The keys that this type takes, and whether each is needed: the arguments of its class."""
    parameters = inspect.signature(_class_of(item)).parameters.values()
    return {parameter.name: parameter.default is parameter.empty for parameter in parameters}


def _class_of(item: Item) -> Any:
    module, _, name = (TASKS if item.kind == "task" else LIMITS)[item.type].partition(".")
    return getattr(importlib.import_module(f"hqp_rp.control.{module}"), name)


def _neutral_target(kind: str, robot: Robot, values: Mapping[str, Any]) -> Any:
    """What the task's frame (or the whole robot) has at the robot's current configuration."""
    if kind == "posture":
        return robot.q
    if kind == "center_of_mass":
        bodies = values.get("bodies")
        return center_of_mass(robot, [bodies] if isinstance(bodies, str) else bodies, "center_of_mass")[0]
    if kind == "look_at":
        raise SettingError("there is no target; give the place to look at, 3 numbers in m.")
    rotation, position = _frame(robot, values["frame"])
    if "point" in values:
        position = position + rotation @ frame_point(values["point"], kind)
    if kind == "position":
        return position
    if kind == "orientation":
        return rotation
    if kind == "relative_pose":
        R, p = _frame(robot, values["reference"])
        return R.T @ rotation, R.T @ (position - p)
    return rotation, position


def _frame(robot: Robot, name: str) -> tuple[Any, Any]:
    return (np.eye(3), np.zeros(3)) if name == WORLD else robot.pose(name)


def _pose(table: Mapping[str, Any], key: str) -> tuple[Any, Any]:
    if set(table) != {"rotation", "position"}:
        raise SettingError(
            f"{key} has the keys {', '.join(sorted(table)) or 'none'}; give rotation (a quaternion (w, x, y, z) or a "
            "3 x 3 matrix) and position (3 numbers in m), or a 4 x 4 matrix."
        )
    return table["rotation"], table["position"]


def _dt(content: Mapping[str, Any], origin: str) -> float | None:
    dt = content.get("dt")
    if dt is None:
        return None
    if isinstance(dt, bool) or not isinstance(dt, int | float) or not 0.0 < dt < float("inf"):
        raise SettingError(f"{origin}: dt is {dt!r}; it must be a finite number of seconds > 0.")
    return float(dt)


def _damping(value: Any, what: str) -> LevelDamping | None:
    """`{ error = 0.1, power = 1 }`, `{ constant = 0.05 }`, `{ variable = [delta, maximum] }`, `{ truncation = 0.01 }`."""
    if value is None:
        return None
    kinds = [kind for kind in value if kind in _DAMPING] if isinstance(value, dict) else []
    if len(kinds) != 1:
        raise SettingError(
            f"{what} is {value!r}; give one of {', '.join(_DAMPING)}, such as damping = {{ error = 0.1 }}."
        )
    ((kind,), made) = kinds, _DAMPING[kinds[0]]
    fields = [field.name for field in dataclasses.fields(made)]
    needed = [field.name for field in dataclasses.fields(made) if field.default is dataclasses.MISSING]
    numbers = value[kind] if isinstance(value[kind], list) else [value[kind]]
    rest = {key: given for key, given in value.items() if key != kind}
    for key in rest:
        if key not in fields[len(needed) :]:
            raise SettingError(f"{what}: {kind} takes no {key!r}.")
    if len(numbers) != len(needed) or any(isinstance(number, bool) for number in numbers):
        raise SettingError(f"{what}: {kind} is {value[kind]!r}; it takes {len(needed)} numbers.")
    try:
        policy: LevelDamping = made(*numbers, **rest)
    except HqpError as error:
        raise _told(error, what) from None
    return policy


def _tables(value: Any, what: str) -> list[dict[str, Any]]:
    """One table or a list of tables, as a list."""
    tables = [value] if isinstance(value, dict) else value
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        name = what.rpartition(" ")[2]
        raise SettingError(
            f"{what} is {value!r}; write tables, such as [[{name if name == 'level' else 'level.' + name}]]."
        )
    return tables


def _told(error: HqpError, where: str) -> HqpError:
    """The same error with the place in the file before it."""
    return type(error)(f"{where}: {error}")
