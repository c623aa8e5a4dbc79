"""The arrays of a lexicographic descent by QPs: one flat array of numbers and one of counts, and views of them.

Two flat arrays, since a kernel's caller pays for each array that it passes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean

# Where what is in `counts`.
SIZES = 16
N, M, P, STAGE, TAKEN, KEPT, T, QP_ROWS, SOFT, RANK, CODE, DENSE, POLISH = range(13)
# Where what is in `numbers`.
SCALARS = 4
SIZE, TOLERANCE, RANK_TOLERANCE, INFINITE = range(4)


class Desk(NamedTuple):
    """Views of the two flat arrays on which a descent works. N: n filled up to a multiple of eight (`vector`).

    raw, lower, upper: (M, n), (M,) hard rows and levels as they came. A (M, N), low, up (M,): the stage's rows scaled, at
    their own place. kept (M, N), kept_lower, kept_upper (M,): the first KEPT, rows of length one that stay within bounds.
    turned (n + M, N): Q, then kept rows times Q, then the stage's two-sided rows times Q. work (M, N): rows being factored,
    times Q. B (n, n): w = B z. tall: flat, a transposed tall L. tau, order, residual, lengths (M,), right (M padded).
    c, sharp (n,): the QP's target and the curvature's root. x, start, least, z (N,): the point, where it began, the least
    violation of the hard rows, a vector in columns of Q. guess_x (p + 2, n), guess_y (p + 2, M): warm starts by stage.
    qp: flat, see `qp_parts`. row, column (M,): reflectors. kept_ids, E, S (M,): row numbers of what is kept, of the stage's
    equalities and of its two-sided rows. pivot (n,). known (p + 2,): which warm starts there are. side (M,): which rows
    left at which bound. leaves (M,): which rows of the stage's QP are about to. offsets (p + 2,): stage k has rows
    offsets[k] ... offsets[k + 1] - 1.
    """

    raw: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    A: np.ndarray
    low: np.ndarray
    up: np.ndarray
    kept: np.ndarray
    kept_lower: np.ndarray
    kept_upper: np.ndarray
    turned: np.ndarray
    work: np.ndarray
    B: np.ndarray
    tall: np.ndarray
    tau: np.ndarray
    order: np.ndarray
    residual: np.ndarray
    lengths: np.ndarray
    right: np.ndarray
    c: np.ndarray
    sharp: np.ndarray
    x: np.ndarray
    start: np.ndarray
    least: np.ndarray
    z: np.ndarray
    guess_x: np.ndarray
    guess_y: np.ndarray
    qp: np.ndarray
    row: np.ndarray
    column: np.ndarray
    kept_ids: np.ndarray
    E: np.ndarray
    S: np.ndarray
    pivot: np.ndarray
    known: np.ndarray
    side: np.ndarray
    leaves: np.ndarray
    offsets: np.ndarray


@lean
def qp_parts(t, m, soft):
    """Where the parts of a QP begin in `Desk.qp`, and the length of all.

    hessian (t,), gradient (t,), rows (m, t), lower (m,), upper (m,), guess t (t,), guess y (m,); the same with slacks, N =
    t + soft: H (N, N), g (N,), C (m, N), lower (m,), upper (m,), start (N,).
    """
    full = t + soft
    rows = 2 * t
    lower = rows + m * t
    upper = lower + m
    guess_t = upper + m
    guess_y = guess_t + t
    H = guess_y + m
    g = H + full * full
    C = g + full
    low = C + m * full
    up = low + m
    start = up + m
    return t, rows, lower, upper, guess_t, guess_y, H, g, C, low, up, start, start + full


@lean
def desk_parts(n, M, p):
    """Where the groups of arrays begin in `numbers` and, the last two, in `counts`, and the lengths of both.

    Groups of equal arrays: (M, n) raw; (M, N) A, kept, work; turned; B; tall; (M,) ten of them; right; (n,) c, sharp;
    (N,) x, start, least, z; guess_x; guess_y; qp. Then (M,) row, column, kept_ids, E, S, side, leaves; the others.
    """
    N_ = (n + 7) // 8 * 8
    high = (M + 7) // 8 * 8
    wide = SCALARS + M * n
    turned = wide + 3 * M * N_
    B = turned + (n + M) * N_
    tall = B + n * n
    rows = tall + n * high
    right = rows + 10 * M
    short = right + high
    vectors = short + 2 * n
    guess_x = vectors + 4 * N_
    guess_y = guess_x + (p + 2) * n
    qp = guess_y + (p + 2) * M
    others = SIZES + 7 * M
    return (
        wide, turned, B, tall, rows, right, short, vectors, guess_x, guess_y, qp, qp + qp_parts(n, M, M)[12],
        others, others + n + 2 * (p + 2),
    )  # fmt: skip


@inlined
def desk_of(numbers, counts):
    """The views of `Desk`."""
    n = counts[N]
    m = counts[M]
    stages = counts[P] + 2
    wide, turned, B, tall, rows, right, short, vectors, guess_x, guess_y, qp, _, others, end = desk_parts(
        n, m, counts[P]
    )
    N_ = (n + 7) // 8 * 8
    return Desk(
        numbers[SCALARS:wide].reshape((m, n)),
        numbers[rows : rows + m],
        numbers[rows + m : rows + 2 * m],
        numbers[wide : wide + m * N_].reshape((m, N_)),
        numbers[rows + 2 * m : rows + 3 * m],
        numbers[rows + 3 * m : rows + 4 * m],
        numbers[wide + m * N_ : wide + 2 * m * N_].reshape((m, N_)),
        numbers[rows + 4 * m : rows + 5 * m],
        numbers[rows + 5 * m : rows + 6 * m],
        numbers[turned:B].reshape((n + m, N_)),
        numbers[wide + 2 * m * N_ : turned].reshape((m, N_)),
        numbers[B:tall].reshape((n, n)),
        numbers[tall:rows],
        numbers[rows + 6 * m : rows + 7 * m],
        numbers[rows + 7 * m : rows + 8 * m],
        numbers[rows + 8 * m : rows + 9 * m],
        numbers[rows + 9 * m : right],
        numbers[right:short],
        numbers[short : short + n],
        numbers[short + n : vectors],
        numbers[vectors : vectors + N_],
        numbers[vectors + N_ : vectors + 2 * N_],
        numbers[vectors + 2 * N_ : vectors + 3 * N_],
        numbers[vectors + 3 * N_ : guess_x],
        numbers[guess_x:guess_y].reshape((stages, n)),
        numbers[guess_y:qp].reshape((stages, m)),
        numbers[qp:],
        counts[SIZES : SIZES + m],
        counts[SIZES + m : SIZES + 2 * m],
        counts[SIZES + 2 * m : SIZES + 3 * m],
        counts[SIZES + 3 * m : SIZES + 4 * m],
        counts[SIZES + 4 * m : SIZES + 5 * m],
        counts[others : others + n],
        counts[others + n : others + n + stages],
        counts[SIZES + 5 * m : SIZES + 6 * m],
        counts[SIZES + 6 * m : others],
        counts[others + n + stages : end],
    )
