"""Intermediate desired values (Lee, Mansard and Park 2012): levels that come and go without a jump."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, TypeAlias

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.shares import checked_shares
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, require_rank_tolerance
from hqp_rp.core.variant import EXACT, LineUp, Variant

Activation: TypeAlias = float | tuple[float, ...]
_MOST = 10


@dataclasses.dataclass(frozen=True, kw_only=True)
class IntermediateDesiredValue(Solver):
    """Null-space priority in which a level that is present to a degree h asks for a value between its own and nobody's.

    ::

        b'_i(S) = h_i b_i + (1 - h_i) A_i x(S \\ {i}),    x(S): null-space priority of the levels in S with b'_i(S)

    S all levels with h_i > 0. At h_i = 1 it is the level's own value, at h_i = 0 what it would have without it, so that x is
    continuous in h where no rank changes. Levels in transition, 0 < h_i < 1, cost 2^t solves for t of them.

    `hqp_rp.control.blend` gives the same with one level in transition, and costs t + 1 solves for more of them.

    Args:
        activation: h, one number in [0, 1] for all levels, or one for each.
        rank_tolerance: as of `null_space`.

    Source: Lee, Mansard and Park 2012. The text was not at hand: for one level in transition the formula is that of its
        citations; for more it is continued as above.
    """

    activation: Activation = 1.0
    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "intermediate_desired_value"
    summary: ClassVar[str] = "null-space priority with levels that are present to a degree"
    source: ClassVar[str] = "Lee, Mansard and Park 2012"
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "intermediate desired value",
                {},
                EXACT,
                "null-space priority with levels present to a degree; here all present",
            ),
        ),
        place=190,
        only_with="transitions",
    )

    def __post_init__(self) -> None:
        meant = "a number in [0, 1], or one for each level"
        object.__setattr__(self, "activation", checked_shares(self.activation, "activation", "degree", meant, depth=1))
        require_rank_tolerance(self.rank_tolerance)

    def refuses(self, problem: Problem) -> str | None:
        """Hard and two-sided rows, damped levels, a number of levels that activation is not for, and too many in transition."""
        if isinstance(self.activation, tuple) and len(self.activation) != problem.p:
            return f"activation is for {len(self.activation)} levels and the problem has {problem.p}."
        moving = sum(0.0 < h < 1.0 for h in self._degrees(problem))
        if moving > _MOST:
            return (
                f"{moving} levels are in transition, which takes 2^{moving} solves; have at most {_MOST}, or use "
                "hqp_rp.control.blend."
            )
        return super().refuses(problem)

    def is_lexicographic(self, problem: Problem) -> bool:
        return problem.is_equality and all(h == 1.0 for h in self._degrees(problem))

    def _degrees(self, problem: Problem) -> tuple[float, ...]:
        return self.activation if isinstance(self.activation, tuple) else (float(self.activation),) * problem.p

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The answer of the levels present to their degrees; see `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        found = _Transition(problem, self._degrees(problem), secondary, self.rank_tolerance)
        present = frozenset(i for i, h in enumerate(found.degrees) if h > 0.0)
        try:
            x = found.answer(present)
        except FloatingPointError:
            message = "An intermediate result overflowed; scale the rows or the right-hand sides."
            return Solution(problem, None, Status.NOT_FINITE, 0, message, secondary)
        return Solution(problem, x, secondary=secondary)


class _Transition:
    """The answers of all sets of levels that one problem needs, each once."""

    def __init__(
        self, problem: Problem, degrees: tuple[float, ...], secondary: FloatArray | None, tolerance: float
    ) -> None:
        self.problem, self.degrees, self.secondary = problem, degrees, secondary
        self.cascade = _native.null_space(tolerance, 0, 0.0, 0.0)
        self.known: dict[frozenset[int], FloatArray] = {}

    def answer(self, present: frozenset[int]) -> FloatArray:
        """x(S) (n,). Raises `FloatingPointError` where it is not finite."""
        if not present:
            return np.zeros(self.problem.n) if self.secondary is None else self.secondary.copy()
        if present not in self.known:
            matrix, rhs, _, offsets = self.problem.stacked
            levels = sorted(present)
            rows = [slice(int(offsets[i]), int(offsets[i + 1])) for i in levels]
            values = []
            for i, own in zip(levels, rows, strict=True):
                h = self.degrees[i]
                value = rhs[own]
                if h < 1.0:
                    value = h * value + (1.0 - h) * (matrix[own] @ self.answer(present - {i}))
                values.append(value)
            ends = np.cumsum([0, *(own.stop - own.start for own in rows)]).astype(np.int64)
            A = np.ascontiguousarray(np.concatenate([matrix[own] for own in rows]))
            self.known[present] = self._cascade(A, np.concatenate(values), ends)
        return self.known[present]

    def _cascade(self, A: FloatArray, b: FloatArray, offsets: IntArray) -> FloatArray:
        found = self.cascade.solve(Problem.from_stacked(A, b, b, offsets, check=False), self.secondary)
        if found is None or found.x is None:
            raise FloatingPointError
        x: FloatArray = found.x
        return x
