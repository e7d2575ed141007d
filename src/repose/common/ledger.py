"""The files that this program wrote in a folder: only these, if unchanged, are replaced or removed.

Each folder holds its ledger, the file `.repose`: a line for each file written there, with the SHA-256 of its content. A
file that a user put there, or changed since, is in no line, so it stays.
"""

import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from repose.common.errors import InputError, require
from repose.dem.io.whole import write_whole as write_in_one_move

LEDGER = ".repose"
AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(
    os, "O_BINARY", 0
)  # Windows has the second alone
LINE = re.compile(r"[0-9a-f]{64}  ")
CUT_OFF = re.compile(r"[0-9a-f]{0,64}|[0-9a-f]{64} .*")
ALLOWED = "a new name, or a file that repose wrote and nobody changed since"


def write_whole(path: str | os.PathLike, write: Callable[[IO[bytes]], Any]) -> None:
    """Write a file in one move by `write`, which gets the open file (bytes); InputError if a foreign file is there."""
    path = Path(path)
    check_replaceable(path)

    def write_and_note(handle: IO[bytes]) -> None:
        write(handle)
        handle.flush()
        _note(path, _hash(handle.name))

    try:
        write_in_one_move(path, write_and_note)
    except OSError as error:
        if error.filename is None:  # the error of a full disk names no file
            error.filename = str(path)
        raise


def link(path: str | os.PathLike, other: str | os.PathLike) -> bool:
    """Give a file of ours a second name; False where a foreign file has it, or the file system has no such names."""
    path, other = Path(path), Path(other)
    part = other.with_name(f"{other.name}.{os.getpid()}.part")
    try:
        check_replaceable(other)
        other.parent.mkdir(exist_ok=True)
        os.link(path, part)
        _note(other, _hash(path))
        os.replace(part, other)
    except (OSError, InputError):
        return False
    finally:
        part.unlink(missing_ok=True)  # it stays where both are the same file already
    return True


def check_replaceable(path: str | os.PathLike) -> None:
    """Raise InputError if a path holds a folder, a link, a device or a file that this program did not write."""
    path = Path(path)
    if path.name in ("", "..", LEDGER) or not path.name.isprintable():
        raise InputError(path, "name", path.name, "a file name of printable characters")
    require(
        not os.path.lexists(path) or is_own_file(path),
        path,
        "file",
        "there already",
        ALLOWED,
    )


def adopt(path: str | os.PathLike) -> None:
    """Note a file whose whole content this program has read and writes again: a copy of its own, or an edited one."""
    _note(Path(path), _hash(path))


def is_own_file(path: str | os.PathLike) -> bool:
    """Tell whether this program wrote a file that nobody changed since; False for anything but a plain file."""
    path = Path(path)
    if path.is_symlink() or not path.is_file():
        return False
    noted = _lines(path.parent)
    return (
        any(line[66:] == path.name for line in noted)
        and f"{_hash(path)}  {path.name}" in noted
    )


def remove(path: str | os.PathLike) -> None:
    """Remove a file that this program wrote; InputError for any other, or if somebody changed it since."""
    require(is_own_file(path), path, "file", "there already", ALLOWED)
    Path(path).unlink()


def changed(folder: str | os.PathLike) -> list[Path]:
    """List the files of a folder, without subfolders, that this program wrote and that were edited or damaged since."""
    digests = defaultdict(set)
    for line in _lines(Path(folder)):
        digests[line[66:]].add(line[:64])
    paths = ((Path(folder) / name, known) for name, known in sorted(digests.items()))
    return [
        path for path, known in paths if path.is_file() and _hash(path) not in known
    ]


def names(folder: str | os.PathLike) -> set[str]:
    """Name the files that this program wrote in a folder, including files deleted since."""
    return {line[66:] for line in _lines(Path(folder))}


def _lines(folder: Path) -> frozenset[str]:
    """Read the ledger's lines, without a line that a full disk cut off; none without a ledger."""
    path = folder / LEDGER
    if path.is_symlink() or not path.is_file():
        return frozenset()
    lines = os.fsdecode(path.read_bytes()).split("\n")
    complete = frozenset(line for line in lines[:-1] if LINE.match(line))
    if not complete and not all(map(CUT_OFF.fullmatch, lines)):
        raise InputError(
            path,
            "content",
            "something else",
            "the list of files that repose wrote in this folder",
        )
    return complete


def _note(path: Path, digest: str) -> None:
    """Add a file to its folder's ledger; lines of jobs that write at the same time do not mix."""
    ledger, line = path.parent / LEDGER, f"{digest}  {path.name}"
    if line in _lines(path.parent):
        return
    handle = os.open(ledger, os.O_WRONLY | os.O_APPEND | os.O_CREAT | AS_IT_IS, 0o666)
    try:
        # It begins with a new line, so that it is whole after a line that a full disk cut off.
        os.write(handle, os.fsencode(f"\n{line}\n"))
    finally:
        os.close(handle)


def _hash(path: str | os.PathLike) -> str:
    """Hash a file's content by SHA-256."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
