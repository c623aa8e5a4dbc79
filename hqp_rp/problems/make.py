"""Remake the problem set: the same files from the same seeds, to the last bit of every number.

python -m hqp_rp.problems.make            # write data/, and the tables of README.md and docs/problem_set.md
python -m hqp_rp.problems.make --check    # write nothing; fail when a number differs from the one that is kept
"""

from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from hqp_rp import problems
from hqp_rp.core.truth import Truth
from hqp_rp.problems import equality_families, inequality_families, norm_families, robot_families
from hqp_rp.problems.exact import exact_answer
from hqp_rp.problems.known_problem import KnownAnswer, KnownProblem, to_arrays
from hqp_rp.problems.recipe import Recipe

PAGES = (
    pathlib.Path(__file__).with_name("README.md"),
    pathlib.Path(__file__).parents[2] / "docs" / "problem_set.md",
)
BEGIN, END = "<!-- table -->", "<!-- end of table -->"

_MAKERS: tuple[Callable[[], Iterator[Recipe]], ...] = (
    equality_families.independent,
    equality_families.over_constrained,
    equality_families.dependent,
    equality_families.rank_deficient,
    equality_families.badly_scaled,
    equality_families.near_singular,
    inequality_families.inequality,
    inequality_families.hard_rows,
    inequality_families.barely_feasible,
    inequality_families.infeasible,
    robot_families.sawyer,
    robot_families.dual_arm,
    robot_families.humanoid,
    norm_families.metric,
    norm_families.damped,
    robot_families.torque,
)


def recipes() -> list[Recipe]:
    """The recipes of all problems, in the order of the set."""
    return [recipe for maker in _MAKERS for recipe in maker()]


def make(recipe: Recipe) -> KnownProblem:
    """The problem with its exact answer."""
    problem = recipe.problem()
    answer = exact_answer(problem)
    return KnownProblem(
        name=recipe.name,
        family=recipe.family,
        problem=problem,
        exact=_known(answer.exact),
        rule=None if answer.rule is None else _known(answer.rule),
        reason=answer.exact.reason,
        distance=recipe.distance,
        seed=recipe.seed,
        made=recipe.made,
        proof=answer.proof,
        set_version=recipe.since,
    )


def differences(made: dict[str, Any], kept: dict[str, Any]) -> list[str]:
    """The names of the arrays that are not the same to the last bit, or are in one of the two only."""
    names = sorted(set(made) | set(kept))
    return [name for name in names if name not in made or name not in kept or not _same(made[name], kept[name])]


def read_arrays(path: pathlib.Path) -> dict[str, Any]:
    """Every array of a file of the set."""
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def table(set_: Iterable[KnownProblem]) -> str:
    """What is in the set, as a table of families."""
    rows: dict[str, list[KnownProblem]] = {family: [] for family in problems.families()}
    for known in set_:
        rows[known.family].append(known)
    lines = [
        "| family | since | problems | n | levels | inequalities | hard rows | infeasible | ambiguous | what it holds |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for family, found in [*rows.items(), ("all", [known for one in rows.values() for known in one])]:
        words = problems.families().get(family, f"version {problems.version}")
        counts = (
            sum(not known.problem.is_equality for known in found),
            sum(known.problem.hard is not None for known in found),
            sum(not known.feasible for known in found),
            sum(known.ambiguous for known in found),
        )
        sizes = (_range([known.problem.n for known in found]), _range([known.problem.p for known in found]))
        since = min(known.set_version for known in found)
        lines.append(f"| {' | '.join([family, since, str(len(found)), *sizes, *map(str, counts), words])} |")
    return "\n".join(lines)


def page_with(text: str, table_: str) -> str:
    """A page with the table between its marks replaced."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n{table_}\n{END}{rest.partition(END)[2]}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns the number of files that were written, removed, or that differ."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.problems.make", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a number differs")
    check = parser.parse_args(arguments).check
    made = [make(recipe) for recipe in recipes()]
    changed = 0
    for known in made:
        path, arrays = problems.DATA / f"{known.name}.npz", to_arrays(known)
        apart = differences(arrays, read_arrays(path)) if path.exists() else ["no file"]
        if not apart:
            continue
        changed += 1
        print(f"{known.name}: {', '.join(apart)}")
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(path, **arrays)
    for path in sorted(problems.DATA.glob("*/*.npz")):
        if path.relative_to(problems.DATA).with_suffix("").as_posix() not in {known.name for known in made}:
            changed += 1
            print(f"{path.name}: no recipe makes it")
            if not check:
                path.unlink()
    for page in PAGES:
        text = page.read_text(encoding="utf-8") if page.exists() else ""
        if text and text != page_with(text, table(made)):
            changed += 1
            print(f"{page.name}: the table")
            if not check:
                page.write_text(page_with(text, table(made)), encoding="utf-8")
    print(f"{len(made)} problems, {changed} {'differ' if check else 'written'}.")
    return changed


def _known(truth: Truth) -> KnownAnswer | None:
    return None if truth.x is None else KnownAnswer(truth.x, truth.residuals, truth.ranks)


def _same(a: Any, b: Any) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return bool(a.dtype == b.dtype) and a.shape == b.shape and a.tobytes() == b.tobytes()


def _range(values: list[int]) -> str:
    low, high = min(values), max(values)
    return str(low) if low == high else f"{low}-{high}"


if __name__ == "__main__":
    sys.exit(1 if main() and "--check" in sys.argv else 0)
