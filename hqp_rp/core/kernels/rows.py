"""The rows of an active-set search: their values, bounds and states, how far a step may go, and how they are turned."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.orthogonal import EPS, turn_forward_by
from hqp_rp.core.kernels.vector import dot_row, reflect_four_rows, reflect_row

WAITING = 0  # of a level that has not been reached
KEPT = 1  # must stay within its bounds
FIXED = 2  # determined: its value stays as it is

LOW, UP, NORM, VALUE, CHANGE, BEFORE = range(6)
STATE, WORKING, GUESS, CONFLICT = range(4)


class Rows(NamedTuple):
    """M rows `low <= a_i x <= up`, stacked level by level, each level scaled by a power of two.

    R: (M, padded n): rows turned by what finished levels did; the columns of the freedom they left stand last. real (6, M):
    bounds `LOW` and `UP`, `NORM` ||a_i||, `VALUE` a_i x, its `CHANGE` along the step that is tried, and the value `BEFORE` it.
    flags (4, M): `STATE` (`WAITING`, `KEPT` or `FIXED`), `WORKING` (1 in the working set), `GUESS` (the bound at which a warm
    start hopes to find the row: -1, 0, +1), `CONFLICT` (1 for a hard row of a contradiction). side (M,): the bound at which a
    row is active, -1 lower, +1 upper (an equality has both), 0 none. x: (n,).

    Few arrays, since a call passes each of them field by field, and at seven unknowns that is most of its cost.
    """

    R: np.ndarray
    real: np.ndarray
    flags: np.ndarray
    side: np.ndarray
    x: np.ndarray


@lean
def load_rows(A, lower, upper, offsets, rows, scale):
    """Fill `rows`, all waiting and without values yet, and the scale of each level; False when a number is not finite."""
    n = A.shape[1]
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
        scale[k] = s
        for i in range(offsets[k], offsets[k + 1]):
            total = 0.0
            for j in range(n):
                a = A[i, j] * s
                rows.R[i, j] = a
                total += a * a
            for j in range(n, rows.R.shape[1]):
                rows.R[i, j] = 0.0
            rows.real[NORM, i] = math.sqrt(total)
            low = lower[i] * s
            up = upper[i] * s
            rows.real[LOW, i] = low
            rows.real[UP, i] = up
            rows.flags[STATE, i] = WAITING
            rows.flags[WORKING, i] = 0
            rows.flags[CONFLICT, i] = 0
            rows.flags[GUESS, i] = rows.side[i]
            rows.side[i] = 0
            if np.isnan(low) or np.isnan(up) or low == np.inf or up == -np.inf:
                finite = False
    return finite


@lean
def set_values(A, scale, rows, r0, r1):
    """The values of rows r0:r1 at x, from the rows as they were given."""
    n = A.shape[1]
    for i in range(r0, r1):
        s = 0.0
        for j in range(n):
            s += (A[i, j] * scale) * rows.x[j]
        rows.real[VALUE, i] = s


@inlined
def length_of(x):
    """||x||."""
    s = 0.0
    for value in x:
        s += value * value
    return math.sqrt(s)


@inlined
def level_norm(rows, r0, r1):
    """Frobenius norm of the loaded rows r0:r1."""
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
def gather(rows, row, c0, out, at):
    """Copy the free columns (c0:) of a row to out[at], from the beginning of their chunk of eight."""
    for j in range(c0 // 8 * 8, rows.R.shape[1]):
        out[at, j] = rows.R[row, j]


@inlined
def gather_unit(rows, row, c0, out, at):
    """Copy the free columns of a row to out[at], divided by the norm of the whole row (a row of zeros stays one)."""
    norm = rows.real[NORM, row]
    if norm == 0.0:
        norm = 1.0
    for j in range(c0 // 8 * 8, rows.R.shape[1]):
        out[at, j] = rows.R[row, j] / norm


@lean
def try_step(rows, end, r0, c0, step):
    """The change of every kept row, and of the rows r0:end of the level, along the whole step, whose first c0 entries are 0."""
    for i in range(end):
        if i >= r0 or rows.flags[STATE, i] == KEPT:
            s = dot_row(rows.R, i, step, c0)
            rows.real[CHANGE, i] = s
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


@inlined
def free_rows_from(rows, i, end):
    """How many of the rows i ... i + 3 (before `end`) are not fixed, up to the first one that is."""
    count = 0
    while count < 4 and i + count < end and rows.flags[STATE, i + count] != FIXED:
        count += 1
    return count


@lean
def turn_rows(rows, end, work, reflectors, ref_row, ref_col, ref_tau):
    """Turn the rows that are not fixed by the reflectors stored in `work`."""
    R = rows.R
    i = 0
    while i < end:
        count = free_rows_from(rows, i, end)
        if count == 4:
            for t in range(reflectors):
                reflect_four_rows(R, i, work, ref_row[t], ref_col[t], ref_tau[t])
        else:
            for row in range(i, i + count):
                for t in range(reflectors):
                    reflect_row(R, row, work, ref_row[t], ref_col[t], ref_tau[t])
        i += max(count, 1)


@lean
def turn_rows_by(rows, end, V, r, v0):
    """Turn columns v0:v0 + r of the rows that are not fixed by V, its leading r x r part."""
    for i in range(end):
        if rows.flags[STATE, i] != FIXED:
            turn_forward_by(V, r, rows.R[i], v0)
