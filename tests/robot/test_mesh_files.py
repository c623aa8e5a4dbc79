"""Mesh files: where a URI leads, which are left out, and what is said of it."""

from __future__ import annotations

import pathlib
import warnings

import numpy as np
import pytest

from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot import load_robot
from hqp_rp.robot.mesh_files import resolved

CORNERS = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
SOLID = CORNERS + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
FLAT = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0.1 0.1 0\nf 1 2 3\nf 2 4 3\n"  # no volume


def urdf(*files: str) -> str:
    shapes = "".join(f'<collision><geometry><mesh filename="{file}"/></geometry></collision>' for file in files)
    return f"""
<robot name="one"><link name="base"/><link name="tip">{shapes}
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.fixture
def model(tmp_path: pathlib.Path) -> pathlib.Path:
    folder = tmp_path / "share" / "one_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes").mkdir()
    (folder / "meshes" / "tip.obj").write_text(SOLID)
    return folder / "urdf" / "one.urdf"


@pytest.mark.parametrize(
    "uri",
    [
        "package://one_description/meshes/tip.obj",
        "package:///one_description/meshes/tip.obj",
        "model://one_description/meshes/tip.obj",
        "package://known_under_another_name/meshes/tip.obj",
    ],
)
def test_packages_above_the_file_are_found(model: pathlib.Path, uri: str) -> None:
    assert resolved(uri, model) == model.parents[1] / "meshes" / "tip.obj"
    model.write_text(urdf(uri))
    assert load_robot(model).model.nmesh == 1


def test_packages_elsewhere(model: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    uri, away = "package://one_description/meshes/tip.obj", tmp_path / "away" / "one.urdf"
    share, found = model.parents[2], model.parents[1] / "meshes" / "tip.obj"
    assert resolved(uri, away) is None
    assert resolved(uri, away, [share]) == resolved(uri, away, [model.parents[1]]) == found
    assert resolved(f"file://{found}", away) == found
    with monkeypatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", f"/none:{share}")
        assert resolved(uri, away) == found
    with monkeypatch.context() as patch:
        patch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
        assert resolved(uri, away) == found
    monkeypatch.setenv("HOME", str(tmp_path))
    away.parent.mkdir()
    away.write_text(urdf(uri))
    assert load_robot("~/away/one.urdf", package_paths=["~/share"]).model.nmesh == 1


def test_what_is_not_there_or_not_read_is_left_out(model: pathlib.Path) -> None:
    (model.parents[1] / "meshes" / "tip.dae").write_text("")
    files = ("meshes/tip.obj", "meshes/tip.dae", "meshes/gone.stl", "meshes/gone.obj")
    model.write_text(urdf(*(f"package://one_description/{file}" for file in files)))
    with pytest.warns(UserWarning, match="mesh files") as told:
        robot = load_robot(model, meshes="if found")
    (message,) = (str(warning.message) for warning in told)
    assert "3 of 4 mesh files are left out, 2 not found ('package://one_description/meshes/gone.stl' ...)" in message
    assert "and 1 of a kind that MuJoCo does not read (.dae); give package_paths=[FOLDER]" in message
    assert (robot.model.nmesh, robot.model.ngeom) == (1, 1)
    assert load_robot(model, meshes=False).model.nmesh == 0
    model.write_text(urdf("gone.stl"))
    with pytest.warns(UserWarning, match="1 not found .'gone.stl'.; give them where the file says"):
        load_robot(model, meshes="if found")


def test_a_mesh_that_mujoco_cannot_use_leaves_all_out(model: pathlib.Path) -> None:
    (model.parents[1] / "meshes" / "flat.obj").write_text(FLAT)
    model.write_text(urdf("package://one_description/meshes/tip.obj", "package://one_description/meshes/flat.obj"))
    with pytest.raises(RobotError, match=r"coplanar vertices.*Its mesh files can be left out with meshes=False"):
        load_robot(model)
    with pytest.warns(UserWarning, match=r"cannot use one of the mesh files \(.*\), so that none of the 2 is read"):
        robot = load_robot(model, meshes="if found")
    assert robot.model.nmesh == 0


def test_an_mjcf_with_some_of_its_meshes(model: pathlib.Path) -> None:
    text = """
<mujoco><compiler meshdir="../meshes"/><asset><mesh file="tip.obj"/><mesh name="m" file="gone.stl"/>
<mesh name="own" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset><worldbody><body><joint name="j"/>
<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><geom type="mesh" mesh="tip"/><geom type="mesh" mesh="m"/>
<geom type="mesh" mesh="own"/></body></worldbody></mujoco>"""
    model = model.with_suffix(".xml")
    model.write_text(text)
    for library in ("mujoco", "pinocchio"):
        with pytest.warns(UserWarning, match="1 of 2 mesh files are left out, 1 not found .'gone.stl'."):
            robot = load_robot(model, library, meshes="if found")
        np.testing.assert_allclose(robot.mass_matrix(), [[1.0]])
    model.write_text(text.replace('<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>', ""))
    with (
        pytest.warns(UserWarning, match="left out"),
        pytest.raises(RobotError, match="cannot be loaded without that file"),
    ):
        load_robot(model, meshes="if found")


def test_a_urdf_never_needs_its_meshes_for_pinocchio(model: pathlib.Path) -> None:
    model.write_text(urdf("package://gone/gone.dae"))
    assert load_robot(model, "pinocchio").nv == load_robot(model, "pinocchio", meshes="if found").nv == 1


def test_wrong_folders_and_a_file_without_links(model: pathlib.Path) -> None:
    model.write_text('<robot name="r" xmlns:xacro="x"/>')
    for library in ("mujoco", "pinocchio"):
        with pytest.raises(
            RobotError, match="has no <link>, so it is no robot; of a xacro file, give what `xacro FILE`"
        ):
            load_robot(model, library)
    with pytest.raises(SettingError, match="package_paths holds '/none', which is no folder"):
        load_robot(model, package_paths=["/none"])
    with pytest.raises(SettingError, match="package_paths is '/'; give a list of folders"):
        load_robot(model, package_paths="/")


def test_mujoco_does_not_write_to_the_terminal_what_is_seen_to(
    model: pathlib.Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = urdf().replace('type="continuous"', 'type="revolute"')
    model.write_text(text.replace("</joint>", '<limit lower="1" upper="1" velocity="1" effort="1"/></joint>'))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message="The neutral configuration")
        robot = load_robot(model)
    np.testing.assert_array_equal((robot.lower, robot.upper), [[1.0], [1.0]])
    assert capfd.readouterr().err == ""
