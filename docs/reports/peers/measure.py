"""N strict levels: who is right, and how fast. Puts the problem set and a control step to hqp_rp and its peers.

    python docs/reports/peers/measure.py --environments DIR                    # everything: report.md, figure.png, run.json
    python docs/reports/peers/measure.py --environments DIR --peer mink --output FOLDER    # one peer beside hqp_rp
    python docs/reports/peers/measure.py --environments DIR --verdicts         # who is right anew, times as they were
    python docs/reports/peers/measure.py --written                             # the page again from run.json
    python docs/reports/peers/measure.py --how                                 # how the environments are made

DIR holds one environment for each peer (`--how` prints the lines); a peer without one is left out and said so. Every peer
answers from a process of its own (workers/), all on the same core, in turns.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import arm
import fresh
import numpy as np
from environments import OURS, PEERS, Peer, how_to
from judge import TOLERANCE, verdict
from process import Process, megabytes

import hqp_rp
from hqp_rp import problems

HERE = Path(__file__).parent
TIMED = {
    "3+3 on 7": [f"independent/n7_3-3_s{i}" for i in range(2)],
    "Sawyer, 3+3+7": [f"sawyer/3-3-7_q{i}" for i in range(3)],
    "Sawyer, 3+3+7 within limits": [f"sawyer/3-3-7_limits_q{i}" for i in range(3)],
    "humanoid, 12+3+12+3+32": [f"humanoid/12-3-12-3-32_q{i}" for i in range(4)],
    "humanoid within limits": [f"humanoid/12-3-12-3-32_limits_q{i}" for i in range(4)],
}
ROUNDS, TURN_NS, COLD = 21, 1.5e7, 7
FIRST = "sawyer/3-3-7_q0"
SEED = 20261127


def stated() -> dict[str, problems.KnownProblem]:
    """The problems of the set without a metric and without damped levels, which a worker's `Given` does not hold."""
    found = {name: problems.load(name) for name in problems.names()}
    return {name: one for name, one in found.items() if one.problem.metric is None and one.problem.damping is None}


def solve_all(process: Process, variant: str, known: Mapping[str, Any], paths: Mapping[str, Path]) -> dict[str, Any]:
    found = {}
    for name, one in known.items():
        reply = process.ask({"solve": str(paths[name]), "variant": variant}, seconds=20.0)
        found[name] = verdict(one, reply)
    return found


def timed(processes: dict[str, Process], about: dict[str, Any], verdicts: dict[str, Any]) -> list[dict[str, Any]]:
    """Single calls: every peer and variant that can state the problems takes turns, `ROUNDS` times."""
    rows = []
    for family, names in TIMED.items():
        paths = [str(problems.path(name)) for name in names]
        entrants = []
        for peer, said in about.items():
            for variant in said["variants"] if said["solves"] else ():
                found = [verdicts[peer][variant][name] for name in names]
                if any(one["verdict"] in ("cannot", "refused") for one in found):
                    continue
                ask = {"time": paths, "variant": variant}
                first = processes[peer].ask({**ask, "calls": 2 * len(paths)})
                if "times" in first:
                    calls = int(np.clip(TURN_NS / np.median(first["times"]), 2 * len(paths), 400))
                    right = sum(one["verdict"] == "right" for one in found)
                    entrants.append((peer, variant, {**ask, "calls": calls}, right, [], []))
        for _ in range(ROUNDS):
            for peer, _, ask, _, medians, least in entrants:
                times = processes[peer].ask(ask)["times"]
                medians.append(float(np.median(times)))
                least.append(float(np.min(times)))
        rows += [
            {"family": family, "peer": p, "variant": v, "right": r, "of": len(names), "medians": m, "least": low}
            for p, v, _, r, m, low in entrants
        ]
    return rows


def steps(processes: dict[str, Process], about: dict[str, Any]) -> list[dict[str, Any]]:
    """Whole control steps from q to v, in turns; every answer judged on the prioritized problem at its configuration."""
    given, wanted = arm.asked()
    rows = []
    for peer, said in about.items():
        if not said["steps"]:
            continue
        ready = processes[peer].ask({"step": given}, seconds=300.0)
        if "ready" not in ready:
            rows.append({"peer": peer, "failed": ready.get("error") or ready.get("ended")})
            continue
        right, off, rows_of = 0, [], "logarithm" if peer in arm.LOGARITHM else "plain"
        for i, problem in enumerate(wanted[rows_of]):
            v = np.array(processes[peer].ask({"velocity": i})["v"], dtype=np.float64)
            best = hqp_rp.solve(problem, "hierarchical_active_set").require()
            off.append(float(np.linalg.norm(v - best) / np.linalg.norm(best)))
            right += bool(np.isfinite(v).all()) and hqp_rp.certify(problem, v, tolerance=TOLERANCE).ok
        calls = int(np.clip(TURN_NS / np.median(processes[peer].ask({"turn": 0, "calls": 20})["times"]), 8, 400))
        rows.append(
            {"peer": peer, "right": right, "of": i + 1, "rows": rows_of, "off": float(np.max(off)), "calls": calls}
        )
        rows[-1] |= {"medians": [], "least": []}
    for k in range(ROUNDS):
        for row in rows:
            if "calls" in row:
                times = processes[row["peer"]].ask({"turn": 7 * k, "calls": row["calls"]})["times"]
                row["medians"].append(float(np.median(times)))
                row["least"].append(float(np.min(times)))
    return rows


def cold_starts(processes: dict[str, Process], about: dict[str, Any]) -> dict[str, list[float]]:
    """Seconds from the start of the interpreter to the first answer, `COLD` times in turns after one that warms caches."""
    given, _ = arm.asked()
    found: dict[str, list[float]] = {peer: [] for peer in about}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "asked.json"
        asked = {"solve": str(problems.path(FIRST)), "variant": "", "step": given}
        path.write_text(json.dumps(asked), encoding="utf-8")
        for k in range(COLD + 1):
            for peer, taken in found.items():
                seconds = processes[peer].cold(path)
                if k:
                    taken.append(seconds)
    return found


def right(processes: dict[str, Process], about: dict[str, Any]) -> dict[str, Any]:
    """Who is right: the verdicts on the set and on problems drawn anew."""
    verdicts: dict[str, Any] = {}
    unseen: dict[str, Any] = {}
    known, drawn = stated(), fresh.draw(SEED)
    paths = {name: problems.path(name) for name in known}
    with tempfile.TemporaryDirectory() as folder:
        drawn_paths = fresh.save(drawn, Path(folder))
        for peer, said in about.items():
            for variant in said["variants"] if said["solves"] else ():
                print(f"{peer}, {variant}", file=sys.stderr)
                verdicts.setdefault(peer, {})[variant] = solve_all(processes[peer], variant, known, paths)
                unseen.setdefault(peer, {})[variant] = solve_all(processes[peer], variant, drawn, drawn_paths)
    families = {name: one.family for name, one in known.items()}
    return {"families": families, "verdicts": verdicts, "seed": SEED, "unseen": unseen}


def measure(peers: list[Peer], environments: Path, before: dict[str, Any] | None = None) -> dict[str, Any]:
    """The whole run; with the run `before` only who is right is asked anew, and its times stay."""
    processes: dict[str, Process] = {}
    about, missing, size = {}, {}, {}
    for peer in peers:
        python = environments / peer.name / "bin" / "python"
        if not python.exists():
            missing[peer.name] = "no environment"
            continue
        process = Process(python, peer.worker)
        said = process.ask({"about": 1}, seconds=120.0)
        if "version" not in said:
            missing[peer.name] = str(said.get("ended") or said.get("error"))
            continue
        processes[peer.name], about[peer.name], size[peer.name] = process, said, megabytes(python)
    if OURS.name not in about:
        raise SystemExit(
            f"{OURS.name} itself takes no part ({missing[OURS.name]}); make its environment first (--how)."
        )
    found = right(processes, about)
    if before is not None:
        for process in processes.values():
            process.close()
        gone = set(before["about"]) - set(about)
        if gone:
            raise SystemExit(
                f"{', '.join(sorted(gone))}: in run.json and not in {environments}; measure everything anew."
            )
        return before | found | {"about": about, "versions": _versions()}
    print("times", file=sys.stderr)
    run = {
        "versions": _versions(),
        "machine": {"processor": _processor(), "system": platform.system(), "cores": os.cpu_count()},
        "load": os.getloadavg()[0],
        "about": about,
        "missing": missing,
        "megabytes": size,
        "alone": megabytes(environments / OURS.name / "bin" / "python", ("hqp_rp", "numpy")),
        **found,
        "calls": timed(processes, about, found["verdicts"]),
        "steps": steps(processes, about),
    }
    for process in processes.values():
        process.close()
    print("cold starts", file=sys.stderr)
    return run | {"cold": cold_starts(processes, about)}


def _versions() -> dict[str, str]:
    return {"hqp_rp": hqp_rp.__version__, "problem set": problems.version}


def _processor() -> str:
    from hqp_rp.compare.machine import machine

    return machine()["processor"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--environments", type=Path, metavar="DIR", help="the folder of the peers' environments")
    parser.add_argument(
        "--peer", action="append", choices=[p.name for p in PEERS[1:]], help="only this one, beside hqp_rp"
    )
    parser.add_argument("--output", type=Path, help="where the page is written; needed with --peer")
    parser.add_argument(
        "--verdicts", action="store_true", help="ask anew who is right, of all peers, and keep the times of run.json"
    )
    parser.add_argument("--written", action="store_true", help="write the page again from run.json")
    parser.add_argument("--how", action="store_true", help="say how the environments are made")
    given = parser.parse_args()
    if given.how:
        print(how_to())
        return
    output = given.output or HERE
    if not given.written:
        if given.environments is None:
            parser.error("--environments DIR is needed: the folder with one environment for each peer (see --how)")
        if given.peer and given.output is None:
            parser.error("--peer needs --output FOLDER: the page here holds all peers")
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # everyone on the same core, in turns
        chosen = [p for p in PEERS if p is OURS or not given.peer or p.name in given.peer]
        before = json.loads((output / "run.json").read_text(encoding="utf-8")) if given.verdicts else None
        run = measure(chosen, given.environments.absolute(), before)
        output.mkdir(parents=True, exist_ok=True)
        (output / "run.json").write_text(json.dumps(run, indent=1) + "\n", encoding="utf-8")
    from page import write

    write(json.loads((output / "run.json").read_text(encoding="utf-8")), output)


if __name__ == "__main__":
    main()
