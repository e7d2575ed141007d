"""Emit LLVM code that numba does not: transpositions, prefetches and 1 / sqrt(x).

Bodies are stored in rows of a table: all columns of one body, then those of the next.
The inner loops need lanes: one column of 32 bodies, then the next column (see `rows`).
To convert one layout into the other, matrices of 8 x 8 numbers are transposed. This
takes 16 loads of half a row, 16 shuffles and 8 wide stores, instead of 64 loads and 64
stores.

`rsqrt` replaces pairs of square roots and divisions, which take most of the time of a
contact. On an AMD Zen the processor's own roots are faster and are used.

The intrinsics write plain LLVM code, so they compile for any processor. Numba does not
check the bounds of arrays in them, so this is up to the caller.

In the functions that emit code, `builder` is LLVM's builder, which appends
instructions to the function being compiled. Its methods return LLVM values: the results
of these instructions at run time.
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

WIDTH = 8  # numbers that one instruction copies
DOUBLE = ir.DoubleType()
INT64 = ir.IntType(64)
INT32 = ir.IntType(32)
BYTE = ir.IntType(8)
BYTES_OF_DOUBLE = 8
VECTOR = ir.VectorType(DOUBLE, WIDTH)
HALF = ir.VectorType(DOUBLE, WIDTH // 2)
FOR_READING, TO_ALL_CACHES, DATA = 0, 3, 1  # arguments of llvm.prefetch
PREFETCH_TYPE = ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), INT32, INT32, INT32])
SMALLEST = 1e-300  # added to the radicand, so that 1 / sqrt(0) is finite

# The arguments of the three intrinsics that copy numbers between a table and a tile.
# The table, the index and the tile are arrays, and the other four are integers.
COPY_ARGUMENTS = ("table", "column", "index", "k", "tile", "first", "stride")


def _shuffle(builder, first, second, positions):
    """Emit a shuffle, which picks WIDTH numbers out of two vectors.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    first, second : LLVM values
        Two vectors of equal length.
    positions : list of int
        Positions of the picked numbers. They count through `first` and continue in
        `second`.

    Returns
    -------
    LLVM value
        The vector of the picked numbers.
    """
    mask = ir.Constant(ir.VectorType(INT32, WIDTH), positions)
    return builder.shuffle_vector(first, second, mask)


def _load(builder, pointer, kind=VECTOR):
    """Emit the load of a vector, and return the vector as an LLVM value.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    pointer : LLVM value
        Pointer to the first double. It is aligned only to a double, not to a vector.
    kind : ir.VectorType
        Type of the vector: VECTOR, or HALF of its length.
    """
    return builder.load(builder.bitcast(pointer, kind.as_pointer()), align=8)


def _store(builder, vector, pointer):
    """Emit the store of a vector.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    vector : LLVM value
        The vector.
    pointer : LLVM value
        Pointer to the first double. It is aligned only to a double, not to a vector.
    """
    builder.store(vector, builder.bitcast(pointer, VECTOR.as_pointer()), align=8)


def _write_transposition(builder, pointers):
    """Emit code that loads a matrix of 8 x 8 numbers from memory and transposes it.

    The matrix is handled in two halves of four columns. Each vector is made of half a
    row and half of another row. The processor can load the second half directly into
    the vector, without a shuffle. Therefore 16 shuffles are enough, instead of 24 for
    whole rows.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    pointers : list of 8 LLVM values
        Pointers to the first numbers of the eight rows.

    Returns
    -------
    list of 8 LLVM values
        The columns of the matrix, each a vector of 8 numbers.
    """
    columns = []
    for first_column in (0, 4):  # columns 0 to 3, then columns 4 to 7
        halves = [
            _load(builder, builder.gep(pointer, [INT64(first_column)]), HALF)
            for pointer in pointers
        ]
        # Join half of a row with half of the row two below it: rows 0 and 2, 1 and 3, 4
        # and 6, 5 and 7.
        row_pairs = {}
        for row in (0, 1, 4, 5):
            row_pairs[row] = _shuffle(
                builder, halves[row], halves[row + 2], list(range(WIDTH))
            )
        # Pick the even and the odd columns of rows 0 to 3, and of rows 4 to 7. A
        # position counts through the first vector (0 to 7) and then the second (8 to
        # 15). With c for the column, `even_columns[0]` is r0c0 r1c0 r0c2 r1c2 r2c0 r3c0
        # r2c2 r3c2.
        pairs = ((row_pairs[0], row_pairs[1]), (row_pairs[4], row_pairs[5]))
        even_columns = [
            _shuffle(builder, *pair, [0, 8, 2, 10, 4, 12, 6, 14]) for pair in pairs
        ]
        odd_columns = [
            _shuffle(builder, *pair, [1, 9, 3, 11, 5, 13, 7, 15]) for pair in pairs
        ]
        # Pick the first even and odd column of all eight rows, then the second ones.
        for positions in ([0, 1, 4, 5, 8, 9, 12, 13], [2, 3, 6, 7, 10, 11, 14, 15]):
            columns.append(_shuffle(builder, *even_columns, positions))
            columns.append(_shuffle(builder, *odd_columns, positions))
    return columns


class _CopyArguments:
    """The arguments of an intrinsic that copies numbers, as LLVM values.

    Attributes
    ----------
    table, index, tile : LLVM values
        Pointers to the first number of each array.
    column, k, first, stride : LLVM values
        Integers of 64 bits.
    row_bytes : LLVM value
        Size of a row of the table in bytes, an integer of 64 bits.
    """

    def __init__(self, context, builder, signature, values):
        """Convert the arguments of a call to pointers and 64-bit integers.

        The attributes get the names in COPY_ARGUMENTS: an array becomes a pointer to
        its first number, an integer is extended to 64 bits. The table also sets
        `row_bytes`, from which `row_pointer` computes addresses.

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
        for name, argument_type, value in arguments:
            if isinstance(argument_type, types.Array):
                array = context.make_array(argument_type)(context, builder, value)
                setattr(self, name, array.data)
                if name == "table":
                    self.row_bytes = builder.extract_value(array.strides, 0)
            else:
                setattr(
                    self, name, context.cast(builder, value, argument_type, types.int64)
                )

    def row_pointer(self, lane):
        """Emit code for the address of table[index[k + lane], column].

        The result is the address as an LLVM value, a pointer to a double. The table may
        be a view, so the address is computed in bytes from the stride.
        """
        builder = self.builder
        index_pointer = builder.gep(self.index, [builder.add(self.k, INT64(lane))])
        row_number = builder.load(index_pointer)
        # The index may hold shorter integers. None of them is negative, so zeros can be
        # put in front (zext).
        if row_number.type != INT64:
            row_number = builder.zext(row_number, INT64)
        # The address in bytes is that of the table, plus the offsets of row and column.
        address = builder.ptrtoint(self.table, INT64)
        address = builder.add(address, builder.mul(row_number, self.row_bytes))
        address = builder.add(address, builder.mul(self.column, INT64(BYTES_OF_DOUBLE)))
        return builder.inttoptr(address, DOUBLE.as_pointer())

    def row_pointers(self):
        """Return pointers to the rows of the table, one for each of WIDTH lanes."""
        return [self.row_pointer(lane) for lane in range(WIDTH)]

    def quantity_pointer(self, quantity):
        """Return the pointer to the lanes of a quantity in the tile.

        This is the address of tile[first + quantity * stride].
        """
        builder = self.builder
        offset = builder.mul(self.stride, INT64(quantity))
        return builder.gep(self.tile, [builder.add(self.first, offset)])

    def quantity_pointers(self):
        """Return pointers to the lanes of all WIDTH quantities of the tile."""
        return [self.quantity_pointer(quantity) for quantity in range(WIDTH)]


def _find_copy_signature(table, column, index, k, tile, first, stride):
    """Return the signature of an intrinsic that copies numbers between table and tile.

    The order of the arguments is that of COPY_ARGUMENTS. If the intrinsic cannot handle
    the arguments, the result is None, which tells numba that there is no such function.

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
    """Make an intrinsic that copies numbers between a table and a tile.

    An intrinsic is a function written in LLVM code that kernels can call. Numba calls
    the inner function `declare` with the types of the arguments, and later `generate`
    to emit the code. The parameters of `declare` must be those of COPY_ARGUMENTS, in
    the same order.

    Parameters
    ----------
    write_code : callable
        Function (builder, copy) -> None that emits the code. `builder` is LLVM's
        builder, and `copy` the arguments as `_CopyArguments`. The name and docstring of
        the function become those of the intrinsic.

    Returns
    -------
    callable
        A function that kernels call with COPY_ARGUMENTS.
    """

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
def rows_to_lanes(builder, copy):
    """Copy eight columns of eight rows of a table to lanes of a tile.

    tile[first + c * stride + lane] = table[index[k + lane], column + c], for c and lane
    of 0..7. Kernels call it with COPY_ARGUMENTS.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    copy : _CopyArguments
        The arguments of the call, as LLVM values.
    """
    for quantity, lanes in enumerate(
        _write_transposition(builder, copy.row_pointers())
    ):
        _store(builder, lanes, copy.quantity_pointer(quantity))


@_make_copy_intrinsic
def lanes_to_rows(builder, copy):
    """Copy eight rows of eight lanes of a tile to columns of a table.

    table[index[k + lane], column + c] = tile[first + c * stride + lane], for c and lane
    of 0..7. Kernels call it with COPY_ARGUMENTS.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    copy : _CopyArguments
        The arguments of the call, as LLVM values.
    """
    for lane, row_values in enumerate(
        _write_transposition(builder, copy.quantity_pointers())
    ):
        _store(builder, row_values, copy.row_pointer(lane))


@_make_copy_intrinsic
def add_lanes_to_rows(builder, copy):
    """Add eight rows of eight lanes of a tile to columns of a table.

    This is `lanes_to_rows` with addition in place of assignment. The lanes are added
    one after another, because two lanes may belong to the same body.

    Parameters
    ----------
    builder : ir.IRBuilder
        LLVM's builder.
    copy : _CopyArguments
        The arguments of the call, as LLVM values.
    """
    for lane, row_values in enumerate(
        _write_transposition(builder, copy.quantity_pointers())
    ):
        pointer = copy.row_pointer(lane)
        _store(builder, builder.fadd(_load(builder, pointer), row_values), pointer)


def _pointer_to_number(context, builder, signature, values):
    """Emit code that computes the address of table[row, column].

    Neither the bounds nor the signs of the indices are checked at run time.

    Parameters
    ----------
    context : numba target context
        Numba's target context, which knows how arrays and integers are stored.
    builder : ir.IRBuilder
        LLVM's builder, which appends instructions to the function being compiled.
    signature : numba signature
        Types of the three values.
    values : sequence of LLVM values
        The table (an array of two dimensions), the row and the column.

    Returns
    -------
    LLVM value
        A pointer to bytes: the address at run time.
    """
    table_type, row_type, column_type = signature.args
    table, row, column = values
    # Take the array apart, and convert both indices to integers of 64 bits.
    array = context.make_array(table_type)(context, builder, table)
    row = context.cast(builder, row, row_type, types.int64)
    column = context.cast(builder, column, column_type, types.int64)
    # The number lies row * strides[0] + column * strides[1] bytes after the first one.
    row_offset = builder.mul(row, builder.extract_value(array.strides, 0))
    column_offset = builder.mul(column, builder.extract_value(array.strides, 1))
    offset = builder.add(row_offset, column_offset)
    return builder.gep(builder.bitcast(array.data, BYTE.as_pointer()), [offset])


@intrinsic
def prefetch(typingctx, table, row, column):
    """Fetch the cache line of table[row, column] before it is read or written.

    The processor fetches it while the program continues. An unnecessary prefetch costs
    time but does not change any result. This is an intrinsic: numba calls the function
    when it compiles a kernel, and then `generate` to emit the code.

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
        pointer = _pointer_to_number(context, builder, sig, values)
        # `p0i8` in the name is LLVM's notation of a pointer to bytes.
        function = cgutils.get_or_insert_function(
            builder.module, PREFETCH_TYPE, "llvm.prefetch.p0i8"
        )
        options = [INT32(FOR_READING), INT32(TO_ALL_CACHES), INT32(DATA)]
        builder.call(function, [pointer, *options])
        return context.get_dummy_value()

    return types.void(table, row, column), generate


@intrinsic
def _rsqrt_seed(typingctx, x):
    """Return a first approximation of 1 / sqrt(x) from the bits of the number x.

    Its relative error is at most 3.5 %. The bits of a double, read as an integer, are
    nearly a linear function of its logarithm. Half of this integer belongs to the root,
    and a constant minus this half belongs to the inverse of the root.
    """

    def generate(context, builder, sig, values):
        bits = builder.bitcast(values[0], INT64)
        bits = builder.sub(INT64(0x5FE6EB50C7B537A9), builder.lshr(bits, INT64(1)))
        return builder.bitcast(bits, DOUBLE)

    return types.float64(types.float64), generate


@inlined
def gather(table, n_columns, index, base, tile, first):
    """Copy the first columns of 32 rows of a table to the lanes of a tile.

    Parameters
    ----------
    table : array (bodies, columns)
        Table with a row for each body.
    n_columns : int
        Number of columns, a multiple of WIDTH.
    index : array of int
        Row index[base + k] of the table is copied to lane k of the tile.
    base : int
        Position in `index` of the row for lane 0.
    tile : array
        The tile. The rows from `first` on are overwritten.
    first : int
        Index of the first number of the tile's row for column 0. The other columns are
        copied to the rows after it.
    """
    # Each call transposes a block of WIDTH lanes and WIDTH columns.
    for lane in range(0, LANES, WIDTH):
        for column in range(0, n_columns, WIDTH):
            rows_to_lanes(
                table,
                column,
                index,
                base + lane,
                tile,
                first + column * LANES + lane,
                LANES,
            )


@inlined
def rsqrt_by_steps(x):
    """Return 1 / sqrt(x), computed from a first approximation by multiplications alone.

    Each of two steps improves the approximation y. If the error is 1 - x y^2, the exact
    result is y / sqrt(1 - error). The step multiplies y by the series of 1 / sqrt(1 -
    error) up to third order, which is 1 + error / 2 + 3/8 error^2 + 5/16 error^3.
    """
    y = _rsqrt_seed(x)
    error = 1.0 - (x * y) * y
    y += y * error * (0.5 + error * (0.375 + error * 0.3125))
    error = 1.0 - (x * y) * y
    return y + y * error * (0.5 + error * (0.375 + error * 0.3125))


@inlined
def rsqrt_by_processor(x):
    """Return 1 / sqrt(x), computed by the processor's square root and division."""
    return 1.0 / math.sqrt(x + SMALLEST)


# 1 / sqrt(x) for x >= 0, to 1e-15. The result is large but finite for x = 0, so that
# x * rsqrt(x) is sqrt(x) there, too.
if get_host_cpu_name().startswith("znver"):
    rsqrt = rsqrt_by_processor
else:
    rsqrt = rsqrt_by_steps

if JIT_OFF:
    globals().update(as_python.INTRINSICS)
