"""Collision geometry of a URDF: shapes, names, where meshes are found, and what is said of what cannot be read."""

import pathlib

import coal
import numpy as np
import pytest

from hqp_rp.core.errors import RobotError
from hqp_rp.robot import PinocchioRobot
from hqp_rp.robot.distance import distances_of
from tests.robot.scene import SHAPES, both, flying, joint, link

TETRAHEDRON = [(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.4)]


def write_mesh(path: pathlib.Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in TETRAHEDRON)
    path.write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")


def test_shapes_and_names_are_those_of_the_file(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "shapes.urdf"
    text = flying(*SHAPES.values())
    path.write_text(text.replace('name="shape1"', 'name="shape0"').replace(' name="shape3"', ""))
    objects = PinocchioRobot.from_file(path).geometry.geometryObjects
    assert [item.name for item in objects] == ["body0_0", "body1_0", "shape2", "body3_0"]
    sphere, capsule, box, cylinder = (item.geometry for item in objects)
    assert (sphere.radius, capsule.radius, 2 * capsule.halfLength) == (0.1, 0.08, 0.4)
    assert (cylinder.radius, 2 * cylinder.halfLength) == (0.1, 0.4)
    np.testing.assert_allclose(2 * box.halfSide, [0.2, 0.4, 0.3])


def mesh_scene(file: str) -> str:
    mesh = f'<mesh filename="{file}" scale="1 2 1"/>'
    links = link("base", mesh, 'xyz="0 .1 .2" rpy=".1 .2 .3"', "tip") + link("ball", SHAPES["sphere"], collision="ball")
    return f'<robot name="m">{links}{joint("slide", "base", "ball", "prismatic", "0 0 1", "0 0 1")}</robot>'


@pytest.mark.parametrize(
    ("file", "urdf", "mesh"),
    [
        ("tip.obj", "m.urdf", "tip.obj"),
        ("../meshes/tip.obj", "urdf/m.urdf", "meshes/tip.obj"),
        ("package://robot/meshes/tip.obj", "robot/urdf/m.urdf", "robot/meshes/tip.obj"),
        ("package://robot/meshes/tip.obj", "other/urdf/m.urdf", "robot/meshes/tip.obj"),
        ("package://robot/meshes/tip.obj", "m.urdf", "tip.obj"),  # as MuJoCo, by its bare name
    ],
)
def test_where_meshes_are_found(tmp_path: pathlib.Path, file: str, urdf: str, mesh: str) -> None:
    write_mesh(tmp_path / mesh)
    (tmp_path / urdf).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / urdf).write_text(mesh_scene(file))
    shape = PinocchioRobot.from_file(tmp_path / urdf).geometry.geometryObjects[0].geometry
    assert isinstance(shape, coal.Convex)
    expected = sorted((x, 2 * y, z) for x, y, z in TETRAHEDRON)
    np.testing.assert_allclose(sorted(map(tuple, shape.points())), expected, atol=1e-6)


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_packages_of_the_environment(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    (tmp_path / "here").mkdir()
    path = tmp_path / "here" / "m.urdf"
    path.write_text(mesh_scene("package://robot/tip.obj"))
    write_mesh(tmp_path / "there" / ("share/robot" if variable[0] == "A" else "robot") / "tip.obj")
    with pytest.raises(RobotError, match="is not there"):
        _ = PinocchioRobot.from_file(path).geometry
    monkeypatch.setenv(variable, str(tmp_path / "there"))
    assert PinocchioRobot.from_file(path).geometry.ngeoms == 2


def test_a_mesh_is_its_hull_in_both_libraries(tmp_path: pathlib.Path) -> None:
    write_mesh(tmp_path / "tip.obj")
    theirs, ours = (
        distances_of(robot, [("base", "ball")], detection=5.0)
        for robot in both(tmp_path / "m.urdf", mesh_scene("tip.obj"))
    )
    for height in (-1.0, -0.6, 0.0, 0.5):
        for found, expected in zip(ours.evaluate(np.array([height])), theirs.evaluate(np.array([height])), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-5)


def test_without_meshes(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "m.urdf"
    path.write_text(mesh_scene("package://robot/absent.obj"))
    robot = PinocchioRobot.from_file(path, meshes=False)
    assert [item.name for item in robot.geometry.geometryObjects] == ["ball"]
    with pytest.raises(RobotError, match=r"the body 'base' has no geom to measure from"):
        distances_of(robot, [("base", "ball")])


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("", r"m.urdf': link 'a' has a collision with nothing; it must be box, sphere, cylinder, capsule or mesh"),
        ("<cone/>", r"link 'a' has a collision with cone; it must be"),
        ('<box size="1 2"/>', r"link 'a' has a collision box with size '1 2'; it must be 3 numbers > 0\."),
        ('<sphere radius="0"/>', r"link 'a' has a collision sphere with radius '0'; it must be one number > 0\."),
        ('<capsule radius="1"/>', r"link 'a' has a collision capsule with length ''; it must be one number > 0\."),
        ('<mesh filename="absent.obj"/>', r"'absent.obj', which is not there: .* can be left out with meshes=False"),
        ('<mesh filename="m.urdf"/>', r"'m.urdf', which is not read: .* can be left out with meshes=False"),
    ],
)
def test_errors(tmp_path: pathlib.Path, shape: str, message: str) -> None:
    path = tmp_path / "m.urdf"
    owner = link("a", "-").replace("-", shape) if shape else link("a", "-").replace("<geometry>-</geometry>", "")
    path.write_text(f'<robot name="m">{owner}{link("b")}{joint("j", "a", "b")}</robot>')
    robot = PinocchioRobot.from_file(path)  # kinematics need no shapes
    with pytest.raises(RobotError, match=message):
        _ = robot.geometry


def test_an_origin_that_is_no_position(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "m.urdf"
    bent = link("a", SHAPES["box"], "xyz='1 2'")
    path.write_text(f'<robot name="m">{bent}{link("b")}{joint("j", "a", "b")}</robot>')
    with pytest.raises(RobotError, match=r"origin has xyz '1 2'; it must be 3 numbers\."):
        _ = PinocchioRobot.from_file(path).geometry
