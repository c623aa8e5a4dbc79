"""The rank rule's answer of a problem with inequality or hard rows, in multi-precision.

Exact arithmetic takes rows that are zero but for the rounding of their coefficients at their word: within limits, such a
row can hold an unknown at a bound. The rank rule leaves that unknown to the levels after it. Which rows bind is guessed in
double precision, the binding rows are solved as equalities by the rule, and the certificate decides whether that answers
the problem itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.certificate import certify
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.metric import in_metric
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.truth import SAME, Truth, truth
from hqp_rp.core.truth_rows import guessed, levels_of

_ANSWERED = (0, 1)  # positions in `Status` of an answer, verified or not


def rule_answer(
    problem: Problem, secondary: FloatArray, tolerance: float, exact: FloatArray, start: FloatArray | None
) -> Truth | None:
    """The first answer by the rank rule that the certificate accepts; None when none is known.

    Its residuals and ranks are those of the levels, without the hard rows. The rows that bind at `start` (n,), at the exact
    answer (n,) and where a double-precision active-set search by the rule ends are tried in turn. Where the certificate
    refuses all (it takes a gain below 1e-5 for none under limits), but the search agrees with the exact answer, that is it.
    """
    levels = levels_of(problem)
    answers: dict[str, Truth] = {}
    answer = None
    for guess in _guesses(problem, secondary, tolerance, exact, start):
        sides = [guessed(level, guess) for level in levels]
        answer = answers.get(repr(sides))
        if answer is None:
            rows = [
                Level.equality(level.A[chosen], np.where(above, level.upper[chosen], level.lower[chosen]))
                for level, (chosen, above) in zip(levels, sides, strict=True)
            ]
            answer = truth(Problem(rows, metric=problem.metric), secondary, tolerance)
            answer = dataclasses.replace(answer, residuals=answer.residuals[1:], ranks=answer.ranks[1:])
            answers[repr(sides)] = answer
            if _accepted(problem, answer, secondary, tolerance):
                return answer
    same = answer is not None and answer.x is not None and norm(answer.x - exact) <= SAME * (1.0 + norm(exact))
    return answer if same else None


def _accepted(problem: Problem, answer: Truth, secondary: FloatArray, tolerance: float) -> bool:
    if answer.x is None or not np.isfinite(answer.x).all():
        return False
    return certify(problem, answer.x, secondary, rank_tolerance=tolerance).ok


def _guesses(
    problem: Problem, secondary: FloatArray, tolerance: float, exact: FloatArray, start: FloatArray | None
) -> Iterator[FloatArray]:
    if start is not None:
        yield start
    yield exact
    searched = searched_in_double_precision(problem, secondary, tolerance)
    if searched is not None:
        yield searched


def searched_in_double_precision(problem: Problem, secondary: FloatArray, tolerance: float) -> FloatArray | None:
    """Where the native active-set search ends; None where it does not."""
    if problem.metric is not None:
        turned = in_metric(problem)
        there = searched_in_double_precision(turned.problem, turned.root @ secondary, tolerance)
        return turned.back(there)
    levels = levels_of(problem)
    hard, rest = levels[0], levels[1:]
    asked = Problem(rest, hard=hard if hard.m else None) if rest else Problem([hard])
    x, rows = np.zeros(problem.n), asked.hard_rows + asked.rows
    side = np.zeros(rows, np.int64)
    code, _ = _native.active_set(asked, secondary, tolerance, 200 + 10 * rows, False, x, side)
    return x if code in _ANSWERED and np.isfinite(x).all() else None
