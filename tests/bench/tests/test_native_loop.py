"""Native sources of the benchmark: compiled where there is a compiler, a sentence where there is none."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.bench import native_loop as bench_native
from tests.bench.families import random_problem
from tests.bench.native_loop import NotBuilt, build, caller, stacked

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc on this machine")

SOURCE = """
int scale(long repeats, long count, double factor, double *x) {
    for (long r = 0; r < repeats; r++)
        for (long i = 0; i < count; i++) x[i] *= factor;
    return repeats > 9;
}
"""


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "scale.c").write_text(SOURCE)
    (tmp_path / "broken.c").write_text("int scale(void) { return nothing; }")
    monkeypatch.setattr(bench_native, "NATIVE", tmp_path)
    monkeypatch.delenv("CC", raising=False)
    return "scale.c"


@needs_cc
def test_a_source_is_compiled_and_called_on_arrays(source: str) -> None:
    x = np.array([1.0, -2.0])
    call = caller(build(source, "c").scale, len(x), 3.0, x)
    call(2)
    assert x.tolist() == [9.0, -18.0]
    with pytest.raises(RuntimeError, match="scale failed"):
        call(10)


@needs_cc
@pytest.mark.usefixtures("source")
def test_what_does_not_compile_is_a_sentence() -> None:
    with pytest.raises(NotBuilt, match=r"cc did not compile broken\.c: .*nothing"):
        build("broken.c", "c")


def test_a_missing_compiler_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler -m64")
    with pytest.raises(NotBuilt, match=r"no C\+\+ compiler 'no-such-compiler' here .*CXX"):
        build("lexls.cpp", "c++")


def test_problems_are_stacked() -> None:
    problems = [random_problem(np.random.default_rng(i), 5, (2, 1)) for i in range(3)]
    A, b, offsets = stacked(problems)
    assert A.shape == (3, 3, 5)
    assert offsets.tolist() == [0, 2, 3]
    for i, problem in enumerate(problems):
        assert np.array_equal(A[i], problem.matrix)
        assert np.array_equal(b[i], problem.lower)
