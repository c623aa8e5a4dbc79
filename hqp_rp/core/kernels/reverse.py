"""Reverse priority (20)-(29) on N levels: lowest level first, each higher one corrected along T_k.

For level k and the rows B = [J_{k+1}; ...; J_p] of all lower levels, T_k holds the first columns of [J_k; B]^+ (25), so
range(T_k) = { S^+ J_k^T mu } with S = J_k^T J_k + B^T B, and the step T_k (J_k T_k)^# r of (29) is the solution of

    min ||B d||^2 + lambda^2 ||d||^2     subject to     J_k d = r (in the least-squares sense),  d of least norm,

the correction that disturbs all lower levels least, jointly; lambda is the damping of the pseudo-inverse that gives T_k.
That problem is what is factored here: J_k by orthogonal transformations, d = Y y + Z w, then the lower rows in the
freedom Z that J_k leaves. It never squares a matrix, and J_k d = r holds to rounding error at any condition.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.cascade import apply_pseudo_inverse, finite, pseudo_inverse, solve_level
from hqp_rp.core.kernels.compile import kernel, lean
from hqp_rp.core.kernels.direct import equalities_of, sizes_of
from hqp_rp.core.kernels.orthogonal import (
    damped_inverse,
    factor,
    forward_substitution,
    load,
    lower_block,
    spectral,
    tall_least_squares,
    turn_back,
)
from hqp_rp.core.kernels.reverse_plain import DONE, UNPROVEN, plain_columns, plain_room, row_weights
from hqp_rp.core.kernels.room import STACK_NUMBERS, numbers_at, stack_numbers


@kernel
def level_weights(scale, offsets, k):
    """`row_weights` in an array of its own."""
    weight = np.empty(offsets[len(offsets) - 1] - offsets[k])
    row_weights(scale, offsets, k, weight)
    return weight


@kernel
def weighted_rows(C, weight):
    """A copy of C (m, r) with row i multiplied by weight[i]."""
    out = np.empty(C.shape)
    for i in range(C.shape[0]):
        for j in range(C.shape[1]):
            out[i, j] = C[i, j] * weight[i]
    return out


@kernel
def disturbance(W, m, rank, y):
    """-B Y y: what the lower rows (below row m of W) must be given back for the step Y y that level k needs."""
    out = np.empty(len(W) - m)
    for i in range(len(out)):
        s = 0.0
        for j in range(rank):
            s -= W[m + i, j] * y[j]
        out[i] = s
    return out


@kernel
def compensate(W, W0, m, rank, tol, weight, t0, ref_row, ref_col, ref_tau, Y):
    """Complete each row y of Y by the least-norm w of min ||B (Y y + Z w)||; the lower rows of W are factored in place.

    Returns (reflectors, V) of that factorization. Where B Z has full row rank no lower level is disturbed and weights
    play no part.
    """
    below = len(W) - m
    origin = np.arange(len(W)) * 1.0  # follows the rows as the factorization swaps them
    r, low, V, U, S = factor(
        W, m, len(W), rank, len(W), origin, W0, m, len(W), 1.0, tol, False, t0, ref_row, ref_col, ref_tau
    )
    if low == 0:
        return r, V
    moved = np.empty(below)
    for i in range(below):
        moved[i] = weight[int(origin[m + i])]
    heaviest = np.argsort(-moved)
    for row in range(len(Y)):
        y = Y[row]
        t = disturbance(W, m, rank, y)
        if len(S) == 0 and low == below:
            forward_substitution(W, m, rank, low, t, y)
            continue
        C = U[:, :low] * S[:low] if len(S) else lower_block(W, m, len(W), rank, low)
        t = (t * moved)[heaviest]
        tall_least_squares(weighted_rows(C, moved)[heaviest], t)
        y[rank : rank + low] = t[:low]
    return r, V


@kernel
def compensate_damped(W, m, rank, weight, factor_, Y):
    """Complete each row y of Y by the w of min ||B (Y y + Z w)||^2 + factor_^2 ||w||^2."""
    below = len(W) - m
    U, S, Vt = np.linalg.svd(weighted_rows(W[m:, rank:], weight[m:]), False)
    for row in range(len(Y)):
        y = Y[row]
        t = disturbance(W, m, rank, y) * weight[m:]
        for l in range(len(S)):
            s = 0.0
            for i in range(below):
                s += U[i, l] * t[i]
            s *= damped_inverse(S[l], 0.0, 0.0, 1, factor_, 0.0)
            for j in range(Vt.shape[1]):
                y[rank + j] += s * Vt[l, j]


@kernel
def correction(W0, m, weight, t, tol, factor_, basis):
    """Row 0: the step T_k (J_k T_k)^# t of (29) (n,). With `basis`, the rows behind it span range(T_k).

    W0: loaded rows of level k (the first m) and of all lower levels. t: (m,) loaded residual of level k. factor_: damping
    of the pseudo-inverse that gives T_k, for rows weighted by `weight`.
    """
    rows, n = W0.shape
    W = W0.copy()
    ref_row = np.empty(rows, np.int64)
    ref_col = np.empty(rows, np.int64)
    ref_tau = np.empty(rows)
    right = np.zeros(rows)
    right[:m] = t
    r, rank, V, U, S = factor(W, 0, m, 0, rows, right, W0, 0, m, 1.0, tol, False, 0, ref_row, ref_col, ref_tau)
    Y = np.zeros((1 + rank if basis else 1, n))
    solve_level(W, n, 0, m, 0, r, rank, U, S, right, 0.0, 1.0, 0, 0.0, 0.0, Y[0])
    for j in range(1, len(Y)):
        Y[j, j - 1] = 1.0
    r_low = 0
    V_low = np.empty((0, 0))
    if rows > m and 0 < rank < n:
        if factor_ > 0.0:
            compensate_damped(W, m, rank, weight, factor_, Y)
        else:
            r_low, V_low = compensate(W, W0, m, rank, tol, weight, r, ref_row, ref_col, ref_tau, Y)
    for row in range(len(Y)):
        turn_back(W, Y[row], rank, V_low, r, r + r_low, ref_row, ref_col, ref_tau)
        turn_back(W, Y[row], 0, V, 0, r, ref_row, ref_col, ref_tau)
    return Y


@kernel
def augmented_damping(J, smallest_scale, kind, first, second):
    """The damping factor of [J_k; B]^#, in the unit of its weighted rows J: constant, or (19) from its sigma_m."""
    if kind == 1:
        return first * smallest_scale
    if kind != 2:
        return 0.0
    _, S, _ = np.linalg.svd(J, False)
    ratio = S[len(S) - 1] / (first * smallest_scale)
    return 0.0 if ratio >= 1.0 else math.sqrt((1.0 - ratio) * (1.0 + ratio)) * second * smallest_scale


@kernel
def smallest_of(scale, k):
    """The scale of the largest level of k ... p - 1: weighted rows are the given rows times it."""
    out = np.inf
    for i in range(k, len(scale)):
        out = min(out, scale[i])
    return out


@kernel
def residual(W0, r0, r1, rhs, x):
    """rhs - J x of loaded rows r0:r1."""
    out = np.empty(r1 - r0)
    for i in range(r0, r1):
        s = rhs[i]
        for j in range(W0.shape[1]):
            s -= W0[i, j] * x[j]
        out[i - r0] = s
    return out


@kernel
def add_step(x, step):
    """x += step; True when the sum is much smaller than what was added up, so that its rounding error shows."""
    before = 0.0
    after = 0.0
    for j in range(len(x)):
        before = max(before, abs(x[j]))
        x[j] += step[j]
        after = max(after, abs(x[j]))
    return before > 4.0 * after


@kernel
def range_projector(T):
    """T T^+ (n, n), from the left singular vectors of T (n, d)."""
    U, S, _ = np.linalg.svd(T, False)
    rank = 0
    while rank < len(S) and S[rank] > 1e-12 * S[0]:
        rank += 1
    Q = np.ascontiguousarray(U[:, :rank])
    return np.dot(Q, np.ascontiguousarray(Q.T))


@kernel
def reverse_priority(A, b, offsets, z, tol, kind, first, second, projector, x):
    """x <- x + T_k (J_k T_k)^# (b_k - J_k x) for k = p, ..., 1, from x = z: (29). True when x is finite.

    With `projector`, the step is (J_k P_{k+1})^# (b_k - J_k x) instead: (20)-(22), where P_{k+1} is (27), which is
    T_k T_k^+ + the projector on null([J_k; B]); the second part drops out of J_k P_{k+1}, as (28) shows, and is left out.
    Damping (kind, first, second) acts on the pseudo-inverse that gives T_k alone. Where a step cancels most of what lower
    levels had put into x, its residual is corrected once more.
    """
    M, n = A.shape
    p = len(offsets) - 1
    W0 = np.empty((M, n))
    rhs = np.empty(M)
    scale = np.empty(p)
    if not load(A, b, offsets, W0, rhs, scale):
        return False
    x[:] = z
    for k in range(p - 1, -1, -1):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        m = r1 - r0
        if m == 0:
            continue
        rows = W0[r0:]
        weight = level_weights(scale, offsets, k)
        unit = smallest_of(scale, k)
        factor_ = 0.0
        V = np.zeros((n, 0))
        if kind != 0:
            J = weighted_rows(rows, weight)
            factor_ = augmented_damping(J, unit, kind, first, second)
            if kind == 3:
                _, S, Vt = np.linalg.svd(J, False)
                kept = 0
                while kept < len(S) and S[kept] > first * unit:
                    kept += 1
                if kept == 0:
                    continue
                V = np.ascontiguousarray(Vt[:kept].T)
                rows = np.dot(rows.copy(), V)
        for _ in range(2):
            t = residual(W0, r0, r1, rhs, x)
            Y = correction(rows, m, weight, t, tol, factor_, projector)
            if kind == 3:
                Y = np.dot(Y, np.ascontiguousarray(V.T))
            step = Y[0]
            if projector and len(Y) > 1:  # else J_k is zero and T_k with it
                P = range_projector(np.ascontiguousarray(Y[1:].T))
                J_k = np.dot(W0[r0:r1].copy(), P)
                zero = tol * spectral(W0, r0, r1)
                step = np.dot(P, apply_pseudo_inverse(J_k, zero, 0, 0.0, 0.0, t.reshape((m, 1)))[:, 0].copy())
            if not add_step(x, step):
                break
    return finite(x)


@kernel
def reverse_priority_damped_everywhere(A, b, offsets, z, tol, kind, first, second, projector, x):
    """(29) or (22) with every pseudo-inverse damped, as a plain reading of (15) in (32) has it; spoils level 1."""
    M, n = A.shape
    p = len(offsets) - 1
    W0 = np.empty((M, n))
    rhs = np.empty(M)
    scale = np.empty(p)
    if not load(A, b, offsets, W0, rhs, scale):
        return False
    x[:] = z
    for k in range(p - 1, -1, -1):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        m = r1 - r0
        if m == 0:
            continue
        unit = smallest_of(scale, k)
        J = weighted_rows(W0[r0:], level_weights(scale, offsets, k))
        zero = tol * spectral(J, 0, len(J))
        T = pseudo_inverse(J, zero, kind, first * unit, second * unit)[:, :m].copy()
        J_k = J[:m].copy()
        t = residual(W0, r0, r1, rhs, x) * (unit / scale[k])
        if projector:
            inner = J_k @ range_projector(T)
            step = pseudo_inverse(inner, tol * spectral(J, 0, m), kind, first * unit, second * unit) @ t
        else:
            inner = J_k @ T
            step = T @ (pseudo_inverse(inner, tol * spectral(inner, 0, m), kind, first, second) @ t)
        x += step
    return finite(x)


@kernel
def columns_form(A, b, offsets, z, tol, kind, first, second, x):
    """(29), damped by T_k alone."""
    if kind == 0:
        code = plain_columns(np.empty(plain_room(A.shape[0], A.shape[1], len(offsets) - 1)), A, b, offsets, z, tol, x)
        if code != UNPROVEN:
            return code == DONE
    return reverse_priority(A, b, offsets, z, tol, kind, first, second, False, x)


@lean
def columns_form_of(problem, settings, x):
    """`columns_form` for the problem described at this address; settings: address of tol, kind, first, second; x: z, then x."""
    M, n, p = sizes_of(problem)
    if n + plain_room(M, n, p) > STACK_NUMBERS:
        return columns_form_on_the_heap(problem, settings, x)
    return columns_form_at(stack_numbers(), problem, settings, x)


@kernel
def columns_form_on_the_heap(problem, settings, x):
    """The same where the stack has not the room."""
    M, n, p = sizes_of(problem)
    return columns_form_at(np.empty(n + plain_room(M, n, p)), problem, settings, x)


@lean
def columns_form_at(room, problem, settings, x):
    """The same in a given room."""
    A, b, offsets = equalities_of(problem)
    M, n = A.shape
    size = plain_room(M, n, len(offsets) - 1)
    given = numbers_at(settings, 4)
    tol = given[0]
    kind = int(given[1])
    z = room[size : size + n]
    for j in range(n):
        z[j] = x[j]
    if kind == 0:
        code = plain_columns(room, A, b, offsets, z, tol, x)
        if code != UNPROVEN:
            return code == DONE
    return reverse_priority(A, b, offsets, z, tol, kind, given[2], given[3], False, x)


@kernel
def projector_form(A, b, offsets, z, tol, kind, first, second, x):
    """(20)-(22), damped by T_k alone."""
    return reverse_priority(A, b, offsets, z, tol, kind, first, second, True, x)


@kernel
def damped_columns_form(A, b, offsets, z, tol, kind, first, second, x):
    """(29), damped everywhere."""
    return reverse_priority_damped_everywhere(A, b, offsets, z, tol, kind, first, second, False, x)


@kernel
def damped_projector_form(A, b, offsets, z, tol, kind, first, second, x):
    """(20)-(22), damped everywhere."""
    return reverse_priority_damped_everywhere(A, b, offsets, z, tol, kind, first, second, True, x)
