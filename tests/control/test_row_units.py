"""In which unit the rows of limits are told: of both robot libraries, and of all kinds of stacks."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    JointCoupling,
    JointLimit,
    LockedJoints,
    PositionTask,
    Stack,
    TorqueLimit,
    TorqueStack,
)
from hqp_rp.control._row_names import effort_units, velocity_units
from hqp_rp.core.row_names import row_names
from hqp_rp.robot import Coupling, MujocoRobot, PinocchioRobot
from hqp_rp.robot.robot import Robot

LIFT = """<mujoco><compiler angle="radian"/><worldbody><body name="base">{}<geom size="0.1" mass="1"/>
<body name="mast" pos="0 0 0.5"><joint name="rise" type="slide" axis="0 0 1" range="-1 1"/><geom size="0.1" mass="1"/>
<body name="arm" pos="0.5 0 0"><joint name="turn" axis="0 1 0" range="-1 1"/><geom size="0.1" mass="1" pos="0.3 0 0"/>{}
</body></body></body></worldbody></mujoco>"""
FREE = ["m/s"] * 3 + ["rad/s"] * 3
MAKERS: list[Any] = [MujocoRobot, PinocchioRobot.from_mujoco]


def lift(make: Any, *, base: str = "", hand: str = "") -> Any:
    """A slide and a hinge above it, made by either library."""
    robot = make(mujoco.MjModel.from_xml_string(LIFT.format(base, hand)))
    robot.update(robot.neutral)
    return robot


@pytest.mark.parametrize("make", MAKERS)
def test_units_of_every_kind_of_joint(make: Any) -> None:
    ball = '<body name="hand" pos="0.5 0 0"><joint name="ball" type="ball"/><geom size="0.1" mass="1"/></body>'
    assert velocity_units(lift(make)) == ["m/s", "rad/s"]
    floating = lift(make, base='<freejoint name="base"/>', hand=ball)
    assert velocity_units(floating) == [*FREE, "m/s", "rad/s", *["rad/s"] * 3]
    assert effort_units(floating) == [*["N"] * 3, *["N m"] * 3, "N", "N m", *["N m"] * 3]


def test_units_of_joints_that_pinocchio_alone_has() -> None:
    import pinocchio as pin

    def robot_with(joint: Any) -> PinocchioRobot:
        model = pin.Model()
        number = model.addJoint(0, joint, pin.SE3.Identity(), "joint")
        model.appendBodyToJoint(number, pin.Inertia.Random(), pin.SE3.Identity())
        return PinocchioRobot(model)

    for joint, units in (
        (pin.JointModelPlanar(), ["m/s", "m/s", "rad/s"]),
        (pin.JointModelTranslation(), ["m/s"] * 3),
        (pin.JointModelSphericalZYX(), ["rad/s"] * 3),
        (pin.JointModelPrismaticUnaligned(1.0, 2.0, 0.0), ["m/s"]),
        (pin.JointModelRUBX(), ["rad/s"]),
    ):
        assert velocity_units(robot_with(joint)) == units


class Other(Robot):
    """A robot of a library of one's own, whose model tells nothing."""

    joint_names, nv = ("a", "b"), 2
    model = None


def test_a_robot_that_does_not_tell_gets_both() -> None:
    assert velocity_units(Other()) == ["rad/s or m/s"] * 2  # type: ignore[abstract]
    assert effort_units(Other()) == ["N m or N"] * 2  # type: ignore[abstract]


@pytest.mark.parametrize("make", MAKERS)
def test_units_of_rows_in_every_stack(make: Any) -> None:
    robot = lift(make)
    limits = [
        JointLimit(velocity=1.0, acceleration=5.0),
        TorqueLimit({"rise": 200.0, "turn": 50.0}),
        LockedJoints(["rise"]),
        JointCoupling([Coupling("turn", "rise", (0.0, 2.0))]),
    ]
    task, v = PositionTask("arm", np.zeros(3)), np.zeros(2)
    velocity = ["m/s", "rad/s", "N", "N m", "m/s", "rad/s"]
    acceleration = ["m/s^2", "rad/s^2", "N", "N m", "m/s^2", "rad/s^2"]

    def units(stack: Any) -> list[str]:
        return [name.unit for name in row_names(stack.problem(robot, 0.01, v))]

    assert units(Stack([task], limits)) == velocity
    assert units(AccelerationStack([task], limits)) == acceleration
    assert units(TorqueStack([task], limits, torque=100.0)) == ["N", "N m", *acceleration]
    floating = lift(make, base='<freejoint name="base"/>')
    problem = TorqueStack([task], [JointLimit(acceleration=5.0, velocity=1.0)], torque=9.0).problem(
        floating, 0.01, np.zeros(8)
    )
    accelerations = [f"{unit}^2" for unit in (*FREE, "m/s", "rad/s")]
    expected = [*["N"] * 3, *["N m"] * 3, "N", "N m", *accelerations]  # equation of motion, torques, limits
    assert [name.unit for name in row_names(problem)] == expected


def test_a_torque_that_is_not_enough_is_told_in_newton_metres() -> None:
    """Of a stack of accelerations: what the arm's weight takes, and not that over the time step."""
    robot = lift(MujocoRobot)
    still = LockedJoints(["rise", "turn"])
    for dt in (0.001, 0.01):
        stack = AccelerationStack([PositionTask("arm", np.zeros(3))], [TorqueLimit({"turn": 1.0}), still])
        conflict = hqp_rp.solve(stack.problem(robot, dt, np.zeros(2)), "hierarchical_active_set").conflict
        assert conflict is not None
        (k,) = (i for i, name in enumerate(conflict.names) if name.startswith("joint torque: turn "))
        assert conflict.units[k] == "N m"
        assert abs(conflict.bounds[k]) == pytest.approx(abs(robot.gravity()[1]) - 1.0)
