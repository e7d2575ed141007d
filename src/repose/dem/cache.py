"""The folder for compiled kernels, named after a hash of all sources of this package and of laws from outside.

numba's own cache checks the file of a kernel only, not the files of the kernels that it calls.
"""

import hashlib
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

HOME = Path(__file__).parent
_outside: dict[str, str] = {}  # sources of laws from other packages, by module and function


def source_hash() -> str:
    """A short hash of the sources of `repose.dem` and of laws from outside: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(HOME.rglob("*.py")):
        digest.update(path.relative_to(HOME).as_posix().encode())
        digest.update(path.read_bytes())
    for name, source in sorted(_outside.items()):
        digest.update(f"{name}\n{source}".encode())
    return digest.hexdigest()[:16]


def folder() -> str:
    """Path of the cache folder of this source version, below NUMBA_CACHE_DIR or the user's cache folder."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "repose"
    )
    return os.path.join(base, f"dem-{source_hash()}")


def use_cache() -> None:
    """Let numba use the cache folder."""
    import numba

    # numba makes its settings when it is imported, so their types are not seen.
    setattr(numba.config, "CACHE_DIR", folder())  # noqa: B010


def add_source(*functions: Callable[..., Any] | None) -> None:
    """Compile with the functions of a law: one from outside moves the cache folder of all kernels."""
    own = f"{__package__}."
    given = [function for function in functions if function is not None]
    if all(function.__module__.startswith(own) for function in given):
        return
    from numba.core.registry import CPUDispatcher

    for function in given:
        names = {function.__module__, *_used(function)}
        for name in sorted(name for name in names if not name.startswith(own)):
            _outside[f"{name} {function.__name__}"] = _source(name, function)
    use_cache()
    for name in [name for name in sys.modules if name.startswith(own)]:
        for value in list(vars(sys.modules[name]).values()):
            if isinstance(value, CPUDispatcher):
                value.enable_caching()


def _used(function):
    """Names of the modules of the functions that a function calls, directly."""
    used = [function.__globals__.get(name) for name in function.__code__.co_names]
    return {value.__module__ for value in used if callable(value) and isinstance(value.__module__, str)}


def _source(module, function):
    """Source of a module, or of a notebook the function's code; and the numbers that the function uses."""
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        source = f"{function.__code__.co_code.hex()} {function.__code__.co_consts!r}"
    used = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    return f"{source} { {name: value for name, value in used.items() if isinstance(value, int | float)}!r}"


use_cache()
