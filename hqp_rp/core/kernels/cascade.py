"""Null-space priority (9)-(11) on N levels: the orthogonal cascade, and the textbook projector recursion."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.compile import kernel, lean
from hqp_rp.core.kernels.direct import equalities_of, sizes_of
from hqp_rp.core.kernels.householder import padded, reflect_rows_by_all
from hqp_rp.core.kernels.orthogonal import (
    damped_inverse,
    frobenius,
    level_least_squares,
    load,
    spectral,
    svd_level,
    triangle,
    turn_back_by,
    turn_back_reflectors,
    turn_forward_by,
)
from hqp_rp.core.kernels.room import STACK_NUMBERS, as_counts, as_matrix, numbers_at, stack_numbers


@lean
def finite(x):
    """True when every entry of x is finite."""
    for value in x:  # noqa: SIM110  numba compiles the loop, not the generator
        if not abs(value) < np.inf:
            return False
    return True


@kernel
def solve_level(W, n, r0, r1, c0, r, rank, U, S, t, zero, scale, kind, first, second, y):
    """y[c0:c0 + rank], the least-squares answer of a factored level to the right-hand side t (m,), damped by the policy.

    n: number of unknowns. The policy's parameters are in the unit of A_k; the factored rows are `scale` times larger.
    """
    m = r1 - r0
    if len(S):
        smallest = S[r - 1] if r == min(m, n - c0) else 0.0
        for j in range(rank):
            s = 0.0
            for i in range(m):
                s += U[i, j] * t[i]
            y[c0 + j] = s * damped_inverse(S[j], smallest, zero, kind, first * scale, second * scale)
    else:
        residual = t[:m].copy()
        level_least_squares(W, r0, r1, c0, r, residual)
        for j in range(r):
            y[c0 + j] = residual[j]


@lean
def null_space_room(M, n, p):
    """How many numbers `null_space_in` needs for M rows, n unknowns and p levels."""
    return (M + 1) * padded(n) + 5 * M + 4 * p + 1 + p * n * n


@kernel
def null_space(A, b, offsets, z, tol, kind, first, second, x):
    """x = z + sum_k Z_{k-1} (A_k Z_{k-1})^# (b_k - A_k x_{k-1}); True when x is finite.

    Damping acts on the pseudo-inverse that gives the level's answer, never on the null space that the level leaves.
    """
    M, n = A.shape
    room = np.empty(null_space_room(M, n, len(offsets) - 1))  # pages that no SVD writes to are never touched
    for j in range(n):
        x[j] = z[j]
    return null_space_in(room, A, b, offsets, tol, kind, first, second, x)


@lean
def null_space_of(problem, settings, x):
    """`null_space` for the problem described at this address; settings: address of tol, kind, first, second; x: z, then x."""
    M, n, p = sizes_of(problem)
    if null_space_room(M, n, p) > STACK_NUMBERS:
        return null_space_on_the_heap(problem, settings, x)
    return null_space_at(stack_numbers(), problem, settings, x)


@kernel
def null_space_on_the_heap(problem, settings, x):
    """The same where the stack has not the room."""
    M, n, p = sizes_of(problem)
    return null_space_at(np.empty(null_space_room(M, n, p)), problem, settings, x)


@lean
def null_space_at(room, problem, settings, x):
    """The same in a given room."""
    A, b, offsets = equalities_of(problem)
    given = numbers_at(settings, 4)
    return null_space_in(room, A, b, offsets, given[0], int(given[1]), given[2], given[3], x)


@lean
def null_space_in(room, A, b, offsets, tol, kind, first, second, x):
    """`null_space` in a given room, x holding z at first.

    The reflectors of finished levels reach a level when its turn comes: levels behind the last free direction need none.
    """
    M, n = A.shape
    p = len(offsets) - 1
    N = padded(n)
    W = as_matrix(room, M, N)
    y = room[M * N : M * N + N]
    vectors = room[M * N + N :]
    rhs = vectors[:M]
    t = vectors[M : 2 * M]
    ref_tau = vectors[2 * M : 3 * M]
    scale = vectors[3 * M : 3 * M + p]
    counts = as_counts(vectors[3 * M + p :], 2 * M + 3 * p + 1)
    turns = 5 * M + 4 * p + 1
    if not load(A, b, offsets, W, rhs, scale):
        return False
    ref_row = counts[:M]
    ref_col = counts[M : 2 * M]
    start = counts[2 * M : 2 * M + p + 1]
    column = counts[2 * M + p + 1 : 2 * M + 2 * p + 1]
    turned = counts[2 * M + 2 * p + 1 :]
    for j in range(N):
        y[j] = 0.0
    start[0] = 0
    c0 = 0
    levels = 0
    while levels < p and c0 < n:
        k = levels
        levels += 1
        r0 = offsets[k]
        r1 = offsets[k + 1]
        column[k] = c0
        turned[k] = 0
        start[k + 1] = start[k]
        if r0 == r1:
            continue
        norm = frobenius(W, r0, r1)
        for i in range(r0, r1):
            s = rhs[i]
            for j in range(n):
                s -= W[i, j] * x[j]
            t[i] = s
        for before in range(k):
            count = start[before + 1] - start[before]
            reflect_rows_by_all(W, r0, r1, W, offsets[before], count, column[before], ref_tau, start[before])
            if turned[before]:
                V = as_matrix(vectors[turns + before * n * n :], n, n)
                for i in range(r0, r1):
                    turn_forward_by(V, turned[before], W[i], column[before])
        for i in range(r0, r1):
            for j in range(c0):
                t[i] -= W[i, j] * y[j]
        r, proven = triangle(W, r0, r1, c0, r1, t, norm, tol, start[k], ref_row, ref_col, ref_tau)
        start[k + 1] += r
        if r == 0:
            continue
        right = t[r0:r1]
        if proven and kind == 0:
            level_least_squares(W, r0, r1, c0, r, right)
            for j in range(r):
                y[c0 + j] = right[j]
            c0 += r
            continue
        V = as_matrix(vectors[turns + k * n * n :], n, n)
        rank, _ = svd_level(W, n, r0, r1, c0, r1, r, A, r0, r1, scale[k], tol, right, kind, first, second, y, V)
        turned[k] = r
        c0 += rank
    for k in range(levels - 1, -1, -1):
        if turned[k]:
            turn_back_by(as_matrix(vectors[turns + k * n * n :], n, n), turned[k], y, column[k])
        turn_back_reflectors(W, y, start[k], start[k + 1], ref_row, ref_col, ref_tau)
    for j in range(n):
        x[j] += y[j]
    return finite(x)


@kernel
def pseudo_inverse(J, zero, kind, first, second):
    """J^# (n, m): V f(S) U^T with the policy's f for 1/sigma; a singular value <= `zero` counts as zero."""
    return apply_pseudo_inverse(J, zero, kind, first, second, np.eye(J.shape[0]))


@kernel
def apply_pseudo_inverse(J, zero, kind, first, second, t):
    """J^# t (n, k) for t (m, k), from the factors, which keeps the residual smaller than J^# formed first."""
    U, S, Vt = np.linalg.svd(J, False)
    smallest = S[len(S) - 1]
    y = np.dot(np.ascontiguousarray(U.T), t)
    for i in range(len(S)):
        y[i] *= damped_inverse(S[i], smallest, zero, kind, first, second) if S[i] > zero else 0.0
    return np.dot(np.ascontiguousarray(Vt.T), y)


@kernel
def null_space_projector(A, b, offsets, z, tol, kind, first, second, x):
    """The textbook recursion: x <- x + (A_k P)^# (b_k - A_k x), P <- P - (A_k P)^# A_k P, with P = I at first.

    P drifts away from a projector near an algorithmic singularity; kept so that this can be seen. Returns 0 when x is not
    finite, else 1 + the largest disturbance of a finished level by a later one, relative to ||A_k|| ||x|| + ||b_k||.
    """
    M, n = A.shape
    p = len(offsets) - 1
    W = np.empty((M, n))
    rhs = np.empty(M)
    scale = np.empty(p)
    if not load(A, b, offsets, W, rhs, scale):
        return 0.0
    x[:] = z
    P = np.eye(n)
    reached = np.empty(M)
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if r0 == r1:
            continue
        J = W[r0:r1].copy()
        zero = tol * spectral(W, r0, r1)
        JP = J @ P
        if not finite(JP.ravel()) or not finite(x):
            return 0.0
        t = (rhs[r0:r1] - J @ x).reshape((r1 - r0, 1))
        x += apply_pseudo_inverse(JP, zero, kind, first * scale[k], second * scale[k], t)[:, 0]
        P -= pseudo_inverse(JP, zero, 0, 0.0, 0.0) @ JP
        reached[r0:r1] = J @ x
    if not finite(x):
        return 0.0
    worst = 0.0
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        size = 0.0
        disturbed = 0.0
        for i in range(r0, r1):
            s = -reached[i]
            for j in range(n):
                s += W[i, j] * x[j]
            disturbed += s * s
            size += rhs[i] * rhs[i]
        size = np.sqrt(size) + frobenius(W, r0, r1) * np.sqrt(np.sum(x * x))
        if size > 0.0:
            worst = max(worst, np.sqrt(disturbed) / size)
    return 1.0 + worst
