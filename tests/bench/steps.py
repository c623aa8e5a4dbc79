"""A whole control step, timed: kinematics, tasks and solve, on the Sawyer and on a humanoid, ours beside mink."""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.stack import Stack
from hqp_rp.core.problem import FloatArray, Problem
from tests.bench.entrants import Entrant, not_installed, our_entrants

say = Sentences(__file__)

STEP_FAMILIES = ("step_sawyer", "step_sawyer_limits", "step_humanoid")
"""Names of the whole control steps, for `--family`."""

DT = 0.01
"""s, for how long mink's answer is held; ours is a velocity."""

GAIN = 2.0
"""1/s, of every task; mink's gain is this times `DT`, so that both ask for the same velocity."""

COSTS = (1e2, 1.0, 1e-2, 1e-4)
"""mink and its kin have weights in place of priorities: the cost of each level's tasks. The least one squared is far above
the damping (1e-12) that mink and pink add, and the regularization of placo."""

STEPPERS = ("null space", "reverse priority", "active set, cold", "active set, warm", "DAQP hierarchy", "QP ProxQP")
"""Labels of our entrants that take part; warm starts pay here, since configurations are neighbours."""

_STEPS = 400


@dataclasses.dataclass(frozen=True, slots=True)
class StepFamily:
    """A robot on a closed path of configurations, and one stack, as ours and as mink's tasks.

    Attributes:
        name, title, words: as of a `Family`.
        robot: what `hqp_rp.control.Stack` needs. stack: ours. configurations: (N, nq).
        mink_levels: mink's tasks, level by level, or None when mink is not installed.
        limited: joint position limits are hard rows, for mink its own `ConfigurationLimit`.
    """

    name: str
    title: str
    words: str
    robot: Any
    stack: Stack
    configurations: FloatArray
    mink_levels: tuple[tuple[Any, ...], ...] | None
    limited: bool = False


@dataclasses.dataclass(frozen=True, slots=True)
class Stepper:
    """One who makes a whole control step.

    Attributes:
        label, peer, settings: as of an `Entrant`. calls: one for each configuration. answer: v (nv,) from what it returned.
        problems: what its answers are judged by, one for each configuration.
    """

    label: str
    peer: bool
    settings: str
    calls: tuple[Callable[[], Any], ...]
    answer: Callable[[Any], FloatArray | None]
    problems: Sequence[Problem]


def step_family(name: str, *, quick: bool = False) -> StepFamily:
    """ "step_sawyer" (position, orientation, posture), "step_sawyer_limits" (the same within the joint limits) or
    "step_humanoid" (soles, centre of mass, hands, posture)."""
    from hqp_rp.robot.named import named_robot

    robot: Any = named_robot("humanoid" if name == "step_humanoid" else "sawyer")
    rng = np.random.default_rng(7)
    count = 64 if quick else _STEPS
    wave = rng.uniform(0.0, 2.0 * np.pi, robot.nv)
    size = np.full(robot.nv, 0.3)
    if name == "step_humanoid":
        size[:6] = 0.02
    configurations = np.array(
        [robot.integrate(robot.neutral, size * np.sin(2.0 * np.pi * i / count + wave), 1.0) for i in range(count)]
    )
    robot.update(robot.neutral)
    mink_there = importlib.util.find_spec("mink") is not None
    limited = name == "step_sawyer_limits"
    if name != "step_humanoid":
        stack, theirs = _sawyer(robot, mink_there)
        title = "step: Sawyer, limits" if limited else "step: Sawyer"
        words = say("sawyer_step", limited=limited)
        if limited:
            stack = Stack(stack.levels, limits=[JointLimit(velocity=np.inf)])
    else:
        stack, theirs = _humanoid(robot, mink_there)
        title = "step: humanoid"
        words = say("humanoid_step", joints=robot.nv - 6, velocities=robot.nv)
    return StepFamily(name, title, words, robot, stack, configurations, theirs, limited)


def _sawyer(robot: Any, mink_there: bool) -> tuple[Stack, tuple[tuple[Any, ...], ...] | None]:
    from hqp_rp.control.orientation_task import OrientationTask
    from hqp_rp.control.position_task import PositionTask
    from hqp_rp.control.posture_task import PostureTask

    rotation, position = robot.pose("tool")
    ours = Stack(
        [
            PositionTask("tool", position, gain=GAIN),
            OrientationTask("tool", rotation, gain=GAIN),
            PostureTask(robot.neutral, gain=GAIN),
        ]
    )
    if not mink_there:
        return ours, None
    import mink

    configuration = mink.Configuration(robot.model, robot.neutral)
    tasks: tuple[Any, ...] = (
        mink.FrameTask("tool", "site", COSTS[0], 0.0, gain=GAIN * DT),
        mink.FrameTask("tool", "site", 0.0, COSTS[1], gain=GAIN * DT),
        mink.PostureTask(robot.model, COSTS[2], gain=GAIN * DT),
    )
    for task in tasks:
        task.set_target_from_configuration(configuration)
    return ours, tuple((task,) for task in tasks)


_SOLES, _GRIPS = ("left_sole", "right_sole"), ("left_grip", "right_grip")


def _humanoid(robot: Any, mink_there: bool) -> tuple[Stack, tuple[tuple[Any, ...], ...] | None]:
    from hqp_rp.control.center_of_mass_task import CenterOfMassTask
    from hqp_rp.control.pose_task import PoseTask
    from hqp_rp.control.position_task import PositionTask
    from hqp_rp.control.posture_task import PostureTask

    ours = Stack(
        [
            [PoseTask(frame, robot.pose(frame), gain=GAIN) for frame in _SOLES],
            CenterOfMassTask(robot.center_of_mass(), gain=GAIN),
            [PositionTask(frame, robot.pose(frame)[1], gain=GAIN) for frame in _GRIPS],
            PostureTask(robot.neutral, joints=range(6, robot.nv), gain=GAIN),
        ]
    )
    if not mink_there:
        return ours, None
    import mink

    configuration = mink.Configuration(robot.model, robot.neutral)
    levels: tuple[tuple[Any, ...], ...] = (
        tuple(mink.FrameTask(frame, "site", COSTS[0], COSTS[0], gain=GAIN * DT) for frame in _SOLES),
        (mink.ComTask(COSTS[1], gain=GAIN * DT),),
        tuple(mink.FrameTask(frame, "site", COSTS[2], 0.0, gain=GAIN * DT) for frame in _GRIPS),
        (mink.PostureTask(robot.model, COSTS[3], gain=GAIN * DT),),
    )
    for level in levels:
        for task in level:
            task.set_target_from_configuration(configuration)
    return ours, levels


def steppers(family: StepFamily, peers: Sequence[str]) -> tuple[list[Stepper], list[str]]:
    """Ours, ours on mink's tasks, and `mink.solve_ik`; and a sentence for each peer that cannot be imported."""
    found = _ours(family, family.stack, STEPPERS, "")
    missing = []
    if "mink" in peers:
        if family.mink_levels is None:
            missing.append(not_installed("mink"))
        else:
            import mink

            limits = [mink.ConfigurationLimit(family.robot.model)] if family.limited else []
            stack = Stack(family.mink_levels, limits=limits)
            found += _ours(family, stack, STEPPERS[3:4] if family.limited else STEPPERS[:1], ", mink's tasks")
            judge = found[-1].problems
            found += [_mink(family, f"mink {solver}", solver, limits, judge) for solver in ("daqp", "proxqp")]
            if family.limited:
                found.append(_mink(family, "mink daqp, default call", "daqp", None, judge))
    return found, missing


def _ours(family: StepFamily, stack: Stack, labels: Sequence[str], suffix: str) -> list[Stepper]:
    robot, dt = family.robot, DT if suffix or family.limited else None
    problems = []
    for q in family.configurations:
        robot.update(q)
        problems.append(stack.problem(robot, dt))

    def stepper(entrant: Entrant) -> Stepper:
        solve = _solve_of(entrant, problems[0])

        def step(q: FloatArray) -> Any:
            robot.update(q)
            return solve(stack.problem(robot, dt))

        calls = tuple(functools.partial(step, q) for q in family.configurations)
        return Stepper(f"{entrant.label}{suffix}", False, entrant.settings, calls, entrant.answer, problems)

    chosen = {entrant.label: entrant for entrant in our_entrants()}
    return [
        stepper(chosen[label]) for label in labels if label in chosen and chosen[label].refuses(problems[0]) is None
    ]


def _solve_of(entrant: Entrant, problem: Problem) -> Callable[[Problem], Any]:
    """The entrant's public call, free of the problem that it was prepared with."""
    call = entrant.prepare([problem])[0]
    assert isinstance(call, functools.partial)
    solve: Callable[[Problem], Any] = call.func
    return solve


def _mink(
    family: StepFamily, label: str, solver: str, limits: list[Any] | None, problems: Sequence[Problem]
) -> Stepper:
    """`limits` None is the documented default: a `ConfigurationLimit`, which mink then builds at every call."""
    import mink

    assert family.mink_levels is not None
    configuration = mink.Configuration(family.robot.model)
    tasks = [task for level in family.mink_levels for task in level]

    def step(q: FloatArray) -> FloatArray:
        configuration.update(q)
        v: FloatArray = mink.solve_ik(configuration, tasks, DT, solver, limits=limits)
        return v

    calls = tuple(functools.partial(step, q) for q in family.configurations)
    names = None if limits is None else [type(limit).__name__ for limit in limits]
    settings = say("mink_call", dt=DT, solver=solver, limits=names, costs=COSTS)
    return Stepper(label, True, settings, calls, lambda v: v, problems)
