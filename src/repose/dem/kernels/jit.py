"""The compiler settings of every kernel.

Of the fast-math flags only `contract` (fused multiply-add) is on. It does not reorder sums, so the bits of a result do
not depend on how the optimiser inlined the code. Kernels allocate nothing, so reference counting is off (`_nrt`): it
would cost two atomic operations for each view of a row.
"""

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from llvmlite import binding
from numba.extending import typeof_impl

from .. import cache

OPTIONS: dict[str, Any] = {
    "fastmath": {"contract"},
    "error_model": "numpy",
    "_nrt": False,
}
# Without the code by which C calls a function, and without the one by which Python does.
FROM_PYTHON: dict[str, Any] = {"no_cfunc_wrapper": True}
FROM_KERNELS: dict[str, Any] = FROM_PYTHON | {"no_cpython_wrapper": True}
# Options of a small function that numba always inlines into its callers.
INLINED: dict[str, Any] = OPTIONS | FROM_KERNELS | {"forceinline": True}


def use_widest_vectors() -> None:
    """Use vectors of 512 bits where the processor has them; a user's NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has priority.

    LLVM prefers 256 bits on many processors, which is slower here; the bits of the results are the same.
    """
    config: Any = (
        numba.config
    )  # numba makes its settings when it is imported, so their types are not seen
    features = binding.get_host_cpu_features()
    if (
        features.get("avx512f")
        and config.CPU_NAME is None
        and config.CPU_FEATURES is None
    ):
        config.CPU_NAME = binding.get_host_cpu_name()
        config.CPU_FEATURES = features.flatten() + ",-prefer-256-bit"


use_widest_vectors()

# With NUMBA_DISABLE_JIT=1 the kernels run as Python, to be measured or debugged. A root is then a number of numpy,
# which can be divided by when it is 0, as in compiled code.
JIT_OFF = bool(getattr(numba.config, "DISABLE_JIT", 0))
_MATH = SimpleNamespace(**{**vars(math), "sqrt": lambda x: np.sqrt(np.float64(x))})


def _as_python(function):
    """Return a kernel as a Python function that divides by zero as the compiled kernel does."""
    function.__globals__["math"] = _MATH
    return function


class Kernel:
    """A compiled function, cached on disk.

    The code that reads the arguments of a call from Python takes up to a third of the time to compile; what kernels
    call is compiled without it.
    """

    def __init__(
        self, function: Callable[..., Any], options: Mapping[str, Any]
    ) -> None:
        self.py_func, self._options = function, options
        self._text = cache.text_hash(function.__code__.co_filename)  # as it is imported

    @cached_property
    def from_python(self) -> Any:
        """The dispatcher that Python calls."""
        return self._dispatcher(FROM_PYTHON)

    @cached_property
    def from_kernels(self) -> Any:
        """The dispatcher that kernels call."""
        return self._dispatcher(FROM_KERNELS)

    def _dispatcher(self, entries):
        options = {**self._options, **entries}
        dispatcher = numba.njit(**options)(self.py_func)
        if self._text:
            dispatcher._cache = cache.KernelCache(self.py_func, options, self._text)
        return dispatcher

    def __call__(self, *arguments: Any) -> Any:
        return self.from_python(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.from_python, name)


@typeof_impl.register(Kernel)
def _type(kernel, context):
    return typeof_impl(kernel.from_kernels, context)


def compiled(function):
    """Compile a function with numba's own settings."""
    return function if JIT_OFF else Kernel(function, {})


def kernel(function):
    """Compile a function of floats and arrays."""
    return _as_python(function) if JIT_OFF else Kernel(function, OPTIONS)


def kernel_without_gil(function):
    """Compile a kernel that several Python threads run at the same time."""
    return (
        _as_python(function) if JIT_OFF else Kernel(function, OPTIONS | {"nogil": True})
    )


def inlined(function):
    """Compile a small function that is always inlined into its callers."""
    return (
        _as_python(function)
        if JIT_OFF
        else Kernel(function, OPTIONS | {"forceinline": True})
    )
