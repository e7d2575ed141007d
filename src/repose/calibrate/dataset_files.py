"""Read the summary of a dataset, which has the definitions of its responses."""

from pathlib import Path
from typing import Any

from repose.calibrate.responses import Definitions
from repose.common.files import StrPath, read_json

SUMMARY_SUFFIX = "_summary.json"  # follows the stem of a dataset's name


def read_summary(dataset_csv: StrPath) -> tuple[dict[str, Any], Path]:
    """Read the summary next to a dataset, and return it with its path.

    The summary is empty if the file does not exist.
    """
    path = Path(dataset_csv)
    path = path.with_name(f"{path.stem}{SUMMARY_SUFFIX}")
    if not path.is_file():
        return {}, path
    return read_json(path, what="the summary of a dataset"), path


def read_definitions(dataset_csv: StrPath) -> tuple[Definitions, Path]:
    """Read the definitions of the responses of a dataset from its summary.

    Return the definitions, which are empty if unknown, and the path of the summary.
    """
    summary, path = read_summary(dataset_csv)
    return summary.get("definitions", {}), path
