"""Compiled code on disk, which is found by what the sources say and not by their path.

A file for each kernel and signature lies in a folder named after a hash of all sources of this package and of laws from
outside. numba's own cache looks at the path of a kernel's file, and at no file of the kernels that it calls.
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
from collections.abc import Callable, Iterator, Mapping
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

try:
    import fcntl
except (
    ImportError
):  # Windows: processes that need the same code at one time compile it each
    fcntl = None  # type: ignore[assignment]

TAKEN, FREE = (fcntl.LOCK_EX, fcntl.LOCK_UN) if fcntl else (0, 0)
HOME = Path(__file__).parent
_outside: dict[
    str, str
] = {}  # sources of laws from other packages, by module and function


def _sources() -> Iterator[bytes]:
    """Yield names and texts of all files of this package."""
    for path in sorted(HOME.rglob("*.py")):
        yield path.relative_to(HOME).as_posix().encode() + path.read_bytes()


_OWN = hashlib.sha256(
    b"".join(_sources())
)  # as they are imported: an edit after that is not what runs


def source_hash() -> str:
    """Hash the sources of `repose.dem` and of laws from outside: 16 hexadecimal digits."""
    digest = _OWN.copy()
    for name, source in sorted(_outside.items()):
        digest.update(f"{name}\n{source}".encode())
    return digest.hexdigest()[:16]


def folder() -> str:
    """Path of the cache folder of this source version, below NUMBA_CACHE_DIR or the user's cache folder."""
    of_user = os.environ.get("XDG_CACHE_HOME") or os.path.join(
        os.path.expanduser("~"), ".cache"
    )
    base = os.environ.get("NUMBA_CACHE_DIR") or os.path.join(of_user, "repose")
    return os.path.join(base, f"dem-{source_hash()}")


@functools.cache
def text_hash(path: str) -> str:
    """Hash a source file; empty for what is no file, as a cell of a notebook."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


class KernelCache(NullCache):
    """The compiled code of a function with some options of the compiler, as a dispatcher of numba asks for it.

    Code holds for one version of numba and of Python and for one type of processor. Of processes that need the same
    code at one time the first compiles it, and the others wait for it.
    """

    def __init__(
        self, function: Callable[..., Any], options: Mapping[str, Any], text: str
    ) -> None:
        self._function, self._made_from = function, (sorted(options.items()), text)
        self._for_kernels = "no_cpython_wrapper" in options

    @property
    def cache_path(self) -> str:
        return folder()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # For code that is found, numba's declarations for the compiler are not loaded: they would take .3 s.
        rtsys.initialize(target_context)
        path = self._path(sig, target_context.codegen())
        stored = _read(path, sig)
        if stored is None:
            _lock(path, TAKEN)
            stored = _read(path, sig)
            if stored is not None:
                _lock(path, FREE)
        return stored and CompileResult._rebuild(target_context, *stored)

    def save_overload(self, sig: Any, data: Any) -> None:
        path = self._path(sig, data.codegen)
        if not self._for_kernels:
            # What no kernel calls is not linked again: in place of its bitcode, which takes .1 s to read, the name of
            # the function that Python calls.
            stub = f'define void @"{data.fndesc.llvm_cpython_wrapper_name}"() {{ ret void }}'
            data.library._shared_module = binding.parse_assembly(stub)
        if not data.library.has_dynamic_globals:
            _write(path, dumps((sig, data._reduce())))
        _lock(path, FREE)

    def _path(self, signature: object, codegen: Any) -> str:
        """Name a file after all that the code depends on; not after the signature's pickle, which may vary."""
        function = self._function
        name = f"{function.__module__}.{function.__qualname__}"
        cells = dumps([cell.cell_contents for cell in function.__closure__ or ()])
        made_from = (
            name,
            function.__code__.co_firstlineno,
            cells,
            str(signature),
            *self._made_from,
        )
        made_by = (numba.__version__, sys.version_info[:2], codegen.magic_tuple())
        digest = hashlib.sha256(repr((made_from, made_by)).encode()).hexdigest()
        return os.path.join(
            folder(), f"{name.replace('<', '').replace('>', '')}-{digest[:24]}"
        )


def _read(path: str, signature: object) -> tuple[Any, ...] | None:
    """Read the code stored for a signature; None if there is none, or only a part."""
    try:
        with open(path, "rb") as file:
            of, stored = pickle.load(file)
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    return stored if of == signature else None


def _write(path: str, content: bytes) -> None:
    """Store a file in one move; where none can be written, each process compiles anew."""
    part = f"{path}.{uuid.uuid4().hex}"
    try:
        with open(part, "wb") as file:
            file.write(content)
        os.replace(part, path)
    except OSError as error:
        _warn_once(f"{os.path.dirname(path)} keeps no compiled code: {error.strerror}")
        with contextlib.suppress(OSError):
            os.unlink(part)


@functools.cache
def _warn_once(message: str) -> None:
    """Warn; the filters of Python would let a warning pass again after each compilation."""
    warnings.warn(message, stacklevel=3)


_locks: dict[
    str, IO[bytes]
] = {}  # a file of each folder, whose bytes stand for its kernels


def _lock(path: str, kind: int) -> None:
    """Wait for the lock of a kernel, or give it back; where the folder has no locks there is none to wait for."""
    parent = os.path.dirname(path)
    if fcntl is None:
        return
    with contextlib.suppress(OSError):
        if parent not in _locks:
            os.makedirs(parent, exist_ok=True)
            _locks[parent] = open(os.path.join(parent, "locks"), "ab")  # noqa: SIM115  (closed, its locks end)
        fcntl.lockf(_locks[parent], kind, 1, int(path[-15:], 16))


class _Failure(event.Listener):
    """Gives all locks back where a compilation fails: processes that wait for the kernel then fail as it does."""

    def on_start(self, event: Any) -> None:
        pass

    def on_end(self, event: Any) -> None:
        if sys.exception() is not None:
            for file in _locks.values():
                fcntl.lockf(file, FREE)


event.register("numba:compile", _Failure())


def add_source(*functions: Callable[..., Any] | None) -> None:
    """Compile with the functions of a law: one from outside moves the cache folder of all kernels."""
    own = f"{__package__}."
    given = [
        cast(FunctionType, function) for function in functions if function is not None
    ]
    if all(function.__module__.startswith(own) for function in given):
        return
    for function in given:
        names = {function.__module__, *_used(function)}
        for name in sorted(name for name in names if not name.startswith(own)):
            _outside[f"{name} {function.__name__}"] = _source(name, function)


def _used(function: FunctionType) -> set[str]:
    """Name the modules of the functions that a function calls directly."""
    used = [function.__globals__.get(name) for name in function.__code__.co_names]
    return {
        value.__module__
        for value in used
        if callable(value) and isinstance(value.__module__, str)
    }


def _source(module: str, function: FunctionType) -> str:
    """Return a module's source, or a notebook function's code; and the numbers that the function uses."""
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        source = f"{function.__code__.co_code.hex()} {function.__code__.co_consts!r}"
    used = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    return f"{source} { {name: value for name, value in used.items() if isinstance(value, int | float)}!r}"
