"""How the responses of a dataset are defined, by the summary beside its table."""

from pathlib import Path
from typing import Any

from repose.calibrate.responses import Definitions
from repose.common.files import Path_, read_json

SUMMARY = "_summary.json"  # follows the stem of a dataset's name


def read_summary(dataset_csv: Path_) -> tuple[dict[str, Any], Path]:
    """Read the summary beside a dataset; return it with its path.

    It is empty where there is none.
    """
    path = Path(dataset_csv)
    path = path.with_name(f"{path.stem}{SUMMARY}")
    if not path.is_file():
        return {}, path
    return read_json(path, what="the summary of a dataset"), path


def read_definitions(dataset_csv: Path_) -> tuple[Definitions, Path]:
    """Read how the responses of a dataset are defined; return also the summary's path.

    The definitions are empty where they are not known.
    """
    summary, path = read_summary(dataset_csv)
    return summary.get("definitions", {}), path
