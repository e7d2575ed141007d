"""The reference shows every public module."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "repose"
PAGES = {path.stem: path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md")}


def public_modules():
    """Names of all modules that have a page; the kernels are compiled and say in comments what their rows hold."""
    for path in sorted(SOURCE.rglob("*.py")):
        if not path.stem.startswith("_") and not path.is_relative_to(SOURCE / "dem" / "kernels"):
            yield ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts)


def test_the_page_of_a_room_shows_each_of_its_modules():
    for room in sorted({name.split(".")[1] for name in public_modules()}):
        shown = re.findall(r"^\.\. automodule:: (\S+)$", PAGES[room], re.MULTILINE)
        assert len(set(shown)) == len(shown), room
        modules = {name for name in public_modules() if name.split(".")[1] == room}
        assert {name for name in shown if name.count(".") > 1} == modules, room
