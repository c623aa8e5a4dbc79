"""Lexicographic least squares in multi-precision with a rank rule: truncated singular values, decided far below rounding.

No singular vector is computed to full precision: the truncated answer depends only on the split between the singular
directions that are kept and those that are cut, and that split is refined from a double-precision SVD by a fixed-point
iteration whose error shrinks by (sigma_cut / sigma_kept)^2 each time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from flint import arb, arb_mat, ctx

from hqp_rp.core.problem import FloatArray
from hqp_rp.core.truth_exact import integers, metric_rows

BORDERLINE = 2.0
"""A singular value within this factor of the rank rule's threshold is one that double precision may decide either way."""


@dataclasses.dataclass(frozen=True, slots=True)
class RuleAnswer:
    """x (n,) and residuals (p,) rounded to float64; ranks (p,) by the rule; whether a rank was borderline; bits used."""

    x: FloatArray
    residuals: tuple[float, ...]
    ranks: tuple[int, ...]
    borderline: bool
    bits: int


def solve_by_rule(
    levels: Sequence[tuple[FloatArray, FloatArray]],
    secondary: FloatArray,
    tolerance: float,
    metric: FloatArray | None = None,
) -> RuleAnswer:
    """Solve `A_k x = b_k`, k = 1 ... p, where singular values of A_k Z <= tolerance * ||A_k||_2 are cut.

    Works with 192 + 2 (p + 1) log2(1 / tolerance) bits: each level can lose twice the digits of 1 / tolerance, and 192
    bits remain for the answer, relative to ||x||. With a metric W = R^T R (n, n) it is solved in y = R x, and A_k
    there is A_k R^-1.
    """
    bits = 192 + 2 * (len(levels) + 1) * math.ceil(max(1.0, -math.log2(tolerance)))
    n = len(secondary)
    with ctx.workprec(bits):
        x, Z = arb_mat(n, 1), _identity(n)
        loaded = [_loaded(A, b) for A, b in levels]
        sizes = [_norm_of(A) if len(A) else 0.0 for A, _ in levels]
        R = None if metric is None else _root(metric, bits)
        inverse = None if R is None else R.inv().mid()
        if inverse is not None:
            loaded = [((matrix * inverse).mid() if matrix.nrows() else matrix, target) for matrix, target in loaded]
            sizes = [_norm_of_arb(matrix) for matrix, _ in loaded]
        ranks, borderline = [], False
        for size, (matrix, target) in zip(sizes, loaded, strict=True):
            if Z.ncols() == 0 or matrix.nrows() == 0:
                ranks.append(0)
                continue
            kept, rest, close = _split(matrix * Z, tolerance * size, bits)
            borderline |= close
            ranks.append(kept.ncols())
            if kept.ncols():
                basis = (Z * kept).mid()
                M = (matrix * basis).mid()
                step = (M.transpose() * M).mid().solve(M.transpose() * (target - matrix * x)).mid()
                x = (x + basis * step).mid()
                Z = (Z * rest).mid()
        if Z.ncols():
            free = arb_mat(n, 1, [arb(v) for v in secondary.tolist()])
            free = free if R is None else R * free
            x = (x + Z * (Z.transpose() * (free - x))).mid()
        residuals = tuple(
            _residual(matrix, x, target, _exponent(A)) for (A, _), (matrix, target) in zip(levels, loaded, strict=True)
        )
        if inverse is not None:
            x = (inverse * x).mid()
        answer = np.array([float(e) for e in x.entries()])
    return RuleAnswer(answer, residuals, tuple(ranks), borderline, bits)


def _split(B: arb_mat, threshold: float, bits: int) -> tuple[arb_mat, arb_mat, bool]:
    """Bases (d, r) and (d, d - r), the second orthonormal, of the right singular directions of B above the threshold and
    of the others; and whether a singular value is within `BORDERLINE` of the threshold."""
    B = B.mid()
    d = B.ncols()
    start = np.linalg.svd(np.array([[float(e) for e in row] for row in B.table()]).reshape(B.nrows(), d))[2].T
    V = _orthonormal(arb_mat(d, d, [arb(e) for e in start.ravel().tolist()]), bits)
    C = (B * V).mid()
    G = (C.transpose() * C).mid().table()
    r, *around = (_above(G, threshold * f) for f in (1.0, BORDERLINE, 1.0 / BORDERLINE))
    close = around[0] != around[1]
    if r in (0, d):
        empty = arb_mat(d, 0)
        return (V, empty, close) if r else (empty, V, close)
    G11, G12 = arb_mat([row[:r] for row in G[:r]]), arb_mat([row[r:] for row in G[:r]])
    G21, G22 = arb_mat([row[:r] for row in G[r:]]), arb_mat([row[r:] for row in G[r:]])
    inverse = G11.inv().mid()
    X = arb_mat(d - r, r)
    goal = arb(2) ** -(bits // 2)
    for _ in range(4 * bits):  # enough for a ratio of 0.9 across the cut; past it the rank itself is borderline
        following = ((G21 + G22 * X - X * G12 * X) * inverse).mid()
        done = _largest(following - X) <= goal * (1 + _largest(following))
        X = following
        if done:
            break
    else:
        close = True
    Xt = X.transpose()
    kept = V * arb_mat(_identity(r).table() + X.table())
    rest = V * _orthonormal(arb_mat((-Xt).table() + _identity(d - r).table()), bits)
    return kept.mid(), rest.mid(), close


def _above(G: list[list[arb]], sigma: float) -> int:
    """Number of eigenvalues of G above sigma^2, by Sylvester's law of inertia (L D L^T of G - sigma^2 I)."""
    d, shift = len(G), arb(sigma) ** 2
    work = [[G[i][j] - shift if i == j else G[i][j] for j in range(d)] for i in range(d)]
    count = 0
    for k in range(d):
        pivot = work[k][k].mid()
        if pivot == 0:
            pivot = -(arb(2) ** -ctx.prec)
        count += pivot > 0
        for i in range(k + 1, d):
            factor = (work[i][k] / pivot).mid()
            for j in range(k + 1, i + 1):
                work[i][j] = (work[i][j] - factor * work[j][k]).mid()
    return count


def _orthonormal(M: arb_mat, bits: int) -> arb_mat:
    """An orthonormal basis of the columns of M: its polar factor, by Newton-Schulz steps (only products)."""
    columns = M.ncols()
    largest = sum((e * e for e in M.entries()), arb(0)).mid()
    if largest > 2 * columns:
        M = (M * (1 / largest.sqrt())).mid()
    goal = arb(2) ** -(bits - 16)
    three = _identity(columns) * 3
    for _ in range(2 * bits):
        gram = (M.transpose() * M).mid()
        M = (M * (three - gram) * arb(0.5)).mid()
        # One step squares the error: when it was below the root of the goal, it now is below the goal.
        if _largest(gram - _identity(columns)) ** 2 <= goal:
            break
    return M


def _largest(M: arb_mat) -> arb:
    return max((abs(e.mid()) for e in M.entries()), default=arb(0))


def _identity(n: int) -> arb_mat:
    return arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def _loaded(A: FloatArray, b: FloatArray) -> tuple[arb_mat, arb_mat]:
    """The level exactly, divided by the power of two that brings A's largest entry into [0.5, 1)."""
    unit = arb(2) ** -_exponent(A)
    (entries, scale), (values, offset) = integers(A), integers(b)
    matrix = arb_mat(int(A.shape[0]), int(A.shape[1]), [arb(e) for e in entries]) * (arb(2) ** scale * unit)
    return matrix, arb_mat(len(b), 1, [arb(v) for v in values]) * (arb(2) ** offset * unit)


def _exponent(A: FloatArray) -> int:
    return math.frexp(float(np.abs(A).max(initial=0.0)))[1]


def _norm_of(A: FloatArray) -> float:
    """||A||_2 in the unit of `_loaded`."""
    return float(np.linalg.svd(np.ldexp(A, -_exponent(A)), compute_uv=False)[0])


def _norm_of_arb(matrix: arb_mat) -> float:
    """||A||_2 of a level in y."""
    values = np.array([[float(entry) for entry in row] for row in matrix.tolist()])
    return float(np.linalg.svd(values, compute_uv=False)[0]) if values.size else 0.0


def _root(metric: FloatArray, bits: int) -> arb_mat:
    """R of W = R^T R, upper triangular, but for a power of two."""
    n = len(metric)
    rows = metric_rows(metric, n, bits + 64)
    unit = arb(2) ** -max(max(abs(entry) for entry in row) for row in rows).bit_length()
    return arb_mat(n, n, [arb(entry) * unit for row in rows for entry in row]).mid()


def _residual(matrix: arb_mat, x: arb_mat, target: arb_mat, exponent: int) -> float:
    """||A x - b||_2; 0 when it is below 2**-128 of ||A|| ||x|| + ||b||, where only the rounding of this recursion is left."""
    size = (_length(matrix) * _length(x) + _length(target)).mid()
    error = _length(matrix * x - target)
    return 0.0 if error <= size * arb(2) ** -128 else float((error * arb(2) ** exponent).mid())


def _length(M: arb_mat) -> arb:
    return sum((e * e for e in M.entries()), arb(0)).mid().sqrt().mid()
