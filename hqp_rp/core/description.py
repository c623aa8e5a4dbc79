"""What compiled code is told of a problem, once: the block of `hqp_rp.core.kernels.direct`; errors for what it cannot read."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import IntArray, Level, split_levels

if TYPE_CHECKING:
    from hqp_rp.core.problem import Problem


@functools.cache
def unknown_block() -> IntArray:
    """A block of `hqp_rp.core.kernels.direct` for rows that are nobody's problem."""
    return np.zeros(_direct().SIZE, np.int64)


def block_of(offsets: IntArray, on_top: int, n: int) -> IntArray:
    """A block of `hqp_rp.core.kernels.direct` that knows everything but where the rows are.

    offsets (p + 1,) of the levels must live as long as the block and its copies; on_top hard rows, n unknowns.
    """
    direct = _direct()
    block = np.zeros(direct.SIZE, np.int64)
    block[direct.OFFSETS] = offsets.__array_interface__["data"][0]
    block[direct.ROWS], block[direct.UNKNOWNS], block[direct.LEVELS] = offsets[-1], n, len(offsets) - 1
    block[direct.HARD_ROWS] = on_top
    return block


@functools.cache
def _direct() -> Any:
    """The compiled code that describes arrays, imported when first needed."""
    from hqp_rp.core.kernels import direct

    return direct


def described(problem: Problem) -> tuple[IntArray, int]:
    """The block of `hqp_rp.core.kernels.direct` for the problem's arrays, and its address; both hold as long as these live.

    Raises `ProblemError` for arrays that compiled code cannot read.
    """
    direct = _direct()
    block = np.empty(direct.SIZE, np.int64)
    matrix, lower, upper, offsets = problem.stacked
    hard = problem.hard
    places = [array.__array_interface__["data"][0] for array in (matrix, lower, upper, offsets)]
    top = [0, 0, 0] if hard is None else [a.__array_interface__["data"][0] for a in (hard.A, hard.lower, hard.upper)]
    block[:] = *places, problem.rows, problem.n, problem.p, *top, problem.hard_rows
    return block, int(block.__array_interface__["data"][0])


def require_arrays(
    matrix: Any, lower: Any, upper: Any, offsets: Any, names: tuple[str, ...] | None, hard: Level | None
) -> None:
    """Raise `ProblemError` for arrays that native code cannot read: of another type or layout, or that do not fit."""
    arrays = [("matrix", matrix), ("lower", lower), ("upper", upper), ("offsets", offsets)]
    if hard is not None:
        arrays += [("hard.A", hard.A), ("hard.lower", hard.lower), ("hard.upper", hard.upper)]
    for name, array in arrays:
        kind = np.dtype(np.int64 if name == "offsets" else np.float64)
        if not isinstance(array, np.ndarray) or array.dtype != kind or not array.flags.c_contiguous:
            told = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise ProblemError(
                f"{name} is {told}; from_stacked(check=False) takes a C-contiguous {kind} array as it is. Convert "
                "it with numpy.ascontiguousarray, or leave check=True."
            )
    split_levels(matrix, lower, upper, offsets, names)  # raises where they do not fit
    if hard is not None and hard.n != matrix.shape[1]:
        raise ProblemError(
            f"The hard rows have {hard.n} columns and the levels have {matrix.shape[1]}: they must be equal."
        )
