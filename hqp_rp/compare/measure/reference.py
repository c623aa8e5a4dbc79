"""The optimum that every answer is measured against: the exact one, computed once for each distinct problem."""

from __future__ import annotations

import collections
import dataclasses
import hashlib
from collections.abc import Iterable

import numpy as np

from hqp_rp.core.certificate import certify
from hqp_rp.core.errors import WorkLimitError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth import Truth, truth

EXACT_UNKNOWNS = 12
EXACT_UNKNOWNS_TWO_SIDED = 8
"""Up to this many unknowns the truth is computed at every step (about 1 ms for equalities on 7 unknowns)."""

REFUTED = 1e-6
"""Relative excess at which the certificate refutes an exact optimum: far above rounding."""

_KEPT = 4096


@dataclasses.dataclass(frozen=True, slots=True)
class Reference:
    """The optimum of one problem.

    Attributes:
        x: (n,) the lexicographic optimum of least norm, by the library's rank rule; None where it was not computed.
        residuals: (p,) residual of each level there, nan where it was not computed.
        method: how it was computed, as reports print it.
        ambiguous: exact ranks and the library's rank rule differ, or nearly so, or the certificate, which follows the rule,
            refutes x: solvers of both opinions are right.
    """

    x: FloatArray | None
    residuals: FloatArray
    method: str
    ambiguous: bool


NOT_COMPUTED = "not computed (too many unknowns): judged by the certificate alone"


TOO_MUCH_WORK = "not computed (the exact search took too long): judged by the certificate alone"


def reference(problem: Problem, secondary: FloatArray | None = None, start: FloatArray | None = None) -> Reference:
    """The optimum of `problem` nearest to `secondary`; computed once for each distinct problem in a process.

    `start` (n,), a certified answer, is where the search with inequality or hard rows begins. A search that took too long
    is made again for a later call with a start.
    """
    limit = EXACT_UNKNOWNS if is_plain(problem) else EXACT_UNKNOWNS_TWO_SIDED
    if problem.n > limit:
        return _without_exact(problem, NOT_COMPUTED)
    key = _key(problem, secondary)
    known = _cache.get(key)
    if known is None or (known.method == TOO_MUCH_WORK and start is not None):
        if known is None and len(_cache) >= _KEPT:
            _cache.popitem(last=False)
        exact = exact_optimum(problem, secondary, start)
        if exact is None:
            known = _without_exact(problem, TOO_MUCH_WORK)
        else:
            # With inequality rows the truth's ranks are exact: a row that is dependent but for rounding then takes freedom
            # that the rank rule, and every solver, leaves to later levels. The certificate tells.
            refuted = exact.x is not None and not certify(problem, exact.x, secondary, REFUTED).ok
            known = Reference(exact.x, exact.residuals, exact.method, exact.ambiguous or refuted)
        _cache[key] = known
    return known


def exact_optimum(
    problem: Problem, secondary: FloatArray | None = None, start: FloatArray | None = None
) -> Truth | None:
    """`truth` by the library's rank rule, or None where its search with inequality rows would take too long."""
    try:
        return truth(problem, secondary, rank_rule=RANK_TOLERANCE, start=start)
    except WorkLimitError:
        return None


def certified_start(problem: Problem, answers: Iterable[FloatArray]) -> FloatArray | None:
    """The first of `answers` (n,) that the certificate accepts to `REFUTED`; None where none is, or none is needed."""
    if is_plain(problem):
        return None
    with np.errstate(all="ignore"):
        return next((x for x in answers if np.isfinite(x).all() and certify(problem, x, tolerance=REFUTED).ok), None)


def is_plain(problem: Problem) -> bool:
    """Whether there are equalities only, and no hard rows."""
    return problem.is_equality and problem.hard is None


def _without_exact(problem: Problem, method: str) -> Reference:
    return Reference(None, np.full(problem.p, np.nan), method, False)


_cache: collections.OrderedDict[bytes, Reference] = collections.OrderedDict()


def _key(problem: Problem, secondary: FloatArray | None) -> bytes:
    arrays = [problem.matrix, problem.lower, problem.upper, problem.offsets]
    if problem.hard is not None:
        arrays += [problem.hard.A, problem.hard.lower, problem.hard.upper]
    if secondary is not None:
        arrays.append(secondary)
    together = hashlib.sha256()
    for array in arrays:
        together.update(repr(array.shape).encode())
        together.update(array.tobytes())
    return together.digest()
