"""The equations in the solvers' files, as the paper prints them, against the native forms and the exact truth."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import ConstantDamping, Level, Problem, solve, truth
from hqp_rp.solvers.damped_least_squares import equation_7
from hqp_rp.solvers.null_space import equation_11
from hqp_rp.solvers.pseudo_inverse import equation_5
from hqp_rp.solvers.reverse_priority import equation_22, equation_29
from hqp_rp.solvers.singularity_robust import equation_13
from tests import reference

ROWS = [(3, 3), (2, 2, 2), (3, 2, 7), (4, 5), (1, 1, 1, 1)]


def stack(seed: int, rows: tuple[int, ...]):
    rng = np.random.default_rng(seed)
    J = [rng.standard_normal((m, 7)) for m in rows]
    b = [rng.standard_normal(m) for m in rows]
    return J, b, rng.standard_normal(7), Problem([Level.equality(A, r) for A, r in zip(J, b, strict=True)])


@pytest.mark.parametrize("rows", ROWS)
@pytest.mark.parametrize("seed", range(4))
def test_every_equation_is_its_solver(rows: tuple[int, ...], seed: int) -> None:
    J, b, zeta, problem = stack(seed, rows)
    found = {
        "pseudo_inverse": equation_5(J, b, zeta),
        "null_space": equation_11(J, b, zeta),
        "singularity_robust": equation_13(J, b, zeta),
        "reverse_priority": equation_29(J, b, zeta),
    }
    for name, x in found.items():
        expected = solve(problem, name, secondary=zeta).x
        np.testing.assert_allclose(x, expected, atol=1e-9 * (1.0 + np.linalg.norm(expected)), err_msg=name)
    expected = solve(problem, "reverse_priority", form="projector", secondary=zeta).x
    np.testing.assert_allclose(equation_22(J, b, zeta), expected, atol=1e-9 * (1.0 + np.linalg.norm(expected)))
    W = np.diag(np.arange(1.0, 8.0))
    expected = solve(problem, "damped_least_squares", damping=ConstantDamping(0.3), weight=W, secondary=zeta).x
    np.testing.assert_allclose(equation_7(J, b, zeta, 0.3, W), expected, atol=1e-11)


@pytest.mark.parametrize("rows", ROWS)
@pytest.mark.parametrize("seed", range(3))
def test_against_exact_arithmetic(rows: tuple[int, ...], seed: int) -> None:
    J, b, zeta, problem = stack(seed, rows)
    np.testing.assert_allclose(equation_11(J, b, zeta), truth(problem, zeta).x, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(equation_29(J, b, zeta), reference.reverse_priority(problem, zeta), rtol=1e-8, atol=1e-9)


def test_the_null_space_of_both_tasks_as_printed_is_none() -> None:
    """N_2 under (11): with J_2 in the last bracket the free vector disturbs task 2; with Jbar_2 it disturbs neither."""
    rng = np.random.default_rng(0)
    J1, J2 = rng.normal(size=(3, 7)), rng.normal(size=(3, 7))
    N1 = np.eye(7) - np.linalg.pinv(J1) @ J1
    bar = J2 @ N1
    printed, read = (N1 @ (np.eye(7) - np.linalg.pinv(bar) @ J) for J in (J2, bar))
    assert np.abs(J2 @ printed).max() > 0.1
    assert np.abs(printed @ printed - printed).max() > 0.1
    for J in (J1, J2):
        np.testing.assert_allclose(J @ read, 0.0, atol=1e-14)
    np.testing.assert_allclose(read @ read, read, atol=1e-14)
