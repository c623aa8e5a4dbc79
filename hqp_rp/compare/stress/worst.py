"""The worst cases of a stress test as files, and their replay."""

from __future__ import annotations

import dataclasses
import pathlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.check import conflict_sentence, described
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.compare.stress.findings import infeasible_file
from hqp_rp.compare.stress.infeasible import problems_of
from hqp_rp.compare.stress.plan import Plan, Samples
from hqp_rp.compare.stress.record import StressResult
from hqp_rp.compare.stress.summary import JUMPING, WORST, Worst
from hqp_rp.core.certificate import certify
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.distance import distance
from hqp_rp.core.io import load_metadata, load_problem, save_problem
from hqp_rp.core.solver import Solver, all_solvers

say = Sentences(__file__)

CONTRADICTION = "hard rows that contradict each other"

TRUTH_UNKNOWNS = 40
"""A replay states the distance from the exact truth up to this many unknowns (about 0.1 s there)."""


def save_worst(test: StressResult, folder: pathlib.Path) -> list[pathlib.Path]:
    """Write each worst case of the summary as .npz, a jump as the two samples between which it happens, and one problem of
    each contradiction among hard rows."""
    folder.mkdir(exist_ok=True)
    written = []
    found = () if test.infeasible is None else test.infeasible.kept
    for place, item in enumerate(found):
        ((_, problem),) = problems_of(test.plan, [item.sample])
        metadata = {
            "model": test.plan.model,
            "stack": test.plan.stack.text,
            "seed": test.plan.seed,
            "sample": item.sample,
        }
        name = pathlib.PurePath(infeasible_file(place)).name
        written.append(
            save_problem(problem, folder / name, **metadata, what=CONTRADICTION, solver="hierarchical_active_set")
        )
    samples: dict[int, Samples] = {}
    for case in test.summary.worst:
        chunk = next(item for item in test.plan.chunks if item.first <= case.sample < item.first + item.count)
        if chunk.index not in samples:
            samples[chunk.index] = test.plan.samples_of(chunk)
        own, i = samples[chunk.index], case.sample - chunk.first
        contestant = next(item for item in test.plan.contestants if item.label == case.contestant)
        for name, at in zip(_names(case), (i - 1, i) if case.criterion == JUMPING else (i,), strict=True):
            metadata = _metadata(test.plan, contestant, case, own, at)
            written.append(save_problem(own.problems[at], folder / name, **metadata))
    for old in folder.glob("*.npz"):
        if old not in written:
            old.unlink()
    return written


def replay_command(test: StressResult, case: Worst) -> str:
    """The command that solves the case again, in the report's folder."""
    contestant = next(item for item in test.plan.contestants if item.label == case.contestant)
    files = " ".join(f"worst/{name}" for name in _names(case))
    return f"hqp-rp replay {files} --solver '{spelled(contestant.solver)}'"


def spelled(solver: Solver) -> str:
    """The solver as the command line takes it: its name or package.module:Class, and the settings that are not the default."""
    kind = type(solver)
    name = kind.name if all_solvers().get(kind.name) is kind else f"{kind.__module__}:{kind.__qualname__}"
    changed = [
        f"{field.name}={getattr(solver, field.name)!r}".replace("'", "").replace(" ", "")
        for field in dataclasses.fields(solver)
        if field.init and repr(getattr(solver, field.name)) != repr(field.default)
    ]
    return f"{name}:{','.join(changed)}" if changed else name


@dataclasses.dataclass(frozen=True)
class Replayed:
    """One saved case solved again. x: (n,) or None; sentences: what to print."""

    x: Any
    sentences: tuple[str, ...]


def replay(path: str | pathlib.Path, solver: str | None = None) -> Replayed:
    """Solve a saved case again with `solver` (as the command line takes it), or with the one that it was saved for.

    Raises `FileError` for a file that is no saved problem, and what `parse_contestant` raises.
    """
    problem, metadata = load_problem(path), load_metadata(path)
    chosen = parse_contestant(solver or str(metadata.get("solver", "null_space")))
    solution = chosen.solve(problem)
    lines = [f"{path}: {described(metadata)}", f"  {chosen!r}"]
    lines.append(f"  {solution.status.name}: {solution.status.value} {solution.message}".rstrip())
    if solution.conflict is not None:
        lines.append(f"  {conflict_sentence(solution)}")
    if solution.x is None:
        return Replayed(None, tuple(lines))
    lines.append(f"  |x| = {norm(solution.x):.6g}, x = {np.array2string(solution.x, precision=6)}")
    told = []
    if problem.n <= TRUTH_UNKNOWNS and (problem.is_equality or problem.n <= 10):
        found = distance(problem, solution.x, reference="truth")
        told.append(say("replayed_distance", found=found))
    verdict = certify(problem, solution.x)
    told += [say("replayed_level", level=level) for level in verdict.levels]
    told.append(verdict.sentence)
    return Replayed(solution.x, (*lines, *(f"  {sentence}" for sentence in told)))


def replay_all(paths: Sequence[str | pathlib.Path], solver: str | None = None) -> tuple[str, ...]:
    """`replay` of several files, and by how much x changes from each to the next."""
    sentences: list[str] = []
    before = None
    for path in paths:
        found = replay(path, solver)
        sentences += found.sentences
        if before is not None and found.x is not None and len(before) == len(found.x):
            change = say("replayed_change", change=norm(found.x - before))
            sentences.append(f"  {change}")
        before = found.x
    return tuple(sentences)


def _names(case: Worst) -> tuple[str, ...]:
    slug = re.sub(r"[^a-z0-9]+", "-", f"{case.contestant} {case.criterion}".lower()).strip("-")
    return (f"{slug}-1.npz", f"{slug}-2.npz") if case.criterion == JUMPING else (f"{slug}.npz",)


def _metadata(plan: Plan, contestant: Contestant, case: Worst, samples: Samples, i: int) -> dict[str, Any]:
    sigma = float(samples.sigma[i])
    return {
        "model": plan.model,
        "stack": plan.stack.text,
        "seed": plan.seed,
        "samples": plan.samples,
        "sample": int(samples.number[i]),
        "kind": samples.kind,
        "sigma": sigma if np.isfinite(sigma) else None,
        "q": samples.q[i],
        "contestant": contestant.label,
        "solver": spelled(contestant.solver),
        "what": WORST[case.criterion],
        "figure": case.value,
    }
