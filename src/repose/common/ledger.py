"""List the files that this program wrote in a folder: only these are replaced.

Each folder holds its ledger, the file `.repose`: a line for each file written there,
with the SHA-256 of its content. A file that a user put there, or changed since, has no
such line, so it stays.
"""

import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from repose.common.errors import InputError, require
from repose.dem.io.whole import write_whole as write_in_one_move

LEDGER = ".repose"
LINE = re.compile(r"([0-9a-f]{64})  (.+)")
# What a full disk may have left of a line.
CUT_OFF = re.compile(r"[0-9a-f]{0,64}|[0-9a-f]{64} .*")
ALLOWED = "a new name, or a file that repose wrote and nobody changed since"
# A file that is a link is not followed. Windows has the second flag alone.
OPEN_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


def write_whole(path: str | os.PathLike, write: Callable[[IO[bytes]], Any]) -> None:
    """Write a file in one move, and list it as written by this program.

    Parameters
    ----------
    path : path
        The file.
    write : callable
        Called with the open file, to which it writes bytes.

    Raises
    ------
    InputError
        If the path holds a file that this program did not write, or that was changed.
    """
    path = Path(path)
    check_replaceable(path)

    def write_and_note(handle: IO[bytes]) -> None:
        write(handle)
        handle.flush()
        # List the file before the move. Unlisted, it would pass for a file of the user.
        _note(path.parent, path.name, _hash(handle.name))

    try:
        write_in_one_move(path, write_and_note)
    except OSError as error:
        if error.filename is None:  # the error of a full disk names no file
            error.filename = str(path)
        raise


def check_replaceable(path: str | os.PathLike) -> None:
    """Raise InputError if a file must not be written here.

    That is, if a path holds a folder, a link, a device or a file that this program did
    not write, or if its name cannot stand in the ledger.
    """
    path = Path(path)
    if path.name in ("", "..", LEDGER) or not path.name.isprintable():
        raise InputError(path, "name", path.name, "a file name of printable characters")
    is_free = not os.path.lexists(path) or is_own_file(path)
    require(is_free, path, "file", "there already", ALLOWED)


def is_own_file(path: str | os.PathLike) -> bool:
    """Tell whether this program wrote a plain file that nobody changed since."""
    path = Path(path)
    if path.is_symlink() or not path.is_file():
        return False
    digests = _digests(path.parent)
    return path.name in digests and _hash(path) in digests[path.name]


def adopt(path: str | os.PathLike) -> None:
    """Note a file that this program has read as a whole and writes again.

    It may be a copy of one of its own files, or an edited one.
    """
    path = Path(path)
    _note(path.parent, path.name, _hash(path))


def adopt_below(
    folder: str | os.PathLike, name: str, source: str | os.PathLike
) -> None:
    """Note in a folder's ledger a file that another program wrote, to be kept below it.

    Parameters
    ----------
    folder : path
        The folder of the ledger.
    name : str
        The path of the file from there, with slashes, at which it is going to lie.
    source : path
        The file where it lies now.
    """
    _note(Path(folder), name, _hash(source))


def remove(path: str | os.PathLike) -> None:
    """Remove a file; InputError unless this program wrote it and nobody changed it."""
    require(is_own_file(path), path, "file", "there already", ALLOWED)
    Path(path).unlink()


def names(folder: str | os.PathLike) -> set[str]:
    """Name the files that this program wrote in a folder, also those deleted since."""
    return set(_digests(Path(folder)))


def changed(folder: str | os.PathLike) -> list[Path]:
    """List the files in a folder's ledger that were changed since.

    Somebody edited them, or they are damaged. Files that this program wrote in
    subfolders have ledgers of their own, so only those of `adopt_below` lie there.
    """
    folder = Path(folder)
    listed = _digests(folder)
    paths = {folder / name: listed[name] for name in sorted(listed)}
    return [path for path, digests in paths.items() if _differs(path, digests)]


def is_changed(folder: str | os.PathLike, name: str) -> bool:
    """Tell whether a file in a folder's ledger was changed since; see `changed`."""
    folder = Path(folder)
    digests = _digests(folder)
    return name in digests and _differs(folder / name, digests[name])


def _differs(path: Path, digests: set[str]) -> bool:
    """Tell whether a file is there and has none of the hashes."""
    return path.is_file() and _hash(path) not in digests


def _digests(folder: Path) -> dict[str, set[str]]:
    """Read the ledger of a folder: for each name, the hashes of what was written there.

    A folder without a ledger has none. A line that a full disk cut off is ignored.
    """
    path = folder / LEDGER
    digests: dict[str, set[str]] = defaultdict(set)
    if path.is_symlink() or not path.is_file():
        return digests

    # The text after the last newline is empty, or a line that was cut off.
    *whole_lines, last_line = os.fsdecode(path.read_bytes()).split("\n")
    for line in whole_lines:
        match = LINE.fullmatch(line)
        if match:
            digest, name = match.groups()
            digests[name].add(digest)

    # Refuse a file of the same name that is not a ledger.
    if not digests and not all(map(CUT_OFF.fullmatch, [*whole_lines, last_line])):
        allowed = "the list of files that repose wrote in this folder"
        raise InputError(path, "content", "something else", allowed)
    return digests


def _note(folder: Path, name: str, digest: str) -> None:
    """Add a file to a folder's ledger."""
    if digest in _digests(folder)[name]:
        return
    with open_descriptor(folder / LEDGER, os.O_APPEND) as handle:
        # One write, so that lines of jobs do not mix. It begins with a new line, so
        # that it is whole after a line that a full disk cut off.
        os.write(handle, os.fsencode(f"\n{digest}  {name}\n"))


@contextmanager
def open_descriptor(path: str | os.PathLike, flag: int) -> Iterator[int]:
    """Open a file to write into it, in the way of a flag such as `os.O_APPEND`.

    Yields
    ------
    int
        The open file, for `os.write`. A link is not followed: it is an OSError.
    """
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | flag | OPEN_FLAGS, 0o666)
    try:
        yield handle
    finally:
        os.close(handle)


def _hash(path: str | os.PathLike) -> str:
    """Hash a file's content by SHA-256."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
