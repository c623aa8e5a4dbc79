"""LexLS, an optional peer: its equality solver, compiled from a checkout that the user names, called in a C++ loop."""

from __future__ import annotations

import ctypes
import functools
import itertools
import pathlib
import subprocess
from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from tests.bench.native_loop import Loop, build, caller, stacked

HEADER = pathlib.Path("include/lexls/lexlse.h")
"""What a checkout of github.com/jrl-umi3218/lexls holds."""

SOLVES = {"solve": 0, "solveLeastNorm_1": 1, "solveLeastNorm_2": 2}
"""LexLS's ways from its factorization to x: a basic solution; least norm by Givens rotations; by normal equations."""

_EIGEN_FOLDERS = ("/usr/include/eigen3", "/usr/local/include/eigen3")


def checked_lexls(folder: pathlib.Path | None, eigen: pathlib.Path | None) -> tuple[str, str] | None:
    """The folders of LexLS and of Eigen, or None without LexLS. Raises `SettingError` when one is not what it should be."""
    if folder is None:
        if eigen is not None:
            raise SettingError(
                f"eigen is {str(eigen)!r}, and LexLS, which it is for, is not asked for; give lexls too."
            )
        return None
    if not (folder / HEADER).is_file():
        raise SettingError(
            f"lexls is {str(folder)!r}, which holds no {HEADER}; give a checkout of github.com/jrl-umi3218/lexls."
        )
    for candidate in [eigen] if eigen is not None else _eigen_folders():
        if (candidate / "Eigen" / "Dense").is_file():
            return str(folder), str(candidate)
    where = f"in {eigen}" if eigen is not None else "where it usually is"
    raise SettingError(f"There is no Eigen/Dense {where}; give the folder that holds the folder Eigen as eigen.")


def _eigen_folders() -> Iterator[pathlib.Path]:
    try:
        found = subprocess.run(["pkg-config", "--cflags-only-I", "eigen3"], capture_output=True, text=True, check=False)
        yield from (pathlib.Path(flag.removeprefix("-I")) for flag in found.stdout.split())
    except OSError:
        pass
    yield from map(pathlib.Path, _EIGEN_FOLDERS)


def lexls_loops(problems: Sequence[Problem], folders: tuple[str, str]) -> dict[str, Loop]:
    """One loop over the problems for each of `SOLVES`. Raises `NotBuilt` when the compiler refuses.

    One object of LexLS serves all problems of a shape; each is reset, given its data, factorized and solved.
    """
    library = _library(folders)
    A, b, offsets = stacked(problems)
    count, M, n = A.shape
    rows = np.diff(offsets)
    # By columns, as Eigen has it.
    data = np.ascontiguousarray(np.concatenate([A, b[:, :, None]], axis=2).transpose(0, 2, 1))
    x = np.empty((count, n))

    def looped(way: int) -> Loop:
        call = caller(library.lexls_loop, count, M, n, len(rows), rows, data, way, x)

        def loop(repeats: int) -> FloatArray:
            call(repeats)
            return x

        return loop

    return {name: looped(way) for name, way in SOLVES.items()}


@functools.cache
def _library(folders: tuple[str, str]) -> ctypes.CDLL:
    lexls, eigen = folders
    includes = itertools.chain.from_iterable(("-I", path) for path in (str(pathlib.Path(lexls) / "include"), eigen))
    return build("lexls.cpp", "c++", "-std=c++14", "-DNDEBUG", *includes)
