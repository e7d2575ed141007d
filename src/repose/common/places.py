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
        The first file is the method. If the working folder has a file
        `config/config.yaml`, the built-in crop is the second file, and this file is the
        third. Otherwise the second file is `config.yaml` of the working folder if there
        is one, or else the built-in crop.
    """
    method = find_file(METHOD_CONFIG)
    built_in_crop = find_program_folder() / DEFAULT_CONFIG

    # If the working folder has the same folders as the project, its file changes single
    # values of the built-in crop.
    users_config = Path(DEFAULT_CONFIG)
    if users_config.is_file():
        # In a checkout of the project both are the same file, which is listed once.
        if users_config.resolve() == built_in_crop.resolve():
            return [method, users_config]
        return [method, built_in_crop, users_config]

    # If the working folder is that of another crop, its file replaces the built-in crop.
    users_crop = Path("config.yaml")
    crop = users_crop if users_crop.is_file() else built_in_crop
    return [method, crop]
