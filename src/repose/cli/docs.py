"""The subcommand that shows the documentation, whose pages are part of the program."""

import argparse
import sys
from pathlib import Path

from repose.cli.registry import PROGRAM, Option, subcommand
from repose.common import places
from repose.common.errors import InputError, did_you_mean

# Pages that only the site needs: its first page, and its list of modules.
HIDDEN_PAGES = ("docs", "reference")


@subcommand(
    Option(
        "name", nargs="?", help="name of the page; without it, all pages are listed"
    ),
    config=False,
)
def docs(args: argparse.Namespace) -> None:
    """Print a page of the documentation; without a name, list the pages.

    Examples
    --------
    $ repose docs photographs
    """
    known = find_pages()

    # List the pages, with the names in a column.
    if args.name is None:
        width = max(len(name) for name in known)
        for name, path in known.items():
            print(f"{name:{width}}  {read_title(path)}")
        return

    if args.name not in known:
        raise InputError(
            "command line",
            key="docs",
            value=args.name,
            allowed=f"a page that `{PROGRAM} docs` lists{did_you_mean(args.name, known)}",
        )
    text = known[args.name].read_text(encoding="utf-8")
    if sys.stdout.isatty():
        _show_in_pager(text)
    else:
        print(text, end="")


def _show_in_pager(text: str) -> None:
    """Show a page in Markdown on a terminal, with its headings and emphasis."""
    from rich.console import Console
    from rich.markdown import Markdown

    console = Console()
    with console.pager(styles=True):
        console.print(Markdown(text))


def find_pages() -> dict[str, Path]:
    """Find the pages of the documentation.

    Returns
    -------
    dict of str to Path
        The path of each page by its name, in alphabetical order. The index page of a
        folder is named after the folder. All other pages have different names, although
        some are in folders.
    """
    folder = places.find_program_folder() / "docs"
    paths = {}
    # A folder whose name begins with an underscore has no pages for readers.
    for path in (*folder.glob("*.md"), *folder.glob("[!_]*/*.md")):
        name = path.parent.name if path.stem == "index" else path.stem
        paths[name] = path
    # These two pages are not in the folder docs. The library is `repose.dem`.
    paths["configuration"] = places.find_program_folder() / "config" / "README.md"
    paths["library"] = places.PACKAGE / "dem" / "README.md"
    return {name: paths[name] for name in sorted(paths) if name not in HIDDEN_PAGES}


def read_title(path: Path) -> str:
    """Return the first heading of a page; an empty string if it has none."""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            return line.removeprefix("# ")
    return ""
