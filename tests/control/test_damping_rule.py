"""The damping by level that the pages print: one rule everywhere, and it keeps an arm still at 1 kHz."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hqp_rp import ErrorDamping, get_solver
from hqp_rp.control import JointLimit, OrientationTask, PositionTask, PostureTask, Stack
from hqp_rp.robot import MujocoRobot, panda_like, sawyer

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    "still_at_the_limit.md",
    "choose_a_solver.md",
    "faq.md",
    "tutorials/arm_with_limits.md",
    "tutorials/humanoid.md",
    "tutorials/from_pink.md",
]
FIRST = re.compile(r"ErrorDamping\(reach \* [^`\n]*?, power=1\)")
SECOND = re.compile(r"ErrorDamping\(\S+ / gain, power=1\)")
GAIN, DT = 5.0, 0.001


def printed(page: str) -> tuple[str, str]:
    """The first damping of each level on the page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    first, second = FIRST.search(text), SECOND.search(text)
    assert first is not None, f"{page} prints no damping of the first level"
    assert second is not None, f"{page} prints no damping of the second level"
    return first[0], second[0]


def last_acceleration(robot: Any, target: np.ndarray, damping: list[Any], acceleration: float | None) -> float:
    """rad/s^2, the largest of the last half of 3 s."""
    robot.update(robot.neutral)
    levels = [
        PositionTask("tool", target, gain=GAIN),
        OrientationTask("tool", robot.pose("tool")[0], gain=GAIN),
        PostureTask(robot.neutral, gain=GAIN / 10.0),
    ]
    stack = Stack(levels, [JointLimit(acceleration=acceleration)], damping=damping)
    solver, v, changes = get_solver("hierarchical_active_set"), np.zeros(robot.nv), []
    for _ in range(3000):
        before, v = v, solver.solve(stack.problem(robot, DT, v)).require()
        robot.update(robot.integrate(robot.q, v, DT))
        changes.append(float(np.abs(v - before).max()))
    return max(changes[1500:]) / DT


@pytest.mark.parametrize("page", PAGES)
def test_every_page_prints_the_same_rule(page: str) -> None:
    assert printed(page) == printed(PAGES[0])


@pytest.mark.parametrize("acceleration", [None, 20.0])
@pytest.mark.parametrize(("arm", "reach"), [("sawyer", 1.0), ("panda_like", 0.86)])
def test_the_rule_keeps_an_arm_still_out_of_reach(arm: str, reach: float, acceleration: float | None) -> None:
    robot = MujocoRobot.from_arm({"sawyer": sawyer, "panda_like": panda_like}[arm]())
    target = np.array([1.6, 0.3, 0.5])
    names = {"ErrorDamping": ErrorDamping, "reach": reach, "gain": GAIN, "dt": DT, "max": max}
    by_level = [eval(line, {"__builtins__": {}}, names) for line in printed(PAGES[0])]
    assert last_acceleration(robot, target, [*by_level, None], acceleration) < 1.0


def test_factors_in_proportion_to_the_step_shake() -> None:
    """What the rule is for: ten times the first factor at the second level is too little at 1 kHz."""
    robot, target = MujocoRobot.from_arm(sawyer()), np.array([1.6, 0.3, 0.5])
    damping = [ErrorDamping(DT, power=1), ErrorDamping(10.0 * DT, power=1), None]
    assert last_acceleration(robot, target, damping, 20.0) > 19.0


def test_the_page_says_how_many_runs_came_to_rest() -> None:
    with (DOCS / "reports/still/runs.csv").open(encoding="utf-8", newline="") as file:
        runs = [row for row in csv.DictReader(file) if row["part"] == "matrix"]
    text = (DOCS / "still_at_the_limit.md").read_text(encoding="utf-8")
    for rule in ("0.05 reach/gain, 1/gain", "0.05 reach/gain, 5/gain"):
        still = [float(row["hardest"]) < 1.0 for row in runs if row["rule"] == rule]
        assert f"{sum(still)} of {len(still)}" in text
    former = [float(row["hardest"]) < 1.0 for row in runs if row["rule"] == "reach dt, 10 reach dt"]
    assert f"as this page once had it: {sum(former)}." in text
