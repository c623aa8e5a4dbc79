"""The rows of an active-set search: their values, bounds and states, and how far a step may go."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.vector import dot_row
from hqp_rp.core.kernels.vector_rows import inverse_power, largest_of_rows, scale_row

WAITING = 0  # of a level that has not been reached
KEPT = 1  # must stay within its bounds
FIXED = 2  # determined: its value stays as it is

LOW, UP, NORM, VALUE, CHANGE, BEFORE = range(6)
STATE, WORKING, GUESS, CONFLICT, TURNS = range(5)
REALS: Any = np.int64(6)
FLAGS: Any = np.int64(5)

NONE: Any = np.int64(0)
"""Zero where it is handed to a kernel: for a literal 0 numba would compile the kernel once more."""


class Rows(NamedTuple):
    """M rows `low <= a_i x <= up`, stacked level by level, each level scaled by a power of two.

    R (M, padded n): the rows. T (M, padded n): those that were needed, turned by what finished levels did; the columns of the
    freedom they left stand last. real (6, M): bounds `LOW` and `UP`, `NORM` ||a_i||, `VALUE` a_i x, its `CHANGE` along the
    step that is tried, and the value `BEFORE` it. flags (5, M): `STATE` (`WAITING`, `KEPT` or `FIXED`), `WORKING` (1 in the
    working set), `GUESS` (the bound at which a warm start hopes to find the row: -1, 0, +1), `CONFLICT` (1 for a hard row of
    a contradiction), `TURNS` (by how many finished levels row i of T is turned, -1 when it has not been needed).
    side (M,): the bound at which a row is active, -1 lower, +1 upper (an equality has both), 0 none.
    """

    R: np.ndarray
    T: np.ndarray
    real: np.ndarray
    flags: np.ndarray
    side: np.ndarray


@inlined
def load_rows(rows, A, lower, upper, offsets):
    """Fill `rows`, all waiting and without values yet; False when a number is not finite."""
    n = A.shape[1]
    finite = True
    for i in range(A.shape[0]):
        for j in range(n):
            rows.R[i, j] = A[i, j]
        for j in range(n, rows.R.shape[1]):
            rows.R[i, j] = 0.0
    for k in range(len(offsets) - 1):
        big = largest_of_rows(rows.R, offsets[k], offsets[k + 1])
        s = 1.0
        if not big < np.inf:
            finite = False
        elif big > 0.0:
            s = inverse_power(big)
        for i in range(offsets[k], offsets[k + 1]):
            rows.real[NORM, i] = math.sqrt(scale_row(rows.R, i, s))
            low = lower[i] * s
            up = upper[i] * s
            rows.real[LOW, i] = low
            rows.real[UP, i] = up
            rows.flags[STATE, i] = WAITING
            rows.flags[WORKING, i] = 0
            rows.flags[CONFLICT, i] = 0
            rows.flags[TURNS, i] = -1
            rows.flags[GUESS, i] = rows.side[i]
            rows.side[i] = 0
            if not (low < np.inf and up > -np.inf):
                finite = False
    return finite


@inlined
def level_norm(rows, r0, r1):
    """Frobenius norm of the rows r0:r1."""
    s = 0.0
    for i in range(r0, r1):
        s += rows.real[NORM, i] * rows.real[NORM, i]
    return math.sqrt(s)


@inlined
def bound_of(rows, i):
    """The bound at which row i is active."""
    return rows.real[UP, i] if rows.side[i] > 0 else rows.real[LOW, i]


@inlined
def miss(rows, size, i):
    """How far row i is from its active bound, signed; what rounding error can explain at an x of this size is 0."""
    bound = bound_of(rows, i)
    w = rows.real[VALUE, i] - bound
    return w if abs(w) > 64.0 * EPS * (rows.real[NORM, i] * size + abs(bound)) else 0.0


@inlined
def activate(rows, i, side):
    """Put row i into the working set at that bound."""
    rows.side[i] = side
    rows.flags[WORKING, i] = 1


@inlined
def release(rows, i):
    """Take row i out of the working set."""
    rows.side[i] = 0
    rows.flags[WORKING, i] = 0


@inlined
def compress(W, count, rows):
    """Drop the rows of the list W that are no longer working; returns how many remain."""
    still = 0
    for i in range(count):
        if rows.flags[WORKING, W[i]]:
            W[still] = W[i]
            still += 1
    return still


@inlined
def beyond(rows, i, size):
    """Whether row i is outside its bounds by more than rounding error can explain at an x of this size."""
    value = rows.real[VALUE, i]
    bound = rows.real[UP, i] if value > rows.real[UP, i] else rows.real[LOW, i]
    over = max(value - rows.real[UP, i], rows.real[LOW, i] - value)
    return over > 0.0 and over > 64.0 * EPS * (rows.real[NORM, i] * size + abs(bound))


@inlined
def set_values(rows, vectors, point, r0, r1):
    """The values of rows r0:r1 at row `point` of `vectors`."""
    for i in range(r0, r1):
        rows.real[VALUE, i] = dot_row(rows.R, i, vectors[point], 0)


@inlined
def try_step(rows, vectors, move, end, r0):
    """Values of every kept row, and of the rows r0:end of the level, after row `move` of `vectors` as a step of x.

    Returns how many rows that are not in the working set are then outside their bounds.
    """
    outside = 0
    for i in range(end):
        if i >= r0 or rows.flags[STATE, i] == KEPT:
            change = dot_row(rows.R, i, vectors[move], 0)
            value = rows.real[VALUE, i]
            rows.real[CHANGE, i] = change
            rows.real[BEFORE, i] = value
            value += change
            rows.real[VALUE, i] = value
            if (value > rows.real[UP, i] or value < rows.real[LOW, i]) and rows.flags[WORKING, i] == 0:
                outside += 1
    return outside


@inlined
def still(rows, end, r0):
    """The change of a step that is rounding error: none."""
    for i in range(end):
        if i >= r0 or rows.flags[STATE, i] == KEPT:
            rows.real[CHANGE, i] = 0.0
            rows.real[BEFORE, i] = rows.real[VALUE, i]


@lean
def set_length(rows, end, r0, length):
    """Values after that part of the step that was tried; length 0 goes back to where it began."""
    for i in range(end):
        if i >= r0 or rows.flags[STATE, i] == KEPT:
            rows.real[VALUE, i] = rows.real[BEFORE, i] + length * rows.real[CHANGE, i]


@inlined
def room_to_bound(rows, i, span, slack, depends):
    """(part of the step at which row i meets a bound, the side): (inf, 0) where it meets none.

    A row that changes by less than `depends` times its norm depends on the working set, as its factorization sees it, and
    cannot block. A row nearer to its bound than `slack` times its size meets it at once.
    """
    s = rows.real[CHANGE, i]
    norm = rows.real[NORM, i]
    part = np.inf
    side = 0
    if abs(s) > 2.0 * depends * norm * span:
        bound = rows.real[UP, i] if s > 0.0 else rows.real[LOW, i]
        if abs(bound) < np.inf:
            room = bound - rows.real[BEFORE, i] if s > 0.0 else rows.real[BEFORE, i] - bound
            part = 0.0 if room <= slack * (norm + 1e-3 * abs(bound)) else room / abs(s)
            side = 1 if s > 0.0 else -1
    return part, side


@lean
def first_to_block(rows, end, r0, span, slack, depends):
    """(length, row, side): how far in [0, 1] the step that was tried goes and what stops it, a kept row or one of r0:end.

    span: ||step||. Of rows nearer to their bounds than `slack` times their size the first stops it at once, whatever
    rounding says of their order: with slack > 0 as Bland's rule needs it.
    """
    best = 1.0
    row = -1
    side = 0
    for i in range(end):
        if rows.flags[WORKING, i] or not (i >= r0 or rows.flags[STATE, i] == KEPT):
            continue
        part, which = room_to_bound(rows, i, span, slack, depends)
        if part < best:
            best, row, side = part, i, which
    return best, row, side
