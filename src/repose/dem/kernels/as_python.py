"""The functions of `simd`, which are LLVM there, in Python for a run without the compiler (NUMBA_DISABLE_JIT=1)."""

import numpy as np

WIDTH = 8


def rows_to_lanes(table, column, index, k, tile, at, stride):
    """tile[at + c * stride + l] = table[index[k + l], column + c] for c and l of 0..7."""
    for lane in range(WIDTH):
        tile[at + lane : at + lane + WIDTH * stride : stride] = table[
            index[k + lane], column : column + WIDTH
        ]


def lanes_to_rows(table, column, index, k, tile, at, stride):
    """table[index[k + l], column + c] = tile[at + c * stride + l] for c and l of 0..7."""
    for lane in range(WIDTH):
        table[index[k + lane], column : column + WIDTH] = tile[
            at + lane : at + lane + WIDTH * stride : stride
        ]


def add_lanes_to_rows(table, column, index, k, tile, at, stride):
    """table[index[k + l], column + c] += tile[at + c * stride + l], lane after lane."""
    for lane in range(WIDTH):
        table[index[k + lane], column : column + WIDTH] += tile[
            at + lane : at + lane + WIDTH * stride : stride
        ]


def prefetch(_table, _row, _column):
    """No operation: Python cannot prefetch."""


def _rsqrt_seed(x):
    """First approximation of 1 / sqrt(x) from the bits of the exponent."""
    bits = 0x5FE6EB50C7B537A9 - (int(np.float64(x).view(np.int64)) >> 1)
    return np.int64(bits).view(np.float64)


INTRINSICS = {
    f.__name__: f
    for f in (rows_to_lanes, lanes_to_rows, add_lanes_to_rows, prefetch, _rsqrt_seed)
}
