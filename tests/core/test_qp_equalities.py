"""The quick way through levels of equalities: right or silent, and its proof notices what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import Level, Problem, get_solver, solve
from hqp_rp.core.kernels import qp_equalities
from hqp_rp.core.qp_backend import Backend, QPAnswer, SlackQP, make_backend
from hqp_rp.core.qp_equalities import QuickDesk

SHAPES = ((7, (3, 3)), (7, (3, 3, 7)), (8, (2, 6, 5)), (9, (12, 3)), (30, (6, 6, 3, 12, 30)), (1, (1, 1)))


def random_problem(seed: int, n: int, rows: tuple[int, ...]) -> Problem:
    rng = np.random.default_rng(seed)
    return Problem([Level.equality(rng.standard_normal((m, n)), rng.standard_normal(m)) for m in rows])


def desk_of(problem: Problem) -> QuickDesk:
    return QuickDesk(problem.n, problem.offsets)


class Wrong(Backend):
    """Answers what ProxQP answers, off by `error`."""

    def __init__(self, error: float) -> None:
        self._right, self._error = make_backend("proxqp", 1e-9, 1000), error

    def solve(self, qp: SlackQP, guess=None, dense=None) -> QPAnswer:
        answer = self._right.solve(qp)
        return answer._replace(t=answer.t + self._error)


@pytest.mark.parametrize("backend", ["proxqp", "osqp", "quadprog"])
@pytest.mark.parametrize(("n", "rows"), SHAPES)
@pytest.mark.parametrize("free", [False, True])
def test_it_finds_the_optimum_nearest_to_the_secondary_vector(backend: str, n: int, rows, free: bool) -> None:
    kept = make_backend(backend, 1e-9, 4000)
    desk = desk_of(random_problem(0, n, rows))
    for seed in range(5):
        problem = random_problem(seed, n, rows)
        secondary = np.random.default_rng(seed + 50).standard_normal(n) if free else None
        x, _ = desk.solve(problem, secondary, kept, 1e-9)
        expected = solve(problem, "null_space", secondary=secondary)
        np.testing.assert_allclose(x, expected.x, atol=1e-7 * (1.0 + np.linalg.norm(expected.x)))


def test_dependent_rows_need_no_singular_values_and_a_doubtful_rank_is_left_to_others() -> None:
    A = np.random.default_rng(3).standard_normal((3, 7))
    dependent = Problem([Level.equality(A, [1, 2, 3]), Level.equality(A[:2] * 2.0, [2, 4])])
    doubtful = Problem([Level.equality(A, [1, 2, 3]), Level.equality(A[:2] + 1e-12 * np.eye(7)[:2], [1, 2])])
    proxqp = make_backend("proxqp", 1e-9, 1000)
    x, _ = desk_of(dependent).solve(dependent, None, proxqp, 1e-9)
    np.testing.assert_allclose(x, solve(dependent, "null_space").x, atol=1e-9)
    assert desk_of(doubtful).solve(doubtful, None, proxqp, 1e-9)[0] is None
    assert solve(doubtful, "qp_cascade").status.ok


@pytest.mark.parametrize("error", [1e-6, np.nan])
def test_an_answer_that_is_no_optimum_of_its_qp_is_not_taken(error: float) -> None:
    problem = random_problem(1, 7, (3, 3))
    assert desk_of(problem).solve(problem, None, Wrong(0.0), 1e-9)[0] is not None
    assert desk_of(problem).solve(problem, None, Wrong(error), 1e-9)[0] is None


@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7), (9, 1)])
def test_the_proof_notices_a_point_and_factors_that_are_wrong(
    rows: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = random_problem(2, 7, rows)
    _, rhs, _, offsets = problem.stacked
    desk = desk_of(problem)
    desk.solve(problem, None, make_backend("proxqp", 1e-9, 1000), 1e-9)
    with monkeypatch.context() as patch:  # compiled code takes views by an instruction of its own
        patch.setattr(qp_equalities, "as_matrix", lambda vector, m, n: vector[: m * n].reshape((m, n)))
        room = qp_equalities.room_of.py_func(desk._numbers, desk._counts)

    def holds() -> bool:
        return bool(qp_equalities.proven_by(7, rhs, offsets, room, 1e-9))

    assert holds()
    for array, index in (
        (room.y, 0),  # a level is missed
        (room.y, 6) if room.free[-1] < 7 else (room.y, 5),  # not the nearest, or another level missed
        (room.W, (1, 0)),  # an entry of L
        (room.W, (0, 3)),  # an entry of a reflector
        (room.tau, 1),
    ):
        before = array[index]
        array[index] = before + 1e-6
        assert not holds()
        array[index] = before
        assert holds()


def test_a_workspace_that_was_spoilt_costs_no_later_answer() -> None:
    problem = random_problem(4, 7, (3, 3))
    expected = solve(problem, "null_space").x
    solver = get_solver("qp_cascade", backend="proxqp")
    solver.solve(problem)
    kept = solver._workspace.backend("proxqp", solver.eps_abs, solver.max_iterations)
    w, _ = kept.unconstrained(np.full(3, np.nan))
    assert np.isnan(w).any()
    solution = solver.solve(problem)
    assert solution.status.ok
    np.testing.assert_allclose(solution.x, expected, atol=1e-8)
    assert np.isfinite(kept.unconstrained(np.ones(3))[0]).all()
