"""Keep compiled code on disk, so that other processes need not compile it again.

The folder is named after a hash of all sources of this package and of laws from other
packages. It holds a file for each kernel and signature. numba's own cache would not do:
it depends on the path of a kernel's file, but not on the files of the kernels that it
calls.
"""

import contextlib
import functools
import hashlib
import inspect
import os
import pickle
import sys
import uuid
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FunctionType
from typing import IO, Any, cast

import numba
from llvmlite import binding
from numba.core import event
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from .sources import outside_sources, source_hash

try:
    import fcntl
except ImportError:
    # On Windows there are no locks. If several processes need the same code at the same
    # time, each compiles it.
    fcntl = None  # type: ignore[assignment]


def cache_folder() -> str:
    """Return the path of the cache folder of these sources.

    The folder lies in NUMBA_CACHE_DIR or in the user's cache folder.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    if not base:
        default = os.path.join(os.path.expanduser("~"), ".cache")
        user_cache = os.environ.get("XDG_CACHE_HOME") or default
        base = os.path.join(user_cache, "repose")
    return os.path.join(base, f"dem-{source_hash()}")


@functools.cache
def hash_file(path: str) -> str:
    """Hash a source file.

    The result is empty if there is no file, as for a cell of a notebook.
    """
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


class KernelCache(NullCache):
    """The cache of one function's compiled code, which numba reads and writes.

    Stored code is valid for one version of numba, one of Python and one type of
    processor. If several processes need the same code at the same time, the first one
    compiles it and the others wait.

    Parameters
    ----------
    function : function
        The function that is compiled.
    options : mapping
        Options of the compiler.
    file_hash : str
        Hash of the function's source file.
    """

    def __init__(
        self, function: Callable[..., Any], options: Mapping[str, Any], file_hash: str
    ) -> None:
        self._function = function
        self._options = sorted(options.items())
        self._file_hash = file_hash
        self._is_called_by_kernels = "no_cpython_wrapper" in options

    @property
    def cache_path(self) -> str:
        return cache_folder()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the stored code of a signature, the types of the arguments.

        This is the method that numba calls before it compiles a function. If there is
        no stored code, the lock of the kernel is taken and kept, so that other
        processes wait until `save_overload` releases it.

        Parameters
        ----------
        sig : object
            The types of the arguments.
        target_context : object
            numba's target context, which describes the processor.

        Returns
        -------
        CompileResult or None
            The code. If it is None, numba compiles the function and calls
            `save_overload`. Until then, this process holds the lock of the kernel.
        """
        # The method of numba's own cache also loads information that only its compiler
        # needs. This takes 0.3 s. The runtime is enough here.
        rtsys.initialize(target_context)
        path = self._build_path(sig, target_context.codegen())
        stored = _read_code(path, sig)
        if stored is None:
            # Another process may be compiling this function. Wait until it releases the
            # lock, and look again.
            _lock_kernel(path)
            stored = _read_code(path, sig)
            if stored is None:
                return None
            _unlock_kernel(path)
        # `_rebuild` is the private counterpart of `_reduce` in `save_overload`.
        return CompileResult._rebuild(target_context, *stored)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the code that numba has compiled for a signature.

        Afterwards, the lock of the kernel is released, which `load_overload` has taken,
        so that processes waiting for this code continue. If the call fails,
        `_UnlockOnFailure` releases it.

        Parameters
        ----------
        sig : object
            The types of the arguments.
        data : CompileResult
            The compiled code. If no kernel calls the function, its bitcode is replaced
            by a stub, in place.
        """
        path = self._build_path(sig, data.codegen)
        if not self._is_called_by_kernels:
            # Only Python calls this function. Bitcode is needed to link a function into
            # others, and reading it would take 0.1 s. The stub is an empty function
            # with the name that numba looks up, that of the wrapper for calls from
            # Python. `_shared_module` is a private attribute of numba.
            name = data.fndesc.llvm_cpython_wrapper_name
            stub = f'define void @"{name}"() {{ ret void }}'
            data.library._shared_module = binding.parse_assembly(stub)
        # Code that contains addresses of this process is useless to other processes.
        if not data.library.has_dynamic_globals:
            _write_code(path, dumps((sig, data._reduce())))
        _unlock_kernel(path)

    def _build_path(self, signature: object, codegen: Any) -> str:
        """Build the path of a signature's code from all that the code depends on.

        Whatever changes the code must be in `sources` or `compiler`. Otherwise old code
        would be used.

        Parameters
        ----------
        signature : object
            The types of the arguments.
        codegen : object
            numba's code generator, which knows the type of the processor.

        Returns
        -------
        str
            The path. It ends with 24 hexadecimal digits of a hash, from which
            `_set_lock` takes an offset.
        """
        function = self._function
        name = f"{function.__module__}.{function.__qualname__}"
        # Values of an outer function's variables that the function uses
        closure = dumps([cell.cell_contents for cell in function.__closure__ or ()])
        sources = (
            name,
            function.__code__.co_firstlineno,
            closure,
            str(signature),  # its text, as its pickle may vary
            self._options,
            self._file_hash,
        )
        # The versions of numba and Python, and the type of the processor
        compiler = (numba.__version__, sys.version_info[:2], codegen.magic_tuple())
        digest = hashlib.sha256(repr((sources, compiler)).encode()).hexdigest()
        file_name = name.replace("<", "").replace(">", "")
        return os.path.join(cache_folder(), f"{file_name}-{digest[:24]}")


def _read_code(path: str, signature: object) -> tuple[Any, ...] | None:
    """Read the code stored for a signature.

    Parameters
    ----------
    path : str
        The file.
    signature : object
        The types of the arguments.

    Returns
    -------
    tuple or None
        The code; None if there is none, or if the file is damaged.
    """
    try:
        with open(path, "rb") as file:
            stored_signature, stored = pickle.load(file)
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    return stored if stored_signature == signature else None


def _write_code(path: str, content: bytes) -> None:
    """Write a file so that other processes see either all of it or none of it.

    If the file cannot be written, a warning is issued, and each process has to compile
    the code itself.

    Parameters
    ----------
    path : str
        The file.
    content : bytes
        Its content.
    """
    # The file is first written under another name and then renamed in one step, so that
    # no process reads half of it.
    temporary = f"{path}.{uuid.uuid4().hex}"
    try:
        with open(temporary, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except OSError as error:
        _warn_once(f"{os.path.dirname(path)} keeps no compiled code: {error.strerror}")
        with contextlib.suppress(OSError):
            os.unlink(temporary)


@functools.cache
def _warn_once(message: str) -> None:
    """Issue a warning only once in this process.

    With Python's own filters, it would be repeated at each compilation.
    """
    warnings.warn(message, stacklevel=3)


# The lock file of each folder. One of its bytes belongs to each kernel, and a process
# locks this byte while it compiles the kernel.
_lock_files: dict[str, IO[bytes]] = {}


def _lock_kernel(path: str) -> None:
    """Wait until no other process is compiling a kernel, then make the others wait."""
    if fcntl is not None:
        _set_lock(path, fcntl.LOCK_EX)


def _unlock_kernel(path: str) -> None:
    """Let the processes that are waiting for this kernel continue."""
    if fcntl is not None:
        _set_lock(path, fcntl.LOCK_UN)


def _set_lock(path: str, operation: int) -> None:
    """Lock or unlock one byte of the lock file, which belongs to one kernel.

    All kernels of a folder share a lock file, each with a byte of its own. The file is
    opened once and kept in `_lock_files`. If the file cannot be created or locked, the
    call does nothing: then several processes may compile the same kernel.

    Parameters
    ----------
    path : str
        File of the kernel's code. Its name must end with hexadecimal digits, as
        `_build_path` makes it.
    operation : int
        A lock operation of `fcntl`: LOCK_EX or LOCK_UN.
    """
    kernel_folder = os.path.dirname(path)
    # The last 15 hexadecimal digits of the file's name are part of a hash. As a number
    # below 2^60, they give the byte's offset, which therefore differs between kernels.
    # A lock may lie beyond the end of the lock file.
    byte_place = int(path[-15:], 16)
    with contextlib.suppress(OSError):
        if kernel_folder not in _lock_files:
            os.makedirs(kernel_folder, exist_ok=True)
            # The file stays open, since its locks end when it is closed.
            file = open(os.path.join(kernel_folder, "locks"), "ab")  # noqa: SIM115
            _lock_files[kernel_folder] = file
        fcntl.lockf(_lock_files[kernel_folder], operation, 1, byte_place)


class _UnlockOnFailure(event.Listener):
    """Unlocks all kernels when a compilation fails.

    The processes that were waiting then fail in the same way.
    """

    def on_start(self, event: Any) -> None:
        pass

    def on_end(self, event: Any) -> None:
        if sys.exception() is not None:
            for file in _lock_files.values():
                fcntl.lockf(file, fcntl.LOCK_UN)


event.register("numba:compile", _UnlockOnFailure())


def add_law_sources(*functions: Callable[..., Any] | None) -> None:
    """Make the path of the cache folder depend on the functions of a law.

    The code of a law from another package is compiled into the kernels, so the cache
    must notice when it changes. The function adds a description of these sources to
    `outside_sources`, which is part of the hash in the name of the folder. It must be
    called before the path is used. The functions of this package are part of that hash
    anyway, so a law that consists of them changes nothing.

    Parameters
    ----------
    *functions : callable or None
        The functions. None stands for a function that the law does not have.
    """
    package_prefix = f"{__package__}."
    law_functions = [
        cast(FunctionType, function) for function in functions if function is not None
    ]
    if all(
        function.__module__.startswith(package_prefix) for function in law_functions
    ):
        return
    for function in law_functions:
        # A function may call functions of further modules.
        modules = {function.__module__, *_list_called_modules(function)}
        for module in sorted(modules):
            if not module.startswith(package_prefix):
                # The key only has to be different for each module and function.
                key = f"{module} {function.__name__}"
                outside_sources[key] = _describe_source(module, function)


def _look_up_globals(function: FunctionType) -> dict[str, Any]:
    """Look up the values of the global names that a function uses.

    The value is None for a name that is not defined.
    """
    names = function.__code__.co_names
    return {name: function.__globals__.get(name) for name in names}


def _list_called_modules(function: FunctionType) -> set[str]:
    """List the modules of the functions that a function calls directly."""
    modules = set()
    for value in _look_up_globals(function).values():
        if callable(value) and isinstance(value.__module__, str):
            modules.add(value.__module__)
    return modules


def _describe_source(module: str, function: FunctionType) -> str:
    """Return the source of a module, and the values of numbers that a function uses.

    The numbers are global names of the module. If the module has no source file, as in
    a notebook, the bytecode of the function is returned in place of the source.
    """
    code = function.__code__
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        source = f"{code.co_code.hex()} {code.co_consts!r}"
    numbers = {
        name: value
        for name, value in _look_up_globals(function).items()
        if isinstance(value, int | float)
    }
    return f"{source} {numbers!r}"
