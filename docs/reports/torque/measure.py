"""One step of inverse dynamics on a humanoid and on an arm, beside tsid: writes report.md and figure.png here.

    python3.14 -m venv TSID; TSID/bin/pip install tsid==1.10.0 pin==4.0.0
    python docs/reports/torque/measure.py TSID/bin/python

(The wheels of libtsid, a C++ library, are tagged for Python 3.14; they serve another version when they are unpacked
by hand. With Pinocchio 4.1 they crash.) Both sides take turns in one run, each in its own process, on JVRC-1 without fingers,
along a recorded motion. A step is
everything from q and v to joint torques: kinematics, dynamics, rows, solve.
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np

import hqp_rp
from hqp_rp import JointLimit, OrientationTask, PositionTask, PostureTask, TorqueController, TorqueStack, certify
from hqp_rp.compare.machine import machine
from hqp_rp.control import Mode, TorqueCommand
from hqp_rp.core.errors import HqpError
from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.scenarios.humanoid_reach import _FINGERS, _urdf
from hqp_rp.scenarios.humanoid_stand_reach import _PLACE, _SOLE, HumanoidStandReach, _Run

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
OURS, TSID = "hqp_rp, six levels, all limits hard", "tsid 1.10, two levels"
DT = 0.001
ROUNDS, STEPS = 16, 50
PHASES = {"stand and reach": (0.0, 3.2), "pushed": (3.2, 3.8)}
"""s of the scenario, both soles on the floor."""


class Remote:
    """tsid in its own interpreter, a turn at a time."""

    def __init__(self, python: str, asked: dict[str, Any]) -> None:
        worker = str(HERE / "tsid_worker.py")
        self._process = subprocess.Popen(
            [python, worker], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.said = self.ask(asked)
        if "error" in self.said:
            raise SystemExit(f"tsid: {self.said['error']}")

    def ask(self, message: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(message) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


class Ours:
    """A torque controller on a robot, a turn at a time; `refer` writes the references of a time into its tasks."""

    def __init__(self, robot: MujocoRobot, stack: TorqueStack, solver: str, refer: Callable[[float], None]) -> None:
        self.robot, self.refer = robot, refer
        self.controller = TorqueController(stack, solver)

    def ask(self, turn: dict[str, Any]) -> dict[str, Any]:
        robot, times, solves, failed, certified = self.robot, [], [], 0, 0
        for k, (t, q, v) in enumerate(zip(turn["t"], turn["own_q"], turn["own_v"], strict=True)):
            self.refer(t)
            begin = time.perf_counter()
            robot.update(q)
            command = self.controller.step(robot, DT, v)
            times.append(time.perf_counter() - begin)
            solves.append(command.solve_time)
            failed += command.mode.name != "RUNNING"
            if k % 20 == 0 and command.solution is not None and command.solution.x is not None:
                certified += certify(command.problem, command.solution.x).ok
        return {"times": times, "solves": solves, "failed": failed, "certified": certified, "tried": len(times[::20])}


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


def pinocchio_state(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's state with the quaternion's w last and the base's linear velocity in its own axes; joints in MuJoCo's order."""
    import pinocchio as pin

    turned = np.array([*q[:3], *q[4:7], q[3], *q[7:]])
    return turned, np.array([*(pin.Quaternion(turned[3:7]).matrix().T @ v[:3]), *v[3:]])


class Standing:
    """The scenario with torques from elsewhere: who keeps feet and balance?"""

    def __init__(self, scenario: HumanoidStandReach) -> None:
        self.scenario = scenario

    def run(
        self, torques: Callable[[float, np.ndarray, np.ndarray, _Run], tuple[np.ndarray | None, float]]
    ) -> list[str]:
        """Cells of a row: stood, largest errors, steps without an answer, time of a step."""
        import mujoco

        scenario = self.scenario
        run = _Run(scenario, scenario.robot(), 0)
        robot, model, data = run.robot, run.robot.model, run.robot.data
        pelvis = model.body("PELVIS_S").id
        worst: dict[str, float] = {}
        times: list[float] = []
        missing, hand = 0, math.nan
        for k in range(scenario.periods()):
            t = k * scenario.period
            robot.update(data.qpos)
            run.refer(t)
            torque, seconds = torques(t, data.qpos.copy(), data.qvel.copy(), run)
            times.append(seconds)
            missing += torque is None
            torque = np.zeros(model.nv - 6) if torque is None else torque
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[6:] = np.clip(torque, -run.limit, run.limit)
            data.xfrc_applied[pelvis, :3] = run.push(t)
            mujoco.mj_step(model, data, scenario.substeps)
            robot.update(data.qpos)
            run.refer(t + scenario.period)
            measured = run.measured(TorqueCommand(torque, Mode.RUNNING), data)
            if measured["height [m]"] < 0.6:
                return [f"fell at {t:.2f} s", *[""] * 4, f"{missing} of {k + 1}", f"{1e6 * np.median(times):.0f}"]
            for name, value in measured.items():
                worst[name] = max(worst.get(name, 0.0), value)
            hand = measured["hand error [m]"]
        return [
            "yes",
            f"{1e3 * hand:.1f}",
            f"{1e3 * worst['balance error [m]']:.0f}",
            f"{1e3 * worst['slip [m]']:.1f}",
            f"{worst['tilt [rad]']:.3f}",
            f"{missing} of {scenario.periods()}",
            f"{1e6 * np.median(times):.0f}",
        ]

    def ours(self) -> Callable[[float, np.ndarray, np.ndarray, _Run], tuple[np.ndarray | None, float]]:
        controllers: dict[int, TorqueController] = {}

        def torques(t: float, q: np.ndarray, v: np.ndarray, run: _Run) -> tuple[np.ndarray | None, float]:
            controller = controllers.setdefault(id(run), TorqueController(run.stack, "hierarchical_active_set"))
            begin = time.perf_counter()
            run.robot.update(q)
            command = controller.step(run.robot, self.scenario.period, v)
            seconds = time.perf_counter() - begin
            return (command.torque if command.mode is Mode.RUNNING else None), seconds

        return torques

    def theirs(
        self, remote: Remote
    ) -> Callable[[float, np.ndarray, np.ndarray, _Run], tuple[np.ndarray | None, float]]:
        def torques(t: float, q: np.ndarray, v: np.ndarray, run: _Run) -> tuple[np.ndarray | None, float]:
            own_q, own_v = pinocchio_state(q, v)
            answer = remote.ask(
                {
                    "loop": t,
                    "q": own_q.tolist(),
                    "v": own_v.tolist(),
                    "hand": run.hand.target.tolist(),
                    "balance": run.balance.target.tolist(),
                    "height": float(run.foot.target[1][2] - run._foot[1][2]),
                    "closed": run.contacts[0].activation == 1.0,
                }
            )
            return (None if answer["torque"] is None else np.array(answer["torque"])), answer["time"]

        return torques


def without_fingers(path: Path) -> Path:
    """The URDF with its finger joints fixed, beside the original, so that meshes are found."""
    tree = ElementTree.parse(path)
    for joint in tree.getroot().iterfind("joint"):
        if joint.get("name", "").endswith(_FINGERS):
            joint.set("type", "fixed")
            for part in [*joint.findall("mimic"), *joint.findall("limit"), *joint.findall("axis")]:
                joint.remove(part)
    for link in tree.getroot().iterfind("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    made = HERE / "jvrc_without_fingers.urdf"
    tree.write(made)
    return made


def arm(limits: bool) -> Ours:
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    R, p = robot.pose("tool")
    hand = PositionTask("tool", p)
    levels = [hand, OrientationTask("tool", R), PostureTask(robot.neutral)]

    def refer(t: float) -> None:
        hand.target = p + np.array([0.05 * np.sin(t), 0.0, 0.0])

    if limits:
        stack = TorqueStack(levels, [JointLimit(acceleration=100.0)], torque=80.0)
        return Ours(robot, stack, "hierarchical_active_set", refer)
    return Ours(robot, TorqueStack(levels), "null_space", refer)


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
    write(found, pairs, remote.said, standing)


def stood(python: str, asked: dict[str, Any]) -> list[str]:
    """Rows of the table of closed loops: both sides, a hand target within reach and one out of it."""
    rows = []
    for reach in (0.5, 0.9):
        for damping, words in ((0.0, "no damping"), (0.01, "hand damped, as the scenario has it")):
            standing = Standing(HumanoidStandReach(reach=reach, hand_damping=damping))
            rows.append([f"{reach:g} m", f"hqp_rp, {words}", *standing.run(standing.ours())])
        for weight in (1.0, 0.1, 0.03, 0.01, 0.001):
            standing = Standing(HumanoidStandReach(reach=reach))
            dt = standing.scenario.period
            remote = Remote(python, asked | {"dt": dt, "hand_weight": weight})
            rows.append([f"{reach:g} m", f"tsid, hand weight {weight:g}", *standing.run(standing.theirs(remote))])
    return [f"| {' | '.join(row)} |" for row in rows]


def write(
    found: dict[tuple[str, str], dict[str, list[float]]],
    pairs: dict[str, list[float]],
    tsid: dict[str, Any],
    standing: list[str],
) -> None:
    lines = [
        "| method | phase | whole step: least, us | median, us | 99 % below, us | solve: median, us | no answer | certified |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (name, phase), kept in found.items():
        times = 1e6 * np.array(kept["times"])
        solve = f"{1e6 * np.median(kept['solves']):.1f}" if kept["solves"] else ""
        proof = f"{int(sum(kept['certified']))} of {int(sum(kept['tried']))}" if kept["solves"] else ""
        lines.append(
            f"| {name} | {phase} | {times.min():.1f} | {np.median(times):.1f} | {np.quantile(times, 0.99):.0f} | {solve} | "
            f"{int(sum(kept['failed']))} of {len(times)} | {proof} |"
        )
    ratios = {phase: float(np.median(pairs[phase])) for phase in PHASES}
    spread = {phase: np.quantile(pairs[phase], [0.1, 0.9]) for phase in PHASES}
    figure, axes = plt.subplots(1, len(PHASES), figsize=(9.0, 3.4), layout="constrained")
    for ax, phase in zip(axes, PHASES, strict=True):
        for name in (OURS, TSID):
            ax.hist(1e6 * np.array(found[name, phase]["times"]), bins=np.geomspace(60, 3000, 70), alpha=0.7, label=name)
        ax.set_xscale("log")
        ax.set_title(f"{phase}: tsid takes {ratios[phase]:.2f} times as long", fontsize=10)
        ax.set_xlabel("whole step (us)")
    axes[0].set_ylabel("steps")
    axes[0].legend(fontsize=8, frameon=False)
    figure.savefig(HERE / "figure.png", dpi=130)
    told = ", ".join(
        f"{phase} {ratio:.2f} ({spread[phase][0]:.2f} to {spread[phase][1]:.2f})" for phase, ratio in ratios.items()
    )
    about = machine()
    text = f"""# Inverse dynamics: one step, beside tsid

How long does a step from q and v to joint torques take on a humanoid with contacts and limits, and on an arm? Remade by
`python docs/reports/torque/measure.py TSID/bin/python`, whose first lines say how to get tsid.

![Distribution of the time of a whole step](figure.png)

*JVRC-1 without fingers: 38 velocities, 8 contact points, 62 unknowns, along a recorded motion. A median step of tsid over
one of ours, turn by turn, the median (and the 10 % and 90 % quantiles) of all turns: {told}.*

{chr(10).join(lines)}

The whole scenario `humanoid_stand_reach` in MuJoCo, seed 0, with the torques of either side: reach, push, the right foot
lifted and set down. Largest values of the run; the hand's is the one at its end, when it is back. A target at 0.9 m is out
of reach: a strict level without damping throws the robot over for it, and much weight on the hand makes the soles slip.

| reach | controller | stood | hand, mm | balance, mm | slip, mm | tilt, rad | no answer | step: median, us |
|---|---|---|---|---|---|---|---|---|
{chr(10).join(standing)}

- hqp_rp {hqp_rp.__version__}: the stack of the scenario `humanoid_stand_reach`, six strict levels (contacts,
  balance, swing foot,
  hand, torso, posture with even forces), no damping; 116 hard rows: equation of motion of the base, torques, friction pyramids,
  unilaterality, joint positions, velocities and accelerations. Robot by MuJoCo {version("mujoco")}, solver
  `hierarchical_active_set` with its warm start, from Python.
- tsid 1.10.0 (its own environment, Pinocchio {tsid["pinocchio"]}): two levels; hard are dynamics, contacts, torque
  bounds, friction
  and joint velocities; balance, hand, torso, posture and forces are weighed 1, 0.1, 0.01, 0.001 and 1e-5 on the second;
  {tsid["variables"]} unknowns, {tsid["rows"]} rows; eiquadprog-fast, from Python. It has no position and
  acceleration bounds here; in the closed loop it has the swing foot, weight 1, and its contact fades for 0.2 s
  (`removeRigidContact`). The sweep of the hand's weight is printed, since no one weight is the right one for both reaches.
- Both get the same states, those of `humanoid_stand_reach` with a reach of 0.5 m, 4 ms apart, in turns of {STEPS} steps,
  {ROUNDS} rounds, both processes on the same core. The arm moves along a sine.
- "No answer" counts steps that ended without one that may be used; "certified" are ours, every twentieth, by `hqp_rp.certify`.
- Machine: {about["processor"]}, {about["cores"]} cores, {about["system"]}, Python {platform.python_version()}, one thread each.
"""
    (HERE / "report.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            main()
        except HqpError as error:
            raise SystemExit(str(error)) from error
