"""The compiler settings of every kernel, in one place.

Only `contract` (fused multiply-add) of the fast-math flags is on: it never reorders a sum, so the machine code and
with it every bit of a result does not depend on what the optimiser happened to inline. Kernels allocate nothing, so
arrays are not counted (`_nrt`): each view of a row would otherwise cost two atomic operations.
"""

import numba

from .. import cache  # noqa: F401  (sets the cache folder before any kernel is made)

FLAGS = {"contract"}
# What numba is told of a small function that is always inlined into its callers.
INLINED = {"fastmath": FLAGS, "error_model": "numpy", "_nrt": False, "forceinline": True}


def kernel(function):
    """Compile a function of floats and arrays, cached on disk."""
    return numba.njit(cache=True, fastmath=FLAGS, error_model="numpy", _nrt=False)(function)


def kernel_without_gil(function):
    """Compile a kernel that several Python threads run at the same time."""
    return numba.njit(cache=True, fastmath=FLAGS, error_model="numpy", _nrt=False, nogil=True)(function)


def inlined(function):
    """Compile a small function that is always inlined into its callers."""
    return numba.njit(cache=True, **INLINED)(function)
