"""Copy the tables and pictures of a finished study, without its runs, into a snapshot."""

import argparse
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from repose.bench import names as bench_tests
from repose.calibrate import strategies
from repose.common import ledger
from repose.common.attached import SIDECAR_SUFFIX
from repose.common.errors import BAD_INPUT, InputError, print_fault
from repose.common.ledger import write_listed_file
from repose.config.results_folder import name_run_folder

# Folders of a study, with those of the studies in `research`.
FOLDERS = (
    "berry",
    "design",
    "network",
    "miga",
    "validation",
    "measure",
    "drum",
    "film",
    "figures",
    "noise",
    "posterior",
    "sensitivity",
    "next",
    "pool",
    "comparison",
    "responses",
    "measurement_study",
    "joint_targets",
    "seeds_per_sample",
    "shape",
)
# Those of them that may hold results of a study itself.
RESULT_FOLDERS = {*FOLDERS, *strategies.names()} - {"published"}
# Suffixes of tables and pictures. Positions and meshes are not copied.
SUFFIXES = (
    ".csv",
    ".json",
    ".png",
    ".gif",
    ".html",
)
# Largest size of a file in bytes, so that the repository stays small.
LARGEST_FILE = 5_000_000
# The first and the last file that a study writes.
CONFIG = "config.json"
CARD = "card.json"
# Files that are not copied: runs of the drum, and the check of a configuration. A record
# is copied only with its result.
OTHERS = re.compile(r"drum_\d+\.json|.*\.provenance\.json|checked\.json")
# The list of the files of a snapshot, one on each line.
MANIFEST = "snapshot.txt"


def copy_study(results_dir: str | Path, out: str | Path) -> list[Path]:
    """Copy the tables and pictures of a finished study into a snapshot.

    Files of an earlier snapshot in the same folder are replaced or removed.

    Parameters
    ----------
    results_dir : path
        The folder of the study's results.
    out : path
        The folder of the snapshot. It must be new, or hold an earlier snapshot.

    Returns
    -------
    list of Path
        The files of the snapshot, without its list.

    Raises
    ------
    InputError
        If the study is not finished, a file is too large, or the folder of the snapshot
        has other files.
    """
    source = Path(results_dir)
    out = Path(out)
    if not (source / CARD).is_file():
        raise InputError(source, key=CARD, value="missing", allowed="a finished study")
    files = _list_files_to_copy(source)
    for path in files:
        n_bytes = path.stat().st_size
        if n_bytes > LARGEST_FILE:
            raise InputError(
                path, key="size", value=n_bytes, allowed=f"at most {LARGEST_FILE} bytes"
            )

    # While files are copied, list those of both snapshots. After an interruption, the
    # next call then recognises all of them.
    names = [path.relative_to(source).as_posix() for path in files]
    earlier_names = _list_earlier_files(out)
    _write(out / MANIFEST, _format_manifest({*names, *earlier_names}))
    for path, name in zip(files, names, strict=True):
        _write(out / name, path.read_bytes())
    for name in earlier_names.difference(names):
        ledger.remove_own_file(out / name)
    _write(out / MANIFEST, _format_manifest(names))
    return [out / name for name in names]


def _list_files_to_copy(source: Path) -> list[Path]:
    """List the tables and pictures of a study, each with its record if it has a sidecar.

    Runs are left out, and so is any other study in a folder below.
    """
    run_folders = {name_run_folder(name) for name in bench_tests()}
    found = []
    for folder, subfolders, names in os.walk(source):
        candidates = set(subfolders)
        if Path(folder) == source:
            candidates &= RESULT_FOLDERS
        # `os.walk` enters only the folders that remain in this list.
        subfolders[:] = sorted(
            name
            for name in candidates
            if name not in run_folders and not Path(folder, name, CONFIG).is_file()
        )
        found += [Path(folder, name) for name in names if Path(name).suffix in SUFFIXES]
    results = sorted(path for path in found if not OTHERS.fullmatch(path.name))

    # A sidecar may be in the list already. List each file once.
    sidecars = [path.with_name(f"{path.name}{SIDECAR_SUFFIX}") for path in results]
    existing_sidecars = [path for path in sidecars if path.is_file()]
    return list(dict.fromkeys([*results, *existing_sidecars]))


def _list_earlier_files(out: Path) -> set[str]:
    """List the files of an earlier snapshot in a folder.

    Parameters
    ----------
    out : Path
        The folder of the snapshot, which need not exist.

    Returns
    -------
    set of str
        Paths relative to the folder; empty if there is no earlier snapshot.

    Raises
    ------
    InputError
        If the folder has a file that belongs to no snapshot.
    """
    if not os.path.lexists(out):
        return set()
    if not out.is_dir():
        raise InputError(out, key="folder", value="a file", allowed="a folder")

    # The list of a snapshot counts only if nobody has changed it.
    manifest = out / MANIFEST
    listed_names: set[str] = set()
    if ledger.is_own_file(manifest):
        listed_names.update(manifest.read_text(encoding="utf-8").splitlines())

    # Refuse any file, or link to a folder, that no snapshot has written.
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        is_listed = name == MANIFEST or name in listed_names
        is_of_snapshot = is_listed and ledger.is_own_file(path)
        is_plain_folder = path.is_dir() and not path.is_symlink()
        is_ledger = path.name == ledger.LEDGER
        if not (is_of_snapshot or is_ledger or is_plain_folder):
            raise InputError(
                out,
                key="content",
                value=name,
                allowed="a new folder, or an earlier snapshot and no other file",
            )
    return {name for name in listed_names if (out / name).is_file()}


def _format_manifest(names: Iterable[str]) -> bytes:
    """Write sorted names, one on each line."""
    return "".join(f"{name}\n" for name in sorted(names)).encode()


def _write(path: Path, content: bytes) -> None:
    """Write bytes unchanged, so that a copy keeps the record of its original."""
    write_listed_file(path, lambda handle: handle.write(content))


def main() -> None:
    """Make the snapshot that the command line asks for, and print its files."""
    parser = argparse.ArgumentParser(
        prog="python -m research.snapshot", description=__doc__
    )
    parser.add_argument("results", help="folder of the finished study")
    parser.add_argument(
        "--out", required=True, help="folder of the snapshot, as results/published/mine"
    )
    args = parser.parse_args()
    try:
        print(*copy_study(args.results, args.out), sep="\n")
    except (InputError, OSError) as error:
        print_fault(error)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
