"""Lexicographic least squares in exact rational arithmetic (FLINT integers).

A problem's floats are integers times powers of two, so every level is an integer matrix, and the set of lexicographic optima
is an affine set with rational coefficients that elimination without fractions finds exactly.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from flint import arb, ctx, fmpq, fmpz, fmpz_mat

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.problem import FloatArray


@dataclasses.dataclass(frozen=True, slots=True)
class Rows:
    """Integer rows `matrix u = target / denominator` in the scaled unknown u."""

    matrix: fmpz_mat
    target: fmpz_mat
    denominator: int = 1


@dataclasses.dataclass(frozen=True, slots=True)
class RationalVector:
    """`numerators / denominator`: an exact vector (n,)."""

    numerators: list[int]
    denominator: int

    @property
    def column(self) -> fmpz_mat:
        return fmpz_mat(len(self.numerators), 1, self.numerators)


class AffineSet:
    """The affine set {u in Q^n : S u = Y / D}, S of full row rank; it shrinks with every level that is minimized on it."""

    __slots__ = ("D", "S", "Y", "_solved", "n")

    def __init__(self, n: int) -> None:
        self.n = n
        self.S = fmpz_mat(0, n, [])
        self.Y = fmpz_mat(0, 1, [])
        self.D = 1
        self._solved: tuple[fmpz_mat, fmpz, fmpz_mat] | None = None

    @property
    def dimension(self) -> int:
        """Dimension of the set."""
        return int(self.n - self.S.nrows())

    def copy(self) -> AffineSet:
        """An independent copy (the matrices are shared: they are never changed in place)."""
        other = AffineSet(self.n)
        other.S, other.Y, other.D, other._solved = self.S, self.Y, self.D, self._solved
        return other

    def solved(self) -> tuple[fmpz_mat, fmpz, fmpz_mat]:
        """u0 (n x 1), den, N (n x d): the set is {u0 / (den D) + N z}."""
        if self._solved is None:
            r, n = self.S.nrows(), self.n
            if r == 0:
                identity = [int(i == j) for i in range(n) for j in range(n)]
                self._solved = fmpz_mat(n, 1, [0] * n), fmpz(1), fmpz_mat(n, n, identity)
            else:
                R, den, _ = beside(self.S, self.Y).rref()
                pivots, table = pivots_of(R), R.table()
                free = sorted(set(range(n)) - set(pivots))
                start = [fmpz(0)] * n
                basis = [[fmpz(0)] * len(free) for _ in range(n)]
                for i, pivot in enumerate(pivots):
                    start[pivot] = table[i][n]
                    basis[pivot] = [-table[i][j] for j in free]
                for k, j in enumerate(free):
                    basis[j][k] = den
                self._solved = fmpz_mat(n, 1, start), den, fmpz_mat(n, len(free), [e for row in basis for e in row])
        return self._solved

    def minimize(self, rows: Rows) -> int:
        """Keep only the points of the set that minimize `||matrix u - target / denominator||`; returns the rank gained."""
        if self.dimension == 0 or rows.matrix.nrows() == 0:
            return 0
        self._refine(rows.denominator)  # before `solved`, whose start has the unit of D
        start, den, N = self.solved()
        # In z' = den D z the level reads B z' = c, both of integers.
        B = rows.matrix * N
        c = rows.target * (den * (self.D // rows.denominator)) - rows.matrix * start
        R, _, total = beside(B, c).rref()
        pivots = pivots_of(R)
        d = N.ncols()
        consistent = total == 0 or pivots[-1] < d
        rank = total if consistent else total - 1
        if rank == 0:
            return 0
        chosen = list(range(rows.matrix.nrows()))
        if rank < len(chosen):
            chosen = pivots_of(B.transpose().rref()[0])
        added = _rows(rows.matrix, chosen)
        if consistent:
            values = _rows(rows.target, chosen) * (self.D // rows.denominator)
        else:
            columns = _columns(B, pivots[:rank])
            transposed = columns.transpose()
            solved, scale, _ = beside(transposed * columns, transposed * c).rref()
            table = solved.table()
            z = [fmpz(0)] * d
            for i, pivot in enumerate(pivots[:rank]):
                z[pivot] = table[i][rank]
            point = start * scale + N * fmpz_mat(d, 1, z)
            values = added * point
            self.Y, self.D = self.Y * (den * scale), self.D * int(den * scale)
        self.S, self.Y = _above(self.S, added), _above(self.Y, values)
        self._reduce()
        self._solved = None
        return int(rank)

    def nearest(self, point: RationalVector) -> RationalVector:
        """The element of the set that is nearest to `point` in the 2-norm."""
        r = self.S.nrows()
        if self.dimension == 0:
            start, den, _ = self.solved()
            return rational([int(e) for e in start.entries()], int(den) * self.D)
        column = point.column
        if r == 0:
            return point
        transposed = self.S.transpose()
        gap = self.Y * point.denominator - self.S * column * self.D
        solved, den, _ = beside(self.S * transposed, gap).rref()
        weights = fmpz_mat(r, 1, [row[r] for row in solved.table()])
        moved = transposed * weights + column * (den * self.D)
        return rational([int(e) for e in moved.entries()], int(den) * self.D * point.denominator)

    def _refine(self, denominator: int) -> None:
        """Make D a multiple of `denominator`."""
        factor = denominator // math.gcd(self.D, denominator)
        if factor != 1:
            self.Y, self.D = self.Y * factor, self.D * factor
            self._solved = None if self._solved is None else (self._solved[0] * factor, *self._solved[1:])

    def _reduce(self) -> None:
        if self.D == 1:
            return
        values = [int(e) for e in self.Y.entries()]
        common = math.gcd(self.D, *values)
        if common != 1:
            self.Y, self.D = fmpz_mat(len(values), 1, [e // common for e in values]), self.D // common


def integers(values: FloatArray) -> tuple[list[int], int]:
    """`values` exactly, as integers times 2**e with the largest e; e = 0 when all are zero."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    mantissa, exponent = np.frexp(flat)
    whole = np.ldexp(mantissa, 53).astype(np.int64)
    used = whole != 0
    if not used.any():
        return [0] * flat.size, 0
    least = int(exponent[used].min())
    exact = [int(w) << (int(e) - least) if w else 0 for w, e in zip(whole.tolist(), exponent.tolist(), strict=True)]
    bits = 0
    for entry in exact:
        bits |= abs(entry)
    zeros = (bits & -bits).bit_length() - 1
    return [entry >> zeros for entry in exact], least - 53 + zeros


@dataclasses.dataclass(frozen=True, slots=True)
class Unit:
    """Common power of two of the unknown: u = 2**shift * x is what every integer row speaks of."""

    shift: int

    @classmethod
    def fitting(cls, levels: Sequence[tuple[FloatArray, FloatArray]], secondary: FloatArray) -> Unit:
        """The unit in which the right-hand sides of all levels (A, b ...) and `secondary` are integers."""
        shift = max(0, -integers(secondary)[1])
        for A, b in levels:
            shift = max(shift, integers(A)[1] - integers(b)[1])
        return cls(shift)

    def rows(self, A: FloatArray, b: FloatArray) -> Rows:
        """`A x = b` as integer rows."""
        (entries, unit), (values, scale) = integers(A), integers(b)
        lift = scale - unit + self.shift
        return Rows(
            fmpz_mat(*_shape(A), entries), fmpz_mat(len(b), 1, [v << lift for v in values] if any(values) else values)
        )

    def vector(self, x: FloatArray) -> RationalVector:
        """`x` as a vector u."""
        entries, scale = integers(x)
        lift = scale + self.shift
        return RationalVector([e << lift for e in entries] if any(entries) else entries, 1)

    def floats(self, u: RationalVector) -> FloatArray:
        """u as x (n,), each entry correctly rounded; infinite where it exceeds the largest float."""
        return np.array([nearest_float(e, u.denominator << self.shift) for e in u.numerators])


def metric_rows(metric: FloatArray | None, n: int, bits: int = 256) -> list[list[int]]:
    """Integer rows whose norm is a multiple of ||.||_W: the identity for None, else R of W = R^T R, upper
    triangular, right to `bits` bits.

    W itself is taken to the last bit; its root is irrational.
    """
    if metric is None:
        return [[int(i == j) for j in range(n)] for i in range(n)]
    with ctx.workprec(4 * bits + 4 * n):
        entries, scale = integers(metric)
        if scale % 2:
            entries = [2 * entry for entry in entries]
        W = [entries[i * n : (i + 1) * n] for i in range(n)]
        R = [[arb(0)] * n for _ in range(n)]
        for i in range(n):  # Cholesky, row by row
            for j in range(i, n):
                rest = arb(W[i][j]) - sum((R[k][i] * R[k][j] for k in range(i)), arb(0))
                if j > i:
                    R[i][j] = (rest / R[i][i]).mid()
                elif rest > 0:
                    R[i][i] = rest.sqrt().mid()
                else:
                    raise ProblemError("metric is not positive definite in exact arithmetic; add to its diagonal.")
        least = min(R[i][i] for i in range(n))
        lift = arb(2) ** max(0, bits - math.frexp(float(least))[1])
        return [[int((entry * lift).floor().unique_fmpz() or 0) for entry in row] for row in R]


def rational(numerators: list[int], denominator: int) -> RationalVector:
    """The vector in lowest terms, with a positive denominator."""
    common = math.gcd(denominator, *numerators) * (-1 if denominator < 0 else 1)
    return RationalVector([e // common for e in numerators], denominator // common)


def nearest_float(numerator: int, denominator: int) -> float:
    """The float nearest to a ratio of integers, infinite when it is out of range."""
    try:
        return numerator / denominator
    except OverflowError:
        return math.inf if (numerator > 0) == (denominator > 0) else -math.inf


def exact_norm(A: FloatArray, b: FloatArray, u: RationalVector, unit: Unit) -> float:
    """`||A x - b||_2` at the exact x, correctly rounded but for the last bit."""
    (entries, scale), (values, offset) = integers(A), integers(b)
    product = (fmpz_mat(*_shape(A), entries) * u.column).entries()
    # A x = product * 2**(scale - shift) / denominator; b = values * 2**offset.
    power = scale - unit.shift
    least = min(power, offset)
    gaps = [
        (int(p) << (power - least)) - ((v << (offset - least)) * u.denominator)
        for p, v in zip(product, values, strict=True)
    ]
    return root(sum(gap * gap for gap in gaps), u.denominator * u.denominator, 2 * least)


def root(numerator: int, denominator: int, exponent: int) -> float:
    """sqrt(numerator / denominator * 2**exponent), for an even exponent."""
    if numerator == 0:
        return 0.0
    with ctx.workprec(128):
        value = (arb(fmpq(numerator, denominator)).sqrt() * arb(2) ** (exponent // 2)).mid()
        mantissa, power = (int(part) for part in value.man_exp())
    return nearest_float(mantissa << power, 1) if power >= 0 else nearest_float(mantissa, 1 << -power)


def stacked_ranks(matrices: Sequence[FloatArray], n: int) -> tuple[int, ...]:
    """Exact rank that each matrix (m, n) adds to the ones before it."""
    total, gained, rows = 0, [], list[int]()
    for A in matrices:
        rows += integers(A)[0]
        rank = int(fmpz_mat(len(rows) // n, n, rows).rank()) if rows and total < n else total
        gained.append(rank - total)
        total = rank
    return tuple(gained)


def _shape(A: FloatArray) -> tuple[int, int]:
    return int(A.shape[0]), int(A.shape[1])


def pivots_of(R: fmpz_mat) -> list[int]:
    pivots = []
    for row in R.table():
        found = next((j for j, entry in enumerate(row) if entry), None)
        if found is None:
            break
        pivots.append(found)
    return pivots


def beside(A: fmpz_mat, b: fmpz_mat) -> fmpz_mat:
    """[A b]"""
    joined = [[*row, *tail] for row, tail in zip(A.table(), b.table(), strict=True)]
    return fmpz_mat(A.nrows(), A.ncols() + b.ncols(), [e for row in joined for e in row])


def matrix_of(rows: list[list[int]], n: int) -> fmpz_mat:
    """The matrix (m, n) with these rows; m may be 0."""
    return fmpz_mat(len(rows), n, [e for row in rows for e in row])


def _above(A: fmpz_mat, B: fmpz_mat) -> fmpz_mat:
    return fmpz_mat(A.nrows() + B.nrows(), A.ncols(), A.entries() + B.entries())


def _rows(A: fmpz_mat, chosen: list[int]) -> fmpz_mat:
    table = A.table()
    return fmpz_mat(len(chosen), A.ncols(), [e for i in chosen for e in table[i]])


def _columns(A: fmpz_mat, chosen: list[int]) -> fmpz_mat:
    return fmpz_mat(A.nrows(), len(chosen), [row[j] for row in A.table() for j in chosen])
