"""pink's limits and barriers as hard and soft rows, against pink's own problem and solution."""

import numpy as np
import pink
import pinocchio as pin
import pytest
from pink.barriers import BodySphericalBarrier, PositionBarrier, SelfCollisionBarrier
from pink.limits import AccelerationLimit, ConfigurationLimit, FloatingBaseVelocityLimit, VelocityLimit
from pink.tasks import ComTask, DampingTask, FrameTask, JointVelocityTask, PostureTask

import hqp_rp
from hqp_rp.control import PositionTask, Stack
from hqp_rp.control.catalogue import tasks_only
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.robot import PinocchioRobot, planar_arm
from tests.control.pink_scene import DT, FRAMES, away, frame_task, scene


@pytest.fixture(params=["arm", "floating"])
def setting(request, tmp_path):
    return request.param, *scene(request.param, tmp_path)


def limits_of(kind, robot, rng):
    last = rng.uniform(-0.2, 0.2, robot.nv)
    acceleration = AccelerationLimit(robot.model, np.full(robot.nv, 20.0))
    acceleration.set_last_integration(last, DT)
    made = [ConfigurationLimit(robot.model), VelocityLimit(robot.model, np.full(robot.nv, 0.5)), acceleration]
    return made if kind == "arm" else [*made, FloatingBaseVelocityLimit(robot.model, None, [0.3, 0.2, np.inf], 0.4)]


def test_limits_are_pinks_inequalities(setting):
    kind, rng, robot, configuration = setting
    limits = limits_of(kind, robot, rng)
    frame = frame_task(kind, rng, configuration, position_cost=1.0, orientation_cost=1.0)
    posture = PostureTask(cost=1.0)
    posture.set_target(away(robot, rng))
    qp = pink.build_ik(configuration, [frame, posture], DT, damping=0.0, limits=limits)
    hard = Stack([[frame, posture]], limits=limits).problem(robot, DT).hard
    np.testing.assert_allclose(hard.A, qp.G, atol=1e-14)
    np.testing.assert_allclose(hard.upper * DT, qp.h, atol=1e-15)
    assert (hard.lower == -np.inf).all()
    theirs = pink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=limits)
    for solver in ("hierarchical_active_set", "qp_cascade"):
        ours = hqp_rp.solve(Stack([[frame, posture]], limits=limits).problem(robot, DT), solver)
        assert ours.status.ok
        assert (hard.A @ ours.x <= hard.upper + 1e-7).all()
        np.testing.assert_allclose(ours.x, theirs, atol=1e-5)
    free = pink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[])
    assert np.linalg.norm(free - theirs) > 0.1
    # Soft, below another level.
    problem = Stack([posture, limits[1]]).problem(robot, DT)
    np.testing.assert_array_equal(problem.levels[1].A, limits[1].compute_qp_inequalities(configuration, DT)[0])


def test_limits_hold_in_a_loop(tmp_path):
    """A posture far outside: joints stop at their limits, at no more than the speed allowed."""
    _, robot, _ = scene("arm", tmp_path)
    posture = PostureTask(cost=1.0)
    posture.set_target(robot.upper + 1.0)
    limits = [ConfigurationLimit(robot.model), VelocityLimit(robot.model)]
    stack, fastest = Stack([posture], limits=limits), 0.0
    for _ in range(300):
        v = hqp_rp.solve(stack.problem(robot, DT), "hierarchical_active_set").require()
        fastest = max(fastest, float((np.abs(v) / robot.velocity_limit).max()))
        robot.update(robot.integrate(robot.q, v, DT))
        assert (robot.q <= robot.upper + 1e-9).all()
    assert fastest == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(robot.q, robot.upper, atol=1e-3)


def test_a_limit_that_limits_nothing_has_no_rows(tmp_path):
    _, robot, _ = scene("arm", tmp_path)
    problem = Stack(
        [PositionTask("tool", np.zeros(3))], limits=[VelocityLimit(robot.model, np.full(7, np.inf))]
    ).problem(robot, DT)
    assert problem.hard.A.shape == (0, robot.nv)


def test_rows_of_limits_go_by_their_joints(tmp_path):
    _, robot, _ = scene("arm", tmp_path)
    fixed = JointVelocityTask(cost=1.0)
    fixed.set_target(np.array([0.0, 0.0, -1.0, 0.0, 2.0, 0.0, 0.0]), DT)  # the velocity asked for is its negative
    stack = Stack([PositionTask("tool", np.zeros(3))], limits=[VelocityLimit(robot.model, np.full(7, 0.5)), fixed])
    conflict = hqp_rp.solve(stack.problem(robot, DT), "hierarchical_active_set").conflict
    assert conflict.names[0] == "pink VelocityLimit: joint5 lower"


def barriers_of(kind, robot):
    p = robot.pose(FRAMES[kind][0])[1]
    return [
        PositionBarrier(FRAMES[kind][0], indices=[0, 2], p_min=p[[0, 2]] - 0.02, p_max=p[[0, 2]] + 0.03, gain=10.0),
        BodySphericalBarrier(FRAMES[kind], d_min=0.05, gain=5.0, safe_displacement_gain=0.0),
    ]


def test_barriers_are_pinks_inequalities(setting):
    kind, rng, robot, configuration = setting
    barriers = barriers_of(kind, robot)
    frame = frame_task(kind, rng, configuration, position_cost=1.0, orientation_cost=1.0)
    posture = PostureTask(cost=1.0)
    posture.set_target(away(robot, rng))
    problem = Stack([[frame, posture]], limits=barriers).problem(robot, DT)
    qp = pink.build_ik(configuration, [frame, posture], DT, damping=0.0, limits=[], barriers=barriers)
    np.testing.assert_allclose(problem.hard.A, qp.G * DT, atol=1e-14)
    np.testing.assert_allclose(problem.hard.upper, qp.h, atol=1e-14)
    theirs = pink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[], barriers=barriers)
    np.testing.assert_allclose(hqp_rp.solve(problem, "hierarchical_active_set").x, theirs, atol=1e-6)
    free = pink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[])
    assert np.linalg.norm(free - theirs) > 0.1


def test_a_barrier_holds_in_a_loop_and_may_be_moved(tmp_path):
    _, robot, _ = scene("arm", tmp_path)
    rotation, start = robot.pose("tool")
    task = FrameTask("tool", position_cost=1.0, orientation_cost=1.0, gain=0.1)
    task.set_target(pin.SE3(rotation, start + np.array([0.2, 0.0, 0.0])))
    wall = PositionBarrier("tool", indices=[0], p_max=start[[0]] + 0.05, gain=10.0)
    stack = Stack([task], limits=[wall])
    for end in (0.05, 0.1):
        wall.p_max = start[[0]] + end
        for _ in range(200):
            v = hqp_rp.solve(stack.problem(robot, DT), "hierarchical_active_set").require()
            robot.update(robot.integrate(robot.q, v, DT))
            assert robot.pose("tool")[1][0] < start[0] + end + 1e-4
        assert robot.pose("tool")[1][0] > start[0] + end - 1e-3


def test_a_barrier_with_inequalities_of_its_own(tmp_path):
    class Doubled(PositionBarrier):
        def compute_qp_inequalities(self, configuration, dt=1e-3):
            G, h = super().compute_qp_inequalities(configuration, dt)
            return 2.0 * G, 2.0 * h

    _, robot, configuration = scene("arm", tmp_path)
    barrier = Doubled("tool", p_max=np.ones(3))
    problem = Stack([DampingTask(cost=1.0)], limits=[barrier]).problem(robot, DT)
    G, h = barrier.compute_qp_inequalities(configuration, DT)
    np.testing.assert_allclose(problem.hard.A, DT * G, atol=1e-14)
    np.testing.assert_allclose(problem.hard.upper, h, atol=1e-14)


def test_limits_that_do_not_fit_are_refused(tmp_path):
    _, robot, _ = scene("arm", tmp_path)
    other = PinocchioRobot.from_arm(planar_arm(3))
    damp = DampingTask(cost=1.0)
    with pytest.raises(
        RobotError, match=r"pink ConfigurationLimit was made for a model with nq = 3 and nv = 3; this robot"
    ):
        Stack([damp], limits=[ConfigurationLimit(other.model)]).problem(robot, DT)
    robot.update(robot.upper + 0.1)
    with pytest.raises(
        ProblemError, match=r"pink AccelerationLimit: its bound h\[0\] is nan .* bring the robot inside, or"
    ):
        Stack([damp], limits=[AccelerationLimit(robot.model, np.ones(7))]).problem(robot, DT)
    with pytest.raises(
        SettingError, match=r"SelfCollisionBarrier needs pink's collision model, which a robot does not"
    ):
        Stack([damp], limits=[SelfCollisionBarrier(3)])


def test_limits_and_barriers_are_no_tasks_where_tasks_are_asked_for(tmp_path):
    _, robot, _ = scene("arm", tmp_path)
    com = ComTask(cost=1.0)
    free, _ = tasks_only(Stack([com, [VelocityLimit(robot.model), barriers_of("arm", robot)[0]]]))
    assert free.names == ("pink ComTask",)
