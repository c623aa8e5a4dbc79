"""`hqp-rp check`: what it says of a stack and of a saved problem, and the code that it ends with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hqp_rp import Level, Problem, save_problem
from hqp_rp.compare.check import check_problem, problem_of
from hqp_rp.compare.command_line import main
from hqp_rp.compare.commands.check import FOUND
from hqp_rp.compare.exit_codes import MISUSE
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.solver import get_solver
from hqp_rp.robot.robot_source import RobotSource
from tests.compare.small import CORRIDOR

BENT = ["--q", "0.4", "0.9", "-1.4", "1.4"]


def test_a_stack_is_told_level_by_level_with_its_active_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "stack.toml").write_text(CORRIDOR.format(speed=5.0, back=0.5))
    assert main(["check", str(tmp_path / "stack.toml"), *BENT]) == 0
    first, solver, status, x, level, held, active, certificate = capsys.readouterr().out.splitlines()
    assert first.endswith("stack.toml on planar4, at rest at q = [ 0.4,  0.9, -1.4,  1.4], dt = 0.01 s")
    assert solver.startswith("HierarchicalActiveSet(")
    assert status == "SOLVED: Solved to the solver's declared tolerance."
    assert x.startswith("x = [")
    assert level.startswith("tool position: residual ")
    assert "rank 1 of 2 rows (2 by itself). LIMITED: " in level
    assert held == "tool position is held back by corridor: tool at its lower bound (100%)."
    assert active == "active rows: corridor: tool at its lower bound"
    assert certificate == "certificate: Optimal at every level to a relative 1.0e-09."


def test_an_infeasible_stack_names_the_conflict_and_its_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "stack.toml").write_text(CORRIDOR.format(speed=1.0, back=20.0))
    assert main(["check", str(tmp_path / "stack.toml"), *BENT]) == FOUND
    printed = capsys.readouterr().out
    assert "\nINFEASIBLE: The hard rows contradict each other: no x meets them all." in printed
    (conflict,) = (line for line in printed.splitlines() if line.startswith("conflict: "))
    assert conflict.startswith("conflict: corridor: tool asks for at least 20 m/s; within 'joint limits' at most ")
    assert "joint limits: joint1 >= -1 rad/s" in conflict
    assert "Moving 'corridor' to a level makes the rest feasible" in conflict
    assert "certificate" not in printed


def test_a_saved_problem_keeps_the_names_of_its_hard_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "stack.toml").write_text(CORRIDOR.format(speed=1.0, back=20.0))
    problem, _ = problem_of(load_stack(tmp_path / "stack.toml"), RobotSource("planar4"), (0.4, 0.9, -1.4, 1.4), None)
    before = check_problem(problem, get_solver("hierarchical_active_set"))
    path = save_problem(problem, tmp_path / "bad.npz", model="planar4")
    assert main(["check", str(path)]) == FOUND
    assert capsys.readouterr().out == "\n".join((f"{path}: model planar4", *before.sentences)) + "\n"


def test_an_answer_that_is_solved_and_not_certified_is_no_success(tmp_path: Path) -> None:
    levels = [Level.equality(np.eye(2), [1.0, 2.0]), Level.equality([[1.0, 1.0]], [9.0])]
    path = save_problem(Problem(levels), tmp_path / "conflicting.npz")
    assert main(["check", str(path)]) == 0
    assert main(["check", str(path), "--solver", "weighted"]) == FOUND  # weighs the two levels against each other


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sawyer"], "sawyer says no robot: give an MJCF or URDF file or the name of a robot"),
        (["sawyer", "--robot", "sawyer", "--q", "0", "0"], "q has shape (2,); it must be (7,)."),
        (["sawyer", "--robot", "sawyer", "--dt", "-1"], "dt is -1.0; it must be a finite number > 0."),
        (["no_such.toml"], "no_such.toml: there is no such stack file."),
        (["no_such.npz"], "no_such.npz: there is no such file."),
        (["problem.npz", "--dt", "0.1"], "--dt is for a stack file; problem.npz is a saved problem"),
        (["problem.npz", "--robot", "sawyer"], "--robot is for a stack file"),
        (["problem.npz", "--keyframe", "home"], "--keyframe is for a stack file"),
        (["problem.npz", "--floating-base"], "--floating-base is for a stack file"),
        (["sawyer", "--robot", "sawyer", "--solver", "nul_space"], "Did you mean 'null_space'?"),
    ],
)
def test_wrong_input_is_one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", *arguments]) == MISUSE
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
