"""Copy the tables and pictures of a finished study, without its runs, as results/published keeps them."""

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

# Folders of a study; those of `research` and of its strategies are among them.
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
# whose results have the names of the method
OWN = {*FOLDERS, *strategies.names()} - {"published"}
# tables and pictures, without positions and meshes
SUFFIXES = (
    ".csv",
    ".json",
    ".png",
    ".gif",
    ".html",
)
LARGEST_FILE = 5_000_000  # bytes
# what a study begins and ends with
CONFIG = "config.json"
CARD = "card.json"
# runs of the drum, and the check of a configuration; records follow their results
OTHERS = re.compile(r"drum_\d+\.json|.*\.provenance\.json|checked\.json")
MANIFEST = "snapshot.txt"  # in a snapshot: its files, one a line


def take(results_dir: str | Path, out: str | Path) -> list[Path]:
    """Copy the tables and pictures of a finished study to `out`, in place of an earlier snapshot, and return them."""
    source = Path(results_dir)
    out = Path(out)
    files = _kept(source)
    sidecars = (path.with_name(f"{path.name}{SIDECAR_SUFFIX}") for path in files)
    files = list(
        dict.fromkeys([*files, *(path for path in sidecars if path.is_file())])
    )
    if not (source / CARD).is_file():
        raise InputError(source, CARD, "missing", "a finished study")
    for path in files:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(
                path, "size", path.stat().st_size, f"at most {LARGEST_FILE} bytes"
            )
    earlier = _earlier(out)
    names = [path.relative_to(source).as_posix() for path in files]
    _write(out / MANIFEST, _lines({*names, *earlier}))
    for path, name in zip(files, names, strict=True):
        _write(out / name, path.read_bytes())
    for name in earlier - set(names):
        ledger.remove_own_file(out / name)
    _write(out / MANIFEST, _lines(names))
    return [out / name for name in names]


def _kept(source: Path) -> list[Path]:
    """List the files of a study's own folders: no runs, and none of another study in a folder below."""
    left_out = {name_run_folder(name) for name in bench_tests()}
    found = []
    for folder, below, names in os.walk(source):
        known = set(below) if Path(folder) != source else OWN.intersection(below)
        below[:] = sorted(
            name
            for name in known
            if name not in left_out and not Path(folder, name, CONFIG).is_file()
        )
        found += [Path(folder, name) for name in names if Path(name).suffix in SUFFIXES]
    return sorted(path for path in found if not OTHERS.fullmatch(path.name))


def _earlier(out: Path) -> set[str]:
    """List the files of an earlier snapshot in a folder; InputError where the folder holds anything else."""
    if not os.path.lexists(out):
        return set()
    if not out.is_dir():
        raise InputError(out, "folder", "a file", "a folder")
    manifest = out / MANIFEST
    names = (
        set(manifest.read_text(encoding="utf-8").splitlines())
        if ledger.is_own_file(manifest)
        else set()
    )
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        is_ours = name in {*names, MANIFEST} and ledger.is_own_file(path)
        if (
            not is_ours
            and path.name != ledger.LEDGER
            and (path.is_symlink() or not path.is_dir())
        ):
            allowed = "a new folder, or an earlier snapshot and no other file"
            raise InputError(out, "content", name, allowed)
    return {name for name in names if (out / name).is_file()}


def _lines(names: Iterable[str]) -> bytes:
    """Write sorted names, one a line."""
    return "".join(f"{name}\n" for name in sorted(names)).encode()


def _write(path: Path, content: bytes) -> None:
    """Write bytes as they are: a copy keeps the record of its original, and gets none of its own."""
    write_listed_file(path, lambda handle: handle.write(content))


def main() -> None:
    """Take the snapshot that the command line asks for, and print its files."""
    parser = argparse.ArgumentParser(
        prog="python -m research.snapshot", description=__doc__
    )
    parser.add_argument("results", help="folder of the finished study")
    parser.add_argument(
        "--out", required=True, help="folder of the snapshot, as results/published/mine"
    )
    args = parser.parse_args()
    try:
        print(*take(args.results, args.out), sep="\n")
    except (InputError, OSError) as error:
        print_fault(error)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
