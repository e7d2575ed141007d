"""The subcommand that makes the folder of a new crop."""

import argparse
from operator import methodcaller
from pathlib import Path

from repose.cli.registry import Option, subcommand
from repose.common.errors import InputError

# This text in the files of the template is replaced by the name of the crop.
NAME_PLACEHOLDER = "NAME"


@subcommand(
    Option("name", help="of the crop, and of the folder that is made here"),
    config=False,
)
def new(args: argparse.Namespace) -> None:
    """Make a folder for a crop of your own.

    It holds a short configuration, a table of sizes, and a text that says what to do
    next.

    Examples
    --------
    $ repose new wheat
    """
    from repose.common import faults
    from repose.common.ledger import write_atomically
    from repose.config.models import make_settings_type

    # Check the name. It also becomes the label of the study.
    model = make_settings_type()
    if not faults.is_valid_value("label", args.name, model):
        raise InputError(
            "command line",
            key="new",
            value=args.name,
            allowed=faults.describe_allowed_values("label", model),
        )

    # Refuse a path that exists already, also if it is a broken link.
    folder = Path(args.name)
    if folder.exists() or folder.is_symlink():
        raise InputError(
            "command line",
            key="new",
            value=args.name,
            allowed="a folder that is not there yet",
        )

    # Copy the template, and put the name of the crop into each file.
    template = Path(__file__).parents[1] / "config" / "new_crop"
    for path in sorted(template.rglob("*.*")):
        text = path.read_text(encoding="utf-8").replace(NAME_PLACEHOLDER, args.name)
        new_path = folder / path.relative_to(template)
        new_path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(new_path, methodcaller("write", text.encode()))

    print(
        f"{folder}: made. What to do next is in {folder / 'README.md'}; begin with "
        f"{folder / 'sizes.csv'}."
    )
