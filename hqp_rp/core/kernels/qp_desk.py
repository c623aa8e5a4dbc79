"""The arrays of a lexicographic descent by QPs: one flat array of numbers and one of counts, and views of them.

Two flat arrays, since a kernel's caller pays for each array that it passes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, kernel

# Where what is in `counts`.
SIZES = 16
N, M, P, STAGE, FREE, KEPT, T, QP_ROWS, SOFT, FREE_AFTER, CODE, DENSE, POLISH = range(13)
# Where what is in `numbers`.
SCALARS = 4
SIZE, TOLERANCE, RANK_TOLERANCE, INFINITE = range(4)


class Desk(NamedTuple):
    """Views of the two flat arrays on which a descent works; flat matrices have the shape of the moment.

    raw, lower, upper: (M, n), (M,) hard rows and levels as they came. x, start, least: (n,) the point, where it began, the
    least violation of the hard rows. Z: flat (n, FREE). A, low, up: flat; rows of the stage, scaled. T, Z0: flat (n, T),
    (n, FREE_AFTER), of the QP being solved. kept, kept_lower, kept_upper, kept_ids: rows kept, the first KEPT of M.
    lengths: (M,). S: (M,). eye: (n, n). guess_x (p + 2, n), guess_y (p + 2, M + n), known (p + 2,): warm starts by stage.
    side: (M + n,) which rows left at which bound. offsets: (p + 2,), stage k has rows offsets[k] ... offsets[k + 1] - 1.
    """

    raw: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    x: np.ndarray
    start: np.ndarray
    least: np.ndarray
    Z: np.ndarray
    A: np.ndarray
    low: np.ndarray
    up: np.ndarray
    T: np.ndarray
    Z0: np.ndarray
    kept: np.ndarray
    kept_lower: np.ndarray
    kept_upper: np.ndarray
    lengths: np.ndarray
    eye: np.ndarray
    guess_x: np.ndarray
    guess_y: np.ndarray
    qp: np.ndarray
    kept_ids: np.ndarray
    S: np.ndarray
    known: np.ndarray
    side: np.ndarray
    offsets: np.ndarray


@kernel
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


@kernel
def desk_size(n, M, p):
    """(length of `numbers`, of `counts`) for n unknowns, M rows and p levels."""
    qp = qp_parts(n, M, M)[12]
    numbers = SCALARS + M * n + 2 * M + 3 * n + n * n + M * n + 2 * M + 2 * n * n + M * n + 3 * M + n * n
    numbers += (p + 2) * (2 * n + M) + qp
    return numbers, SIZES + 2 * M + (p + 2) + (M + n) + (p + 2)


@inlined
def desk_of(numbers, counts):
    """The views of `Desk`."""
    n = counts[N]
    M_ = counts[M]
    stages = counts[P] + 2
    o = SCALARS
    raw = numbers[o : o + M_ * n].reshape((M_, n))
    o += M_ * n
    lower = numbers[o : o + M_]
    o += M_
    upper = numbers[o : o + M_]
    o += M_
    x = numbers[o : o + n]
    o += n
    start = numbers[o : o + n]
    o += n
    least = numbers[o : o + n]
    o += n
    Z = numbers[o : o + n * n]
    o += n * n
    A = numbers[o : o + M_ * n]
    o += M_ * n
    low = numbers[o : o + M_]
    o += M_
    up = numbers[o : o + M_]
    o += M_
    T_ = numbers[o : o + n * n]
    o += n * n
    Z0 = numbers[o : o + n * n]
    o += n * n
    kept = numbers[o : o + M_ * n].reshape((M_, n))
    o += M_ * n
    kept_lower = numbers[o : o + M_]
    o += M_
    kept_upper = numbers[o : o + M_]
    o += M_
    lengths = numbers[o : o + M_]
    o += M_
    eye = numbers[o : o + n * n].reshape((n, n))
    o += n * n
    guess_x = numbers[o : o + stages * n].reshape((stages, n))
    o += stages * n
    guess_y = numbers[o : o + stages * (M_ + n)].reshape((stages, M_ + n))
    o += stages * (M_ + n)
    q = SIZES
    return Desk(
        raw, lower, upper, x, start, least, Z, A, low, up, T_, Z0, kept, kept_lower, kept_upper, lengths, eye, guess_x,
        guess_y, numbers[o:], counts[q : q + M_], counts[q + M_ : q + 2 * M_], counts[q + 2 * M_ : q + 2 * M_ + stages],
        counts[q + 2 * M_ + stages : q + 3 * M_ + n + stages], counts[q + 3 * M_ + n + stages :],
    )  # fmt: skip
