"""The prioritized problem: levels of two-sided rows, most important first, held stacked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from hqp_rp.core.description import described
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import FloatArray, IntArray, Level, checked_levels, frozen, split_levels

__all__ = ["FloatArray", "IntArray", "Level", "Problem", "Stacked"]


class Stacked(NamedTuple):
    """A problem with its hard rows on top: rows (M, n), bounds (M,), offsets (p + 2,), level 0 being the hard rows."""

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    offsets: IntArray


class _Fields:
    """What a problem holds, written before it becomes a `Problem`: one that refuses to be written costs ten times as much."""

    __slots__ = (
        "_address",
        "_block",
        "_levels",
        "_offsets",
        "_on_top",
        "_public",
        "_rows",
        "_with_hard",
        "hard",
        "is_equality",
        "n",
        "names",
        "p",
        "stacked",
    )

    stacked: tuple[FloatArray, FloatArray, FloatArray, IntArray]
    names: tuple[str, ...]
    hard: Level | None
    n: int
    p: int
    is_equality: bool
    _address: int
    _block: IntArray
    _levels: tuple[Level, ...] | None
    _offsets: IntArray
    _on_top: int  # hard rows
    _rows: int  # of all levels
    _public: tuple[FloatArray, FloatArray, FloatArray, IntArray] | None
    _with_hard: Stacked | None


@final
class Problem(_Fields):
    """A lexicographic problem: minimize each level's violation in turn, without spoiling the levels before it.

    ::

        lex min_x ( ||v_1(x)||, ||v_2(x)||, ..., ||v_p(x)||, ||x|| )
        subject to  hard.lower <= hard.A x <= hard.upper

    where `v_k(x)` is the violation of `lower_k <= A_k x <= upper_k` (for an equality, `A_k x - b_k`). The last term
    makes the answer unique: among all lexicographic optima, the one of least norm.

    Args:
        levels: the levels, most important first; every level has the same number of unknowns.
        hard: rows that no answer may violate; optional.

    Attributes:
        matrix: (M, n), all levels stacked, C-contiguous and read-only.
        lower, upper: (M,) bounds, read-only.
        offsets: (p + 1,) int64: level k (from 0) holds rows `offsets[k]:offsets[k + 1]`.
        names: p strings.
        hard: `Level` or None.
        n, p: number of unknowns and of levels.
        is_equality: every row of every level is an equality.
        stacked: (matrix, lower, upper, offsets) for compiled kernels, which take only writable arrays; do not write to it.

    Raises:
        ProblemError: no level, no unknown, or levels that do not fit together; it names the level and the remedy.

    Source: equations (2), (9) of the paper; Escande, Mansard and Wieber 2014 for two-sided rows at any level.
    """

    __slots__ = ()

    def __init__(self, levels: Sequence[Level], hard: Level | None = None) -> None:
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
        own_lower = lower[on_top:]
        own_upper = own_lower if equality else upper[on_top:]
        object.__setattr__(self, "__class__", _Fields)
        _become_problem(self, (matrix[on_top:], own_lower, own_upper, offsets), names, hard, equality)
        if on_top:
            object.__setattr__(self, "_with_hard", Stacked(matrix, lower, upper, _under(offsets, on_top)))

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
        check: bool = True,
    ) -> Problem:
        """The same problem from stacked arrays: matrix (M, n), lower, upper (M,), offsets (p + 1,).

        With `check=False`, the fast path of a control loop: nothing is copied or checked, so the arrays must be
        C-contiguous float64 (offsets int64) and writable (for read-only ones every kernel is compiled anew), must satisfy
        what `Level` demands, and must not be written to while the problem is in use. Pass the same array as `lower` and
        `upper` for a pure equality problem.
        """
        if check:
            return cls(split_levels(matrix, lower, upper, offsets, names), hard)
        if names is None:
            names = [f"level {k + 1}" for k in range(len(offsets) - 1)]
        equality = lower is upper or bool((lower == upper).all())
        return _become_problem(_Fields(), (matrix, lower, upper, offsets), tuple(names), hard, equality)

    def _read_only(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """Read-only views of `stacked`, made when first asked for: a control loop's solvers need none."""
        public = self._public
        if public is None:
            matrix, lower, upper, offsets = self.stacked
            low = frozen(lower.view())
            high = low if upper is lower else frozen(upper.view())
            public = (frozen(matrix.view()), low, high, frozen(offsets.view()))
            object.__setattr__(self, "_public", public)
        return public

    @property
    def matrix(self) -> FloatArray:
        """(M, n), all levels stacked, C-contiguous and read-only."""
        return self._read_only()[0]

    @property
    def lower(self) -> FloatArray:
        """(M,) lower bounds, read-only; -inf means none."""
        return self._read_only()[1]

    @property
    def upper(self) -> FloatArray:
        """(M,) upper bounds, read-only; +inf means none. The same array as `lower` where one was given for both."""
        return self._read_only()[2]

    @property
    def offsets(self) -> IntArray:
        """(p + 1,) int64: level k (from 0) holds rows `offsets[k]:offsets[k + 1]`; read-only."""
        return self._read_only()[3]

    @property
    def levels(self) -> tuple[Level, ...]:
        """The levels, most important first, as views of the stacked arrays."""
        levels = self._levels
        if levels is None:
            levels = tuple(self._views())
            object.__setattr__(self, "_levels", levels)
        return levels

    @property
    def with_hard(self) -> Stacked:
        """`stacked` with the hard rows (none: an empty level) as level 0; do not write to it."""
        found = self._with_hard
        if found is None:
            matrix, lower, upper, offsets = self.stacked
            on_top = 0 if self.hard is None else self.hard.m
            if self.hard is not None and on_top:
                matrix = np.concatenate((self.hard.A, matrix))
                lower = np.concatenate((self.hard.lower, lower))
                upper = np.concatenate((self.hard.upper, upper))
            found = Stacked(matrix, lower, upper, _under(offsets, on_top))
            object.__setattr__(self, "_with_hard", found)
        return found

    @property
    def address(self) -> int:
        """Where `hqp_rp.core.kernels.direct` finds this problem described, as long as it lives.

        Raises `ProblemError` where `from_stacked(check=False)` was given arrays that compiled code cannot read.
        """
        if not self._address:
            block, address = described(self)
            object.__setattr__(self, "_block", block)
            object.__setattr__(self, "_address", address)
        return self._address

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """What `assembled` leaves for later: a solver that takes all rows together asks for none of it."""
            if name == "hard":
                matrix, lower, upper, _ = self._with_hard
                top = slice(self._on_top)
                made = Level._view(frozen(matrix[top]), frozen(lower[top]), frozen(upper[top]), "limits")
            elif name == "stacked":
                matrix, lower, upper, _ = self._with_hard
                low = lower[self._on_top :]
                high = low if self.is_equality else upper[self._on_top :]
                made = matrix[self._on_top :], low, high, self._offsets
            else:
                raise AttributeError(f"A Problem has no {name!r}.")
            object.__setattr__(self, name, made)
            return made

    def _views(self) -> Iterator[Level]:
        for k in range(self.p):
            rows = slice(int(self.offsets[k]), int(self.offsets[k + 1]))
            yield Level._view(self.matrix[rows], self.lower[rows], self.upper[rows], self.names[k])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"A Problem is read-only: build a new one instead of setting {name!r}.")

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (self.matrix, self.lower, self.upper, self.offsets, self.names, self.hard))

    def __repr__(self) -> str:
        rows = " + ".join(str(int(m)) for m in np.diff(self.offsets))
        hard = f", {self.hard.m} hard rows" if self.hard is not None else ""
        return f"Problem({rows} rows on {self.n} unknowns{hard})"


def _become_problem(
    fields: _Fields,
    stacked: tuple[FloatArray, FloatArray, FloatArray, IntArray],
    names: tuple[str, ...],
    hard: Level | None,
    equality: bool,
) -> Problem:
    fields.stacked = stacked
    fields._offsets = stacked[3]
    fields.names = names
    fields.hard = hard
    fields._on_top = 0 if hard is None else len(hard.lower)
    try:
        fields._rows, fields.n = stacked[0].shape
    except (AttributeError, ValueError):
        raise ProblemError(f"matrix has shape {np.shape(stacked[0])}; it must be an array (M, n).") from None
    fields.p = len(stacked[3]) - 1
    fields.is_equality = equality
    fields._address = 0
    fields._levels = fields._public = fields._with_hard = None
    fields.__class__ = Problem
    return fields  # type: ignore[return-value]


def assembled(
    matrix: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    offsets: tuple[IntArray, IntArray],
    names: tuple[str, ...],
    equality: bool,
    limited: bool,
    block: tuple[IntArray | None, int] = (None, 0),
) -> Problem:
    """The problem whose hard rows, if any, stand on top of its levels' rows; nothing is checked or copied.

    Args:
        matrix, lower, upper: of all rows, writable. offsets: of the levels, and as of `Problem.with_hard`.
        names: of the levels. equality: whether every row of every level is an equality.
        limited: whether the problem has hard rows, were it none at present.
        block: what `hqp_rp.core.kernels.direct` knows of the problem, and its address, where that is known already.
    """
    fields = _Fields()
    fields.names = names
    rows, fields.n = matrix.shape
    fields._offsets, starts = offsets
    fields.p = len(names)
    fields.is_equality = equality
    fields._block, fields._address = block  # type: ignore[assignment]
    fields._levels = fields._public = None
    fields._on_top = int(starts[1])
    fields._rows = rows - fields._on_top
    if limited:
        fields._with_hard = Stacked(matrix, lower, upper, starts)
    else:
        fields.stacked = (matrix, lower, upper, fields._offsets)
        fields._with_hard = fields.hard = None
    fields.__class__ = Problem
    return fields  # type: ignore[return-value]


def _under(offsets: IntArray, on_top: int) -> IntArray:
    """Offsets of the same levels below a level 0 of `on_top` rows."""
    starts = np.zeros(len(offsets) + 1, np.int64)
    starts[1:] = offsets
    starts[1:] += on_top
    return starts


def _rebuild(
    matrix: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    offsets: IntArray,
    names: tuple[str, ...],
    hard: Level | None,
) -> Problem:
    return Problem.from_stacked(matrix, lower, upper, offsets, names=names, hard=hard)
