"""LexLS as a peer: what is asked of the folders, and, where a checkout is named, that its answers are right.

The checkout is no part of this project: HQP_RP_LEXLS names its folder.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from hqp_rp.core.errors import SettingError
from tests.bench.accuracy import references
from tests.bench.families import random_problem
from tests.bench.floor import LEXLS, _judged, measure_floor
from tests.bench.lexls import HEADER, SOLVES, checked_lexls, lexls_loops

CHECKOUT = os.environ.get("HQP_RP_LEXLS", "")
needs_lexls = pytest.mark.skipif(not CHECKOUT, reason="HQP_RP_LEXLS names no checkout of LexLS")


def checkout(folder: Path) -> Path:
    (folder / HEADER).parent.mkdir(parents=True)
    (folder / HEADER).write_text("")
    return folder


def eigen(folder: Path) -> Path:
    (folder / "Eigen").mkdir(parents=True)
    (folder / "Eigen" / "Dense").write_text("")
    return folder


def test_folders_are_checked(tmp_path: Path) -> None:
    assert checked_lexls(None, None) is None
    with pytest.raises(SettingError, match=r"holds no include/lexls/lexlse\.h; give a checkout"):
        checked_lexls(tmp_path, None)
    lexls = checkout(tmp_path / "lexls")
    with pytest.raises(SettingError, match=r"There is no Eigen/Dense in .*empty; give the folder"):
        checked_lexls(lexls, tmp_path / "empty")
    with pytest.raises(SettingError, match="give lexls too"):
        checked_lexls(None, tmp_path)
    found = checked_lexls(lexls, eigen(tmp_path / "eigen"))
    assert found == (str(lexls), str(tmp_path / "eigen"))


def test_a_header_that_does_not_compile_is_a_sentence(tmp_path: Path) -> None:
    lexls = checkout(tmp_path / "lexls")  # an empty header: there is no LexLS::Index in it
    folders = str(lexls), str(eigen(tmp_path / "eigen"))
    (found,), missing = measure_floor(["7_3-3"], lexls=folders, quick=True, calls=8, budget=0.002)
    assert LEXLS not in found.times
    assert any(sentence.startswith("LexLS takes no part: ") for sentence in missing)


@needs_lexls
def test_lexls_solves_what_it_is_given() -> None:
    folders = checked_lexls(Path(CHECKOUT), None)
    assert folders is not None
    for rows, determined in (((6, 1, 7), True), ((3, 3), False)):
        problems = [random_problem(np.random.default_rng(i), 7, rows) for i in range(4)]
        loops = lexls_loops(problems, folders)
        found = {way: _judged(problems, loop, references(problems)) for way, loop in loops.items()}
        assert set(found) == set(SOLVES)
        assert found["solveLeastNorm_1"].ok
        assert found["solveLeastNorm_2"].ok
        assert found["solve"].ok is determined  # a basic solution is not of least norm


@needs_lexls
def test_the_fastest_certified_way_is_taken() -> None:
    (found,), _ = measure_floor(["7_3-3"], lexls=checked_lexls(Path(CHECKOUT), None), quick=True, calls=8, budget=0.002)
    assert found.accuracy[LEXLS].ok
    assert found.lexls in ("solveLeastNorm_1", "solveLeastNorm_2")
