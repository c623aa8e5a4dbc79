"""The arrays of one proof that an answer is optimal (`verify`), carved from one room of numbers and one of counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.room import as_matrix


class Proof(NamedTuple):
    """The arrays of one proof, rows padded to N columns.

    W (M + 1, N): rows scaled by level, then x - zeta. held (M, N): active rows of judged levels. work (M, N): rows being
    factored. C, H: flat, what `held_back` takes. tall: flat. V (n, n). x (N,). value, size, v, side, new_side, multipliers,
    order, tau, right, residual, sharp (M + n or more,): by row. scale (p,). pulling, fixed, row, column, pivot: integers.
    """

    W: np.ndarray
    held: np.ndarray
    work: np.ndarray
    C: np.ndarray
    H: np.ndarray
    tall: np.ndarray
    V: np.ndarray
    x: np.ndarray
    value: np.ndarray
    size: np.ndarray
    v: np.ndarray
    side: np.ndarray
    new_side: np.ndarray
    multipliers: np.ndarray
    order: np.ndarray
    tau: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    sharp: np.ndarray
    scale: np.ndarray
    pulling: np.ndarray
    fixed: np.ndarray
    row: np.ndarray
    column: np.ndarray
    pivot: np.ndarray


@lean
def proof_parts(M, n, p):
    """Where W, held, work, C, H, tall, V, x, the vectors by row and scale end in the room, and the length of `counts`."""
    wide = padded(n)
    s = padded(M + n)
    W = (M + 1) * wide
    held = W + M * wide
    work = held + M * wide
    C = work + s * n
    H = C + M * n
    tall = H + n * s
    V = tall + n * n
    x = V + wide
    return W, held, work, C, H, tall, V, x, x + 11 * s, x + 11 * s + p, 5 * s


@inlined
def proof_of(room, counts, M, n, p):
    """The views of `Proof`."""
    W, held, work, C, H, tall, V, x, rows, end, _ = proof_parts(M, n, p)
    wide = padded(n)
    s = padded(M + n)
    return Proof(
        as_matrix(room[:W], M + 1, wide),
        as_matrix(room[W:held], M, wide),
        as_matrix(room[held:work], M, wide),
        room[work:C],
        room[C:H],
        room[H:tall],
        as_matrix(room[tall:V], n, n),
        room[V:x],
        room[x : x + s],
        room[x + s : x + 2 * s],
        room[x + 2 * s : x + 3 * s],
        room[x + 3 * s : x + 4 * s],
        room[x + 4 * s : x + 5 * s],
        room[x + 5 * s : x + 6 * s],
        room[x + 6 * s : x + 7 * s],
        room[x + 7 * s : x + 8 * s],
        room[x + 8 * s : x + 9 * s],
        room[x + 9 * s : x + 10 * s],
        room[x + 10 * s : rows],
        room[rows:end],
        counts[:s],
        counts[s : 2 * s],
        counts[2 * s : 3 * s],
        counts[3 * s : 4 * s],
        counts[4 * s : 5 * s],
    )
