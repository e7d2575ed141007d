"""The verb that shows the documentation, whose pages come with the program."""

import argparse
import sys
from pathlib import Path

from repose.cli.registry import PROGRAM, Option, verb
from repose.common import places
from repose.common.errors import did_you_mean, require

NO_PAGES = ("docs", "reference")  # the site's first page, and its list of modules


@verb(
    Option("name", nargs="?", help="of the page; without it, all are listed"),
    config=False,
)
def docs(args: argparse.Namespace) -> None:
    """Print a page of the documentation; without a name, list the pages.

    example: photographs
    """
    known = pages()
    if args.name is None:
        width = max(map(len, known))
        print(
            *(f"{name:{width}}  {title_of(path)}" for name, path in known.items()),
            sep="\n",
        )
        return
    allowed = f"a page that `{PROGRAM} docs` lists{did_you_mean(args.name, known)}"
    require(args.name in known, "command line", "docs", args.name, allowed)
    text = known[args.name].read_text(encoding="utf-8")
    if not sys.stdout.isatty():
        print(text, end="")
        return
    from rich.console import Console
    from rich.markdown import Markdown

    console = Console()
    with console.pager(styles=True):
        console.print(Markdown(text))


def pages() -> dict[str, Path]:
    """Return every page by its name, in the order of their names; an index has the name of its folder."""
    found = [
        path
        for pattern in ("*.md", "[!_]*/*.md")
        for path in (places.root() / "docs").glob(pattern)
    ]
    names = {
        path.parent.name if path.stem == "index" else path.stem: path for path in found
    }
    names["configuration"] = places.root() / "config" / "README.md"
    names["library"] = places.PACKAGE / "dem" / "README.md"
    return {name: names[name] for name in sorted(names) if name not in NO_PAGES}


def title_of(path: Path) -> str:
    """Return the first heading of a page."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return next(
        (line.removeprefix("# ") for line in lines if line.startswith("# ")), ""
    )
