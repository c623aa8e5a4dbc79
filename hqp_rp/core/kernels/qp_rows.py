"""One stage of a QP cascade: its small QP in the free directions, and what is kept and what leaves afterwards.

`Desk.turned` holds Q (n, n) orthogonal; its columns from `taken` on are the directions that finished stages leave free. A
stage's equalities are factored there, `A_E Q = L [Q'; 0]`, Q is turned by Q', and w = B z are the QP's coordinates for the
first `rank` free columns, B being L, the triangle of a tall L, or its singular values (`hqp_rp.core.qp_descent` has the QP).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.householder import reflect_rows_by_all
from hqp_rp.core.kernels.orthogonal import EPS, frobenius, inverse_norm, lq, spectral, triangle
from hqp_rp.core.kernels.qp_desk import (
    DENSE,
    INFINITE,
    KEPT,
    QP_ROWS,
    RANK,
    RANK_TOLERANCE,
    SIZE,
    SOFT,
    SQUARE,
    STAGE,
    TAKEN,
    M,
    N,
    P,
    T,
    desk_of,
    qp_parts,
)
from hqp_rp.core.kernels.qp_slacks import fill_slacks
from hqp_rp.core.kernels.qp_tall import by_singular_values, lay_down, turn_columns
from hqp_rp.core.kernels.vector import add_multiple, dot_row, sum_of_squares

FLAT = 1e-3  # Singular values are preconditioned away down to this fraction of the largest one.
STRONG = 1e-6  # A row whose scaled multiplier or violation exceeds this stays where it is at later levels.
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
def sort_rows(desk, r0, r1, last):
    """Fill E and S with the stage's equalities and two-sided rows; (how many of each, whether x meets them all)."""
    mE = 0
    mS = 0
    for i in range(r0, r1):
        if desk.low[i] == desk.up[i]:
            desk.E[mE] = i
            mE += 1
        elif desk.low[i] > -np.inf or desk.up[i] < np.inf:
            desk.S[mS] = i
            mS += 1
    met = mE == 0 and not last
    for i in range(mS):
        if met:
            value = dot_row(desk.A, desk.S[i], desk.x, 0)
            met = desk.low[desk.S[i]] <= value <= desk.up[desk.S[i]]
    return mE, mS, met


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
        tall_to_lower(desk, mE, c0, r, rows)
    for j in range(r):
        desk.sharp[j] = 1.0
    if proven and (sharpest == 0.0 or inverse_norm(desk.B, 0, 0, r) * triangle_norm(desk.B, r) * sharpest <= 1.0):
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
def tall_to_lower(desk, m, c0, r, rows):
    """B, lower triangular, from the R of `lay_down`: w and z in reverse order, and the columns of `turned` as pivoted."""
    wide = (m + 7) // 8 * 8
    L = desk.tall[: r * wide].reshape((r, wide))
    for i in range(r):
        desk.c[i] = desk.right[r - 1 - i]
        for j in range(i + 1):
            desk.B[i, j] = L[r - 1 - j, r - 1 - i]
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


@lean
def stage_qp(numbers, counts):
    """Put the QP of the stage on the desk, with SIZE, T, RANK, SOFT and QP_ROWS; SIZE 0: nothing is left to do.

    Returns whether there is a guess.
    """
    desk = desk_of(numbers, counts)
    n = counts[N]
    k = counts[STAGE]
    last = k == counts[P] + 1
    r0 = desk.offsets[k] if not last else counts[M]
    r1 = desk.offsets[k + 1] if not last else counts[M]
    K = counts[KEPT]
    c0 = counts[TAKEN]
    mE, mS, met = sort_rows(desk, r0, r1, last)
    count = mS + K
    numbers[SIZE] = 0.0
    counts[SOFT] = mS
    counts[QP_ROWS] = count
    counts[T] = 0
    counts[RANK] = 0
    counts[SQUARE] = not last
    for i in range(mS):
        times_Q(desk.A[desk.S[i]], desk, desk.turned[n + K + i])
    if met:
        return False
    noise = 0.0
    rank = 0
    if last:  # A Q is orthonormal as it is
        rank = n - c0
        for j in range(len(desk.z)):
            desk.z[j] = 0.0
        for i in range(n):
            add_multiple(desk.z, desk.turned, i, desk.start[i] - desk.x[i])
        for j in range(rank):
            desk.c[j] = desk.z[c0 + j]
            desk.sharp[j] = 1.0
        noise = 8.0 * EPS * (length_of(desk.start) + length_of(desk.x))
    elif mE > 0:
        rank = factor_equalities(desk, mE, n + count, c0, r0, r1, numbers[RANK_TOLERANCE], FLAT if count > 0 else 0.0)
        b = 0.0
        square = 0.0
        for i in range(mE):
            b += desk.low[desk.E[i]] ** 2
            square += sum_of_squares(desk.A, desk.E[i], 0)
        noise = 8.0 * EPS * (math.sqrt(b) + math.sqrt(square) * length_of(desk.x))
    t = rank + keep_felt(desk, count, mS, K, c0 + rank)
    counts[RANK] = rank
    if t == 0:
        return False
    counts[T] = t
    q = desk.qp
    a, b, c, e, f, g, H, gs, C, lo, hi, s, end = qp_parts(t, count, mS)
    rows = q[b:c].reshape((count, t))
    largest = 0.0
    total = 0.0
    for j in range(rank):
        total += desk.c[j] * desk.c[j]
    if math.sqrt(total) > noise:
        for j in range(rank):
            largest = max(largest, abs(desk.c[j]))
    for i in range(count):
        row = n + K + i if i < mS else n + i - mS
        for j in range(t):
            rows[i, j] = desk.turned[row, c0 + j]
        if not last:
            over_triangle(rows, i, desk.B, rank)
        if i < mS:
            own = desk.S[i]
            value = dot_row(desk.A, own, desk.x, 0)
            within = math.sqrt(sum_of_squares(desk.turned, row, c0))
            # Earlier levels have used the row up: nothing here may follow it.
            if within <= numbers[RANK_TOLERANCE] * math.sqrt(sum_of_squares(desk.A, own, 0)):
                for j in range(t):
                    rows[i, j] = 0.0
            q[c + i] = desk.low[own] - value
            q[e + i] = desk.up[own] - value
            desk.lengths[i] = 1.0
            largest = max(largest, q[c + i], -q[e + i])
        else:
            value = dot_row(desk.kept, i - mS, desk.x, 0)
            length = 0.0
            for j in range(t):
                length += rows[i, j] * rows[i, j]
            length = math.sqrt(length)
            desk.lengths[i] = length
            if length > 0.0:
                for j in range(t):
                    rows[i, j] /= length
            else:
                length = 1.0
            # The start is feasible by construction: a bound passed by rounding moves to where the point is.
            q[c + i] = min(desk.kept_lower[i - mS] - value, 0.0) / length
            q[e + i] = max(desk.kept_upper[i - mS] - value, 0.0) / length
    size = power_of_two(largest)
    numbers[SIZE] = size
    if not size > 0.0:
        return False
    for j in range(t):
        curved = desk.sharp[j] if j < rank else 0.0
        q[j] = curved * curved
        q[a + j] = -curved * desk.c[j] / size if j < rank else 0.0
    for i in range(count):
        q[c + i] /= size
        q[e + i] /= size
    guessed = desk.known[k] == 1 and guess(desk, k, K, mS, c0, t, rank, last, size, q[f:g], q[g:H])
    if not guessed:
        for j in range(f, H):
            q[j] = 0.0
    if counts[DENSE] and count > 0:
        full = t + mS
        fill_slacks(
            q[:a], q[a:b], rows, q[c:e], q[e:f], mS, numbers[INFINITE], q[f:g], q[g:H],
            q[H:gs].reshape((full, full)), q[gs:C], q[C:lo].reshape((count, full)), q[lo:hi], q[hi:s], q[s:end],
        )  # fmt: skip
    return guessed


@lean
def guess(desk, k, K, mS, c0, t, rank, last, size, guess_t, guess_y):
    """What an earlier answer of stage k says of this QP's answer; False when that is not finite."""
    total = 0.0
    for j in range(len(desk.z)):
        desk.z[j] = 0.0
    for i in range(len(desk.guess_x[k])):
        add_multiple(desk.z, desk.turned, i, (desk.guess_x[k, i] - desk.x[i]) / size)
    for j in range(t):
        s = desk.z[c0 + j]
        if j < rank and not last:
            s = 0.0
            for i in range(j + 1):
                s += desk.B[j, i] * desk.z[c0 + i]
        guess_t[j] = s
        total += s
    for i in range(mS + K):
        y = desk.guess_y[k, desk.S[i]] if i < mS else desk.guess_y[k, desk.kept_ids[i - mS]] * desk.lengths[i]
        guess_y[i] = y / size
        total += guess_y[i]
    return math.isfinite(total)


@lean
def move(desk, c0, t, rank, lower, w, size):
    """x += Q z size on t columns from c0 on, B z = w on the first `rank`; lower: B is a triangle, else the identity."""
    for j in range(len(desk.z)):
        desk.z[j] = 0.0
    for j in range(t):
        s = w[j]
        if j < rank and lower:
            for i in range(j):
                s -= desk.B[j, i] * desk.z[c0 + i]
            s /= desk.B[j, j]
        desk.z[c0 + j] = s
    for i in range(desk.raw.shape[1]):
        desk.x[i] += size * dot_row(desk.turned, i, desk.z, c0)


@lean
def take_leave(desk, rows, count, c0, r0, r1, tol, by_rule):
    """The first `count` rows of `work` take their directions from the columns c0 ...; returns the first column still free.

    by_rule: their rank is decided by the rank rule of the stage's rows, else rows of length one are noise below `GONE`.
    """
    proven = True
    if by_rule:
        norm = frobenius(desk.A, r0, r1)
        r, proven = triangle(desk.work, 0, count, c0, count, desk.order, norm, tol, 0, desk.row, desk.column, desk.tau)
    else:
        r = lq(desk.work, 0, count, c0, count, desk.order, GONE, 0, desk.row, desk.column, desk.tau)
    reflect_rows_by_all(desk.turned, 0, rows, desk.work, 0, r, c0, desk.tau, 0)
    if proven:
        return c0 + r
    zero = tol * spectral(desk.A, r0, r1)
    rank = by_singular_values(desk.work, count, c0, r, zero, desk.residual, desk.B, desk.sharp, desk.c)
    turn_columns(desk.turned, 0, rows, c0, desk.B, r)
    return c0 + rank


@lean
def finish_stage(numbers, counts, step, y):
    """Move x by the answer, let go what must stay where it is, keep satisfied rows; y (QP_ROWS,) multipliers.

    Without an answer (SIZE 0, or one that was not found) step is empty. `Desk.side`, by row number, is written for rows that
    now leave, +1 at their upper bound, -1 at their lower one. A kept row is never tighter than the point reached.
    """
    desk = desk_of(numbers, counts)
    n = counts[N]
    k = counts[STAGE]
    last = k == counts[P] + 1
    r0 = desk.offsets[k] if not last else counts[M]
    r1 = desk.offsets[k + 1] if not last else counts[M]
    K = counts[KEPT]
    mS = counts[SOFT]
    size = numbers[SIZE]
    c0 = counts[TAKEN]
    rank = counts[RANK]
    if size > 0.0 and len(step):
        move(desk, c0, counts[T], rank, not last, step, size)
    c0 += rank
    leaving = 0
    for i in range(mS):
        row = desk.S[i]
        value = dot_row(desk.A, row, desk.x, 0)
        desk.right[i] = value
        desk.leaves[i] = size > 0.0 and max(desk.low[row] - value, value - desk.up[row]) > STRONG * size
        if desk.leaves[i]:
            desk.side[row] = 1 if value > desk.up[row] else -1
            if c0 < n:
                copy_row(desk.turned, n + K + i, desk.work, leaving)
                leaving += 1
    if leaving:
        c0 = take_leave(desk, n + K + mS, leaving, c0, r0, r1, numbers[RANK_TOLERANCE], True)
    leaving = 0
    for i in range(K):
        desk.right[mS + i] = dot_row(desk.kept, i, desk.x, 0)
        desk.leaves[mS + i] = len(y) > 0 and abs(y[mS + i]) > STRONG
        if desk.leaves[mS + i]:
            desk.side[desk.kept_ids[i]] = 1 if y[mS + i] > 0.0 else -1
            if c0 < n:
                copy_row(desk.turned, n + i, desk.work, leaving)
                leaving += 1
    if leaving:
        c0 = take_leave(desk, n + K + mS, leaving, c0, r0, r1, numbers[RANK_TOLERANCE], False)
    counts[TAKEN] = c0
    q = 0
    for i in range(K):
        if not desk.leaves[mS + i] and still_free(desk.turned, n + i, c0, n, 1.0):
            copy_row(desk.kept, i, desk.kept, q)
            copy_row(desk.turned, n + i, desk.turned, n + q)
            desk.kept_lower[q] = min(desk.kept_lower[i], desk.right[mS + i])
            desk.kept_upper[q] = max(desk.kept_upper[i], desk.right[mS + i])
            desk.kept_ids[q] = desk.kept_ids[i]
            q += 1
    for i in range(mS):
        row = desk.S[i]
        length = math.sqrt(sum_of_squares(desk.A, row, 0))
        if not desk.leaves[i] and length > 0.0 and still_free(desk.turned, n + K + i, c0, n, length):
            for j in range(desk.kept.shape[1]):
                desk.kept[q, j] = desk.A[row, j] / length
                desk.turned[n + q, j] = desk.turned[n + K + i, j] / length
            desk.kept_lower[q] = min(desk.low[row], desk.right[i]) / length
            desk.kept_upper[q] = max(desk.up[row], desk.right[i]) / length
            desk.kept_ids[q] = row
            q += 1
    counts[KEPT] = q


@inlined
def copy_row(A, i, B, k):
    """B[k] <- A[i]."""
    for j in range(A.shape[1]):
        B[k, j] = A[i, j]


@lean
def still_free(turned, i, c0, n, length):
    """Whether a row of that length has more than rounding left in the free directions."""
    return c0 < n and math.sqrt(sum_of_squares(turned, i, c0)) > 1e-12 * length
