"""What compiled code is told of a problem, once: the block of `hqp_rp.core.kernels.direct`; errors for what it cannot read."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import IntArray, split_levels

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
    try:
        together = problem._with_hard
        if together is not None and problem._on_top:
            return block, direct.describe_on_top(*together[:3], problem._offsets, block)
        address: int = direct.describe(*problem.stacked, block)
        hard = problem.hard
        if hard is not None and not direct.describe_hard(hard.A, hard.lower, hard.upper, block):
            address = 0
        if address:
            return block, address
    except TypeError:
        pass
    return _described_slowly(block, problem)


def _described_slowly(block: IntArray, problem: Problem) -> tuple[IntArray, int]:
    """The same for read-only arrays; and the error for arrays of another type or layout."""
    hard = problem.hard
    arrays = list(zip(("matrix", "lower", "upper", "offsets"), problem.stacked, strict=True))
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
    matrix, lower, upper, offsets = (np.asarray(array) for _, array in arrays[:4])
    split_levels(matrix, lower, upper, offsets, problem.names)  # raises where they do not fit
    if hard is not None and hard.n != problem.n:
        raise ProblemError(f"The hard rows have {hard.n} columns and the levels have {problem.n}: they must be equal.")
    places = [array.__array_interface__["data"][0] for _, array in arrays]
    places += [0] * (7 - len(places))
    block[:] = *places[:4], problem._rows, problem.n, problem.p, *places[4:], problem._on_top
    return block, int(block.__array_interface__["data"][0])
