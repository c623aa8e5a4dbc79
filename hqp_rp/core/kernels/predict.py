"""A guess of a level's working set, by a dual active-set method on the level made strictly convex.

    min ||B s - t||^2 + WEIGHT^2 ||s_2||^2    subject to    low_i <= value_i + g_i s <= up_i   (kept rows),

s_2 being the directions that B does not see. With B = [L 0] Q^T and L^T L = R^T R this is the least-distance problem
min ||u||^2 in u = (R y_1 - q, WEIGHT y_2), s = Q y, whose dual needs the Gram matrix of the active rows alone: a row enters
or leaves for O(rows * unknowns), where the exact search factors afresh. Nothing here has to be accurate: the exact search
starts from the rows found and accepts nothing else than its own conditions of optimality.

Source: Goldfarb and Idnani 1983; Arnström, Bemporad and Axehill 2022 (the dual in Gram form).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel, lean
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import lq
from hqp_rp.core.kernels.room import as_matrix
from hqp_rp.core.kernels.rows import GUESS, KEPT, LOW, NONE, STATE, UP, VALUE, level_norm
from hqp_rp.core.kernels.vector import add_multiple, dot_row, sum_of_squares
from hqp_rp.core.kernels.vector_rows import copy_row

WEIGHT = 1e-4
VIOLATED = 1e-9  # of a row's length in u


@lean
def normal_triangle(T, m, c0, r, P):
    """The lower triangle P of L^T L = P P^T for L (m, r) in the leading rows of T from column c0; False when it breaks down."""
    for i in range(r):
        for j in range(i + 1):
            s = 0.0
            for row in range(i, m):
                s += T[row, c0 + i] * T[row, c0 + j]
            for col in range(j):
                s -= P[i, col] * P[j, col]
            if i > j:
                P[i, j] = s / P[j, j]
            elif s > 0.0:
                P[i, i] = math.sqrt(s)
            else:
                return False
    return True


@lean
def forget_row(C, at, count):
    """Delete row `at` of the Cholesky factor C of a Gram matrix of `count` rows."""
    for i in range(at, count - 1):
        for j in range(i + 2):
            C[i, j] = C[i + 1, j]
    for c in range(at, count - 1):
        length = math.hypot(C[c, c], C[c, c + 1])
        cosine = C[c, c] / length
        sine = C[c, c + 1] / length
        for i in range(c, count - 1):
            x = C[i, c]
            y = C[i, c + 1]
            C[i, c] = cosine * x + sine * y
            C[i, c + 1] = cosine * y - sine * x


@lean
def least_distance(G, value, low, up, u, C, vectors, busy, active, side, limit):
    """Active rows of min ||u||^2 subject to low <= value + G u <= up, G padded.

    Fills `active` and `side` (as long as `value`) and returns how many are active. An inconsistent system ends with those
    that are active when that is found. u (2, padded d): the point, and the direction of a step. C (., .), vectors (4, .) and
    busy (.,): as long as the rows and the unknowns that there are, and one more; all are written anew.
    """
    K, d = G.shape
    most = min(K, d)
    square = vectors[0]
    multiplier = vectors[1]
    l = vectors[2]
    w = vectors[3]
    for j in range(d):
        u[0, j] = 0.0
    for i in range(K):
        square[i] = sum_of_squares(G, i, 0)
        busy[i] = square[i] == 0.0
    count = NONE
    for _ in range(limit):
        p = -1
        worst = VIOLATED
        for i in range(K):
            if busy[i] != 0:
                continue
            h = value[i] + dot_row(G, i, u[0], 0)
            over = max(h - up[i], low[i] - h) / math.sqrt(square[i])
            if over > worst:
                worst = over
                p = i
        if p < 0:
            break
        h = value[p] + dot_row(G, p, u[0], 0)
        sign = 1.0 if h > up[p] else -1.0
        own = 0.0
        while True:
            delta = square[p]
            for i in range(count):
                s = dot_row(G, active[i], G[p], 0)
                for j in range(i):
                    s -= C[i, j] * l[j]
                l[i] = s / C[i, i]
                delta -= l[i] * l[i]
            for i in range(count - 1, -1, -1):
                s = l[i]
                for j in range(i + 1, count):
                    s -= C[j, i] * w[j]
                w[i] = s / C[i, i]
            over = max(value[p] + dot_row(G, p, u[0], 0) - up[p], 0.0)
            if sign < 0.0:
                over = max(low[p] - value[p] - dot_row(G, p, u[0], 0), 0.0)
            whole = over / delta if delta > 1e-12 * square[p] and count < most else np.inf
            part = np.inf
            out = NONE - 1
            for i in range(count):
                c = sign * w[i] * side[i]
                if c > 0.0 and multiplier[i] * side[i] < part * c:
                    part = multiplier[i] * side[i] / c
                    out = i
            tau = min(whole, part)
            if not tau < np.inf:  # inconsistent, or a number overflowed
                return count
            copy_row(u, 1, G, p)
            for i in range(count):
                multiplier[i] -= tau * sign * w[i]
                add_multiple(u[1], G, active[i], -w[i])
            own += tau * sign
            add_multiple(u[0], u, 1, -tau * sign)
            if whole <= part:
                for i in range(count):
                    C[count, i] = l[i]
                C[count, count] = math.sqrt(delta)
                active[count] = p
                side[count] = 1 if sign > 0.0 else -1
                multiplier[count] = own
                busy[p] = 1
                count += 1
                break
            busy[active[out]] = 0
            forget_row(C, out, count)
            for i in range(out, count - 1):
                active[i] = active[i + 1]
                side[i] = side[i + 1]
                multiplier[i] = multiplier[i + 1]
            count -= 1
    return count


@kernel
def guess_working_set(rows, r0, r1, c0, d, goal):
    """Put into `GUESS` the side of every kept row that is likely to be active at the minimum of level r0:r1, 0 for others.

    All rows of the level must be equalities, and T up to date. d: the freedom, columns c0:c0 + d. goal (padded n,): where
    r0 == r1, what ||s - goal|| is minimized for.
    """
    m = r1 - r0
    K = NONE
    for i in range(r0):
        if rows.flags[STATE, i] == KEPT:
            K += 1
    if K == 0:
        return
    n = rows.R.shape[1]  # padded, as D is
    D = padded(d)
    most = min(K, D) + 1
    r = min(m, d)
    guess_in(
        np.empty((m + K) * n + K * D + 3 * D + r * r + most * most + 4 * (K + D + 1) + 3 * K + 2 * m),
        np.empty(4 * K + 2 * m, np.int64),
        rows, r0, m, K, c0, d, goal,
    )  # fmt: skip


@lean
def guess_in(room, counts, rows, r0, m, K, c0, d, goal):
    """`guess_working_set` in a given room, for K kept rows and m rows of the level."""
    n = rows.R.shape[1]
    D = padded(d)
    most = min(K, D) + 1
    r = min(m, d)
    end = (m + K) * n
    T = as_matrix(room[:end], m + K, n)
    G = as_matrix(room[end : end + K * D], K, D)
    end += K * D
    u = as_matrix(room[end : end + 2 * D], 2, D)
    q = room[end + 2 * D : end + 3 * D]
    end += 3 * D
    C = as_matrix(room[end : end + most * most], most, most)
    end += most * most
    vectors = as_matrix(room[end : end + 4 * (K + D + 1)], 4, K + D + 1)
    end += 4 * (K + D + 1)
    bounds = as_matrix(room[end : end + 3 * K], 3, K)
    end += 3 * K
    target = room[end : end + m]
    tau = room[end + m : end + 2 * m]
    end += 2 * m
    P = as_matrix(room[end : end + r * r], r, r)
    which = as_matrix(counts[: 3 * K], 3, K)
    busy = counts[3 * K : 4 * K]
    reflectors = as_matrix(counts[4 * K :], 2, m)
    K = NONE
    for i in range(r0):
        if rows.flags[STATE, i] == KEPT:
            copy_row(T, m + K, rows.T, i)
            which[0, K] = i
            K += 1
    for i in range(m):
        copy_row(T, i, rows.T, r0 + i)
        target[i] = rows.real[LOW, r0 + i] - rows.real[VALUE, r0 + i]
    for j in range(D):
        q[j] = 0.0
    scale = 1.0
    if m:
        floor = 1e-8 * level_norm(rows, r0, r0 + m)
        r = lq(T, NONE, m, c0, m + K, target, floor, NONE, reflectors[0], reflectors[1], tau)
        if not normal_triangle(T, m, c0, r, P):
            r = NONE
        scale = 1.0 / WEIGHT
        for i in range(r):
            s = 0.0
            for row in range(i, m):
                s += T[row, c0 + i] * target[row]
            for j in range(i):
                s -= P[i, j] * q[j]
            q[i] = s / P[i, i]
    else:
        for j in range(d):
            q[j] = goal[c0 + j]
    for i in range(K):
        row = which[0, i]
        for j in range(d):
            s = T[m + i, c0 + j]
            if j < r:
                for col in range(j):
                    s -= P[j, col] * G[i, col]
                G[i, j] = s / P[j, j]
            else:
                G[i, j] = s * scale
        for j in range(d, D):
            G[i, j] = 0.0
        bounds[0, i] = rows.real[VALUE, row] + dot_row(G, i, q, 0)
        bounds[1, i] = rows.real[LOW, row]
        bounds[2, i] = rows.real[UP, row]
        rows.flags[GUESS, row] = 0
    count = least_distance(
        G, bounds[0], bounds[1], bounds[2], u, C, vectors, busy, which[1], which[2], 3 * K + 20
    )  # fmt: skip
    for i in range(count):
        rows.flags[GUESS, which[0, which[1, i]]] = which[2, i]
