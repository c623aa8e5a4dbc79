"""What solvers say of active rows: at or beyond the bound they name, and the same rows as the exact optimum."""

from __future__ import annotations

import numpy as np
import pytest

import hqp_rp
from hqp_rp import Level, Problem, Solver, certify, get_solver, solve, truth
from tests.problems import boxed, independent, over_constrained, two_sided

INF = np.inf
SOLVERS = {
    "hierarchical_active_set": {},
    "hierarchical_active_set, cold": {"warm_start": False},
    "daqp": {},
    "qp_cascade": {},
    "qp_cascade, unpolished": {"polish": False},
    **{f"qp_cascade on {name}": {"backend": name} for name in ("osqp", "daqp", "quadprog", "piqp")},
    "weighted": {},
    "saturation_null_space": {},
    "reverse_priority_unilateral": {},
    "set_based": {},
}


def name_in(label: str) -> str:
    """The solver's name in a label of `SOLVERS`."""
    return label.replace(",", " ").split()[0]


EVERY = pytest.mark.parametrize(
    "solver",
    [pytest.param(get_solver(name_in(label), **settings), id=label) for label, settings in SOLVERS.items()],
)
PROBLEMS = [
    *(boxed(independent(seed, rows=(3, 3, 7)), 0.3) for seed in range(4)),
    *(boxed(over_constrained(seed), 0.3) for seed in range(3)),
    *(two_sided(seed, 5, (2, 3, 3)) for seed in range(5)),
    *(two_sided(seed, 5, (2, 3, 3), box=0.5) for seed in range(5)),
    independent(0),
]


def sides(problem: Problem, x: np.ndarray, near: float) -> np.ndarray:
    """+1 for rows at or beyond their upper bound (equalities too), -1 at or beyond the lower one, 0 between."""
    matrix, lower, upper, _ = problem.with_hard
    value = matrix @ x
    reach = near * (np.linalg.norm(matrix, axis=1) * np.linalg.norm(x) + np.abs(np.clip(value, lower, upper)))
    return np.where((lower == upper) | (value >= upper - reach), 1, np.where(value <= lower + reach, -1, 0))


@EVERY
def test_active_rows_are_at_or_beyond_the_bound_they_name(solver: Solver) -> None:
    asked = 0
    for problem in PROBLEMS:
        if solver.refuses(problem):
            continue
        solution = solver.solve(problem)
        if not solution.status.ok:  # unpolished QPs, sums of very different weights: not to the declared tolerance
            continue
        active = solution.active
        assert active.shape == (len(problem.matrix) + (0 if problem.hard is None else problem.hard.m),)
        assert active.dtype == np.int8
        assert active is solution.active
        assert not active.flags.writeable
        _, lower, upper, _ = problem.with_hard
        there = sides(problem, solution.x, max(solver.tolerance, 1e-9))
        np.testing.assert_array_equal(active[lower == upper], 1)
        np.testing.assert_array_equal(active[active != 0], there[active != 0])
        asked += int(np.count_nonzero(active[lower < upper]))
    assert asked >= 15


@EVERY
def test_exact_solvers_name_the_active_rows_of_the_optimum(solver: Solver) -> None:
    compared = 0
    exact = [problem for problem in PROBLEMS if not solver.refuses(problem) and solver.is_lexicographic(problem)]
    for problem in exact:
        right = truth(problem).x
        expected = sides(problem, right, 1e-9)
        if (sides(problem, right, 1e-4) != expected).any():
            continue  # a row so near to its bound that a multiplier need not be clear of zero
        solver.reset()
        for _ in range(2):  # the second time from what was kept
            np.testing.assert_array_equal(solver.solve(problem).active, expected)
        compared += 1
    assert compared >= 0.7 * len(exact)


@EVERY
def test_a_row_known_by_hand(solver: Solver) -> None:
    problem = Problem([Level.equality(np.eye(2), [3.0, 0.25], "target")], hard=Level(np.eye(2), -1.0, 1.0, "box"))
    solution = solver.solve(problem)
    np.testing.assert_array_equal(solution.active, [1, 0, 1, 1])
    assert solution.active_rows == ("box[0] at its upper bound",)


@EVERY
def test_no_answer_no_active_rows(solver: Solver) -> None:
    apart = Level(np.array([[1.0, 0.0], [1.0, 0.0]]), [1.0, -INF], [INF, 0.0])
    solution = solver.solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard=apart))
    assert solution.x is None
    assert solution.active is None
    assert solution.active_rows is None


@pytest.mark.parametrize("name", ["hierarchical_active_set", "qp_cascade", "daqp"])
def test_a_violated_row_and_a_row_that_is_only_touched(name: str) -> None:
    bands = Level(np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), [1.0, -INF, -5.0], [INF, 0.0, 5.0], "bands")
    solution = solve(Problem([bands, Level.equality(np.eye(2), [7.0, 4.0], "target")]), name)
    np.testing.assert_allclose(solution.x, [0.5, 4.0], atol=1e-7)
    np.testing.assert_array_equal(solution.active, [-1, 1, 0, 1, 1])
    assert solution.active_rows == ("bands[0] at its lower bound", "bands[1] at its upper bound")


@EVERY
def test_beside_a_damped_level_the_rows_at_their_bounds_are_said(solver: Solver) -> None:
    A = np.random.default_rng(0).standard_normal((3, 7))
    goal = [9.0, -9.0, 9.0]
    far = Level(A, goal, goal, "far", damping=hqp_rp.ConstantDamping(0.1))
    problem = Problem([far, Level.equality(np.eye(7), np.zeros(7), "rest")], hard=Level(np.eye(7), -0.3, 0.3, "box"))
    if solver.refuses(problem):
        pytest.skip("refused")
    solution = solver.solve(problem)
    if solution.x is None:  # unpolished QPs: not to the declared tolerance
        pytest.skip(solution.status.value)
    there = sides(problem, solution.x, max(solver.tolerance, 1e-9))[:7]
    assert np.count_nonzero(there) >= 3
    np.testing.assert_array_equal(solution.active[:7], there)
    assert len(solution.active_rows) == np.count_nonzero(there)


@EVERY
def test_a_row_whose_box_is_a_single_point_is_said(solver: Solver) -> None:
    box = Level(np.eye(2), [0.0, -1.0], [0.0, 0.5], "box")
    solution = solver.solve(Problem([Level.equality(np.eye(2), [1.0, 1.0])], hard=box))
    assert solution.active_rows[0] == "box[0] at its only value"
    assert set(solution.active_rows[1:]) <= {"box[1] at its upper bound"}
    tied = Problem([Level.equality(np.eye(2), [1.0, 1.0])], hard=Level.equality([[1.0, 0.0]], [0.0]))
    if not solver.refuses(tied):  # hard equalities alone are no limits
        assert solver.solve(tied).active_rows == ()


def test_solvers_that_do_not_say() -> None:
    solution = solve(independent(0), "null_space")
    assert solution.active is None
    assert solution.active_rows is None
    said = {name_in(label) for label in SOLVERS}
    for name, cls in hqp_rp.all_solvers().items():
        assert (cls.takes_hard or cls.takes_inequalities) == (name in said), name
    assert certify(independent(0), solution.x).ok
