"""The names of the top level: each there, each loaded only when it is used."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hqp_rp
import hqp_rp.control
import hqp_rp.robot

ROOT = Path(__file__).parents[1]


def test_every_name_is_there() -> None:
    assert set(dir(hqp_rp)) == set(hqp_rp.__all__)
    for name in hqp_rp.__all__:
        assert getattr(hqp_rp, name) is not None
    with pytest.raises(AttributeError, match="module 'hqp_rp' has no attribute 'Stock'"):
        hqp_rp.Stock  # noqa: B018


def test_type_checkers_see_what_is_loaded_later() -> None:
    tree = ast.parse((ROOT / "hqp_rp" / "__init__.py").read_text(encoding="utf-8"))
    (checking,) = (node for node in tree.body if isinstance(node, ast.If))
    told = {
        alias.name: node.module for node in checking.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    told.pop("problems")
    assert told == {name: f"hqp_rp.{module}" for name, module in hqp_rp._LAZY.items()}


def test_stack_robot_tasks_and_limits() -> None:
    tasks = {name for name in hqp_rp.control.__all__ if name.endswith("Task") and name != "FeedbackTask"}
    limits = {name for name in hqp_rp.control.__all__ if name.endswith("Limit")}
    for name in {"Stack", "MotionRunner", "LockedJoints", "JointCoupling"} | tasks | limits:
        assert name in hqp_rp.__all__
        assert getattr(hqp_rp, name) is getattr(hqp_rp.control, name)
    assert hqp_rp.load_robot is hqp_rp.robot.load_robot


def test_nothing_of_it_is_loaded_by_the_import() -> None:
    program = (
        "import sys, hqp_rp; print(*sorted(n for n in sys.modules if n.startswith(('hqp_rp.control', 'hqp_rp.robot'))))"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
