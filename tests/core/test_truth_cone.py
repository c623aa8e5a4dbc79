"""Multipliers of the right sign: against an independent solver, and never claimed where there are none."""

import numpy as np
from flint import fmpz_mat
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from hqp_rp.core.truth_cone import held, nonnegative_residual


def column(values: np.ndarray) -> fmpz_mat:
    return fmpz_mat(len(values), 1, [int(v) for v in values])


def matrix(A: np.ndarray) -> fmpz_mat:
    return fmpz_mat(*A.shape, [int(e) for e in A.ravel()])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(1, 7))
def test_nonnegative_residual_against_scipy(seed: int, d: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    slope, normals = rng.integers(-9, 10, d), rng.integers(-4, 5, (d, k))
    exact = nonnegative_residual(fmpz_mat(d, 1, slope.tolist()), fmpz_mat(d, k, normals.ravel().tolist()))
    mine = np.array([float(int(e)) for e in exact.entries()])
    weights, _ = nnls(normals.astype(float), -slope.astype(float))
    other = slope + normals @ weights
    if not mine.any():
        np.testing.assert_allclose(other, 0, atol=1e-9)
    else:
        assert (normals.T @ mine >= 0).all()  # exact, by integers
        np.testing.assert_allclose(mine / np.linalg.norm(mine), other / np.linalg.norm(other), atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(0, 3), st.integers(0, 7))
def test_held_is_a_proof_and_found_where_multipliers_are_unique(seed: int, n: int, r: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    S = np.eye(n, dtype=int)[: min(r, n)]  # rows that fix the first unknowns: the others are what is free
    N = rng.integers(-3, 4, (k, n))
    if seed % 2:
        gradient = -(rng.integers(-5, 6, len(S)) @ S) - rng.integers(0, 4, k) @ N  # held by construction
    else:
        gradient = rng.integers(-9, 10, n)
    free = slice(len(S), n)
    rest = nonnegative_residual(column(gradient[free]), matrix(N[:, free].T)) if len(S) < n else fmpz_mat(0, 1, [])
    zero = not any(rest.entries())
    found = held(column(gradient), matrix(S), N.tolist())
    assert zero or not seed % 2
    assert found <= zero  # what is claimed is proven
    rows = np.vstack([S, N])
    if np.linalg.matrix_rank(rows) == len(rows):
        assert found == zero


def test_held_with_numbers_beyond_the_floats() -> None:
    big = 10**400  # and the multiplier of the first row is -7 / 10**400
    rows = [[big, 0, 0]]
    normals = [[0, 3 * big, 0], [0, 0, -1]]
    assert held(fmpz_mat(3, 1, [7, -(big**2), big**2]), fmpz_mat(1, 3, rows[0]), normals)
    assert not held(fmpz_mat(3, 1, [7, big**2, big**2]), fmpz_mat(1, 3, rows[0]), normals)
    assert not held(fmpz_mat(3, 1, [7, -(big**2), big**2]), fmpz_mat(0, 3, []), normals)
    assert held(fmpz_mat(3, 1, [0, 0, 0]), fmpz_mat(0, 3, []), [])
