"""The text of a deck with places for values."""

import string
from pathlib import Path


class _Text(string.Template):
    """A text in which @{name} stands for a value: $ and braces have a meaning in the decks themselves."""

    delimiter = "@"


def filled(name: str, **values: object) -> str:
    """The template `name` of this folder with its places filled; a number is written with nine digits."""
    text = Path(__file__).with_name(name).read_text(encoding="utf-8")
    words = {key: f"{value:.9g}" if isinstance(value, float) else value for key, value in values.items()}
    return _Text(text).substitute(words)
