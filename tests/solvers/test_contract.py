"""Every solver against every problem: what the `Solver` protocol promises, whatever the method."""

import dataclasses
import pickle

import numpy as np
import pytest

import hqp_rp
from hqp_rp import ConstantDamping, Level, Problem, Solver, Status, Truncation, VariableDamping, certify, get_solver
from tests.problems import EQUALITY_CASES, boxed, damped, in_metric, independent, near_singular, two_sided

VARIANTS = {
    "null_space": [{"variant": "projector"}, {"damping": ConstantDamping(0.1)}, {"damping": Truncation(0.1)}],
    "reverse_priority": [
        {"form": "projector"},
        {"damping": ConstantDamping(0.1)},
        {"damping": VariableDamping(0.1, 0.1), "form": "projector"},
        {"damping": ConstantDamping(0.1), "damp": "everywhere"},
        {"damping": ConstantDamping(0.1), "damp": "everywhere", "form": "projector"},
    ],
    "reverse_priority_unilateral": [{"damping": ConstantDamping(0.1)}],
    "operational_space": [{"singularity": "selective"}, {"singularity": "blend"}],
    "null_space_torque": [{"projection": "successive", "consistency": "static"}],
    "qp_cascade": [{"backend": name} for name in ("osqp", "daqp", "quadprog", "piqp")],
}


def contestants() -> dict[str, Solver]:
    """Every solver with its defaults, and the variants that run other code."""
    found = {}
    for name in hqp_rp.all_solvers():
        for settings in [{}, *VARIANTS.get(name, [])]:
            solver = get_solver(name, **settings)
            found[f"{name} {settings}" if settings else name] = solver
    return found


PROBLEMS = {
    **{name: make(1) for name, make in EQUALITY_CASES.items()},
    "near-singular 1e-9, three levels": near_singular(1e-9, 1, rows=(3, 3, 7)),
    "exactly singular": near_singular(0.0, 1),
    "a level of zeros": Problem([Level.equality(np.zeros((2, 4)), [1.0, 0.0]), Level.equality(np.eye(4), np.ones(4))]),
    "only empty levels": Problem([Level.equality(np.zeros((0, 3)), []), Level.equality(np.zeros((0, 3)), [])]),
    "one unknown": Problem([Level.equality([[2.0]], [1.0]), Level.equality([[1.0]], [5.0])]),
    "40 unknowns": independent(1, n=40, rows=(12, 3, 6, 38)),
    "two-sided": two_sided(1),
    "two-sided in a box": two_sided(1, box=0.2),
    "equalities in a box": boxed(independent(1), 0.3),
    "damped levels": damped(independent(1, rows=(3, 3, 2)), 0),
    "damped two-sided levels in a box": damped(two_sided(1, box=0.2), 1),
    "damped near-singular in a box": damped(boxed(near_singular(1e-6, 1, rows=(3, 3, 7)), 0.3), 2),
    "a metric": in_metric(independent(1, rows=(3, 3, 7)), 0),
    "a diagonal metric in a box": Problem(
        independent(1).levels, hard=Level(np.eye(7), -0.3, 0.3), metric=np.arange(1.0, 8.0)
    ),
    "a metric, two-sided in a box": in_metric(two_sided(1, box=0.2), 1),
    "a metric, near-singular": in_metric(near_singular(1e-6, 1, rows=(3, 3, 7)), 2),
    "a metric, damped two-sided levels in a box": in_metric(damped(two_sided(1, box=0.2), 1), 3),
    "empty hard rows": Problem(independent(1).levels, hard=Level(np.zeros((0, 7)), -1.0, 1.0)),
}

EVERY = pytest.mark.parametrize("solver", [pytest.param(s, id=label) for label, s in contestants().items()])
ANY = pytest.mark.parametrize("problem", [pytest.param(p, id=name) for name, p in PROBLEMS.items()])


@EVERY
@ANY
def test_an_answer_is_what_its_status_says(solver, problem):
    solver.reset()
    before = problem.matrix.copy(), problem.lower.copy(), problem.upper.copy()
    solution = solver.solve(problem)
    sentence = solver.refuses(problem)
    assert isinstance(solution.status, Status)
    assert (solution.status is Status.REFUSED) == (sentence is not None)
    if sentence is not None:
        assert solution.x is None
        assert solution.message == sentence
        assert sentence.endswith(".")
        return
    assert solution.status.ok == (solution.message == "")
    if solution.x is None:
        assert solution.status in (Status.NOT_FINITE, Status.INFEASIBLE, Status.ITERATION_LIMIT, Status.INACCURATE)
        return
    assert solution.x.shape == (problem.n,)
    assert solution.x.dtype == np.float64
    assert np.isfinite(solution.x).all()
    if solution.status.ok and solver.is_lexicographic(problem):
        certificate = certify(problem, solution.x, tolerance=solver.tolerance)
        assert certificate.ok, certificate.sentence
    if solution.status.ok and problem.hard is not None and problem.hard.m:
        reach = problem.hard.A @ solution.x
        slack = solver.tolerance * (np.linalg.norm(problem.hard.A, 2) * np.linalg.norm(solution.x) + 1.0)
        assert (reach >= problem.hard.lower - slack).all()
        assert (reach <= problem.hard.upper + slack).all()
    for array, kept in zip((problem.matrix, problem.lower, problem.upper), before, strict=True):
        np.testing.assert_array_equal(array, kept)


@EVERY
def test_refusals_are_only_about_inequalities(solver):
    assert all(solver.refuses(make(0)) is None for make in EQUALITY_CASES.values())
    assert (solver.refuses(PROBLEMS["two-sided"]) is None) == solver.takes_inequalities
    assert (solver.refuses(PROBLEMS["equalities in a box"]) is None) == solver.takes_hard


@EVERY
def test_the_same_problem_twice_gives_the_same_answer(solver):
    for problem in (PROBLEMS["independent 3+3"], PROBLEMS["6+3+7"]):
        solver.reset()
        first = solver.solve(problem)
        solver.solve(PROBLEMS["dependent 3+3"])
        second = solver.solve(problem)
        assert first.status is second.status
        np.testing.assert_allclose(first.x, second.x, atol=1e-7)


@EVERY
def test_the_free_vector_is_used(solver):
    problem, zeta = independent(2, rows=(2, 2)), np.linspace(-1.0, 1.0, 7)
    solver.reset()
    with_free, without = solver.solve(problem, zeta), solver.solve(problem)
    assert np.linalg.norm(with_free.x - zeta) < np.linalg.norm(without.x - zeta)
    if solver.is_lexicographic(problem):
        assert certify(problem, with_free.x, zeta, tolerance=max(solver.tolerance, 1e-9)).ok


@EVERY
def test_overflow_is_a_status_and_no_exception(solver):
    huge = Problem([Level.equality(1e-200 * np.eye(2), [1e200, 1.0]), Level.equality(np.eye(2), [1.0, 1.0])])
    solver.reset()
    solution = solver.solve(huge)
    assert solution.x is None or np.isfinite(solution.x).all()
    assert not solution.status.ok or solution.x is not None


@EVERY
def test_a_solver_can_be_sent_to_another_process(solver):
    twin = pickle.loads(pickle.dumps(solver))
    assert repr(twin) == repr(solver)
    problem = PROBLEMS["independent 3+3"]
    np.testing.assert_allclose(twin.solve(problem).x, solver.solve(problem).x, atol=1e-7)


@EVERY
def test_it_says_what_it_is(solver):
    assert solver.name == type(solver).__module__.rsplit(".", 1)[1]
    assert solver.summary
    assert solver.source
    assert 0.0 < solver.tolerance < 1.0
    assert type(solver).__doc__
    for field in dataclasses.fields(solver):
        if field.repr:
            assert f"{field.name}=" in repr(solver)
