"""The rows of an active-set search: their values, bounds and states, how far a step may go, and what it turns."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, kernel
from hqp_rp.core.kernels.orthogonal import EPS

WAITING = 0  # of a level that has not been reached
KEPT = 1  # must stay within its bounds
FIXED = 2  # determined: its value stays as it is


class Rows(NamedTuple):
    """M rows `low <= a_i x <= up`, stacked level by level, each level scaled by a power of two.

    R: (M + n, n): rows in the coordinates of the freedom that finished levels left; the last n are the basis Z itself, so
    that x moves by Z d and row i's value by R_i d. loaded: (M, n) rows as loaded. low, up, norms, value: (M,). level: (M,)
    level of each row. state: (M,) `WAITING`, `KEPT` or `FIXED`. side: (M,) the bound at which a row is active: -1 lower,
    +1 upper (an equality has both), 0 none. working: (M,) whether it is in the working set. x: (n,).
    """

    R: np.ndarray
    loaded: np.ndarray
    low: np.ndarray
    up: np.ndarray
    norms: np.ndarray
    value: np.ndarray
    level: np.ndarray
    state: np.ndarray
    side: np.ndarray
    working: np.ndarray
    x: np.ndarray


@kernel
def load_rows(A, lower, upper, offsets, side, x):
    """(rows, whether all numbers are finite) for a search that starts at x; every row is waiting and none is working."""
    M, n = A.shape
    rows = Rows(
        np.empty((M + n, n)),
        np.empty((M, n)),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.empty(M, np.int64),
        np.empty(M, np.int64),
        side,
        np.zeros(M, np.bool_),
        x,
    )
    finite = True
    for k in range(len(offsets) - 1):
        big = 0.0
        for i in range(offsets[k], offsets[k + 1]):
            for j in range(n):
                a = abs(A[i, j])
                if not a < np.inf:
                    finite = False
                big = max(big, a)
        s = 1.0
        if big > 0.0 and finite:
            s = math.ldexp(1.0, max(-1000, min(1000, -math.frexp(big)[1])))
        for i in range(offsets[k], offsets[k + 1]):
            total = 0.0
            value = 0.0
            for j in range(n):
                a = A[i, j] * s
                rows.R[i, j] = a
                rows.loaded[i, j] = a
                total += a * a
                value += a * x[j]
            rows.norms[i] = math.sqrt(total)
            rows.value[i] = value
            rows.low[i] = lower[i] * s
            rows.up[i] = upper[i] * s
            rows.level[i] = k
            rows.state[i] = WAITING
            side[i] = 0
            if np.isnan(rows.low[i]) or np.isnan(rows.up[i]) or rows.low[i] == np.inf or rows.up[i] == -np.inf:
                finite = False
    for i in range(n):
        for j in range(n):
            rows.R[M + i, j] = 1.0 if i == j else 0.0
    return rows, finite


@inlined
def bound_of(rows, i):
    """The bound at which row i is active."""
    return rows.up[i] if rows.side[i] > 0 else rows.low[i]


@inlined
def miss(rows, size, i):
    """How far row i is from its active bound, signed; what rounding error can explain at an x of this size is 0."""
    bound = bound_of(rows, i)
    w = rows.value[i] - bound
    return w if abs(w) > 64.0 * EPS * (rows.norms[i] * size + abs(bound)) else 0.0


@inlined
def activate(rows, i, side):
    """Put row i into the working set at that bound."""
    rows.side[i] = side
    rows.working[i] = True


@inlined
def release(rows, i):
    """Take row i out of the working set."""
    rows.side[i] = 0
    rows.working[i] = False


@inlined
def compress(W, count, rows):
    """Drop the rows of the list W that are no longer working; returns how many remain."""
    still = 0
    for i in range(count):
        if rows.working[W[i]]:
            W[still] = W[i]
            still += 1
    return still


@inlined
def gather(rows, listed, count, c0, out, at):
    """Copy the free columns (c0:) of the listed rows to out[at:]."""
    for i in range(count):
        for j in range(c0, rows.R.shape[1]):
            out[at + i, j - c0] = rows.R[listed[i], j]


@inlined
def gather_unit(rows, listed, count, c0, out):
    """Copy the free columns of the listed rows to `out`, each divided by the norm of its whole row."""
    for i in range(count):
        for j in range(c0, rows.R.shape[1]):
            out[i, j - c0] = rows.R[listed[i], j] / rows.norms[listed[i]]


@kernel
def move(rows, c0, step, length):
    """x += length * Z step, and every row's value with it; False when x is not finite."""
    R = rows.R
    M = len(rows.value)
    d = len(step)
    for i in range(M):
        s = 0.0
        for j in range(d):
            s += R[i, c0 + j] * step[j]
        rows.value[i] += length * s
    finite = True
    for i in range(len(rows.x)):
        s = 0.0
        for j in range(d):
            s += R[M + i, c0 + j] * step[j]
        rows.x[i] += length * s
        if not abs(rows.x[i]) < np.inf:
            finite = False
    return finite


@kernel
def first_to_block(rows, k, c0, step, span, slack, depends):
    """(length, row, side): how far in [0, 1] the step goes and what stops it, a kept row or one of level k that is left.

    span: ||step||. Of rows nearer to their bounds than `slack` times their size the first stops it at once, whatever
    rounding says of their order: with slack > 0 as Bland's rule needs it. A row that changes by less than `depends` times
    its norm depends on the working set, as its factorization sees it, and cannot block.
    """
    best = 1.0
    row = -1
    side = 0
    for i in range(len(rows.state)):
        if rows.working[i] or not (rows.state[i] == KEPT or (rows.state[i] == WAITING and rows.level[i] == k)):
            continue
        s = 0.0
        for j in range(len(step)):
            s += rows.R[i, c0 + j] * step[j]
        if abs(s) <= 2.0 * depends * rows.norms[i] * span:
            continue
        bound = rows.up[i] if s > 0.0 else rows.low[i]
        if abs(bound) == np.inf:
            continue
        room = bound - rows.value[i] if s > 0.0 else rows.value[i] - bound
        length = 0.0 if room <= slack * (rows.norms[i] + 1e-3 * abs(bound)) else room / abs(s)
        if length < best:
            best, row, side = length, i, 1 if s > 0.0 else -1
    return best, row, side


@kernel
def turn_rows(rows, listed, count, c0, work, V, v0, reflectors, ref_row, ref_col, ref_tau):
    """Turn the free columns of the listed rows by the reflectors stored in `work`, then by V at column v0."""
    R = rows.R
    d = R.shape[1] - c0
    r = len(V)
    turned = np.empty(r)
    for i in range(count):
        row = listed[i]
        for t in range(reflectors):
            c = ref_col[t]
            w = ref_row[t]
            dot = R[row, c0 + c]
            for j in range(c + 1, d):
                dot += R[row, c0 + j] * work[w, j]
            dot *= ref_tau[t]
            R[row, c0 + c] -= dot
            for j in range(c + 1, d):
                R[row, c0 + j] -= dot * work[w, j]
        for j in range(r):
            s = 0.0
            for col in range(r):
                s += R[row, c0 + v0 + col] * V[col, j]
            turned[j] = s
        for j in range(r):
            R[row, c0 + v0 + j] = turned[j]
