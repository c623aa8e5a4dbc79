"""The torque loop in MuJoCo: it stands, is pushed, lifts a foot without a jump, and never sends what it must not."""

import mujoco
import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import Contact, Mode, PostureTask, TorqueController, TorqueStack
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.robot.named import ASSETS, named_robot
from tests.control.test_torque_stack import standing

ASSET = ASSETS / "humanoid.xml"


class Failing(hqp_rp.Solver):
    """Answers as told."""

    name, summary, source = "failing", "", ""
    takes_hard = takes_inequalities = True
    how = "solve"

    def solve(self, problem, secondary=None):
        if self.how == "raise":
            raise RuntimeError("broken")
        if self.how == "nan":
            return hqp_rp.Solution(problem, np.full(problem.n, np.nan))
        if self.how == "none":
            return hqp_rp.Solution(problem, None, hqp_rp.Status.INFEASIBLE, message="Nothing.")
        return hqp_rp.solve(problem, "hierarchical_active_set", secondary=secondary)


@pytest.mark.parametrize("how", ["raise", "nan", "none"])
def test_a_failed_solve_holds_with_gravity_compensation(how):
    robot, _, stack = standing()
    robot.update(robot.neutral)
    solver = Failing()
    controller = TorqueController(stack, solver)
    assert controller.step(robot, 0.002, np.zeros(robot.nv)).mode is Mode.RUNNING
    object.__setattr__(solver, "how", how)
    command = controller.step(robot, 0.002, np.zeros(robot.nv))
    assert command.mode is Mode.HOLDING
    assert command.reason
    assert controller.failures == 1
    # At rest it is the static torque: gravity less what the soles carry, which balances the base.
    static = stack.holding_torque(robot, np.zeros(robot.nv), 5.0)
    np.testing.assert_array_equal(command.torque, static)
    jacobian = stack.dynamics(stack.problem(robot, 0.002, np.zeros(robot.nv))).contact_jacobian
    forces = np.linalg.lstsq(jacobian[:, :6].T, robot.gravity()[:6], rcond=None)[0]
    np.testing.assert_allclose(static, np.clip((robot.gravity() - jacobian.T @ forces)[6:], -120.0, 120.0), atol=1e-6)
    object.__setattr__(solver, "how", "solve")
    assert controller.step(robot, 0.002, np.zeros(robot.nv)).mode is Mode.RUNNING
    assert controller.failures == 0


@pytest.mark.parametrize("v", [np.full(35, np.nan), np.full(35, 1e300), np.zeros(3), "fast", None])
def test_a_velocity_that_is_none_holds(v):
    robot, _, stack = standing()
    robot.update(robot.neutral)
    controller = TorqueController(stack, "hierarchical_active_set")
    with pytest.raises(HqpError):
        TorqueController(stack, "hierarchical_active_set").step(robot, 0.002, np.full(35, np.nan))
    controller.step(robot, 0.002, np.zeros(robot.nv))
    command = controller.step(robot, 0.002, v)
    assert command.mode is Mode.HOLDING
    assert np.isfinite(command.torque).all()
    assert (np.abs(command.torque) <= 120.0).all()


def simulation(robot):
    """The library's humanoid on a floor, with motors, at 1 kHz."""
    spec = mujoco.MjSpec.from_file(str(ASSET))
    spec.option.timestep = 0.001
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], friction=[0.8, 0.005, 0.0001])
    model = spec.compile()
    model.dof_damping[:] = 0.0
    model.dof_armature[:] = robot.model.dof_armature
    data = mujoco.MjData(model)
    q = robot.neutral.copy()
    robot.update(q)
    q[2] -= robot.pose("left_sole")[1][2]
    data.qpos[:] = q
    return model, data


def run(robot, stack, controller, seconds, push=lambda t: None, before=lambda t: None):
    model, data = simulation(robot)
    commands, poses = [], []
    for step in range(round(seconds / 0.001)):
        t = 0.001 * step
        before(t)
        robot.update(data.qpos)
        command = controller.step(robot, 0.001, data.qvel)
        commands.append(command)
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[6:] = command.torque
        force = push(t)
        data.xfrc_applied[:] = 0.0
        if force is not None:
            data.xfrc_applied[model.body("pelvis").id, :3] = force
        mujoco.mj_step(model, data)
        poses.append((robot.pose("pelvis"), robot.pose("left_sole"), robot.pose("right_sole")))
    return commands, poses, data


def test_a_humanoid_stands_and_is_pushed():
    robot, _, stack = standing()
    controller = TorqueController(stack, "hierarchical_active_set")
    shove = lambda t: (60.0, 0.0, 0.0) if 0.2 <= t < 0.3 else None  # noqa: E731
    commands, poses, data = run(robot, stack, controller, 1.0, shove)
    assert all(np.isfinite(command.torque).all() for command in commands)
    assert max(np.abs(command.torque).max() for command in commands) <= 120.0
    assert np.mean([command.mode is Mode.RUNNING for command in commands]) > 0.99
    assert data.qpos[2] > 0.6
    feet = np.array([pose[1][1] for pose in poses])
    assert np.linalg.norm(feet - feet[0], axis=1).max() < 0.02


def test_contacts_come_and_go_without_a_jump():
    """The torque as a function of the activation, at one state: as continuous as the steps are small."""
    robot, contacts, stack = standing()
    robot.update(robot.neutral)
    v = np.zeros(robot.nv)
    controller = TorqueController(stack, "hierarchical_active_set")
    steps = []
    for activation in np.linspace(1.0, 0.0, 401):
        contacts[1].activation = float(activation)
        command = controller.step(robot, 0.002, v)
        assert command.mode is Mode.RUNNING, command.reason
        steps.append(command.torque)
    change = np.abs(np.diff(steps, axis=0)).max(axis=1)
    assert np.abs(steps[-1] - steps[0]).max() > 10.0
    assert change.max() < 0.1 * np.abs(steps[-1] - steps[0]).max()


def test_an_impact_yields_neither_nan_nor_excess():
    """Dropped from 0.3 m with large velocities, at every solver that takes hard rows."""
    robot, _, stack = standing()
    rng = np.random.default_rng(0)
    for name in ("hierarchical_active_set", "qp_cascade", "daqp"):
        controller = TorqueController(stack, name)
        robot.update(robot.neutral)
        controller.step(robot, 0.001, np.zeros(robot.nv))
        for scale in (1.0, 10.0, 1e3, 1e6):
            command = controller.step(robot, 0.001, scale * rng.normal(size=robot.nv))
            assert np.isfinite(command.torque).all()
            assert np.abs(command.torque).max() <= 120.0
            if command.mode is Mode.HOLDING:
                assert command.reason


def test_an_arm_holds_still_under_gravity():
    robot = MujocoRobot.from_arm(sawyer(), gravity_compensation=False)
    robot.update(robot.neutral)
    stack = TorqueStack([PostureTask(robot.neutral, gain=10.0)], torque=200.0)

    class Nothing(hqp_rp.Solver):
        name, summary, source, takes_hard = "nothing", "", "", True

        def solve(self, problem, secondary=None):
            return hqp_rp.Solution(problem, None, hqp_rp.Status.NOT_FINITE)

    command = TorqueController(stack, Nothing()).step(robot, 0.001, np.zeros(7))
    assert command.mode is Mode.HOLDING
    np.testing.assert_allclose(command.torque, robot.gravity(), atol=1e-9)
    command = TorqueController(stack, "hierarchical_active_set").step(robot, 0.001, np.zeros(7))
    np.testing.assert_allclose(command.torque, robot.gravity(), atol=1e-8)


def test_settings_are_checked():
    robot = named_robot("humanoid")
    stack = TorqueStack([PostureTask(robot.neutral)], contacts=[Contact("left_sole")])
    with pytest.raises(SettingError, match="give a TorqueStack"):
        TorqueController("stack", "daqp")
    for bad in (-1.0, np.nan, [1.0]):
        with pytest.raises(SettingError, match="braking"):
            TorqueController(stack, "daqp", braking=bad)
    with pytest.raises(SettingError, match="dt"):
        TorqueController(stack, "daqp").step(robot, 0.0, np.zeros(35))


def test_hold_compensates_gravity_within_the_limits():
    robot = MujocoRobot.from_arm(sawyer(), gravity_compensation=False)
    robot.update(robot.neutral)
    controller = TorqueController(TorqueStack([PostureTask(robot.neutral)], torque=200.0), "hierarchical_active_set")
    command = controller.hold(robot, np.zeros(7), "A door is open.")
    assert (command.mode, command.reason, command.solution) == (Mode.HOLDING, "A door is open.", None)
    np.testing.assert_allclose(command.torque, robot.gravity(), atol=1e-9)
    assert np.abs(controller.hold(robot, np.full(7, np.inf)).torque).max() <= 200.0
    assert controller.step(robot, 0.001, np.zeros(7)).mode is Mode.RUNNING
    with pytest.raises(SettingError, match="give a sentence"):
        controller.hold(robot, np.zeros(7), "")
