"""report.md and figure.png from the numbers of a run."""

from __future__ import annotations

import string
from collections import Counter
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from environments import ABSENT, OURS, PEERS, how_to

mpl.use("Agg")
import matplotlib.pyplot as plt

Run = dict[str, Any]
REFERENCE = "active set"
TITLES = {peer.name: peer.title for peer in PEERS}
KINDS = {
    "right": ("right, to 1e-6", "#1b7f5c"),
    "kept": ("another answer, as promised (weighted or scaled)", "#e8b64c"),
    "wrong": ("wrong, called a success", "#c0392b"),
    "refused": ("refused or failed, and said so", "#9aa3ad"),
    "cannot": ("cannot state the problem", "#eef0f2"),
}


def write(run: Run, folder: Path) -> None:
    figure(run, folder / "figure.png")
    chosen, machine = best(run), run["machine"]
    text = string.Template((Path(__file__).parent / "template.txt").read_text(encoding="utf-8")).substitute(
        total=len(run["families"]),
        right="; ".join(f"{label(p, v)} {counts(run['verdicts'][p][v])['right']}" for p, v in chosen.items()),
        totals=totals(run),
        unseen=totals(run, "unseen"),
        drawn=len(next(iter(next(iter(run["unseen"].values())).values()))),
        seed=run["seed"],
        promises=table(["peer", "what it promises"], [[p.title, p.what] for p in PEERS if p.name in run["about"]]),
        reasons=reasons(run),
        families=by_family(run),
        reference=label(OURS.name, REFERENCE),
        calls=calls(run),
        steps=steps(run),
        starts=starts(run),
        alone=f"{run['alone']:.0f}",
        settings=settings(run),
        absent=absent(run),
        rounds=len(run["steps"][0]["medians"]),
        load=f"{run['load']:.1f}",
        cores=machine["cores"],
        processor=machine["processor"],
        system=machine["system"],
        python=run["about"][OURS.name]["python"],
        version=run["versions"]["hqp_rp"],
        set=run["versions"]["problem set"],
        how=how_to(),
    )
    (folder / "report.md").write_text(text, encoding="utf-8")


def counts(found: dict[str, dict[str, Any]]) -> Counter[str]:
    """How many of each of `KINDS`, and "tight": right to 1e-9, "loose": right to 1e-3 only."""
    counted = Counter("kept" if one.get("kept") else one["verdict"] for one in found.values())
    counted["loose"] = sum(bool(one.get("loose")) for one in found.values())
    counted["tight"] = sum(one["verdict"] == "right" and one["tight"] for one in found.values())
    return counted


def label(peer: str, variant: str) -> str:
    return f"{TITLES[peer]}, {variant}"


def entrants(run: Run, which: str = "verdicts") -> list[tuple[str, str, Counter[str]]]:
    return [(p, v, counts(found)) for p, by_variant in run[which].items() for v, found in by_variant.items()]


def best(run: Run) -> dict[str, str]:
    """Peer -> its variant with most right answers."""
    found: dict[str, tuple[str, int]] = {}
    for peer, variant, counted in entrants(run):
        if peer not in found or counted["right"] > found[peer][1]:
            found[peer] = variant, counted["right"]
    return {peer: variant for peer, (variant, _) in found.items()}


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def over(ours: dict[str, Any], theirs: dict[str, Any]) -> float:
    """Their least time over ours: other work on the machine only ever adds to a time, and adds more to a long one."""
    return float(np.min(theirs["least"]) / np.min(ours["least"]))


def microseconds(row: dict[str, Any]) -> str:
    return f"{np.median(row['medians']) / 1e3:.1f} ({np.min(row['least']) / 1e3:.1f})"


def totals(run: Run, which: str = "verdicts") -> str:
    rows = []
    for peer, variant, c in entrants(run, which):
        put = sum(c[kind] for kind in KINDS) - c["cannot"]
        rows.append(
            [label(peer, variant)]
            + [
                str(n)
                for n in (put, c["right"], c["tight"], c["loose"], c["wrong"], c["kept"], c["refused"], c["cannot"])
            ]
        )
    head = ["solver, variant", "put to it", "right to 1e-6", "of these to 1e-9", "to 1e-3 only"]
    head += ["wrong, called a success", "another answer, as promised", "refused, failed", "cannot state"]
    return table(head, rows)


def reasons(run: Run) -> str:
    lines = []
    for peer, by_variant in run["verdicts"].items():
        for variant, found in by_variant.items():
            why = Counter(one["said"] for one in found.values() if one["verdict"] in ("cannot", "refused"))
            if why:
                words = "; ".join(f"{said} ({n})" for said, n in why.most_common(4))
                lines.append(f"- {label(peer, variant)}: {words}")
    return "\n".join(lines)


def by_family(run: Run) -> str:
    families = list(dict.fromkeys(run["families"].values()))
    chosen = best(run)
    rows = []
    for family in families:
        names = [name for name, of in run["families"].items() if of == family]
        cells = []
        for peer, variant in chosen.items():
            c = counts({name: run["verdicts"][peer][variant][name] for name in names})
            cells.append(
                "–" if c["cannot"] == len(names) else f"{c['right']} / {c['wrong']} / {c['kept']} / {c['refused']}"
            )
        rows.append([f"{family} ({len(names)})", *cells])
    head = ["family", *(label(peer, variant) for peer, variant in chosen.items())]
    return table(head, rows)


def calls(run: Run) -> str:
    families = list(dict.fromkeys(row["family"] for row in run["calls"]))
    rows = []
    for peer, variant, _ in entrants(run):
        cells = []
        for family in families:
            there = {(row["peer"], row["variant"]): row for row in run["calls"] if row["family"] == family}
            row = there.get((peer, variant))
            if row is None:
                cells.append("–")
                continue
            ratio = over(there[OURS.name, REFERENCE], row)
            mark = "" if row["right"] == row["of"] else f", {row['right']} of {row['of']} right"
            cells.append(f"{microseconds(row)} × {ratio:.2f}{mark}")
        rows.append([label(peer, variant), *cells])
    head = ["us: median (least) × ratio of the least", *families]
    return table(head, rows)


def steps(run: Run) -> str:
    ours = next(row for row in run["steps"] if row["peer"] == OURS.name)
    rows = []
    for row in run["steps"]:
        if "failed" in row:
            rows.append([TITLES[row["peer"]], "–", "–", "–", row["failed"]])
            continue
        right, off = f"{row['right']} of {row['of']}", f"{row['off']:.0e}"
        rows.append([TITLES[row["peer"]], microseconds(row), f"{over(ours, row):.2f}", right, off])
    head = ["peer", "us: median (least)", "× hqp_rp", "right to 1e-6", "largest deviation, relative"]
    return table(head, rows)


def starts(run: Run) -> str:
    rows = []
    for peer, taken in run["cold"].items():
        first = "first call" if run["about"][peer]["solves"] else "first step"
        rows.append(
            [TITLES[peer], f"{np.median(taken):.2f} ({np.min(taken):.2f})", first, f"{run['megabytes'][peer]:.0f}"]
        )
    return table(["peer", "start, s", "to its", "size, MB"], rows)


def settings(run: Run) -> str:
    lines = []
    for peer, said in run["about"].items():
        package = f"{said['package']} {said['version']}"
        lines += [f"- {label(peer, v)} ({package}): `{words}`" for v, words in said["variants"].items()]
        if said["steps"]:
            lines.append(f"- {TITLES[peer]}, whole step ({package}): `{said['step_settings']}`")
    return "\n".join(lines)


def absent(run: Run) -> str:
    lines = [f"- {name}: {why}." for name, why in ABSENT.items()]
    return "\n".join(lines + [f"- {TITLES[name]}: {why}." for name, why in run["missing"].items()])


def figure(run: Run, path: Path) -> None:
    found = entrants(run)[::-1]
    fig, (left, right) = plt.subplots(
        1, 2, figsize=(13.0, 6.2), gridspec_kw={"width_ratios": [1.25, 1.0]}, layout="constrained"
    )
    names = [label(p, v) for p, v, _ in found]
    at = np.zeros(len(found))
    for kind, (words, colour) in KINDS.items():
        size = np.array([c[kind] for _, _, c in found])
        left.barh(names, size, left=at, color=colour, label=words, edgecolor="white", linewidth=0.6)
        for y, (x, n) in enumerate(zip(at, size, strict=True)):
            if n >= 6:
                dark = kind in ("kept", "cannot")
                left.text(x + n / 2, y, str(n), ha="center", va="center", fontsize=8, color="#333" if dark else "white")
        at = at + size
    left.set_xlim(0, len(run["families"]))
    left.set_xlabel("problems")
    left.set_title("Answers to the problem set", loc="left", fontsize=11)
    left.legend(loc="upper center", bbox_to_anchor=(0.4, -0.09), ncols=2, frameon=False, fontsize=8)
    _times(run, right)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(axis="y", length=0, labelsize=9)
    fig.savefig(path, dpi=130)
    plt.close(fig)


def _times(run: Run, axes: Any) -> None:
    chosen = best(run)
    peers = [p for p in run["about"] if p != "mink-warp"][::-1]  # one world of a batched library: in the table
    series = (
        ("3+3 on 7", "one call, 3+3", "v", "#5b9bd5"),
        ("Sawyer, 3+3+7", "one call, 3+3+7", "o", "#1f4e79"),
        ("Sawyer, 3+3+7 within limits", "the same within limits", "s", "#d9822b"),
        ("humanoid within limits", "one call, humanoid within limits", "D", "#7a4ea3"),
        (None, "whole step, arm", "^", "#1b7f5c"),
    )
    for k, (family, words, marker, colour) in enumerate(series):
        rows = run["steps"] if family is None else run["calls"]
        there = {
            row["peer"]: row
            for row in rows
            if "medians" in row
            and (family is None or (row["family"], row["variant"]) == (family, chosen.get(row["peer"])))
        }
        points = [(np.median(there[p]["medians"]) / 1e3, y, there[p]) for y, p in enumerate(peers) if p in there]
        for x, y, row in points:
            full = row["right"] == row["of"]
            axes.plot(
                x, y + 0.12 * (2.0 - k), marker, color=colour, markerfacecolor=colour if full else "white", markersize=7
            )
        axes.plot([], [], marker, color=colour, label=words, linestyle="none")
    axes.set_xscale("log")
    axes.set_yticks(range(len(peers)), [TITLES[p] + (f", {chosen[p]}" if p in chosen else "") for p in peers])
    axes.set_ylim(-0.6, len(peers) - 0.4)
    axes.grid(axis="x", which="both", color="#e6e8eb", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("microseconds (hollow: not all of these answers are right)")
    axes.set_title("Time", loc="left", fontsize=11)
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, -0.09), ncols=2, frameon=False, fontsize=8)
