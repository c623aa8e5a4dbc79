"""What names, patterns and groups of geoms stand for, and what is left out of their pairs: what MuJoCo's own filter does."""

import mujoco
import numpy as np
import pytest

from hqp_rp.core.errors import RobotError
from hqp_rp.robot.geoms import pairs_of
from hqp_rp.robot.mujoco_model import geoms_of


def random_tree(rng: np.random.Generator, *, filtered: bool) -> mujoco.MjModel:
    """Bodies on bodies, some without a joint, all their spheres in one place; some pairs of bodies excluded."""
    spec = mujoco.MjSpec()
    bodies = [spec.worldbody]
    for i in range(12):
        body = bodies[rng.integers(len(bodies))].add_body(name=f"b{i}")
        if rng.random() < 0.6:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE)
        bodies.append(body)
    for body in bodies:
        for _ in range(rng.integers(0, 3)):
            body.add_geom(size=[0.1, 0, 0], pos=0.01 * rng.normal(size=3))
    for _ in range(6):
        a, b = rng.choice(12, 2, replace=False)
        spec.add_exclude(bodyname1=f"b{a}", bodyname2=f"b{b}")
    if not filtered:
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    bodies[1].add_geom(size=[0.1, 0, 0])  # it is never without a pair
    bodies[1].add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    spec.worldbody.add_geom(size=[0.1, 0, 0])
    for body in bodies[1:]:
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
    return spec.compile()


@pytest.mark.parametrize("filtered", [True, False])
def test_a_group_against_itself_is_what_mj_collision_looks_at(filtered: bool) -> None:
    sizes = []
    for seed in range(25):
        model = random_tree(np.random.default_rng(seed), filtered=filtered)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        expected = {tuple(sorted(pair)) for pair in data.contact.geom.tolist()}
        everything = [model.body(i).name for i in range(model.nbody) if model.body_geomnum[i]]
        found = pairs_of(geoms_of(model), [(everything, everything)])
        assert len(set(map(frozenset, found))) == len(found)
        assert {tuple(sorted(pair)) for pair in found} == expected
        sizes.append(len(found))
    assert min(sizes) >= 1
    assert max(sizes) > 50


CHAIN = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="base"><geom name="base" size=".1"/>
 <body name="arm_1"><joint/><geom name="arm_1_a" size=".1"/><geom name="arm_1_seen" size=".1" contype="0" conaffinity="0"/>
  <body name="arm_2"><joint/><geom name="arm_2_a" size=".1"/><geom name="arm_2_b" size=".1"/>
   <body name="plate"><geom name="plate_a" size=".1"/>
    <body name="arm_3"><joint/><geom name="arm_3_a" size=".1"/></body>
   </body>
   <body name="empty"/>
  </body>
 </body>
</body></worldbody><contact><exclude body1="base" body2="arm_3"/></contact></mujoco>"""


@pytest.fixture(scope="module")
def chain():
    return geoms_of(mujoco.MjModel.from_xml_string(CHAIN))


def named(geoms, *pairs):
    return {(geoms.shown[a], geoms.shown[b]) for a, b in pairs_of(geoms, pairs)}


def test_neighbours_are_left_out_of_bodies_and_groups_alone(chain) -> None:
    # The parent of what is fixed to the world is not left out; the plate is one with arm_2, hence arm_3 hangs on arm_2.
    arm = ["base", "arm_1", "arm_2", "plate", "arm_3"]
    bodies = {
        ("base", "arm_1_a"),
        ("base", "arm_2_a"),
        ("base", "arm_2_b"),
        ("base", "plate_a"),
        ("arm_1_a", "arm_3_a"),
    }
    assert named(chain, (arm, arm)) == bodies
    assert named(chain, ("arm_*", "arm_*")) == {("arm_1_a", "arm_3_a")}
    assert named(chain, (["arm_2_a", "arm_1_a"], ["arm_3_a"])) == {("arm_1_a", "arm_3_a")}
    assert named(chain, ("floor", ["base", "arm_3"])) == {("floor", "arm_3_a")}


def test_two_geoms_named_one_by_one_are_kept(chain) -> None:
    assert named(chain, ("plate_a", "arm_3_a")) == {("plate_a", "arm_3_a")}
    assert named(chain, ("geom:base", "arm_3_a")) == {("base", "arm_3_a")}  # excluded by the model
    with pytest.raises(RobotError, match=r"the pair 'arm_2_a', 'plate_a' is fixed on one rigid body"):
        pairs_of(chain, [("arm_2_a", "plate_a")])
    with pytest.raises(RobotError, match=r"the pair 'plate_a', 'plate_a' is fixed on one rigid body"):
        pairs_of(chain, [("plate_a", "plate_a")])


def test_patterns_stand_for_what_bodies_stand_for(chain) -> None:
    assert named(chain, ("arm_1*", "floor")) == {("arm_1_a", "floor")}  # not arm_1_seen, which does not collide
    assert named(chain, ("*_a", "floor")) == {(f"{n}_a", "floor") for n in ("arm_1", "arm_2", "plate", "arm_3")}
    assert named(chain, ("body:arm_[12]", "floor")) == {(f"arm_{n}", "floor") for n in ("1_a", "2_a", "2_b")}
    assert named(chain, ("geom:*_b", "floor")) == {("arm_2_b", "floor")}
    assert named(chain, ("arm_1_seen", "floor")) == {("arm_1_seen", "floor")}


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        (("leg_*", "floor"), r"no geom, and no body that has one, matches 'leg_\*'; the bodies are world, base, arm_1"),
        (("empt?", "floor"), r"no geom, and no body that has one, matches 'empt\?'"),
        (("geom:arm_1", "floor"), r"There is no geom or body named 'geom:arm_1'"),
        (("empty", "floor"), r"the body 'empty' has no geom to measure from"),
        (
            ("arm_2", "arm_1"),
            r"no pair of geoms is left of \[\('arm_2', 'arm_1'\)\] \(2 on a body and its parent\); name other bodies, or two "
            r"geoms one by one, as \('a', 'b'\)",
        ),
        (("plate", "arm_2"), r"no pair of geoms is left .* \(2 on one rigid body\)"),
        (("body:base", "arm_3"), r"no pair of geoms is left .* \(1 excluded by the model\)"),
    ],
)
def test_errors(chain, pair, message) -> None:
    with pytest.raises(RobotError, match=message):
        pairs_of(chain, [pair])


def test_an_entry_of_which_nothing_is_left_is_no_error_beside_others(chain) -> None:
    assert named(chain, ("arm_1", "arm_2"), ("arm_1", "arm_3")) == {("arm_1_a", "arm_3_a")}
