"""The joint box: never empty, never left, and a bounded, monotone way back; with a limit on jerk as well."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.control import JointLimit, PostureTask, Stack
from hqp_rp.core._native import allowed_step, stop_change, stop_rise
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot.named import named_robot
from tests.control.chain import Chain, random_chain

_allowed_step = np.vectorize(allowed_step)

N = 8


def box(q, v, a=None, *, lower, upper, V, dt, **settings):
    robot = Chain(np.ones((len(q), 3)), np.ones((len(q) + 1, 3)))
    robot.lower, robot.upper, robot.velocity_limit = lower, upper, V
    robot.q = np.asarray(q, dtype=float)
    G, low, high = JointLimit(**settings).rows(robot, dt, v, a)
    np.testing.assert_array_equal(G, np.eye(len(q)))
    return low, high


def scene(seed, dt):
    rng = np.random.default_rng(seed)
    middle, half = rng.normal(size=N), rng.uniform(0.0, 2.0, N)
    lower, upper = middle - half, middle + half
    # Some joints have a limit on one side or on none.
    lower[0], upper[1], lower[2], upper[2] = -np.inf, np.inf, -np.inf, np.inf
    V = rng.uniform(0.1, 3.0, N)
    A = V / dt * 10.0 ** rng.uniform(-3.0, 1.0, N)
    A[3] = np.inf
    return rng, lower, upper, V, A


seeds = st.integers(0, 2**32 - 1)
steps = st.sampled_from([1e-3, 0.01, 0.3])
gains = st.sampled_from([1.0, 0.95, 0.3, 0.01])


@given(seed=seeds, dt=steps, gain=gains, accelerations=st.booleans(), scale=st.sampled_from([1e-9, 1.0, 30.0]))
def test_the_box_is_never_empty_and_keeps_velocity_and_acceleration(seed, dt, gain, accelerations, scale):
    rng, lower, upper, V, A = scene(seed, dt)
    q, v = scale * rng.normal(size=N), scale * rng.normal(size=N)
    low, high = box(q, v, lower=lower, upper=upper, V=V, dt=dt, gain=gain, acceleration=A if accelerations else None)
    assert (low <= high).all()
    assert (low >= -V).all()
    assert (high <= V).all()
    if accelerations:
        kept = np.abs(v) <= V + A * dt
        slack = 1e-12 * (1 + np.abs(v))
        assert (low >= v - A * dt - slack)[kept].all()
        assert (high <= v + A * dt + slack)[kept].all()


def play(choose, rng, low, high):
    share = {"upper": 1.0, "lower": 0.0, "random": rng.uniform(size=N), "bang": rng.integers(0, 2, N)}[choose]
    low_share = np.where(share == 1.0, high, low + share * (high - low))
    return np.clip(low_share, low, high)


@given(
    seed=seeds,
    dt=steps,
    gain=gains,
    accelerations=st.booleans(),
    choose=st.sampled_from(["upper", "lower", "random", "bang"]),
)
def test_from_rest_inside_the_limits_are_never_left(seed, dt, gain, accelerations, choose):
    rng, lower, upper, V, A = scene(seed, dt)
    finite_low, finite_up = np.where(np.isfinite(lower), lower, -9.0), np.where(np.isfinite(upper), upper, 9.0)
    q, v = rng.uniform(finite_low, finite_up), np.zeros(N)
    for _ in range(60):
        low, high = box(
            q, v, lower=lower, upper=upper, V=V, dt=dt, gain=gain, acceleration=A if accelerations else None
        )
        new = play(choose, rng, low, high)
        if accelerations:
            assert (np.abs(new - v) <= A * dt + 1e-9).all()
        v = new
        q = q + dt * v
        assert (q >= lower - 1e-11).all()
        assert (q <= upper + 1e-11).all()


@given(
    seed=seeds,
    dt=steps,
    gain=gains,
    accelerations=st.booleans(),
    choose=st.sampled_from(["upper", "lower", "random", "bang"]),
)
def test_from_rest_outside_the_way_back_is_monotone_and_bounded(seed, dt, gain, accelerations, choose):
    rng, lower, upper, V, A = scene(seed, dt)
    bounded = np.isfinite(lower) & np.isfinite(upper)
    out = rng.uniform(0.0, 3.0, N) * rng.choice([-1.0, 1.0], N)
    q = np.where(bounded, np.where(out > 0, upper + out, lower + out), 0.0)
    v = np.zeros(N)

    def outside(q):
        return np.maximum(0.0, np.maximum(q - upper, lower - q))

    distance = outside(q)
    for _ in range(60):
        low, high = box(
            q, v, lower=lower, upper=upper, V=V, dt=dt, gain=gain, acceleration=A if accelerations else None
        )
        new = play(choose, rng, low, high)
        assert (np.abs(new) <= V).all()
        promised = np.minimum(gain * distance, V * dt)
        if accelerations:
            assert (np.abs(new - v) <= A * dt + 1e-9).all()
            reach = np.maximum(0.0, np.minimum(np.abs(v) + A * dt, np.inf)) * dt
            promised = np.minimum(promised, np.minimum(_allowed_step(distance, gain, A * dt * dt), reach))
        v = new
        q = q + dt * v
        now = outside(q)
        assert (now <= np.maximum(distance - promised, 0.0) + 1e-11).all()
        distance = now


def test_outside_and_moving_out_brakes_first():
    low, high = box(
        [1.2],
        np.array([0.5]),
        lower=np.array([-1.0]),
        upper=np.array([1.0]),
        V=np.array([2.0]),
        dt=0.1,
        acceleration=1.0,
    )
    np.testing.assert_allclose([low[0], high[0]], [0.4, 0.4])


def test_known_boxes():
    shape = {"lower": np.array([-1.0]), "upper": np.array([1.0]), "V": np.array([2.0]), "dt": 0.1}
    np.testing.assert_allclose(box([0.0], None, **shape), [[-2.0], [2.0]])  # far away: the velocity limit
    np.testing.assert_allclose(box([0.9], None, gain=0.5, **shape), [[-2.0], [0.5]])  # 0.5 * 0.1 / 0.1
    np.testing.assert_allclose(box([1.04], None, gain=0.5, **shape), [[-2.0], [-0.2]])  # outside: must come back
    np.testing.assert_allclose(box([5.0], None, gain=0.5, **shape), [[-2.0], [-2.0]])  # far outside: no faster than V
    np.testing.assert_allclose(box([0.9], None, margin=0.1, gain=1.0, **shape), [[-2.0], [0.0]])
    np.testing.assert_allclose(box([1.04], None, position=False, **shape), [[-2.0], [2.0]])


@given(d=st.floats(1e-9, 1e3), a=st.floats(1e-6, 1e3))
def test_longest_step_is_the_one_that_just_stops(d, a):
    x = float(_allowed_step(np.array([d]), 1.0, np.array([a]))[0])
    if x < 1e4 * a:
        path = np.maximum(0.0, x - a * np.arange(int(x / a) + 2)).sum()
        assert path == pytest.approx(d, rel=1e-9)
    else:  # so many steps that the sum is its integral
        assert x * x / (2 * a) == pytest.approx(d, rel=1e-3)


def test_robot_with_several_coordinates_per_joint():
    """A free joint before a hinge: positions are looked up by coordinate, not by velocity index."""
    mujoco = pytest.importorskip("mujoco")
    from hqp_rp.robot import MujocoRobot

    model = mujoco.MjModel.from_xml_string(
        """<mujoco><compiler angle="radian"/><worldbody><body><freejoint/><geom size=".1"/><body><joint type="hinge"
        limited="true" range="-1 2"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    )
    robot = MujocoRobot(model)
    q = robot.neutral.copy()
    q[:3], q[7] = 7.0, 1.5
    robot.update(q)
    _, low, high = JointLimit(gain=0.5).rows(robot, 0.1, None)
    np.testing.assert_array_equal(low[:6], -np.inf)
    np.testing.assert_array_equal(high[:6], np.inf)
    np.testing.assert_allclose([low[6], high[6]], [-12.5, 2.5])


def test_accelerations_need_the_velocity_before():
    with pytest.raises(SettingError, match=r"needs the velocity before this step: stack.problem\(robot, dt, v\)"):
        JointLimit(acceleration=1.0).rows(random_chain(np.random.default_rng(0)), 0.1, None)


def test_a_margin_that_swallows_the_range():
    with pytest.raises(RobotError, match=r"velocity index 0 the margin 3 swallows the range \[-2, 2\]"):
        JointLimit(margin=3.0).rows(random_chain(np.random.default_rng(0)), 0.1, None)


def test_a_robot_without_any_limit():
    robot = Chain(np.ones((2, 3)), np.ones((3, 3)), limit=np.inf, velocity=np.inf)
    with pytest.raises(RobotError, match=r"has no such limits and none are given"):
        JointLimit().rows(robot, 0.1, None)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gain": 0.0}, "the gain of 'joint limits' is 0.0; it must be a finite number > 0"),
        ({"gain": 1.5}, r"it must be in \(0, 1\]"),
        ({"margin": -1.0}, "the margin of 'joint limits' is -1.0; it must be finite and >= 0"),
        ({"velocity": -1.0}, "the velocity of 'joint limits' is -1.0; it must be > 0"),
        ({"jerk": 0.0}, "the jerk of 'joint limits' is 0.0; it must be > 0: one number, or one for each velocity"),
        ({"jerk": {"joint1": float("nan")}}, "the jerk of 'joint limits': 'joint1' has nan; it must be a number > 0"),
        ({"acceleration": {"joint1": 0.0}}, "'joint1' has 0.0; it must be a number > 0"),
        ({"acceleration": [1.0, float("nan")]}, "it must be > 0"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(SettingError, match=message):
        JointLimit(**settings)


def test_numbers_by_joint_name():
    robot = random_chain(np.random.default_rng(0))
    robot.update(np.zeros(7))
    _, low, high = JointLimit(velocity={"joint3": 0.25}).rows(robot, 0.01, None)
    np.testing.assert_array_equal(high, [1.5, 1.5, 0.25, 1.5, 1.5, 1.5, 1.5])
    np.testing.assert_array_equal(low, -high)
    with pytest.raises(RobotError, match=r"no joint named 'elbow'.*Valid: joint1"):
        JointLimit(velocity={"elbow": 1.0}).rows(robot, 0.01, None)
    with pytest.raises(RobotError, match=r"2 numbers are given; the robot has nv = 7"):
        JointLimit(velocity=[1.0, 2.0]).rows(robot, 0.01, None)


class Jerked:
    """N joints with limits of many sizes, and their box at any state. `room` is u - l of each."""

    def __init__(self, seed, dt, gain, *, acceleration=True, sharpest=1.0):
        self.rng, self.dt = np.random.default_rng(seed), dt
        rng = self.rng
        self.robot = robot = Chain(np.ones((N, 3)), np.ones((N + 1, 3)))
        self.V = robot.velocity_limit = 10.0 ** rng.uniform(-1.0, 1.0, N)
        # From stops within one step to stops of thousands.
        self.A = self.V / dt * 10.0 ** rng.uniform(-3.0, sharpest, N)
        self.J = self.A / dt * 10.0 ** rng.uniform(-3.0, sharpest, N)
        if not acceleration:
            self.A = np.full(N, np.inf)
        middle, self.room = rng.normal(size=N), 10.0 ** rng.uniform(-3.0, 1.0, N)
        self.lower, self.upper = middle - self.room / 2, middle + self.room / 2
        robot.lower, robot.upper = self.lower, self.upper
        self.limit = JointLimit(acceleration=self.A if acceleration else None, jerk=self.J, gain=gain)

    def box(self, q, v, a):
        self.robot.q = q
        _, low, high = self.limit.rows(self.robot, self.dt, v, a)
        return low, high

    def keeps(self, v, a, new):
        """Whether V, A and J are kept, to rounding."""
        change, noise = new - v, 1e-11 * self.V
        return (
            (np.abs(new) <= self.V).all()
            and (np.abs(change) <= self.A * self.dt + noise).all()
            and (np.abs(change - a * self.dt) <= self.J * self.dt**2 + noise).all()
        )


ways = st.sampled_from(["upper", "lower", "random", "bang", "slow"])


def chosen(way, rng, k, low, high):
    if way == "slow":  # one end for long, then the other
        return high if (k // 40) % 2 else low
    return play(way, rng, low, high)


@given(seed=seeds, dt=steps, gain=gains, accelerations=st.booleans(), size=st.integers(-9, 6))
def test_with_jerk_the_box_is_never_empty_and_jerk_yields_first(seed, dt, gain, accelerations, size):
    scene = Jerked(seed, dt, gain, acceleration=accelerations)
    rng, V, A, J = scene.rng, scene.V, scene.A, scene.J
    q, v, a = (10.0**size * rng.normal(size=N) for _ in range(3))
    low, high = scene.box(q, v, a)
    assert (low <= high).all()
    assert (low >= -V).all()
    assert (high <= V).all()
    slack = 1e-12 * (1 + np.abs(v) + np.abs(a))
    kept = np.abs(v) <= V + A * dt
    assert (low >= v - A * dt - slack)[kept].all()
    assert (high <= v + A * dt + slack)[kept].all()
    # The jerk is kept wherever velocity and acceleration let it.
    nearest = np.clip(v + a * dt, np.clip(v - A * dt, -V, V), np.clip(v + A * dt, -V, V))
    kept = np.abs(nearest - v - a * dt) <= J * dt**2
    assert (low >= v + a * dt - J * dt**2 - slack)[kept].all()
    assert (high <= v + a * dt + J * dt**2 + slack)[kept].all()


@given(seed=seeds, dt=steps, gain=gains, accelerations=st.booleans(), way=ways)
def test_with_jerk_from_rest_inside_all_limits_are_kept(seed, dt, gain, accelerations, way):
    scene = Jerked(seed, dt, gain, acceleration=accelerations)
    q, v, a = scene.rng.uniform(scene.lower, scene.upper), np.zeros(N), np.zeros(N)
    noise = 1e-13 * (1 + np.abs(q) + scene.room)
    for k in range(300):
        low, high = scene.box(q, v, a)
        new = chosen(way, scene.rng, k, low, high)
        assert scene.keeps(v, a, new)
        v, a = new, (new - v) / dt
        q = q + dt * v
        assert (q >= scene.lower - noise).all()
        assert (q <= scene.upper + noise).all()


@given(seed=seeds, dt=steps, gain=st.sampled_from([1.0, 0.95, 0.3]), accelerations=st.booleans(), outside=st.booleans())
def test_with_jerk_a_driven_joint_comes_to_rest_at_its_limit(seed, dt, gain, accelerations, outside):
    """Inside, driven at the upper end; outside, as slowly as the box allows, and never further out."""
    scene = Jerked(seed, dt, gain, acceleration=accelerations)
    q, v, a = scene.rng.uniform(scene.lower, scene.upper), np.zeros(N), np.zeros(N)
    if outside:
        q = scene.upper + scene.rng.uniform(0.0, 1.0, N) * scene.room
    # From rest to rest over d takes no longer than this: ramps of A and J, and V between them.
    d = 2.0 * scene.room
    longest = (
        d / scene.V + 2.0 * np.sqrt(d / scene.A) + 4.0 * np.cbrt(d / scene.J) + scene.V / scene.A + scene.A / scene.J
    )
    longest = np.where(
        np.isfinite(longest), longest, d / scene.V + 4.0 * np.cbrt(d / scene.J) + np.sqrt(scene.V / scene.J)
    )
    for _ in range(min(4000, int(2.0 * longest.max() / dt) + 100)):
        new = scene.box(q, v, a)[1]
        assert scene.keeps(v, a, new)
        before, v, a = q, new, (new - v) / dt
        q = q + dt * v
        assert not outside or (q <= np.maximum(before, scene.upper) + 1e-13 * (1 + np.abs(q))).all()
    there = 2.0 * longest <= 4000 * dt
    assert (np.abs(q - scene.upper) <= 1e-6)[there].all()
    assert (np.abs(v) <= 1e-6)[there].all()


@given(seed=seeds, dt=steps, gain=gains, way=ways)
def test_with_jerk_from_rest_outside_nothing_moves_further_out(seed, dt, gain, way):
    scene = Jerked(seed, dt, gain)
    side = scene.rng.choice([-1.0, 1.0], N)
    q = np.where(side > 0, scene.upper, scene.lower) + side * scene.rng.uniform(0.0, 2.0, N) * scene.room
    v, a = np.zeros(N), np.zeros(N)

    def outside(q):
        return np.maximum(0.0, np.maximum(q - scene.upper, scene.lower - q))

    for k in range(300):
        low, high = scene.box(q, v, a)
        new = chosen(way, scene.rng, k, low, high)
        assert scene.keeps(v, a, new)
        before = outside(q)
        v, a = new, (new - v) / dt
        q = q + dt * v
        assert (outside(q) <= before + 1e-13 * (1 + np.abs(q))).all()


@given(u=st.floats(-50.0, 50.0), share=st.floats(-1.0, 1.0), a=st.one_of(st.just(np.inf), st.floats(0.05, 100.0)))
def test_the_stop_rises_as_its_closed_form_says(u, share, a):
    c = share * min(a, 30.0)
    rise = stop_rise(u, c, a, 1.0)
    x = top = 0.0
    for _ in range(20000):
        before, c = c, stop_change(u, c, a, 1.0)
        assert abs(c) <= a
        assert abs(c - before) <= 1.0 + 1e-12
        u += c
        x += u
        top = max(top, x)
        if abs(u) < 1e-13 and abs(c) <= 1.0:
            break
    else:
        raise AssertionError("no end")
    assert rise == pytest.approx(top, rel=1e-10, abs=1e-9)


def test_known_boxes_with_jerk():
    shape = {"lower": np.array([-1.0]), "upper": np.array([1.0]), "V": np.array([2.0]), "dt": 0.1}
    rest = np.zeros(1)
    # 1 rad/s^3 and no limit on the acceleration: 0.01 rad/s a step.
    np.testing.assert_allclose(box([0.0], rest, rest, jerk=1.0, **shape), [[-0.01], [0.01]])
    np.testing.assert_allclose(box([0.0], rest, rest + 0.2, jerk=1.0, **shape), [[0.01], [0.03]])
    # At 1.98 rad/s and 0.2 rad/s^2, ramped down by 0.01 rad/s a step, 1.99 are reached; at 0.3 rad/s^2 2.01 are: too many.
    np.testing.assert_allclose(
        box([-9.0], rest + 1.97, rest + 0.2, jerk=1.0, position=False, **shape), [[1.98], [1.99]]
    )
    np.testing.assert_allclose(
        box([-9.0], rest + 1.97, rest + 0.3, jerk=1.0, position=False, **shape), [[1.99], [1.99]]
    )
    # So strong that it says nothing: the box is that of the acceleration alone.
    far = {"acceleration": 3.0, "gain": 1.0} | shape
    np.testing.assert_allclose(box([0.9], rest, rest, jerk=1e9, **far), box([0.9], rest, **far))


def test_jerk_by_joint_name_leaves_the_others_as_they_are():
    robot = random_chain(np.random.default_rng(0))
    robot.update(np.zeros(7))
    rng = np.random.default_rng(1)
    v, a = 0.1 * rng.normal(size=7), rng.normal(size=7)
    without = JointLimit(acceleration=5.0).rows(robot, 0.01, v)
    some = JointLimit(acceleration=5.0, jerk={"joint3": 50.0}).rows(robot, 0.01, v, a)
    np.testing.assert_array_equal(np.flatnonzero((some[1] != without[1]) | (some[2] != without[2])), [2])


def test_jerk_needs_velocity_and_acceleration_before():
    robot = random_chain(np.random.default_rng(0))
    robot.update(np.zeros(7))
    stack, rest = Stack([PostureTask(np.zeros(7))], [JointLimit(jerk=10.0)]), np.zeros(7)
    for motion in ((), (rest,)):
        with pytest.raises(
            SettingError, match=r"bounds jerks, so it needs .*: stack.problem\(robot, dt, v, a\); zeros"
        ):
            stack.problem(robot, 0.01, *motion)
    with pytest.raises(SettingError, match=r"a is \[nan, .*; it must be 7 finite numbers in rad/s\^2 or m/s\^2"):
        stack.problem(robot, 0.01, rest, np.full(7, np.nan))
    hard = stack.problem(robot, 0.01, rest, rest).hard
    assert hard is not None
    np.testing.assert_allclose(hard.upper, 10.0 * 0.01**2)
    level = Stack([JointLimit(jerk=10.0)]).batch(robot, np.zeros((2, 7)), 0.01, rest, rest)
    np.testing.assert_allclose(level[2], 10.0 * 0.01**2)


def test_a_number_bounds_a_floating_base_too_and_a_pattern_leaves_it_out():
    robot = named_robot("humanoid")
    robot.update(robot.neutral)
    v, free = np.zeros(robot.nv), {"position": False}
    for settings, bound in (
        ({"velocity": 3.0}, 3.0),
        ({"velocity": {"*": 3.0}}, np.inf),
        ({"velocity": np.inf, "acceleration": 100.0}, 100.0 * 0.002),
        ({"velocity": np.inf, "acceleration": {"*": 100.0}}, np.inf),
    ):
        _, lower, upper = JointLimit(**settings, **free).rows(robot, 0.002, v)
        np.testing.assert_allclose(upper[:6], bound)
        np.testing.assert_allclose(lower[:6], -bound)
        assert np.isfinite(upper[6:]).all()
    J, _ = PostureTask(robot.neutral, joints=["*"]).evaluate(robot)
    np.testing.assert_array_equal(J, np.eye(robot.nv)[6:])
