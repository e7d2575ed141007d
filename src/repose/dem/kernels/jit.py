"""The compiler settings of every kernel, in one place.

Only `contract` (fused multiply-add) of the fast-math flags is on: it never reorders a sum, so the machine code and
with it every bit of a result does not depend on what the optimiser happened to inline. Kernels allocate nothing, so
arrays are not counted (`_nrt`): each view of a row would otherwise cost two atomic operations.
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
    """Let loops take vectors of 512 bits where the processor has them; LLVM prefers 256 on many, which is slower here.

    The bits of a result are the same. A user's NUMBA_CPU_NAME or NUMBA_CPU_FEATURES is left as it is.
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
    """A kernel as a Python function that divides by zero as the compiled one does."""
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
