"""The compiler settings of every kernel, and the decorators that apply them.

Of the fast-math flags only `contract` (fused multiply-add) is on. It does not reorder
sums, but of two products in a sum it lets LLVM choose the one that is fused. So the last
bits of a result may change where an expression is written in another way: a load is moved
out of a loop, or a vector is read by a function instead of number by number. Compare the
results of whole simulations after an edit of a kernel (tests/same_bits).

Kernels allocate nothing, so reference counting is off (`_nrt`): it would cost two atomic
operations for each view of a row.
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
# Python calls a kernel: without the code by which C calls it.
FROM_PYTHON: dict[str, Any] = {"no_cfunc_wrapper": True}
# Another kernel calls it: without the code by which Python calls it, either.
FROM_KERNELS: dict[str, Any] = FROM_PYTHON | {"no_cpython_wrapper": True}
# A small function that is always inlined into its callers.
INLINED: dict[str, Any] = OPTIONS | FROM_KERNELS | {"forceinline": True}


def use_widest_vectors() -> None:
    """Use vectors of 512 bits where the processor has them.

    LLVM prefers 256 bits on many processors, which is slower here; the bits of the
    results are the same. A user's NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has priority.
    """
    # numba makes its settings when it is imported, so their types are not known
    config: Any = numba.config
    features = binding.get_host_cpu_features()
    set_by_user = config.CPU_NAME is not None or config.CPU_FEATURES is not None
    if features.get("avx512f") and not set_by_user:
        config.CPU_NAME = binding.get_host_cpu_name()
        config.CPU_FEATURES = features.flatten() + ",-prefer-256-bit"


use_widest_vectors()

# With NUMBA_DISABLE_JIT=1 the kernels run as Python, to be measured or debugged. A root is
# then a number of numpy, by which one can divide when it is 0, as in compiled code.
JIT_OFF = bool(getattr(numba.config, "DISABLE_JIT", 0))
_MATH = SimpleNamespace(**{**vars(math), "sqrt": lambda x: np.sqrt(np.float64(x))})


def _as_python(function):
    """Return a kernel as a Python function that divides by zero as compiled code does.

    The function's module gets another `math`, whose root is a number of numpy.
    """
    function.__globals__["math"] = _MATH
    return function


class Kernel:
    """A compiled function, cached on disk.

    There are two compiled versions, made when they are needed: one that Python calls, and
    one that kernels call. The code that reads the arguments of a call from Python takes
    up to a third of the time to compile, and the second version is without it.

    Other attributes than the methods here are those of the version that Python calls.

    Parameters
    ----------
    function : callable
        The Python function.
    options : mapping
        Options of `numba.njit`.
    """

    def __init__(
        self, function: Callable[..., Any], options: Mapping[str, Any]
    ) -> None:
        self.py_func = function
        self._options = options
        # of the file as it is imported; it may change on disk later
        self._text = cache.hash_file(function.__code__.co_filename)

    @cached_property
    def from_python(self) -> Any:
        """The compiled function that Python calls."""
        return self._dispatcher(FROM_PYTHON)

    @cached_property
    def from_kernels(self) -> Any:
        """The compiled function that kernels call."""
        return self._dispatcher(FROM_KERNELS)

    def _dispatcher(self, caller_options):
        """Make numba's function of these options, with the cache of this package.

        Parameters
        ----------
        caller_options : dict
            FROM_PYTHON or FROM_KERNELS, added to the options of the kernel.
        """
        options = {**self._options, **caller_options}
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
    """Return numba's type of a `Kernel` that is called in another one."""
    return typeof_impl(kernel.from_kernels, context)


def _compile(function, options):
    """Return a `Kernel`, or a Python function where the compiler is off."""
    return _as_python(function) if JIT_OFF else Kernel(function, options)


def compiled(function):
    """Compile a function with numba's own settings."""
    return function if JIT_OFF else Kernel(function, {})


def kernel(function):
    """Compile a function of floats and arrays."""
    return _compile(function, OPTIONS)


def kernel_without_gil(function):
    """Compile a kernel that several Python threads run at the same time."""
    return _compile(function, OPTIONS | {"nogil": True})


def inlined(function):
    """Compile a small function that is always inlined into its callers."""
    return _compile(function, OPTIONS | {"forceinline": True})
