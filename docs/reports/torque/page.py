"""What was measured, as report.md and figure.png."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Any

import matplotlib as mpl
import numpy as np
from sides import HERE, OURS, TSID

import hqp_rp
from hqp_rp.compare.machine import machine

mpl.use("Agg")
import matplotlib.pyplot as plt


def write(
    found: dict[tuple[str, str], dict[str, list[float]]],
    pairs: dict[str, list[float]],
    tsid: dict[str, Any],
    standing: list[str],
    *,
    rounds: int,
    steps: int,
) -> None:
    """report.md and figure.png, from the times of each (side, phase), the ratios of each phase's turns and the closed loops.

    Args:
        found: of each side and phase, times and solve times in s, and counts. pairs: phase -> tsid's median over ours, turn by
            turn. tsid: what it said of itself. standing: rows of the table of closed loops. rounds, steps: how often, how long.
    """
    lines = [
        "| method | phase | whole step: least, us | median, us | 99 % below, us | solve: median, us | "
        "no answer | certified |",
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
    ratios = {phase: float(np.median(pairs[phase])) for phase in pairs}
    spread = {phase: np.quantile(pairs[phase], [0.1, 0.9]) for phase in pairs}
    figure, axes = plt.subplots(1, len(pairs), figsize=(9.0, 3.4), layout="constrained")
    for ax, phase in zip(axes, pairs, strict=True):
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
- Both get the same states, those of `humanoid_stand_reach` with a reach of 0.5 m, 4 ms apart, in turns of {steps} steps,
  {rounds} rounds, both processes on the same core. The arm moves along a sine.
- The tail of ours is some nine steps of each pass, 1.68 to 1.86 s into the motion: as the hand leaves what balance allows, many
  limits change from one step to the next, and the active set takes up to 45 iterations where 7 are usual.
- "No answer" counts steps that ended without one that may be used; "certified" are ours, every twentieth, by `hqp_rp.certify`.
- Machine: {about["processor"]}, {about["cores"]} cores, {about["system"]}, Python {platform.python_version()}, one thread each.
"""
    (HERE / "report.md").write_text(text, encoding="utf-8")
