"""Vector instructions for the inner loops of factorizations.

What numba makes of `for col in range(c, n)` runs a quarter as fast on rows of 7 to 100 entries: it checks each loop for
aliasing and for negative indices, and ends it with a scalar remainder. These intrinsics emit whole chunks of eight entries,
which LLVM maps to what the machine has. They need matrices whose number of columns is a multiple of eight, filled up with
zeros (`padded`); nothing is checked. Sums may be reordered, as in every kernel.

A reflector is stored in a row: v = (1, V[t, column + 1:]), and what stands left of `column` is not part of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from hqp_rp.core.kernels.compile import Compiled

WIDTH = 8
_INT = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_CHUNK = ir.VectorType(_DOUBLE, WIDTH)
_LANES = ir.VectorType(_INT, WIDTH)
_FAST = ("reassoc", "contract")


def _emitted(function: Callable[..., Any]) -> Compiled:
    """numba's `intrinsic`; a kernel calls it without the typing context."""
    return cast(Compiled, intrinsic(function))


def _integer(value: int) -> Any:
    return ir.Constant(_INT, value)


def _all(value: float) -> Any:
    return ir.Constant(_CHUNK, [value] * WIDTH)


class _Row:
    """Row i of a C-contiguous matrix, or a vector, in chunks from the one that holds `column`."""

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any, i: Any, column: Any) -> None:
        self.builder = builder
        made = context.make_array(kind)(context, builder, array)
        address = builder.ptrtoint(made.data, _INT)
        if i is not None:
            stride = cgutils.unpack_tuple(builder, made.strides)[0]
            address = builder.add(address, builder.mul(i, stride))
        start = builder.and_(column, _integer(-WIDTH))
        self.columns = cgutils.unpack_tuple(builder, made.shape)[-1]
        self.start = start
        self.address = builder.add(address, builder.mul(start, _integer(8)))

    def _pointer(self, chunk: Any) -> Any:
        offset = self.builder.mul(chunk, _integer(8 * WIDTH))
        return self.builder.inttoptr(self.builder.add(self.address, offset), _CHUNK.as_pointer())

    def load(self, chunk: Any) -> Any:
        return self.builder.load(self._pointer(chunk), align=8)

    def store(self, value: Any, chunk: Any) -> None:
        self.builder.store(value, self._pointer(chunk), align=8)


def _spread(builder: Any, value: Any, kind: Any = _CHUNK) -> Any:
    index = ir.IntType(32)
    undefined = ir.Constant(kind, ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(index, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(index, WIDTH), [0] * WIDTH))


def _lanes(builder: Any, relation: str, column: Any) -> Any:
    """A mask: lane `relation` the lane of `column` within its chunk."""
    lane = builder.and_(column, _integer(WIDTH - 1))
    return builder.icmp_signed(relation, ir.Constant(_LANES, list(range(WIDTH))), _spread(builder, lane, _LANES))


def _total(builder: Any, chunk: Any) -> Any:
    kind = ir.FunctionType(_DOUBLE, [_DOUBLE, _CHUNK])
    reduce = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{WIDTH}f64")
    return builder.call(reduce, [ir.Constant(_DOUBLE, -0.0), chunk], fastmath=_FAST)


def _further_chunks(builder: Any, row: _Row, body: Callable[[Any], None]) -> None:
    """body(chunk) for every chunk of the row behind the first."""
    count = builder.lshr(builder.sub(row.columns, row.start), _integer(3))
    with cgutils.for_range(builder, builder.sub(count, _integer(1))) as loop:
        body(builder.add(loop.index, _integer(1)))


def _sum_of_products(builder: Any, pairs: list[tuple[Any, Any]], row: _Row, more: Callable[[Any], Any]) -> list[Any]:
    """Sums over all chunks: `pairs` are the factors of the first, more(chunk) gives those of the others."""
    sums = [cgutils.alloca_once_value(builder, builder.fmul(a, b, flags=_FAST)) for a, b in pairs]

    def gather(chunk: Any) -> None:
        for total, (a, b) in zip(sums, more(chunk), strict=True):
            product = builder.fmul(a, b, flags=_FAST)
            builder.store(builder.fadd(builder.load(total), product, flags=_FAST), total)

    _further_chunks(builder, row, gather)
    return [_total(builder, builder.load(total)) for total in sums]


def _reflect(builder: Any, rows: list[_Row], by: _Row, column: Any, tau: Any) -> None:
    zero = _integer(0)
    head = builder.select(_lanes(builder, "==", column), _all(1.0), _all(0.0))
    head = builder.select(_lanes(builder, ">", column), by.load(zero), head)
    firsts = [row.load(zero) for row in rows]

    def more(chunk: Any) -> list[tuple[Any, Any]]:
        v = by.load(chunk)
        return [(row.load(chunk), v) for row in rows]

    dots = _sum_of_products(builder, [(first, head) for first in firsts], by, more)
    factors = [_spread(builder, builder.fmul(dot, tau)) for dot in dots]
    for row, first, factor in zip(rows, firsts, factors, strict=True):
        row.store(builder.fsub(first, builder.fmul(factor, head, flags=_FAST), flags=_FAST), zero)

    def update(chunk: Any) -> None:
        v = by.load(chunk)
        for row, factor in zip(rows, factors, strict=True):
            row.store(builder.fsub(row.load(chunk), builder.fmul(factor, v, flags=_FAST), flags=_FAST), chunk)

    _further_chunks(builder, by, update)


def _reflect_rows(count: int) -> Any:
    @_emitted
    def reflect(_: Any, W: Any, i: Any, V: Any, t: Any, column: Any, tau: Any) -> Any:
        signature = types.void(W, types.int64, V, types.int64, types.int64, types.float64)

        def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            turned, first, by, which, at, factor = given
            rows = [
                _Row(context, builder, sig.args[0], turned, builder.add(first, _integer(r)), at) for r in range(count)
            ]
            _reflect(builder, rows, _Row(context, builder, sig.args[2], by, which, at), at, factor)
            return context.get_dummy_value()

        return signature, codegen

    return reflect


reflect_row = _reflect_rows(1)
"""reflect_row(W, i, V, t, column, tau): row i of W <- row - tau (row . v) v."""

reflect_two_rows, reflect_three_rows, reflect_four_rows = _reflect_rows(2), _reflect_rows(3), _reflect_rows(4)
"""The same for rows i, i + 1, ... of W, side by side."""


@_emitted
def reflect_vector(_: Any, y: Any, V: Any, t: Any, column: Any, tau: Any) -> Any:
    """The same for a vector: reflect_vector(y, V, t, column, tau)."""
    signature = types.void(y, V, types.int64, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        turned, by, which, at, factor = given
        row = _Row(context, builder, sig.args[0], turned, None, at)
        _reflect(builder, [row], _Row(context, builder, sig.args[1], by, which, at), at, factor)
        return context.get_dummy_value()

    return signature, codegen


@_emitted
def make_reflector(_: Any, W: Any, i: Any, column: Any, beta: Any, inverse: Any) -> Any:
    """make_reflector(W, i, column, beta, inverse): W[i, column] <- beta, and what stands right of it is multiplied."""
    signature = types.void(W, types.int64, types.int64, types.float64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, at, head, factor = given
        row = _Row(context, builder, sig.args[0], array, which, at)
        factors = _spread(builder, factor)
        first = row.load(_integer(0))
        scaled = builder.select(_lanes(builder, ">", at), builder.fmul(first, factors), first)
        row.store(builder.select(_lanes(builder, "==", at), _spread(builder, head), scaled), _integer(0))
        _further_chunks(builder, row, lambda chunk: row.store(builder.fmul(row.load(chunk), factors), chunk))
        return context.get_dummy_value()

    return signature, codegen


@_emitted
def swap_rows(_: Any, W: Any, i: Any, k: Any) -> Any:
    """swap_rows(W, i, k): rows i and k of W change places."""
    signature = types.void(W, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, first, second = given
        one = _Row(context, builder, sig.args[0], array, first, _integer(0))
        other = _Row(context, builder, sig.args[0], array, second, _integer(0))

        def swap(chunk: Any) -> None:
            a, b = one.load(chunk), other.load(chunk)
            one.store(b, chunk)
            other.store(a, chunk)

        swap(_integer(0))
        _further_chunks(builder, one, swap)
        return context.get_dummy_value()

    return signature, codegen


@_emitted
def sum_of_squares(_: Any, W: Any, i: Any, column: Any) -> Any:
    """sum_of_squares(W, i, column): of row i from `column` on."""
    signature = types.float64(W, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, at = given
        row = _Row(context, builder, sig.args[0], array, which, at)
        first = builder.select(_lanes(builder, ">=", at), row.load(_integer(0)), _all(0.0))

        def more(chunk: Any) -> list[tuple[Any, Any]]:
            entries = row.load(chunk)
            return [(entries, entries)]

        return _sum_of_products(builder, [(first, first)], row, more)[0]

    return signature, codegen


@_emitted
def dot_row(_: Any, W: Any, i: Any, y: Any, column: Any) -> Any:
    """dot_row(W, i, y, column): row i . y from the chunk of eight that holds `column` on; y is at least as long."""
    signature = types.float64(W, types.int64, y, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, vector, at = given
        row = _Row(context, builder, sig.args[0], array, which, at)
        other = _Row(context, builder, sig.args[2], vector, None, at)

        def more(chunk: Any) -> list[tuple[Any, Any]]:
            return [(row.load(chunk), other.load(chunk))]

        return _sum_of_products(builder, more(_integer(0)), row, more)[0]

    return signature, codegen


@_emitted
def add_multiple(_: Any, y: Any, V: Any, t: Any, factor: Any) -> Any:
    """add_multiple(y, V, t, factor): y += factor * V[t]; y is at least as long."""
    signature = types.void(y, V, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        vector, matrix, which, scale = given
        row = _Row(context, builder, sig.args[0], vector, None, _integer(0))
        added = _Row(context, builder, sig.args[1], matrix, which, _integer(0))
        factors = _spread(builder, scale)

        def update(chunk: Any) -> None:
            change = builder.fmul(factors, added.load(chunk), flags=_FAST)
            row.store(builder.fadd(row.load(chunk), change, flags=_FAST), chunk)

        update(_integer(0))
        _further_chunks(builder, added, update)
        return context.get_dummy_value()

    return signature, codegen


def _reflect_rows_by_raw(count: int) -> Any:
    @_emitted
    def reflect(_: Any, W: Any, i: Any, t: Any, column: Any, beta: Any, factor: Any) -> Any:
        signature = types.void(W, types.int64, types.int64, types.int64, types.float64, types.float64)

        def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            array, first, which, at, mapped, scale = given
            by = _Row(context, builder, sig.args[0], array, which, at)
            rows = [
                _Row(context, builder, sig.args[0], array, builder.add(first, _integer(r)), at) for r in range(count)
            ]
            zero = _integer(0)
            here, heads = _lanes(builder, "==", at), [row.load(zero) for row in rows]
            raw = builder.select(_lanes(builder, ">=", at), by.load(zero), _all(0.0))

            def more(chunk: Any) -> list[tuple[Any, Any]]:
                v = by.load(chunk)
                return [(row.load(chunk), v) for row in rows]

            dots = _sum_of_products(builder, [(head, raw) for head in heads], by, more)
            lane = builder.trunc(builder.and_(at, _integer(WIDTH - 1)), ir.IntType(32))
            factors = []
            for head, dot in zip(heads, dots, strict=True):
                own = builder.fmul(mapped, builder.extract_element(head, lane), flags=_FAST)
                factors.append(_spread(builder, builder.fmul(scale, builder.fsub(dot, own, flags=_FAST))))
            v = builder.select(here, builder.fsub(raw, _spread(builder, mapped)), raw)
            for row, head, times in zip(rows, heads, factors, strict=True):
                row.store(builder.fsub(head, builder.fmul(times, v, flags=_FAST), flags=_FAST), zero)

            def update(chunk: Any) -> None:
                v = by.load(chunk)
                for row, times in zip(rows, factors, strict=True):
                    row.store(builder.fsub(row.load(chunk), builder.fmul(times, v, flags=_FAST), flags=_FAST), chunk)

            _further_chunks(builder, by, update)
            return context.get_dummy_value()

        return signature, codegen

    return reflect


reflect_row_by_raw = _reflect_rows_by_raw(1)
"""reflect_row_by_raw(W, i, t, column, beta, factor): row i of W <- row - factor (row . v) v.

v = (W[t, column] - beta, W[t, column + 1:]).

The same reflection as by `reflect_row` after `make_reflector`, by the row as it was before: with beta the entry that row t
is mapped on and factor = 1 / (beta (beta - W[t, column])). The sum over the row need not wait for the root in beta.
"""

reflect_four_rows_by_raw = _reflect_rows_by_raw(4)
"""The same for rows i ... i + 3 of W, side by side."""
