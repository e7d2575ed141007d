"""Replace the intrinsics of `simd` by Python, for a run with NUMBA_DISABLE_JIT=1.

The names and arguments are those of `simd`, which has LLVM code for them.
"""

import numpy as np

WIDTH = 8


def _lane_slice(first, stride):
    """Return the slice that selects WIDTH numbers of a tile.

    `first` is the index of the first number, `stride` the distance between two of them.
    """
    return slice(first, first + WIDTH * stride, stride)


def rows_to_lanes(table, column, index, k, tile, first, stride):
    """Copy eight columns of eight rows of a table to lanes of a tile.

    tile[first + c * stride + lane] = table[index[k + lane], column + c], for c and lane
    of 0..7.

    Parameters
    ----------
    table : array (rows, columns)
        A table such as `Bodies.rows`.
    column : int
        First of the eight columns.
    index, k : array of int, int
        Lane `lane` is row index[k + lane] of the table.
    tile : array
        A flat array, to which the numbers are written.
    first, stride : int
        Index of the first number in the tile, and distance between two rows.
    """
    for lane in range(WIDTH):
        row = table[index[k + lane], column : column + WIDTH]
        tile[_lane_slice(first + lane, stride)] = row


def lanes_to_rows(table, column, index, k, tile, first, stride):
    """Copy eight rows of eight lanes of a tile to columns of a table.

    table[index[k + lane], column + c] = tile[first + c * stride + lane], for c and lane
    of 0..7. The arguments are those of `rows_to_lanes`. The numbers are written to the
    table.
    """
    for lane in range(WIDTH):
        numbers = tile[_lane_slice(first + lane, stride)]
        table[index[k + lane], column : column + WIDTH] = numbers


def add_lanes_to_rows(table, column, index, k, tile, first, stride):
    """Add eight rows of eight lanes of a tile to columns of a table.

    This is `lanes_to_rows` with addition in place of assignment, and has the same
    arguments. The lanes are added one after another, because two lanes may belong to
    the same body.
    """
    for lane in range(WIDTH):
        numbers = tile[_lane_slice(first + lane, stride)]
        table[index[k + lane], column : column + WIDTH] += numbers


def prefetch(_table, _row, _column):
    """Do nothing: Python cannot prefetch."""


def _rsqrt_seed(x):
    """Return a first approximation of 1 / sqrt(x) from the bits of the number x.

    See `simd`, whose compiled function gives the same bits.
    """
    bits = 0x5FE6EB50C7B537A9 - (int(np.float64(x).view(np.int64)) >> 1)
    return np.int64(bits).view(np.float64)


INTRINSICS = {
    "rows_to_lanes": rows_to_lanes,
    "lanes_to_rows": lanes_to_rows,
    "add_lanes_to_rows": add_lanes_to_rows,
    "prefetch": prefetch,
    "_rsqrt_seed": _rsqrt_seed,
}
