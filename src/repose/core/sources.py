"""Hashes of source code: the engine behind a result."""

import hashlib
from collections.abc import Iterable
from functools import cache

from repose.core.places import PACKAGE

ENGINE = ("dem", "apparatus")  # a pour depends on the simulator and the bench tests


@cache
def engine_hash() -> str:
    """Hash of the source of the simulator and the bench tests, 16 digits."""
    return source_hash(ENGINE)


def source_hash(rooms: Iterable[str]) -> str:
    """Hash of the source of some rooms of the package, such as ``dem``, 16 digits."""
    digest = hashlib.sha256()
    for room in rooms:
        for path in sorted((PACKAGE / room).rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(path.relative_to(PACKAGE).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
