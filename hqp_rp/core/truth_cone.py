"""Whether a gradient is held back by the rows that stop it, decided exactly: multipliers of the right sign."""

from __future__ import annotations

import numpy as np
from flint import fmpq, fmpz_mat

from hqp_rp.core.diagnostics import norm
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.truth_exact import beside, matrix_of, pivots_of


def held(gradient: fmpz_mat, rows: fmpz_mat, normals: list[list[int]]) -> bool:
    """Whether `gradient + rows^T y + normals^T w = 0` for some y and w >= 0: gradient (n, 1), rows (r, n), normals (k, n).

    The w > 0 are guessed in double precision and the equation is then solved in rationals: True is a proof, False is not.
    """
    n = gradient.nrows()
    fixed = [[int(e) for e in row] for row in rows.table()]
    chosen = _guess(_scaled([[int(e)] for e in gradient.entries()]), _floats(fixed), _floats(normals))
    columns = matrix_of([*fixed, *(normals[i] for i in chosen)], n).transpose()
    solved, den, _ = beside(columns, -gradient).rref()
    pivots, last = pivots_of(solved), columns.ncols()
    if pivots and pivots[-1] == last:
        return False
    table = solved.table()
    return all(table[i][last] * den >= 0 for i, pivot in enumerate(pivots) if pivot >= len(fixed))


def _guess(gradient: FloatArray, rows: FloatArray, normals: FloatArray) -> list[int]:
    """Indices of the normals that pull, when the gradient is projected onto the null space of the rows."""
    if not len(normals):
        return []
    across = normals.T
    slope = gradient[:, 0]
    if len(rows):
        Q = np.linalg.qr(rows.T)[0]
        for _ in range(2):  # the second time takes away what rounding left of the first
            across = across - Q @ (Q.T @ across)
            slope = slope - Q @ (Q.T @ slope)
    if norm(slope) <= 1e-12 * norm(gradient[:, 0]):
        return []
    lengths = np.linalg.norm(across, axis=0)
    used = np.flatnonzero(lengths > 1e-9)
    if not len(used):
        return []
    weights, _ = nonnegative_least_squares(across[:, used] / lengths[used], -slope)
    return [int(i) for i in used[weights > 1e-12 * weights.max(initial=0.0)]]


def _floats(table: list[list[int]]) -> FloatArray:
    """The rows, each divided by a power of two that brings its largest entry to the order of one."""
    return np.vstack([_scaled([row])[0] for row in table]) if table else np.zeros((0, 0))


def _scaled(table: list[list[int]]) -> FloatArray:
    """The matrix divided by a power of two that brings its largest entry to the order of one."""
    unit = 1 << max((abs(e).bit_length() for row in table for e in row), default=0)
    return np.array([[e / unit for e in row] for row in table])


def nonnegative_residual(slope: fmpz_mat, normals: fmpz_mat) -> fmpz_mat:
    """A positive multiple of `slope + normals w`, d x 1, at the w >= 0 (k,) that makes its norm least (Lawson-Hanson).

    Exact. It is zero just when -slope is in the cone of the normals; else each normal makes with it an angle <= 90 degrees.
    """
    k = normals.ncols()
    across = normals.transpose()
    passive: list[int] = []
    weights = [fmpq(0)] * k
    residual, scale = slope, 1
    while True:
        pull = [-int(e) for e in (across * residual).entries()]
        entering = [i for i in range(k) if i not in passive and pull[i] > 0]
        if not entering:
            return residual
        passive.append(max(entering, key=lambda i: pull[i]))
        while True:
            columns = fmpz_mat(normals.nrows(), len(passive), [row[i] for row in normals.table() for i in passive])
            turned = columns.transpose()
            solved, den, _ = beside(turned * columns, -(turned * slope)).rref()
            best = [fmpq(row[len(passive)], den) for row in solved.table()]
            if all(weight > 0 for weight in best):
                break
            ratio = min(weights[i] / (weights[i] - w) for i, w in zip(passive, best, strict=True) if w <= 0)
            for i, w in zip(passive, best, strict=True):
                weights[i] = weights[i] + ratio * (w - weights[i])
            passive = [i for i in passive if weights[i] > 0]
            weights = [w if i in passive else fmpq(0) for i, w in enumerate(weights)]
        for i, w in zip(passive, best, strict=True):
            weights[i] = w
        scale = abs(int(den))
        numerators = [int((w * scale).p) for w in best]
        residual = slope * scale + columns * fmpz_mat(len(passive), 1, numerators)
