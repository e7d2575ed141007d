"""Vector code that numba's own loops do not give: transpositions of eight bodies at a time, and reciprocal roots.

Bodies lie in rows (one body after another); the inner loops need lanes (one quantity of many bodies after another). The
change is a transposition of 8 x 8 numbers: 16 loads of half a row, 16 shuffles and eight wide stores, instead of 64
loads and stores. `rsqrt` replaces pairs of square roots and divisions, which take most of a contact's time, except on
an AMD Zen, whose own roots are faster. All is plain LLVM, so it compiles for any processor.
"""

import math

from llvmlite import ir
from llvmlite.binding import get_host_cpu_name
from numba import types
from numba.extending import intrinsic

from . import as_python
from .jit import JIT_OFF, inlined
from .rows import LANES

WIDTH = 8  # numbers moved at once
DOUBLE, INT64, INT32, BYTE = (
    ir.DoubleType(),
    ir.IntType(64),
    ir.IntType(32),
    ir.IntType(8),
)
FOR_READING, TO_ALL_CACHES, DATA = 0, 3, 1  # arguments of llvm.prefetch
SMALLEST = 1e-300  # makes the root of zero a number to divide by
VECTOR, HALF = ir.VectorType(DOUBLE, WIDTH), ir.VectorType(DOUBLE, WIDTH // 2)


def _shuffle(builder, a, b, mask):
    return builder.shuffle_vector(
        a, b, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), mask)
    )


def _load(builder, pointer, kind=VECTOR):
    return builder.load(builder.bitcast(pointer, kind.as_pointer()), align=8)


def _transposed(builder, pointers):
    """Compute the 8 x 8 transpose of the eight numbers at each of eight places.

    A vector is made of halves of two rows: one instruction, which is no shuffle, loads and inserts the second half. So
    16 shuffles are needed instead of 24 with whole rows.
    """
    vectors = []
    for side in (0, 4):
        halves = [
            _load(builder, builder.gep(pointer, [INT64(side)]), HALF)
            for pointer in pointers
        ]
        a, b, c, d = (
            _shuffle(builder, halves[k], halves[k + 2], list(range(8)))
            for k in (0, 1, 4, 5)
        )
        even = [
            _shuffle(builder, *pair, [0, 8, 2, 10, 4, 12, 6, 14])
            for pair in ((a, b), (c, d))
        ]
        odd = [
            _shuffle(builder, *pair, [1, 9, 3, 11, 5, 13, 7, 15])
            for pair in ((a, b), (c, d))
        ]
        for mask in ([0, 1, 4, 5, 8, 9, 12, 13], [2, 3, 6, 7, 10, 11, 14, 15]):
            vectors += [_shuffle(builder, *even, mask), _shuffle(builder, *odd, mask)]
    return vectors


def _store(builder, value, pointer):
    builder.store(value, builder.bitcast(pointer, VECTOR.as_pointer()), align=8)


class _Call:
    """The arguments of the intrinsics below: arrays and integers (table, column, index, k, tile, at, stride)."""

    def __init__(self, context, builder, signature, values):
        self.builder = builder
        arrays = {}
        for name, kind, value in zip(
            ("table", "column", "index", "k", "tile", "at", "stride"),
            signature.args,
            values,
            strict=True,
        ):
            if isinstance(kind, types.Array):
                arrays[name] = context.make_array(kind)(context, builder, value)
                setattr(self, name, arrays[name].data)
            else:
                setattr(self, name, context.cast(builder, value, kind, types.int64))
        self.row_bytes = builder.extract_value(arrays["table"].strides, 0)

    def body(self, lane):
        """Pointer to the first number of the body of a lane."""
        builder = self.builder
        place = builder.gep(self.index, [builder.add(self.k, INT64(lane))])
        number = builder.load(place)
        if number.type != INT64:
            number = builder.zext(number, INT64)
        start = builder.ptrtoint(self.table, INT64)
        start = builder.add(start, builder.mul(number, self.row_bytes))
        start = builder.add(start, builder.mul(self.column, INT64(8)))
        return builder.inttoptr(start, DOUBLE.as_pointer())

    def lanes(self, quantity):
        """Pointer to the lanes of a quantity in the tile."""
        builder = self.builder
        return builder.gep(
            self.tile, [builder.add(self.at, builder.mul(self.stride, INT64(quantity)))]
        )


def _checked(table, column, index, k, tile, at, stride):
    """Return the signature of an intrinsic, or None where the arguments do not fit."""
    fits = all(isinstance(array, types.Array) for array in (table, tile, index))
    fits = (
        fits
        and table.dtype == tile.dtype == types.float64
        and isinstance(index.dtype, types.Integer)
    )
    return types.void(table, column, index, k, tile, at, stride) if fits else None


def _moving(move):
    """Make an intrinsic of (table, column, index, k, tile, at, stride) of the function that writes its code."""

    def declare(typingctx, table, column, index, k, tile, at, stride):
        def generate(context, builder, sig, values):
            move(builder, _Call(context, builder, sig, values))
            return context.get_dummy_value()

        return _checked(table, column, index, k, tile, at, stride), generate

    declare.__name__, declare.__doc__ = move.__name__, move.__doc__
    return intrinsic(declare)


@_moving
def rows_to_lanes(builder, call):
    """tile[at + c * stride + l] = table[index[k + l], column + c] for c and l of 0..7."""
    rows = [call.body(lane) for lane in range(WIDTH)]
    for quantity, lanes in enumerate(_transposed(builder, rows)):
        _store(builder, lanes, call.lanes(quantity))


@_moving
def lanes_to_rows(builder, call):
    """table[index[k + l], column + c] = tile[at + c * stride + l] for c and l of 0..7."""
    lanes = [call.lanes(quantity) for quantity in range(WIDTH)]
    for lane, row in enumerate(_transposed(builder, lanes)):
        _store(builder, row, call.body(lane))


@_moving
def add_lanes_to_rows(builder, call):
    """table[index[k + l], column + c] += tile[at + c * stride + l], lane after lane (a body may come twice)."""
    lanes = [call.lanes(quantity) for quantity in range(WIDTH)]
    for lane, row in enumerate(_transposed(builder, lanes)):
        place = call.body(lane)
        _store(builder, builder.fadd(_load(builder, place), row), place)


@intrinsic
def prefetch(typingctx, table, row, column):
    """Prefetch the cache line of table[row, column] for reading and writing."""
    signature = types.void(table, row, column)

    def generate(context, builder, sig, values):
        array = context.make_array(sig.args[0])(context, builder, values[0])
        row, column = (
            context.cast(builder, values[k], sig.args[k], types.int64) for k in (1, 2)
        )
        offset = builder.mul(row, builder.extract_value(array.strides, 0))
        offset = builder.add(
            offset, builder.mul(column, builder.extract_value(array.strides, 1))
        )
        place = builder.gep(builder.bitcast(array.data, BYTE.as_pointer()), [offset])
        kind = ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), *3 * [INT32]])
        name = "llvm.prefetch.p0i8"
        function = builder.module.globals.get(name) or ir.Function(
            builder.module, kind, name
        )
        builder.call(
            function,
            [place, *(INT32(value) for value in (FOR_READING, TO_ALL_CACHES, DATA))],
        )
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def _rsqrt_seed(typingctx, x):
    """First approximation of 1 / sqrt(x) from the bits of the exponent, with an error of 3.5 % at most."""

    def generate(context, builder, sig, values):
        bits = builder.bitcast(values[0], INT64)
        bits = builder.sub(INT64(0x5FE6EB50C7B537A9), builder.lshr(bits, INT64(1)))
        return builder.bitcast(bits, DOUBLE)

    return types.float64(types.float64), generate


@inlined
def gather(rows, columns, index, base, t, at):
    """Copy the first columns of the rows of a tile's bodies into lanes."""
    for k in range(0, LANES, WIDTH):
        for column in range(0, columns, WIDTH):
            rows_to_lanes(
                rows, column, index, base + k, t, at + column * LANES + k, LANES
            )


@inlined
def root_of_bits(x):
    """`rsqrt` from the exponent's bits, by multiplications alone."""
    y = _rsqrt_seed(x)
    e = 1.0 - (x * y) * y
    y += y * e * (0.5 + e * (0.375 + e * 0.3125))
    e = 1.0 - (x * y) * y
    return y + y * e * (0.5 + e * (0.375 + e * 0.3125))


@inlined
def root_of_processor(x):
    """`rsqrt` by the processor's own root and division."""
    return 1.0 / math.sqrt(x + SMALLEST)


# 1 / sqrt(x) for x >= 0 to 1e-15; of zero a large finite number, so that x * rsqrt(x) is sqrt(x) there too.
rsqrt = root_of_processor if get_host_cpu_name().startswith("znver") else root_of_bits


if JIT_OFF:
    globals().update(as_python.INTRINSICS)
