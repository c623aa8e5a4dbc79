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

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import lq
from hqp_rp.core.kernels.rows import GUESS, KEPT, LOW, STATE, UP, VALUE, level_norm
from hqp_rp.core.kernels.vector import add_multiple, copy_row, dot_row, sum_of_squares

WEIGHT = 1e-4
VIOLATED = 1e-9  # of a row's length in u


@kernel
def normal_triangle(T, m, r, P):
    """The lower triangle P of L^T L = P P^T for L (m, r) in the leading rows and columns of T; False when it breaks down."""
    for i in range(r):
        for j in range(i + 1):
            s = 0.0
            for row in range(i, m):
                s += T[row, i] * T[row, j]
            for col in range(j):
                s -= P[i, col] * P[j, col]
            if i > j:
                P[i, j] = s / P[j, j]
            elif s > 0.0:
                P[i, i] = math.sqrt(s)
            else:
                return False
    return True


@kernel
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


@kernel
def least_distance(G, value, low, up, active, side, limit):
    """Active rows of min ||u||^2 subject to low <= value + G u <= up, G padded.

    Fills `active` and `side` (as long as `value`) and returns how many are active. An inconsistent system ends with those
    that are active when that is found.
    """
    K, d = G.shape
    most = min(K, d)
    C = np.empty((most + 1, most + 1))
    vectors = np.empty((4, K + d + 1))
    square = vectors[0]
    multiplier = vectors[1]
    l = vectors[2]
    w = vectors[3]
    u = np.zeros((2, d))  # the point, and the direction of a step
    busy = np.zeros(K, np.bool_)
    for i in range(K):
        square[i] = sum_of_squares(G, i, 0)
        if square[i] == 0.0:
            busy[i] = True
    count = 0
    for _ in range(limit):
        p = -1
        worst = VIOLATED
        for i in range(K):
            if busy[i]:
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
            out = -1
            for i in range(count):
                c = sign * w[i] * side[i]
                if c > 0.0 and multiplier[i] * side[i] < part * c:
                    part = multiplier[i] * side[i] / c
                    out = i
            tau = min(whole, part)
            if not tau < np.inf:  # inconsistent, or a number overflowed
                return count
            u[1] = 0.0
            add_multiple(u[1], G, p, 1.0)
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
                busy[p] = True
                count += 1
                break
            busy[active[out]] = False
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
    n = rows.R.shape[1]  # padded, as d is
    m = r1 - r0
    K = 0
    for i in range(r0):
        if rows.flags[STATE, i] == KEPT:
            K += 1
    T = np.zeros((m + K, n))
    which = np.empty((3, K), np.int64)
    K = 0
    for i in range(r0):
        if rows.flags[STATE, i] == KEPT:
            copy_row(T, m + K, rows.T, i)
            which[0, K] = i
            K += 1
    target = np.empty(m)
    for i in range(m):
        copy_row(T, i, rows.T, r0 + i)
        target[i] = rows.real[LOW, r0 + i] - rows.real[VALUE, r0 + i]
    G = np.zeros((K, padded(d)))
    bounds = np.empty((3, K))
    r = 0
    P = np.empty((0, 0))
    q = np.zeros(padded(d))
    scale = 1.0
    if m:
        reflectors = np.empty((2, m), np.int64)
        floor = 1e-8 * level_norm(rows, r0, r1)
        r = lq(T, 0, m, c0, m + K, target, floor, 0, reflectors[0], reflectors[1], np.empty(m))
        P = np.empty((r, r))
        if not normal_triangle(T[:, c0:].copy(), m, r, P):
            r = 0
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
        bounds[0, i] = rows.real[VALUE, row] + dot_row(G, i, q, 0)
        bounds[1, i] = rows.real[LOW, row]
        bounds[2, i] = rows.real[UP, row]
        rows.flags[GUESS, row] = 0
    count = least_distance(G, bounds[0], bounds[1], bounds[2], which[1], which[2], 3 * K + 20)
    for i in range(count):
        rows.flags[GUESS, which[0, which[1, i]]] = which[2, i]
