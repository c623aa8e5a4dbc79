"""The judge of a stress test: the optimum of each sample, and how far each level of an answer is from it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.measure.reference import certified_start, exact_optimum, is_plain
from hqp_rp.compare.stress.levels import LevelScale, level_scales
from hqp_rp.compare.stress.levels import level_errors as equality_errors
from hqp_rp.compare.stress.plan import STEPS, Samples
from hqp_rp.core.certificate import certify
from hqp_rp.core.problem import FloatArray, Problem

RESOLVED = 1e-9
"""A double-precision optimum serves where its error is estimated below this; nearer answers count as equal."""

EXACT, DOUBLE, CERTIFICATE, NONE = "exact", "double", "certificate", "none"
REFERENCES = (EXACT, DOUBLE, CERTIFICATE, NONE)
"""How a row was judged: against the exact truth, against a double-precision optimum whose own error is estimated below
`RESOLVED`, by the certificate (problems with limits), or not at all."""

JUMP = 0.9
"""A jump: x changes by more than this share of itself between two samples of a path, a quarter of a decade apart."""
_EPS = float(np.finfo(np.float64).eps)

STEADY = 0.1
"""Between such samples the problem itself must not change by more than this share of itself."""


@dataclasses.dataclass(frozen=True, slots=True)
class References:
    """The optimum of each of C samples, and what judges the levels of equality problems.

    Attributes:
        x: (C, n) the optimum, nan where it is not known. method: (C,) index into `REFERENCES`.
        ambiguous: (C,) solvers of two opinions on the rank are right. sigma: (C,) distance from a singularity, see
            `LevelScale`.
        scales: one for each level; empty for problems with limits.
    """

    x: FloatArray
    method: NDArray[np.uint8]
    ambiguous: NDArray[np.bool_]
    sigma: FloatArray
    scales: tuple[LevelScale, ...]


def exact_every(problem: Problem) -> int:
    """One path (or sample) in so many is compared with the exact truth where a double-precision optimum does not serve.

    From what the truth costs: about 1 ms up to 12 unknowns, 5 ms at 14, 70 ms at 35; with limits 10 ms at 7. 0: none.
    """
    if is_plain(problem):
        return 1 if problem.n <= 12 else 4 if problem.n <= 20 else 32
    return 16 if problem.n <= 8 else 0


def references(samples: Samples, answers: Sequence[FloatArray] = ()) -> References:
    """The optima of the samples: exact or in double precision, as each sample's condition asks for.

    `answers`: (C, n) each, of the solvers. With limits the exact search starts from the first that is certified; a sample
    for which it takes too long has no exact optimum and is left to the certificate.
    """
    problems = samples.problems
    first = problems[0]
    count, n = len(problems), first.n
    x = np.full((count, n), np.nan)
    method = np.zeros(count, dtype=np.uint8)
    ambiguous = np.zeros(count, dtype=bool)
    sigma = samples.sigma.copy()
    scales, doubles, errors = level_scales(samples.tasks)
    unknown = ~np.isfinite(sigma)
    sigma[unknown] = np.min([scale.sigma for scale in scales], axis=0)[unknown]
    plain = all(is_plain(problem) for problem in problems)
    every = exact_every(first)
    method[:] = REFERENCES.index(NONE if plain else CERTIFICATE)
    if plain:
        known = errors <= RESOLVED
        x[known], method[known] = doubles[known], REFERENCES.index(DOUBLE)
    for i in np.flatnonzero(method != REFERENCES.index(DOUBLE)).tolist():
        number = samples.path[i] if samples.path[i] >= 0 else samples.number[i]
        if every and number % every == 0:
            start = certified_start(problems[i], (answer[i] for answer in answers))
            exact = exact_optimum(problems[i], start=start)
            if exact is None:
                continue
            ambiguous[i] = exact.ambiguous
            if exact.x is not None:
                x[i], method[i] = exact.x, REFERENCES.index(EXACT)
    return References(x, method, ambiguous, sigma, scales if plain else ())


def level_errors(problems: Sequence[Problem], found: References, x: FloatArray) -> FloatArray:
    """(C, p) relative error of each level of the answers x (C, n), nan where there is no answer.

    What of the level's residual v could be removed at no cost to the levels before it, and rounding does not explain, over
    `||A_k|| ||x|| + ||b_k||`, the unit in which solvers declare their tolerance. For equalities `||P v|| - noise ||v||`
    with P the projector onto `LevelScale.range`; for problems with limits by `certify`.
    """
    if found.scales:
        return equality_errors(problems, found.scales, x)
    errors = np.full((len(problems), problems[0].p), np.nan)
    for i, problem in enumerate(problems):
        if np.isfinite(x[i]).all():
            with np.errstate(all="ignore"):
                levels = certify(problem, x[i]).levels
            proven = [max(level.excess - level.uncertainty, 0.0) for level in levels]
            errors[i] = [part / level.scale if part else 0.0 for part, level in zip(proven, levels, strict=True)]
    return errors


def distances(found: References, x: FloatArray) -> FloatArray:
    """(C,) ||x - x*|| / (1 + ||x*||), nan where x or x* is not known."""
    with np.errstate(all="ignore"):
        apart = np.linalg.norm(x - found.x, axis=1) / (1.0 + np.linalg.norm(found.x, axis=1))
    return np.asarray(apart)


def along_paths(samples: Samples, x: FloatArray) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Lipschitz estimate (C,) between each sample of a path and the one before, whether x jumps, and where that is known.

    The estimate is ||x_i - x_(i-1)|| / ||q_i - q_(i-1)||, in 1/s; nan at the first sample of a path.
    """
    count = len(x)
    lipschitz = np.full(count, np.nan)
    jump, known = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    if not (samples.path >= 0).any():
        return lipschitz, jump, known
    rows = np.stack([np.hstack([problem.matrix, problem.lower[:, None]]) for problem in samples.problems])
    rows = np.where(np.isfinite(rows), rows, 0.0).reshape(count, -1)
    for first in range(0, count, STEPS):
        here = slice(first + 1, first + STEPS)
        before = slice(first, first + STEPS - 1)
        with np.errstate(all="ignore"):
            change = np.linalg.norm(x[here] - x[before], axis=1)
            size = np.maximum(np.linalg.norm(x[here], axis=1), np.linalg.norm(x[before], axis=1))
            lipschitz[here] = change / np.linalg.norm(samples.q[here] - samples.q[before], axis=1)
            steady = np.linalg.norm(rows[here] - rows[before], axis=1) <= STEADY * np.linalg.norm(rows[here], axis=1)
            known[here] = steady & np.isfinite(change) & (size > 0.0)
            jump[here] = known[here] & (change > JUMP * size)
    return lipschitz, jump, known
