"""Places of the files that are not Python: the workflow, the default configurations, measured and published tables."""

import os
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
METHOD_CONFIG = "config/method.yaml"
DEFAULT_CONFIG = "config/config.yaml"


def root() -> Path:
    """Find the folder with Snakefile, workflow, config, profiles and resources: `repose/data`, or the checkout."""
    installed = PACKAGE / "data"
    return installed if installed.is_dir() else PACKAGE.parents[1]


def find(path: str | os.PathLike) -> Path:
    """Return the path if it exists, or else the program's own file or folder of this name, if there is one."""
    path = Path(path)
    own = root() / path
    return own if not path.exists() and own.exists() else path


def configs() -> list[Path]:
    """List the default configurations, each over the one before it; a crop in the working folder replaces ours."""
    method, default, study = (
        find(METHOD_CONFIG),
        root() / DEFAULT_CONFIG,
        Path(DEFAULT_CONFIG),
    )
    if study.is_file():
        return (
            [method, study]
            if study.resolve() == default.resolve()
            else [method, default, study]
        )
    crop = Path("config.yaml")
    return [method, crop if crop.is_file() else default]
