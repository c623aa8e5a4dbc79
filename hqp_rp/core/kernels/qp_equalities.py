"""The quick way through levels of equalities: every rank proven by a triangle, every answer proven, else nothing is said.

Working rows W = A Q are turned as in the orthogonal cascade (`orthogonal`): behind level k the columns c_k ... of W are free,
x = start + Q y. Level k asks a back end for `min 1/2 ||w||^2 + g . w`, `g = -d / size`, where d is what its rows L (m, r)
still miss (r = m), or `R^-T L^T` of that where L = Q_L R has more rows than columns; then `L y = size w` or `R y = size w`.

What the proof uses of the factorization it checks against the problem's own rows: for a fixed vector u of random numbers,
`A (Q u) = W u` and `||Q u|| = ||u||` to rounding (Freivalds 1977), which wrong factors do not meet.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numba.core import types

from hqp_rp.core.kernels.compile import Compiled, entry, inlined, lean
from hqp_rp.core.kernels.direct import equalities_of
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import EPS, load, triangle, turn_back_reflectors, turn_forward
from hqp_rp.core.kernels.qp_factor import length_of, power_of_two
from hqp_rp.core.kernels.qp_tall import lay_down
from hqp_rp.core.kernels.room import as_matrix
from hqp_rp.core.kernels.vector import dot_row, sum_of_squares

PROVEN = 0  # done: x is proven optimal
OPEN = -1  # a rank, an answer or the optimum is not proven here

# Where what is in `numbers` and in `counts`.
TOLERANCE, RANK_TOLERANCE, SIZE = range(3)
SCALARS = 8
VECTORS = 7  # of unknowns, in the order of `Room`
N, M, P, STAGE = range(4)
SIZES = 4


class Room(NamedTuple):
    """Views of the two flat arrays that are kept between problems of one shape; vectors of unknowns are padded.

    A, W (M, N): rows, scaled by powers of two, and the same turned. T: flat, a transposed tall L (r, padded m).
    start, x, y, u, turned, gap, g: (N,). right: (padded M,), a level's right-hand side. rhs, order, tau (M,): the targets
    less A start, the order of rows, the reflectors' factors. scale, norm, target (p,): of each level the power of two,
    ||A_k||_F and ||b_k||, both scaled. row, column (M,): where reflectors are. first, free (p + 1,): of level k the first
    reflector and the first free column before it. pivot (n,): the order of a tall L's columns.
    """

    A: np.ndarray
    W: np.ndarray
    T: np.ndarray
    start: np.ndarray
    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    turned: np.ndarray
    gap: np.ndarray
    g: np.ndarray
    right: np.ndarray
    rhs: np.ndarray
    order: np.ndarray
    tau: np.ndarray
    scale: np.ndarray
    norm: np.ndarray
    target: np.ndarray
    row: np.ndarray
    column: np.ndarray
    first: np.ndarray
    free: np.ndarray
    pivot: np.ndarray


@lean
def room_parts(n, M, p):
    """Where A, W, T, the vectors, the rows, the levels end in `numbers`, the reflectors and the rest in `counts`."""
    wide = padded(n)
    tall = padded(M)
    A = SCALARS + M * wide
    T = A + M * wide + n * tall
    vectors = T + VECTORS * wide
    rows = vectors + tall + 3 * M
    reflectors = SIZES + 2 * M
    return A, A + M * wide, T, vectors, rows, rows + 3 * p, reflectors, reflectors + 2 * (p + 1) + n


@inlined
def room_of(numbers, counts):
    """The views of `Room`."""
    n = counts[N]
    m = counts[M]
    p = counts[P]
    A, W, T, vectors, rows, levels, reflectors, end = room_parts(n, m, p)
    wide = padded(n)
    return Room(
        as_matrix(numbers[SCALARS:A], m, wide),
        as_matrix(numbers[A:W], m, wide),
        numbers[W:T],
        numbers[T : T + wide],
        numbers[T + wide : T + 2 * wide],
        numbers[T + 2 * wide : T + 3 * wide],
        numbers[T + 3 * wide : T + 4 * wide],
        numbers[T + 4 * wide : T + 5 * wide],
        numbers[T + 5 * wide : T + 6 * wide],
        numbers[T + 6 * wide : vectors],
        numbers[vectors : rows - 3 * m],
        numbers[rows - 3 * m : rows - 2 * m],
        numbers[rows - 2 * m : rows - m],
        numbers[rows - m : rows],
        numbers[rows : rows + p],
        numbers[rows + p : rows + 2 * p],
        numbers[rows + 2 * p : levels],
        counts[SIZES : SIZES + m],
        counts[SIZES + m : reflectors],
        counts[reflectors : reflectors + p + 1],
        counts[reflectors + p + 1 : reflectors + 2 * p + 2],
        counts[reflectors + 2 * p + 2 : end],
    )


@lean
def go_on(problem, numbers, counts, w):
    """Begin (w empty) or go on with the answer w (r,) of the QP that was asked for; problem: the address of its description.

    Returns r > 0, the size of the QP to solve, its gradient being `Room.g`; `PROVEN`, x being `Room.x`; or `OPEN`.
    """
    matrix, rhs, offsets = equalities_of(problem)
    room = room_of(numbers, counts)
    if len(w) == 0:
        if not take_up(matrix, rhs, offsets, room):
            return OPEN
        counts[STAGE] = -1
    else:
        k = counts[STAGE]
        if not answered(room, offsets[k], offsets[k + 1], room.free[k], numbers[SIZE], numbers[TOLERANCE], w):
            return OPEN
    last = counts[P] - 1
    while counts[STAGE] < last:
        counts[STAGE] += 1
        k = counts[STAGE]
        r0 = offsets[k]
        r1 = offsets[k + 1]
        c0 = room.free[k]
        r, proven = triangle(
            room.W, r0, r1, c0, len(room.W), room.order, room.norm[k], numbers[RANK_TOLERANCE], room.first[k], room.row,
            room.column, room.tau,
        )  # fmt: skip
        room.first[k + 1] = room.first[k] + r
        room.free[k + 1] = c0 + r
        if not proven:
            return OPEN
        if r > 0:
            size = missing(room, r0, r1, c0, r, room.norm[k], room.target[k])
            numbers[SIZE] = size
            if size > 0.0:
                return r
            if size != 0.0:
                return OPEN
    return PROVEN if proven_by(counts[N], rhs, offsets, room, numbers[TOLERANCE]) else OPEN


@functools.cache
def go_on_entry() -> Compiled:
    """The machine code of `go_on`: numbers float64, counts int64 and w float64 must be contiguous vectors."""
    vector = types.float64[::1]
    return entry(go_on, (types.int64, vector, types.int64[::1], vector))


@lean
def take_up(matrix, rhs, offsets, room):
    """Load a problem, with what each row misses at the start; False when a number is not finite."""
    if not load(matrix, rhs, offsets, room.W, room.rhs, room.scale):
        return False
    room.first[0] = 0
    room.free[0] = 0
    for j in range(len(room.y)):
        room.y[j] = 0.0
    for k in range(len(offsets) - 1):
        square = 0.0
        target = 0.0
        for i in range(offsets[k], offsets[k + 1]):
            for j in range(room.W.shape[1]):
                room.A[i, j] = room.W[i, j]
            square += sum_of_squares(room.W, i, 0)
            target += room.rhs[i] * room.rhs[i]
            room.rhs[i] -= dot_row(room.W, i, room.start, 0)
            room.order[i] = i
        room.norm[k] = math.sqrt(square)
        room.target[k] = math.sqrt(target)
    return True


@lean
def missing(room, r0, r1, c0, r, norm, target):
    """Put the level's QP into g; returns its size, 0 when what is missing is rounding noise."""
    m = r1 - r0
    for i in range(m):
        # y is zero from c0 on, so that what stands there (L, reflectors) does not count.
        room.right[i] = room.rhs[int(room.order[r0 + i])] - dot_row(room.W, r0 + i, room.y, 0)
    if r < m:
        lay_down(room.W, r0, r1, c0, r, room.T, room.right, room.pivot)
    largest = 0.0
    s = 0.0
    for j in range(r):
        largest = max(largest, abs(room.right[j]))
        s += room.right[j] * room.right[j]
    if math.sqrt(s) <= 8.0 * EPS * (target + norm * (length_of(room.start) + length_of(room.y))):
        return 0.0
    if not largest < np.inf:
        return -1.0
    size = power_of_two(largest)
    for j in range(r):
        room.g[j] = room.right[j] / -size
    return size


@lean
def answered(room, r0, r1, c0, size, eps, w):
    """Take w (r,) for the level's answer into y; False where it does not meet `||w + g||_inf <= eps`."""
    r = len(w)
    m = r1 - r0
    for j in range(r):
        if not abs(w[j] + room.g[j]) <= eps:
            return False
    if r == m:
        for i in range(r):
            s = w[i] * size
            for j in range(i):
                s -= room.W[r0 + i, c0 + j] * room.y[c0 + j]
            room.y[c0 + i] = s / room.W[r0 + i, c0 + i]
        return True
    wide = padded(m)
    T = as_matrix(room.T[: r * wide], r, wide)
    for j in range(r - 1, -1, -1):
        s = w[j] * size
        for i in range(j + 1, r):
            s -= T[i, j] * room.right[i]
        room.right[j] = s / T[j, j] if T[j, j] != 0.0 else 0.0
    for j in range(r):
        room.y[c0 + room.pivot[j]] = room.right[j]
    return True


@lean
def proven_by(n, rhs, offsets, room, tolerance):
    """x <- start + Q y, and whether x is proven optimal to the relative `tolerance` (`verify` has the excess of a level)."""
    p = len(offsets) - 1
    count = room.first[p]
    for j in range(len(room.x)):
        room.x[j] = room.y[j]
        room.turned[j] = room.u[j]
    turn_back_reflectors(room.W, room.x, 0, count, room.row, room.column, room.tau)
    turn_back_reflectors(room.W, room.turned, 0, count, room.row, room.column, room.tau)
    head = room.g
    for j in range(len(room.x)):
        room.x[j] += room.start[j]
        room.gap[j] = room.x[j] - room.start[j]
        head[j] = 0.0
    x_size = length_of(room.x)
    u_size = length_of(room.u)
    if not x_size < 1e150 or not abs(length_of(room.turned) - u_size) <= (128.0 + 8.0 * n) * EPS * u_size:
        return False
    for k in range(p):
        r0 = offsets[k]
        m = offsets[k + 1] - r0
        c0 = room.free[k]
        r = room.free[k + 1] - c0
        allowed = (128.0 + 8.0 * n) * EPS * room.norm[k] * u_size
        square = 0.0
        for i in range(m):
            row = int(room.order[r0 + i])
            if i < r:
                head[c0 + i] = room.u[c0 + i]  # what stands behind the diagonal of L is the reflector
            if not abs(dot_row(room.A, row, room.turned, 0) - dot_row(room.W, r0 + i, head, 0)) <= allowed:
                return False
            room.right[i] = dot_row(room.A, row, room.x, 0) - rhs[row] * room.scale[k]
            square += room.right[i] * room.right[i]
        level_size = room.target[k]
        if m > 0:
            level_size += room.norm[k] / math.sqrt(min(m, n)) * x_size
        if math.sqrt(square) <= tolerance * level_size:
            continue
        if 0 < r < m:
            lay_down(room.W, r0, r0 + m, c0, r, room.T, room.right, room.pivot)
            square = 0.0
            for j in range(r):
                square += room.right[j] * room.right[j]
        elif r == 0:
            square = 0.0
        if not math.sqrt(square) <= (tolerance + 4.0 * EPS * (n + m)) * level_size:
            return False
    turn_forward(room.W, room.gap, 0, count, room.row, room.column, room.tau)
    square = 0.0
    for j in range(room.free[p], n):
        square += room.gap[j] * room.gap[j]
    return math.sqrt(square) <= (tolerance + 8.0 * EPS * n) * (x_size + length_of(room.start))
