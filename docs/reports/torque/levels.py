"""Velocities, accelerations, torques: one path through a singularity and one humanoid. Writes levels.md and two figures here.

python docs/reports/torque/levels.py
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from hqp_rp import ConstantDamping, get_solver
from hqp_rp.compare.machine import machine
from hqp_rp.scenarios.humanoid_stand_reach import _END, _PHASES, HumanoidStandReach
from hqp_rp.scenarios.sawyer_crossing import SawyerCrossing
from hqp_rp.scenarios.sawyer_torque_impedance import SawyerTorqueImpedance

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator, NullFormatter

HERE = Path(__file__).parent
COMMANDS = ("velocity", "acceleration", "torque")
CASES = ("three levels", "two levels")
SEEDS = (0, 1, 2, 3, 4)
SETTLED = 0.3
"""s of 1.2: seeds other than 0 start off the path."""
_CONSTANT = ConstantDamping(0.1)
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "exact (null space)": ("null_space", {}),
    "null space, damped 0.1": ("null_space", {"damping": _CONSTANT}),
    "reverse priority": ("reverse_priority", {}),
    "reverse priority, T_k damped 0.1": ("reverse_priority", {"damping": _CONSTANT}),
    "operational space, selective": ("operational_space", {"singularity": "selective"}),
    "operational space, blend": ("operational_space", {"singularity": "blend"}),
    "null-space torques": ("null_space_torque", {}),
    "damped least squares 0.1": ("damped_least_squares", {"damping": _CONSTANT}),
}
MEASURES = {
    "position error [m]": "tool position, largest miss (m)",
    "orientation error [rad]": "tool orientation, largest miss (rad)",
    "measured speed [rad/s]": "joint speed, largest (rad/s)",
}


def crossing() -> dict[tuple[str, str, str], dict[str, float]]:
    """Worst over the path, once it is settled on, and the seeds."""
    found = {}
    for command in COMMANDS:
        scenario = SawyerCrossing(command=command)
        for label, (name, settings) in METHODS.items():
            runs = [list(scenario.steps(get_solver(name, **settings), seed)) for seed in SEEDS]
            for case in CASES:
                steps = [step for run in runs for step in run if step.case == case and step.parameter >= SETTLED]
                names = [*MEASURES, "commanded acceleration [rad/s^2]", "largest torque [N m]"]
                found[command, label, case] = {
                    name: max(step.measured.get(name, 0.0) for step in steps) for name in names
                }
    return found


def draw_crossing(found: dict[tuple[str, str, str], dict[str, float]]) -> None:
    figure, axes = plt.subplots(1, len(MEASURES), figsize=(11.0, 4.4), sharey=True, layout="constrained")
    colours = dict(zip(COMMANDS, ("#0072b2", "#009e73", "#d55e00"), strict=True))
    for ax, (name, title) in zip(axes, MEASURES.items(), strict=True):
        for row, label in enumerate(METHODS):
            for shift, command in zip((-0.22, 0.0, 0.22), COMMANDS, strict=True):
                for case, marker in zip(CASES, ("o", "D"), strict=True):
                    value = found[command, label, case][name]
                    filled = colours[command] if case == CASES[0] else "none"
                    ax.plot(value, row + shift, marker, color=colours[command], mfc=filled, ms=6)
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_xlabel(title)
        ax.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(range(len(METHODS)), list(METHODS))
    axes[0].invert_yaxis()
    dots = [plt.Line2D([], [], marker="o", ls="", color=colours[c], label=c) for c in COMMANDS]
    dots += [plt.Line2D([], [], marker="D", ls="", mfc="none", color="grey", label="open: two levels")]
    figure.legend(handles=dots, loc="outside upper center", ncols=4, frameon=False)
    figure.savefig(HERE / "levels.png", dpi=130)


def humanoid() -> dict[str, np.ndarray]:
    steps = list(HumanoidStandReach().steps(get_solver("hierarchical_active_set"), 0))
    names = steps[0].measured
    found = {name: np.array([step.measured[name] for step in steps]) for name in names}
    found["time"] = np.array([step.parameter for step in steps])
    found["solve"] = np.array([step.solve_time for step in steps])
    return found


def draw_humanoid(found: dict[str, np.ndarray]) -> None:
    curves = {
        "hand error [m]": ("hand (m)", "#d55e00"),
        "balance error [m]": ("balance (m)", "#0072b2"),
        "slip [m]": ("slip of a closed sole (m)", "#009e73"),
    }
    figure, (above, below) = plt.subplots(2, 1, figsize=(9.0, 4.8), sharex=True, layout="constrained")
    for name, (label, colour) in curves.items():
        above.plot(found["time"], 1e3 * found[name], label=label.replace("(m)", "(mm)"), color=colour)
    above.set_yscale("symlog", linthresh=1.0)
    above.set_ylabel("error (mm)")
    above.legend(frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    below.plot(found["time"], found["largest torque [N m]"], color="#333333")
    below.axhline(100.0, color="#d55e00", ls="--", lw=1)
    below.set_ylabel("largest torque (N m)")
    below.set_xlabel("time (s)")
    out, _, _, home, push, end, shift, _, lifted, _, down, _, middle = _PHASES
    phases = (("reach and back", out, home), ("push", push, end), ("weight to the left", shift, lifted))
    for name, begin, until in (*phases, ("right foot lifted", lifted, down), ("weight back", down, middle)):
        for ax in (above, below):
            ax.axvspan(begin, until, color="0.5", alpha=0.10 if name != "push" else 0.3, lw=0)
        below.text(0.5 * (begin + until), 4.0, name, ha="center", fontsize=8, rotation=90 if name == "push" else 0)
    below.set_xlim(0.0, _END)
    below.set_ylim(0.0, 110.0)
    figure.savefig(HERE / "humanoid.png", dpi=130)


def impedance() -> list[str]:
    """Of each family its largest deviation from the ideal while pushed, and the energy gained afterwards."""
    lines = [
        "| family | metric | translation off the law: regular, near singular, mm | energy gained after the push: regular, near "
        "singular, J |",
        "|---|---|---|---|",
    ]
    families: dict[str, tuple[str, dict[str, Any]]] = {
        "null space, reverse priority, operational space": ("null_space", {}),
        "operational space, selective": ("operational_space", {"singularity": "selective"}),
        "null-space torques, augmented, dynamic": ("null_space_torque", {}),
        "null-space torques, augmented, static": ("null_space_torque", {"consistency": "static"}),
        "damped least squares 0.1": ("damped_least_squares", {"damping": _CONSTANT}),
    }
    for metric in ("inertia", "none"):
        scenario = SawyerTorqueImpedance(metric=metric)
        for label, (name, settings) in families.items():
            off, gained = [], []
            for case in scenario.cases():
                steps = list(scenario.run_case(case, scenario.contact_arm(case), get_solver(name, **settings), 0))
                axes = ("x", "y", "z")
                off.append(
                    max(abs(s.measured[f"deviation {a}"] - s.measured[f"ideal {a}"]) for s in steps for a in axes)
                )
                gained.append(max(s.measured["energy gained [J]"] for s in steps))
            far = ", ".join(f"{1e3 * value:.2g}" for value in off)
            lines.append(f"| {label} | {metric} | {far} | {', '.join(f'{value:.2g}' for value in gained)} |")
    return lines


def stood_by_others() -> list[str]:
    """The same motion with other solvers of the same problem; the weighted sum over a sweep of its ratio."""
    solvers: dict[str, tuple[str, dict[str, Any]]] = {
        "hierarchical_active_set": ("hierarchical_active_set", {}),
        "qp_cascade, ProxQP": ("qp_cascade", {}),
        "daqp": ("daqp", {}),
        **{f"weighted, ratio {ratio:g}": ("weighted", {"ratio": ratio}) for ratio in (0.3, 0.1, 0.03, 0.01, 1e-3)},
    }
    lines = [
        "| solver | stood | hand within reach again, mm | balance, mm | slip, mm | tilt, rad | no answer | solve: median, ms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for label, (name, settings) in solvers.items():
        steps = list(HumanoidStandReach().steps(get_solver(name, **settings), 0))
        column = {key: np.array([step.measured[key] for step in steps]) for key in steps[0].measured}
        stood = "yes" if column["height [m]"].min() > 0.6 else "fell"
        cells = [
            stood,
            f"{1e3 * column['hand error [m]'][-1]:.1f}",
            f"{1e3 * column['balance error [m]'].max():.0f}",
            f"{1e3 * column['slip [m]'].max():.1f}",
            f"{column['tilt [rad]'].max():.3f}",
            f"{int(column['holding'].sum())} of {len(steps)}",
            f"{1e3 * np.median([step.solve_time for step in steps]):.2f}",
        ]
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    found = crossing()
    draw_crossing(found)
    stood = humanoid()
    draw_humanoid(stood)
    lines = [
        "| command | method | levels | position, m | orientation, rad | joint speed, rad/s | acceleration asked for, rad/s^2 | "
        "torque asked for, N m |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (command, label, case), values in found.items():
        numbers = " | ".join(f"{value:.2g}" if value else "" for value in values.values())
        lines.append(f"| {command} | {label} | {case.split()[0]} | {numbers} |")
    worst = {name: float(values.max()) for name, values in stood.items()}
    about = machine()
    text = f"""# Velocities, accelerations, torques

Remade by `python docs/reports/torque/levels.py`; read in [From velocities to torques](../../torque.md).

## The Sawyer through an algorithmic singularity

`sawyer_crossing`, {len(SEEDS)} seeds, the worst of each from {SETTLED:g} s on; torques are cut to 80 N m.

![Worst errors and joint speeds of each method at each level of command](levels.png)

{chr(10).join(lines)}

## Impedance by torques

`sawyer_torque_impedance`, seed 0: 20 N and 2 N m for 1.5 s, then nothing for 1.5 s.

{chr(10).join(impedance())}

## A humanoid

`humanoid_stand_reach`, seed 0, `hierarchical_active_set`: slip at most {1e3 * worst["slip [m]"]:.1f} mm, tilt
{worst["tilt [rad]"]:.3f} rad, balance {1e3 * worst["balance error [m]"]:.0f} mm, torque violation
{worst["torque violation [N m]"]:.2g} N m, {int(stood["holding"].sum())} of {len(stood["time"])} steps without an answer.

![Errors and torques of the humanoid over time](humanoid.png)

The same motion with other solvers of the same problem, each at its defaults; `weighted` is a weighted inverse dynamics,
over a sweep of its ratio, since no one ratio is the right one for six levels:

{chr(10).join(stood_by_others())}

Solve times compare with each other only: what else the machine does lengthens all of them.

Machine: {about["processor"]}, {about["cores"]} cores.
"""
    (HERE / "levels.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        main()
