"""The whole scenario in a closed loop, with the torques of either side: who keeps feet and balance?"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from sides import Remote, pinocchio_state

from hqp_rp import TorqueController
from hqp_rp.control import Mode, TorqueCommand
from hqp_rp.scenarios.humanoid_stand_reach import HumanoidStandReach, _Run


class Standing:
    """The scenario with torques from elsewhere."""

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


def stood(python: str, asked: dict[str, Any]) -> list[str]:
    """Rows of the table of closed loops: both sides, a hand target within reach and one out of it."""
    rows = []
    for reach in (0.5, 0.9):
        own = HumanoidStandReach.hand_damping
        for damping, words in ((0.0, "no damping"), (own, "hand damped, as the scenario has it")):
            standing = Standing(HumanoidStandReach(reach=reach, hand_damping=damping))
            rows.append([f"{reach:g} m", f"hqp_rp, {words}", *standing.run(standing.ours())])
        for weight in (1.0, 0.1, 0.03, 0.01, 0.001):
            standing = Standing(HumanoidStandReach(reach=reach))
            dt = standing.scenario.period
            remote = Remote(python, asked | {"dt": dt, "hand_weight": weight})
            rows.append([f"{reach:g} m", f"tsid, hand weight {weight:g}", *standing.run(standing.theirs(remote))])
    return [f"| {' | '.join(row)} |" for row in rows]
