"""The loop behind the page: targets that are dragged, solvers that are switched, ghosts, drives, and what is said of each."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

import hqp_rp
from hqp_rp.compare.play.arm import called, damped, rows_at_bounds
from hqp_rp.compare.play.loop import PlayLoop
from hqp_rp.compare.play.stage import gizmo_axes
from hqp_rp.compare.play.targets import quaternion_of, targets_of
from hqp_rp.control.command import Mode
from hqp_rp.control.singularities import SingularConfiguration
from hqp_rp.control.stack_file import load_stack, parse_stack
from hqp_rp.core.damping import ConstantDamping, ErrorDamping, NoDamping
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot_source import RobotSource


def planar(solver: str = "null_space", beside: str | None = None, dt: float | None = None) -> PlayLoop:
    return PlayLoop(RobotSource("planar4"), load_stack("planar4"), solver, beside=beside, dt=dt)


def sawyer(solver: str = "null_space", beside: str | None = None) -> PlayLoop:
    return PlayLoop(RobotSource("sawyer"), load_stack("sawyer"), solver, beside=beside)


def stack_loop(text: str, robot: str = "planar4", solver: str = "null_space") -> PlayLoop:
    return PlayLoop(RobotSource(robot), parse_stack(text), solver)


# --- targets ---------------------------------------------------------------------------------------------------------


def test_tasks_of_one_frame_share_a_target_that_moves_and_turns() -> None:
    (target,) = sawyer().targets
    assert (target.name, target.frame, target.tasks) == ("tool", "tool", ((0, 0), (1, 0)))
    assert target.moves == target.turns == (True, True, True)


def test_a_target_moves_and_turns_along_the_axes_that_its_tasks_have() -> None:
    tool, link = planar().targets
    assert (tool.moves, tool.turns) == ((True, True, False), (False, False, False))
    assert (link.moves, link.turns) == ((False, False, False), (False, False, True))
    assert gizmo_axes(tool) == (True, True, False)
    assert gizmo_axes(link) == (True, True, False)  # what the ring about z lies in
    assert gizmo_axes(sawyer().targets[0]) == (True, True, True)


def test_points_of_one_frame_and_a_look_at_are_targets_of_their_own() -> None:
    loop = stack_loop(
        """
        [[level]]
        [[level.task]]
        type = "position"
        frame = "tool"
        [[level.task]]
        type = "position"
        frame = "tool"
        point = [0.1, 0.0, 0.0]
        [[level.task]]
        type = "look_at"
        frame = "tool"
        target = [2.0, 0.0, 0.0]
        name = "gaze"
        """
    )
    assert [target.name for target in loop.targets] == ["tool", "tool at 0.1, 0, 0", "gaze"]
    loop.drag(2, position=[2.0, 1.0, 0.0])
    np.testing.assert_array_equal(loop.place(2)[:3], [2.0, 1.0, 0.0])
    assert np.isnan(loop.place(2)[3:]).all()


def test_a_drag_sets_the_targets_of_all_its_tasks_on_the_arm_and_on_the_ghost() -> None:
    loop = sawyer(beside="reverse_priority")
    angle = 0.3
    quaternion = np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])
    loop.drag(0, position=[0.5, 0.2, 0.4], quaternion=2.0 * quaternion)  # any length
    np.testing.assert_allclose(loop.place(0), [0.5, 0.2, 0.4, *quaternion], atol=1e-12)
    for arm in loop.arms:
        np.testing.assert_array_equal(arm.stack.levels[0][0].target, [0.5, 0.2, 0.4])
        R = arm.stack.levels[1][0].target
        np.testing.assert_allclose(R[:2, 0], [math.cos(angle), math.sin(angle)], atol=1e-12)


def test_a_pose_task_keeps_the_half_that_is_not_dragged() -> None:
    loop = stack_loop('[[level]]\n[[level.task]]\ntype = "pose"\nframe = "tool"\naxes = ["x", "y", "rz"]')
    before = loop.place(0)
    loop.drag(0, position=before[:3] + np.array([0.0, 0.1, 0.0]))
    np.testing.assert_allclose(loop.place(0) - before, [0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    loop.drag(0, quaternion=[1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(loop.place(0)[:3], before[:3] + np.array([0.0, 0.1, 0.0]), atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"target": 2}, "target is 2; there are 0: tool, 1: link2."),
        ({"target": 0, "position": [0.0, math.nan, 0.0]}, "position"),
        ({"target": 1, "quaternion": [0.0] * 4}, "quaternion is zero; it must have a direction."),
    ],
)
def test_a_wrong_drag_is_one_error(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(hqp_rp.SettingError, match=words):
        planar().drag(**arguments)  # type: ignore[arg-type]


def test_a_rotation_becomes_its_quaternion() -> None:
    np.testing.assert_allclose(np.abs(quaternion_of(np.diag([1.0, -1.0, -1.0]))), [0.0, 1.0, 0.0, 0.0], atol=1e-12)


# --- the loop --------------------------------------------------------------------------------------------------------


def test_the_tool_follows_its_target_and_the_error_falls_as_the_gain_says() -> None:
    loop = sawyer()
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.0, 0.01, 0.0]))
    first = loop.step()
    assert first.arms[0].error[0] == pytest.approx(0.01, rel=1e-9)
    steps = [loop.step() for _ in range(100)]
    gain = 2.0
    assert steps[-1].arms[0].error[0] == pytest.approx(0.01 * (1.0 - gain * loop.dt) ** 100, rel=0.05)
    assert steps[-1].time == pytest.approx(100 * loop.dt)
    state = steps[0].arms[0]
    assert (state.mode, state.status, state.reason, state.share) == (Mode.RUNNING, "SOLVED", "", 1.0)
    np.testing.assert_array_equal(state.rank, [3, 3, 1])
    np.testing.assert_array_equal(state.rows, [3, 3, 7])
    assert state.speed > 0.0
    assert state.residual[0] < 1e-12


def test_what_is_said_of_a_level_is_what_the_solution_says() -> None:
    loop = sawyer()
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.1, 0.1, 0.0]))
    arm = loop.arms[0]
    solution = hqp_rp.solve(arm.stack.problem(arm.robot, loop.dt), "null_space")
    state = loop.step().arms[0]
    np.testing.assert_allclose(state.sigma_min, [level.sigma_min for level in solution.levels], rtol=1e-12)
    np.testing.assert_allclose(state.residual, [level.residual for level in solution.levels], atol=1e-12)
    assert solution.x is not None
    assert state.speed == pytest.approx(np.linalg.norm(solution.x), rel=1e-12)


def test_no_joint_is_moved_faster_than_it_can_and_the_share_is_told() -> None:
    loop = sawyer()
    loop.drag(0, position=loop.place(0)[:3] + np.array([3.0, 3.0, 3.0]))
    arm = loop.arms[0]
    state = loop.step().arms[0]
    moved = np.abs(arm.robot.difference(state.q, arm.robot.q)) / loop.dt
    assert 0.0 < state.share < 1.0
    assert (moved / arm.robot.velocity_limit).max() == pytest.approx(1.0, rel=1e-9)


def test_a_joint_at_its_stop_is_named_and_not_passed() -> None:
    robot = RobotSource("planar4").robot()
    target = [*robot.neutral[:3].tolist(), float(robot.upper[3]) + 1.0]
    levels = '[[level]]\n[[level.task]]\ntype = "posture"\ngain = 5.0\ntarget = {}\n[[level]]\n[[level.task]]\n{}'
    loop = stack_loop(levels.format(target, 'type = "position"\nframe = "tool"'))
    states = [loop.step().arms[0] for _ in range(300)]
    assert states[0].limits == ()
    assert states[-1].limits == (f"{robot.joint_names[3]} at its stop",)
    assert states[-1].q[3] == robot.upper[3]
    assert max(state.q[3] for state in states) <= robot.upper[3]


def test_joint_limits_as_hard_rows_are_refused_by_a_closed_form_in_words_and_held_by_a_strict_solver() -> None:
    loop = sawyer()
    loop.hold_joint_limits(True)
    state = loop.step().arms[0]
    assert state.mode is Mode.STOPPED
    assert "null_space is a closed form without hard rows" in state.reason
    assert math.isnan(state.speed)
    np.testing.assert_array_equal(state.rank, [3, 3, 1])  # what the problem alone says
    loop.choose("hierarchical_active_set", ErrorDamping(0.01))
    loop.drag(0, position=loop.place(0)[:3] + np.array([1.5, 1.5, 1.5]))
    state = loop.step().arms[0]
    assert (state.mode, state.bounded) == (Mode.RUNNING, 7)
    assert any("joint" in word and word.endswith(("upper", "lower")) for word in state.limits)
    loop.hold_joint_limits(False)
    assert loop.step().arms[0].bounded == 0


def test_an_arm_without_an_answer_brakes_and_goes_on_when_it_is_answered() -> None:
    loop = sawyer()
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.3, 0.3, 0.0]))
    for _ in range(20):
        loop.step()
    arm = loop.arms[0]
    velocity = arm.robot.difference(loop.step().arms[0].q, arm.robot.q) / loop.dt
    arm._solver = dataclasses.replace(hqp_rp.get_solver("damped_least_squares"))
    arm._stack = hqp_rp.Stack(arm.stack.levels, [hqp_rp.VelocityLimit(1.0)])  # which that solver refuses
    speeds = []
    for _ in range(20):
        state = loop.step().arms[0]
        speeds.append(float(np.abs(arm.robot.difference(state.q, arm.robot.q)).max()) / loop.dt)
    assert speeds[0] == pytest.approx(max(float(np.abs(velocity).max()) - 20.0 * loop.dt, 0.0), abs=1e-6)
    assert speeds[-1] == 0.0
    assert state.mode is Mode.STOPPED
    loop.choose("null_space")
    assert loop.step().arms[0].mode is Mode.RUNNING


def test_two_solvers_go_side_by_side_from_one_configuration() -> None:
    loop = sawyer()
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.3, 0.3, 0.0]))
    for _ in range(10):
        loop.step()
    loop.compare_with("reverse_priority")
    first = loop.step()
    np.testing.assert_array_equal(first.arms[0].q, first.arms[1].q)
    last = [loop.step() for _ in range(100)][-1]
    assert np.abs(last.arms[0].q - last.arms[1].q).max() > 1e-3  # three levels: the methods differ
    loop.meet()
    met = loop.step()
    np.testing.assert_array_equal(met.arms[0].q, met.arms[1].q)
    loop.compare_with(None)
    assert len(loop.step().arms) == 1


def test_a_ghost_of_the_same_solver_stays_with_the_arm() -> None:
    loop = sawyer(beside="null_space")
    loop.drag(0, position=loop.place(0)[:3] + np.array([0.3, 0.3, 0.0]))
    last = [loop.step() for _ in range(50)][-1]
    np.testing.assert_array_equal(last.arms[0].q, last.arms[1].q)


def test_damping_goes_to_the_solver_that_has_one_and_else_to_the_levels() -> None:
    solver, level = damped(hqp_rp.get_solver("null_space"), ConstantDamping(0.2))
    assert (called(solver), level) == ("null_space (damping constant(0.2))", None)
    solver, level = damped(hqp_rp.get_solver("hierarchical_active_set"), ConstantDamping(0.2))
    assert (called(solver), level) == ("hierarchical_active_set", ConstantDamping(0.2))
    loop = sawyer()
    loop.choose(None, ConstantDamping(0.2))
    assert loop.arms[0].label == "null_space (damping constant(0.2))"
    loop.choose("hierarchical_active_set", ErrorDamping(0.1))
    assert loop.arms[0].stack.damping == (ErrorDamping(0.1),) * 3
    assert loop.arms[0].label.startswith("hierarchical_active_set, levels damped by ")
    loop.choose(None, None)
    assert not any(loop.arms[0].stack.damping)


def test_a_damping_that_a_solver_does_not_take_is_refused_and_nothing_changes() -> None:
    refusing = [
        name for name, kind in hqp_rp.all_solvers().items() if not kind.takes_damping and not hasattr(kind, "damping")
    ]
    solver = hqp_rp.get_solver(refusing[0])
    assert damped(solver, NoDamping()) == (solver, None)
    loop = sawyer()
    with pytest.raises(hqp_rp.SettingError, match=f"{solver.name} takes no ConstantDamping"):
        loop.choose(solver, ConstantDamping(0.1))
    assert loop.arms[0].label == "null_space"
    with pytest.raises(hqp_rp.SettingError, match="arm is 1; there are 1"):
        loop.choose("null_space", arm=1)


def test_rows_at_their_bounds_are_named_from_the_problem_and_x_alone() -> None:
    problem = hqp_rp.Problem(
        [hqp_rp.Level(np.eye(2), [-1.0, -1.0], [1.0, 1.0], name="band")],
        hqp_rp.Level(np.eye(2), [-2.0, -2.0], [2.0, 3.0]),
    )
    assert rows_at_bounds(problem, np.array([2.0, -2.5])) == (
        "hard row 0 upper", "hard row 1 lower", "band[0] upper", "band[1] lower",
    )  # fmt: skip
    assert rows_at_bounds(problem, np.array([0.5, 0.5])) == ()


# --- singularities ---------------------------------------------------------------------------------------------------


def test_a_drive_ends_at_the_sigma_that_was_asked_for_and_rests_there() -> None:
    loop = sawyer(beside="reverse_priority")
    catalogue = loop.find_singularities(starts=6)
    place = catalogue.of(1, Singularity.ALGORITHMIC)[0]
    loop.drive_to(place, sigma=1e-3)
    assert loop.driving
    steps = [loop.step()]
    while loop.driving:
        steps.append(loop.step())
        assert len(steps) < 2000
    assert all(step.driving for step in steps)
    moved = [np.abs(loop.robot.difference(a.arms[0].q, b.arms[0].q)) for a, b in itertools.pairwise(steps)]
    assert all((v <= loop.arms[0].fastest * loop.dt * (1.0 + 1e-9)).all() for v in moved)
    state = loop.step()
    assert not state.driving
    for arm in state.arms:
        relative = arm.sigma_min[1] / np.linalg.norm(loop.arms[0].stack.levels[1][0].evaluate(loop.arms[0].robot)[0], 2)
        assert relative == pytest.approx(1e-3, rel=0.02)
        np.testing.assert_allclose(arm.error, 0.0, atol=1e-9)  # the targets went with the arm
    after = [loop.step() for _ in range(20)][-1]
    np.testing.assert_allclose(after.arms[0].q, state.arms[0].q, atol=1e-9)


def test_near_a_singularity_the_undamped_answer_is_large_and_the_damped_one_is_not() -> None:
    loop = sawyer()
    place = loop.find_singularities(starts=6).of(1, Singularity.ALGORITHMIC)[0]
    speeds = {}
    for name, damping in (("none", NoDamping()), ("constant", ConstantDamping(0.1))):
        loop.choose("null_space", damping)
        loop.drive_to(place, sigma=1e-5)
        while loop.driving:
            loop.step()
        task = loop.arms[0].stack.levels[1][0]
        turn = place.task_direction / np.linalg.norm(place.task_direction)
        task.feedforward = 0.1 * turn
        speeds[name] = loop.step().arms[0].speed
        task.feedforward = None
    assert speeds["none"] > 1e2
    assert speeds["constant"] < 1.0


def test_every_kind_of_target_rests_where_a_drive_ends() -> None:
    loop = PlayLoop(RobotSource("dual_sawyer"), load_stack("dual_sawyer"), "null_space")
    loop.drive_to(loop.find_singularities(starts=3)[0], sigma=1e-2)
    while loop.driving:
        loop.step()
    np.testing.assert_allclose(loop.step().arms[0].error, 0.0, atol=1e-7)
    humanoid = PlayLoop(RobotSource("humanoid"), load_stack("humanoid"), "null_space")
    q = humanoid.robot.neutral.copy()
    q[10:14] += 0.1
    humanoid._goal = q
    while humanoid.driving:
        humanoid.step()
    np.testing.assert_allclose(humanoid.step().arms[0].error, 0.0, atol=1e-7)


def test_a_drive_home_ends_at_the_neutral_configuration_and_a_drag_ends_a_drive() -> None:
    loop = planar()
    for _ in range(50):
        loop.step()
    loop.drive_home()
    while loop.driving:
        loop.step()
    np.testing.assert_allclose(loop.arms[0].robot.q, loop.robot.neutral, atol=1e-12)
    loop.drive_to(loop.find_singularities(starts=3)[0])
    loop.step()
    loop.drag(0, position=loop.place(0)[:3])
    assert not loop.driving


# --- misuse ----------------------------------------------------------------------------------------------------------


def test_misuse_is_one_error_with_the_remedy() -> None:
    with pytest.raises(hqp_rp.SettingError, match="no task with a target to drag; give it one of type position"):
        stack_loop('[[level]]\n[[level.task]]\ntype = "posture"')
    with pytest.raises(hqp_rp.SettingError, match=r"dt is -1"):
        planar(dt=-1.0)
    loop = planar()
    with pytest.raises(hqp_rp.SettingError, match="call find_singularities first"):
        loop.drive_to(_nowhere())
    with pytest.raises(hqp_rp.SettingError, match=r"sigma is 1\.0; it must be in"):
        loop.drive_to(_nowhere(), sigma=1.0)
    with pytest.raises(hqp_rp.SettingError, match="nothing is being recorded"):
        loop.stop_recording()
    with pytest.raises(hqp_rp.UnknownNameError, match="no solver named"):
        loop.choose("nul_space")


def _nowhere() -> SingularConfiguration:
    nothing: FloatArray = np.zeros(4)
    return SingularConfiguration(
        nothing, 0, "tool", Singularity.KINEMATIC, 0.0, 0.0, math.inf, nothing[:2], nothing, nothing[:0], nothing, 0.0
    )


def test_targets_are_found_in_any_stack() -> None:
    robot = RobotSource("humanoid").robot()
    names = [target.name for target in targets_of(load_stack("humanoid").stack(robot))]
    assert names == ["left_sole", "right_sole", "left_grip", "right_grip"]
