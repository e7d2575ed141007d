"""Store the result of a configuration's check, so that later runs need not repeat it.

Snakemake reads the Snakefile for each of its commands. The first command checks the
configuration with its grain and the files that it names, and computes each `auto`. A run
keeps the result in RESULTS/checked.json, with a hash of all that it follows from, so that
the next command need not check it again.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repose.common import ledger
from repose.common.errors import InputError
from repose.common.files import read_json, write_json
from repose.common.keys import Config, get_value
from repose.common.provenance import hash_content, hash_file
from repose.common.source_code import code_hash
from repose.config.models import list_file_keys
from repose.stages.published import find_sibling_table, list_tables

FILE_NAME = "checked.json"
# Rooms whose code checks a configuration or computes a number of it.
CHECKING_PACKAGES = (
    "common",
    "config",
    "stages",
    "bench",
    "measure",
    "calibrate",
    "grain",
    "dem",
)


def compute_fingerprint(config: Config) -> str:
    """Hash a configuration as its files have it, the files that it names, and the code."""
    contents = {}
    for path in _list_named_paths(config):
        if path is not None and Path(path).is_file():
            contents[str(path)] = hash_file(path)
    code = code_hash(*CHECKING_PACKAGES, follow_imports=False)
    return hash_content({"config": config, "files": contents, "code": code})


def _list_named_paths(config: Config) -> list[Any]:
    """List the paths of all files that a check of the configuration reads.

    Parameters
    ----------
    config : mapping
        The configuration, which was not checked. It may have no value, or a value of any
        type, where a path belongs.

    Returns
    -------
    list
        Texts and paths, and whatever else stands in place of a path.
    """
    # Keys that name a file, and the tables in the folder of published results.
    paths = [get_value(config, key) for key in list_file_keys()]
    published = get_value(config, "validation.published")
    if isinstance(published, str):
        paths += [*list_tables(published), find_sibling_table(published, "table1.csv")]

    # A target may name a file with a measured profile.
    targets = config.get("targets")
    if isinstance(targets, list):
        for target in targets:
            if isinstance(target, Mapping):
                paths.append(target.get("file"))
    return paths


def read_checked_config(config: Config, fingerprint: str) -> dict[str, Any] | None:
    """Read what an earlier run made of the same configuration.

    Parameters
    ----------
    config : mapping
        The configuration as its files have it.
    fingerprint : str
        Its `compute_fingerprint`.

    Returns
    -------
    dict or None
        The complete configuration, with a number in place of each `auto`, or None if
        this configuration was not yet checked.
    """
    folder = config.get("results_dir")
    if not isinstance(folder, str):
        return None

    # Trust only a file that this program wrote and nobody changed.
    path = Path(folder) / FILE_NAME
    if not (path.is_file() and ledger.is_own_file(path)):
        return None
    try:
        content = read_json(path, {"fingerprint": str, "config": dict})
    except InputError:
        return None
    return content["config"] if content["fingerprint"] == fingerprint else None


def write_checked_config(fingerprint: str, config: Config) -> None:
    """Keep a checked configuration for later commands.

    Parameters
    ----------
    fingerprint : str
        The `compute_fingerprint` of the configuration as its files have it.
    config : mapping
        The same, complete, with a number in place of each `auto`.
    """
    path = Path(config["results_dir"]) / FILE_NAME
    write_json(path, {"fingerprint": fingerprint, "config": config})
