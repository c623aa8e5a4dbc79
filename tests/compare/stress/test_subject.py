"""Any robot under stress: objects built in Python, robot files with their options, and what is said where it cannot be."""

from __future__ import annotations

import functools
import os
import pathlib
import pickle
import subprocess
import sys
import threading
import warnings
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp import OrientationTask, PositionTask, PostureTask, Stack, VelocityLimit, load_robot
from hqp_rp.compare.command_line import main
from hqp_rp.compare.stress.plan import scene_of
from hqp_rp.compare.stress.stress import stress
from hqp_rp.compare.stress.subject import FileSubject, ObjectSubject, subject_of
from hqp_rp.control.stack_file import load_stack, parse_stack
from hqp_rp.core.errors import FileError, HqpError, RobotError, SettingError
from hqp_rp.robot import RobotSource, planar_arm
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import named_robot

ROOT = pathlib.Path(__file__).parents[3]
SMALL: dict[str, Any] = {"samples": 60, "solvers": ["null_space", "reverse_priority"], "starts": 3, "workers": 1}

URDF = """
<robot name="elbow"><link name="base">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="package://elbow_description/meshes/upper.stl"/></geometry></collision></link>
<link name="lower"><inertial><mass value="1"/><inertia ixx="{ixx}" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="end" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.3 0 0"/></joint></robot>
"""

TOML = """
[[level]]
name = "reach"
[[level.task]]
type = "position"
frame = "tool"
axes = "x"
[[level]]
name = "turn"
[[level.task]]
type = "orientation"
frame = "tool"
axes = ["rz"]
"""

MJCF = """
<mujoco model="keyed"><worldbody><body name="a"><joint name="j" range="-170 170"/><geom size=".1" mass="1"/>
<body name="tool" pos=".5 0 0"><joint name="k" range="-170 170"/><geom size=".1" mass="1"/></body></body></worldbody>
<keyframe><key name="home" qpos="0.3 0.5"/></keyframe></mujoco>
"""


def planar() -> tuple[MujocoRobot, Stack]:
    robot = MujocoRobot.from_arm(planar_arm(3))
    robot.update([0.1, 0.5, 0.3])
    turn = OrientationTask("link2", [1.0, 0.0, 0.0, 0.0], axes=["rz"], name="turn")
    return robot, Stack([PositionTask("tool", [0.8, 0.2, 0.0], axes="xy", name="tool"), turn])


@pytest.fixture
def elbow(tmp_path: pathlib.Path) -> pathlib.Path:
    (tmp_path / "elbow.urdf").write_text(URDF.format(ixx=1))
    (tmp_path / "stack.toml").write_text(TOML)
    return tmp_path


def command(folder: pathlib.Path, *more: str, model: str = "elbow.urdf") -> int:
    small = ["--samples", "60", "--solver", "null_space", "--starts", "3", "--workers", "1"]
    output = ["--output", str(folder / "out"), "--overwrite"]
    return main(["stress", str(folder / model), "--stack", str(folder / "stack.toml"), *small, *output, *more])


def test_objects_give_the_rows_of_a_file(tmp_path: pathlib.Path) -> None:
    robot = named_robot("planar4")
    stack = load_stack("planar4").stack(robot)
    there = robot.q
    found = stress(robot, stack, output=tmp_path / "objects", **SMALL)
    filed = stress("planar4", "planar4", output=tmp_path / "files", **SMALL)
    assert found.rows().collect().drop("time").equals(filed.rows().collect().drop("time"))
    np.testing.assert_array_equal(robot.q, there)
    assert "Stack(" in (tmp_path / "objects" / "report.md").read_text()
    assert hqp_rp.stress is stress


def test_objects_over_workers_and_again(tmp_path: pathlib.Path) -> None:
    robot, stack = planar()
    options = {**SMALL, "samples": 300}
    alone = stress(robot, stack, output=tmp_path / "one", **options).rows().collect().drop("time")
    shared = stress(robot, stack, output=tmp_path / "two", **{**options, "workers": 2})
    assert shared.rows().collect().drop("time").equals(alone)
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "two" / "parts").iterdir()}
    again, anew = planar()  # built again, and somewhere else: the same run
    again.update([0.0, 0.1, 0.2])
    stress(again, anew, output=tmp_path / "two", **options)
    assert {path: path.stat().st_mtime_ns for path in parts} == parts
    robot, _ = planar()
    other = Stack([PositionTask("tool", [0.8, 0.2, 0.0], axes="xy", name="tool", gain=2.0), stack.levels[1]])
    with pytest.raises(FileError, match=r"it differs in robot and stack\)"):
        stress(robot, other, output=tmp_path / "two", **options)


def test_classes_of_a_script_reach_the_workers(tmp_path: pathlib.Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text(
        "import numpy as np, hqp_rp\n"
        "from hqp_rp.robot.named import named_robot\n"
        "class Mine:\n"
        "    name, frames = 'mine', ()\n"
        "    scale = staticmethod(lambda: 2.0)\n"
        "    def evaluate(self, robot):\n"
        "        return self.scale() * np.eye(robot.nv)[:1], np.ones(1)\n"
        "if __name__ == '__main__':\n"
        "    stack = hqp_rp.Stack([hqp_rp.PositionTask('tool', [0.8, 0.2, 0.0], axes='xy'), Mine()])\n"
        "    found = hqp_rp.stress(named_robot('planar3'), stack, samples=300, solvers=['null_space'], starts=2, workers=2)\n"
        "    print(found.summary.status.sum() / len(found.summary.labels))\n"
    )
    done = subprocess.run(
        [sys.executable, script],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["300.0"]


def test_which_subject_it_is() -> None:
    robot, stack = planar()
    file = parse_stack(TOML, "stack.toml")
    assert isinstance(subject_of("planar3", file), FileSubject)
    for given in ((robot, stack), (robot, file), ("planar3", stack), (RobotSource("planar3"), stack)):
        subject = subject_of(*given)
        assert isinstance(subject, ObjectSubject)
        assert scene_of(pickle.loads(pickle.dumps(subject))) is scene_of(subject)
    assert subject_of(robot, stack).model == "planar3"
    assert subject_of(robot, stack) == subject_of(*planar())
    assert subject_of(robot, stack) != subject_of(robot, stack, 0.1)


class Locked(PositionTask):
    """A task that holds what no pickle can."""

    def __init__(self) -> None:
        super().__init__("tool", [0.8, 0.2, 0.0])
        self.lock = threading.Lock()


@pytest.mark.parametrize(
    ("robot", "stack", "error", "words"),
    [
        (None, Stack([PostureTask(np.zeros(3))]), SettingError, "robot is None, and a Stack does not say on which robot"),
        (None, "planar4", SettingError, r"planar4 says no robot: give an MJCF or URDF file .* under \[robot\]"),
        (3, "planar4", RobotError, "robot is a int; give a robot with the methods of hqp_rp.robot.Robot"),
        ("planar3", 3, SettingError, "stack is a int; give a Stack, a StackFile, or the path or name of a stack file"),
        ("planar3", Stack([PostureTask(np.zeros(4))]), HqpError, "posture"),
        ("planar3", Stack([PositionTask("hand", np.zeros(3))]), RobotError, "hand"),
        ("planar3", Stack([VelocityLimit(1.0)]), SettingError, "holds limits or mink tasks, which need the time step: give dt"),
        ("planar3", Stack([Locked()]), SettingError, r"Stack\(.*\) on this robot cannot be handed to worker processes"),
    ],
)  # fmt: skip
def test_what_cannot_be_stressed_is_one_error(robot: Any, stack: Any, error: type[HqpError], words: str) -> None:
    with pytest.raises(error, match=words) as caught:
        stress(robot, stack, **SMALL)
    assert "\n" not in str(caught.value)


def test_limits_alone_have_no_singularities() -> None:
    with pytest.raises(SettingError, match=r"holds no task; singularities are those of tasks"):
        stress("planar3", Stack([VelocityLimit(1.0)]), dt=0.01, **SMALL)


def test_tasks_of_mink() -> None:
    mink = pytest.importorskip("mink")
    robot, _ = planar()
    task = mink.PostureTask(robot.model, 1.0)
    task.set_target(robot.q)
    reach = mink.FrameTask("tool", "site", 1.0, 0.0)
    reach.set_target(mink.SE3.from_translation(np.array([0.8, 0.2, 0.0])))
    with pytest.raises(SettingError, match="mink tasks, which need the time step"):
        stress(robot, Stack([reach, task]), **SMALL)
    found = stress(robot, Stack([reach, task]), dt=0.01, **SMALL)
    assert found.summary.status.sum() == 60 * len(found.summary.labels)


def test_a_warning_of_the_model_is_given_once(tmp_path: pathlib.Path) -> None:
    (tmp_path / "coupled.xml").write_text(
        MJCF.replace("<keyframe>", '<equality><joint joint1="k" joint2="j"/></equality><keyframe>')
    )
    robot = load_robot(tmp_path / "coupled.xml")
    with pytest.warns(UserWarning, match="follow others") as told:
        stress(robot, Stack([PositionTask("tool", [0.4, 0.2, 0.0], axes="x")]), **SMALL)
    assert len(told) == 1


def test_one_level_is_enough() -> None:
    robot, stack = planar()
    found = stress(robot, Stack(stack.levels[:1]), **SMALL)
    assert found.summary.status.sum() == 60 * len(found.summary.labels)


def test_missing_meshes_are_one_line(elbow: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert command(elbow) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("hqp-rp:")]
    assert "1 of 1 mesh files are left out, 1 not found ('package://elbow_description/meshes/upper.stl')" in line
    assert "give --package-path FOLDER, the folder that holds 'elbow_description'; --no-meshes leaves all out" in line
    assert command(elbow, "--no-meshes") == 0
    assert command(elbow, "--library", "pinocchio") == 0
    assert "hqp-rp:" not in capsys.readouterr().err


def test_a_package_path_finds_them(elbow: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    meshes = elbow / "packages" / "elbow_description" / "meshes"
    meshes.mkdir(parents=True)
    (meshes / "upper.stl").write_bytes(tetrahedron())
    assert command(elbow, "--package-path", str(elbow / "packages")) == 0
    assert "hqp-rp:" not in capsys.readouterr().err
    assert command(elbow, "--package-path", str(elbow / "none")) == 2
    assert "which is no folder" in capsys.readouterr().err


def test_options_of_robot_files(elbow: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(elbow, "--floating-base", "--no-meshes") == 0
    (elbow / "elbow.urdf").write_text(URDF.format(ixx=0))
    assert command(elbow, "--no-meshes") == 2
    assert "--repair-inertias makes the least change that MuJoCo accepts." in capsys.readouterr().err
    assert command(elbow, "--no-meshes", "--repair-inertias") == 0
    (elbow / "keyed.xml").write_text(MJCF)
    assert command(elbow, "--keyframe", "home", model="keyed.xml") == 0
    assert command(elbow, "--keyframe", "hom", model="keyed.xml") == 2
    assert "has no keyframe 'hom'; it has home" in capsys.readouterr().err
    assert main(["stress", "planar4", "--stack", "planar4", "--floating-base"]) == 2
    assert "floating_base is for robot files; 'planar4' is one of the library's own" in capsys.readouterr().err


def test_the_robot_of_a_stack_file(elbow: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        '[robot]\nmodel = "elbow.urdf"\nmeshes = false\nneutral = [0.1, 0.2]\nvelocity_limit = { elbow = 0.5 }\n' + TOML
    )
    (elbow / "whole.toml").write_text(text)
    source = load_stack(elbow / "whole.toml").robot_source()
    assert (source.model, source.neutral) == (str(elbow / "elbow.urdf"), (0.1, 0.2))
    robot = source.robot()
    np.testing.assert_array_equal(robot.neutral, [0.1, 0.2])
    np.testing.assert_array_equal(robot.velocity_limit, [np.inf, 0.5])
    assert load_stack(elbow / "whole.toml").robot_source(neutral=None, library="pinocchio").library == "pinocchio"
    monkeypatch.setenv("HOME", str(elbow))
    assert main(["stress", "--stack", "~/whole.toml", "--samples", "5", "--solver", "null_space", "--starts", "1",
                 "--workers", "1", "--output=~/home"]) == 0  # fmt: skip
    assert (elbow / "home" / "report.md").exists()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("robot = 3", "stack: robot is 3; write a table"),
        ("[robot]\nfile = 'a'", "robot: There is no setting of .*robot.* named 'file'"),
        ("[robot]\nfloating_base = 1", "robot: floating_base is 1; it must be true or false"),
        ("[robot]\npackage_paths = 'a'", "robot: package_paths is 'a'; give a list of folders"),
        (
            "[robot]\nmodel = 'sawyer'\nmeshes = false",
            "robot: meshes is for robot files; 'sawyer' is one of the library's",
        ),
    ],
)
def test_a_wrong_robot_of_a_stack_file(table: str, words: str) -> None:
    with pytest.raises(HqpError, match=words):
        parse_stack(f"{table}\n{TOML}", "stack")


def test_if_found_in_python(elbow: pathlib.Path) -> None:
    with pytest.raises(RobotError, match=r"upper.stl' of .* is not found: give package_paths=\[FOLDER\]"):
        load_robot(elbow / "elbow.urdf")
    with pytest.warns(UserWarning, match="1 of 1 mesh files are left out, 1 not found"):
        robot = load_robot(elbow / "elbow.urdf", meshes="if found")
    assert robot.nv == 2
    with pytest.raises(SettingError, match="meshes is 'maybe'; it must be True, False or \"if found\""):
        load_robot(elbow / "elbow.urdf", meshes="maybe")  # type: ignore[arg-type]


@functools.cache
def tetrahedron() -> bytes:
    """A binary STL."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], dtype="<f4")
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    record = b"".join(np.zeros(3, "<f4").tobytes() + corners[list(face)].tobytes() + b"\0\0" for face in faces)
    return bytes(80) + len(faces).to_bytes(4, "little") + record
