"""The native core compiled for each instruction set: the same verdicts and, to rounding error, the same answers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
import numpy as np
import hqp_rp
from hqp_rp.core import _native
from tests.problems import boxed, damped, independent, near_singular, two_sided

answers = []
for n in (1, 2, 3, 7, 8, 9, 15, 16, 17, 31, 40):
    sizes = (max(1, n // 3), max(1, n // 2), n)
    free = independent(n, n=n, rows=sizes)
    problems = [free, boxed(free, 0.3), two_sided(n, n=n, rows=sizes, box=0.5), damped(two_sided(n, n=n, rows=sizes, box=0.5))]
    for problem in problems:
        for name in ("null_space", "reverse_priority", "hierarchical_active_set", "saturation_null_space", "qp_cascade"):
            solver = hqp_rp.get_solver(name)
            solution = solver.solve(problem)
            x = np.full(n, np.nan) if solution.x is None else solution.x
            if solution.status.ok and solver.is_lexicographic(problem):
                assert hqp_rp.certify(problem, x, tolerance=solver.tolerance).ok, (name, problem)
            answers.append(x)
    batch = np.stack([free.matrix] * 17), np.stack([free.lower] * 17)
    for name in ("null_space", "reverse_priority"):
        answers.append(hqp_rp.solve_batch(*batch, None, free.offsets, solver=name, threads=1).x[16])
np.savez(sys.argv[1], set=_native.instruction_set(), answers=np.concatenate(answers))
"""


def answers(isa: str, folder: Path) -> tuple[str, np.ndarray]:
    path = folder / f"{isa}.npz"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)],
        cwd=ROOT,
        env=os.environ | {"HQP_RP_ISA": isa},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    with np.load(path) as found:
        return str(found["set"]), found["answers"]


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    return answers("", tmp_path_factory.mktemp("chosen"))[1]


@pytest.mark.parametrize("isa", ["baseline", "v3", "v4"])
def test_every_instruction_set_gives_the_same_answers(isa: str, chosen: np.ndarray, tmp_path: Path) -> None:
    name, found = answers(isa, tmp_path)
    assert name == isa or isa != "baseline"  # one that this processor cannot run is ignored
    np.testing.assert_array_equal(np.isnan(found), np.isnan(chosen))
    np.testing.assert_allclose(found, chosen, rtol=1e-6, atol=1e-7)
