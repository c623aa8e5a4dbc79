"""Rows of one priority, checked when they are stated."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.damping import LevelDamping, checked_level_damping
from hqp_rp.core.errors import ProblemError

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
_Scalar = TypeVar("_Scalar", bound=np.generic)


class Level:
    """Rows of one priority: `lower <= A x <= upper`, softened at this level (or hard, as `Problem(hard=...)`).

    Args:
        A: (m, n) matrix, finite; m may be 0.
        lower: (m,) lower bounds, or a number for all rows; -inf means none.
        upper: (m,) upper bounds, or a number for all rows; +inf means none.
        name: what reports and errors call the level.
        damping: None, or a policy: the level then minimizes its violation and what the policy adds, in the freedom that the
            levels before it leave, and the levels after it keep what its rows reached; see `hqp_rp.core.level_damping`.
        row_names: what `Solution.conflict` and `active_rows` call its rows, one string for each; without, they are numbered.

    A row whose two bounds coincide is an equality `A x = b`. Arrays are copied and read-only.

    Raises:
        ProblemError: wrong shapes, NaN, infinite entries of A, lower > upper, or row_names that are not one for each row; it
            names the level and the entry.
        SettingError: a damping that is none.
    """

    __slots__ = ("A", "damping", "lower", "name", "row_names", "upper")

    A: FloatArray
    lower: FloatArray
    upper: FloatArray
    name: str
    damping: LevelDamping | None
    row_names: tuple[str, ...]

    def __init__(
        self,
        A: ArrayLike,
        lower: ArrayLike,
        upper: ArrayLike,
        name: str = "",
        *,
        damping: LevelDamping | None = None,
        row_names: Sequence[str] = (),
    ) -> None:
        label = f"level {name!r}" if name else "a level"
        matrix = _real_array(A, f"{label}: A", copy=True)
        if matrix.ndim != 2:
            raise ProblemError(
                f"{label}: A has {matrix.ndim} dimension(s), shape {matrix.shape}; it must be a matrix (m, n). "
                "For one row, write A[None, :]."
            )
        _require_finite(matrix, f"{label}: A")
        object.__setattr__(self, "name", str(name))
        object.__setattr__(self, "damping", checked_level_damping(damping, f"{label}: damping"))
        object.__setattr__(self, "A", frozen(matrix))
        object.__setattr__(self, "lower", frozen(_bound(lower, len(matrix), f"{label}: lower")))
        object.__setattr__(self, "upper", frozen(_bound(upper, len(matrix), f"{label}: upper")))
        object.__setattr__(self, "row_names", _row_names(row_names, len(matrix), label))
        _check_bounds(self.lower, self.upper, label)

    @classmethod
    def equality(
        cls,
        A: ArrayLike,
        b: ArrayLike,
        name: str = "",
        *,
        damping: LevelDamping | None = None,
        row_names: Sequence[str] = (),
    ) -> Level:
        """The level `A x = b`: A (m, n), b (m,), both finite. Raises `ProblemError` as `Level` does."""
        label = f"level {name!r}" if name else "a level"
        rhs = _real_array(b, f"{label}: b", copy=True)
        _require_finite(rhs, f"{label}: b")
        return cls(A, rhs, rhs, name, damping=damping, row_names=row_names)

    @property
    def m(self) -> int:
        """Number of rows."""
        return int(self.A.shape[0])

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(self.A.shape[1])

    @property
    def is_equality(self) -> bool:
        """True when the two bounds of every row coincide."""
        return bool(np.array_equal(self.lower, self.upper))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"A Level is read-only: build a new one instead of setting {name!r}.")

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (self.A, self.lower, self.upper, self.name, self.damping, self.row_names))

    def __repr__(self) -> str:
        kind = "equality" if self.is_equality else "two-sided"
        damped = "" if self.damping is None else f", damping {self.damping!r}"
        return f"Level({self.name!r}, {self.m} x {self.n}, {kind}{damped})"

    @classmethod
    def _view(
        cls,
        A: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        name: str,
        damping: LevelDamping | None = None,
        row_names: tuple[str, ...] = (),
    ) -> Level:
        level = object.__new__(cls)
        for key, value in (("A", A), ("lower", lower), ("upper", upper), ("name", name), ("damping", damping)):
            object.__setattr__(level, key, value)
        object.__setattr__(level, "row_names", row_names)
        return level


def _rebuild(
    A: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    name: str,
    damping: LevelDamping | None,
    row_names: tuple[str, ...] = (),
) -> Level:
    return Level(A, lower, upper, name, damping=damping, row_names=row_names)


def _row_names(names: Sequence[str], m: int, label: str) -> tuple[str, ...]:
    if isinstance(names, str) or not all(isinstance(name, str) for name in names) or len(names) not in (0, m):
        raise ProblemError(f"{label}: row_names is {names!r}; give one string for each of its {m} rows, or none.")
    return tuple(names)


def _real_array(value: ArrayLike, what: str, *, copy: bool) -> FloatArray:
    try:
        raw = np.asarray(value)
    except ValueError as error:
        raise ProblemError(f"{what} is ragged: every row must have the same length ({error}).") from None
    if raw.dtype.kind not in "fiub":
        raise ProblemError(f"{what} has dtype {raw.dtype}; it must hold real numbers (float64).")
    return np.array(raw, dtype=np.float64, copy=copy, order="C")


def _bound(value: ArrayLike, m: int, what: str) -> FloatArray:
    bound = _real_array(value, what, copy=True)
    if bound.ndim == 0:
        bound = np.full(m, float(bound))
    if bound.shape != (m,):
        raise ProblemError(f"{what} has shape {bound.shape}; A has {m} rows, so it must be ({m},) or one number.")
    nan = np.flatnonzero(np.isnan(bound))
    if nan.size:
        raise ProblemError(f"{what}[{nan[0]}] is nan; every bound must be a number (infinite means none).")
    return bound


def _require_finite(array: FloatArray, what: str) -> None:
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        index = ", ".join(str(int(i)) for i in bad[0])
        raise ProblemError(f"{what}[{index}] is {array[tuple(bad[0])]}; every entry must be finite.")


def _check_bounds(lower: FloatArray, upper: FloatArray, label: str) -> None:
    crossed = np.flatnonzero(lower > upper)
    if crossed.size:
        i = int(crossed[0])
        raise ProblemError(
            f"{label}: lower[{i}] = {lower[i]:g} > upper[{i}] = {upper[i]:g}; lower must not exceed upper."
        )
    for name, bound, empty in (("lower", lower, math.inf), ("upper", upper, -math.inf)):
        bad = np.flatnonzero(bound == empty)
        if bad.size:
            raise ProblemError(
                f"{label}: {name}[{int(bad[0])}] is {empty}, which no x can meet; give a finite bound or {-empty}."
            )


def frozen(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    array.flags.writeable = False
    return array


def split_levels(
    matrix: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    offsets: ArrayLike,
    names: Sequence[str] | None,
    damping: Sequence[LevelDamping | None] | None = None,
) -> list[Level]:
    matrix, lower, upper = np.asarray(matrix), np.asarray(lower), np.asarray(upper)
    offsets = np.asarray(offsets)
    if matrix.ndim != 2 or lower.shape != (len(matrix),) or upper.shape != (len(matrix),):
        raise ProblemError(
            f"The stacked arrays do not fit: matrix {matrix.shape}, lower {lower.shape}, upper {upper.shape}; "
            "they must be (M, n), (M,) and (M,)."
        )
    if offsets.ndim != 1 or offsets.dtype.kind not in "iu":
        raise ProblemError(f"offsets must be a vector of integers, not {offsets.dtype} of shape {offsets.shape}.")
    steps = np.diff(offsets.astype(np.int64))
    if len(offsets) < 2 or offsets[0] != 0 or offsets[-1] != len(matrix) or (steps < 0).any():
        raise ProblemError(
            f"offsets = {offsets.tolist()} must rise from 0 to the number of rows, {len(matrix)}, "
            "one entry more than levels."
        )
    p = len(offsets) - 1
    if names is not None and len(names) != p:
        raise ProblemError(f"{len(names)} names for {p} levels: give one name for each level, or none.")
    labels = list(names) if names is not None else [""] * p
    if damping is not None and len(damping) != p:
        raise ProblemError(
            f"{len(damping)} policies of damping for {p} levels: give one or None for each level, or None."
        )
    policies = [None] * p if damping is None else list(damping)
    return [
        Level(matrix[a:b], lower[a:b], upper[a:b], labels[k], damping=policies[k])
        for k, (a, b) in enumerate(itertools.pairwise(offsets))
    ]


def checked_levels(levels: Sequence[Level], hard: Level | None) -> list[Level]:
    if isinstance(levels, Level):
        raise ProblemError("Problem takes a list of levels, most important first: write Problem([level]).")
    levels = list(levels)
    if not levels:
        raise ProblemError("A problem needs at least one level: an empty list was given.")
    for k, level in enumerate(levels):
        if not isinstance(level, Level):
            raise ProblemError(
                f"Level {k + 1} is a {type(level).__name__}: build it with Level(...) or Level.equality(...)."
            )
    n = levels[0].n
    if n == 0:
        raise ProblemError(
            f"{_label(levels[0], 0)} has no unknowns: A is {levels[0].A.shape}, and n must be at least 1."
        )
    for k, level in enumerate(levels):
        if level.n != n:
            raise ProblemError(
                f"{_label(level, k)} has {level.n} columns and {_label(levels[0], 0)} has {n}: "
                "every level must have one column for each unknown."
            )
    if hard is not None:
        if isinstance(hard, Level) and hard.damping is not None:
            raise ProblemError(
                f"The hard rows have damping {hard.damping!r}; hard rows are met or not, so give a level damping."
            )
        if not isinstance(hard, Level):
            stacked = (
                " Stack the rows of several: Level(np.vstack([a.A, b.A]), np.concatenate([a.lower, b.lower]), "
                "np.concatenate([a.upper, b.upper])); row_names= tells them apart."
            )
            raise ProblemError(
                f"hard is a {type(hard).__name__}: it must be one Level(A, lower, upper)."
                + (stacked if isinstance(hard, list | tuple) else "")
            )
        if hard.n != n:
            raise ProblemError(f"The hard rows have {hard.n} columns and the levels have {n}: they must be equal.")
    return levels


def _label(level: Level, k: int) -> str:
    return f"Level {k + 1} ({level.name!r})" if level.name else f"Level {k + 1}"
