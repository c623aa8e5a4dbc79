"""Draws the pictures of docs/tutorials from the pages' own code: `python docs/figures/tutorials.py`, a quarter of a minute.

Each page's python blocks run as they stand; a picture shows what their variables hold.
"""

from __future__ import annotations

import re
import sys
import tempfile
import types
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
OUT = HERE
COLORS = ["#1f5fa8", "#c0392b", "#2e8b57", "#b8860b", "#6b4fa0"]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
Values = dict[str, Any]


def run(page: str, blocks: int | None = None) -> Values:
    """The variables of a tutorial page after its first `blocks` python blocks, None for all."""
    text = (HERE.parent / "tutorials" / f"{page}.md").read_text(encoding="utf-8")
    module = types.ModuleType(f"page_{page}")
    sys.modules[module.__name__] = module
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for code in BLOCK.findall(text)[:blocks]:
            exec(compile(code, page, "exec", dont_inherit=True), module.__dict__)
    return module.__dict__


def arm_with_limits() -> None:
    page = run("arm_with_limits", 3)
    time = page["dt"] * np.arange(1, len(page["speeds"]) + 1)
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.4), constrained_layout=True)
    left.axhspan(-1.0, 1.0, color="#dddddd", lw=0)
    for j in range(7):
        left.plot(time, page["speeds"][:, j], lw=1.2, label=f"joint {j + 1}")
    left.set_ylabel("joint velocity (rad/s)")
    left.legend(fontsize=7, ncol=2, frameon=False, loc="lower right")
    right.semilogy(time, page["errors"][:, 0], color=COLORS[0], label="tool position (m)")
    right.semilogy(time, page["errors"][:, 1], color=COLORS[1], label="tool orientation (rad)")
    right.set_ylabel("error")
    right.legend(frameon=False)
    finish(fig, [left, right], "time (s)", "arm_with_limits")


def through_a_singularity() -> None:
    page = run("through_a_singularity", 2)
    fig, axes = plt.subplots(1, 3, figsize=(11.0, 3.6), constrained_layout=True)
    for (name, speed), color in zip(page["speed"].items(), COLORS, strict=True):
        missed = np.array(page["missed"][name])
        axes[0].semilogy(page["reach"], speed, color=color, label=name, lw=1.4)
        axes[1].semilogy(page["reach"], np.maximum(missed[:, 0], 1e-17), color=color, lw=1.2)
        axes[2].semilogy(page["reach"], np.maximum(missed[:, 1], 1e-17), color=color, lw=1.2)
    for axis, what in zip(
        axes, ("largest joint speed (rad/s)", "level 1 off by (m/s)", "level 2 off by (m/s)"), strict=True
    ):
        axis.set_ylabel(what)
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncol=3, frameon=False, fontsize=8)
    finish(fig, axes, "distance along the line (rad)", "through_a_singularity")


def force_on_a_wall() -> None:
    page = run("force_on_a_wall", 2)
    time = page["dt"] * np.arange(len(page["felt"]))
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.2), constrained_layout=True)
    left.plot(time, page["felt"], color=COLORS[0])
    left.axhline(10.0, color="#999999", lw=0.8, ls="--")
    left.set_ylabel("force on the wall (N)")
    wanted = 100.0 * np.sin(time)
    right.plot(time, wanted, color="#999999", ls="--", label="path")
    right.plot(time, wanted + 1e3 * np.array(page["slid"]), color=COLORS[1], label="tool")
    right.set_ylabel("along the wall (mm)")
    right.legend(frameon=False)
    finish(fig, [left, right], "time (s)", "force_on_a_wall")


def humanoid() -> None:
    page = run("humanoid", 2)
    robot, runner, hand, gaze = page["robot"], page["runner"], page["hand"], page["gaze"]
    robot.update(page["q"])
    runner.reset()
    fig, axes = plt.subplots(1, 2, figsize=(9.6, 3.4), sharey=True, constrained_layout=True)
    for axis, title, steps in zip(axes, ("within reach", "out of reach"), (800, 1600), strict=True):
        if title == "out of reach":
            hand.target = gaze.target = robot.pose("right_grip")[1] + [1.0, 0.0, 0.0]
        soles, com, off = [task.target for task in page["feet"]], page["balance"].target, []
        for _ in range(steps):
            command = runner.step(robot, dt=0.005)
            robot.update(robot.integrate(robot.q, command.v, 0.005))
            feet = max(
                np.linalg.norm(robot.pose(f"{side}_sole")[1] - target[1])
                for side, target in zip(("left", "right"), soles, strict=True)
            )
            balance = np.linalg.norm((robot.center_of_mass() - com)[:2])
            off.append((feet, balance, np.linalg.norm(hand.error(robot)), np.linalg.norm(gaze.error(robot))))
        time = 0.005 * np.arange(1, steps + 1)
        labels = ("feet (m)", "centre of mass (m)", "hand (m)", "gaze (rad)")
        for values, label, color in zip(np.array(off).T, labels, COLORS, strict=False):
            axis.semilogy(time, np.maximum(values, 1e-9), color=color, label=label)
        axis.set_title(title)
    axes[0].set_ylabel("off by")
    axes[1].legend(frameon=False, fontsize=8)
    finish(fig, axes, "time (s)", "humanoid")


def finish(fig: Any, axes: Any, below: str, name: str) -> None:
    for axis in axes:
        axis.set_xlabel(below)
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(alpha=0.25)
    fig.savefig(OUT / f"{name}.png", dpi=110)
    plt.close(fig)


PICTURES: tuple[Callable[[], None], ...] = (arm_with_limits, through_a_singularity, force_on_a_wall, humanoid)

if __name__ == "__main__":
    for picture in PICTURES:
        picture()
