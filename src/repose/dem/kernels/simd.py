"""LLVM code that numba does not make of loops: transpositions, prefetches, 1 / sqrt(x).

Bodies lie in rows of a table (all columns of one body, then the next body). The inner
loops need lanes (one column of 32 bodies, then the next column; see `rows`). The change
from one to the other is a transposition of 8 x 8 numbers: 16 loads of half a row, 16
shuffles and 8 wide stores, instead of 64 loads and 64 stores.

`rsqrt` replaces pairs of square roots and divisions, which take most of the time of a
contact, except on an AMD Zen, whose own roots are faster.

The intrinsics write plain LLVM code, so they compile for any processor. They take no
part in numba's checks: the caller answers for the bounds of the arrays.

In the functions that write code, `builder` is LLVM's builder, which appends
instructions to the function being compiled; what its methods return are LLVM values,
the results of these instructions at run time.
"""

import math

from llvmlite import ir
from llvmlite.binding import get_host_cpu_name
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from . import as_python
from .jit import JIT_OFF, inlined
from .rows import LANES

WIDTH = 8  # numbers moved at once
DOUBLE = ir.DoubleType()
INT64 = ir.IntType(64)
INT32 = ir.IntType(32)
BYTE = ir.IntType(8)
BYTES_OF_DOUBLE = 8
VECTOR = ir.VectorType(DOUBLE, WIDTH)
HALF = ir.VectorType(DOUBLE, WIDTH // 2)
FOR_READING, TO_ALL_CACHES, DATA = 0, 3, 1  # arguments of llvm.prefetch
PREFETCH_TYPE = ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), INT32, INT32, INT32])
SMALLEST = 1e-300  # makes the root of zero a number to divide by

# The arguments of the three intrinsics that move numbers between a table and a tile:
# arrays `table`, `index` and `tile`, the other four integers.
COPY_ARGUMENTS = ("table", "column", "index", "k", "tile", "first", "stride")


def _shuffle(builder, first, second, places):
    """Write a shuffle: pick WIDTH numbers out of two vectors.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    first, second : LLVM values
        Two vectors of equal length.
    places : list of int
        Which numbers are picked: places in `first`, counted on through `second`.

    Returns
    -------
    LLVM value
        The vector of the picked numbers.
    """
    mask = ir.Constant(ir.VectorType(INT32, WIDTH), places)
    return builder.shuffle_vector(first, second, mask)


def _load(builder, pointer, kind=VECTOR):
    """Write the load of a vector; return it as an LLVM value.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    pointer : LLVM value
        Pointer to the first double. It is aligned to a double only, not to a vector.
    kind : ir.VectorType
        Type of the vector: VECTOR, or HALF of its length.
    """
    return builder.load(builder.bitcast(pointer, kind.as_pointer()), align=8)


def _store(builder, vector, pointer):
    """Write the store of a vector.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    vector : LLVM value
        The vector.
    pointer : LLVM value
        Pointer to the first double. It is aligned to a double only, not to a vector.
    """
    builder.store(vector, builder.bitcast(pointer, VECTOR.as_pointer()), align=8)


def _write_transposition(builder, pointers):
    """Write code that transposes a matrix of 8 x 8 numbers in memory.

    A vector is made of halves of two rows: one instruction, which is no shuffle, loads
    and inserts the second half. So 16 shuffles are needed instead of 24 with whole
    rows.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    pointers : list of 8 LLVM values
        Pointers to the first numbers of the eight rows.

    Returns
    -------
    list of 8 LLVM values
        The columns, each a vector of 8 numbers.
    """
    columns = []
    for first_column in (0, 4):  # columns 0 to 3, then columns 4 to 7
        halves = [
            _load(builder, builder.gep(pointer, [INT64(first_column)]), HALF)
            for pointer in pointers
        ]
        # Four numbers of a row, then four numbers of the row after the next one.
        row_pairs = {}
        for row in (0, 1, 4, 5):
            row_pairs[row] = _shuffle(
                builder, halves[row], halves[row + 2], list(range(WIDTH))
            )
        # The even and the odd columns of rows 0 to 3, and of rows 4 to 7.
        pairs = ((row_pairs[0], row_pairs[1]), (row_pairs[4], row_pairs[5]))
        even_columns = [
            _shuffle(builder, *pair, [0, 8, 2, 10, 4, 12, 6, 14]) for pair in pairs
        ]
        odd_columns = [
            _shuffle(builder, *pair, [1, 9, 3, 11, 5, 13, 7, 15]) for pair in pairs
        ]
        # The first even and odd column of all eight rows, then the second ones.
        for places in ([0, 1, 4, 5, 8, 9, 12, 13], [2, 3, 6, 7, 10, 11, 14, 15]):
            columns.append(_shuffle(builder, *even_columns, places))
            columns.append(_shuffle(builder, *odd_columns, places))
    return columns


class _CopyArguments:
    """The arguments of an intrinsic that moves numbers, as LLVM values.

    Attributes
    ----------
    table, index, tile : pointers to the first number of each array
    column, k, first, stride : int64
    row_bytes : int64, size of a row of the table
    """

    def __init__(self, context, builder, signature, values):
        """Convert the arguments of a call to pointers and 64-bit integers.

        Parameters
        ----------
        context, builder
            Numba's target context and LLVM's builder.
        signature : numba signature
            Types of the arguments, in the order of COPY_ARGUMENTS.
        values : sequence of LLVM values
            The arguments.
        """
        self.builder = builder
        arguments = zip(COPY_ARGUMENTS, signature.args, values, strict=True)
        for name, kind, value in arguments:
            if isinstance(kind, types.Array):
                array = context.make_array(kind)(context, builder, value)
                setattr(self, name, array.data)
                if name == "table":
                    self.row_bytes = builder.extract_value(array.strides, 0)
            else:
                setattr(self, name, context.cast(builder, value, kind, types.int64))

    def row(self, lane):
        """Write code for the address of table[index[k + lane], column]; return it.

        The table may be a view, so the address is calculated in bytes, with its stride.
        """
        builder = self.builder
        index_pointer = builder.gep(self.index, [builder.add(self.k, INT64(lane))])
        row_number = builder.load(index_pointer)
        if row_number.type != INT64:
            row_number = builder.zext(row_number, INT64)
        # the address in bytes: that of the table, of the row, and of the column in it
        address = builder.ptrtoint(self.table, INT64)
        address = builder.add(address, builder.mul(row_number, self.row_bytes))
        address = builder.add(address, builder.mul(self.column, INT64(BYTES_OF_DOUBLE)))
        return builder.inttoptr(address, DOUBLE.as_pointer())

    def rows(self):
        """Return the pointers to the rows of the table, one for each of WIDTH lanes."""
        return [self.row(lane) for lane in range(WIDTH)]

    def lanes(self, quantity):
        """Return the pointer to a quantity's lanes: tile[first + quantity * stride]."""
        builder = self.builder
        offset = builder.mul(self.stride, INT64(quantity))
        return builder.gep(self.tile, [builder.add(self.first, offset)])

    def all_lanes(self):
        """Return the pointers to the lanes of all WIDTH quantities of the tile."""
        return [self.lanes(quantity) for quantity in range(WIDTH)]


def _find_copy_signature(table, column, index, k, tile, first, stride):
    """Return the signature of an intrinsic that moves numbers.

    Where the intrinsic cannot move them the result is None, by which numba knows that
    no such function exists.

    Parameters
    ----------
    table, column : numba type
        The table has to be an array of doubles.
    index, k : numba type
        The index has to be an array of integers.
    tile, first, stride : numba type
        The tile has to be an array of doubles.
    """
    if not all(isinstance(array, types.Array) for array in (table, tile, index)):
        return None
    if not table.dtype == tile.dtype == types.float64:
        return None
    if not isinstance(index.dtype, types.Integer):
        return None
    return types.void(table, column, index, k, tile, first, stride)


def _make_copy_intrinsic(write_code):
    """Make an intrinsic, a function with LLVM code of its own, that moves numbers.

    Parameters
    ----------
    write_code : callable
        Writes the code, given LLVM's builder and the arguments as a `_CopyArguments`. It gives the
        intrinsic its name and docstring.

    Returns
    -------
    callable
        A function that kernels call with COPY_ARGUMENTS.
    """

    # numba calls `declare` with the types of the arguments, then `generate` for the code
    def declare(typingctx, table, column, index, k, tile, first, stride):
        def generate(context, builder, sig, values):
            write_code(builder, _CopyArguments(context, builder, sig, values))
            return context.get_dummy_value()

        signature = _find_copy_signature(table, column, index, k, tile, first, stride)
        return signature, generate

    declare.__name__ = write_code.__name__
    declare.__doc__ = write_code.__doc__
    return intrinsic(declare)


@_make_copy_intrinsic
def rows_to_lanes(builder, move):
    """Copy eight columns of eight rows of a table to lanes of a tile.

    tile[first + c * stride + lane] = table[index[k + lane], column + c], for c and lane
    of 0..7. Kernels call it with COPY_ARGUMENTS.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    move : _CopyArguments
        The arguments of the call.
    """
    for quantity, lanes in enumerate(_write_transposition(builder, move.rows())):
        _store(builder, lanes, move.lanes(quantity))


@_make_copy_intrinsic
def lanes_to_rows(builder, move):
    """Copy eight rows of eight lanes of a tile to columns of a table.

    table[index[k + lane], column + c] = tile[first + c * stride + lane], for c and lane
    of 0..7. Kernels call it with COPY_ARGUMENTS.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    move : _CopyArguments
        The arguments of the call.
    """
    for lane, row in enumerate(_write_transposition(builder, move.all_lanes())):
        _store(builder, row, move.row(lane))


@_make_copy_intrinsic
def add_lanes_to_rows(builder, move):
    """Add eight rows of eight lanes of a tile to columns of a table.

    This is `lanes_to_rows` with a sum. Lane after lane is added, since a body may come
    twice.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    move : _CopyArguments
        The arguments of the call.
    """
    for lane, row in enumerate(_write_transposition(builder, move.all_lanes())):
        place = move.row(lane)
        _store(builder, builder.fadd(_load(builder, place), row), place)


def _pointer_to_number(context, builder, signature, values):
    """Write code for the address of table[row, column]; return the pointer.

    Parameters
    ----------
    context : numba target context
        Knows how arrays and integers are stored.
    builder : ir.IRBuilder
        LLVM's builder, which appends instructions to the function being compiled.
    signature : numba signature
        Types of the three values.
    values : sequence of LLVM values
        The table (an array of two dimensions), the row and the column.

    Returns
    -------
    LLVM value
        A pointer to bytes.
    """
    table_type, row_type, column_type = signature.args
    table, row, column = values
    # The array's first number and strides, and both indices as 64-bit integers.
    array = context.make_array(table_type)(context, builder, table)
    row = context.cast(builder, row, row_type, types.int64)
    column = context.cast(builder, column, column_type, types.int64)
    # The number lies row * stride 0 + column * stride 1 bytes after the first one.
    row_offset = builder.mul(row, builder.extract_value(array.strides, 0))
    column_offset = builder.mul(column, builder.extract_value(array.strides, 1))
    offset = builder.add(row_offset, column_offset)
    return builder.gep(builder.bitcast(array.data, BYTE.as_pointer()), [offset])


@intrinsic
def prefetch(typingctx, table, row, column):
    """Ask for the cache line of table[row, column] before it is read or written.

    The processor fetches it while the program goes on. A wrong place costs time only,
    but changes no result.

    Parameters
    ----------
    typingctx
        Numba's typing context, which it passes to every intrinsic.
    table, row, column
        Numba's types of an array of two dimensions and of two integers.

    Returns
    -------
    signature, function
        The signature of the call, and the function that writes its LLVM code.
    """

    def generate(context, builder, sig, values):
        place = _pointer_to_number(context, builder, sig, values)
        function = cgutils.get_or_insert_function(
            builder.module, PREFETCH_TYPE, "llvm.prefetch.p0i8"
        )
        options = [INT32(FOR_READING), INT32(TO_ALL_CACHES), INT32(DATA)]
        builder.call(function, [place, *options])
        return context.get_dummy_value()

    return types.void(table, row, column), generate


@intrinsic
def _rsqrt_seed(typingctx, x):
    """Return a first approximation of 1 / sqrt(x) from the bits of the number x.

    Its error is 3.5 % at most. The bits of a double, read as an integer, grow nearly as
    its logarithm: halving them takes the root, and subtracting that from a constant
    inverts it.
    """

    def generate(context, builder, sig, values):
        bits = builder.bitcast(values[0], INT64)
        bits = builder.sub(INT64(0x5FE6EB50C7B537A9), builder.lshr(bits, INT64(1)))
        return builder.bitcast(bits, DOUBLE)

    return types.float64(types.float64), generate


@inlined
def gather(rows, columns, index, base, tile, first):
    """Copy the first columns of the rows of 32 bodies to the lanes of a tile.

    Parameters
    ----------
    rows : array (bodies, columns)
        Table with a row for each body.
    columns : int
        Number of columns, a multiple of WIDTH.
    index : array of int
        Body index[base + k] goes to lane k of the tile.
    base : int
        Place of lane 0 in `index`.
    tile : array
        The tile; it is overwritten.
    first : int
        Place in the tile to which column 0 goes; the next columns go to the next rows.
    """
    # blocks of WIDTH lanes and WIDTH columns, each transposed at once
    for lane in range(0, LANES, WIDTH):
        for column in range(0, columns, WIDTH):
            rows_to_lanes(
                rows,
                column,
                index,
                base + lane,
                tile,
                first + column * LANES + lane,
                LANES,
            )


@inlined
def rsqrt_by_steps(x):
    """Return 1 / sqrt(x) by multiplications alone: a seed and two steps of third order.

    A step improves y by the error 1 - x y^2 and the first terms of the series of
    1 / sqrt(1 - error) = 1 + error / 2 + 3/8 error^2 + 5/16 error^3.
    """
    y = _rsqrt_seed(x)
    error = 1.0 - (x * y) * y
    y += y * error * (0.5 + error * (0.375 + error * 0.3125))
    error = 1.0 - (x * y) * y
    return y + y * error * (0.5 + error * (0.375 + error * 0.3125))


@inlined
def rsqrt_by_processor(x):
    """Return 1 / sqrt(x) by the processor's own root and division."""
    return 1.0 / math.sqrt(x + SMALLEST)


# 1 / sqrt(x) for x >= 0, to 1e-15. Of zero it is a large finite number, so that
# x * rsqrt(x) is sqrt(x) there, too.
if get_host_cpu_name().startswith("znver"):
    rsqrt = rsqrt_by_processor
else:
    rsqrt = rsqrt_by_steps

if JIT_OFF:
    globals().update(as_python.INTRINSICS)
