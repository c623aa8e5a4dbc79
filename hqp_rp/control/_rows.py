"""The rows of many tasks and limits in one matrix, checked: the inner part of `Stack.problem`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from hqp_rp.control._checks import real_array
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

TASK, LIMIT, MINK_TASK = 0, 1, 2

Rows: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
Where: TypeAlias = Callable[[Any], str]


def stack_rows(
    items: Sequence[tuple[int, Any]],
    robot: Robot,
    dt: float | None,
    v: FloatArray | None,
    two_sided: bool,
    where: Where,
) -> tuple[Rows, list[int]]:
    """Matrix (M, nv), lower (M,), upper (M,) of all items, and how many rows each has.

    Args:
        items: pairs of a kind (TASK, LIMIT, MINK_TASK) and the item.
        dt: s; not None where an item needs it.
        v: (nv,) velocity before the step, or None.
        two_sided: whether upper may differ from lower; otherwise it is the same array.
        where: says where an item stands, for errors.

    Raises `ProblemError` for rows that do not fit the robot, are not finite or have crossed bounds.
    """
    n = robot.nv
    matrices: list[FloatArray] = []
    lowers: list[FloatArray] = []
    uppers: list[FloatArray] = []
    counts: list[int] = []
    for kind, item in items:
        if kind == TASK:
            A, lower = item.evaluate(robot)
            upper = lower
        elif kind == LIMIT:
            A, lower, upper = item.rows(robot, dt, v)
        else:
            A, lower = item.evaluate(robot, dt)
            upper = lower
        try:
            m = len(lower)
            fits = A.shape == (m, n) and len(upper) == m
        except (AttributeError, TypeError):
            A, lower, upper = (_as_array(value, item, where) for value in (A, lower, upper))
            m = lower.size
            fits = A.shape == (m, n) and upper.shape == lower.shape == (m,)
        if not fits:
            raise _misfit(A, lower, upper, n, where(item))
        matrices.append(A)
        lowers.append(lower)
        uppers.append(upper)
        counts.append(m)
    # Fresh arrays at each step: a problem that someone keeps must not change when the next one is built. `out` makes them
    # C-contiguous float64 whatever the robot library returned.
    total = sum(counts)
    matrix, lower = np.empty((total, n)), np.empty(total)
    upper = np.empty(total) if two_sided else lower
    try:
        np.concatenate(matrices, out=matrix)
        np.concatenate(lowers, out=lower)
        if two_sided:
            np.concatenate(uppers, out=upper)
    except (TypeError, ValueError):
        for (_, item), *values in zip(items, matrices, lowers, uppers, strict=True):
            for value in values:
                _as_array(value, item, where)
        raise
    # One product instead of a mask: any nan or infinity makes it so. Comparisons with nan are false as well.
    sound = math.isfinite(np.vdot(matrix, matrix)) and (
        bool(((lower <= upper) & (lower < math.inf) & (upper > -math.inf)).all())
        if two_sided
        else math.isfinite(lower.dot(lower))
    )
    if not sound:
        _refuse_unsound(items, matrices, lowers, uppers, where)
    return (matrix, lower, upper), counts


def _as_array(value: Any, item: Any, where: Where) -> FloatArray:
    """What an item that is not ours returned, as an array; raises `ProblemError` where it is no real array."""
    try:
        return real_array(value, "it gives a value that")
    except SettingError as error:
        raise ProblemError(f"{where(item)}: {error}") from None


def _misfit(A: FloatArray, lower: FloatArray, upper: FloatArray, n: int, place: str) -> ProblemError:
    shapes = f"a matrix {np.shape(A)} and bounds {np.shape(lower)}"
    if np.shape(upper) != np.shape(lower):
        shapes += f" and {np.shape(upper)}"
    return ProblemError(f"{place} gives {shapes}; for this robot it must be a matrix (m, {n}) and m bounds, (m,).")


def _refuse_unsound(
    items: Sequence[tuple[int, Any]],
    matrices: list[FloatArray],
    lowers: list[FloatArray],
    uppers: list[FloatArray],
    where: Where,
) -> None:
    """Raise `ProblemError` for the first item with a nan, an infinite entry or crossed bounds; pass if all is well.

    (All is well when the quick test overflowed on huge but finite entries.)
    """
    for (kind, item), *values in zip(items, matrices, lowers, uppers, strict=True):
        A, lower, upper = (np.asarray(value) for value in values)
        if not np.isfinite(A).all():
            i, j = (int(k) for k in np.argwhere(~np.isfinite(A))[0])
            raise ProblemError(f"{where(item)}: matrix[{i}, {j}] is {A[i, j]}; every entry must be finite.")
        if kind == LIMIT:
            bad = np.flatnonzero(~((lower <= upper) & (lower < math.inf) & (upper > -math.inf)))
            if bad.size:
                i = int(bad[0])
                raise ProblemError(
                    f"{where(item)}: lower[{i}] is {lower[i]}, upper[{i}] is {upper[i]}; every bound must be a number with "
                    "lower <= upper, and infinite only to mean none."
                )
        else:
            bad = np.flatnonzero(~np.isfinite(lower))
            if bad.size:
                i = int(bad[0])
                raise ProblemError(f"{where(item)}: rate[{i}] is {lower[i]}; every entry must be finite.")
