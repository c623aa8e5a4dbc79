"""Problems that reach a kernel by the address of a block."""

from __future__ import annotations

import gc
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hqp_rp import ConstantDamping, Level, Problem, ProblemError, get_solver, solve
from hqp_rp.core.kernels import direct, room
from hqp_rp.core.kernels.cascade import null_space, null_space_room
from hqp_rp.core.kernels.compile import entry, fixed, kernel
from hqp_rp.core.problem import assembled


def arrays(n: int = 7, rows: tuple[int, ...] = (3, 3), seed: int = 0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((sum(rows), n)), rng.standard_normal(sum(rows)), np.array([0, *np.cumsum(rows)])


def unchecked(A, b, offsets, **more) -> Problem:
    return Problem.from_stacked(A, b, b, offsets, check=False, **more)


def plainly(A, b, offsets) -> np.ndarray:
    """The kernel called with arrays."""
    x = np.empty(A.shape[1])
    assert null_space(A, b, offsets, np.zeros(len(x)), 1e-12, 0, 0.0, 0.0, x)
    return x


@pytest.mark.parametrize(
    ("n", "rows"), [(1, (1,)), (7, (3, 3)), (8, (3, 0, 5)), (9, (4, 4, 9)), (30, (6, 12, 30)), (100, (15,) * 6)]
)
def test_the_answer_is_that_of_the_kernel_called_with_arrays(n: int, rows: tuple[int, ...]) -> None:
    A, b, offsets = arrays(n, rows)
    x = get_solver("null_space").solve(unchecked(A, b, offsets)).x
    np.testing.assert_array_equal(x, plainly(A, b, offsets))


def test_small_and_large_problems_take_their_room_from_the_stack_and_from_the_heap() -> None:
    assert null_space_room(13, 7, 3) <= room.STACK_NUMBERS < null_space_room(90, 100, 6)


def test_the_block_of_a_problem() -> None:
    A, b, offsets = arrays()
    hard = Level(np.eye(7), -1.0, 1.0)
    problem = unchecked(A, b, offsets, hard=hard)
    assert problem.address == problem.address
    block = problem._block
    assert block.ctypes.data == problem.address
    places = [array.ctypes.data for array in (A, b, b, offsets)]
    assert block[: direct.HARD_MATRIX].tolist() == [*places, 6, 7, 2]
    places = [array.ctypes.data for array in (hard.A, hard.lower, hard.upper)]
    assert block[direct.HARD_MATRIX :].tolist() == [*places, 7]


def test_read_only_arrays_are_described_as_well() -> None:
    A, b, offsets = arrays()
    for array in (A, b, offsets):
        array.flags.writeable = False
    problem = unchecked(A, b, offsets, hard=Level(np.eye(7), -1.0, 1.0))
    assert problem.address == problem._block.ctypes.data
    assert problem._block[direct.MATRIX] == A.ctypes.data
    assert problem._block[direct.HARD_ROWS] == 7
    x = get_solver("null_space").solve(unchecked(A, b, offsets)).x
    np.testing.assert_array_equal(x, plainly(A.copy(), b.copy(), offsets.copy()))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("matrix", lambda A, b, o: (A.astype(np.float32), b, o)),
        ("matrix", lambda A, b, o: (np.asfortranarray(A), b, o)),
        ("lower", lambda A, b, o: (A, np.repeat(b, 2)[::2], o)),
        ("offsets", lambda A, b, o: (A, b, o.astype(np.int32))),
    ],
)
def test_arrays_that_compiled_code_cannot_read_are_refused_by_name(name: str, change) -> None:
    problem = unchecked(*change(*arrays()))
    with pytest.raises(ProblemError, match=f"^{name} is .*; from_stacked.* takes a C-contiguous (float|int)64 array"):
        get_solver("null_space").solve(problem)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda A, b, o: (A, b[:5], o), r"do not fit: matrix \(6, 7\), lower \(5,\)"),
        (
            lambda A, b, o: (A, b, np.array([0, 3, 7])),
            r"offsets = \[0, 3, 7\] must rise from 0 to the number of rows, 6",
        ),
        (lambda A, b, o: (A, b, np.array([0, 7, 6])), "must rise from 0"),
        (lambda A, b, o: (A, b, np.array([1, 3, 6])), "must rise from 0"),
        (lambda A, b, o: (A[0], b, o), r"matrix has shape \(7,\); it must be an array \(M, n\)"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused_before_they_are_read(change, text: str) -> None:
    A, b, offsets = change(*arrays())
    with pytest.raises(ProblemError, match=text):
        get_solver("null_space").solve(Problem.from_stacked(A, b, b, offsets, check=False))


def test_hard_rows_of_another_size_are_refused_before_they_are_read() -> None:
    problem = unchecked(*arrays(), hard=Level(np.eye(6), -1.0, 1.0))
    with pytest.raises(ProblemError, match="hard rows have 6 columns and the levels have 7"):
        get_solver("hierarchical_active_set").solve(problem)


def test_the_arrays_outlive_whoever_made_the_problem() -> None:
    def made() -> Problem:
        A, b, offsets = arrays(seed=5)
        return unchecked(A, b, offsets)

    problem = made()
    address = problem.address
    gc.collect()
    others = [np.full(42, np.nan) for _ in range(1000)]
    assert problem.address == address
    np.testing.assert_array_equal(get_solver("null_space").solve(problem).x, plainly(*arrays(seed=5)))
    assert len(others) == 1000


def test_a_copy_describes_itself() -> None:
    problem = unchecked(*arrays())
    copy = pickle.loads(pickle.dumps(problem))
    assert problem.address != copy.address
    np.testing.assert_array_equal(solve(copy, "null_space").x, solve(problem, "null_space").x)


@pytest.mark.parametrize("name", ["null_space", "reverse_priority"])
def test_the_free_vector_may_be_any_numbers_and_is_not_written_to(name: str) -> None:
    problem = unchecked(*arrays())
    free = np.arange(7.0)
    expected = get_solver(name).solve(problem, free).x
    np.testing.assert_array_equal(free, np.arange(7.0))
    for same in (list(range(7)), np.arange(7), np.arange(14.0)[::2] / 2.0):
        np.testing.assert_array_equal(get_solver(name).solve(problem, same).x, expected)
    with pytest.raises(ProblemError, match=r"secondary has shape \(6,\); it must be \(7,\)"):
        get_solver(name).solve(problem, np.zeros(6))


def test_damping_reaches_the_kernel() -> None:
    problem = unchecked(*arrays())
    plain = solve(problem, "reverse_priority").x
    for name in ("null_space", "reverse_priority"):
        damped = solve(problem, name, damping=ConstantDamping(0.5)).x
        assert np.linalg.norm(damped) < 0.99 * np.linalg.norm(plain)


def test_one_solver_serves_many_threads() -> None:
    problems = [unchecked(*arrays(seed=seed)) for seed in range(64)]
    solver = get_solver("null_space")
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda problem: solver.solve(problem).x, problems * 20))
    for problem, x in zip(problems * 20, found, strict=True):
        np.testing.assert_array_equal(x, solver.solve(problem).x)


def test_fixed_kernels_take_no_other_types_and_entries_are_the_kernel() -> None:
    from numba.core import types

    @kernel
    def twice(x):
        return 2.0 * x[0]

    one = entry(twice, (types.float64[::1],))
    assert one(np.array([1.5])) == twice(np.array([1.5])) == 3.0
    only = fixed(twice, (types.float64[::1],))
    with pytest.raises(TypeError, match="No matching definition"):
        only(np.array([1], dtype=np.int64))


def on_top() -> tuple[Problem, Problem]:
    """A problem whose hard rows stand on top of its levels' rows, and the same stated apart."""
    A, b, offsets = arrays(7, (3, 3, 7))
    box = np.full(7, 0.2)
    rows = np.concatenate((np.eye(7), A))
    low, high = np.concatenate((-box, b)), np.concatenate((box, b))
    starts = np.array([0, *(7 + offsets)])
    together = assembled(rows, low, high, (offsets, starts), ("one", "two", "three"), True, True)
    return together, unchecked(A, b, offsets, names=("one", "two", "three"), hard=Level(np.eye(7), -box, box, "limits"))


def test_rows_that_stand_together_are_described_where_they_lie() -> None:
    together, _ = on_top()
    assert together.address == together._block.ctypes.data
    matrix, lower, upper, _ = together.with_hard
    places = [array.ctypes.data for array in (matrix, lower, upper)]
    assert together._block[direct.HARD_MATRIX :].tolist() == [*places, 7]
    steps = [8 * 7 * 7, 8 * 7, 8 * 7]
    assert together._block[: direct.OFFSETS].tolist() == [a + step for a, step in zip(places, steps, strict=True)]
    assert together._block[direct.ROWS : direct.HARD_MATRIX].tolist() == [13, 7, 3]


def test_what_stands_together_is_the_same_problem() -> None:
    together, apart = on_top()
    found, expected = (get_solver("hierarchical_active_set").solve(problem) for problem in on_top())
    np.testing.assert_array_equal(found.x, expected.x)
    np.testing.assert_array_equal(found.active, expected.active)
    for name in ("matrix", "lower", "upper", "offsets"):
        np.testing.assert_array_equal(getattr(together, name), getattr(apart, name))
    assert together.hard is not None
    assert apart.hard is not None
    for name in ("A", "lower", "upper"):
        array = getattr(together.hard, name)
        np.testing.assert_array_equal(array, getattr(apart.hard, name))
        assert not array.flags.writeable
    assert together.hard is together.hard
    assert repr(together) == repr(apart)
    assert (together.p, together.n, together.names, together.is_equality) == (3, 7, ("one", "two", "three"), True)
    for ours, theirs in zip(pickle.loads(pickle.dumps(together)).with_hard, apart.with_hard, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(AttributeError, match="A Problem has no 'rows'"):
        together.rows  # type: ignore[attr-defined]  # noqa: B018
