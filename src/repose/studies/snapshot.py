"""A snapshot of a finished study: its tables and pictures without the pours themselves."""

import os
from pathlib import Path

from repose.core import ledger, provenance
from repose.core.attached import SIDECAR
from repose.core.errors import InputError
from repose.core.ledger import write_whole

# Files that are kept, by folder of the results; logs, timings and positions of single pours stay behind.
KEPT = {
    ".": ("*.csv", "dataset_summary.json", "config.json", "report.html", "card.json"),
    "berry": ("*.csv", "*.json"),
    "design": ("*.csv",),
    "network": ("*.csv", "*.json"),
    "miga": ("*.csv", "*.json"),
    "validation": ("*.csv",),
    "measure": ("*.json", "*.png"),
    "measurement_study": ("noise.csv", "correlation.csv", "pour_correlation.csv", "bias.csv"),
    "figures": ("*.png",),
    "film": ("*.gif",),
    "shape": ("*.csv", "*.json", "*.png"),
    "drum": ("*.csv", "*.gif"),
    "responses/with_benches": ("*.csv", "*.json", "*.png"),
    "refined": ("*.csv", "*.json", "*.png", "round_*/round.csv", "round_*/network/metrics.json"),
    "response_surface": ("*.png", "*/*.csv", "*/*.json"),
    "sequential": ("*.csv", "*.json", "*.png", "*/*.csv", "*/*.json"),
    "noise": ("*.csv", "*.json", "*.png"),
    "posterior": ("posterior.csv", "discrepancy.csv", "region.csv", "*.json", "*.png"),
    "sensitivity": ("*.csv", "*.png"),
    "responses": ("*.csv", "*.json", "*.png"),
    "pool": ("*.csv", "*.json"),
    "comparison": ("*.csv", "*.json", "*.png"),
}
# Folders that every study fills: the workflow makes them before a snapshot. The others are those of optional studies.
CHAIN = (
    ".",
    "berry",
    "design",
    "network",
    "miga",
    "validation",
    "measure",
    "figures",
    "film",
    "drum",
    "posterior",
)
LARGEST_FILE = 5_000_000  # bytes


MANIFEST = "snapshot.txt"  # in a snapshot: its files, one a line


def take(results_dir: str | Path, out: str | Path) -> list[Path]:
    """Copy tables and pictures of a study to a folder of its own, where they replace an earlier snapshot."""
    source, out = Path(results_dir), Path(out)
    files = _kept(source, KEPT)
    sidecars = (path.with_name(f"{path.name}{SIDECAR}") for path in files)
    files = list(dict.fromkeys([*files, *(path for path in sidecars if path.is_file())]))
    if not (source / "validation" / "table4.csv").is_file():
        raise InputError(source, "validation/table4.csv", "missing", "a finished study")
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


def of_optional_studies(results_dir: str | Path) -> str:
    """Hash of the optional studies' files in a snapshot, 16 hexadecimal digits."""
    source = Path(results_dir)
    files = _kept(source, (folder for folder in KEPT if folder not in CHAIN))
    return provenance.hash_of(
        {str(path.relative_to(source)): provenance.hash_of_file(path) for path in files}
    )


def _kept(source, folders):
    """Files of some folders of a study that a snapshot keeps; the records beside them follow their files."""
    return [
        path
        for folder in folders
        for pattern in KEPT[folder]
        for path in sorted((source / folder).glob(pattern))
        if not path.name.endswith(SIDECAR)
    ]


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
