"""Independent references for the solvers' tests: formulas of the paper evaluated in exact rational arithmetic (FLINT)."""

from __future__ import annotations

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from hqp_rp import Problem

Array = NDArray[np.float64]


def exact(array: Array) -> fmpq_mat:
    """The floats of a matrix (m, n), or of a vector as a column, as rationals."""
    rows = np.atleast_2d(array) if array.ndim == 2 else array[:, None]
    entries = []
    for value in rows.ravel():
        numerator, denominator = float(value).as_integer_ratio()
        entries.append(fmpq(numerator, denominator))
    return fmpq_mat(rows.shape[0], rows.shape[1], entries)


def floats(column: fmpq_mat) -> Array:
    """A rational column (n, 1) as floats (n,)."""
    return np.array([int(column[i, 0].p) / int(column[i, 0].q) for i in range(column.nrows())])


def pinv(A: fmpq_mat) -> fmpq_mat:
    """The Moore-Penrose inverse, from the full-rank factorization A = F G: A^+ = G^T (F^T A G^T)^-1 F^T."""
    reduced, rank = A.rref()
    if rank == 0:
        return fmpq_mat(A.ncols(), A.nrows())
    pivots = []
    column = 0
    for i in range(rank):
        while reduced[i, column] == 0:
            column += 1
        pivots.append(column)
    G = fmpq_mat(rank, A.ncols(), [reduced[i, j] for i in range(rank) for j in range(A.ncols())])
    F = fmpq_mat(A.nrows(), rank, [A[i, j] for i in range(A.nrows()) for j in pivots])
    return G.transpose() * (F.transpose() * A * G.transpose()).inv() * F.transpose()


def rows(A: fmpq_mat, start: int, stop: int) -> fmpq_mat:
    """Rows start:stop of A."""
    return fmpq_mat(stop - start, A.ncols(), [A[i, j] for i in range(start, stop) for j in range(A.ncols())])


def columns(A: fmpq_mat, stop: int) -> fmpq_mat:
    """The first `stop` columns of A."""
    return fmpq_mat(A.nrows(), stop, [A[i, j] for i in range(A.nrows()) for j in range(stop)])


def identity(n: int) -> fmpq_mat:
    """The identity (n, n)."""
    return fmpq_mat(n, n, [fmpq(int(i == j)) for i in range(n) for j in range(n)])


def reverse_priority(problem: Problem, secondary: Array | None = None) -> Array:
    """The recursion (29) with T_k from (25), literally: T_k is the first m_k columns of [J_k; J_{k+1}; ...; J_p]^+."""
    J, b = exact(problem.matrix), exact(problem.lower)
    M = J.nrows()
    q = exact(np.zeros(problem.n) if secondary is None else secondary)
    for k in range(problem.p - 1, -1, -1):
        r0, r1 = int(problem.offsets[k]), int(problem.offsets[k + 1])
        if r0 == r1:
            continue
        J_k = rows(J, r0, r1)
        T = columns(pinv(rows(J, r0, M)), r1 - r0)
        q = q + T * (pinv(J_k * T) * (rows(b, r0, r1) - J_k * q))
    return floats(q)


def reverse_priority_projector(problem: Problem) -> Array:
    """The recursion (22) with P_{k+1} = I - (I - T_k T_k^+) H_k J_{k+1}^RP of (27), literally."""
    J, b = exact(problem.matrix), exact(problem.lower)
    M, n = J.nrows(), problem.n
    q = exact(np.zeros(n))
    for k in range(problem.p - 1, -1, -1):
        r0, r1 = int(problem.offsets[k]), int(problem.offsets[k + 1])
        if r0 == r1:
            continue
        J_k = rows(J, r0, r1)
        whole = pinv(rows(J, r0, M))
        T = columns(whole, r1 - r0)
        P = identity(n) - (identity(n) - T * pinv(T)) * (whole * rows(J, r0, M) - T * J_k)
        q = q + pinv(J_k * P) * (rows(b, r0, r1) - J_k * q)
    return floats(q)


def singularity_robust(problem: Problem) -> Array:
    """Equation (13) on N levels: sum_k N_{k-1} A_k^+ b_k."""
    J, b = exact(problem.matrix), exact(problem.lower)
    n = problem.n
    q = exact(np.zeros(n))
    for k in range(problem.p):
        r0, r1 = int(problem.offsets[k]), int(problem.offsets[k + 1])
        if r0 == r1:
            continue
        step = pinv(rows(J, r0, r1)) * rows(b, r0, r1)
        if r0:
            above = rows(J, 0, r0)
            step = step - pinv(above) * (above * step)
        q = q + step
    return floats(q)


def pseudo_inverse(problem: Problem, secondary: Array | None = None) -> Array:
    """Equation (5): J^+ b + (I - J^+ J) zeta."""
    J, b = exact(problem.matrix), exact(problem.lower)
    inverse = pinv(J)
    x = inverse * b
    if secondary is not None:
        zeta = exact(secondary)
        x = x + zeta - inverse * (J * zeta)
    return floats(x)


def condition(problem: Problem) -> float:
    """max_k ||A_k|| / sigma(A_k Z_{k-1}) over kept singular values, times the same of every A_k alone: how errors grow."""
    worst = 1.0
    Z = np.eye(problem.n)
    for level in problem.levels:
        if not level.m:
            continue
        norm = np.linalg.norm(level.A, 2)
        for matrix in (level.A, level.A @ Z):
            if matrix.size:
                sigma = np.linalg.svd(matrix, compute_uv=False)
                kept = sigma[sigma > 1e-12 * norm]
                if kept.size:
                    worst = max(worst, norm / kept[-1])
        if Z.shape[1]:
            _, sigma, Vt = np.linalg.svd(level.A @ Z)
            Z = Z @ Vt[int(np.count_nonzero(sigma > 1e-12 * norm)) :].T
    return float(worst)
