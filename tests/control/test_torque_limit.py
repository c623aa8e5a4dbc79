"""Torque rows against MuJoCo's own integration, and both robot libraries."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import Limit, PostureTask, Stack, TorqueLimit
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.solution import Status
from hqp_rp.robot import MujocoRobot, PinocchioRobot, planar_arm, sawyer
from tests.control.chain import random_chain
from tests.robot.models import MIXED_MJCF

DT = 0.002


def free_model() -> mujoco.MjModel:
    """The Sawyer without servos, friction, limits, gravity compensation or contacts: M a + h + g = tau and nothing else."""
    spec = hqp_rp.robot.arm_spec(sawyer(), timestep=DT, gravity_compensation=False)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for joint in spec.joints:
        joint.damping = [0.0, 0.0, 0.0]
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    return spec.compile()


def test_the_rows_are_the_torque_that_leads_the_simulation_to_v() -> None:
    robot, rng = MujocoRobot(free_model()), np.random.default_rng(0)
    data = mujoco.MjData(robot.model)
    limit = TorqueLimit(50.0)
    assert isinstance(limit, Limit)
    for _ in range(20):
        q, v, torque = rng.normal(size=7), rng.normal(size=7), rng.uniform(-50, 50, 7)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, torque
        mujoco.mj_step(robot.model, data)
        robot.update(q)
        G, lower, upper = limit.rows(robot, DT, v)
        np.testing.assert_allclose(G @ data.qvel - lower - 50.0, torque, atol=1e-8)
        np.testing.assert_allclose(upper - lower, 100.0)
        np.testing.assert_allclose(limit.torque(robot, DT, v, data.qvel), torque, atol=1e-8)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), coriolis=st.booleans(), gravity=st.booleans())
def test_both_libraries_agree_and_the_parts_add_up(seed: int, coriolis: bool, gravity: bool) -> None:
    rng = np.random.default_rng(seed)
    arm = planar_arm(4, gravity=(1.0, -9.0, 3.0)) if seed % 2 else sawyer()
    q, v = rng.normal(size=arm.n), rng.normal(size=arm.n)
    found = []
    for robot in (MujocoRobot.from_arm(arm), PinocchioRobot.from_arm(arm)):
        robot.update(q)
        found.append(TorqueLimit(9.0, coriolis=coriolis, gravity=gravity).rows(robot, 0.01, v))
        M, g, h = robot.mass_matrix(), robot.gravity(), robot.bias(v) - robot.gravity()
        expected = M @ v / 0.01 - coriolis * h - gravity * g
        np.testing.assert_allclose(0.5 * (found[-1][1] + found[-1][2]), expected, atol=1e-9)
        np.testing.assert_allclose(robot.bias(np.zeros(arm.n)), g, atol=1e-12)
        # h is quadratic in v, and the robot's own state stays at rest.
        np.testing.assert_allclose(robot.bias(3.0 * v) - g, 9.0 * h, atol=1e-8)
        np.testing.assert_array_equal(robot.gravity(), g)
    for first, second in zip(*found, strict=True):
        np.testing.assert_allclose(first, second, atol=1e-8)


def test_bias_of_a_floating_base_is_what_accelerates_a_robot_without_torque() -> None:
    robot, rng = MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF)), np.random.default_rng(1)
    robot.model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(robot.model)
    data.qpos[:], data.qvel[:] = rng.normal(size=robot.nq), rng.normal(size=robot.nv)
    mujoco.mj_forward(robot.model, data)
    robot.update(data.qpos)
    np.testing.assert_allclose(robot.mass_matrix() @ data.qacc + robot.bias(data.qvel), 0.0, atol=1e-9)


@pytest.mark.parametrize("hard", [True, False])
def test_in_closed_loop_the_torque_stays_within_its_limit(hard: bool) -> None:
    robot = MujocoRobot(free_model())
    torque = np.array([40.0, 80.0, 30.0, 40.0, 8.0, 8.0, 3.0])
    limit, posture = TorqueLimit(torque), PostureTask(robot.neutral + 0.6, gain=20.0)
    stack = Stack([posture], [limit]) if hard else Stack([limit, posture])
    q, v = robot.neutral.copy(), np.zeros(7)
    worst, reached = 0.0, []
    for _ in range(150):
        robot.update(q)
        solution = hqp_rp.solve(stack.problem(robot, DT, v), "qp_cascade")
        assert solution.status is Status.SOLVED
        assert solution.x is not None
        worst = max(worst, float((np.abs(limit.torque(robot, DT, v, solution.x)) / torque).max()))
        q, v = q + DT * solution.x, solution.x
        reached.append(float(np.abs(posture.error(robot)).max()))
    assert worst == pytest.approx(1.0, abs=1e-6)
    assert reached[-1] < 0.5 * reached[0]


def test_only_the_limited_velocities_have_rows() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    G, lower, _ = TorqueLimit({"joint2": 3.0, "joint6": 1.0}).rows(robot, 0.01, np.zeros(7))
    np.testing.assert_allclose(G, robot.mass_matrix()[[1, 5]] / 0.01)
    np.testing.assert_allclose(lower, -np.array([3.0, 1.0]) - robot.gravity()[[1, 5]])


def test_errors() -> None:
    robot = random_chain(np.random.default_rng(0))
    with pytest.raises(SettingError, match=r"the limit of 'joint torque' is None"):
        TorqueLimit(None)
    with pytest.raises(SettingError, match=r"the limit of 'joint torque' is 0.0; it must be > 0"):
        TorqueLimit(0.0)
    with pytest.raises(SettingError, match=r"needs the velocity before this step: stack.problem\(robot, dt, v\)"):
        TorqueLimit(1.0).rows(robot, 0.01, None)
    with pytest.raises(RobotError, match=r"a Chain has no method bias\(v\) for the Coriolis torque.*coriolis=False"):
        TorqueLimit(1.0).rows(robot, 0.01, np.zeros(7))
    with pytest.raises(RobotError, match=r"every limit is infinite; give a number to one joint at least"):
        TorqueLimit(np.inf, coriolis=False).rows(robot, 0.01, np.zeros(7))
    with pytest.raises(RobotError, match=r"no joint named 'knee'"):
        TorqueLimit({"knee": 1.0}, coriolis=False).rows(robot, 0.01, np.zeros(7))
