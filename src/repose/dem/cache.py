"""The folder for compiled kernels, named after a hash of all sources of this package.

numba's own cache checks the file of a kernel only, not the files of the kernels that it calls.
"""

import hashlib
import os
from pathlib import Path


def source_hash() -> str:
    """A short hash of the sources of `repose.dem`: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    home = Path(__file__).parent
    for path in sorted(home.rglob("*.py")):
        digest.update(path.relative_to(home).as_posix().encode())
        digest.update(path.read_bytes())
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


use_cache()
