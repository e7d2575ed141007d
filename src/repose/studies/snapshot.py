"""A snapshot of a finished study: its tables and pictures without the pours themselves."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

from repose.core import ledger, provenance
from repose.core.attached import SIDECAR
from repose.core.errors import InputError
from repose.core.ledger import write_whole

SUFFIXES = (".csv", ".json", ".png", ".gif", ".html")  # tables and pictures, without positions and meshes
LARGEST_FILE = 5_000_000  # bytes


CONFIG, CARD = "config.json", "card.json"  # what a study begins and ends with
MANIFEST = "snapshot.txt"  # in a snapshot: its files, one a line


def take(results_dir: str | Path, out: str | Path, patterns: Iterable[str]) -> list[Path]:
    """Copy the tables and pictures of a finished study to `out` and return them; an earlier snapshot there is replaced.

    `patterns` are regular expressions of their paths below the folder of results.
    """
    source, out = Path(results_dir), Path(out)
    files = _kept(source, patterns)
    sidecars = (path.with_name(f"{path.name}{SIDECAR}") for path in files)
    files = list(dict.fromkeys([*files, *(path for path in sidecars if path.is_file())]))
    if not (source / CARD).is_file():
        raise InputError(source, CARD, "missing", "a finished study")
    for path in files:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(path, "size", path.stat().st_size, f"at most {LARGEST_FILE} bytes")
    earlier = _earlier(out)
    names = [path.relative_to(source).as_posix() for path in files]
    _write(out / MANIFEST, _lines({*names, *earlier}))
    for path, name in zip(files, names, strict=True):
        _write(out / name, path.read_bytes())
    for name in earlier - set(names):
        ledger.remove(out / name)
    _write(out / MANIFEST, _lines(names))
    return [out / name for name in names]


def of_optional_studies(
    results_dir: str | Path, patterns: Iterable[str], made: Iterable[str], strategy: str
) -> str:
    """Hash, 16 digits, of a snapshot's files outside the folders of `made` and of the strategy.

    Those files are not of the calibration; another hash is a reason to take the snapshot anew.
    """
    source = Path(results_dir)
    folders = {Path(path).parent for path in made}
    kept = [path for path in _kept(source, patterns) if not path.is_relative_to(source / strategy)]
    files = [path for path in kept if path.parent not in folders]
    return provenance.hash_of(
        {str(path.relative_to(source)): provenance.hash_of_file(path) for path in files}
    )


def _kept(source, patterns):
    """Files of a study that a snapshot keeps, none of another study in a folder below; their records follow them."""
    try:
        kept = [re.compile(pattern) for pattern in patterns]
    except re.error as error:
        raise InputError("command line", "--keep", error.pattern, "regular expressions") from error
    found = []
    for folder, below, names in os.walk(source):
        below[:] = [name for name in below if not Path(folder, name, CONFIG).is_file()]
        paths = [Path(folder, name) for name in names if Path(name).suffix in SUFFIXES]
        named = {path.relative_to(source).as_posix(): path for path in paths}
        found += [path for name, path in named.items() if any(pattern.fullmatch(name) for pattern in kept)]
    return sorted(found)


def _earlier(out):
    """Names of the files of an earlier snapshot in a folder; InputError where the folder holds anything else."""
    if not os.path.lexists(out):
        return set()
    if not out.is_dir():
        raise InputError(out, "folder", "a file", "a folder")
    manifest = out / MANIFEST
    names = set(manifest.read_text(encoding="utf-8").splitlines()) if ledger.is_own_file(manifest) else set()
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        own = name in {*names, MANIFEST} and ledger.is_own_file(path)
        if not own and path.name != ledger.LEDGER and (path.is_symlink() or not path.is_dir()):
            allowed = "a new folder, or an earlier snapshot and no other file"
            raise InputError(out, "content", name, allowed)
    return {name for name in names if (out / name).is_file()}


def _lines(names):
    """Sorted names, one a line, as bytes."""
    return "".join(f"{name}\n" for name in sorted(names)).encode()


def _write(path, content):
    """Write bytes as they are: a copy keeps the record of its original, and gets none of its own."""
    write_whole(path, lambda handle: handle.write(content))
