"""Many problems of one shape: loops over a closed form, and null-space priority on eight problems side by side.

The side-by-side form keeps entry (i, j) of eight problems next to each other, so that every operation of the cascade is one
vector operation. It factors without pivoting, and where the triangles do not prove that no singular value counts as zero
(or a number is not finite) the problem is left to the one-by-one form, so answers obey the same rank rule.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.cascade import null_space, null_space_projector
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.reverse import columns_form, damped_columns_form, damped_projector_form, projector_form
from hqp_rp.core.kernels.robust import singularity_robust

LANES = 8


NULL_SPACE = 0
NULL_SPACE_PROJECTOR = 1
COLUMNS_FORM = 2
PROJECTOR_FORM = 3
DAMPED_COLUMNS_FORM = 4
DAMPED_PROJECTOR_FORM = 5
SINGULARITY_ROBUST = 6


@kernel
def batch_one_by_one(which, A, b, offsets, Z, tol, kind, first, second, X, code):
    """A closed form on problems i = 0 ... N - 1: A (N, M, n), b (N, M), Z (N, n) or (1, n) free vectors.

    Fills X (N, n) and code (N,), what the closed form returned. `which` is one of the numbers above but
    `NULL_SPACE`, which `batch_null_space` serves; one compiled loop for all, since numba cannot cache a function that takes
    another as its argument.
    """
    for i in range(len(A)):
        z = Z[i % len(Z)]
        if which == NULL_SPACE_PROJECTOR:
            code[i] = null_space_projector(A[i], b[i], offsets, z, tol, kind, first, second, X[i])
        elif which == COLUMNS_FORM:
            code[i] = columns_form(A[i], b[i], offsets, z, tol, kind, first, second, X[i])
        elif which == PROJECTOR_FORM:
            code[i] = projector_form(A[i], b[i], offsets, z, tol, kind, first, second, X[i])
        elif which == DAMPED_COLUMNS_FORM:
            code[i] = damped_columns_form(A[i], b[i], offsets, z, tol, kind, first, second, X[i])
        elif which == DAMPED_PROJECTOR_FORM:
            code[i] = damped_projector_form(A[i], b[i], offsets, z, tol, kind, first, second, X[i])
        else:
            code[i] = singularity_robust(A[i], b[i], offsets, z, tol, kind, first, second, X[i])


@kernel
def load_lanes(A, b, Z, start, offsets, W, t, norm, good):
    """Eight problems from `start` side by side: W (M, n, 8) loaded rows, t (M, 8) loaded b - A z, norm (p, 8) of each level."""
    n = A.shape[2]
    for lane in range(LANES):
        i = start + lane
        z = Z[i % len(Z)]
        good[lane] = True
        for k in range(len(offsets) - 1):
            big = 0.0
            for row in range(offsets[k], offsets[k + 1]):
                for j in range(n):
                    big = max(big, abs(A[i, row, j]))
            if not big < np.inf:
                good[lane] = False
            s = 1.0
            if 0.0 < big < np.inf:
                s = math.ldexp(1.0, max(-1000, min(1000, -math.frexp(big)[1])))
            total = 0.0
            for row in range(offsets[k], offsets[k + 1]):
                dot = b[i, row] * s
                for j in range(n):
                    a = A[i, row, j] * s
                    W[row, j, lane] = a
                    total += a * a
                    dot -= a * z[j]
                t[row, lane] = dot
            norm[k, lane] = math.sqrt(total)


@kernel
def prove_lanes(W, norm, r0, c0, m, transposed, tol, good, column, total):
    """Keep good[lane] only where 1 / ||L^-1||_F > tol * norm, L (m, m) the triangle at (r0, c0), or its transpose."""
    for lane in range(LANES):
        total[lane] = 0.0
    for j in range(m):
        for i in range(j, m):
            for lane in range(LANES):
                column[i, lane] = 1.0 if i == j else 0.0
            for l in range(j, i):
                for lane in range(LANES):
                    entry = W[r0 + l, c0 + i, lane] if transposed else W[r0 + i, c0 + l, lane]
                    column[i, lane] -= entry * column[l, lane]
            for lane in range(LANES):
                column[i, lane] /= W[r0 + i, c0 + i, lane]
                total[lane] += column[i, lane] * column[i, lane]
    for lane in range(LANES):
        if not tol * norm[lane] * math.sqrt(total[lane]) < 1.0:
            good[lane] = False


@kernel
def wide_level_lanes(W, t, c0, r0, r1, tau, dot):
    """LQ of rows r0:r1 on columns c0:, in place; the reflectors turn every row below as well."""
    M, n, _ = W.shape
    for i in range(r0, r1):
        c = c0 + i - r0
        for lane in range(LANES):
            dot[lane] = 0.0
        for j in range(c, n):
            for lane in range(LANES):
                dot[lane] += W[i, j, lane] * W[i, j, lane]
        for lane in range(LANES):
            alpha = W[i, c, lane]
            beta = -math.copysign(math.sqrt(dot[lane]), alpha)
            tau[i, lane] = (beta - alpha) / beta
            dot[lane] = 1.0 / (alpha - beta)
            W[i, c, lane] = beta
        for j in range(c + 1, n):
            for lane in range(LANES):
                W[i, j, lane] *= dot[lane]
        for row in range(i + 1, M):
            for lane in range(LANES):
                dot[lane] = W[row, c, lane]
            for j in range(c + 1, n):
                for lane in range(LANES):
                    dot[lane] += W[row, j, lane] * W[i, j, lane]
            for lane in range(LANES):
                dot[lane] *= tau[i, lane]
                W[row, c, lane] -= dot[lane]
            for j in range(c + 1, n):
                for lane in range(LANES):
                    W[row, j, lane] -= dot[lane] * W[i, j, lane]


@kernel
def tall_level_lanes(W, t, c0, r0, r1, dot, scale):
    """QR of rows r0:r1 on columns c0: (fewer than rows), in place, and t[r0:] <- Q^T t: least squares without freedom left."""
    n = W.shape[1]
    for c in range(c0, n):
        i0 = r0 + c - c0
        for lane in range(LANES):
            dot[lane] = 0.0
        for i in range(i0, r1):
            for lane in range(LANES):
                dot[lane] += W[i, c, lane] * W[i, c, lane]
        for lane in range(LANES):
            alpha = W[i0, c, lane]
            beta = -math.copysign(math.sqrt(dot[lane]), alpha)
            scale[0, lane] = (beta - alpha) / beta
            dot[lane] = 1.0 / (alpha - beta)
            W[i0, c, lane] = beta
        for i in range(i0 + 1, r1):
            for lane in range(LANES):
                W[i, c, lane] *= dot[lane]
        for j in range(c + 1, n + 1):
            for lane in range(LANES):
                dot[lane] = t[i0, lane] if j == n else W[i0, j, lane]
            for i in range(i0 + 1, r1):
                for lane in range(LANES):
                    dot[lane] += W[i, c, lane] * (t[i, lane] if j == n else W[i, j, lane])
            for lane in range(LANES):
                dot[lane] *= scale[0, lane]
                if j == n:
                    t[i0, lane] -= dot[lane]
                else:
                    W[i0, j, lane] -= dot[lane]
            for i in range(i0 + 1, r1):
                for lane in range(LANES):
                    if j == n:
                        t[i, lane] -= dot[lane] * W[i, c, lane]
                    else:
                        W[i, j, lane] -= dot[lane] * W[i, c, lane]


@kernel
def null_space_lanes(W, t, norm, offsets, tol, good, y, tau, top, work, dot):
    """y (n, 8): the cascade's steps from z, in x's own coordinates; good (8,) keeps where every rank was proven full.

    W, t, norm as `load_lanes` leaves them, overwritten. tau (M, 8), top (n,), work (n, 8), dot (8,) are room.
    """
    n = W.shape[1]
    p = len(offsets) - 1
    for j in range(n):
        for lane in range(LANES):
            y[j, lane] = 0.0
    c0 = 0
    reflected = 0
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        m = r1 - r0
        if m == 0 or c0 == n:
            continue
        for i in range(r0, r1):
            for j in range(c0):
                for lane in range(LANES):
                    t[i, lane] -= W[i, j, lane] * y[j, lane]
        if m > n - c0:
            tall_level_lanes(W, t, c0, r0, r1, dot, work)
            prove_lanes(W, norm[k], r0, c0, n - c0, True, tol, good, work, dot)
            for c in range(n - 1, c0 - 1, -1):
                i = r0 + c - c0
                for j in range(c + 1, n):
                    for lane in range(LANES):
                        t[i, lane] -= W[i, j, lane] * y[j, lane]
                for lane in range(LANES):
                    y[c, lane] = t[i, lane] / W[i, c, lane]
            c0 = n
            break
        wide_level_lanes(W, t, c0, r0, r1, tau, dot)
        prove_lanes(W, norm[k], r0, c0, m, False, tol, good, work, dot)
        for i in range(m):
            for j in range(i):
                for lane in range(LANES):
                    t[r0 + i, lane] -= W[r0 + i, c0 + j, lane] * y[c0 + j, lane]
            for lane in range(LANES):
                y[c0 + i, lane] = t[r0 + i, lane] / W[r0 + i, c0 + i, lane]
            top[c0 + i] = r0 + i
        c0 += m
        reflected = c0
    for c in range(reflected - 1, -1, -1):
        i = top[c]
        for lane in range(LANES):
            dot[lane] = y[c, lane]
        for j in range(c + 1, n):
            for lane in range(LANES):
                dot[lane] += y[j, lane] * W[i, j, lane]
        for lane in range(LANES):
            dot[lane] *= tau[i, lane]
            y[c, lane] -= dot[lane]
        for j in range(c + 1, n):
            for lane in range(LANES):
                y[j, lane] -= dot[lane] * W[i, j, lane]


@kernel
def batch_null_space(A, b, offsets, Z, tol, kind, first, second, X, code):
    """`null_space` on every problem, eight at a time where the ranks can be proven full; undamped (kind = 0) only."""
    N, M, n = A.shape
    p = len(offsets) - 1
    W = np.empty((M, n, LANES))
    t = np.empty((M, LANES))
    norm = np.empty((p, LANES))
    y = np.empty((n, LANES))
    tau = np.empty((M, LANES))
    top = np.empty(n, np.int64)
    work = np.empty((max(n, 1), LANES))
    dot = np.empty(LANES)
    good = np.empty(LANES, np.bool_)
    whole = N - N % LANES if kind == 0 else 0
    for start in range(0, whole, LANES):
        load_lanes(A, b, Z, start, offsets, W, t, norm, good)
        null_space_lanes(W, t, norm, offsets, tol, good, y, tau, top, work, dot)
        for lane in range(LANES):
            i = start + lane
            ok = good[lane]
            for j in range(n):
                X[i, j] = Z[i % len(Z), j] + y[j, lane]
                if not abs(X[i, j]) < np.inf:
                    ok = False
            if ok:
                code[i] = 1.0
            else:
                code[i] = null_space(A[i], b[i], offsets, Z[i % len(Z)], tol, kind, first, second, X[i])
    for i in range(whole, N):
        code[i] = null_space(A[i], b[i], offsets, Z[i % len(Z)], tol, kind, first, second, X[i])
