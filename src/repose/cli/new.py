"""The subcommand that makes the folder of a new crop."""

import argparse
import os
from operator import methodcaller
from pathlib import Path

from repose.cli.registry import Option, subcommand
from repose.common import places
from repose.common.errors import InputError

# This text in the files of the template is replaced by the name of the crop.
NAME_PLACEHOLDER = "NAME"
TEMPLATE_FOLDER = places.PACKAGE / "config" / "new_crop"


@subcommand(
    Option("name", help="name of the crop, and of the folder that is made here"),
    config=False,
)
def new(args: argparse.Namespace) -> None:
    """Make a folder for a crop of your own.

    It contains a short configuration, a table of sizes, and a page that explains what
    to do next.

    Examples
    --------
    $ repose new wheat
    """
    _check_name(args.name)
    folder = Path(args.name)
    _copy_template(folder, crop_name=args.name)
    print(
        f"{folder}: made. {folder / 'README.md'} says what to do next; begin with "
        f"{folder / 'sizes.csv'}."
    )


def _check_name(name: str) -> None:
    """Check that the name of a new crop is allowed, and that it has no folder yet.

    Raises
    ------
    InputError
        If the label of a study may not have this form, or if there is a file or folder
        of this name.
    """
    from repose.common import faults
    from repose.config.models import make_settings_type

    # The name becomes the label of the study.
    settings_type = make_settings_type()
    if not faults.is_valid_value("label", name, settings_type):
        raise InputError(
            "command line",
            key="new",
            value=name,
            allowed=faults.describe_allowed_values("label", settings_type),
        )

    # Unlike `Path.exists`, this function also finds a broken link.
    if os.path.lexists(name):
        raise InputError(
            "command line",
            key="new",
            value=name,
            allowed="a folder that does not exist yet",
        )


def _copy_template(folder: Path, crop_name: str) -> None:
    """Copy the template into a new folder, with the name of the crop in each file."""
    from repose.common.ledger import write_atomically

    for path in sorted(TEMPLATE_FOLDER.rglob("*.*")):
        text = path.read_text(encoding="utf-8").replace(NAME_PLACEHOLDER, crop_name)
        new_path = folder / path.relative_to(TEMPLATE_FOLDER)
        new_path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(new_path, methodcaller("write", text.encode()))
