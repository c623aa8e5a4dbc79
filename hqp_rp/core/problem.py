"""The prioritized problem: levels of two-sided rows, most important first, held stacked."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import FloatArray, IntArray, Level, frozen

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
        levels = _checked_levels(levels, hard)
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
            return cls(_split(matrix, lower, upper, offsets, names), hard)
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
            block, address = _described(self)
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


def _described(problem: Problem) -> tuple[IntArray, int]:
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
    _split(matrix, lower, upper, offsets, problem.names)  # raises where they do not fit
    if hard is not None and hard.n != problem.n:
        raise ProblemError(f"The hard rows have {hard.n} columns and the levels have {problem.n}: they must be equal.")
    places = [array.__array_interface__["data"][0] for _, array in arrays]
    places += [0] * (7 - len(places))
    block[:] = *places[:4], problem._rows, problem.n, problem.p, *places[4:], problem._on_top
    return block, int(block.__array_interface__["data"][0])


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


def _split(
    matrix: ArrayLike, lower: ArrayLike, upper: ArrayLike, offsets: ArrayLike, names: Sequence[str] | None
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
    return [
        Level(matrix[a:b], lower[a:b], upper[a:b], labels[k]) for k, (a, b) in enumerate(itertools.pairwise(offsets))
    ]


def _checked_levels(levels: Sequence[Level], hard: Level | None) -> list[Level]:
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
        if not isinstance(hard, Level):
            raise ProblemError(f"hard is a {type(hard).__name__}: build it with Level(A, lower, upper).")
        if hard.n != n:
            raise ProblemError(f"The hard rows have {hard.n} columns and the levels have {n}: they must be equal.")
    return levels


def _label(level: Level, k: int) -> str:
    return f"Level {k + 1} ({level.name!r})" if level.name else f"Level {k + 1}"
