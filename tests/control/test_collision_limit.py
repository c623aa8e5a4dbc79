"""Collision rows: the derivative of the distance, the approach, the way back, and what names mean."""

import itertools

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import CollisionLimit, JointLimit, Limit, PositionTask, PostureTask, Stack
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import get_solver
from hqp_rp.robot import MujocoRobot
from tests.control.chain import random_chain
from tests.robot.scene import SHAPES, both, joint, link

SIZES = {
    "sphere": ".1",
    "capsule": ".08 .2",
    "ellipsoid": ".1 .2 .15",
    "cylinder": ".1 .2",
    "box": ".1 .2 .15",
    "plane": "1 1 .1",
}
ROUND = ("sphere", "capsule", "plane")


def pair(a: str, b: str) -> MujocoRobot:
    """Two geoms of these kinds on bodies of their own, free where they are no planes."""
    bodies = "".join(
        f'<body name="{name}">{"" if kind == "plane" else "<freejoint/>"}<geom name="{name}" type="{kind}" '
        f'size="{SIZES[kind]}"/></body>'
        for name, kind in (("one", a), ("other", b))
    )
    option = '<option ccd_tolerance="1e-10" ccd_iterations="200"/>'
    return MujocoRobot(mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>"))


def scattered(robot: MujocoRobot, rng: np.random.Generator, spread: float) -> np.ndarray:
    q = spread * rng.normal(size=robot.nq)
    for start in range(3, robot.nq, 7):
        q[start : start + 4] = rng.normal(size=4)
    return robot.integrate(q, np.zeros(robot.nv), 0.0)


def derivative_errors(a: str, b: str, spread: float, count: int = 25) -> tuple[np.ndarray, np.ndarray]:
    robot, limit = pair(a, b), CollisionLimit([("one", "other")], detection=20.0)
    rng, h = np.random.default_rng(0), 1e-5
    errors, distances = [], []
    for _ in range(count):
        q, v = scattered(robot, rng, spread), rng.normal(size=robot.nv)
        robot.update(q)
        slope = limit.rows(robot, 0.01, None)[0] @ v
        ends = []
        for sign in (1.0, -1.0):
            robot.update(robot.integrate(q, sign * v, h))
            ends.append(limit.distances(robot)[0])
        robot.update(q)
        errors.append(abs(slope[0] - (ends[0] - ends[1]) / (2 * h)))
        distances.append(limit.distances(robot)[0])
    return np.array(errors), np.array(distances)


@pytest.mark.parametrize(
    ("a", "b"), [kinds for kinds in itertools.combinations_with_replacement(SIZES, 2) if kinds != ("plane", "plane")]
)
def test_the_row_is_the_derivative_of_the_distance_of_separated_geoms(a: str, b: str) -> None:
    errors, distances = derivative_errors(a, b, 0.6)
    apart = distances > 0.02
    assert apart.sum() >= 8
    assert errors[apart].max() < (1e-6 if a in ROUND and b in ROUND else 1e-4)


@pytest.mark.parametrize(
    ("a", "b"), [("sphere", "sphere"), ("sphere", "capsule"), ("sphere", "plane"), ("box", "plane")]
)
def test_and_of_overlapping_ones(a: str, b: str) -> None:
    errors, distances = derivative_errors(a, b, 0.08)
    assert (distances < -0.01).sum() >= 8
    assert errors[distances < 0.0].max() < 1e-5


def line_of(*positions: float, radius: float = 0.1) -> MujocoRobot:
    """Spheres that slide along x, one joint each, named s0, s1, ..."""
    bodies = "".join(
        f'<body name="b{i}"><joint name="j{i}" type="slide" axis="1 0 0"/><geom name="s{i}" size="{radius}"/></body>'
        for i in range(len(positions))
    )
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    robot.update(np.array(positions, dtype=float))
    return robot


def rate(gap: float, dt: float = 0.1, **settings) -> float:
    """The least rate of two spheres that are `gap` apart."""
    robot = line_of(0.0, 0.2 + gap)
    G, lower, upper = CollisionLimit([("s0", "s1")], **settings).rows(robot, dt, None)
    np.testing.assert_allclose(G, [[-1.0, 1.0]], atol=1e-9)
    assert upper[0] == np.inf
    return float(lower[0])


def test_known_rates() -> None:
    assert rate(0.1, margin=0.02, gain=5.0) == pytest.approx(-5.0 * 0.08)
    assert rate(0.1, margin=0.02, gain=50.0) == pytest.approx(-0.08 / 0.1)  # gain * dt > 1: the whole way, not more
    assert rate(0.02, margin=0.02) == pytest.approx(0.0, abs=1e-12)
    assert rate(0.01, margin=0.02, gain=5.0) == pytest.approx(5.0 * 0.01)
    assert rate(-0.1, margin=0.02, gain=5.0, return_speed=0.3) == pytest.approx(0.3)
    assert rate(-0.1, margin=0.02, gain=5.0, return_speed=np.inf) == pytest.approx(5.0 * 0.12)
    # From 0.06 m, steps of 0.03, 0.02 and 0.01 m stop, each 1 m/s^2 * dt^2 shorter than the one before.
    assert rate(0.06, margin=0.0, gain=10.0, deceleration=1.0) == pytest.approx(-0.03 / 0.1)
    assert rate(0.0, margin=0.01, gain=2.0) == pytest.approx(0.02)  # touching: the points coincide


def test_a_pair_beyond_detection_keeps_its_row() -> None:
    robot, limit = line_of(0.0, 0.5, 4.0), CollisionLimit([("s0", ["s1", "s2"])], detection=1.0)
    assert isinstance(limit, Limit)
    assert limit.pairs(robot) == (("s0", "s1"), ("s0", "s2"))
    np.testing.assert_allclose(limit.distances(robot), [0.3, np.inf])
    G, lower, upper = limit.rows(robot, 0.01, None)
    np.testing.assert_array_equal(G[1], 0.0)
    assert (lower[1], upper[1]) == (-np.inf, np.inf)
    for solver in ("qp_cascade", "weighted"):
        solution = hqp_rp.solve(Stack([limit, PostureTask(np.ones(3))]).problem(robot, 0.01), solver)
        assert solution.status is Status.SOLVED


@settings(max_examples=25)
@given(
    start=st.floats(-0.15, 1.0),
    gain=st.sampled_from([0.5, 5.0, 100.0]),
    deceleration=st.sampled_from([0.3, np.inf]),
    choose=st.sampled_from(["most", "half", "away"]),
)
def test_spheres_on_a_line_never_pass_the_margin_and_come_back_from_inside(start, gain, deceleration, choose) -> None:
    dt, margin, fastest = 0.02, 0.03, 1.5
    limit = CollisionLimit(
        [("s0", "s1")], margin=margin, gain=gain, deceleration=deceleration, return_speed=0.25, detection=5.0
    )
    robot, gap, speed = line_of(0.0, 0.2 + start), start, None
    for _ in range(120):
        robot.update(np.array([0.0, 0.2 + gap]))
        least = float(limit.rows(robot, dt, None)[1][0])
        assert least <= 0.25
        wish = {"most": -fastest, "half": 0.5 * min(least, 0.0), "away": 0.1}[choose]
        change = max(wish, least)
        if gap < margin - 1e-12:
            assert least >= min(0.25, min(gain, 1 / dt) * (margin - gap), 0.3 * dt) - 1e-9  # it does come back
        if speed is not None and deceleration < np.inf and gap >= margin and choose == "most":
            assert change - speed <= 0.3 * dt + 1e-9  # braking
        new = gap + dt * change
        assert new >= min(margin, gap) - 1e-12
        gap, speed = new, change
    if choose == "most" and start < margin:
        assert gap >= margin - 0.05 * (margin - start) - 0.25 * dt or gain == 0.5


def arm() -> MujocoRobot:
    spec = hqp_rp.robot.arm_spec(hqp_rp.robot.planar_arm(5, 0.3), timestep=0.01)
    spec.worldbody.add_geom(
        name="post", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.1, 0.5, 0.0], pos=[0.75, 0.35, 0.0]
    )
    return MujocoRobot.from_spec(spec, velocity_limit=2.0)


def nearest_in_closed_loop(robot: MujocoRobot, stack: Stack, limit: CollisionLimit, dt: float) -> float:
    q, nearest = np.array([-0.9, 0.3, 0.3, 0.3, 0.3]), np.inf
    solver = get_solver("qp_cascade")
    for _ in range(round(3.0 / dt)):
        robot.update(q)
        nearest = min(nearest, float(limit.distances(robot).min()))
        solution = solver.solve(stack.problem(robot, dt))
        assert solution.status is Status.SOLVED, solution.message
        assert solution.x is not None
        q = robot.integrate(q, solution.x, dt)
    return nearest


def test_an_arm_in_closed_loop_keeps_its_distance_but_for_what_turning_costs() -> None:
    robot = arm()
    limit = CollisionLimit([([f"link{i}" for i in range(1, 6)], "post")], margin=0.02, gain=5.0)
    tool = PositionTask("tool", [0.2, 1.0, 0.0], axes="xy", gain=3.0)
    levels = [tool, PostureTask(robot.neutral)]
    hard = Stack(levels, limits=[JointLimit(), limit])
    soft = Stack([limit, *levels], limits=[JointLimit()])
    lost = {dt: 0.02 - nearest_in_closed_loop(robot, hard, limit, dt) for dt in (0.04, 0.02, 0.01)}
    assert np.linalg.norm(tool.error(robot)) < 0.7  # about 1.5 m at the start; the post stands between
    assert 0.0 < lost[0.04] < 0.02
    assert lost[0.02] < 0.55 * lost[0.04]  # it vanishes with the step
    assert lost[0.01] < 0.55 * lost[0.02]
    assert nearest_in_closed_loop(robot, soft, limit, 0.02) == pytest.approx(0.02 - lost[0.02], abs=1e-6)


def two_arms() -> str:
    """URDF: two planar arms of three capsules each, with room to meet, and a box that does not move."""
    text = '<robot name="arms">' + link("base", SHAPES["box"])
    for side, x, turn in (("left", -0.45, "1"), ("right", 0.45, "-1")):
        parent, place = "base", f"{x} 0.3 0"
        for i in (1, 2, 3):
            shape, origin = '<capsule radius="0.03" length="0.3"/>', 'xyz="0 0.15 0" rpy="1.5707963267948966 0 0"'
            text += link(f"{side}_{i}", shape, origin)
            text += joint(f"{side}_joint_{i}", parent, f"{side}_{i}", axis=f"0 0 {turn}", xyz=place)
            parent, place = f"{side}_{i}", "0 0.36 0"
        text += link(f"{side}_tool") + joint(f"{side}_end", parent, f"{side}_tool", xyz="0 0.36 0").replace(
            "revolute", "fixed"
        )
    return text + "</robot>"


def test_a_group_against_itself_is_kept_apart_alike_in_both_libraries(tmp_path) -> None:
    robots = both(tmp_path / "arms.urdf", two_arms())
    group, dt, runs = ["left_*", "right_*"], 0.01, []
    for robot in robots:
        limit = CollisionLimit([(group, group), (group, "base")], margin=0.03, gain=5.0)
        # Each arm's first and third link, each link of one with each of the other, each link with what is fixed.
        assert len(limit.pairs(robot)) == 1 + 1 + 9 + 6
        tools = [PositionTask("left_tool", [0.3, 0.9, 0], axes="xy", gain=2.0)]
        tools += [PositionTask("right_tool", [-0.3, 0.9, 0], axes="xy", gain=2.0)]
        stack = Stack([limit, tools, PostureTask(np.zeros(6))], limits=[JointLimit()])
        solver, q, nearest = get_solver("qp_cascade"), np.full(6, 0.1), []
        for _ in range(200):
            robot.update(q)
            nearest.append(limit.distances(robot).min())
            q = robot.integrate(q, solver.solve(stack.problem(robot, dt)).require(), dt)
        assert tools[0].error(robot)[0] ** 2 > 0.05  # it is the limit that holds them back
        runs.append(np.array(nearest))
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-6)
    for nearest in runs:
        assert 0.029 < nearest.min() < 0.033
        assert nearest[0] > 0.2


def test_what_names_mean() -> None:
    robot = MujocoRobot(
        mujoco.MjModel.from_xml_string(
            """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
            <body name="hand" pos="0 0 1"><joint/><geom name="shown" size=".1" contype="0" conaffinity="0"/>
            <geom name="shell" size=".1"/><geom size=".2"/><site name="tip"/>
            <body name="finger" pos="1 0 0"><geom name="finger" size=".1"/></body>
            <body name="elbow" pos="0 1 0"><joint/><geom name="hand2" size=".1"/><geom name="other" size=".1"/></body>
            <body name="other" pos="0 0 1"><joint/><geom size=".1" name="only"/></body>
            <body name="bare"/></body></worldbody></mujoco>"""
        )
    )

    def pairs(*given):
        return CollisionLimit(given).pairs(robot)

    assert pairs(("hand", "floor")) == (("shell", "floor"), ("geom 3 of hand", "floor"))
    assert pairs(("finger", "floor")) == (("finger", "floor"),)  # body and geom are the same thing
    assert pairs(("shown", "floor")) == (("shown", "floor"),)
    assert pairs(("elbow", "floor"), ("floor", "elbow")) == (("hand2", "floor"), ("other", "floor"))
    assert pairs(("geom:other", "floor"), ("body:other", "floor")) == (("other", "floor"), ("only", "floor"))
    assert pairs((["finger", "shown"], ["floor", "only"])) == (("finger", "floor"), ("shown", "floor"))
    assert pairs((["elbow"], ["floor", "only"]))[1] == ("hand2", "only")
    for given_pair, message in (
        (
            ("hnad", "floor"),
            r"limit 'collision': Distances: There is no geom or body named 'hnad'. Did you mean 'hand'",
        ),
        (("other", "floor"), r"'other' is both a geom and a body with other geoms: write 'geom:other' or 'body:other'"),
        (("bare", "floor"), r"the body 'bare' has no geom to measure from"),
        (("hand", "finger"), r"no pair of geoms is left of \[\('hand', 'finger'\)\] \(2 on one rigid body\)"),
        (("shell", "finger"), r"the pair 'shell', 'finger' is fixed on one rigid body"),
        (("floor", "floor"), r"has two planes, whose distance is not computed"),
    ):
        with pytest.raises(RobotError, match=message):
            pairs(given_pair)


def test_another_robot_library() -> None:
    with pytest.raises(
        RobotError, match=r"limit 'collision': distances .* that MuJoCo or Pinocchio computes; this one is a Chain"
    ):
        CollisionLimit([("a", "b")]).rows(random_chain(np.random.default_rng(0)), 0.01, None)


@pytest.mark.parametrize(
    ("pairs", "values", "message"),
    [
        ([], {}, r"the pairs of 'collision' are \[\]; give a list of pairs"),
        (["ab"], {}, r"hold 'ab'; each must be \(a, b\)"),
        ([("a", [])], {}, r"each must be \(a, b\)"),
        ([("a", 3)], {}, r"each must be \(a, b\)"),
        ([("a", "b")], {"margin": -0.1}, r"the margin of 'collision' is -0.1; it must be a finite number >= 0, in m"),
        ([("a", "b")], {"gain": 0.0}, r"the gain of 'collision' is 0.0; it must be a finite number > 0"),
        ([("a", "b")], {"gain": np.inf}, r"the gain of 'collision' is inf"),
        ([("a", "b")], {"deceleration": -1.0}, r"the deceleration of 'collision' is -1.0"),
        ([("a", "b")], {"return_speed": 0}, r"the return_speed of 'collision' is 0"),
        ([("a", "b")], {"margin": 0.5, "detection": 0.4}, r"is 0.4 m; it must be more than the margin, 0.5 m"),
    ],
)
def test_bad_settings(pairs, values, message) -> None:
    with pytest.raises(SettingError, match=message):
        CollisionLimit(pairs, **values)
