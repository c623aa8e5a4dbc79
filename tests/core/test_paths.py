"""`~` in every path that a user gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hqp_rp import Level, Problem, load_problem, load_robot, problems, save_problem
from hqp_rp.compare.command_line import main
from hqp_rp.compare.run_folder import RunFolder
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.errors import FileError, SettingError
from hqp_rp.core.paths import user_path
from hqp_rp.problems.known_problem import load_known
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import ASSETS, named_robot
from hqp_rp.robot.pinocchio_robot import PinocchioRobot
from tests.bench.bench import bench


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def test_a_home_folder(home: Path) -> None:
    assert user_path("~/a/b") == home / "a" / "b"
    assert user_path(Path("~")) == home
    assert user_path("a/~") == Path("a/~")
    assert user_path("~no_such_user/a") == Path("~no_such_user/a")


def test_problem_files(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = Problem([Level.equality([[1.0, 2.0]], [3.0])])
    assert save_problem(problem, "~/case.npz") == home / "case.npz"
    np.testing.assert_array_equal(load_problem("~/case.npz").matrix, problem.matrix)
    assert main(["replay", "~/case.npz"]) == 0
    assert "SOLVED" in capsys.readouterr().out
    name = problems.names()[0]
    (home / "known.npz").write_bytes(problems.path(name).read_bytes())
    assert load_known("~/known.npz").name == name
    with pytest.raises(FileError, match=str(home)):
        load_problem("~/none.npz")


def test_robots_and_stacks(home: Path) -> None:
    (home / "robot.xml").write_bytes((ASSETS / "humanoid.xml").read_bytes())
    for load in (load_robot, named_robot, MujocoRobot.from_file, PinocchioRobot.from_file):
        assert load("~/robot.xml").nv == 35
    (home / "stack.toml").write_text('[[level]]\n[[level.task]]\ntype = "posture"\n[robot]\nmodel = "~/robot.xml"\n')
    assert load_stack("~/stack.toml").robot_source().model == str(home / "robot.xml")


def test_output_folders(home: Path) -> None:
    assert RunFolder("~/run", {"kind": "a run"}).path == home / "run"
    (home / "bench").write_text("")
    with pytest.raises(FileError, match=f"{home / 'bench'}: is a file"):
        bench("~/bench", quick=True)
    with pytest.raises(SettingError, match=f"{home / 'python'}"):
        bench("~/other", peer_python=["~/python"])
    with pytest.raises(SettingError, match=f"{home / 'lexls'}"):
        bench("~/other", lexls="~/lexls")
