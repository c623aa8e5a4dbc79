"""A stage's rows in the free directions: scaled, times Q, its equalities factored, directions that no row feels set apart.

`Desk.turned` holds Q (n, n) orthogonal; its columns from c0 on are the directions that finished stages leave free. A stage's
equalities are factored there, `A_E Q = L [Q'; 0]`, Q is turned by Q', and w = B z are the QP's coordinates for the first
`rank` free columns, B being L, the triangle of a tall L, or its singular values.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.householder import reflect_rows_by_all
from hqp_rp.core.kernels.orthogonal import frobenius, inverse_norm, lq, spectral, triangle
from hqp_rp.core.kernels.qp_tall import by_singular_values, lay_down, turn_columns
from hqp_rp.core.kernels.room import as_matrix
from hqp_rp.core.kernels.vector import add_multiple, dot_row, sum_of_squares

GONE = 1e-10  # A kept row with no more than this left in the free directions is rounding noise.


@inlined
def length_of(v):
    """||v||."""
    s = 0.0
    for value in v:
        s += value * value
    return math.sqrt(s)


@inlined
def power_of_two(largest):
    """The power of two above `largest`; 0 for 0."""
    return math.ldexp(1.0, math.frexp(largest)[1]) if 0.0 < largest < np.inf else 0.0


@lean
def scale_rows(desk, r0, r1, row_by_row):
    """Rows r0:r1 times powers of two that bring the largest entry (of each row) into [1/2, 1); False on overflow."""
    n = desk.raw.shape[1]
    fits = True
    whole = 0.0
    for i in range(r0, r1):
        for j in range(n):
            whole = max(whole, abs(desk.raw[i, j]))
    for i in range(r0, r1):
        big = whole
        if row_by_row:
            big = 0.0
            for j in range(n):
                big = max(big, abs(desk.raw[i, j]))
        e = -math.frexp(big)[1] if big > 0.0 else 0
        half = math.ldexp(1.0, e // 2)  # the whole power may overflow
        rest = math.ldexp(1.0, e - e // 2)
        for j in range(n):
            desk.A[i, j] = desk.raw[i, j] * half * rest
        desk.low[i] = desk.lower[i] * half * rest
        desk.up[i] = desk.upper[i] * half * rest
        if desk.low[i] == np.inf or desk.up[i] == -np.inf:
            fits = False
    return fits


@inlined
def times_Q(row, desk, out):
    """out (N,) <- row Q."""
    for j in range(len(out)):
        out[j] = 0.0
    for i in range(desk.raw.shape[1]):
        if row[i] != 0.0:
            add_multiple(out, desk.turned, i, row[i])


@lean
def factor_equalities(desk, mE, rows, c0, r0, r1, tol, sharpest):
    """Factor the stage's equalities, turn `rows` rows, and fill B, c, sharp; returns the rank.

    sharpest: singular values are preconditioned away down to this fraction of the largest one.
    """
    for i in range(mE):
        times_Q(desk.A[desk.E[i]], desk, desk.work[i])
        desk.order[i] = i
    norm = frobenius(desk.A, r0, r1)
    r, proven = triangle(desk.work, 0, mE, c0, mE, desk.order, norm, tol, 0, desk.row, desk.column, desk.tau)
    for i in range(mE):
        e = desk.E[int(desk.order[i])]
        desk.residual[i] = desk.low[e] - dot_row(desk.A, e, desk.x, 0)
        desk.right[i] = desk.residual[i]
    if r == 0:
        return 0
    reflect_rows_by_all(desk.turned, 0, rows, desk.work, 0, r, c0, desk.tau, 0)
    zero = 0.0
    if not proven:
        zero = tol * spectral(desk.A, r0, r1)
    elif r == mE:
        for i in range(r):
            for j in range(i + 1):
                desk.B[i, j] = desk.work[i, c0 + j]
            desk.c[i] = desk.right[i]
    else:
        lay_down(desk.work, 0, mE, c0, r, desk.tall, desk.right, desk.pivot)
        tall_to_lower(desk, mE, r)
    for j in range(r):
        desk.sharp[j] = 1.0
    if proven and (sharpest == 0.0 or inverse_norm(desk.B, 0, 0, r) * triangle_norm(desk.B, r) * sharpest <= 1.0):
        if r < mE:
            turn_as_pivoted(desk, c0, r, rows)
        return r
    rank = by_singular_values(desk.work, mE, c0, r, zero, desk.residual, desk.B, desk.sharp, desk.c)
    turn_columns(desk.turned, 0, rows, c0, desk.B, r)
    largest = desk.sharp[0]
    for i in range(rank):
        for j in range(i):
            desk.B[i, j] = 0.0
        desk.B[i, i] = max(desk.sharp[i], sharpest * largest)
        desk.sharp[i] /= desk.B[i, i]
    return rank


@lean
def triangle_norm(B, r):
    """Frobenius norm of a lower triangle."""
    s = 0.0
    for i in range(r):
        for j in range(i + 1):
            s += B[i, j] * B[i, j]
    return math.sqrt(s)


@lean
def tall_to_lower(desk, m, r):
    """B, lower triangular, from the R of `lay_down`: w and z in reverse order."""
    wide = (m + 7) // 8 * 8
    L = as_matrix(desk.tall[: r * wide], r, wide)
    for i in range(r):
        desk.c[i] = desk.right[r - 1 - i]
        for j in range(i + 1):
            desk.B[i, j] = L[r - 1 - j, r - 1 - i]


@lean
def turn_as_pivoted(desk, c0, r, rows):
    """Columns c0:c0 + r of the first rows of `turned` in the order of `lay_down`'s pivots, reversed, as `tall_to_lower`'s B."""
    for i in range(rows):
        for j in range(r):
            desk.z[j] = desk.turned[i, c0 + desk.pivot[r - 1 - j]]
        for j in range(r):
            desk.turned[i, c0 + j] = desk.z[j]


@lean
def keep_felt(desk, count, mS, K, c0):
    """Turn the free columns from c0 on so that some row feels the first f of them, and none the others; returns f.

    Rows are measured at length one. Along columns that no row feels the QP would be free to run away.
    """
    n = desk.raw.shape[1]
    d = n - c0
    if d == 0 or count == 0:
        return 0
    for i in range(count):
        source = n + K + i if i < mS else n + i - mS
        length = 1.0
        if i < mS:
            length = math.sqrt(sum_of_squares(desk.A, desk.S[i], 0))
            if length == 0.0:
                length = 1.0
        for j in range(c0 // 8 * 8, desk.work.shape[1]):
            desk.work[i, j] = desk.turned[source, j] / length
    f = lq(desk.work, 0, count, c0, count, desk.order, GONE, 0, desk.row, desk.column, desk.tau)
    if f < d:
        reflect_rows_by_all(desk.turned, 0, n + K + mS, desk.work, 0, f, c0, desk.tau, 0)
    return f


@lean
def over_triangle(rows, i, B, r):
    """rows[i, :r] <- rows[i, :r] B^-1."""
    for j in range(r - 1, -1, -1):
        s = rows[i, j] / B[j, j]
        rows[i, j] = s
        for k in range(j):
            rows[i, k] -= s * B[j, k]
