"""A snapshot of a finished study: its tables and pictures without the pours themselves."""

import shutil
from pathlib import Path

from repose.core.errors import InputError

# What is kept, by folder of the results; logs, timings and positions of single pours stay behind.
KEPT = {
    ".": ("*.csv", "dataset_summary.json", "config.json"),
    "berry": ("*.csv", "*.json"),
    "design": ("*.csv",),
    "network": ("*.csv", "*.json"),
    "miga": ("*.csv", "*.json"),
    "validation": ("*.csv",),
    "measure": ("*.json", "*.png"),
    "measurement_study": ("noise.csv", "correlation.csv", "bias.csv"),
    "figures": ("*.png",),
    "film": ("*.gif",),
    "shape": ("*.csv", "*.json", "*.png"),
    "drum": ("*.csv", "*.gif"),
    "responses/with_drum": ("*.csv", "*.json", "*.png"),
    "refined": ("*.csv", "*.json", "*.png", "round_*/round.csv", "round_*/network/metrics.json"),
    "noise": ("*.csv", "*.json", "*.png"),
    "posterior": ("posterior.csv", "*.json", "*.png"),
    "sensitivity": ("*.csv", "*.png"),
    "responses": ("*.csv", "*.json", "*.png"),
    "pool": ("*.csv", "*.json"),
    "comparison": ("*.csv", "*.json", "*.png"),
}
LARGEST_FILE = 5_000_000  # bytes


def take(results_dir: str | Path, out: str | Path) -> list[Path]:
    """Copy tables and pictures of a study to a folder of its own, replacing an earlier snapshot there.

    Parameters
    ----------
    results_dir : path
        Folder of a finished study.
    out : path
        Folder of the snapshot.

    Returns
    -------
    list of Path
        The copied files.

    Raises
    ------
    InputError
        If the study is not finished, or a file is too large to be kept in a repository.
    """
    source, out = Path(results_dir), Path(out)
    files = [
        path
        for folder, patterns in KEPT.items()
        for p in patterns
        for path in sorted((source / folder).glob(p))
    ]
    if not (source / "validation" / "table4.csv").is_file():
        raise InputError(source, "validation/table4.csv", "missing", "a finished study")
    for path in files:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(path, "size", path.stat().st_size, f"at most {LARGEST_FILE} bytes")
    if out.exists():
        shutil.rmtree(out)
    copied = []
    for path in files:
        target = out / path.relative_to(source)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
        copied.append(target)
    return copied
