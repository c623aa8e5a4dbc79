"""Building blocks: scaled loading, row-pivoted LQ with a rank decision, least squares, and the way back to x.

A cascade keeps one working copy W (M, n) of the stacked rows and turns its columns by orthogonal transformations,
W <- W Q, level by level, so that x = Q y. After level k has been factored, columns c0 ... c0 + rank - 1 span its row
space within the freedom left to it and the columns behind them are free for the levels below: the null-space basis
Z = Q[:, c0 + rank:] is orthonormal to working precision by construction and is never formed.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import inlined, kernel, lean
from hqp_rp.core.kernels.householder import (
    householder,
    is_padded,
    longest_row,
    padded,
    reflect_rows,
    reflect_rows_by_all,
    swap_any_rows,
    turn_vector,
)
from hqp_rp.core.kernels.room import FEW_NUMBERS, few_numbers
from hqp_rp.core.kernels.vector_load import INFINITE_BITS, copy_scaled_row, float_of, largest_bits

EPS = 2.220446049250313e-16


@lean
def load(A, b, offsets, W, rhs, scale):
    """Copy A into W (filled up with zeros) and b into rhs, each level scaled by a power of two; False if not finite."""
    finite = True
    for k in range(len(offsets) - 1):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        big = largest_bits(A, r0, r1)
        s = power_to_unit(big)
        finite = finite and big < INFINITE_BITS
        scale[k] = s
        for i in range(r0, r1):
            if is_padded(W):
                copy_scaled_row(W, i, A, i, s)
            else:
                for j in range(A.shape[1]):
                    W[i, j] = A[i, j] * s
            rhs[i] = b[i] * s
            if not abs(rhs[i]) < np.inf:
                finite = False
    return finite


@inlined
def power_to_unit(big):
    """The power of two that brings a number with these bits into [0.5, 1), as far as powers to +-1000 do; 1 for 0 and inf."""
    if big == 0 or big >= INFINITE_BITS:
        return 1.0
    return float_of((1023 + max(-1000, min(1000, 1022 - (big >> 52)))) << 52)


@lean
def frobenius(W, r0, r1):
    """Frobenius norm of rows r0:r1 of W, without overflow."""
    s = 0.0
    for i in range(r0, r1):
        for j in range(W.shape[1]):
            s += W[i, j] * W[i, j]
    if 1e-280 < s < 1e280:
        return math.sqrt(s)
    big = 0.0
    for i in range(r0, r1):
        for j in range(W.shape[1]):
            big = max(big, abs(W[i, j]))
    if big == 0.0 or not big < np.inf:
        return big
    s = 0.0
    for i in range(r0, r1):
        for j in range(W.shape[1]):
            s += (W[i, j] / big) ** 2
    return big * math.sqrt(s)


@kernel
def spectral(W, r0, r1):
    """Spectral norm of rows r0:r1 of W."""
    _, s, _ = np.linalg.svd(W[r0:r1].copy(), False)
    return s[0]


@lean
def lq(W, r0, r1, c0, rows_end, rhs, floor, t0, ref_row, ref_col, ref_tau):
    """Row-pivoted Householder LQ of W[r0:r1, c0:] in place; the reflectors also turn rows r1:rows_end.

    Row r0 + j ends with its entries of L left of and at column c0 + j and the reflector (leading 1 implied) right of it.
    Stops when every remaining row is shorter than `floor`. Rows of the level are swapped together with their rhs.
    Reflector number t0 + j is recorded by row, column and tau. Returns the number of reflectors.
    """
    steps = min(r1 - r0, W.shape[1] - c0)
    for j in range(steps):
        c = c0 + j
        top = r0 + j
        best, longest = longest_row(W, top, r1, c)
        norm = math.sqrt(longest)
        if not norm > floor:
            steps = j
            break
        if best != top:
            swap_any_rows(W, top, best)
            swap = rhs[top]
            rhs[top] = rhs[best]
            rhs[best] = swap
        tau = householder(W, top, c, norm)
        ref_row[t0 + j] = top
        ref_col[t0 + j] = c
        ref_tau[t0 + j] = tau
        reflect_rows(W, top + 1, r1 if is_padded(W) else rows_end, W, top, c, tau)
    if is_padded(W):
        reflect_rows_by_all(W, r1, rows_end, W, r0, steps, c0, ref_tau, t0)
    return steps


@kernel
def inverse_norm(W, r0, c0, r):
    """Frobenius norm of the inverse of the leading r x r triangle of L: 1 / it is a rigorous bound below sigma_min(L)."""
    total = 0.0
    for i in range(r):
        total += 1.0 / (W[r0 + i, c0 + i] * W[r0 + i, c0 + i])
    if r == 1:
        return math.sqrt(total)
    total = 0.0
    column = few_numbers()
    if r > FEW_NUMBERS:
        column = np.empty(r)
    for j in range(r):
        for i in range(j, r):
            s = 1.0 if i == j else 0.0
            for col in range(j, i):
                s -= W[r0 + i, c0 + col] * column[col]
            column[i] = s / W[r0 + i, c0 + i]
            total += column[i] * column[i]
    return math.sqrt(total)


@kernel
def lower_block(W, r0, r1, c0, r):
    """A copy of L (m, r), the factor that `lq` left in rows r0:r1, without the reflectors stored above it."""
    L = np.zeros((r1 - r0, r))
    for i in range(r1 - r0):
        for j in range(min(i + 1, r)):
            L[i, j] = W[r0 + i, c0 + j]
    return L


@lean
def triangle(W, r0, r1, c0, rows_end, rhs, norm, tol, t0, ref_row, ref_col, ref_tau):
    """`lq` of rows r0:r1 within columns c0:, and whether its triangle proves that no singular value counts as zero.

    norm: ||A_k||_F of the rows before any transformation. Returns (reflectors, proven).
    """
    m = r1 - r0
    n = W.shape[1]
    if m == 0 or c0 == n or norm == 0.0:
        return 0, True
    floor = min(64.0 * EPS, tol / math.sqrt(min(m, n))) * norm
    r = lq(W, r0, r1, c0, rows_end, rhs, floor, t0, ref_row, ref_col, ref_tau)
    if r == 0:
        return 0, True
    # Pivoting leaves |L_ij| <= |L_jj| (up to rounding, hence 2), so that ||L^-1||_2 <= sqrt(4^r + 6 r - 1) / (3 min |L_jj|).
    smallest = np.inf
    for i in range(r):
        smallest = min(smallest, abs(W[r0 + i, c0 + i]))
    if r <= 30 and 2.0 * tol * norm * math.sqrt(4.0**r + 6.0 * r - 1.0) < 3.0 * smallest:
        return r, True
    return r, tol * norm * inverse_norm(W, r0, c0, r) < 1.0


@kernel
def turn_by_svd(W, r0, r1, c0, rows_end, r, zero):
    """Turn columns c0:c0 + r of the rows below by V of L = U S V^T; returns (rank, V, U, S), with S <= zero counted as zero."""
    U, S, Vt = np.linalg.svd(lower_block(W, r0, r1, c0, r), False)
    rank = 0
    while rank < r and S[rank] > zero:
        rank += 1
    V = Vt.T.copy()
    turned = np.empty(r)
    for i in range(r1, rows_end):
        for j in range(r):
            s = 0.0
            for col in range(r):
                s += W[i, c0 + col] * V[col, j]
            turned[j] = s
        for j in range(r):
            W[i, c0 + j] = turned[j]
    return rank, V, U.copy(), S


@kernel
def svd_level(W, n, r0, r1, c0, rows_end, r, A, o0, o1, unit, tol, t, kind, first, second, y, V):
    """What SVD decides where the triangle proves nothing: rank by the library's rule, and the level's damped answer.

    Rows r0:r1 of W hold L, as `lq` left it; A_k itself is `unit` * A[o0:o1]. The rows below are turned by V of L = U S V^T,
    which is put into the leading part of V. y[c0:c0 + rank] <- f(S) U^T t, t (m,) being the right-hand side and f the policy's.
    Returns (rank, smallest singular value that counts, 0 where one was cut).
    """
    rank, turn, U, S = turn_by_svd(W, r0, r1, c0, rows_end, r, tol * unit * spectral(A, o0, o1))
    m = r1 - r0
    last = S[r - 1] if r == min(m, n - c0) else 0.0
    for j in range(rank):
        s = 0.0
        for i in range(m):
            s += U[i, j] * t[i]
        y[c0 + j] = s * damped_inverse(S[j], last, 0.0, kind, first * unit, second * unit)
    for i in range(r):
        for j in range(r):
            V[i, j] = turn[i, j]
    return rank, S[r - 1] if rank == r else 0.0


@kernel
def factor(W, r0, r1, c0, rows_end, rhs, original, o0, o1, unit, tol, svd, t0, ref_row, ref_col, ref_tau):
    """Factor rows r0:r1 within columns c0: and decide their rank by the library's rule.

    The rule: a singular value of A_k Z counts as zero when it is <= tol * ||A_k||_2. Where the triangle's inverse proves
    every singular value to be above it, no SVD is needed; else (or when `svd` asks for it) L = U S V^T decides and the
    columns are turned by V as well. A_k itself, before any transformation, is `unit` * original[o0:o1].

    Returns (reflectors, rank, V, U, S): V, U, S are empty when no SVD was needed; then rows r0:r1 hold L itself.
    """
    norm = unit * frobenius(original, o0, o1)
    r, proven = triangle(W, r0, r1, c0, rows_end, rhs, norm, tol, t0, ref_row, ref_col, ref_tau)
    if r == 0 or (proven and not svd):
        empty = np.empty((0, 0))
        return r, r, empty, empty, np.empty(0)
    rank, V, U, S = turn_by_svd(W, r0, r1, c0, rows_end, r, tol * unit * spectral(original, o0, o1))
    return r, rank, V, U, S


@lean
def forward_substitution(W, r0, c0, r, t, y):
    """y[c0:c0 + r] from the leading triangle: L y = t."""
    for i in range(r):
        s = t[i]
        for col in range(i):
            s -= W[r0 + i, c0 + col] * y[c0 + col]
        y[c0 + i] = s / W[r0 + i, c0 + i]


@lean
def level_least_squares(W, r0, r1, c0, r, t):
    """t[:r] <- the y of min ||L y - t|| for the factor L (r1 - r0, r) that `lq` left in rows r0:r1, of full column rank."""
    if r == r1 - r0:
        for i in range(r):
            s = t[i]
            for col in range(i):
                s -= W[r0 + i, c0 + col] * t[col]
            t[i] = s / W[r0 + i, c0 + i]
    elif r == 1:
        square = 0.0
        dot = 0.0
        for i in range(r0, r1):
            square += W[i, c0] * W[i, c0]
            dot += W[i, c0] * t[i - r0]
        t[0] = dot / square
    else:
        tall_level(W, r0, r1, c0, r, t)


@kernel
def tall_level(W, r0, r1, c0, r, t):
    """`level_least_squares` with more rows than columns."""
    tall_least_squares(lower_block(W, r0, r1, c0, r), t)


@kernel
def tall_least_squares(C, t):
    """min ||C y - t|| for C (m, r) of full column rank, m >= r, by Householder QR; t[:r] is overwritten with y.

    Columns are pivoted, so that with rows sorted by falling size it is stable row by row (Cox and Higham 1998): rows of
    very different weight then do not swamp each other. It works on C^T, whose rows are contiguous.
    """
    m, r = C.shape
    T = np.zeros((r, padded(m)))
    for i in range(m):
        for j in range(r):
            T[j, i] = C[i, j]
    right = np.zeros(T.shape[1])
    right[:m] = t[:m]
    tall_transposed(T, r, right, np.empty(r, np.int64), t)


@lean
def tall_transposed(T, r, right, order, y):
    """y[:r] <- the y of `tall_least_squares` for C^T = T[:r], padded; right (padded m,), order (r,) and T are overwritten."""
    for j in range(r):
        order[j] = j
    for j in range(r):
        best, longest = longest_row(T, j, r, j)
        if best != j:
            swap_any_rows(T, j, best)
            other = order[j]
            order[j] = order[best]
            order[best] = other
        norm = math.sqrt(longest)
        if norm == 0.0:
            continue
        tau = householder(T, j, j, norm)
        reflect_rows(T, j + 1, r, T, j, j, tau)
        turn_vector(right, T, j, j, tau)
    for j in range(r - 1, -1, -1):
        s = right[j]
        for row in range(j + 1, r):
            s -= T[row, j] * right[row]
        right[j] = s / T[j, j] if T[j, j] != 0.0 else 0.0
    for j in range(r):
        y[order[j]] = right[j]


@kernel
def turn_back_by(V, r, y, c0):
    """y[c0:c0 + r] <- V y[c0:c0 + r], V its leading r x r part."""
    turned = np.empty(r)
    for i in range(r):
        s = 0.0
        for col in range(r):
            s += V[i, col] * y[c0 + col]
        turned[i] = s
    for i in range(r):
        y[c0 + i] = turned[i]


@kernel
def turn_forward_by(V, r, y, c0):
    """y[c0:c0 + r] <- V^T y[c0:c0 + r], V its leading r x r part."""
    turned = np.empty(r)
    for i in range(r):
        s = 0.0
        for row in range(r):
            s += V[row, i] * y[c0 + row]
        turned[i] = s
    for i in range(r):
        y[c0 + i] = turned[i]


@lean
def turn_back_reflectors(W, y, t0, t1, ref_row, ref_col, ref_tau):
    """y <- Q y by reflectors t0:t1, in reverse order."""
    for t in range(t1 - 1, t0 - 1, -1):
        turn_vector(y, W, ref_row[t], ref_col[t], ref_tau[t])


@kernel
def turn_back(W, y, c0, V, t0, t1, ref_row, ref_col, ref_tau):
    """y <- Q_k y for one level: its V (empty when there is none), then its reflectors."""
    if len(V):
        turn_back_by(V, len(V), y, c0)
    turn_back_reflectors(W, y, t0, t1, ref_row, ref_col, ref_tau)


@lean
def turn_forward(W, y, t0, t1, ref_row, ref_col, ref_tau):
    """y <- Q^T y by reflectors t0:t1."""
    for t in range(t0, t1):
        turn_vector(y, W, ref_row[t], ref_col[t], ref_tau[t])


@kernel
def damped_inverse(sigma, smallest, zero, kind, first, second):
    """What a damping policy puts for 1/sigma: (15), (17), (18)-(19) or truncation; 0 for sigma <= `zero` without damping.

    `smallest` is sigma_m of (19); `kind`, `first`, `second` are the policy's (`hqp_rp.core.damping`), in sigma's unit.
    """
    if kind == 0 or kind == 3:
        cut = zero if kind == 0 else max(zero, first)
        return 1.0 / sigma if sigma > cut else 0.0
    factor = first
    if kind == 2:
        ratio = smallest / first
        factor = 0.0 if ratio >= 1.0 else math.sqrt((1.0 - ratio) * (1.0 + ratio)) * second
    if factor == 0.0:
        return 1.0 / sigma if sigma > zero else 0.0
    # sigma / (sigma^2 + factor^2) without squaring a large number.
    if sigma > factor:
        ratio = factor / sigma
        return 1.0 / (sigma * (1.0 + ratio * ratio))
    ratio = sigma / factor
    return ratio / (factor * (1.0 + ratio * ratio))
