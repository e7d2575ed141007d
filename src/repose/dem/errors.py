"""The exception for a fault in a user's file."""

import reprlib
from collections.abc import Iterable

MOST_SHOWN = 400  # characters of a value in a message

_short = reprlib.Repr()
_short.maxlevel = 3
_short.maxdict = _short.maxlist = _short.maxtuple = _short.maxset = 20
_short.maxstring = _short.maxlong = _short.maxother = MOST_SHOWN


def shown(value: object) -> str:
    """Text of a value for a message, at most `MOST_SHOWN` characters."""
    text = _short.repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Ask whether the name most like a word was meant; empty where none is like it."""
    from difflib import get_close_matches  # not by the processes that end well

    return "".join(
        f"; did you mean {name}?" for name in get_close_matches(word, list(names), 1)
    )


class InputError(ValueError):
    """A file, or an entry `key` of it, that cannot be used; the message names `value` and what is `allowed`.

    Of several allowed names the one most like a text is guessed.
    """

    def __init__(self, source: object, key: str, value: object, allowed: str) -> None:
        names = list(
            filter(
                str.isidentifier,
                allowed.removeprefix("one of ").replace(" or ", ", ").split(", "),
            )
        )
        if isinstance(value, str) and len(names) > 1:
            allowed += did_you_mean(value, names)
        self.source, self.key, self.value, self.allowed = source, key, value, allowed
        super().__init__(f"{source}: {key} is {shown(value)}; expected {allowed}")
