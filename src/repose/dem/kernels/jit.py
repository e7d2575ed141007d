"""The compiler settings of every kernel, and the decorators that apply them.

Of the fast-math flags, only `contract` (fused multiply-add) is on. It does not reorder
sums. However, if a sum contains two products, LLVM chooses which one is fused.
Therefore the last bits of a result may change when an expression is written in another
way: when a load is moved out of a loop, or when a vector is read by a function instead
of number by number. Compare the results of whole simulations after editing a kernel
(tests/same_bits).

Kernels do not allocate memory, so reference counting is off (`_nrt`). It would cost two
atomic operations for each view of a row.
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
# For kernels that Python calls: without the wrapper for calls from C.
FROM_PYTHON: dict[str, Any] = {"no_cfunc_wrapper": True}
# For kernels that other kernels call: also without the wrapper for calls from Python.
FROM_KERNELS: dict[str, Any] = FROM_PYTHON | {"no_cpython_wrapper": True}
# For small functions that are always inlined into their callers.
INLINED: dict[str, Any] = OPTIONS | FROM_KERNELS | {"forceinline": True}


def use_widest_vectors() -> None:
    """Use vectors of 512 bits where the processor has them.

    LLVM prefers 256 bits on many processors, which is slower here. The results are the
    same, bit for bit. If a user has set NUMBA_CPU_NAME or NUMBA_CPU_FEATURES, that has
    priority.
    """
    # Numba makes its settings when it is imported, so type checkers do not know them.
    config: Any = numba.config
    features = binding.get_host_cpu_features()
    set_by_user = config.CPU_NAME is not None or config.CPU_FEATURES is not None
    if features.get("avx512f") and not set_by_user:
        config.CPU_NAME = binding.get_host_cpu_name()
        config.CPU_FEATURES = features.flatten() + ",-prefer-256-bit"


use_widest_vectors()

# With NUMBA_DISABLE_JIT=1 the kernels run as Python, for debugging or to measure
# coverage. Square roots are then numpy numbers, so that division by a root of 0 gives
# infinity, as it does in compiled code.
JIT_OFF = bool(getattr(numba.config, "DISABLE_JIT", 0))
_MATH = SimpleNamespace(**{**vars(math), "sqrt": lambda x: np.sqrt(np.float64(x))})


def _as_python(function):
    """Return a kernel as a Python function that divides by zero as compiled code does.

    In the function's module, the name `math` is replaced by an object whose `sqrt`
    returns numpy numbers.
    """
    function.__globals__["math"] = _MATH
    return function


class Kernel:
    """A compiled function, cached on disk.

    There are two compiled versions, one for calls from Python and one for calls from
    kernels. Each is compiled when it is first needed. The second version lacks the code
    that reads the arguments of a call from Python, which takes up to a third of the
    compile time.

    Attributes that this class lacks are those of the version that Python calls.

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
        # Hash the file now, while it is being imported, because it may change on disk
        # later.
        self._source_hash = cache.hash_file(function.__code__.co_filename)

    @cached_property
    def from_python(self) -> Any:
        """The compiled function that Python calls."""
        return self._make_dispatcher(FROM_PYTHON)

    @cached_property
    def from_kernels(self) -> Any:
        """The compiled function that kernels call."""
        return self._make_dispatcher(FROM_KERNELS)

    def _make_dispatcher(self, caller_options):
        """Make numba's dispatcher with these options and the cache of this package.

        Parameters
        ----------
        caller_options : dict
            FROM_PYTHON or FROM_KERNELS, added to the options of the kernel.
        """
        options = {**self._options, **caller_options}
        dispatcher = numba.njit(**options)(self.py_func)
        if self._source_hash:
            dispatcher._cache = cache.KernelCache(
                self.py_func, options, self._source_hash
            )
        return dispatcher

    def __call__(self, *arguments: Any) -> Any:
        return self.from_python(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.from_python, name)


@typeof_impl.register(Kernel)
def _find_numba_type(kernel, context):
    """Return numba's type of a `Kernel` that another kernel calls."""
    return typeof_impl(kernel.from_kernels, context)


def _compile(function, options):
    """Return a `Kernel`, or a Python function if the compiler is off."""
    return _as_python(function) if JIT_OFF else Kernel(function, options)


def compiled(function):
    """Compile a function with numba's default settings."""
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
