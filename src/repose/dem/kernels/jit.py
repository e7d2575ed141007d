"""The compiler settings of every kernel.

Of the fast-math flags only `contract` (fused multiply-add) is on. It does not reorder sums, so the bits of a result do
not depend on how the optimiser inlined the code. Kernels allocate nothing, so reference counting is off (`_nrt`): it
would cost two atomic operations for each view of a row.
"""

import math
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from llvmlite import binding

from .. import cache  # noqa: F401  (sets the cache folder before any kernel is made)

FLAGS = {"contract"}
# Options of a small function that numba always inlines into its callers.
INLINED: dict[str, Any] = {"fastmath": FLAGS, "error_model": "numpy", "_nrt": False, "forceinline": True}


def use_widest_vectors() -> None:
    """Use vectors of 512 bits where the processor has them; a user's NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has priority.

    LLVM prefers 256 bits on many processors, which is slower here; the bits of the results are the same.
    """
    config: Any = numba.config  # numba makes its settings when it is imported, so their types are not seen
    features = binding.get_host_cpu_features()
    if features.get("avx512f") and config.CPU_NAME is None and config.CPU_FEATURES is None:
        config.CPU_NAME = binding.get_host_cpu_name()
        config.CPU_FEATURES = features.flatten() + ",-prefer-256-bit"


use_widest_vectors()

# With NUMBA_DISABLE_JIT=1 the kernels run as Python, to be measured or debugged. A root is then a number of numpy,
# which can be divided by when it is 0, as in compiled code.
JIT_OFF = bool(getattr(numba.config, "DISABLE_JIT", 0))
_MATH = SimpleNamespace(**{**vars(math), "sqrt": lambda x: np.sqrt(np.float64(x))})


def _as_python(function):
    """A kernel as a Python function that divides by zero as the compiled kernel does."""
    function.__globals__["math"] = _MATH
    return function


def kernel(function):
    """Compile a function of floats and arrays, cached on disk."""
    if JIT_OFF:
        return _as_python(function)
    return numba.njit(cache=True, fastmath=FLAGS, error_model="numpy", _nrt=False)(function)


def kernel_without_gil(function):
    """Compile a kernel that several Python threads run at the same time."""
    if JIT_OFF:
        return _as_python(function)
    return numba.njit(cache=True, fastmath=FLAGS, error_model="numpy", _nrt=False, nogil=True)(function)


def inlined(function):
    """Compile a small function that is always inlined into its callers."""
    if JIT_OFF:
        return _as_python(function)
    return numba.njit(cache=True, **INLINED)(function)
