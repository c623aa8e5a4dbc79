"""The 7-joint arm of the whole steps, for every library: URDF, MJCF, configurations, targets, and the problem at each."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hqp_rp import OrientationTask, PositionTask, PostureTask, Problem, Stack
from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.robot.mujoco_arm import arm_spec

DT, GAIN, COUNT = 0.01, 2.0, 64


LOGARITHM = ("mink", "pink", "mink-warp")
"""Whose frame tasks ask for the SE(3) logarithm of the error, and not for position and orientation by themselves."""


def asked() -> tuple[dict[str, Any], dict[str, list[Problem]]]:
    """What a worker's `step` is given, and the prioritized problem (3+3+7) at each configuration: with rows of position and
    orientation ("plain"), and with the rows that mink's own frame tasks make ("logarithm")."""
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    rotation, position = robot.pose("tool")
    rotation, position = rotation.copy(), position.copy()
    wave = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, robot.nv)
    turns = 2.0 * np.pi * np.arange(COUNT) / COUNT
    configurations = robot.neutral + 0.3 * np.sin(turns[:, None] + wave)
    plain = [PositionTask("tool", position, gain=GAIN), OrientationTask("tool", rotation, gain=GAIN)]
    stacks = {"plain": Stack([*plain, PostureTask(robot.neutral, gain=GAIN)]), "logarithm": Stack(_mink_tasks(robot))}
    problems: dict[str, list[Problem]] = {name: [] for name in stacks}
    for q in configurations:
        robot.update(q)
        for name, stack in stacks.items():
            problems[name].append(stack.problem(robot, DT))
    spec = arm_spec(sawyer())
    spec.compile()
    given = {
        "urdf": urdf(),
        "mjcf": spec.to_xml(),
        "neutral": robot.neutral.tolist(),
        "position": position.tolist(),
        "rotation": rotation.tolist(),
        "configurations": configurations.tolist(),
        "gain": GAIN,
        "dt": DT,
    }
    return given, problems


def _mink_tasks(robot: MujocoRobot) -> list[Any]:
    import mink

    tasks = [
        mink.FrameTask("tool", "site", 1.0, 0.0, gain=GAIN * DT),
        mink.FrameTask("tool", "site", 0.0, 1.0, gain=GAIN * DT),
        mink.PostureTask(robot.model, 1.0, gain=GAIN * DT),
    ]
    configuration = mink.Configuration(robot.model, robot.neutral)
    for task in tasks:
        task.set_target_from_configuration(configuration)
    return tasks


def urdf() -> str:
    """The Sawyer as URDF: links world, one for each joint, tool. Angles in rad, lengths in m."""
    arm = sawyer()
    lines = [f'<robot name="{arm.name}">', '<link name="world"/>']
    parent = "world"
    for i, link in enumerate(arm.links):
        inertia = " ".join(f'i{"xyz"[a]}{"xyz"[b]}="{link.inertia[a, b]:.17g}"' for a in range(3) for b in range(a, 3))
        lines += [
            f'<link name="{link.name}"><inertial><origin xyz="{_numbers(link.center)}"/><mass value="{link.mass:.17g}"/>'
            f"<inertia {inertia}/></inertial></link>",
            f'<joint name="{link.joint}" type="revolute"><parent link="{parent}"/><child link="{link.name}"/>'
            f'{_origin(link.rotation, link.position)}<axis xyz="0 0 1"/><limit lower="{arm.lower[i]:.17g}" '
            f'upper="{arm.upper[i]:.17g}" velocity="{arm.velocity_limit[i]:.17g}" effort="1e3"/></joint>',
        ]
        parent = link.name
    lines += [
        '<link name="tool"/>',
        f'<joint name="to_tool" type="fixed"><parent link="{parent}"/><child link="tool"/>',
        f"{_origin(*arm.tool_placement)}</joint>",
        "</robot>",
    ]
    return "\n".join(lines)


def _origin(rotation: Any, position: Any) -> str:
    return f'<origin xyz="{_numbers(position)}" rpy="{_numbers(Rotation.from_matrix(rotation).as_euler("xyz"))}"/>'


def _numbers(vector: Any) -> str:
    return " ".join(f"{float(number):.17g}" for number in vector)
