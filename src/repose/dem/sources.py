"""Hash the sources of this package, without loading numpy or numba."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parent
# Sources of laws from other packages, by module and function.
outside_sources: dict[str, str] = {}


def _package_sources() -> Iterator[bytes]:
    """Yield the name and content of each source file of this package."""
    for path in sorted(PACKAGE.rglob("*.py")):
        yield path.relative_to(PACKAGE).as_posix().encode() + path.read_bytes()


# Computed when the package is imported, because later edits do not affect this process.
_PACKAGE_HASH = hashlib.sha256(b"".join(_package_sources()))


def source_hash() -> str:
    """Hash the sources of `repose.dem` and of laws from other packages.

    The hash has 16 hexadecimal digits.
    """
    digest = _PACKAGE_HASH.copy()
    for name, source in sorted(outside_sources.items()):
        digest.update(f"{name}\n{source}".encode())
    return digest.hexdigest()[:16]
