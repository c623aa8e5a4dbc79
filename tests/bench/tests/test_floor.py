"""The C floor solves what the kernel solves, and the parts of a call are told apart."""

from __future__ import annotations

import shutil
from collections.abc import Sequence

import numpy as np
import pytest

import hqp_rp
from hqp_rp.core.problem import Level, Problem
from tests.bench import floor as bench_floor
from tests.bench.families import random_problem
from tests.bench.floor import CALL, FLOOR, KERNEL, SOLVE, Floor, c_loop, measure_floor, per_solve
from tests.bench.native_loop import NotBuilt
from tests.bench.timing import timing

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc on this machine")

SHAPES = [(7, (3, 3)), (7, (6, 1, 7)), (8, (8,)), (9, (2, 9, 4)), (17, (5, 4, 3, 12)), (3, (1, 0, 1)), (24, (9,) * 3)]


@needs_cc
@pytest.mark.parametrize(("n", "rows"), SHAPES)
def test_the_floor_is_certified(n: int, rows: Sequence[int]) -> None:
    problems = [random_problem(np.random.default_rng([n, i]), n, rows) for i in range(6)]
    for problem, x in zip(problems, c_loop(problems)(1), strict=True):
        assert hqp_rp.certify(problem, x, tolerance=1e-9).ok
        assert x == pytest.approx(hqp_rp.solve(problem, "null_space").x, abs=1e-9)


@needs_cc
def test_the_floor_leaves_dependent_rows_out() -> None:
    rng = np.random.default_rng(2)
    A = rng.standard_normal((3, 7))
    doubled = np.vstack([A[0], 2.0 * A[0], A[1]])
    first = Level.equality(doubled, doubled @ rng.standard_normal(7))
    problem = Problem(
        [first, Level.equality(np.vstack([A[1], A[2]]), rng.standard_normal(2)), Level.equality(A, np.ones(3))]
    )
    x = c_loop([problem])(1)[0]
    assert x == pytest.approx(hqp_rp.solve(problem, "null_space").x, abs=1e-10)
    zero = Problem([Level.equality(np.zeros((2, 7)), np.ones(2)), Level.equality(A, np.ones(3))])
    assert c_loop([zero])(1)[0] == pytest.approx(hqp_rp.solve(zero, "null_space").x, abs=1e-10)


def test_times_of_passes_are_for_one_solve() -> None:
    found = per_solve(timing("a", np.array([8000, 8000, 8000, 8000, 12000])), 4)
    assert found.median == pytest.approx(2e-6)
    assert found.parts == pytest.approx([2e-6] * 4 + [3e-6])


def test_shares_add_up() -> None:
    times = {label: timing(label, np.array([ns] * 5)) for label, ns in ((KERNEL, 1000), (CALL, 1500), (SOLVE, 2500))}
    found = Floor("7_3-3", "7 joints", times, {})
    assert [found.share(part) for part in ("kernel", "dispatch", "solution")] == pytest.approx([0.4, 0.2, 0.4])


@needs_cc
def test_kernel_and_floor_take_part_and_are_certified() -> None:
    (found,), missing = measure_floor(["7_3-3-7"], quick=True, calls=8, budget=0.002)
    assert missing == ()
    assert set(found.times) == {KERNEL, FLOOR, CALL, SOLVE}
    assert {label: item.certified for label, item in found.accuracy.items()} == {KERNEL: 16, FLOOR: 16}
    assert found.lexls == ""


def test_without_a_compiler_the_kernel_is_timed_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(problems: object) -> object:
        raise NotBuilt("there is no C compiler 'cc' here")

    monkeypatch.setattr(bench_floor, "c_loop", none)
    (found,), missing = measure_floor(["7_3-3"], quick=True, calls=8, budget=0.002)
    assert missing == ("The C floor takes no part: there is no C compiler 'cc' here.",)
    assert set(found.times) == {KERNEL, CALL, SOLVE}
