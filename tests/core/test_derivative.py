"""The derivative of an answer: against finite differences, closed expressions and its transpose, and where there is none."""

import itertools

import numpy as np
import pytest

import hqp_rp
from hqp_rp import (
    ConstantDamping,
    Level,
    NoSolutionError,
    NotDifferentiableError,
    Problem,
    ProblemError,
    SettingError,
    Solution,
    SolutionDerivative,
    Status,
    jvp,
    solve,
    vjp,
)
from tests.problems import (
    boxed,
    dependent,
    equality_cases,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
    two_sided,
)
from tests.problems import in_metric as with_metric

EXACT = "hierarchical_active_set"
FULL_RANK = [
    (name, problem)
    for name, problem in equality_cases(2)
    if not name.startswith(("dependent", "rank-deficient", "near-singular", "badly"))
]
SPEED = 1e-6
"""Half the step of the central differences."""


class Direction:
    """Random rates of all data of a problem, the bounds of equalities moving together."""

    def __init__(self, problem, seed=0):
        rng = np.random.default_rng(seed)
        matrix, lower, upper, _ = problem.with_hard
        self.problem, self.h = problem, problem.hard_rows
        self.matrix = rng.standard_normal(matrix.shape)
        self.lower = rng.standard_normal(len(lower))
        self.upper = np.where(lower == upper, self.lower, rng.standard_normal(len(upper)))
        self.secondary = rng.standard_normal(problem.n)
        self.metric = None
        if problem.metric is not None:
            W = rng.standard_normal((problem.n, problem.n))
            self.metric = W + W.T

    def rates(self):
        h = self.h
        return {
            "matrix_dot": self.matrix[h:],
            "lower_dot": self.lower[h:],
            "upper_dot": self.upper[h:],
            "hard_matrix_dot": self.matrix[:h],
            "hard_lower_dot": self.lower[:h],
            "hard_upper_dot": self.upper[:h],
            "secondary_dot": self.secondary,
            "metric_dot": self.metric,
        }

    def moved(self, s, secondary, matrix=None):
        """The answer to the problem, its data moved by s of this direction."""
        A, lower, upper, _ = self.problem.with_hard
        A = A + s * self.matrix if matrix is None else matrix
        lower = lower + s * self.lower
        upper = np.where(self.problem.with_hard.lower == self.problem.with_hard.upper, lower, upper + s * self.upper)
        h = self.h
        hard = Level(A[:h], lower[:h], upper[:h]) if h else None
        W = None if self.metric is None else self.problem.metric + s * self.metric
        bounds = A[h:], lower[h:], upper[h:]
        problem = Problem.from_stacked(*bounds, self.problem.offsets, hard=hard, metric=W)
        return solve(problem, EXACT, secondary=secondary + s * self.secondary).require()

    def dot(self, gradient):
        h = self.h
        total = np.sum(gradient.matrix * self.matrix[h:]) + np.sum(gradient.hard_matrix * self.matrix[:h])
        total += gradient.lower @ self.lower[h:] + gradient.upper @ self.upper[h:]
        total += gradient.hard_lower @ self.lower[:h] + gradient.hard_upper @ self.upper[:h]
        total += gradient.secondary @ self.secondary
        return total if self.metric is None else total + np.sum(gradient.metric * self.metric)


def check(problem, seed=0, secondary=None, tolerance=1e-6):
    """jvp against central differences, vjp against jvp."""
    solution = solve(problem, EXACT, secondary=secondary)
    derivative = SolutionDerivative(problem, solution)
    np.testing.assert_allclose(derivative.x, solution.x, atol=1e-10 * (1.0 + np.linalg.norm(solution.x)))
    direction = Direction(problem, seed)
    zeta = np.zeros(problem.n) if secondary is None else secondary
    measured = (direction.moved(SPEED, zeta) - direction.moved(-SPEED, zeta)) / (2.0 * SPEED)
    found = derivative.jvp(**direction.rates())
    size = 1.0 + np.linalg.norm(found)
    np.testing.assert_allclose(found, measured, atol=tolerance * size**2)
    xbar = np.random.default_rng(seed + 1).standard_normal(problem.n)
    gradient = derivative.vjp(xbar)
    assert direction.dot(gradient) == pytest.approx(xbar @ found, abs=1e-11 * size**2)
    return derivative


# --- against finite differences and its own transpose -----------------------------------------------------------------


@pytest.mark.parametrize(("name", "problem"), FULL_RANK, ids=[name for name, _ in FULL_RANK])
def test_equalities(name, problem):
    check(problem)
    check(problem, 1, np.random.default_rng(2).standard_normal(problem.n))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(
    "make",
    [
        two_sided,
        lambda s: two_sided(s, box=0.5),
        lambda s: boxed(independent(s, rows=(3, 2)), 0.3),
        lambda s: boxed(over_constrained(s, rows=(3, 3, 7)), 0.8),
        lambda s: two_sided(s, n=12, rows=(4, 3, 2, 3), box=0.8),
    ],
    ids=["two-sided", "two-sided in a box", "3+2 in a box", "3+3+7 in a box", "12 unknowns in a box"],
)
def test_inequalities(make, seed):
    check(make(seed), seed, np.random.default_rng(seed).standard_normal(make(seed).n) if seed % 2 else None)


@pytest.mark.parametrize("seed", range(6))
def test_a_metric(seed):
    zeta = np.random.default_rng(seed).standard_normal(7)
    check(with_metric(independent(seed, rows=(3, 2)), seed, 10.0), seed, zeta)
    derivative = check(with_metric(two_sided(seed, box=0.5, rows=(2, 2)), seed, 10.0), seed, zeta)
    metric = derivative.vjp(np.ones(7)).metric
    np.testing.assert_array_equal(metric, metric.T)


def test_near_a_singularity_it_grows_and_stays_right():
    derivative = check(near_singular(1e-2, 3), tolerance=1e-7)
    assert np.linalg.norm(derivative.vjp(np.ones(7)).matrix) > 100.0


# --- against closed expressions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("m", [3, 7, 10])
def test_one_level_is_the_derivative_of_a_pseudo_inverse(m):
    problem = independent(5, rows=(m,))
    A, b = problem.matrix, problem.lower
    rng = np.random.default_rng(0)
    dA, db = rng.standard_normal(A.shape), rng.standard_normal(m)
    inverse = np.linalg.pinv(A)
    x = inverse @ b
    # Golub and Pereyra 1973
    dinverse = (
        -inverse @ dA @ inverse
        + inverse @ inverse.T @ dA.T @ (np.eye(m) - A @ inverse)
        + (np.eye(7) - inverse @ A) @ dA.T @ inverse.T @ inverse
    )
    expected = dinverse @ b + inverse @ db
    solution = solve(problem, "pseudo_inverse")
    np.testing.assert_allclose(jvp(problem, solution, dA, db, db), expected, atol=1e-11)
    xbar = rng.standard_normal(7)
    gradient = vjp(problem, solution, xbar)
    np.testing.assert_allclose(gradient.rhs, inverse.T @ xbar, atol=1e-12)
    np.testing.assert_allclose(gradient.lower, gradient.upper)
    assert np.sum(gradient.matrix * dA) == pytest.approx(xbar @ (dinverse @ b), abs=1e-10)
    np.testing.assert_allclose(x, solution.x, atol=1e-12)


def test_a_bound_that_holds_passes_its_motion_on_and_what_it_stops_does_not():
    # x_1 may be 1 and level 2 wants 2: x_1 moves with the bound, x_2 keeps the sum that level 1 wants.
    wall = Level([[1.0, 0.0]], -1.0, 1.0)
    problem = Problem([Level.equality([[1.0, 1.0]], [2.5]), Level.equality([[1.0, 0.0]], [2.0])], wall)
    solution = solve(problem, EXACT)
    np.testing.assert_allclose(solution.x, [1.0, 1.5], atol=1e-12)
    derivative = SolutionDerivative(problem, solution, constant_rank=True)
    first, second = derivative.vjp([1.0, 0.0]), derivative.vjp([0.0, 1.0])
    np.testing.assert_allclose([first.hard_upper[0], second.hard_upper[0]], [1.0, -1.0], atol=1e-12)
    np.testing.assert_allclose([first.rhs, second.rhs], [[0.0, 0.0], [1.0, 0.0]], atol=1e-12)
    np.testing.assert_array_equal([first.hard_lower[0], second.hard_lower[0]], [0.0, 0.0])
    np.testing.assert_allclose(first.hard_matrix, [[-1.0, -1.5]], atol=1e-12)  # d x_1 = -(da . x)


@pytest.mark.parametrize("factor", [2.0**-498, 2.0**498])
def test_scales_of_levels_are_those_of_the_gradient(factor):
    plain = over_constrained(1, rows=(3, 3, 7))
    other = scaled(plain, [1.0, factor, 1.0 / factor])
    xbar = np.random.default_rng(0).standard_normal(7)
    one, two = (vjp(p, solve(p, "null_space"), xbar) for p in (plain, other))
    factors = np.repeat([1.0, factor, 1.0 / factor], [3, 3, 7])
    np.testing.assert_allclose(two.matrix * factors[:, None], one.matrix, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(two.rhs * factors, one.rhs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_it_does_not_depend_on_the_solver(seed):
    problem = two_sided(seed, box=0.5)
    xbar = np.random.default_rng(seed).standard_normal(7)
    expected = vjp(problem, solve(problem, EXACT), xbar)
    for name in ("qp_cascade", "daqp"):
        found = vjp(problem, solve(problem, name), xbar)
        np.testing.assert_allclose(found.matrix, expected.matrix, atol=1e-8, err_msg=name)
        np.testing.assert_allclose(found.hard_upper, expected.hard_upper, atol=1e-8, err_msg=name)


def test_a_problem_built_anew_from_the_same_numbers_is_the_same():
    problem = two_sided(0, box=0.5)
    again = Problem(problem.levels, problem.hard)
    solution = solve(problem, EXACT)
    np.testing.assert_array_equal(vjp(again, solution, np.ones(7)).matrix, vjp(problem, solution, np.ones(7)).matrix)


# --- ranks that stay ---------------------------------------------------------------------------------------------------


def keeping_ranks(problem, seed, s):
    """The matrix at s of a motion (I + s L_k) A_k (I + s G) of all rows, and its rate at 0: every rank stays as it is."""
    rng = np.random.default_rng(seed)
    A, _, _, offsets = problem.with_hard
    G = 0.3 * rng.standard_normal((problem.n, problem.n))
    moved, rate = A.copy(), np.zeros_like(A)
    for start, end in itertools.pairwise(offsets):
        L = 0.3 * rng.standard_normal((end - start, end - start))
        if start == 0 and problem.hard_rows:
            L = np.diag(np.diag(L))  # hard rows stay what they are one by one
        own = A[start:end]
        moved[start:end] = (own + s * L @ own) @ (np.eye(problem.n) + s * G)
        rate[start:end] = L @ own + own @ G
    return moved, rate


def at_the_wall(seed):
    """Levels that want through bounds which are rows of their own: parallel to them, and so without full rank."""
    rng = np.random.default_rng(seed)
    wall = Level(np.eye(4), -1.0, 1.0, name="wall")
    levels = [Level.equality(np.eye(4)[:2], [2.0, 0.3]), Level.equality(np.eye(4), rng.uniform(0.1, 0.9, 4) * 3.0)]
    return Problem(levels, wall)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "make",
    [
        rank_deficient,
        lambda s: rank_deficient(s, rows=(6, 8), ranks=(3, 4)),
        dependent,
        lambda s: dependent(s, rows=(4, 4), shared=2),
        at_the_wall,
    ],
    ids=["rank-deficient", "rank-deficient over-constrained", "dependent", "2 shared", "at a wall"],
)
def test_changes_that_keep_the_ranks(make, seed):
    problem = make(seed)
    solution = solve(problem, EXACT)
    with pytest.raises(NotDifferentiableError, match="almost every change of the matrix raises it"):
        SolutionDerivative(problem, solution)
    derivative = SolutionDerivative(problem, solution, constant_rank=True)
    direction = Direction(problem, seed)
    direction.matrix = keeping_ranks(problem, seed, 0.0)[1]
    ends = [direction.moved(s, np.zeros(problem.n), keeping_ranks(problem, seed, s)[0]) for s in (SPEED, -SPEED)]
    measured = (ends[0] - ends[1]) / (2.0 * SPEED)
    found = derivative.jvp(**direction.rates())
    size = 1.0 + np.linalg.norm(found)
    np.testing.assert_allclose(found, measured, atol=1e-6 * size**2)
    xbar = np.random.default_rng(seed).standard_normal(problem.n)
    assert direction.dot(derivative.vjp(xbar)) == pytest.approx(xbar @ found, abs=1e-10 * size**2)
    with pytest.raises(NotDifferentiableError, match=r"The rank of level 'level .' changes in this direction"):
        derivative.jvp(**Direction(problem, seed).rates())


# --- where there is none ----------------------------------------------------------------------------------------------


def row(a, lower, upper=None):
    return Level([a], lower, lower if upper is None else upper, name="tool")


REFUSED = {
    "touches": (
        Problem([row([1.0, 0.0], 1.0)], Level(np.eye(2), -1.0, 1.0, name="box")),
        "Row 0 of the hard rows 'box' touches its upper bound without being held there: the answer has a kink",
    ),
    "touches at zero": (
        Problem([row([1.0, 1.0], 1.0)], Level([[1.0, -1.0]], 0.0, 5.0, name="box")),
        "Row 0 of the hard rows 'box' touches its lower bound without being held there",
    ),
    "one of two": (
        Problem([row([1.0, 0.5], 9.0)], Level([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]], -1.0, 1.0, name="box")),
        "Row [01] of the hard rows 'box' touches its upper bound without being held there",
    ),
    "rank": (
        Problem([row([1.0, 0.0], 1.0), row([1.0, 0.0], 2.0)]),
        "The rank of level 'tool' is 0 beside the levels before it and could be 1: almost every change of the matrix",
    ),
    "nearly a rank": (
        Problem([row([1.0, 0.0], 1.0), row([1.0, 1e-10], 1.0)]),
        "The rank of level 'tool' is nearly one less: a singular value beside the levels before it is 1.0e-10 of its norm, "
        "within the tolerance 1e-09",
    ),
    "hard rank": (
        Problem([row([0.0, 1.0], 1.0)], Level.equality([[1.0, 0.0], [2.0, 0.0]], [1.0, 2.0], name="grip")),
        "The rank of the hard rows 'grip' is 1 and could be 2: almost every change of the matrix",
    ),
    "damping": (
        Problem([Level.equality([[1.0, 0.0]], [1.0], damping=ConstantDamping(0.1))]),
        "The problem has levels with damping",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_where_there_is_no_derivative_it_says_so(what):
    problem, text = REFUSED[what]
    with pytest.raises(NotDifferentiableError, match=text):
        vjp(problem, solve(problem, EXACT), np.ones(problem.n))


def answered(problem, x, held):
    solution = Solution(problem, np.array(x))
    solution.held = np.array(held, np.int8)
    return solution


def test_rows_that_a_solver_holds_without_need_are_a_kink():
    problem = Problem([row([1.0, 1.0], 1.0)], Level([[1.0, -1.0]], 0.0, 5.0, name="box"))
    solution = answered(problem, [0.5, 0.5], [-1, 0])
    with pytest.raises(
        NotDifferentiableError, match="'box' is at its lower bound, where the answer would be without it"
    ):
        vjp(problem, solution, np.ones(2))


def test_rows_that_hold_the_same_are_a_kink():
    problem = Problem([row([1.0, 0.5], 9.0)], Level([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]], -1.0, 1.0, name="box"))
    solution = answered(problem, [1.0, 1.0], [1, 1, 1, 0])
    with pytest.raises(
        NotDifferentiableError, match=r"Row [01] of the hard rows 'box' is held at its upper bound beside rows"
    ):
        vjp(problem, solution, np.ones(2))
    # The level alone puts x_1 to the bound, and a lower one pulls it there too.
    problem = Problem([row([1.0, 0.0], 1.0), row([1.0, 1.0], 4.0)], Level([[1.0, 0.0]], -1.0, 1.0, name="wall"))
    solution = answered(problem, [1.0, 3.0], [1, 0, 0])
    with pytest.raises(
        NotDifferentiableError, match="Row 0 of the hard rows 'wall' is held at its upper bound beside rows"
    ):
        vjp(problem, solution, np.ones(2))


def test_rows_held_at_the_wrong_side_are_no_optimum():
    level = row([1.0, 1.0], 1.0)
    problem = Problem([level], Level(np.eye(2), 0.75, 5.0, name="box"))
    right = answered(problem, [0.75, 0.75], [-1, -1, 0])
    np.testing.assert_allclose(vjp(problem, right, np.ones(2)).hard_lower, [1.0, 1.0])
    problem = Problem([level], Level([[0.0, 1.0]], 0.0, 1.0, name="box"))
    with pytest.raises(
        NotDifferentiableError,
        match="Row 0 of the hard rows 'box' is held at its upper bound, and the norm would be better without it: x is not",
    ):
        vjp(problem, answered(problem, [0.0, 1.0], [1, 0]), np.ones(2))
    problem = Problem([Level.equality(np.eye(2), [1.0, 1.0], name="tool")], Level([[0.0, 1.0]], 0.0, 3.0, name="box"))
    with pytest.raises(
        NotDifferentiableError,
        match="Row 0 of the hard rows 'box' is held at its upper bound, and level 'tool' would be better without it",
    ):
        vjp(problem, answered(problem, [1.0, 3.0], [1, 0, 0]), np.ones(2), constant_rank=True)


def test_an_answer_that_is_not_the_optimum_has_none():
    problem = over_constrained(0, rows=(3, 3, 7))
    with pytest.raises(NotDifferentiableError, match="x is not the lexicographic optimum"):
        vjp(problem, solve(problem, "reverse_priority"), np.ones(7))


def test_a_solver_that_does_not_say_what_is_active():
    problem = two_sided(0)
    solution = Solution(problem, solve(problem, EXACT).x)
    with pytest.raises(NotDifferentiableError, match="does not say which rows are active"):
        vjp(problem, solution, np.ones(7))


def test_no_answer_no_derivative():
    problem = Problem([row([1.0, 0.0], 1.0)], Level([[1.0, 0.0], [1.0, 0.0]], [1.0, 2.0], [1.5, 3.0]))
    solution = solve(problem, EXACT)
    assert solution.status is Status.INFEASIBLE
    with pytest.raises(NoSolutionError, match="contradict"):
        vjp(problem, solution, np.ones(2))


def test_misuse():
    problem = independent(0)
    solution = solve(problem, "null_space")
    with pytest.raises(ProblemError, match="answers another problem"):
        vjp(independent(1), solution, np.ones(7))
    with pytest.raises(ProblemError, match="x_bar must be 7 finite numbers"):
        vjp(problem, solution, np.ones(6))
    with pytest.raises(SettingError, match="tolerance is -1"):
        vjp(problem, solution, np.ones(7), tolerance=-1)
    with pytest.raises(SettingError, match="constant_rank is 'yes'; it must be True or False"):
        vjp(problem, solution, np.ones(7), constant_rank="yes")
    with pytest.raises(ProblemError, match=r"matrix_dot has shape \(7,\); it must have that of the data, \(6, 7\)"):
        jvp(problem, solution, np.ones(7))
    with pytest.raises(ProblemError, match="secondary_dot has entries that are not finite"):
        jvp(problem, solution, secondary_dot=np.full(7, np.nan))
    with pytest.raises(ProblemError, match="lower_dot is 'a'; it must be finite numbers"):
        jvp(problem, solution, None, "a")
    with pytest.raises(NotDifferentiableError, match="Row 0 of level 'level 1' is an equality whose bounds would part"):
        jvp(problem, solution, None, np.ones(6))
    with pytest.raises(ProblemError, match="metric_dot is given and the problem has no metric"):
        jvp(problem, solution, metric_dot=np.eye(7))
    weighted = with_metric(problem)
    with pytest.raises(ProblemError, match="metric_dot is not symmetric"):
        jvp(weighted, solve(weighted, "null_space"), metric_dot=np.triu(np.ones((7, 7))))
    with pytest.raises(ProblemError, match="answers another problem"):
        vjp(weighted, solution, np.ones(7))


def test_it_is_there_at_the_top_level():
    assert hqp_rp.vjp is vjp
    assert issubclass(NotDifferentiableError, hqp_rp.HqpError | ArithmeticError)


@pytest.mark.parametrize("weight", [1.0, 1e5, 1e6])
def test_a_large_row_of_a_level_says_nothing_of_a_held_row_that_it_does_not_reach(weight: float) -> None:
    level = Level.equality(np.diag([weight, 1.0]), [2.0 * weight, 1.5])
    problem = Problem([level], Level(np.eye(2), -1.0, 1.0))
    gradient = vjp(problem, solve(problem, "hierarchical_active_set"), [0.0, 1.0])
    np.testing.assert_allclose(gradient.hard_upper, [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(gradient.rhs, [0.0, 0.0], atol=1e-9)
