"""Store the result of a configuration's check, so that later runs need not repeat it.

Snakemake reads the Snakefile for each of its commands. The first command checks the
configuration, its grain and the files that it names, and computes each `auto`. A run
stores the result in RESULTS/checked.json with a hash of everything that it depends on.
If the hash is the same, the next command uses the stored result.
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
# Packages whose code checks a configuration or computes one of its numbers.
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
    """Hash a configuration, the files that it names, and the code that checks it.

    Parameters
    ----------
    config : mapping
        The merged values of the files, before the check. Each `auto` is still a string.
    """
    contents = {}
    for path in _list_input_paths(config):
        if path is not None and Path(path).is_file():
            contents[str(path)] = hash_file(path)
    code = code_hash(*CHECKING_PACKAGES, follow_imports=False)
    return hash_content({"config": config, "files": contents, "code": code})


def _list_input_paths(config: Config) -> list[Any]:
    """List the paths of all files that a check of the configuration reads.

    Parameters
    ----------
    config : mapping
        The configuration, which has not been checked.

    Returns
    -------
    list
        The values of the keys that should be paths. A value may be None or have a wrong
        type, because it has not been checked.
    """
    paths = [get_value(config, key) for key in list_file_keys()]

    # Other tables in the folder of the published solutions are also read. Its
    # table1.csv has the published sizes of grains.
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
    """Read the complete configuration that an earlier run made from the same files.

    Parameters
    ----------
    config : mapping
        The merged values of the user's files, before the check.
    fingerprint : str
        The result of `compute_fingerprint` for these values.

    Returns
    -------
    dict or None
        The complete configuration, with a number in place of each `auto`. None if these
        files were not checked before.
    """
    folder = config.get("results_dir")
    if not isinstance(folder, str):
        return None

    # Trust only a file that this program wrote and nobody changed. The ledger, which
    # lists such files with a hash of their content, tells so.
    path = Path(folder) / FILE_NAME
    if not (path.is_file() and ledger.is_own_file(path)):
        return None
    try:
        content = read_json(path, {"fingerprint": str, "config": dict})
    except InputError:
        return None
    return content["config"] if content["fingerprint"] == fingerprint else None


def write_checked_config(fingerprint: str, config: Config) -> None:
    """Store a checked configuration for later commands.

    Parameters
    ----------
    fingerprint : str
        The result of `compute_fingerprint` for the values of the files.
    config : mapping
        The complete configuration, with a number in place of each `auto`.
    """
    path = Path(config["results_dir"]) / FILE_NAME
    write_json(path, {"fingerprint": fingerprint, "config": config})
