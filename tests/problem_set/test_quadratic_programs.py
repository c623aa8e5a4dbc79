"""Each quadratic program has the answer that it states: by its optimality conditions, and by a QP solver."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import problems
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.problems import quadratic_programs as module
from hqp_rp.problems.quadratic_programs import quadratic_programs

KNOWN = {name: problems.load(name) for name in problems.names()}
PROGRAMS = [program for known in KNOWN.values() for program in quadratic_programs(known)]


def test_every_problem_has_its_stages() -> None:
    names = [program.name for program in PROGRAMS]
    assert len(names) == len(set(names))
    assert {name.rpartition("/")[0] for name in names} == set(problems.names())
    assert sum(name.endswith("/norm") for name in names) == len(problems.names())
    infeasible = [program for program in PROGRAMS if program.x is None]
    assert {program.name.partition("/")[0] for program in infeasible} == {"infeasible"}
    assert [p.name for p in PROGRAMS if p.name.startswith("sawyer/3-7-3_band_q0")] == [
        "sawyer/3-7-3_band_q0/1",
        "sawyer/3-7-3_band_q0/3",
        "sawyer/3-7-3_band_q0/norm",
    ]


def _gradient_left(program: module.QuadraticProgram) -> float:
    """How much of P x + q no multipliers of the right sign explain, over ||P|| ||x|| + ||q||."""
    x = program.x
    assert x is not None
    slack = program.h - program.G @ x
    size = np.linalg.norm(program.G, axis=1) * np.linalg.norm(x) + np.abs(program.h)
    active = program.G[slack <= 1e-9 * size]
    # Equalities pull both ways.
    columns = np.vstack((active, program.A, -program.A)).T
    lengths = np.linalg.norm(columns, axis=0)
    gradient = program.P @ x + program.q
    scale = np.linalg.norm(program.P, 2) * np.linalg.norm(x) + np.linalg.norm(program.q)
    if columns.size == 0 or scale == 0.0:
        return float(np.linalg.norm(gradient)) / max(scale, 1e-300)
    rest = nonnegative_least_squares(columns[:, lengths > 0] / lengths[lengths > 0], -gradient)[1]
    return float(np.linalg.norm(rest)) / scale


def test_the_stated_answer_is_feasible_and_optimal() -> None:
    for program in PROGRAMS:
        if program.x is None:
            continue
        x = program.x
        size = np.linalg.norm(x)
        equal = np.abs(program.A @ x - program.b) - 1e-11 * (
            np.linalg.norm(program.A, axis=1) * size + np.abs(program.b)
        )
        assert equal.max(initial=0.0) <= 0.0, program.name
        over = program.G @ x - program.h - 1e-11 * (np.linalg.norm(program.G, axis=1) * size + np.abs(program.h))
        assert over.max(initial=0.0) <= 0.0, program.name
        known = KNOWN[program.name.rpartition("/")[0]]
        assert np.isfinite(program.P).all(), program.name
        # What is badly scaled overflows when its square is squared again.
        if not known.ambiguous and known.distance is None and known.family != "badly_scaled":
            assert _gradient_left(program) <= 1e-8, program.name
            assert program.cost == pytest.approx(0.5 * x @ program.P @ x + program.q @ x)


def test_a_solver_finds_the_unique_answer() -> None:
    import daqp

    tried = 0
    for program in PROGRAMS:
        family = program.name.partition("/")[0]
        if not program.unique or family not in ("independent", "hard_rows", "inequality", "metric", "damped"):
            continue
        if KNOWN[program.name.rpartition("/")[0]].distance is not None:
            continue
        A = np.ascontiguousarray(np.vstack((program.A, program.G)))
        upper = np.concatenate((program.b, program.h))
        lower = np.concatenate((program.b, np.full(len(program.h), -1e30)))
        # Equalities that depend on each other may miss by rounding.
        upper[: len(program.b)] += 1e-10
        lower[: len(program.b)] -= 1e-10
        x, _, flag, _ = daqp.solve(program.P, program.q, A, upper, lower, np.zeros(len(A), np.int32), primal_tol=1e-11)
        assert flag > 0, program.name
        assert np.linalg.norm(x - program.x) <= 1e-6 * (1.0 + np.linalg.norm(x)), program.name
        tried += 1
    assert tried > 40


def test_files_hold_the_arrays(tmp_path, capsys) -> None:
    module.main(["--output", str(tmp_path)])
    assert capsys.readouterr().out.startswith(f"{len(PROGRAMS)} quadratic programs in ")
    assert len(list(tmp_path.glob("*.npz"))) == len(PROGRAMS)
    with np.load(tmp_path / "sawyer_3-3-7_q0_2.npz", allow_pickle=False) as file:
        assert sorted(file.files) == ["A", "G", "P", "b", "cost", "h", "name", "q", "unique", "x"]
        assert str(file["name"]) == "sawyer/3-3-7_q0/2"
        assert file["A"].shape == (3, 7)
