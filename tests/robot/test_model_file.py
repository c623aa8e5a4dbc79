"""Loading robot files through either library: formats, options, and an error that names file and remedy."""

import subprocess
import sys

import numpy as np
import pytest

from hqp_rp import HqpError, RobotError, UnknownNameError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, load_robot
from hqp_rp.robot.model_file import file_format
from tests.robot.models import MIXED_MJCF, URDF

libraries = pytest.mark.parametrize("library", ["mujoco", "pinocchio"])


def test_the_library_is_chosen_by_name(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    assert isinstance(load_robot(path), MujocoRobot)
    assert isinstance(load_robot(str(path), "pinocchio"), PinocchioRobot)
    with pytest.raises(UnknownNameError, match=r"no robot library named 'pinochio'. Did you mean 'pinocchio'"):
        load_robot(path, "pinochio")


@libraries
def test_arguments_reach_the_robot(tmp_path, library):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    robot = load_robot(path, library, velocity_limit={"elbow": 2.0})
    np.testing.assert_array_equal(robot.velocity_limit, [np.inf, 2.0])
    neutral = np.full(robot.nq, 0.6)
    np.testing.assert_array_equal(load_robot(path, library, neutral=neutral).neutral, neutral)
    assert load_robot(path, library, floating_base=True).nv == 8


@pytest.mark.parametrize("prefix", ["", "\ufeff", "<?xml version='1.0'?>\n<!-- <robot> -->\n", "<!-- a --><!-- b -->"])
def test_the_format_is_that_of_the_root_element(tmp_path, prefix):
    path = tmp_path / "model"
    path.write_text(prefix + "<mujoco/>", encoding="utf-8")
    assert file_format(path) == "mjcf"
    path.write_text(prefix + '<robot name="r"/>', encoding="utf-8")
    assert file_format(path) == "urdf"


@libraries
@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "The robot file '.*model.xml' cannot be read: No such file or directory."),
        (
            "",
            "'.*model.xml' is no robot model: it does not begin with an XML element; an MJCF file begins with <mujoco>",
        ),
        ("<sdf/>", "'.*model.xml' is no robot model: its root element is <sdf>"),
        ('<robot name="r"><link name="a"/>', "The URDF file '.*model.xml' is not well-formed XML: .*line 1, column 32"),
        (
            "<mujoco><worldbody><bod/></worldbody></mujoco>",
            "MuJoCo does not read '.*model.xml': .*unrecognized element",
        ),
        ("<mujoco>", "MuJoCo does not read '.*model.xml': "),
        (
            '<mujoco><worldbody><body name="b"><joint/></body></worldbody></mujoco>',
            "MuJoCo does not compile '.*model.xml': .*mass and inertia of moving bodies",
        ),
        (URDF.replace('"base"/><child', '"bas"/><child'), "(MuJoCo|Pinocchio) does not read '.*model.xml': "),
        ("<mujoco/>", "nothing can move: it has no joint"),
    ],
)
def test_a_file_that_is_no_robot_gets_one_clear_error(tmp_path, library, text, message):
    path = tmp_path / "model.xml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(RobotError, match=message) as caught:
        load_robot(path, library)
    assert isinstance(caught.value, HqpError)


def test_a_file_name_that_mujoco_does_not_take(tmp_path):
    path = tmp_path / "model.txt"
    path.write_text(URDF)
    with pytest.raises(
        RobotError, match=r"MuJoCo reads only files whose name ends in .xml or .urdf: rename '.*model.txt'"
    ):
        load_robot(path)
    assert load_robot(path, "pinocchio").nv == 2


@libraries
def test_a_folder_is_no_file(tmp_path, library):
    with pytest.raises(RobotError, match="cannot be read: Is a directory"):
        load_robot(tmp_path, library)


def test_a_velocity_limit_that_is_no_number(tmp_path):
    path = tmp_path / "model.urdf"
    path.write_text(URDF.replace('velocity="3"', 'velocity="${v}"'))
    with pytest.raises(RobotError, match=r"joint 'shoulder' has the velocity limit '\${v}'; it must be a number"):
        load_robot(path)


@libraries
def test_what_cannot_float(tmp_path, library):
    path = tmp_path / "model.xml"
    path.write_text(MIXED_MJCF)
    with pytest.raises(RobotError, match=r"floating_base is for URDF files; .* says with <freejoint/> what floats"):
        load_robot(path, library, floating_base=True)
    path.write_text(URDF.replace('"base"', '"world"'))
    assert load_robot(path, library).nv == 2
    with pytest.raises(RobotError, match="is 'world', to which the robot is fixed: it cannot have a floating base"):
        load_robot(path, library, floating_base=True)


@libraries
def test_a_urdf_limit_that_states_no_bounds_is_none(tmp_path, library):
    path = tmp_path / "model.urdf"
    path.write_text(URDF.replace('lower="-1" upper="2" ', ""))
    robot = load_robot(path, library)
    assert (robot.lower[0], robot.upper[0], robot.velocity_limit[0]) == (-np.inf, np.inf, 3.0)


MESH = """
<mujoco><asset><mesh name="m" file="absent.stl"/></asset><worldbody><body name="b">
<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><joint name="j"/><geom type="mesh" mesh="m"/><geom size=".1"/>
</body></worldbody></mujoco>
"""


@libraries
def test_meshes_can_be_left_out(tmp_path, library):
    path = tmp_path / "model.xml"
    path.write_text(MESH)
    with pytest.raises(RobotError, match=r"absent.stl.* Its mesh files can be left out with meshes=False."):
        load_robot(path, library)
    np.testing.assert_allclose(load_robot(path, library, meshes=False).mass_matrix(), [[1.0]])
    path.write_text(MESH.replace('<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>', ""))
    with pytest.raises(RobotError, match=r"The body 'b' of .* takes its inertia from the mesh 'm'"):
        load_robot(path, library, meshes=False)


@libraries
def test_meshes_of_a_urdf_can_be_left_out(tmp_path, library):
    path = tmp_path / "model.urdf"
    mesh = '<visual><geometry><mesh filename="package://nowhere/absent.dae"/></geometry></visual>'
    path.write_text(
        URDF.replace('<link name="tool"/>', f'<link name="tool">{mesh}{mesh.replace("visual", "collision")}</link>')
    )
    with pytest.raises(
        RobotError, match=r"'package://nowhere/absent.dae' of .* the package 'nowhere', .* meshes=False"
    ):
        load_robot(path)
    robot, other = load_robot(path, meshes=False), load_robot(path, "pinocchio")
    with pytest.raises(RobotError, match=r"absent.dae.* Its mesh files can be left out with meshes=False"):
        other.distances_between([("tool", "base")])
    with pytest.raises(RobotError, match="'tool'"):  # has no shape left
        load_robot(path, "pinocchio", meshes=False).distances_between([("tool", "base")])
    with pytest.warns(UserWarning, match="1 of 1 mesh files are left out, 1 not found"), pytest.raises(RobotError):
        load_robot(path, "pinocchio", meshes="if found").distances_between([("tool", "base")])
    np.testing.assert_allclose(robot.pose("tool")[1], other.pose("tool")[1], atol=1e-12)


def test_a_urdf_link_without_inertial_has_no_mass_in_either_library(tmp_path):
    path = tmp_path / "model.urdf"
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    path.write_text(URDF.replace('<link name="tool"/>', f'<link name="tool">{box}</link>'))
    robot, other = load_robot(path), load_robot(path, "pinocchio")
    np.testing.assert_allclose(robot.mass_matrix(), other.mass_matrix(), atol=1e-12)
    assert robot.model.ngeom == 1


def test_robot_libraries_are_imported_only_when_used():
    code = (
        "import sys, hqp_rp.robot; from hqp_rp.robot import DHArm, sawyer, planar_arm, load_robot, Robot; sawyer();"
        "assert not {'mujoco', 'pinocchio'} & set(sys.modules); "
        "from hqp_rp.robot import MujocoRobot; assert 'pinocchio' not in sys.modules; "
        "assert set(hqp_rp.robot.__all__) == set(dir(hqp_rp.robot))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_an_unknown_name_of_the_package():
    import hqp_rp.robot

    with pytest.raises(AttributeError, match="no attribute 'Sawyer'"):
        hqp_rp.robot.Sawyer  # noqa: B018
