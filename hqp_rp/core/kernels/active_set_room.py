"""The arrays of an active-set search, and what finished levels turned: from their freedom to x and back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core.kernels.by_address import COUNT, COUNTS, ENTRIES, MATRIX, PAGES, arrays_at, enter
from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import turn_back_by, turn_forward_by
from hqp_rp.core.kernels.rows import FIXED, FLAGS, NONE, REALS, STATE, TURNS, Rows
from hqp_rp.core.kernels.vector import reflect_four_rows, reflect_row
from hqp_rp.core.kernels.vector_rows import copy_row

ENTERED, COUNTED, REF_ROW, REF_COL, DONE_COL = range(5)
ORIGIN, TARGET, MULTIPLIER, GRADIENT, REF_TAU, DONE_TAU = range(6)
POINT, STEP, MOVE, NEXT, GOAL = range(5)
FIRST, END, TURNED_AT, TURNED = range(4)


class Room(NamedTuple):
    """What a search writes anew.

    matrix (., padded n): the kept rows W of the working set and the rows B of the level that count; factored.
    done (M, padded n): reflectors of finished levels. marks (p + 1, 4): of each finished level, its reflectors `FIRST`:`END`
    and the column `TURNED_AT` at which its `TURNED` columns were turned by an SVD, by turns[k] (p + 1, n, n).
    lists (5, .): `ENTERED` is W; `COUNTED` is B, or in the end the rows that a level determined; `REF_ROW`, `REF_COL` of the
    reflectors in `matrix`; `DONE_COL` of those in `done`.
    real (6, .): `ORIGIN`, which listed row stands where after the factorization's swaps; `TARGET` of each row of B;
    `MULTIPLIER` of each row of W; `GRADIENT` along each; `REF_TAU`, `DONE_TAU`.
    vectors (5, padded n), zero behind n: `POINT`, where the search stands; `STEP` in the freedom of finished levels and the
    same `MOVE` of x; the point `NEXT` after it; `GOAL`, what x should be near to.
    """

    matrix: np.ndarray
    done: np.ndarray
    turns: np.ndarray
    marks: np.ndarray
    lists: np.ndarray
    real: np.ndarray
    vectors: np.ndarray


at = arrays_at(
    (Rows, (MATRIX, MATRIX, MATRIX, COUNTS, COUNT)),
    (Room, (MATRIX, MATRIX, PAGES, COUNTS, COUNTS, MATRIX, MATRIX)),
)
"""rows, room = at(address)."""

ARRAYS = len(Rows._fields) + len(Room._fields)
SIDE = Rows._fields.index("side")
LINE = 8  # eight-byte words of a cache line: a row of eight entries lies in one

ONE: Any = np.int64(1)


@lean
def shapes(M, n, p, largest):
    """The shapes of the arrays in their order, all but `side`, for p levels of up to `largest` rows, M in all."""
    N = padded(n)
    size = max(N + largest + 1, M)
    return (
        (M, N, ONE), (M, N, ONE), (REALS, M, ONE), (FLAGS, M, ONE),
        (N + largest + 1, N, ONE),
        (M, N, ONE),  # a level cut by the rank rule turns more often than it takes directions
        (p + 1, n, n),  # pages that no SVD writes to are never touched
        (p + 1, 4 * ONE, ONE), (5 * ONE, size, ONE), (6 * ONE, size, ONE), (5 * ONE, N, ONE),
    )  # fmt: skip


@lean
def words(M, n, p, largest):
    """Eight-byte words that the arrays and their table take."""
    total = ENTRIES * ARRAYS + LINE
    for i, j, k in shapes(M, n, p, largest):
        total += i * j * k + LINE
    return total


@lean
def lay_out(block, side, M, n, p, largest):
    """Divide a block of `words` integers among the arrays; returns the address for `at`. Nothing is written to them."""
    address = np.int64(block.ctypes.data)
    free = address + 8 * ENTRIES * ARRAYS
    number = NONE
    for i, j, k in shapes(M, n, p, largest):
        if number == SIDE:
            enter(block, number, np.int64(side.ctypes.data), M, ONE, ONE)
            number += 1
        free = (free + 63) // 64 * 64
        enter(block, number, free, i, j, k)
        free += i * j * k * 8
        number += 1
    return address


@lean
def from_free(address, levels):
    """`MOVE` <- Z `STEP`: a step in the freedom that `levels` finished levels left, as a step of x."""
    _, room = at(address)
    copy_row(room.vectors, MOVE, room.vectors, STEP)
    for k in range(levels - 1, -1, -1):
        if room.marks[k, TURNED]:
            turn_back_by(room.turns[k], room.marks[k, TURNED], room.vectors[MOVE], room.marks[k, TURNED_AT])
        for t in range(room.marks[k, END] - 1, room.marks[k, FIRST] - 1, -1):
            reflect_row(room.vectors, MOVE, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])


@lean
def to_free(address, levels, step):
    """Row `step` of `vectors` <- the coordinates of a step of x: those of the freedom that finished levels left stand last."""
    _, room = at(address)
    for k in range(levels):
        for t in range(room.marks[k, FIRST], room.marks[k, END]):
            reflect_row(room.vectors, step, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])
        if room.marks[k, TURNED]:
            turn_forward_by(room.turns[k], room.marks[k, TURNED], room.vectors[step], room.marks[k, TURNED_AT])


@lean
def turn_rows(address, i0, i1, levels):
    """T[i] of the rows i0:i1 that are not fixed <- what `levels` finished levels make of R[i]; four alike side by side."""
    rows, room = at(address)
    i = i0
    while i < i1:
        begun = rows.flags[TURNS, i]
        if begun == levels or rows.flags[STATE, i] == FIXED:
            i += 1
            continue
        end = i + 1
        while end < min(i + 4, i1) and rows.flags[TURNS, end] == begun and rows.flags[STATE, end] != FIXED:
            end += 1
        for row in range(i, end):
            rows.flags[TURNS, row] = levels
            if begun < 0:
                copy_row(rows.T, row, rows.R, row)
        for k in range(max(begun, 0), levels):
            t0 = room.marks[k, FIRST]
            t1 = room.marks[k, END]
            if end - i == 4:
                for t in range(t0, t1):
                    reflect_four_rows(rows.T, i, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])
            else:
                for row in range(i, end):
                    for t in range(t0, t1):
                        reflect_row(rows.T, row, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])
            if room.marks[k, TURNED]:
                for row in range(i, end):
                    turn_forward_by(room.turns[k], room.marks[k, TURNED], rows.T[row], room.marks[k, TURNED_AT])
        i = end


@lean
def keep_turns(address, k, reflectors, turned, v0):
    """Remember what level k turned."""
    _, room = at(address)
    first = room.marks[k - 1, END] if k else 0
    room.marks[k, FIRST] = first
    room.marks[k, END] = first + reflectors
    room.marks[k, TURNED] = turned
    room.marks[k, TURNED_AT] = v0
    for t in range(reflectors):
        room.lists[DONE_COL, first + t] = room.lists[REF_COL, t]
        room.real[DONE_TAU, first + t] = room.real[REF_TAU, t]
        copy_row(room.done, first + t, room.matrix, room.lists[REF_ROW, t])
