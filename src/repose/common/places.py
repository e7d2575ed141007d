"""Find the files of the program that are not Python code.

These are the workflow, the default configurations, and measured and published tables.
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
        The first file is always the configuration of the method. What follows depends
        on the working folder:

        - with a file `config/config.yaml`: the built-in crop, and this file;
        - with a file `config.yaml`: this file;
        - with neither of them: the built-in crop.
    """
    method = find_file(METHOD_CONFIG)
    built_in_crop = find_program_folder() / DEFAULT_CONFIG

    # A file at the same place as in the project changes single values of the built-in
    # crop.
    users_config = Path(DEFAULT_CONFIG)
    if users_config.is_file():
        # In a checkout of the project both are the same file, which is listed once.
        if users_config.resolve() == built_in_crop.resolve():
            return [method, users_config]
        return [method, built_in_crop, users_config]

    # In the folder of another crop, its file replaces the built-in crop.
    users_crop = Path("config.yaml")
    crop = users_crop if users_crop.is_file() else built_in_crop
    return [method, crop]
