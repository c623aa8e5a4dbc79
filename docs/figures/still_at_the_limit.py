"""Draws docs/figures/still_at_the_limit.png: `python docs/figures/still_at_the_limit.py`, some seconds."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

from hqp_rp import ErrorDamping, get_solver
from hqp_rp.control import JointLimit, PositionTask, PostureTask, Stack
from hqp_rp.robot import MujocoRobot, sawyer

mpl.use("Agg")
import matplotlib.pyplot as plt

DT, SECONDS = 0.002, 5.0
FAR = np.array([1.6, 0.3, 0.5])


def run(target: np.ndarray, damping: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint velocities (steps, 7), distances (steps,) and the tool's last place (3,)."""
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    tasks = [PositionTask("tool", target, gain=2.0), PostureTask(robot.neutral)]
    stack = Stack(tasks, [JointLimit()], damping=[damping, None])
    solver, v, speeds, distances = get_solver("hierarchical_active_set"), np.zeros(7), [], []
    for _ in range(round(SECONDS / DT)):
        v = solver.solve(stack.problem(robot, DT, v)).x
        robot.update(robot.integrate(robot.q, v, DT))
        speeds.append(v)
        distances.append(np.linalg.norm(robot.pose("tool")[1] - target))
    return np.array(speeds), np.array(distances), robot.pose("tool")[1]


def main() -> None:
    damping = ErrorDamping(0.002, power=1)
    tip = run(FAR, damping)[2]
    near = tip + 0.003 * (FAR - tip) / np.linalg.norm(FAR - tip)
    time = DT * np.arange(round(SECONDS / DT))
    fig, axes = plt.subplots(2, 2, figsize=(10.0, 5.6), sharex=True, constrained_layout=True)
    for column, (title, target) in enumerate([("0.65 m out of reach", FAR), ("3 mm out of reach", near)]):
        for label, color, policy in (("exact", "#c0392b", None), ("damped", "#1f5fa8", damping)):
            speeds, distances, _ = run(target, policy)
            change = np.abs(np.diff(speeds, axis=0)).max(axis=1)
            axes[0, column].plot(time, speeds[:, 3], color=color, lw=0.6 if policy is None else 1.8, label=label)
            axes[1, column].semilogy(time[1:], np.maximum(change, 1e-12), color=color, lw=0.8, label=label)
            end = 1e3 * distances[-1]
            print(f"{title}, {label}: {change[-500:].max():.1e} rad/s a step, {end:.3f} mm at the end")
        axes[0, column].set_title(f"target {title}")
        axes[1, column].set_xlabel("time (s)")
    axes[0, 0].set_ylabel("velocity of joint 4 (rad/s)")
    axes[1, 0].set_ylabel("largest change of a joint\nvelocity in a step (rad/s)")
    axes[1, 0].legend(loc="lower left", frameon=False)
    for axis in axes.flat:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(alpha=0.25)
    fig.savefig(Path(__file__).with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main()
