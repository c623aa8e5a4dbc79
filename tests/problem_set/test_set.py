"""The files of the set: what they hold, how they are found and read, and that numpy is enough to read them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hqp_rp
from hqp_rp import FileError, UnknownNameError, problems
from hqp_rp.problems.known_problem import load_known, to_arrays
from hqp_rp.problems.make import PAGES, differences, page_with, read_arrays, table

KNOWN = {name: problems.load(name) for name in problems.names()}


def test_every_family_has_problems_and_every_file_a_family() -> None:
    assert all(problems.names(family) for family in problems.families())
    files = {path.relative_to(problems.DATA).with_suffix("").as_posix() for path in problems.DATA.rglob("*.npz")}
    assert files == set(problems.names())
    for name, known in KNOWN.items():
        assert known.name == name
        assert name.startswith(known.family + "/")
        new = known.family in ("metric", "damped", "torque")
        assert known.set_version == ("1.1" if new else "1.0")
    assert max(known.set_version for known in KNOWN.values()) == problems.version


def test_the_set_stays_small() -> None:
    assert sum(path.stat().st_size for path in problems.DATA.rglob("*.npz")) < 3_000_000


def test_the_families_hold_what_they_are_named_for() -> None:
    assert all(known.feasible == (known.family != "infeasible") for known in KNOWN.values())
    assert any(known.problem.n >= 36 and known.problem.p == 5 for known in KNOWN.values() if known.family == "humanoid")
    several = [k for k in KNOWN.values() if sum(not level.is_equality for level in k.problem.levels) > 1]
    assert len(several) >= 8, "inequality rows at several levels"
    assert {k.family for k in KNOWN.values() if k.ambiguous} == {"near_singular", "sawyer", "dual_arm"}
    assert {k.family for k in KNOWN.values() if k.problem.hard is not None} >= {
        "sawyer",
        "dual_arm",
        "humanoid",
        "hard_rows",
    }


def test_a_file_is_an_ordinary_problem_file() -> None:
    for name, known in KNOWN.items():
        problem = hqp_rp.load_problem(problems.path(name))
        assert problem.matrix.tobytes() == known.problem.matrix.tobytes()
        assert problem.names == known.problem.names


def test_what_is_loaded_writes_the_same_arrays() -> None:
    for name, known in KNOWN.items():
        assert not differences(to_arrays(known), read_arrays(problems.path(name))), name


def test_arrays_have_the_shapes_of_the_readme() -> None:
    readme = (problems.DATA.parent / "README.md").read_text(encoding="utf-8")
    for name in problems.names():
        with np.load(problems.path(name), allow_pickle=False) as file:
            (M, n), p = file["matrix"].shape, len(file["offsets"]) - 1
            assert file["lower"].shape == file["upper"].shape == (M,)
            assert file["names"].shape == file["residuals"].shape == file["ranks"].shape == (p,)
            assert file["x"].shape == (n,)
            assert np.isfinite(file["x"]).all() == bool(file["feasible"])
            assert bool(file["ambiguous"]) == ("x_rule" in file) == bool(str(file["reason"]))
            assert all(f"`{array}`" in readme for array in file.files), file.files


def test_ambiguous_problems_hold_both_answers() -> None:
    ambiguous = [known for known in KNOWN.values() if known.ambiguous]
    assert len(ambiguous) >= 20
    for known in ambiguous:
        exact, rule = known.answers
        assert np.linalg.norm(exact.x - rule.x) > 1e-3 * (1.0 + np.linalg.norm(exact.x)), known.name
        assert known.truth("library").x is rule.x
        assert known.truth().x is exact.x
        assert known.truth().ambiguous


def test_the_answer_serves_as_reference_of_the_distance() -> None:
    known = KNOWN["sawyer/3-3_q1"]
    assert hqp_rp.distance(known.problem, known.exact.x, reference=known.truth()).value == 0.0
    infeasible = KNOWN["infeasible/n7_3-3_box"]
    assert infeasible.exact is None
    assert not infeasible.answers
    assert not infeasible.truth().feasible
    with pytest.raises(UnknownNameError, match="Valid: exact, library"):
        known.truth("exakt")


def test_loading_needs_numpy_only() -> None:
    program = (
        "import sys, hqp_rp\n"
        "assert 'hqp_rp.problems' not in sys.modules\n"
        "known = hqp_rp.problems.load('humanoid/12-3-12-3-32_limits_q1')\n"
        "assert known.exact.x.shape == (38,)\n"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))\n"
        "print(*sorted(name for name in sys.modules if name.startswith('hqp_rp.')))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    packages, modules = (set(line.split()) for line in done.stdout.splitlines())
    assert not packages & {"flint", "scipy", "mujoco", "pinocchio", "osqp", "proxsuite"}
    assert not {name.split(".")[1] for name in modules} & {"robot", "control", "scenarios", "compare", "solvers"}


def test_errors_name_the_value_and_the_valid_ones(tmp_path: Path) -> None:
    with pytest.raises(
        UnknownNameError, match=r"no family of problems named 'near_singula'.*Did you mean 'near_singular'"
    ):
        problems.names("near_singula")
    with pytest.raises(UnknownNameError, match=r"no problem named 'sawyer/3-3_q9'.*Did you mean 'sawyer/3-3_q"):
        problems.load("sawyer/3-3_q9")
    with pytest.raises(UnknownNameError, match=r"Valid: .*humanoid/\.\.\."):
        problems.load("../robots")
    plain = hqp_rp.save_problem(KNOWN["sawyer/3-3_q0"].problem, tmp_path / "plain.npz")
    with pytest.raises(FileError, match=r"plain\.npz: a problem without the array 'distance'"):
        load_known(plain)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_table_is_the_one_of_the_files(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "| all | " in text
    assert text == page_with(text, table(KNOWN.values())), "remake it: python -m hqp_rp.problems.make"
