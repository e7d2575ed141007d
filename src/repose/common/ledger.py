"""List the files that this program wrote in a folder, because only these are replaced.

Each folder has a list of files, called its ledger, in the file `.repose`. It has a line
for each file that this program wrote there, with the SHA-256 of the content. A file
that a user put there, or has changed, has no such line and is therefore not replaced.
"""

import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from repose.common.errors import InputError
from repose.dem.io.whole import write_whole as write_atomically

LEDGER = ".repose"
ENTRY_PATTERN = re.compile(r"([0-9a-f]{64})  (.+)")
# The beginning of a line, of which a full disk may have cut off the end.
CUT_OFF_PATTERN = re.compile(r"[0-9a-f]{0,64}|[0-9a-f]{64} .*")
REPLACEABLE_FILES = "a new name, or a file that repose wrote and nobody changed since"
# Do not follow a link, and do not convert line ends. Windows has only the second flag,
# other systems have only the first.
OPEN_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


def write_listed_file(
    path: str | os.PathLike, write: Callable[[IO[bytes]], Any]
) -> None:
    """Write a file atomically, and add it to the ledger of its folder.

    The ledger is the list of the files that this program wrote. A file is written
    atomically if its path never has half of the content: the content is written into a
    temporary file, which is then renamed.

    Parameters
    ----------
    path : path
        The file.
    write : callable
        Function that writes bytes to the open file, its argument.

    Raises
    ------
    InputError
        If there is a file that this program did not write, or that was changed.
    """
    path = Path(path)
    check_replaceable(path)

    def write_and_list(handle: IO[bytes]) -> None:
        """Write the content into a temporary file, and list it under its later name."""
        write(handle)
        handle.flush()
        # List the file before `write_atomically` renames the temporary file. Otherwise,
        # if the program were killed in between, the next run would mistake it for a
        # file of the user. `handle.name` is the path of the temporary file.
        _append_entry(path.parent, path.name, _hash_file(handle.name))

    try:
        write_atomically(path, write_and_list)
    except OSError as error:
        # The error of a full disk names no file, but the message for the user should.
        if error.filename is None:
            error.filename = str(path)
        raise


def check_replaceable(path: str | os.PathLike) -> None:
    """Check that a file may be written to a path.

    Raises
    ------
    InputError
        If the path is a folder, a link, a device, or a file that this program did not
        write or that was changed, or if the ledger cannot list such a name.
    """
    path = Path(path)
    if path.name in ("", "..", LEDGER) or not path.name.isprintable():
        raise InputError(
            path,
            key="name",
            value=path.name,
            allowed="a file name of printable characters",
        )
    is_free = not os.path.lexists(path) or is_own_file(path)
    if not is_free:
        raise InputError(
            path, key="file", value="there already", allowed=REPLACEABLE_FILES
        )


def is_own_file(path: str | os.PathLike) -> bool:
    """Tell whether a path is a file that this program wrote and nobody has changed."""
    path = Path(path)
    if path.is_symlink() or not path.is_file():
        return False
    digests = _read_ledger(path.parent)
    return path.name in digests and _hash_file(path) in digests[path.name]


def list_file(path: str | os.PathLike) -> None:
    """List a file in the ledger of its folder, so that this program may replace it.

    Call this for a file whose whole content this program has read and will write again.
    The file may be a copy of a file of this program, or an edited one.
    """
    path = Path(path)
    _append_entry(path.parent, path.name, _hash_file(path))


def list_file_below(
    folder: str | os.PathLike, name: str, source: str | os.PathLike
) -> None:
    """List a file of another program in the ledger of a folder around its new place.

    Parameters
    ----------
    folder : path
        The folder of the ledger.
    name : str
        The future path of the file, relative to the folder and with slashes.
    source : path
        The present path of the file.
    """
    _append_entry(Path(folder), name, _hash_file(source))


def remove_own_file(path: str | os.PathLike) -> None:
    """Remove a file; raise InputError if this program did not write it as it is now."""
    if not is_own_file(path):
        raise InputError(
            path, key="file", value="there already", allowed=REPLACEABLE_FILES
        )
    Path(path).unlink()


def list_names(folder: str | os.PathLike) -> set[str]:
    """List the names in a folder's ledger, including those of files deleted later."""
    return set(_read_ledger(Path(folder)))


def find_changed_files(folder: str | os.PathLike) -> list[Path]:
    """Find the files in a folder's ledger that were edited or damaged later.

    Subfolders have ledgers of their own. Therefore the only files of subfolders in this
    ledger are those of `list_file_below`.
    """
    folder = Path(folder)
    listed = _read_ledger(folder)
    paths = {folder / name: listed[name] for name in sorted(listed)}
    return [
        path for path, digests in paths.items() if _has_other_content(path, digests)
    ]


def is_changed(folder: str | os.PathLike, name: str) -> bool:
    """Tell whether a file in a folder's ledger was changed; see `find_changed_files`."""
    folder = Path(folder)
    digests = _read_ledger(folder)
    return name in digests and _has_other_content(folder / name, digests[name])


def _has_other_content(path: Path, digests: set[str]) -> bool:
    """Tell whether a file exists and has none of the listed hashes."""
    return path.is_file() and _hash_file(path) not in digests


def _read_ledger(folder: Path) -> dict[str, set[str]]:
    """Read the ledger of a folder, the list of the files that this program wrote.

    Returns
    -------
    dict of str to set of str
        For each file, the hashes of all contents that this program wrote into it. The
        dict is empty for a folder without a ledger. It is a defaultdict, so that a file
        that is not listed has an empty set.

    Raises
    ------
    InputError
        If there is a file of this name that is not a ledger.
    """
    path = folder / LEDGER
    digests: dict[str, set[str]] = defaultdict(set)
    if path.is_symlink() or not path.is_file():
        return digests

    # The text after the last newline is empty, or a line that was cut off. Read only
    # the lines before it. A full disk may also have cut off one of these, which then
    # does not match the pattern and is skipped.
    *whole_lines, last_line = os.fsdecode(path.read_bytes()).split("\n")
    for line in whole_lines:
        match = ENTRY_PATTERN.fullmatch(line)
        if match:
            digest, name = match.groups()
            digests[name].add(digest)

    # A file without a single entry is a ledger only if each of its lines may be the
    # beginning of an entry. Otherwise it belongs to another program.
    lines = [*whole_lines, last_line]
    if not digests and not all(map(CUT_OFF_PATTERN.fullmatch, lines)):
        raise InputError(
            path,
            key="content",
            value="something else",
            allowed="the list of files that repose wrote in this folder",
        )
    return digests


def _append_entry(folder: Path, name: str, digest: str) -> None:
    """Append a file to the ledger of a folder, unless the ledger lists it already."""
    if digest in _read_ledger(folder)[name]:
        return
    with open_descriptor(folder / LEDGER, os.O_APPEND) as handle:
        # Use a single write, so that lines of different jobs do not mix. Begin with a
        # newline, because a full disk may have cut off the previous line.
        os.write(handle, os.fsencode(f"\n{digest}  {name}\n"))


@contextmanager
def open_descriptor(path: str | os.PathLike, flag: int) -> Iterator[int]:
    """Open a file for writing with a flag such as `os.O_APPEND`.

    Yields
    ------
    int
        The descriptor of the file, for `os.write`.

    Raises
    ------
    OSError
        If the path is a link, or the file cannot be opened.
    """
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | flag | OPEN_FLAGS, 0o666)
    try:
        yield handle
    finally:
        os.close(handle)


def _hash_file(path: str | os.PathLike) -> str:
    """Hash the content of a file with SHA-256."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
