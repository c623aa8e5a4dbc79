"""report.md and figure.png from the runs."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import matplotlib as mpl
import numpy as np
from further import humanoid, loops, one_level, stands, times, torques, within_reach
from measure import (
    ARMS,
    BEYOND,
    HERE,
    QUIET,
    RULE,
    RULES,
    STEPS,
    STILL,
    STRICT,
    SWEEP,
    SWEPT,
    Case,
    Result,
    drive,
    factor,
    least,
    levels_of,
    robot_of,
    targets,
)

from hqp_rp import JointLimit, Stack
from hqp_rp.compare.machine import machine

mpl.use("Agg")
import matplotlib.pyplot as plt

Runs = list[tuple[Case, Result]]
OLD = "reach dt, 10 reach dt"
COLORS = {
    OLD: "#c0392b",
    "reach dt, 100 reach dt": "#d98c2b",
    RULE: "#1f5fa8",
    STRICT: "#2a8f5b",
    "not damped": "#777777",
}

FAILURES = [
    "not still",
    "arm",
    "beyond reach, mm",
    "step, ms",
    "gain",
    "limit",
    "hardest, rad/s^2",
    "orientation left, rad",
]
PRICES = ["factors of levels 1, 2", "arm", "still", "hardest, rad/s^2", "until still, s", "distance, mm"]
OTHERS = ["what", "still", "hardest, rad/s^2", "distance, mm"]
LOOPS = ["arm", "beyond reach, mm", "sigma of level 1", "factor times zeta", "not damped", "1 / gain", "5 / gain"]
WITHIN = [
    "arm",
    "factors of levels 1, 2",
    "within 1 mm after, s",
    "within 1 mrad after, s",
    "left over, mm",
    "left over, mrad",
]
ONE = ["arm", "still", "hardest, rad/s^2", "distance lost, mm"]
HUMANOID = ["factors of hand, gaze", "step, ms", "posture gain", "hardest, rad/s^2", "hand off, mm", "balance off, mm"]
TORQUES = [
    "damping of the hand",
    "posture gain",
    "hand off, mm",
    "speed at the end, rad/s",
    "change of a torque in a step, N m",
]
STANDS = ["damping of the hand", "hand off, mm", "largest slip, mm", "largest tilt, rad"]
TIMES = ["damping", "hierarchical_active_set", "qp_cascade", "us", "us"]


def still(runs: Iterable[tuple[Case, Result]]) -> tuple[int, int]:
    """How many of the runs are still, of how many."""
    hard = [result.hardest < STILL for _, result in runs]
    return sum(hard), len(hard)


def draw(runs: Runs) -> None:
    fig, axes = plt.subplots(1, 3, figsize=(13.0, 3.9), constrained_layout=True)
    robot, dt, gain = robot_of("Sawyer"), 0.001, 5.0
    for rule in (OLD, RULE):
        first, second = RULES[rule](ARMS["Sawyer"], dt, gain)
        levels = levels_of(robot, targets("Sawyer")[1], gain, 0.1)
        stack = Stack(levels, [JointLimit(acceleration=20.0)], damping=[factor(first), factor(second), None])
        hardest, _ = drive(robot, stack, dt, 4.0)
        axes[0].semilogy(
            dt * np.arange(len(hardest)), np.maximum(hardest, 1e-5), color=COLORS[rule], lw=0.9, label=rule
        )
    axes[0].set_title("Sawyer, 1 kHz, 0.5 m out of reach", fontsize=10)
    axes[0].set_xlabel("time (s)")
    axes[0].set_ylabel("hardest acceleration of a joint (rad/s$^2$)")
    axes[0].legend(title="factors of levels 1, 2", loc="lower left", frameon=False, fontsize=8, title_fontsize=8)

    swept = [item for item in runs if item[0].part == "sweep"]
    for (step, gain), marker in zip(SWEPT, "osDv", strict=True):
        share = []
        for second in SWEEP:
            there = [item for item in swept if item[0].dt == step and item[0].gain == gain]
            kept, total = still(item for item in there if np.isclose(item[0].second * gain, second))
            share.append(100.0 * kept / total)
        axes[1].semilogx(SWEEP, share, marker=marker, ms=4, lw=1.2, label=f"{1e3 * step:g} ms, gain {gain:g}/s")
    axes[1].set_title("level 1 at 0.05 reach / gain, at least reach dt", fontsize=10)
    axes[1].set_xlabel("factor of level 2 times gain")
    axes[1].set_ylabel("runs that come to rest (%)")
    axes[1].set_ylim(-3, 103)
    axes[1].legend(loc="lower right", frameon=False, fontsize=8)

    names = list(RULES)
    for k, step in enumerate(STEPS):
        for row, rule in enumerate(names):
            there = [item for item in runs if item[0].part == "matrix" and item[0].rule == rule and item[0].dt == step]
            kept, total = still(there)
            place = row + 0.26 * (k - 1)
            axes[2].barh(place, 100.0 * kept / total, 0.23, color=COLORS[rule], alpha=1.0 - 0.3 * k)
            axes[2].text(100.0 * kept / total + 1.0, place, f"{kept}/{total}", va="center", fontsize=7)
    axes[2].set_yticks(range(len(names)), names, fontsize=8)
    axes[2].invert_yaxis()
    axes[2].set_xlim(0, 115)
    axes[2].set_xlabel("runs at rest (%), dark to light 1, 2, 10 ms")
    axes[2].set_title("all runs, by the factors of levels 1, 2", fontsize=10)
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(alpha=0.25)
    fig.savefig(HERE / "figure.png", dpi=110)


def table(head: list[str], rows: Iterable[list[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def by_rule(runs: Runs) -> Iterable[list[str]]:
    """Of each rule: still runs at each gain and step, and what is left over."""
    for rule in RULES:
        own = [item for item in runs if item[0].part == "matrix" and item[0].rule == rule]
        row = [rule]
        for step, gain in itertools.product(STEPS, (1.0, 5.0, 20.0)):
            kept, total = still(item for item in own if item[0].dt == step and item[0].gain == gain)
            row.append(f"{kept}/{total}" if total else "")
        yield row


def prices(runs: Runs) -> Iterable[list[str]]:
    """Of each rule at 1 ms: until still, and position lost to what position alone reaches."""
    for rule, arm in itertools.product(RULES, ARMS):
        own = [
            (case, result)
            for case, result in runs
            if case.part == "matrix" and case.rule == rule and case.arm == arm and case.dt == 0.001 and case.gain == 5.0
        ]
        calm = [(case, result) for case, result in own if result.hardest < STILL]
        row = [rule, arm, f"{len(calm)}/{len(own)}", f"{max(result.hardest for _, result in own):.2g}"]
        if calm:
            lost = [1e3 * (result.position - least(arm)[case.target]) for case, result in calm]
            settled = [result.settled for _, result in calm]
            row += [both(settled), both(lost)]
        else:
            row += ["", ""]
        yield row


def both(values: list[float]) -> str:
    """Median and largest, no minus before a zero."""
    return " / ".join(f"{round(value, 1) + 0.0:.1f}" for value in (float(np.median(values)), max(values)))


def others(runs: Runs) -> Iterable[list[str]]:
    for rule in dict.fromkeys(case.rule for case, _ in runs if case.part == "other"):
        own = [item for item in runs if item[0].rule == rule]
        kept, total = still(own)
        lost = [1e3 * (result.position - least(case.arm)[case.target]) for case, result in own]
        hardest = max(result.hardest for _, result in own)
        yield [rule, f"{kept}/{total}", f"{hardest:.2g}", both(lost)]


def failures(runs: Runs) -> Iterable[list[str]]:
    for case, result in runs:
        if case.part == "matrix" and case.rule in (RULE, STRICT) and result.hardest >= STILL:
            limit = "" if case.acceleration is None else f"{case.acceleration:g}"
            beyond = f"{1e3 * BEYOND[case.target]:g}"
            row = [case.rule, case.arm, beyond, f"{1e3 * case.dt:g}", f"{case.gain:g}", limit, f"{result.hardest:.2g}"]
            yield [*row, f"{result.orientation:.2f}"]


def report(runs: Runs) -> None:
    about = machine()
    matrix = [item for item in runs if item[0].part == "matrix"]
    rest = {rule: "{} of {}".format(*still(item for item in matrix if item[0].rule == rule)) for rule in RULES}
    ratios = [f"{1e3 * step:g} ms, gain {gain:g}" for step, gain in itertools.product(STEPS, (1, 5, 20))]
    text = f"""# Which damping keeps an arm still

![Acceleration over time, runs at rest over the factor of level 2, runs at rest of each rule](figure.png)

*Left one run with the former rule and with the rule; in the middle the factor of level 2, at three gains and two steps; right
all runs. Still: no joint harder than {STILL:g} rad/s^2 in the last {QUIET:g} s.*

Remade by `python docs/reports/still/measure.py`, half an hour on two cores; every run of the arms is a line of
[runs.csv](runs.csv). Read in [still at the limit](../../still_at_the_limit.md).

**The rule.** `ErrorDamping(reach * max(0.05 / gain, dt), power=1)` at the level of the position, `ErrorDamping(1 / gain,
power=1)` at that of an orientation below it, a posture at a tenth of their gain: {rest[RULE]} runs come to rest; with
`5 / gain` {rest[STRICT]}. Both factors in proportion to the step (`reach * dt`, ten times that): {rest[OLD]}.

## What it cannot tell

An ideal robot that does what it is told; two arms of about a metre, six targets each (four {BEYOND[0]:g} to {BEYOND[1]:g} m out
of reach, one 3 mm out, one 10 mm within, where the arm is nearly stretched), one start, resting targets, the orientation of the
start asked for. Least distances are those that the position alone comes to, from the same start: not the least of all postures.

## Still, of all

{table(["factors of levels 1, 2", *ratios], by_rule(runs))}

Both arms, six targets, without and with acceleration limits of 20 rad/s^2, posture gain a tenth.

{table(FAILURES, failures(runs))}

## Why

At 1 ms and a gain of 5/s, at rest, without acceleration limits: the smallest singular value of the first level, what it
should be, and the loop gain of the second level, `dt K pull / (sigma (sigma_2^2 + mu))`. It must stay below 2; with a first
factor of `reach dt` each is ten times as large. Arriving at speed takes more than small deviations do.

{table(LOOPS, loops())}

## The price out of reach

At 1 ms and a gain of 5/s; s until still and mm above what the position alone reaches, median / worst of the still runs.

{table(PRICES, prices(runs))}

Beside them at 1 ms, gain 5/s, 20 rad/s^2: `VariableDamping(delta, delta)` at levels 1 and 2, and the rule with the
posture at the tool's gain.

{table(OTHERS, others(runs))}

## The price within reach

0.33 m away, turned by 1 rad, gain 5/s, 2 ms, 20 rad/s^2, for 12 s.

{table(WITHIN, within_reach())}

## One level above the posture

Position above posture at 1 ms, `ErrorDamping(reach * dt, power=1)`: gains of 1, 5 and 20, without and with 20 rad/s^2.

{table(ONE, one_level())}

## A humanoid

The primitive one of `named_robot("humanoid")`: feet, centre of mass, a hand asked for a metre too much, gaze, posture;
3 rad/s, 30 rad/s^2, gain 5/s, reach 0.7 m, 5 s.

{table(HUMANOID, humanoid())}

## Torques

The stack of [torque.md](../../torque.md), its hand asked for 0.9 m, on an ideal robot, 4 s at 2 ms.

{table(TORQUES, torques())}

`humanoid_stand_reach`, the same in MuJoCo on soles with friction, hand gain 8/s, posture gain 4/s, 4 ms:

{table(STANDS, stands())}

## Times

Least time of a solve, in units of the undamped active set, and in microseconds, of the Sawyer at rest at its limit; all
took turns in one process.

{table(TIMES, times())}

Machine: {about["processor"]}, {about["cores"]} cores.
"""
    (HERE / "report.md").write_text(text, encoding="utf-8")
