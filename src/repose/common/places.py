"""Find the files of the program that are not Python.

These are the workflow, the default configurations, measured and published tables.
"""

import os
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
METHOD_CONFIG = "config/method.yaml"
DEFAULT_CONFIG = "config/config.yaml"


def find_program_folder() -> Path:
    """Find the folder with Snakefile, workflow, config, profiles and resources.

    In an installed package this is `repose/data`. Otherwise it is the checkout.
    """
    installed = PACKAGE / "data"
    return installed if installed.is_dir() else PACKAGE.parents[1]


def find_file(path: str | os.PathLike) -> Path:
    """Return a path, or the path of the program's own file or folder of this name.

    The program's own file is used only if the given path does not exist.
    """
    path = Path(path)
    program_path = find_program_folder() / path
    if not path.exists() and program_path.exists():
        return program_path
    return path


def list_default_configs() -> list[Path]:
    """List the default configurations; each overrides the one before it.

    Returns
    -------
    list of Path
        The first file is the method. If the working folder has a file `config.yaml`,
        this file is the second. Otherwise the built-in crop is the second file, and a
        file `config/config.yaml` of the working folder is the third.
    """
    method = find_file(METHOD_CONFIG)
    built_in_crop = find_program_folder() / DEFAULT_CONFIG

    # The working folder may be laid out like the project ...
    users_config = Path(DEFAULT_CONFIG)
    if users_config.is_file():
        # In a checkout of the project both are the same file.
        if users_config.resolve() == built_in_crop.resolve():
            return [method, users_config]
        return [method, built_in_crop, users_config]

    # ... or be the folder of one crop.
    users_crop = Path("config.yaml")
    return [method, users_crop if users_crop.is_file() else built_in_crop]
