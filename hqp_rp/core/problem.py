"""The prioritized problem: levels of two-sided rows, most important first, held stacked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, final

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core import _native
from hqp_rp.core.arrays import require_arrays
from hqp_rp.core.damping import LevelDamping
from hqp_rp.core.level import FloatArray, IntArray, Level, checked_levels, frozen, split_levels

if TYPE_CHECKING:
    from hqp_rp.core.row_names import RowName

__all__ = ["FloatArray", "IntArray", "Level", "Problem", "Stacked"]


_T = TypeVar("_T")
_ROW_NAMES = "row names as given"
_keep = _native.Problem.__dict__["kept"].__set__  # not by way of __setattr__, a tenth of a control step's time


class Stacked(NamedTuple):
    """A problem with its hard rows on top: rows (M, n), bounds (M,), offsets (p + 2,), level 0 being the hard rows."""

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    offsets: IntArray


@final
class Problem(_native.Problem):
    """A lexicographic problem: minimize each level's violation in turn, without spoiling the levels before it.

    ::

        lex min_x ( ||v_1(x)||, ||v_2(x)||, ..., ||v_p(x)||, ||x|| )
        subject to  hard.lower <= hard.A x <= hard.upper

    where `v_k(x)` is the violation of `lower_k <= A_k x <= upper_k` (for an equality, `A_k x - b_k`). The last term
    makes the answer unique: among all lexicographic optima, the one of least norm. A level with damping minimizes
    `||v_k(x)||^2 + ||D_k x - d_k||^2` instead, and the levels after it keep what its rows reached; see
    `hqp_rp.core.level_damping`. With a metric W, ||x||_W = sqrt(x^T W x) takes the place of ||x|| in all of this, damping and
    the rank rule included; see `hqp_rp.core.metric`.

    Args:
        levels: the levels, most important first; every level has the same number of unknowns.
        hard: rows that no answer may violate; optional.
        metric: W (n, n), symmetric positive definite, or (n,) for a diagonal; None means the identity.

    Attributes:
        matrix: (M, n), all levels stacked, C-contiguous and read-only.
        lower, upper: (M,) bounds, read-only.
        offsets: (p + 1,) int64: level k (from 0) holds rows `offsets[k]:offsets[k + 1]`.
        names: p strings.
        hard: `Level` or None.
        damping: p policies or Nones, or None where no level is damped.
        metric: (n, n), read-only, or None.
        n, p: number of unknowns and of levels.
        is_equality: every row of every level is an equality.
        rows, hard_rows: how many rows the levels have together, and how many are hard.

    Raises:
        ProblemError: no level, no unknown, levels that do not fit together, or a metric that is none; it names the remedy.

    Source: equations (2), (9) of the paper; Escande, Mansard and Wieber 2014 for two-sided rows at any level.
    """

    __slots__ = ()

    def __init__(self, levels: Sequence[Level], hard: Level | None = None, *, metric: ArrayLike | None = None) -> None:
        levels = checked_levels(levels, hard)
        on_top = 0 if hard is None else hard.m
        everything = levels if hard is None else [hard, *levels]
        offsets = np.zeros(len(levels) + 1, dtype=np.int64)
        np.cumsum([level.m for level in levels], out=offsets[1:])
        lower = np.concatenate([level.lower for level in everything])
        equality = all(level.is_equality for level in levels)
        upper = lower
        if on_top or not equality:
            upper = np.concatenate([level.upper for level in everything])
        matrix = np.ascontiguousarray(np.concatenate([level.A for level in everything], axis=0))
        names = tuple(level.name or f"level {k + 1}" for k, level in enumerate(levels))
        damping = tuple(level.damping for level in levels) if any(level.damping for level in levels) else None
        W = None if metric is None else _checked_metric(metric, matrix.shape[1])
        super().__init__(matrix, lower, upper, offsets, names, on_top, None, equality, damping, W)
        if hard is not None:
            self.kept = {"hard": hard}
        if any(level.row_names for level in levels):
            self.kept = {**(self.kept or {}), _ROW_NAMES: [level.row_names for level in levels]}

    @classmethod
    def from_stacked(
        cls,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        offsets: IntArray,
        *,
        names: Sequence[str] | None = None,
        hard: Level | None = None,
        damping: Sequence[LevelDamping | None] | None = None,
        metric: ArrayLike | None = None,
        check: bool = True,
    ) -> Problem:
        """The same problem from stacked arrays: matrix (M, n), lower, upper (M,), offsets (p + 1,).

        damping: one policy or None for each level; None for none at all. metric: as `Problem`; unchecked it must be (n, n).

        With `check=False`, the fast path of a control loop: nothing is copied or checked, so the arrays must be
        C-contiguous float64 (offsets int64), must satisfy what `Level` demands, and must not be written to while the problem
        is in use. Pass the same array as `lower` and `upper` for a pure equality problem.
        """
        if check:
            return cls(split_levels(matrix, lower, upper, offsets, names, damping), hard, metric=metric)
        if names is None:
            names = [f"level {k + 1}" for k in range(len(offsets) - 1)]
        equality = lower is upper or bool((lower == upper).all())
        return cls._of(matrix, lower, upper, offsets, tuple(names), 0, hard, equality, _damping(damping), metric)

    @classmethod
    def from_rows(
        cls,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        offsets: IntArray,
        names: tuple[str, ...],
        hard_rows: int,
        is_equality: bool,
        damping: tuple[LevelDamping | None, ...] | None = None,
        metric: FloatArray | None = None,
        kept: dict[str, Any] | None = None,
    ) -> Problem:
        """The problem whose first `hard_rows` rows are hard, above those of its levels; nothing is checked or copied.

        Args:
            matrix, lower, upper: (hard_rows + M, n), (hard_rows + M,), of all rows; offsets: (p + 1,) of the levels alone.
            names: of the levels. is_equality: whether every row of every level is an equality.
            damping: one policy or None for each level, at least one that is not None; or None.
            metric: (n, n), symmetric positive definite and C-contiguous, or None.
            kept: what goes with the problem, such as the names of its rows (`hqp_rp.core.row_names`), or None.
        """
        problem = cls._of(matrix, lower, upper, offsets, names, hard_rows, None, is_equality, damping, metric)
        if kept is not None:
            _keep(problem, kept)
        return problem

    @classmethod
    def _of(cls, *arrays: Any) -> Problem:
        problem = cls.__new__(cls)
        try:
            _native.Problem.__init__(problem, *arrays)
        except (TypeError, ValueError):
            matrix, lower, upper, offsets, names, _, hard, *_ = arrays
            require_arrays(matrix, lower, upper, offsets, names, hard)
            raise
        return problem

    def _once(self, name: str, make: Callable[[], _T]) -> _T:
        """What `make` returns, kept under that name: most solves ask for none of it."""
        kept = self.kept
        if kept is None:
            kept = self.kept = {}
        if name not in kept:
            kept[name] = make()
        found: _T = kept[name]
        return found

    @property
    def stacked(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """(matrix, lower, upper, offsets) of the levels as they are kept; not to be written to."""
        if not self.on_top:
            return self.given, self.given_lower, self.given_upper, self.given_offsets
        return self._once("stacked", self._below)

    def _below(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        low = self.given_lower[self.hard_rows :]
        high = low if self.is_equality else self.given_upper[self.hard_rows :]
        return self.given[self.hard_rows :], low, high, self.given_offsets

    def _read_only(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        matrix, lower, upper, offsets = self.stacked
        low = frozen(lower.view())
        return frozen(matrix.view()), low, low if upper is lower else frozen(upper.view()), frozen(offsets.view())

    @property
    def matrix(self) -> FloatArray:
        """(M, n), all levels stacked, C-contiguous and read-only."""
        return self._once("public", self._read_only)[0]

    @property
    def lower(self) -> FloatArray:
        """(M,) lower bounds, read-only; -inf means none."""
        return self._once("public", self._read_only)[1]

    @property
    def upper(self) -> FloatArray:
        """(M,) upper bounds, read-only; +inf means none. The same array as `lower` where one was given for both."""
        return self._once("public", self._read_only)[2]

    @property
    def offsets(self) -> IntArray:
        """(p + 1,) int64: level k (from 0) holds rows `offsets[k]:offsets[k + 1]`; read-only."""
        return self._once("public", self._read_only)[3]

    @property
    def hard(self) -> Level | None:
        """The rows that no answer may violate, or None."""
        if not self.on_top:
            given: Level | None = self.given_hard if self.kept is None else self.kept.get("hard", self.given_hard)
            return given
        return self._once("hard", self._top)

    def _top(self) -> Level:
        top = slice(self.hard_rows)
        return Level._view(
            frozen(self.given[top]), frozen(self.given_lower[top]), frozen(self.given_upper[top]), "limits"
        )

    @property
    def levels(self) -> tuple[Level, ...]:
        """The levels, most important first, as views of the stacked arrays."""
        return self._once("levels", lambda: tuple(self._views()))

    @property
    def damping_rows(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """D (R, n), d (R,), offsets (p + 1,): level k minimizes `||v_k(x)||^2 + ||D_k x - d_k||^2`; not to be written to."""
        from hqp_rp.core.level_damping import damping_rows

        return self._once("damping_rows", lambda: damping_rows(self))

    @property
    def with_hard(self) -> Stacked:
        """`stacked` with the hard rows (none: an empty level) as level 0; not to be written to."""
        return self._once("with_hard", self._together)

    def _together(self) -> Stacked:
        if self.on_top:
            rows = self.given, self.given_lower, self.given_upper
        else:
            rows = self.stacked[:3]
            if self.hard is not None and self.hard.m:
                rows = (
                    np.concatenate((self.hard.A, rows[0])),
                    np.concatenate((self.hard.lower, rows[1])),
                    np.concatenate((self.hard.upper, rows[2])),
                )
        return Stacked(*rows, np.concatenate((np.zeros(1, np.int64), self.given_offsets + self.hard_rows)))

    def _views(self) -> Iterator[Level]:
        stated: list[tuple[str, ...]] = (self.kept or {}).get(_ROW_NAMES, [])
        for k in range(self.p):
            rows = slice(int(self.offsets[k]), int(self.offsets[k + 1]))
            damping = None if self.damping is None else self.damping[k]
            yield Level._view(
                self.matrix[rows],
                self.lower[rows],
                self.upper[rows],
                self.names[k],
                damping,
                stated[k] if stated else (),
            )

    def __setattr__(self, name: str, value: object) -> None:
        if name == "kept":
            super().__setattr__(name, value)
            return
        raise AttributeError(f"A Problem is read-only: build a new one instead of setting {name!r}.")

    def __reduce__(self) -> tuple[object, ...]:
        from hqp_rp.core.row_names import stated_row_names

        arrays = self.matrix, self.lower, self.upper, self.offsets
        given = (self.kept or {}).get(_ROW_NAMES)
        # Names as they are now: what makes them, a stack on a robot, stays behind.
        return (
            _rebuild,
            (*arrays, self.names, self.hard, self.damping, self.metric, given, stated_row_names(self)),
        )

    def __repr__(self) -> str:
        rows = " + ".join(str(int(m)) for m in np.diff(self.offsets))
        hard = f", {self.hard.m} hard rows" if self.hard is not None else ""
        damped = "" if self.damping is None else f", damping {', '.join(str(policy) for policy in self.damping)}"
        metric = "" if self.metric is None else ", with a metric"
        return f"Problem({rows} rows on {self.n} unknowns{hard}{damped}{metric})"

    def _repr_html_(self) -> str:
        from hqp_rp.core.html import problem_html

        return problem_html(self)


def _rebuild(
    matrix: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    offsets: IntArray,
    names: tuple[str, ...],
    hard: Level | None,
    damping: tuple[LevelDamping | None, ...] | None = None,
    metric: FloatArray | None = None,
    row_names: list[tuple[str, ...]] | None = None,
    stated: dict[str, list[RowName]] | None = None,
) -> Problem:
    problem = Problem.from_stacked(
        matrix, lower, upper, offsets, names=names, hard=hard, damping=damping, metric=metric
    )
    if row_names is not None:
        problem.kept = {**(problem.kept or {}), _ROW_NAMES: row_names}
    if stated:
        from hqp_rp.core.row_names import state_row_names

        state_row_names(problem, stated)
    return problem


def _checked_metric(metric: ArrayLike, n: int) -> FloatArray:
    from hqp_rp.core.metric import checked_metric

    return checked_metric(metric, n)


def _damping(damping: Sequence[LevelDamping | None] | None) -> tuple[LevelDamping | None, ...] | None:
    """As a problem keeps it: None where no level is damped."""
    return tuple(damping) if damping is not None and any(damping) else None
