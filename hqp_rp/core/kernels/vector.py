"""Vector instructions for the inner loops of factorizations: a reflector on one or four rows, sums of squares, dot products.

What numba makes of `for col in range(c, n)` runs a quarter as fast on rows of 20 to 100 entries: it checks each loop for
aliasing and for negative indices, and ends it with up to fifteen scalar steps. These intrinsics emit chunks of four
entries, then two, then one. LLVM maps them to what the machine has. Sums may be reordered, as in every kernel.

Columns are `first ... last - 1`; nothing is checked.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

WIDTH = 4
_INT = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_FAST = ("reassoc", "contract")


def _vector(width: int) -> Any:
    return _DOUBLE if width == 1 else ir.VectorType(_DOUBLE, width)


def _zero(width: int) -> Any:
    return ir.Constant(_vector(width), 0.0 if width == 1 else [0.0] * width)


def _integer(value: int) -> Any:
    return ir.Constant(_INT, value)


class _Row:
    """Row i of a C-contiguous array, or a contiguous vector, as the address of its entry 0."""

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any, i: Any = None) -> None:
        self.builder = builder
        made = context.make_array(kind)(context, builder, array)
        self.address = builder.ptrtoint(made.data, _INT)
        if i is not None:
            stride = cgutils.unpack_tuple(builder, made.strides)[0]
            self.address = builder.add(self.address, builder.mul(i, stride))

    def pointer(self, at: Any, width: int) -> Any:
        offset = self.builder.mul(at, _integer(8))
        return self.builder.inttoptr(self.builder.add(self.address, offset), _vector(width).as_pointer())

    def load(self, at: Any, width: int = 1) -> Any:
        return self.builder.load(self.pointer(at, width), align=8)

    def store(self, value: Any, at: Any, width: int = 1) -> None:
        self.builder.store(value, self.pointer(at, width), align=8)


class _Sum:
    """A running sum, kept apart for each width until it is asked for."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder
        self.parts = {width: cgutils.alloca_once_value(builder, _zero(width)) for width in (4, 2, 1)}

    def add(self, left: Any, right: Any, width: int) -> None:
        product = self.builder.fmul(left, right, flags=_FAST)
        part = self.parts[width]
        self.builder.store(self.builder.fadd(self.builder.load(part), product, flags=_FAST), part)

    def value(self) -> Any:
        total = self.builder.load(self.parts[1])
        for width in (2, 4):
            kind = ir.FunctionType(_DOUBLE, [_DOUBLE, _vector(width)])
            reduce = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.vector.reduce.fadd.v{width}f64")
            part = self.builder.load(self.parts[width])
            total = self.builder.call(reduce, [total, part], fastmath=_FAST)
        return total


def _chunks(builder: Any, first: Any, last: Any, body: Callable[[Any, int], None]) -> None:
    """body(column, width) for chunks that cover first ... last - 1."""
    length = builder.sub(last, first)
    length = builder.select(builder.icmp_signed("<", length, _integer(0)), _integer(0), length)
    full = builder.lshr(length, _integer(2))
    with cgutils.for_range(builder, full) as loop:
        body(builder.add(first, builder.mul(loop.index, _integer(WIDTH))), WIDTH)
    at = builder.add(first, builder.mul(full, _integer(WIDTH)))
    for width in (2, 1):
        left = builder.and_(length, _integer(width))
        with builder.if_then(builder.icmp_signed("!=", left, _integer(0))):
            body(at, width)
        at = builder.add(at, left)


def _spread(builder: Any, value: Any, width: int) -> Any:
    if width == 1:
        return value
    index = ir.IntType(32)
    undefined = ir.Constant(_vector(width), ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(index, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(index, width), [0] * width))


def _reflect(builder: Any, rows: list[_Row], by: _Row, column: Any, last: Any, tau: Any) -> None:
    sums = [_Sum(builder) for _ in rows]
    behind = builder.add(column, _integer(1))
    heads = [row.load(column) for row in rows]

    def gather(at: Any, width: int) -> None:
        v = by.load(at, width)
        for row, total in zip(rows, sums, strict=True):
            total.add(row.load(at, width), v, width)

    _chunks(builder, behind, last, gather)
    factors = []
    for row, head, total in zip(rows, heads, sums, strict=True):
        factor = builder.fmul(builder.fadd(head, total.value(), flags=_FAST), tau)
        row.store(builder.fsub(head, factor), column)
        factors.append(factor)

    def update(at: Any, width: int) -> None:
        v = by.load(at, width)
        for row, factor in zip(rows, factors, strict=True):
            change = builder.fmul(_spread(builder, factor, width), v, flags=_FAST)
            row.store(builder.fsub(row.load(at, width), change, flags=_FAST), at, width)

    _chunks(builder, behind, last, update)


def _reflect_rows(count: int) -> Any:
    @intrinsic
    def reflect(_: Any, W: Any, i: Any, V: Any, t: Any, column: Any, last: Any, tau: Any) -> Any:
        signature = types.void(W, types.int64, V, types.int64, types.int64, types.int64, types.float64)

        def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            turned, first, by, which, at, end, factor = given
            rows = [_Row(context, builder, sig.args[0], turned, builder.add(first, _integer(r))) for r in range(count)]
            _reflect(builder, rows, _Row(context, builder, sig.args[2], by, which), at, end, factor)
            return context.get_dummy_value()

        return signature, codegen

    return reflect


reflect_row = _reflect_rows(1)
"""reflect_row(W, i, V, t, column, last, tau): row i of W <- row - tau (row . v) v, with v = (1, V[t, column + 1:last])."""

reflect_four_rows = _reflect_rows(4)
"""The same for rows i ... i + 3 of W, side by side."""


@intrinsic
def reflect_vector(_: Any, y: Any, V: Any, t: Any, column: Any, last: Any, tau: Any) -> Any:
    """The same for a vector: reflect_vector(y, V, t, column, last, tau)."""
    signature = types.void(y, V, types.int64, types.int64, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        turned, by, which, at, end, factor = given
        rows = [_Row(context, builder, sig.args[0], turned)]
        _reflect(builder, rows, _Row(context, builder, sig.args[1], by, which), at, end, factor)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def sum_of_squares(_: Any, W: Any, i: Any, first: Any, last: Any) -> Any:
    """sum_of_squares(W, i, first, last): of the entries first ... last - 1 of row i."""
    signature = types.float64(W, types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, start, end = given
        row = _Row(context, builder, sig.args[0], array, which)
        total = _Sum(builder)

        def gather(at: Any, width: int) -> None:
            entries = row.load(at, width)
            total.add(entries, entries, width)

        _chunks(builder, start, end, gather)
        return total.value()

    return signature, codegen


@intrinsic
def dot_row(_: Any, W: Any, i: Any, first: Any, y: Any, start: Any, count: Any) -> Any:
    """dot_row(W, i, first, y, start, count): W[i, first:first + count] . y[start:start + count]."""
    signature = types.float64(W, types.int64, types.int64, y, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, column, vector, offset, length = given
        row = _Row(context, builder, sig.args[0], array, which)
        other = _Row(context, builder, sig.args[3], vector)
        total = _Sum(builder)

        def gather(at: Any, width: int) -> None:
            total.add(row.load(builder.add(column, at), width), other.load(builder.add(offset, at), width), width)

        _chunks(builder, _integer(0), length, gather)
        return total.value()

    return signature, codegen


@intrinsic
def add_multiple(_: Any, W: Any, i: Any, V: Any, t: Any, first: Any, last: Any, factor: Any) -> Any:
    """add_multiple(W, i, V, t, first, last, factor): W[i, first:last] += factor * V[t, first:last]."""
    signature = types.void(W, types.int64, V, types.int64, types.int64, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, other, source, start, end, scale = given
        row = _Row(context, builder, sig.args[0], array, which)
        added = _Row(context, builder, sig.args[2], other, source)

        def update(at: Any, width: int) -> None:
            change = builder.fmul(_spread(builder, scale, width), added.load(at, width), flags=_FAST)
            row.store(builder.fadd(row.load(at, width), change, flags=_FAST), at, width)

        _chunks(builder, start, end, update)
        return context.get_dummy_value()

    return signature, codegen
