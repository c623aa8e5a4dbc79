"""The stack of tasks: levels in order of priority and limits, turned into a `Problem` at every control step."""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import check_frames, checked_motion, positive_number
from hqp_rp.control._displacement import Configurations, DisplacementTask, library_of
from hqp_rp.control._refusal import outline
from hqp_rp.control._rows_in_words import rows_in_words
from hqp_rp.control._stack_metric import MetricOnRobot, StackMetric
from hqp_rp.control._stack_rows import DISPLACEMENT_TASK, LIMIT, TASK, StackRows
from hqp_rp.control._stack_warnings import (
    warn_of_couplings,
    warn_of_hard_torques,
    warn_of_hard_torques_on,
    warn_of_speeds,
)
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.limit import Limit, VelocityLimit
from hqp_rp.control.task import FeedbackTask, Task
from hqp_rp.core.damping import ConstantDamping, LevelDamping, checked_level_damping
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray, Level, Problem
from hqp_rp.core.row_names import LEVEL_ROW_NAMES, ROW_NAMES
from hqp_rp.core.warned import warn
from hqp_rp.robot.robot import Robot

Item: TypeAlias = Any
"""A `Task`, a `Limit`, or a task or limit of mink or pink."""

_LONG = 1.0  # s: what no control loop waits
_MEANT = "a Task, a Limit, or a task or limit of mink or pink"


class Stack:
    """Levels of tasks and limits, most important first, and hard limits, for a robot's velocity.

    `stack.problem(robot, dt)` is the prioritized problem at the robot's current configuration; its unknown is the velocity
    v (nv,) that the robot shall have during the next step, 0 where `robot.unactuated` says that it drives nothing; what moves
    there by itself is taken into account. Any solver takes it::

        stack = Stack([position, [orientation, com], posture], limits=[JointLimit()])
        robot.update(q)
        v = hqp_rp.solve(stack.problem(robot, dt), solver).require()
        q = robot.integrate(q, v, dt)

    Args:
        levels: one entry for each level: a task, or a sequence of tasks whose rows are stacked. A limit may stand wherever
            a task may: there it is soft, violated as little as the levels before it allow. Tasks and limits of mink are
            taken as they are, for robots that MuJoCo computes, and those of pink for robots that Pinocchio computes: see
            `hqp_rp.control.mink_adapter` and `hqp_rp.control.pink_adapter`.
        limits: rows that no answer may violate. A task given here is a hard equality.
        names: one name for each level; by default the names of its tasks.
        damping: a policy for every level, or a list with a policy or None for each: see `hqp_rp.core.level_damping`. A level
            whose target may be out of reach, or whose way may be blocked by limits, needs it: without, the exact answer of
            each step jumps between bounds. For a position above an orientation above a posture the page "Still at the limit"
            found `[ErrorDamping(reach * max(0.05 / gain, dt), power=1), ErrorDamping(1 / gain, power=1), None]`, reach in m.
            The error there is the level's rate, gain times error, so that a target at rest is reached exactly. None
            takes over the `lm_damping` of tasks of mink and pink, where they have one.
        metric: what the freedom that all levels leave is measured in, and every pseudo-inverse weighted by
            (`hqp_rp.core.metric`): "inertia", the joint-space inertia M(q), for what is dynamically consistent; or
            weights > 0 by
            joint name or pattern, 1 for the others: a joint of weight 100 moves a hundred times less than its neighbour where
            either would do; or (nv,) weights. None is the plain norm.

    Raises:
        SettingError: no level, an empty level, names, damping or a metric that do not fit, or an item that is none of these.

    Warns:
        UserWarning: a hard `TorqueLimit` beside a hard `JointLimit` without an acceleration, which asks for stops within one
            step; where some joints have one, when the stack first meets a robot on which others have not.
    """

    __slots__ = (
        "_configurations",
        "_counts",
        "_damping",
        "_displacement_tasks",
        "_dt",
        "_ends",
        "_hard",
        "_hard_rows",
        "_items",
        "_levels",
        "_limits",
        "_metric",
        "_names",
        "_needs_dt",
        "_offsets",
        "_policies",
        "_rows",
        "_tells_causes",
        "_two_sided",
    )

    _of_velocities: ClassVar[bool] = True

    def __init__(
        self,
        levels: Sequence[Item | Sequence[Item]],
        limits: Sequence[Item] = (),
        *,
        names: Sequence[str] | None = None,
        damping: LevelDamping | Sequence[LevelDamping | None] | None = None,
        metric: StackMetric = None,
    ) -> None:
        self._metric = MetricOnRobot(metric)
        self._configurations: dict[str, Configurations] = {}  # by library
        if not isinstance(levels, list | tuple) or not levels:
            raise SettingError(f"levels is {levels!r}; give a list with at least one level, most important first.")
        if not isinstance(limits, list | tuple):
            raise SettingError(f"limits is {limits!r}; give a list of limits, empty for none.")
        self._levels = tuple(_as_level(level, k) for k, level in enumerate(levels))
        self._limits = tuple(limits)
        adapted = [[self._adapt(item, f"level {k + 1}") for item in level] for k, level in enumerate(self._levels)]
        self._items = [pair for level in adapted for pair in level]
        self._ends = np.cumsum([len(level) for level in adapted]).tolist()
        self._hard = [self._adapt(item, "limits") for item in self._limits]
        warn_of_hard_torques([item for _, item in self._hard])
        self._damping = _level_damping(damping, len(adapted))
        self._policies = self._damping if any(self._damping) else None
        levels_of = [k for k, level in enumerate(adapted) for _ in level]
        # Of tasks of mink and pink whose own damping counts: level, position among all items, hard ones first, and the task.
        self._displacement_tasks = [
            (k, len(self._hard) + i, item)
            for i, (k, (kind, item)) in enumerate(zip(levels_of, self._items, strict=True))
            if kind == DISPLACEMENT_TASK and self._damping[k] is None
        ]
        self._names = _level_names(names, adapted)
        boxes = any(isinstance(item, JointLimit | VelocityLimit) for _, item in self._hard)
        self._tells_causes = self._of_velocities and boxes
        self._needs_dt = any(kind != TASK for kind, _ in (*self._items, *self._hard))
        self._two_sided = any(kind == LIMIT for kind, _ in self._items)
        self._rows: StackRows | None = None
        self._dt: float | None = None
        # Of the levels, and of the levels below the hard rows; how many of these there are.
        self._counts: list[int] = []
        self._offsets = (np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))
        self._hard_rows = 0

    @property
    def levels(self) -> tuple[tuple[Item, ...], ...]:
        """The items of each level as they were given."""
        return self._levels

    @property
    def limits(self) -> tuple[Item, ...]:
        """The hard limits as they were given."""
        return self._limits

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each level."""
        return self._names

    @property
    def damping(self) -> tuple[LevelDamping | None, ...]:
        """The damping of each level as it was given; mink's and pink's own is not among it."""
        return self._damping

    @property
    def metric(self) -> StackMetric:
        """The metric as it was given."""
        return self._metric.stated

    def problem(
        self, robot: Robot, dt: float | None = None, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> Problem:
        """The prioritized problem at the robot's current configuration.

        Every array is fresh and read-only: a problem stays as it is when the robot moves on.

        Args:
            robot: at its current configuration; `robot.update(q)` sets it.
            dt: > 0, s, for how long the answer will be held. Needed by limits and by tasks of mink and pink only. When
                first given, it is compared with the gains.
            v: (nv,) velocity before this step, rad/s or m/s. Needed by limits on accelerations only.
            a: (nv,) acceleration before this step, (v - velocity before v) / dt, rad/s^2 or m/s^2. Needed by limits on jerks
                only, and looked at for them only.

        Raises:
            SettingError: dt, v or a missing or out of range.
            RobotError: a frame or joint that the robot does not have.
            ProblemError: rows that do not fit together or are not finite; it names the level and the item.

        Warns:
            UserWarning: a dt of more than 1 s, or gain * dt > 1; when it first meets a robot, a `JointLimit()` on a model
                without velocity limits.
        """
        rows = self._rows
        if rows is None or rows.robot is not robot:
            rows = self._meet(robot)
        if dt is None:
            if self._needs_dt:
                raise SettingError(
                    "this stack holds limits, or tasks of mink or pink; they need the time step: problem(robot, dt)."
                )
        elif type(dt) is not float or dt != self._dt:
            dt = self._checked_dt(dt)
        velocity = None if v is None else checked_motion(v, robot, "v", "rad/s or m/s")
        matrix, lower, upper, damping = self._filled(rows, robot, dt, velocity, a)
        offsets, hard_rows = self._offsets[0], self._hard_rows
        metric = self._metric.on(robot)
        kept: dict[str, Any] | None = None
        if self._hard:
            # What names them, and what made their bounds, is asked for later: of this robot and this step.
            named = robot, self._hard, rows.counts, self._of_velocities
            if self._tells_causes and dt is not None:
                before = None if velocity is None else velocity.copy()
                kept = {ROW_NAMES: functools.partial(rows_in_words, *named, dt, before, lower, upper)}
            else:
                kept = {ROW_NAMES: functools.partial(rows_in_words, *named)}
            if not hard_rows:  # limits without a row at present
                kept["hard"] = Level(np.zeros((0, robot.nv)), [], [], name="limits")
        if self._two_sided:
            counts = rows.counts[len(self._hard) :]
            stated = functools.partial(rows_in_words, robot, self._items, counts, self._of_velocities)
            kept = {**(kept or {}), LEVEL_ROW_NAMES: stated}
        return Problem.from_rows(
            matrix, lower, upper, offsets, self._names, hard_rows, not self._two_sided, damping, metric, kept
        )

    def _filled(
        self, rows: StackRows, robot: Robot, dt: float | None, v: FloatArray | None, a: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, FloatArray, tuple[LevelDamping | None, ...] | None]:
        """Matrix, lower and upper of all rows, hard ones first, and the damping of the levels; dt and v were checked."""
        if a is not None:
            a = checked_motion(a, robot, "a", "rad/s^2 or m/s^2") if rows.is_jerked else None
        for configurations in self._configurations.values():
            configurations.expire()

        matrix, lower, upper = rows.rows(dt, v, a)
        if rows.counts is not self._counts:
            self._count(rows)
        damping = self._policies
        if self._displacement_tasks:
            damping = self._with_theirs(rows, lower, dt)
        return matrix, lower, upper, damping

    def batch(
        self,
        robot: Robot,
        q: ArrayLike,
        dt: float | None = None,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        *,
        threads: int | None = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray | None, IntArray]:
        """The problems at many configurations, as `hqp_rp.solve_batch` takes them: A, lower, upper, offsets.

        Where all items are the library's own tasks, their rows come from one native call; on a robot made from a `DHArm`
        its kinematics do as well (see `hqp_rp.robot.frame_batch`). Otherwise the robot is moved from one configuration to
        the next. It is put back where it was.

        Args:
            robot: any `Robot`. q: (N, nq) configurations, N >= 1.
            dt, v, a: as for `problem`; v and a (nv,) for all.
            threads: how many share native work; None means one for each core.

        Returns A (N, M, nv), lower (N, M), upper (N, M) or None where every row is an equality, and offsets (p + 1,).

        Raises:
            SettingError: a stack with hard limits, damping or a metric, which a batch cannot hold; otherwise as `problem`.
            RobotError: q of another shape or not finite; otherwise as `problem`.
            ProblemError: an item whose number of rows differs between the configurations; otherwise as `problem`.
        """
        if self._policies or any(task.lm_damping for _, _, task in self._displacement_tasks):
            raise SettingError(f"{self!r} has damped levels, which a batch cannot hold; call problem() for each q.")
        if self._metric.stated is not None:
            raise SettingError(f"{self!r} has a metric, which a batch cannot hold; call problem() for each q.")
        if self._hard:
            raise SettingError(
                f"{self!r} has hard limits, which a batch cannot hold; list them as a level, or call problem() for each q."
            )
        rows = self._rows
        if rows is None or rows.robot is not robot:
            rows = self._meet(robot)
        configurations = np.array(q, dtype=np.float64)
        if configurations.ndim != 2 or configurations.shape[1] != robot.nq or not len(configurations):
            raise RobotError(f"q has shape {configurations.shape}; it must be (N, {robot.nq}) with N at least 1.")
        if rows.is_native and not self._needs_dt:
            if not np.isfinite(configurations).all():
                i, j = np.argwhere(~np.isfinite(configurations))[0]
                raise RobotError(f"q[{i}, {j}] is {configurations[i, j]}; every entry must be finite.")
            A, lower = rows.many(configurations, threads)
            self._count(rows)
            return A, lower, None, self._offsets[0]
        before = robot.q
        try:
            problems = []
            for configuration in configurations:
                robot.update(configuration)
                problems.append(self.problem(robot, dt, v, a))
        finally:
            robot.update(before)
        offsets = problems[0].offsets
        for i, problem in enumerate(problems):
            if not np.array_equal(problem.offsets, offsets):
                raise ProblemError(
                    f"At q[{i}] the levels end at rows {problem.offsets[1:].tolist()}, at q[0] at {offsets[1:].tolist()}; a "
                    "batch needs the same rows everywhere. Call problem() for each q."
                )
        A, lower, upper = (
            np.stack([getattr(problem, name) for problem in problems]) for name in ("matrix", "lower", "upper")
        )
        return A, lower, None if all(problem.is_equality for problem in problems) else upper, offsets

    def _checked_dt(self, dt: object) -> float:
        """dt as a number; a step that is long, or longer than a gain allows, is said, once for each dt."""
        self._dt = value = positive_number(dt, "dt")
        if value > _LONG:
            warn(
                f"dt is {value:g} s: the answer is meant to be held that long. A rate of {value:g} Hz is dt = {1.0 / value:g}."
            )
            return value
        for where, item in self._places():
            told = self._too_quick(item, value)
            if told is not None:
                warn(f"{where}: {item.name!r} has {told}")
        return value

    def _too_quick(self, item: Any, dt: float) -> str | None:
        """What is wrong with the gains of an item at this dt, or None."""
        gain = float(np.max(item.gain)) if isinstance(item, FeedbackTask) else 0.0
        if gain * dt <= 1.0 + 1e-9:
            return None
        return (
            f"gain {gain:g} 1/s at dt {dt:g} s: each step goes {gain * dt:.3g} times the way to the target, past it. Take a "
            f"gain of at most 1/dt = {1.0 / dt:g}."
        )

    def _with_theirs(
        self, rows: StackRows, lower: FloatArray, dt: float | None
    ) -> tuple[LevelDamping | None, ...] | None:
        """The damping of this step: their mu = lm_damping |w alpha e|^2 in its unit, where a displacement is v dt."""
        damped = [(k, i, task.lm_damping) for k, i, task in self._displacement_tasks if task.lm_damping]
        if not damped or dt is None:
            return self._policies
        mu, ends = [0.0] * len(self._damping), np.cumsum(rows.counts)
        for k, i, factor in damped:
            rate = lower[ends[i] - rows.counts[i] : ends[i]]
            mu[k] += factor * float(rate @ rate) * dt**2
        policies = tuple(
            ConstantDamping(math.sqrt(mu_k)) if mu_k > 0.0 else own for mu_k, own in zip(mu, self._damping, strict=True)
        )
        return policies if any(policies) else None

    def _count(self, rows: StackRows) -> None:
        """Find where levels begin and end, from the rows of each item: hard ones first."""
        ends = np.cumsum([0, *rows.counts])
        below = ends[[0, len(self._hard), *(len(self._hard) + end for end in self._ends)]]
        self._offsets = (below[1:] - below[1], below)
        self._hard_rows, self._counts = int(below[1]), rows.counts

    def _outline(self, n: int) -> Problem:
        """What is known of every problem of this stack before there is a robot, as a problem of n unknowns."""
        damping = list(self._damping)
        for k, _, task in self._displacement_tasks:
            if task.lm_damping:
                damping[k] = ConstantDamping(1.0)
        return outline(
            n,
            self._names,
            two_sided=self._two_sided,
            hard=str(self._hard[0][1].name) if self._hard else "",
            damping=damping,
            metric=self._metric.kind,
        )

    def _meet(self, robot: Robot) -> StackRows:
        """What makes the rows on this robot, once it is seen to have what the items name."""
        if not isinstance(robot, Robot):
            library = type(robot).__module__.partition(".")[0]
            ours = {"pink": "PinocchioRobot", "mink": "MujocoRobot"}.get(library)
            if ours is not None:
                raise RobotError(
                    f"robot is a {library} {type(robot).__name__}; give a robot made of its model: "
                    f"robot = hqp_rp.robot.{ours}(configuration.model), robot.update(configuration.q)."
                )
            raise RobotError(
                f"robot is a {type(robot).__name__}; give a robot with the methods of hqp_rp.robot.Robot, such as a "
                "MujocoRobot, or a PinocchioRobot for tasks of pink."
            )
        for where, item in self._places():
            check_frames(robot, getattr(item, "frames", ()), f"{where}: {item.name!r}")
        items = [item for _, item in (*self._hard, *self._items)]
        warn_of_couplings(items, robot)
        warn_of_speeds(items, robot)
        warn_of_hard_torques_on([item for _, item in self._hard], robot)
        two_sided = self._two_sided or bool(self._hard)
        self._rows = rows = self._rows_on(robot, two_sided)
        self._count(rows)
        return rows

    def _rows_on(self, robot: Robot, two_sided: bool) -> StackRows:
        return StackRows((*self._hard, *self._items), robot, two_sided, self._where)

    def _places(self) -> Iterator[tuple[str, Any]]:
        level = 0
        for position, (_, item) in enumerate(self._items):
            while position >= self._ends[level]:
                level += 1
            yield f"level {level + 1}", item
        for _, item in self._hard:
            yield "limits", item

    def _where(self, item: Any) -> str:
        return next((f"{where}: {item.name!r}" for where, other in self._places() if other is item), repr(item))

    def _adapt(self, item: Any, where: str) -> tuple[int, Any]:
        """What kind of item it is, and the item or its adapter."""
        library = library_of(item)
        if library is not None:  # and only then is it imported
            adapter = importlib.import_module(f"hqp_rp.control.{library}_adapter")
            adapted = adapter.adapt(item, self._configurations)
            if adapted is not None:
                return (DISPLACEMENT_TASK if isinstance(adapted, DisplacementTask) else LIMIT), adapted
        if not isinstance(item, type):
            if isinstance(item, Task):
                return TASK, item
            if isinstance(item, Limit):
                return LIMIT, item
        shown = f"the class {item.__name__}" if isinstance(item, type) else repr(item)
        raise SettingError(f"{where} holds {shown}, which is neither {_MEANT}; give one of these.")

    def __repr__(self) -> str:
        hard = f", {len(self._limits)} hard" if self._limits else ""
        return f"{type(self).__name__}({' > '.join(self._names)}{hard})"

    def _repr_html_(self) -> str:
        from hqp_rp.core.html import table

        levels = zip(self._names, self._levels, self._damping, strict=True)
        rows = [
            (str(k + 1), name, _described(items), "" if policy is None else repr(policy))
            for k, (name, items, policy) in enumerate(levels)
        ]
        rows = [("hard", "limits", _described(self._limits), ""), *rows] if self._limits else rows
        metric = "" if self.metric is None else f", metric {self.metric!r}"
        return table(f"{type(self).__name__}{metric}", ("level", "name", "holds", "damping"), rows)


def _described(items: Sequence[Item]) -> str:
    """The kinds and names of tasks and limits."""
    return ", ".join(f"{type(item).__name__} {getattr(item, 'name', '')}".rstrip() for item in items)


def _as_level(level: Item | Sequence[Item], k: int) -> tuple[Item, ...]:
    if not isinstance(level, list | tuple):
        return (level,)
    if not level:
        raise SettingError(f"level {k + 1} is empty; give it at least one task, or leave the level out.")
    return tuple(level)


def _level_names(names: Sequence[str] | None, levels: list[list[tuple[int, Any]]]) -> tuple[str, ...]:
    if names is None:
        return tuple(" + ".join(str(item.name) for _, item in level) for level in levels)
    if isinstance(names, str) or len(names) != len(levels):
        raise SettingError(f"names is {names!r}; give one name for each of the {len(levels)} levels.")
    return tuple(str(name) for name in names)


def _level_damping(
    damping: LevelDamping | Sequence[LevelDamping | None] | None, levels: int
) -> tuple[LevelDamping | None, ...]:
    if not isinstance(damping, list | tuple):
        return (checked_level_damping(damping),) * levels
    if len(damping) != levels:
        raise SettingError(
            f"damping has {len(damping)} entries for {levels} levels; give one policy or None for each, or one for all."
        )
    return tuple(checked_level_damping(policy, f"damping of level {k + 1}") for k, policy in enumerate(damping))
