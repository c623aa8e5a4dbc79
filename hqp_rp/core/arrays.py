"""What is wrong with arrays that native code cannot read."""

from __future__ import annotations

from typing import Any

import numpy as np

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import Level, split_levels


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
