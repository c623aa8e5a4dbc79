"""The room of an active-set search, and what finished levels turned: from their freedom to x and back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import kernel, lean
from hqp_rp.core.kernels.householder import padded, turn_vector
from hqp_rp.core.kernels.orthogonal import turn_back_by, turn_forward_by

ENTERED, COUNTED, REF_ROW, REF_COL, DONE_COL = range(5)
ORIGIN, TARGET, MULTIPLIER, REF_TAU, STEP, GRADIENT, DONE_TAU, MOVE = range(8)
FIRST, END, TURNED_AT, TURNED = range(4)


class Room(NamedTuple):
    """Arrays that a search writes anew, few for the reason given in `Rows`.

    matrix (., padded n): the kept rows W of the working set, then the rows B of the level that count; factored.
    done (M, padded n): reflectors of finished levels. marks (p + 1, 4): of each finished level, its reflectors `FIRST`:`END`
    and the column `TURNED_AT` at which its `TURNED` columns were turned by an SVD, by turns[k] (p + 1, n, n).
    lists (5, .): `ENTERED` is W; `COUNTED` is B, or in the end the rows that a level determined; `REF_ROW`, `REF_COL` of the
    reflectors in `matrix`; `DONE_COL` of those in `done`.
    real (8, .): `ORIGIN`, which listed row stands where after the factorization's swaps; `TARGET` of each row of B;
    `MULTIPLIER` of each row of W; `REF_TAU`, `DONE_TAU`; vectors `STEP`, `GRADIENT` and `MOVE` (n,), zero behind.
    """

    matrix: np.ndarray
    done: np.ndarray
    turns: np.ndarray
    marks: np.ndarray
    lists: np.ndarray
    real: np.ndarray


@kernel
def make_room(M, n, p, largest):
    """Room for p levels of up to `largest` rows, M in all."""
    N = padded(n)
    size = max(N + largest + 1, M)
    return Room(
        np.empty((N + largest + 1, N)),
        np.empty((M, N)),  # a level cut by the rank rule turns more often than it takes directions
        np.empty((p + 1, n, n)),  # pages that no SVD writes to are never touched
        np.zeros((p + 1, 4), np.int64),
        np.empty((5, size), np.int64),
        np.zeros((8, size)),
    )


@lean
def from_free(room, levels, step, move):
    """move (n,) <- Z step: a step in the freedom that `levels` finished levels left, as a step of x."""
    n = room.turns.shape[1]
    for j in range(n):
        move[j] = step[j]
    for k in range(levels - 1, -1, -1):
        if room.marks[k, TURNED]:
            turn_back_by(room.turns[k], room.marks[k, TURNED], move, room.marks[k, TURNED_AT])
        for t in range(room.marks[k, END] - 1, room.marks[k, FIRST] - 1, -1):
            turn_vector(move, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])


@lean
def to_free(room, levels, step):
    """step <- the coordinates of a step of x, those of the freedom that `levels` finished levels left standing last."""
    for k in range(levels):
        for t in range(room.marks[k, FIRST], room.marks[k, END]):
            turn_vector(step, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])
        r = room.marks[k, TURNED]
        if r:
            turn_forward_by(room.turns[k], r, step, room.marks[k, TURNED_AT])


@lean
def keep_turns(room, k, reflectors, turned, v0):
    """Remember what level k turned."""
    first = room.marks[k - 1, END] if k else 0
    room.marks[k, FIRST] = first
    room.marks[k, END] = first + reflectors
    room.marks[k, TURNED] = turned
    room.marks[k, TURNED_AT] = v0
    for t in range(reflectors):
        room.lists[DONE_COL, first + t] = room.lists[REF_COL, t]
        room.real[DONE_TAU, first + t] = room.real[REF_TAU, t]
        row = room.lists[REF_ROW, t]
        for j in range(room.done.shape[1]):
            room.done[first + t, j] = room.matrix[row, j]
