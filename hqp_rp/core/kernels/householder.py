"""Householder reflectors on rows: with vector instructions on padded matrices, by plain loops on others."""

from __future__ import annotations

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.vector import (
    make_reflector,
    reflect_four_rows,
    reflect_row,
    reflect_three_rows,
    reflect_two_rows,
    reflect_vector,
    sum_of_squares,
    swap_rows,
)


@inlined
def padded(n):
    """The number of columns of a working matrix for n unknowns: the next multiple of eight (see `vector`)."""
    return (n + 7) // 8 * 8


@inlined
def is_padded(W):
    """Whether the vector instructions may be used on W."""
    return W.shape[1] % 8 == 0


@lean
def reflect_rows(W, i0, i1, V, t, column, tau):
    """Rows i0:i1 of W <- W - tau (W v) v^T with v = (1, V[t, column + 1:]) from `column` on."""
    n = W.shape[1]
    i = i0
    if is_padded(W):
        while i + 4 <= i1:
            reflect_four_rows(W, i, V, t, column, tau)
            i += 4
        if i + 3 == i1:
            reflect_three_rows(W, i, V, t, column, tau)
        elif i + 2 == i1:
            reflect_two_rows(W, i, V, t, column, tau)
        elif i < i1:
            reflect_row(W, i, V, t, column, tau)
        return
    while i < i1:
        dot = W[i, column]
        for col in range(column + 1, n):
            dot += W[i, col] * V[t, col]
        dot *= tau
        W[i, column] -= dot
        for col in range(column + 1, n):
            W[i, col] -= dot * V[t, col]
        i += 1


@lean
def reflect_rows_by_all(W, i0, i1, V, t0, count, c0, tau, s0):
    """Rows i0:i1 of padded W <- W Q for reflectors t = 0 ... count - 1, row t0 + t of V from column c0 + t, with tau[s0 + t].

    Each row meets all reflectors before the next one is fetched.
    """
    i = i0
    while i + 4 <= i1:
        for t in range(count):
            reflect_four_rows(W, i, V, t0 + t, c0 + t, tau[s0 + t])
        i += 4
    if i + 3 == i1:
        for t in range(count):
            reflect_three_rows(W, i, V, t0 + t, c0 + t, tau[s0 + t])
    elif i + 2 == i1:
        for t in range(count):
            reflect_two_rows(W, i, V, t0 + t, c0 + t, tau[s0 + t])
    elif i < i1:
        for t in range(count):
            reflect_row(W, i, V, t0 + t, c0 + t, tau[s0 + t])


@inlined
def swap_any_rows(W, i, k):
    """Rows i and k of W change places."""
    if is_padded(W):
        swap_rows(W, i, k)
    else:
        for col in range(W.shape[1]):
            swap = W[i, col]
            W[i, col] = W[k, col]
            W[k, col] = swap


@inlined
def longest_row(W, i0, i1, column):
    """(row, squared length) of the longest of the rows i0:i1 from `column` on."""
    best = i0
    longest = -1.0
    for i in range(i0, i1):
        s = 0.0
        if is_padded(W):
            s = sum_of_squares(W, i, column)
        else:
            for col in range(column, W.shape[1]):
                s += W[i, col] * W[i, col]
        if s > longest:
            longest = s
            best = i
    return best, longest


@inlined
def householder(W, i, column, norm):
    """Turn row i into a reflector that maps it on its entry at `column`; returns tau. norm: its length from `column` on."""
    alpha = W[i, column]
    beta = -norm if alpha >= 0.0 else norm
    inverse = 1.0 / (alpha - beta)
    if is_padded(W):
        make_reflector(W, i, column, beta, inverse)
    else:
        for col in range(column + 1, W.shape[1]):
            W[i, col] *= inverse
        W[i, column] = beta
    return (beta - alpha) / beta


@inlined
def turn_vector(y, V, t, column, tau):
    """y <- y - tau (y v) v with v = (1, V[t, column + 1:]) from `column` on."""
    if is_padded(V):
        reflect_vector(y, V, t, column, tau)
    else:
        dot = y[column]
        for col in range(column + 1, V.shape[1]):
            dot += y[col] * V[t, col]
        dot *= tau
        y[column] -= dot
        for col in range(column + 1, V.shape[1]):
            y[col] -= dot * V[t, col]
