"""Write a file so that it is either complete or absent."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any


def write_whole(path: str | os.PathLike, write: Callable[[IO[bytes]], Any]) -> None:
    """Write a file completely, or leave the earlier file unchanged.

    The content is written to a temporary file in the same folder, which then replaces
    the file. Therefore an interrupt never leaves half a file.

    Parameters
    ----------
    path : path
        The file. Its folder is made if it does not exist.
    write : callable
        Function that takes an open binary file and writes the content to it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with open(temporary, "wb") as handle:
            write(handle)
            handle.flush()
            os.fsync(handle.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
