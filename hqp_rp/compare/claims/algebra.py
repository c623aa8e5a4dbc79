"""What needs no simulation: theorems of reverse priority, each with its proof and a check on random problems."""

from __future__ import annotations

import dataclasses
import functools
import itertools

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.robot.arms import sawyer

say = Sentences(__file__)

DRAWS = 1000
ROUNDING = 1e-9
"""What passes for rounding, relative to the answer."""
_WELL_AWAY = 0.02  # least singular value of the stacked Jacobian


@dataclasses.dataclass(frozen=True, slots=True)
class Theorem:
    """Attributes: statement and proof, in words; largest: the largest deviation from it over `DRAWS` random problems."""

    statement: str
    proof: str
    largest: float

    @property
    def checked(self) -> bool:
        """Whether the check found nothing beyond rounding."""
        return self.largest <= ROUNDING

    @property
    def told(self) -> str:
        """Statement, proof and check, in sentences."""
        checked = say("checked", draws=DRAWS, largest=self.largest)
        return f"Theorem: {self.statement}. {self.proof} {checked}"


@functools.cache
def first_level_kept() -> Theorem:
    """J_1 x = v_1, whatever the other levels ask for."""
    reverse = get_solver("reverse_priority")
    worst = 0.0
    for J, v, cuts in _random_stacks(full=False):
        x = _answer(reverse, J, v, cuts)
        worst = max(worst, _size(J[: cuts[0]] @ x - v[: cuts[0]]) / max(_size(x), 1.0))
    return Theorem(say("first_level_kept"), say("first_level_kept_proof"), worst)


@functools.cache
def same_on_two_levels() -> Theorem:
    """With two levels, reverse priority is null-space priority."""
    reverse, null_space = get_solver("reverse_priority"), get_solver("null_space")
    worst = 0.0
    for J, v, cuts in _random_stacks(full=False):
        a, b = (_answer(solver, J, v, cuts[:1]) for solver in (reverse, null_space))
        worst = max(worst, _size(a - b) / _size(b))
    return Theorem(say("same_on_two_levels"), say("same_on_two_levels_proof"), worst)


@functools.cache
def same_as_pseudo_inverse() -> Theorem:
    """Where all rows together have full rank, reverse priority is the pseudo-inverse."""
    solvers = [get_solver(name) for name in ("reverse_priority", "null_space", "pseudo_inverse")]
    worst = 0.0
    for J, v, cuts in _random_stacks(full=True):
        a, *others = (_answer(solver, J, v, cuts) for solver in solvers)
        worst = max([worst, *(_size(a - b) / _size(b) for b in others)])
    return Theorem(say("same_as_pseudo_inverse"), say("same_as_pseudo_inverse_proof"), worst)


def third_disturbs_second() -> tuple[float, float]:
    """A counterexample to (53): J_2 x of reverse priority and of null-space priority, where v_2 = 0 can be met exactly.

    J_1 = (1, 1), v_1 = 1; J_2 = (1, 0), v_2 = 0; J_3 = (0, 1), v_3 = 0.
    """
    J = ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
    problem = Problem([Level.equality([row], [v]) for row, v in zip(J, (1.0, 0.0, 0.0), strict=True)])
    reverse, null_space = (get_solver(name).solve(problem).require()[0] for name in ("reverse_priority", "null_space"))
    return float(reverse), float(null_space)


def _answer(solver: Solver, J: FloatArray, v: FloatArray, cuts: tuple[int, ...]) -> FloatArray:
    edges = (0, *cuts, len(J))
    levels = [Level.equality(J[a:b], v[a:b]) for a, b in itertools.pairwise(edges)]
    return solver.solve(Problem(levels)).require()


def _random_stacks(*, full: bool) -> list[tuple[FloatArray, FloatArray, tuple[int, ...]]]:
    """Tool Jacobians of the arm at random postures, with random rates; levels x; the rest, or x; y, z; rotation."""
    arm, rng = sawyer(), np.random.default_rng(0)
    found: list[tuple[FloatArray, FloatArray, tuple[int, ...]]] = []
    while len(found) < DRAWS:
        J = arm.jacobian(rng.uniform(arm.lower, arm.upper), "tool")
        v = rng.normal(size=6)
        cuts = (1,) if len(found) % 2 else (1, 3)
        if np.linalg.svd(J, compute_uv=False)[-1] >= _WELL_AWAY:
            if not full:
                J = np.vstack((J, J[1:] + 1e-3 * rng.normal(size=(5, 7))))  # lower rows that contradict each other
                v = rng.normal(size=11)
            found.append((J, v, cuts))
    return found


def _size(vector: FloatArray) -> float:
    return float(np.linalg.norm(vector))
