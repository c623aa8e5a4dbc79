"""The law M_d e'' + B_d e' + K_d e = f: exact against closed forms, never gaining energy, and its errors."""

import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.core.errors import SettingError
from tests.control.gantry import mass_damper, mass_spring_damper

PAPER_M, PAPER_B = [15.0, 15.0, 15.0, 80.0, 80.0, 80.0], [150.0, 150.0, 150.0, 280.0, 280.0, 280.0]


def run(law, e, de, forces, periods):
    """Deviation and velocity after these periods, with one force (m,) held during each."""
    for f, dt in zip(forces, periods, strict=True):
        mean, de = law.advance(e, de, f, dt)
        e = e + dt * mean
    return e, de


def spd(rng, m, rank=None):
    A = rng.normal(size=(m, m if rank is None else rank))
    return A @ A.T


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 0.05, 3.0])
def test_step_force_on_the_masses_and_dampers_of_the_paper(dt):
    law = AdmittanceLaw(6, PAPER_M, PAPER_B)
    f = np.array([30.0, -5.0, 1.0, 2.0, 0.0, -7.0])
    e, de = run(law, np.zeros(6), np.zeros(6), [f] * 40, [dt] * 40)
    for i in range(6):
        x, v = mass_damper(40 * dt, PAPER_M[i], PAPER_B[i], f[i])
        assert e[i] == pytest.approx(x, rel=1e-12, abs=1e-15)
        assert de[i] == pytest.approx(v, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize(
    ("b", "kind"), [(0.0, "undamped"), (40.0, "under"), (200.0, "critical"), (2000.0, "over"), (1e5, "far over")]
)
@pytest.mark.parametrize("dt", [1e-3, 0.02, 0.5])
def test_free_response_of_mass_spring_damper(b, kind, dt):
    m, k, x0, v0 = 10.0, 1000.0, 0.1, -0.5
    law = AdmittanceLaw(1, m, b, k)
    e, de = run(law, np.array([x0]), np.array([v0]), [np.zeros(1)] * 50, [dt] * 50)
    x, v = mass_spring_damper(50 * dt, m, b, k, x0, v0)
    assert e[0] == pytest.approx(x, rel=1e-10, abs=2e-13)
    assert de[0] == pytest.approx(v, rel=1e-10, abs=2e-12)


def test_it_does_not_matter_how_time_is_cut_into_periods():
    rng = np.random.default_rng(0)
    law = AdmittanceLaw(3, spd(rng, 3) + np.eye(3), spd(rng, 3), 30 * spd(rng, 3))
    f, e0, v0 = rng.normal(size=(3, 3))
    cuts = np.sort(np.append(rng.uniform(0.0, 2.0, 30), [0.0, 2.0]))
    many = run(law, e0, v0, [f] * 31, np.diff(cuts))
    once = run(law, e0, v0, [f], [2.0])
    np.testing.assert_allclose(many, once, rtol=0, atol=1e-12 * np.abs(once).max())


def test_full_matrices_that_share_their_modes_are_solved_mode_by_mode():
    rng = np.random.default_rng(1)
    W = rng.normal(size=(4, 4))
    m, b, k = (rng.uniform(1.0, 50.0, 4) for _ in range(3))
    law = AdmittanceLaw(4, W @ np.diag(m) @ W.T, W @ np.diag(b) @ W.T, W @ np.diag(k) @ W.T)
    y0, w0 = rng.normal(size=(2, 4))
    back = np.linalg.inv(W.T)  # e = W^-T y: then each y_i has m_i, b_i, k_i of its own
    e, de = run(law, back @ y0, back @ w0, [np.zeros(4)] * 20, [0.03] * 20)
    modes = np.array([mass_spring_damper(0.6, *values) for values in zip(m, b, k, y0, w0, strict=True)])
    np.testing.assert_allclose(W.T @ e, modes[:, 0], atol=1e-11)
    np.testing.assert_allclose(W.T @ de, modes[:, 1], atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_general_matrices_against_thirty_digits(seed):
    rng = np.random.default_rng(seed)
    M, B, K = spd(rng, 3) + 0.1 * np.eye(3), spd(rng, 3, 2), 50 * spd(rng, 3, 1)
    e, de, f = rng.normal(size=(3, 3))
    dt = 0.2
    mean, end = AdmittanceLaw(3, M, B, K).advance(e, de, f, dt)
    with mpmath.workdps(30):
        inverse = mpmath.matrix(M.tolist()) ** -1
        A = mpmath.zeros(9, 9)
        for i in range(3):
            A[i, 3 + i] = 1
            for j in range(3):
                A[3 + i, j] = -(inverse * mpmath.matrix(K.tolist()))[i, j]
                A[3 + i, 3 + j] = -(inverse * mpmath.matrix(B.tolist()))[i, j]
                A[3 + i, 6 + j] = inverse[i, j]
        z = mpmath.expm(A * mpmath.mpf(dt)) * mpmath.matrix([*e, *de, *f])
        exact = np.array([float(z[i]) for i in range(6)])
    np.testing.assert_allclose(e + dt * mean, exact[:3], rtol=0, atol=1e-13 * np.abs(exact).max())
    np.testing.assert_allclose(end, exact[3:6], rtol=0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize(("sampled_at", "order"), [(0.0, 1), (0.5, 2)])
def test_order_of_accuracy_when_the_force_varies(sampled_at, order):
    """m x'' + b x' = sin(w t) from rest: x' = Im[(e^{iwt} - e^{-bt/m}) / (i w m + b)]."""
    m, b, w, T = 2.0, 5.0, 7.0, 1.0
    exact = ((np.exp(1j * w * T) - np.exp(-b * T / m)) / (1j * w * m + b)).imag
    law = AdmittanceLaw(1, m, b)
    errors = []
    for n in (100, 200, 400):
        t = (np.arange(n) + sampled_at) * T / n
        _, de = run(law, np.zeros(1), np.zeros(1), np.sin(w * t)[:, None], [T / n] * n)
        errors.append(abs(de[0] - exact))
    for coarse, fine in itertools.pairwise(errors):
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.05)


@settings(deadline=None, max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    m=st.integers(1, 6),
    ranks=st.tuples(st.integers(0, 6), st.integers(0, 6)),
    dt=st.floats(-5.0, 1.0).map(lambda x: 10.0**x),
    stiffness=st.floats(-2.0, 5.0).map(lambda x: 10.0**x),
    damping=st.floats(-3.0, 4.0).map(lambda x: 10.0**x),
)
def test_the_free_response_never_gains_energy(seed, m, ranks, dt, stiffness, damping):
    rng = np.random.default_rng(seed)
    M = spd(rng, m) + 0.1 * np.eye(m)
    B, K = (scale * spd(rng, m, rank) for scale, rank in zip((damping, stiffness), ranks, strict=True))
    law = AdmittanceLaw(m, M, B, K)
    e, de = rng.normal(size=(2, m))
    start = energy = law.energy(e, de)
    for _ in range(20):
        mean, de = law.advance(e, de, np.zeros(m), dt)
        e = e + dt * mean
        assert law.energy(e, de) <= energy + 1e-9 * start
        energy = law.energy(e, de)


def test_a_stiff_law_on_a_long_period_comes_to_rest():
    law = AdmittanceLaw(2, 1.0, 1e7, [1e9, 0.0])
    e, de = run(law, np.ones(2), np.ones(2), [np.zeros(2)] * 100, [0.01] * 100)
    np.testing.assert_allclose(e, [0.0, 1.0 + 1e-7], atol=1e-12)
    np.testing.assert_allclose(de, 0.0, atol=1e-12)


def test_numbers_diagonals_and_matrices_are_one_law():
    assert AdmittanceLaw(2, 3.0, [1.0, 1.0]).inertia.tolist() == [[3.0, 0.0], [0.0, 3.0]]
    same = [AdmittanceLaw(2, M, 2.0, 5.0) for M in (3, [3, 3], [[3, 0], [0, 3]])]
    results = [law.advance(np.ones(2), np.zeros(2), np.ones(2), 0.1) for law in same]
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])
    with pytest.raises(ValueError, match="read-only"):
        same[0].inertia[0, 0] = 1.0


@pytest.mark.parametrize(
    ("M", "B", "K", "text"),
    [
        ([1, 0], 1, 0, "M_d of the law must be positive definite: every eigenvalue > 0, and its smallest is 0"),
        (-1.0, 1, 0, "M_d of the law must be positive definite"),
        ([[1, 2], [2, 1]], 1, 0, "its smallest is -1"),
        ([[1, 0.5], [0, 1]], 1, 0, r"M_d of the law is not symmetric: entry \[0, 1\] is 0.5 and entry \[1, 0\] is 0"),
        (
            1,
            [1, -1e-3],
            0,
            "B_d of the law must be positive semidefinite: every eigenvalue >= 0, and its smallest is -0.001",
        ),
        (1, 1, [[0, 1], [1, 0]], "K_d of the law must be positive semidefinite"),
        (1, 1, np.nan, "K_d of the law is .*; every entry must be finite"),
        ([1, np.inf], 1, 1, "M_d of the law is .*; every entry must be finite"),
        ([1, 2, 3], 1, 0, r"M_d of the law has shape \(3,\); for 2 axes give one number, the 2 numbers of a diagonal"),
        (1, "stiff", 0, "B_d of the law is 'stiff'; it must hold real numbers"),
        (1, 1, [[1, 2], [3]], "K_d of the law is ragged"),
    ],
)
def test_one_clear_error_for_each_matrix_that_is_no_law(M, B, K, text):
    with pytest.raises(SettingError, match=text):
        AdmittanceLaw(2, M, B, K)


def test_semidefinite_damping_and_stiffness_are_allowed():
    AdmittanceLaw(2, 1, [0, 0], [[1, 1], [1, 1]])


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf, None])
def test_a_period_must_be_positive(dt):
    with pytest.raises(SettingError, match=r"dt is .*; it must be a finite number > 0"):
        AdmittanceLaw(1, 1, 1).advance(np.zeros(1), np.zeros(1), np.zeros(1), dt)


def test_a_period_that_overflows_is_refused():
    with pytest.raises(SettingError, match=r"over so long a period overflows\. Shorten dt"):
        AdmittanceLaw(1, 1e-200, 1e200).advance(np.zeros(1), np.zeros(1), np.zeros(1), 1.0)
