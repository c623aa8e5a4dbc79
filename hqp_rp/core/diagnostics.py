"""What an answer does to each level, judged from (problem, x) alone: violation, residual, rank, singularity."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.tolerances import ACTIVE

ACTIVE_TOLERANCE = ACTIVE
"""A row counts as active at x within this times `||a_i|| ||x|| + |bound_i|` of its bound."""


class Singularity(enum.Enum):
    """Why a level loses rank. The value is the sentence that reports print."""

    NONE = "The level keeps full rank beside the levels before it."
    PARTLY_USED_UP = (
        "The levels before it, and hard equalities, leave less freedom than the level has rows; it gets all that is left (no "
        "singularity)."
    )
    LIMITED = (
        "Active limits, hard inequality rows or those of the levels before it, use up freedom that the level needs; beside "
        "equalities alone it keeps its rank (no singularity)."
    )
    KINEMATIC = "The level's own rows are dependent (kinematic singularity)."
    ALGORITHMIC = (
        "The level's rows depend on rows of the levels before it, or on hard equalities (algorithmic singularity)."
    )
    BOTH = "The level's own rows are dependent, and they depend on rows of the levels before it, or on hard equalities."

    @classmethod
    def of(cls, rank: int, own_rank: int, full: int, free: int) -> Singularity:
        """The kind: `rank` beside the earlier levels, which leave `free` dimensions, `own_rank` alone, `full` = min(m, n)."""
        loses = rank < min(own_rank, free)
        if own_rank < full:
            return cls.BOTH if loses else cls.KINEMATIC
        if loses:
            return cls.ALGORITHMIC
        return cls.PARTLY_USED_UP if rank < own_rank else cls.NONE

    def beside_limits(self, alone: Singularity) -> Singularity:
        """The kind of a level beside all rows before it, `self`, where it is `alone` beside the equalities among them."""
        sound = alone in (Singularity.NONE, Singularity.PARTLY_USED_UP)
        if self is Singularity.ALGORITHMIC and sound:
            return Singularity.LIMITED
        if self is Singularity.PARTLY_USED_UP and alone is Singularity.NONE:
            return Singularity.LIMITED
        return alone if self is Singularity.BOTH or alone is Singularity.ALGORITHMIC else self


@dataclasses.dataclass(frozen=True, slots=True)
class Spectrum:
    """Ranks of one level's rows A_k (m, n), alone and in the null space Z (n, d) of the rows before them.

    Attributes:
        rank: rank of A_k Z by the rank rule: singular values > rank_tolerance * ||A_k||_2 are counted.
        own_rank: rank of A_k by the same rule.
        sigma_min: the min(m, d)-th singular value of A_k Z, in the unit of A_k; 0 when d = 0, inf when m = 0.
        singularity: `KINEMATIC` when own_rank < min(m, n); `ALGORITHMIC` when rank < min(own_rank, d), which is equation (12),
            rank J_1 + rank J_2 > rank [J_1; J_2], where both would fit into the n dimensions; `BOTH` when both hold.
            `PARTLY_USED_UP` where the rows do not fit by their number alone, own_rank > d, and use up all d: a posture below
            other levels. `LIMITED` where a loss of either kind is due to limits: without the inequality rows, hard ones and
            those of earlier levels, the equalities leave the level all rank, or all that they leave. A hard row with
            lower == upper is an equality, a joint that its limits leave one velocity included.
    """

    rank: int
    own_rank: int
    sigma_min: float
    singularity: Singularity


@dataclasses.dataclass(frozen=True, slots=True)
class LevelReport:
    """One level, judged at x.

    Attributes:
        name: the level's name.
        violation: (m,) signed, in the unit of the rows: `a_i x - upper_i` where above, `a_i x - lower_i` where below,
            else 0. For an equality, `a_i x - b_i`.
        residual: ||violation||_2.
        rank, own_rank, sigma_min, singularity: as in `Spectrum`, of the level's equality rows and of those inequality
            rows that are active or violated at x: a row that x keeps away from binds nothing.
    """

    name: str
    violation: FloatArray
    residual: float
    rank: int
    own_rank: int
    sigma_min: float
    singularity: Singularity


def diagnose(
    problem: Problem,
    x: ArrayLike,
    rank_tolerance: float = RANK_TOLERANCE,
    *,
    active_tolerance: float = ACTIVE_TOLERANCE,
) -> tuple[LevelReport, ...]:
    """Judge x level by level: violation, residual, rank in the null space of the earlier levels, kind of singularity.

    The rows that take freedom from later levels are the equalities and the inequality rows that are active or violated
    at x; active hard rows come before level 1. Every level is normalised by a power of two first, so that its scale
    (1e-150 or 1e150) matters nowhere.

    Args:
        problem: the problem that x answers.
        x: (n,) finite.
        rank_tolerance: a singular value of A_k Z counts as zero when <= rank_tolerance * ||A_k||_2, >= 0.
        active_tolerance: see `ACTIVE_TOLERANCE`.

    With a metric, ranks and singular values are those of A_k R^-1 (`hqp_rp.core.metric`).

    Raises:
        ProblemError: x is not n finite numbers.
        SettingError: a tolerance that is negative or not finite.

    Source: equation (12) of the paper; the rank rule is the library's own.
    """
    point = checked_point(x, problem.n)
    require_tolerance("rank_tolerance", rank_tolerance)
    require_tolerance("active_tolerance", active_tolerance)
    violations = [violation(level, point) for level in problem.levels]
    equalities = None
    if problem.is_equality:
        chosen = [level.A for level in problem.levels]
    else:
        bound = [binding(level, point, active_tolerance) for level in problem.levels]
        chosen = [level.A[rows] for level, rows in zip(problem.levels, bound, strict=True)]
        equalities = [(level.lower == level.upper)[rows] for level, rows in zip(problem.levels, bound, strict=True)]
    hard, first, fixed = problem.hard, None, None
    if hard is not None and hard.m:
        bound_hard = binding(hard, point, active_tolerance)
        first, fixed = hard.A[bound_hard], (hard.lower == hard.upper)[bound_hard]
    ranks = _spectra(*_in_metric(problem, chosen, first), rank_tolerance, equalities, fixed)
    return tuple(
        LevelReport(
            name=name,
            violation=error,
            residual=norm(error),
            rank=spectrum.rank,
            own_rank=spectrum.own_rank,
            sigma_min=spectrum.sigma_min,
            singularity=spectrum.singularity,
        )
        for name, error, spectrum in zip(problem.names, violations, ranks, strict=True)
    )


def spectra(problem: Problem, rank_tolerance: float = RANK_TOLERANCE) -> tuple[Spectrum, ...]:
    """Ranks, sigma_min and kind of singularity of every level, without an x: every row counts as an equality.

    Hard rows are left out. Raises `SettingError` when rank_tolerance is negative or not finite.
    """
    require_tolerance("rank_tolerance", rank_tolerance)
    return tuple(_spectra(*_in_metric(problem, [level.A for level in problem.levels], None), rank_tolerance))


def _in_metric(
    problem: Problem, chosen: list[FloatArray], first: FloatArray | None
) -> tuple[list[tuple[FloatArray, FloatArray]], FloatArray | None]:
    """(A_k, its chosen rows) of each level and the first rows, as rows on y where the problem has a metric."""
    pairs = [(level.A, rows) for level, rows in zip(problem.levels, chosen, strict=True)]
    if problem.metric is None:
        return pairs, first
    from hqp_rp.core.metric import in_metric

    inverse = in_metric(problem).inverse
    turned = []
    for A, rows in pairs:
        whole = A @ inverse
        turned.append((whole, whole if len(rows) == len(A) else rows @ inverse))
    return turned, None if first is None else first @ inverse


def _spectra(
    levels: Iterable[tuple[FloatArray, FloatArray]],
    first: FloatArray | None,
    rank_tolerance: float,
    equalities: Sequence[NDArray[np.bool_]] | None = None,
    fixed_first: NDArray[np.bool_] | None = None,
) -> list[Spectrum]:
    """`levels`: for each, the whole A_k, whose norm the rank rule speaks of, and the rows that bind; `equalities`: which of
    these are equalities, None for all; `fixed_first`: which of the `first` rows, hard ones, are."""
    Z: FloatArray | None = None
    # The same without what limits take, where there are any.
    limited = equalities is not None and not all(own.all() for own in equalities)
    without: FloatArray | None = None
    if first is not None and len(first):
        Z = remaining(first, None, rank_tolerance)[1]
        limited = limited or fixed_first is None or not fixed_first.all()
        if limited and fixed_first is not None:
            scaled, _ = normalised(first)
            without = _null_space(scaled[fixed_first], None, rank_tolerance * two_norm(scaled))
    found = []
    for k, (A, rows) in enumerate(levels):
        m, n = rows.shape
        if m == 0:
            found.append(Spectrum(0, 0, math.inf, Singularity.NONE))
            continue
        scaled, exponent = normalised(rows)
        projected = scaled if Z is None else scaled @ Z
        _, sigma, Vt = np.linalg.svd(projected)
        own = sigma if Z is None else np.linalg.svd(scaled, compute_uv=False)
        cut = rank_tolerance * (float(own[0]) if rows is A else two_norm(np.ldexp(A, -exponent)))
        own_rank = int((own > cut).sum())
        rank, free = min(int((sigma > cut).sum()), own_rank), n if Z is None else Z.shape[1]
        sigma_min = float(sigma[-1]) if len(sigma) else 0.0
        Z = Vt[rank:].T if Z is None else Z @ Vt[rank:].T
        kind = Singularity.of(rank, own_rank, min(m, n), free)
        if limited:
            beside, free = min(_rank(scaled, without, cut), own_rank), n if without is None else without.shape[1]
            kind = kind.beside_limits(Singularity.of(beside, own_rank, min(m, n), free))
            fixed = scaled if equalities is None else scaled[equalities[k]]
            without = _null_space(fixed, without, cut)
        found.append(Spectrum(rank, own_rank, times_power(sigma_min, exponent), kind))
    return found


def _rank(rows: FloatArray, Z: FloatArray | None, cut: float) -> int:
    """How many singular values of rows Z are beyond `cut`; Z None is the identity."""
    B = rows if Z is None else rows @ Z
    return int((np.linalg.svd(B, compute_uv=False) > cut).sum()) if min(B.shape) else 0


def _null_space(rows: FloatArray, Z: FloatArray | None, cut: float) -> FloatArray | None:
    """An orthonormal basis of the null space of the rows within range(Z), singular values up to `cut` counting as zero."""
    B = rows if Z is None else rows @ Z
    if not min(B.shape):
        return Z
    _, sigma, Vt = np.linalg.svd(B)
    rest: FloatArray = Vt[int((sigma > cut).sum()) :].T
    return rest if Z is None else Z @ rest


def remaining(A: FloatArray, Z: FloatArray | None, rank_tolerance: float) -> tuple[int, FloatArray]:
    """Rank of A Z by the rank rule, and an orthonormal basis (n, d - rank) of the null space of A within range(Z)."""
    scaled, _ = normalised(A)
    cut = rank_tolerance * two_norm(scaled)
    B = scaled if Z is None else scaled @ Z
    if min(B.shape) == 0:
        return 0, np.eye(A.shape[1]) if Z is None else Z
    _, sigma, Vt = np.linalg.svd(B)
    rank = int((sigma > cut).sum())
    return rank, Vt[rank:].T if Z is None else Z @ Vt[rank:].T


def violation(level: Level, x: FloatArray) -> FloatArray:
    """(m,) signed distance of `A x` from [lower, upper]: positive above, negative below, 0 inside."""
    with np.errstate(over="ignore", invalid="ignore"):
        value = level.A @ x
        return np.where(value > level.upper, value - level.upper, np.minimum(value - level.lower, 0.0))


def binding(level: Level, x: FloatArray, active_tolerance: float) -> NDArray[np.bool_]:
    """(m,) bool: the rows that are equalities, violated, or within the active tolerance of a bound at x."""
    with np.errstate(over="ignore"):
        value = level.A @ x
        reach = row_norms(level.A) * norm(x)
        above = value >= level.upper - active_tolerance * (reach + np.abs(_finite(level.upper)))
        below = value <= level.lower + active_tolerance * (reach + np.abs(_finite(level.lower)))
    return np.asarray(above | below | (level.lower == level.upper))


def normalised(A: FloatArray) -> tuple[FloatArray, int]:
    """`A` times 2**-e, its largest entry in [0.5, 1), and e (0 for a matrix of zeros): no rounding, no overflow."""
    largest = float(np.abs(A).max(initial=0.0))
    exponent = math.frexp(largest)[1]
    return (np.ldexp(A, -exponent) if exponent else A), exponent


def norm(v: FloatArray) -> float:
    """||v||_2 without overflow or underflow."""
    largest = float(np.abs(v).max(initial=0.0))
    if largest == 0.0 or not math.isfinite(largest):
        return largest
    exponent = math.frexp(largest)[1]
    w = np.ldexp(v, -exponent)
    return times_power(math.sqrt(float(w @ w)), exponent)


def row_norms(A: FloatArray) -> FloatArray:
    """(m,) ||a_i||_2 of every row, without overflow or underflow of a level's common scale."""
    scaled, exponent = normalised(A)
    norms: FloatArray = np.ldexp(np.sqrt(np.einsum("ij,ij->i", scaled, scaled)), exponent)
    return norms


class OneSided(NamedTuple):
    """Rows `G x <= h` of length one, upper bounds first: row i is row `rows[i]` at `sides[i]`, +1 upper, -1 lower."""

    G: FloatArray
    h: FloatArray
    rows: NDArray[np.int64]
    sides: NDArray[np.int64]


def one_sided(A: FloatArray, lower: FloatArray, upper: FloatArray) -> OneSided:
    """What `lower <= A x <= upper` says, one bound a row; rows of zeros and infinite bounds are left out."""
    lengths = row_norms(A)
    rows = np.flatnonzero(lengths > 0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        unit = A[rows] / lengths[rows, None]
        h = np.concatenate((upper[rows] / lengths[rows], -lower[rows] / lengths[rows]))
    finite = np.isfinite(h)
    sides = np.repeat(np.array([1, -1], dtype=np.int64), len(rows))
    return OneSided(
        np.concatenate((unit, -unit))[finite], h[finite], np.concatenate((rows, rows))[finite], sides[finite]
    )


def two_norm(A: FloatArray) -> float:
    """||A||_2, the largest singular value; 0 for an empty matrix."""
    return float(np.linalg.svd(A, compute_uv=False)[0]) if min(A.shape) else 0.0


def checked_point(x: ArrayLike, n: int, what: str = "x") -> FloatArray:
    """`x` as a float64 vector (n,). Raises `ProblemError` when it is not n finite numbers."""
    try:
        point = np.asarray(x, dtype=np.float64)
    except (TypeError, ValueError):
        raise ProblemError(f"{what} is {x!r}; it must be {n} finite numbers, one for each unknown.") from None
    if point.shape != (n,) or not np.isfinite(point).all():
        raise ProblemError(f"{what} must be {n} finite numbers, one for each unknown; got {point.tolist()}.")
    return point


def require_tolerance(name: str, value: float) -> None:
    """Raises `SettingError` unless `value` is a finite number >= 0."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value < 0:
        raise SettingError(f"{name} is {value!r}; it must be a finite number >= 0.")


def times_power(value: float, exponent: int) -> float:
    """value * 2**exponent, infinite where that overflows."""
    try:
        return math.ldexp(value, exponent)
    except OverflowError:
        return math.inf


def _finite(bound: FloatArray) -> FloatArray:
    return np.where(np.isfinite(bound), bound, 0.0)
