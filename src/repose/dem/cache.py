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
_outside: dict[str, str] = {}  # source of laws from other packages by the name of their module


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


def add_source(kernel: Callable[..., Any]) -> None:
    """Compile with the kernel of a law: one from outside moves the cache folder of all kernels."""
    if kernel.__module__.startswith(f"{__package__}."):
        return
    from numba.core.registry import CPUDispatcher

    module = sys.modules[kernel.__module__]
    try:
        _outside[kernel.__module__] = inspect.getsource(module)
    except (OSError, TypeError):  # of a notebook
        _outside[kernel.__module__] = inspect.getsource(kernel)
    use_cache()
    for name in [name for name in sys.modules if name.startswith(f"{__package__}.")]:
        for value in list(vars(sys.modules[name]).values()):
            if isinstance(value, CPUDispatcher) and value.targetoptions.get("cache", True):
                value.enable_caching()


use_cache()
