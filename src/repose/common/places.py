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
        The first file is always `config/method.yaml` of the program, with the settings
        that all crops share. What follows depends on the working folder. The built-in
        file is `config/config.yaml` of the program, the configuration of its example.

        - With a file `config/config.yaml`: the built-in file, and this file.
        - With a file `config.yaml`: this file.
        - With neither of them: the built-in file.
    """
    method_config = find_file(METHOD_CONFIG)
    built_in_config = find_program_folder() / DEFAULT_CONFIG

    # `DEFAULT_CONFIG` is a relative path, so this file is in the working folder. It
    # overrides single values of the built-in file.
    users_config = Path(DEFAULT_CONFIG)
    if users_config.is_file():
        # In a checkout of the project both are the same file, which is listed once.
        if users_config.resolve() == built_in_config.resolve():
            return [method_config, users_config]
        return [method_config, built_in_config, users_config]

    # The folder of another crop has a complete configuration, which replaces the
    # built-in file.
    crop_config = Path("config.yaml")
    if crop_config.is_file():
        return [method_config, crop_config]
    return [method_config, built_in_config]
