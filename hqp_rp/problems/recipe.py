"""What a problem of the set is made from: a recipe with a seed, and numbers that are the same on every machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.problem import FloatArray, Level, Problem

Integers = NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True)
class Recipe:
    """How one problem is made.

    Attributes:
        family, label: the problem's name is "family/label".
        seed: of its `Draw`.
        made: a sentence on how it is made.
        build: makes the problem from its draw.
        distance: of a problem at a controlled distance from what makes it hard, that distance (`made` says in which
            unit); 0 is on it; None where there is none.
        since: the version of the set that it came with.
    """

    family: str
    label: str
    seed: int
    made: str
    build: Callable[[Draw], Problem]
    distance: float | None = None
    since: str = "1.0"

    @property
    def name(self) -> str:
        """What `hqp_rp.problems.load` calls it."""
        return f"{self.family}/{self.label}"

    def problem(self) -> Problem:
        """The problem: always the same, to the last bit."""
        return self.build(Draw(self.seed))


class Draw:
    """Random numbers that are the same on every machine and with every numpy.

    Taken from the raw stream of PCG64, which numpy keeps from release to release (it does not promise that of the
    distributions of a `Generator`), by shifts and remainders of integers only.
    """

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(np.random.SeedSequence(seed))

    def integers(self, low: int, high: int, shape: int | tuple[int, ...]) -> Integers:
        """Integers from `low` to `high`, both included."""
        shape = (shape,) if isinstance(shape, int) else shape
        raw = self._bits.random_raw(int(np.prod(shape))) >> np.uint64(11)
        return (raw % np.uint64(high - low + 1)).astype(np.int64).reshape(shape) + low

    def grid(self, shape: int | tuple[int, ...], size: float = 1.0, bits: int = 20) -> FloatArray:
        """Multiples of size * 2**-bits, uniform in [-size, size]; `size` is a power of two."""
        return self.integers(-(2**bits), 2**bits, shape).astype(np.float64) * (size * 2.0**-bits)


def equalities(matrices: Sequence[FloatArray], targets: Sequence[FloatArray], hard: Level | None = None) -> Problem:
    """`A_k x = b_k`, k = 1 ... p, and hard rows."""
    return Problem([Level.equality(A, b) for A, b in zip(matrices, targets, strict=True)], hard)


def random_levels(draw: Draw, n: int, rows: Sequence[int]) -> Problem:
    """Equality levels of `rows` rows on n unknowns, all entries uniform on multiples of 2**-20 in [-1, 1]."""
    return equalities([draw.grid((m, n)) for m in rows], [draw.grid(m) for m in rows])


def shape_of(rows: Sequence[int]) -> str:
    """ "3-3-7": the rows of each level, as labels name them."""
    return "-".join(str(m) for m in rows)
