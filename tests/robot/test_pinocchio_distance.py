"""Distances of Pinocchio robots: MuJoCo's of the same scene, derivatives, touching and overlapping shapes, what is missing."""

import itertools
import pickle

import coal
import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hqp_rp.core.errors import RobotError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
from hqp_rp.robot.distance import distances_of
from tests.robot.scene import SHAPES, both, flying

ROUND = ("sphere", "capsule")


@pytest.mark.parametrize(("a", "b"), list(itertools.combinations_with_replacement(SHAPES, 2)))
def test_a_scene_in_both_libraries(tmp_path, a: str, b: str) -> None:
    robots = both(tmp_path / "scene.urdf", flying(SHAPES[a], SHAPES[b]))
    assert robots[0].joint_names == robots[1].joint_names
    theirs, ours = (distances_of(robot, [("body0", "body1")], detection=20.0) for robot in robots)
    assert theirs.names == ours.names == (("shape0", "shape1"),)
    rng, h = np.random.default_rng(0), 1e-5
    smooth = "cylinder" not in (a, b)  # nearest points along an edge that is round are less exact
    apart = 0
    for _ in range(40):
        q, v = 0.35 * rng.normal(size=12), rng.normal(size=12)
        (distance,), (row,) = ours.evaluate(q)
        np.testing.assert_array_equal(ours.distances(q), [distance])
        slope = (ours.distances(q + h * v)[0] - ours.distances(q - h * v)[0]) / (2 * h)
        if distance < 0.02 and not (a in ROUND and b in ROUND):
            continue  # two boxes part along the face of least depth: it is not the same for both where two are
        apart += 1
        (their_distance,), (their_row,) = theirs.evaluate(q)
        assert distance == pytest.approx(their_distance, abs=1e-5)
        np.testing.assert_allclose(row, their_row, atol=1e-5 if smooth else 1e-3)
        assert row @ v == pytest.approx(slope, abs=1e-5 if smooth else 1e-3)
    assert apart >= 25


@pytest.mark.parametrize(
    ("a", "b"),
    [("box", "box"), ("box", "cylinder"), ("capsule", "cylinder"), ("cylinder", "cylinder"), ("capsule", "capsule")],
)
def test_depths_of_overlapping_shapes_in_both_libraries(tmp_path, a: str, b: str) -> None:
    """At finer tolerances than those chosen, coal answers some of these placements with a depth that is wrong by much."""
    robots = both(tmp_path / "scene.urdf", flying(SHAPES[a], SHAPES[b]))
    theirs, ours = (distances_of(robot, [("body0", "body1")]) for robot in robots)
    rng, overlapping = np.random.default_rng(1), 0
    while overlapping < 150:
        q = np.r_[0.15 * rng.normal(size=3), 2.0 * rng.normal(size=3), np.zeros(3), 2.0 * rng.normal(size=3)]
        depth = ours.distances(q)[0]
        if depth < 0.0:
            overlapping += 1
            assert depth == pytest.approx(theirs.distances(q)[0], abs=1e-5)


@pytest.mark.parametrize("gap", [0.0, 1e-9, -1e-9, 1e-6, -1e-6])
@pytest.mark.parametrize("other", SHAPES)
def test_touching_shapes_have_a_normal(tmp_path, other: str, gap: float) -> None:
    robot = both(tmp_path / "scene.urdf", flying(SHAPES["box"], SHAPES[other]))[1]
    measure = distances_of(robot, [("body0", "body1")])
    q = np.array([0, 0, 0, 0, 0, 0, 0.4, 0.03, 0.02, 0, 0, 0.0])
    for _ in range(4):  # along the normal, until they touch
        (distance,), (row,) = measure.evaluate(q)
        q[6:9] -= (distance - gap) * row[6:9]
    (distance,), (row,) = measure.evaluate(q)
    assert distance == pytest.approx(gap, abs=1e-6)
    assert np.linalg.norm(row[6:9]) == pytest.approx(1.0)
    np.testing.assert_allclose(row[:3], -row[6:9], atol=1e-12)
    step = measure.distances(q + 1e-4 * np.r_[np.zeros(6), row[6:9], np.zeros(3)])[0]
    assert step == pytest.approx(gap + 1e-4, abs=3e-6)


def test_every_placement_has_an_answer() -> None:
    """coal finds none for some shapes at the fine tolerance, and no normal where centres coincide."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("body", joint, 0, pin.SE3.Identity(), pin.FrameType.BODY), False)
    geometry, shapes = pin.GeometryModel(), [coal.Cylinder(0.1, 0.4), coal.Ellipsoid(0.1, 0.2, 0.15), coal.Sphere(0.1)]
    for i, shape in enumerate(shapes):
        geometry.addGeometryObject(pin.GeometryObject(f"fixed{i}", 0, 0, pin.SE3.Identity(), shape))
        geometry.addGeometryObject(pin.GeometryObject(f"moved{i}", joint, 1, pin.SE3.Identity(), shape))
    robot = PinocchioRobot(model, geometry=geometry)
    measure = distances_of(robot, [("fixed*", "body")], detection=5.0)
    assert len(measure.names) == 9
    rng, q = np.random.default_rng(1), pin.neutral(model)
    for i in range(300):
        distances, jacobian = measure.evaluate(q)
        assert np.isfinite(jacobian).all()
        assert np.abs(distances).max() < 3.0
        np.testing.assert_allclose(np.linalg.norm(jacobian[:, :3], axis=1), 1.0, atol=1e-6)
        q = pin.integrate(
            model, pin.neutral(model), np.r_[rng.normal(size=3) * (0.1 if i % 2 else 0.4), 3 * rng.normal(size=3)]
        )


MJCF = """<mujoco><option ccd_tolerance="1e-10" ccd_iterations="200"/>
<asset><mesh name="wedge" vertex="0 0 0  .3 0 0  0 .2 0  0 0 .4  .1 .1 .3"/></asset><worldbody>
<geom name="floor" type="plane" size="1 1 1" euler="10 20 0"/>
<body name="one" pos="0 0 .6"><joint name="a" axis="1 0 1" pos=".1 0 0"/><joint name="b" type="slide" axis="0 1 0"/>
 <geom name="wedge" type="mesh" mesh="wedge"/><geom type="ellipsoid" size=".1 .05 .15" pos="-.2 0 .1" euler="30 0 0"/>
 <body pos=".7 0 0" euler="0 0 40"><joint name="c" axis="0 1 0"/><geom name="unnamed_body" size=".05"/>
  <body name="three" pos=".5 0 .1"><joint name="d" axis="0 0 1"/><geom type="box" size=".1 .05 .02" name="three"/>
   <geom name="shown" size=".5" contype="0" conaffinity="0"/></body>
 </body>
</body>
<body name="loose" pos=".3 .8 .7"><freejoint/><geom name="loose" type="capsule" size=".05 .2"/></body>
</worldbody><contact><exclude body1="three" body2="loose"/></contact></mujoco>"""


def test_a_model_from_mujoco_keeps_its_names_and_its_filter() -> None:
    source = mujoco.MjModel.from_xml_string(MJCF)
    robots = MujocoRobot(source), PinocchioRobot.from_mujoco(source)
    group = ["world", "one", "unnamed_body", "three", "loose"]
    theirs, ours = (distances_of(robot, [(group, group)], detection=9.0) for robot in robots)
    assert theirs.names == ours.names
    assert ("geom 2 of one", "three") in ours.names
    assert not {("wedge", "unnamed_body"), ("three", "loose"), ("shown", "loose")} & set(ours.names)
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = np.r_[0.5 * rng.normal(size=4), rng.normal(size=3), rng.normal(size=4)]
        q[7:] /= np.linalg.norm(q[7:])
        other = np.r_[q[:7], np.roll(q[7:], -1)]
        robots[0].update(q)
        change = np.eye(10)
        change[4:7, 4:7] = robots[0].pose("loose")[0]
        (d0, J0), (d1, J1) = theirs.evaluate(q), ours.evaluate(other)
        far = d0 > 0.02
        np.testing.assert_allclose(d1[far], d0[far], atol=1e-5)
        np.testing.assert_allclose(J1[far], (J0 @ change)[far], atol=1e-3)
        np.testing.assert_allclose(ours.distances(np.r_[other[:7], 3.0 * other[7:]]), d1, atol=1e-12)


def test_arms_have_the_shapes_of_their_mujoco_model() -> None:
    robots = MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())
    theirs, ours = (distances_of(robot, [("link*", "link*")]) for robot in robots)
    assert theirs.names == ours.names
    assert len(ours.names) == 15
    for q in np.random.default_rng(0).normal(size=(5, 7)):
        for found, expected in zip(ours.evaluate(q), theirs.evaluate(q), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_beyond_detection() -> None:
    robot = PinocchioRobot.from_arm(sawyer())
    near = distances_of(robot, [("link1", "link5"), ("link1", "link3")], detection=0.3)
    distances, jacobian = near.evaluate(robot.neutral)
    assert distances[0] == np.inf
    assert distances[1] < 0.1
    np.testing.assert_array_equal(jacobian[0], 0.0)
    assert jacobian[1].any()


def test_the_robot_is_left_as_it_was_and_travels_with_its_geometry(tmp_path) -> None:
    robot = both(tmp_path / "scene.urdf", flying(SHAPES["box"], SHAPES["sphere"]))[1]
    measure, before = distances_of(robot, [("body0", "body1")]), robot.pose("body1")[1]
    q = np.full(12, 0.3)
    expected = measure.evaluate(q)
    np.testing.assert_array_equal(robot.pose("body1")[1], before)
    again = distances_of(pickle.loads(pickle.dumps(robot)), [("body0", "body1")]).evaluate(q)
    for found, value in zip(again, expected, strict=True):
        np.testing.assert_array_equal(found, value)


def test_collision_pairs_of_the_geometry_are_the_only_ones() -> None:
    robot = PinocchioRobot.from_arm(sawyer())
    geometry = robot.geometry
    geometry.addAllCollisionPairs()
    geometry.removeCollisionPair(pin.CollisionPair(geometry.getGeometryId("link1"), geometry.getGeometryId("link3")))
    names = distances_of(robot, [("link*", "link*")]).names
    assert len(names) == 14
    assert ("link1", "link3") not in names
    assert distances_of(robot, [("link3", "link1")]).names == (("link3", "link1"),)


def test_what_cannot_be_measured() -> None:
    robot = PinocchioRobot(PinocchioRobot.from_arm(sawyer()).model)
    with pytest.raises(
        RobotError, match=r"has no collision geometry: load the robot with PinocchioRobot.from_file, or gi"
    ):
        distances_of(robot, [("link1", "link3")])
    with pytest.raises(RobotError, match=r"geometry is a str; give a pinocchio.GeometryModel"):
        PinocchioRobot(robot.model, geometry="robot.urdf")
    flat = coal.BVHModelOBBRSS()
    flat.beginModel(2, 4)
    flat.addVertices(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    flat.addTriangles(np.array([[0, 1, 2], [1, 2, 3]]))
    flat.endModel()
    geometry = pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("sheet", 0, 0, pin.SE3.Identity(), flat))
    geometry.addGeometryObject(
        pin.GeometryObject("ball", 7, robot.model.getFrameId("link7"), pin.SE3.Identity(), coal.Sphere(0.1))
    )
    with pytest.raises(
        RobotError, match=r"Distances: 'sheet' is a mesh without volume; use a box or a mesh with volume"
    ):
        distances_of(PinocchioRobot(robot.model, geometry=geometry), [("sheet", "link7")])
    source = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody><geom name="ground" type='
        '"hfield" hfield="h"/><body name="b"><joint/><geom name="g" size=".1"/></body></worldbody></mujoco>'
    )
    for hilly in (MujocoRobot(source), PinocchioRobot.from_mujoco(source)):
        with pytest.raises(
            RobotError, match=r"the pair 'g', 'ground' has a height field, whose distance is not computed"
        ):
            distances_of(hilly, [("b", "world")])
