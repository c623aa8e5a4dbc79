"""The set as quadratic programs: known optimal values, the exact answer as the last one's, and the columns of the file."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
import qpsolvers

from hqp_rp import UnknownNameError, problems
from hqp_rp.problems.qpbenchmark import KEYS, frame, main, programs

NAMES = (
    "independent/n7_3-3_s0",
    "over_constrained/n7_6-3-7_s0",
    "dependent/n7_3-3_shared1_conflict",
    "inequality/n7_3-3-7_s0",
    "hard_rows/n7_3-3_mixed",
    "metric/n7_3-3_dense",
    "metric/n7_3-3_box",
    "torque/limits_q0",
)


def solved(program: dict[str, object]) -> np.ndarray:
    given = {key: None if program[key] is None else np.array(program[key]) for key in KEYS if key != "name"}
    answer = qpsolvers.solve_qp(**given, solver="piqp")
    assert answer is not None
    return answer


@pytest.mark.parametrize("name", NAMES)
def test_each_program_has_the_value_of_its_level_and_the_last_one_the_answer(name: str) -> None:
    known = problems.load(name)
    found = list(programs(known))
    assert [program["name"] for program in found] == [
        *(f"{name}/level_{k + 1}" for k in range(known.problem.p)),
        f"{name}/least_norm",
    ]
    for program, level, residual in zip(found[:-1], known.problem.levels, known.exact.residuals, strict=True):
        x = solved(program)[: known.problem.n]
        value = level.A @ x
        violation = np.linalg.norm(np.maximum(value - level.upper, 0.0) + np.maximum(level.lower - value, 0.0))
        assert violation == pytest.approx(residual, rel=1e-5, abs=1e-6 * (1.0 + np.abs(level.A).max()))
    np.testing.assert_allclose(
        solved(found[-1]), known.exact.x, rtol=1e-5, atol=1e-5 * (1 + np.abs(known.exact.x).max())
    )


def test_what_is_no_such_program_is_left_out() -> None:
    assert not list(programs(problems.load(problems.names("infeasible")[0])))
    assert not list(programs(problems.load(problems.names("damped")[0])))


def test_the_file_has_the_columns_and_shapes_that_are_read_back(tmp_path, capsys) -> None:
    path = tmp_path / "set.parquet"
    main([str(path), "--family", "hard_rows", "--family", "independent"])
    assert f"{path}: " in capsys.readouterr().out
    table = pl.read_parquet(path)
    assert tuple(table.columns) == KEYS
    assert table.equals(frame(["hard_rows", "independent"]))
    for row in table.iter_rows(named=True):
        n = len(row["q"])
        assert len(row["P"]) == n * n
        for matrix, vector in (("G", "h"), ("A", "b")):
            assert (row[matrix] is None) == (row[vector] is None)
            if row[matrix] is not None:
                assert len(row[matrix]) == n * len(row[vector])
                assert np.isfinite(row[vector]).all()
    with pytest.raises(UnknownNameError, match="hard_rows"):
        frame(["hard_row"])
