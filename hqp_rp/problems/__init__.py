"""A versioned set of prioritized least-squares problems with their exact answers.

    for name in hqp_rp.problems.names():
        known = hqp_rp.problems.load(name)
        solution = hqp_rp.solve(known.problem, "null_space")

Each problem is a plain .npz file that numpy alone reads; README.md beside this file says what is in it, the
page "The problem set" how another project uses it. Loading needs no solver, no robot and nothing beyond numpy.
"""

from __future__ import annotations

import functools
import pathlib

from hqp_rp.core.errors import unknown_name
from hqp_rp.problems.known_problem import KnownAnswer, KnownProblem, load_known

__all__ = ["DATA", "KnownAnswer", "KnownProblem", "families", "load", "names", "path", "version"]

version = "1.1"
"""Of the numbers, apart from the library's: the page "The problem set" says what a change of it means."""

DATA = pathlib.Path(__file__).with_name("data")
"""The folder of the files: `DATA / family / label.npz`."""

_FAMILIES = {
    "independent": "every level can be met: all rows of all levels are independent",
    "over_constrained": "more rows than unknowns: levels contradict the ones before them",
    "dependent": "rows that are exact combinations of earlier levels' rows (algorithmic singularity)",
    "rank_deficient": "levels whose own matrix lacks rank exactly (kinematic singularity)",
    "badly_scaled": "levels, rows or unknowns in units that differ by powers of two",
    "near_singular": "at distance 2^-7 ... 2^-44 from an algorithmic or a kinematic singularity",
    "inequality": "equalities, bands and one-sided rows mixed at every level",
    "hard_rows": "hard bounds, bands and equalities with room to move",
    "barely_feasible": "hard rows that leave a set of width 2^-10 ... 2^-40, or none",
    "infeasible": "hard rows that contradict each other, by 1/2 ... 2^-40 or plainly",
    "sawyer": "7-joint Sawyer: tool position, orientation, posture; limits; sigma 1e-1 ... 1e-13",
    "dual_arm": "two Sawyers, 14 joints: relative and absolute poses, limits",
    "humanoid": "Apptronik Apollo, 32 joints and floating base: five levels, limits",
    "metric": "least sqrt(x^T W x) with a metric W on the unknown: dense, diagonal, with dependent rows, within hard rows",
    "damped": "levels with a damping of their own, constant or by their error; near singularities; within hard rows",
    "torque": "Sawyer commanded by torques, with and without a contact: joint accelerations and contact forces as unknowns",
}


def families() -> dict[str, str]:
    """Every family and what it holds, in the order of the set."""
    return dict(_FAMILIES)


def names(family: str | None = None) -> tuple[str, ...]:
    """The names of all problems, "family/label", or of one family's; by family in the order of the set, then by label.

    Raises `UnknownNameError` when there is no such family.
    """
    if family is None:
        return tuple(name for one in _FAMILIES for name in _names(one))
    if family not in _FAMILIES:
        raise unknown_name("family of problems", family, _FAMILIES)
    return _names(family)


def path(name: str) -> pathlib.Path:
    """The file of the problem `name`. Raises `UnknownNameError` when the set has none of that name."""
    family = name.partition("/")[0]
    valid = _names(family) if family in _FAMILIES else ()
    if name not in valid:
        raise unknown_name("problem", name, valid or (f"{one}/..." for one in _FAMILIES))
    return DATA / f"{name}.npz"


def load(name: str) -> KnownProblem:
    """The problem `name` with its exact answer. Raises `UnknownNameError` when the set has none of that name."""
    return load_known(path(name))


@functools.cache
def _names(family: str) -> tuple[str, ...]:
    return tuple(sorted(f"{family}/{file.stem}" for file in (DATA / family).glob("*.npz")))
