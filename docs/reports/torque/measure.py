"""One step of inverse dynamics on a humanoid and on an arm, beside tsid: writes report.md and figure.png here.

    python3.14 -m venv TSID; TSID/bin/pip install tsid==1.10.0 pin==4.0.0
    python docs/reports/torque/measure.py TSID/bin/python

(The wheels of libtsid, a C++ library, are tagged for Python 3.14; they serve another version when they are unpacked
by hand. With Pinocchio 4.1 they crash.) Both sides take turns in one run, each in its own process, on JVRC-1 without fingers,
along a recorded motion. A step is
everything from q and v to joint torques: kinematics, dynamics, rows, solve.
"""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from page import write
from sides import DT, OURS, TSID, Ours, Remote, arm, pinocchio_state, without_fingers
from standing import stood

import hqp_rp
from hqp_rp.core.errors import HqpError
from hqp_rp.robot import MujocoRobot
from hqp_rp.scenarios.humanoid_reach import _urdf
from hqp_rp.scenarios.humanoid_stand_reach import _PLACE, _SOLE, HumanoidStandReach, _Run

ROUNDS, STEPS = 16, 50
PHASES = {"stand and reach": (0.0, 3.2), "pushed": (3.2, 3.8)}
"""s of the scenario, both soles on the floor."""


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    if hasattr(os, "sched_setaffinity"):  # cores differ in what else runs on them; a child process stays on it as well
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    scenario = HumanoidStandReach(reach=0.5, hand_damping=0.0)
    robot = scenario.robot()
    run = _Run(scenario, robot, 0)
    corners = [[x + _PLACE[0], y, _PLACE[2] - _SOLE[2]] for x in (-_SOLE[0], _SOLE[0]) for y in (-_SOLE[1], _SOLE[1])]
    stance = robot.neutral.copy()
    stance[3:7] = [*robot.neutral[4:7], robot.neutral[3]]  # Pinocchio's quaternion ends in w
    urdf = without_fingers(Path(_urdf()))
    asked: dict[str, Any] = {"urdf": str(urdf), "q": stance.tolist(), "points": corners, "friction": 0.7, "dt": DT}
    asked["joints"] = list(robot.joint_names[1:])
    asked["effort"] = run.limit.tolist()
    try:
        remote = Remote(sys.argv[1], asked)
        standing = stood(sys.argv[1], asked)
    finally:
        urdf.unlink()
    ours = Ours(robot, run.stack, "hierarchical_active_set", run.refer)
    arms = {"Sawyer, three levels, closed form": arm(False), "Sawyer, three levels, limits hard": arm(True)}
    found: dict[tuple[str, str], dict[str, list[float]]] = {}

    def keep(name: str, phase: str, answer: dict[str, Any]) -> None:
        kept = found.setdefault((name, phase), {"times": [], "solves": [], "failed": [], "certified": [], "tried": []})
        kept["times"] += answer["times"]
        kept["solves"] += answer.get("solves", [])
        for name in ("failed", "certified", "tried"):
            kept[name].append(answer.get(name, 0))

    parts = turns(recorded())
    rng = np.random.default_rng(0)
    pairs: dict[str, list[float]] = {phase: [] for phase in parts}
    for turn in range(ROUNDS):
        for phase, taken in parts.items():
            for part in taken:
                own = ours.ask(part)
                keep(OURS, phase, own)
                sent = {name: part[name] for name in ("q", "v", "hand")}
                theirs = remote.ask(sent)
                keep(TSID, phase, theirs)
                pairs[phase].append(float(np.median(theirs["times"]) / np.median(own["times"])))
        for name, side in arms.items():
            times = [0.001 * k for k in range(STEPS)]
            neutral = side.robot.neutral
            path = [neutral + 0.05 * np.sin(t) for t in times]
            speeds = [0.05 * np.cos(t) + 0.001 * rng.normal(size=7) for t in times]
            keep(name, "moving", side.ask({"t": times, "own_q": path, "own_v": speeds}))
        del turn
    write(found, pairs, remote.said, standing, rounds=ROUNDS, steps=STEPS)


def recorded() -> list[dict[str, Any]]:
    """Time, state and hand target along the motion that our own answers lead to."""
    scenario = HumanoidStandReach(reach=0.5, hand_damping=0.0)
    states: list[dict[str, Any]] = []
    robots: list[MujocoRobot] = []
    plain = HumanoidStandReach.robot

    def robot(self: HumanoidStandReach) -> MujocoRobot:
        robots.append(plain(self))
        return robots[-1]

    HumanoidStandReach.robot = robot  # type: ignore[method-assign]
    try:
        for step in scenario.steps(hqp_rp.get_solver("hierarchical_active_set"), 0):
            data = robots[-1].data
            states.append({"t": step.parameter + scenario.period, "q": data.qpos.copy(), "v": data.qvel.copy()})
    finally:
        HumanoidStandReach.robot = plain  # type: ignore[method-assign]
    run = _Run(scenario, scenario.robot(), 0)
    for state in states:
        run.refer(state["t"])
        state["hand"] = run.hand.target.tolist()
    return states


def turns(states: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The states of each phase in turns of `STEPS`, for both sides: Pinocchio's base velocity is in body axes."""
    found: dict[str, list[dict[str, Any]]] = {}
    for phase, (begin, end) in PHASES.items():
        chosen = [state for state in states if begin <= state["t"] < end]
        found[phase] = []
        for first in range(0, len(chosen) - STEPS + 1, STEPS):
            part = chosen[first : first + STEPS]
            q, v = zip(*(pinocchio_state(s["q"], s["v"]) for s in part), strict=True)
            found[phase].append(
                {
                    "t": [s["t"] for s in part],
                    "own_q": [s["q"] for s in part],
                    "own_v": [s["v"] for s in part],
                    "q": [qi.tolist() for qi in q],
                    "v": [vi.tolist() for vi in v],
                    "hand": [s["hand"] for s in part],
                }
            )
    return found


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            main()
        except HqpError as error:
            raise SystemExit(str(error)) from error
