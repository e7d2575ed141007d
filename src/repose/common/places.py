"""Find the files of the program that are not Python.

These are the workflow, the default configurations, measured and published tables.
"""

import os
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
METHOD_CONFIG = "config/method.yaml"
DEFAULT_CONFIG = "config/config.yaml"


def root() -> Path:
    """Find the folder with Snakefile, workflow, config, profiles and resources.

    It is `repose/data` of an installation, or the checkout.
    """
    installed = PACKAGE / "data"
    return installed if installed.is_dir() else PACKAGE.parents[1]


def find(path: str | os.PathLike) -> Path:
    """Return a path, or the program's own file or folder of this name.

    The program's own is taken only if there is none in the working folder.
    """
    path = Path(path)
    of_program = root() / path
    if not path.exists() and of_program.exists():
        return of_program
    return path


def configs() -> list[Path]:
    """List the default configurations; each overrides the one before it.

    Returns
    -------
    list of Path
        The first is the method. It is followed by the crop of the working folder, or by
        the built-in crop if the folder has none. A file `config/config.yaml` in the
        working folder overrides the built-in crop.
    """
    method = find(METHOD_CONFIG)
    built_in_crop = root() / DEFAULT_CONFIG

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
