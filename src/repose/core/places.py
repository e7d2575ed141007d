"""Places of the files that are not Python: the workflow, the default configurations, measured and published tables."""

import os
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
METHOD_CONFIG = "config/method.yaml"
DEFAULT_CONFIG = "config/config.yaml"


def root() -> Path:
    """Folder that holds Snakefile, workflow, config, profiles and resources."""
    installed = PACKAGE / "data"
    return installed if installed.is_dir() else PACKAGE.parents[1]


def find(path: str | os.PathLike) -> Path:
    """A file or folder of the working folder, or else the one of the same name that comes with the program."""
    path = Path(path)
    own = root() / path
    return own if not path.exists() and own.exists() else path


def configs() -> list[Path]:
    """The default configurations; the keys of each replace those of the one before it."""
    method, default, study = find(METHOD_CONFIG), root() / DEFAULT_CONFIG, Path(DEFAULT_CONFIG)
    if study.is_file():
        return [method, study] if study.resolve() == default.resolve() else [method, default, study]
    crop = Path("config.yaml")
    return [method, crop if crop.is_file() else default]
