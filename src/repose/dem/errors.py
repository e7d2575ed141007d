"""Report an error in a user's file, with a short representation of the wrong value."""

import reprlib
from collections.abc import Iterable

MOST_SHOWN = 400  # largest number of characters of a value in a message

_short = reprlib.Repr()
_short.maxlevel = 3
_short.maxdict = _short.maxlist = _short.maxtuple = _short.maxset = 20
_short.maxstring = _short.maxlong = _short.maxother = MOST_SHOWN


def shown(value: object) -> str:
    """Convert a value to a string of at most `MOST_SHOWN` characters for a message."""
    text = _short.repr(value)
    if len(text) > MOST_SHOWN:
        return f"{text[: MOST_SHOWN - 3]}..."
    return text


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return a question for a message, whether the user meant the most similar name.

    The question is empty if no name is similar to the word.
    """
    # This import is slow, and needed only if there is an error.
    from difflib import get_close_matches

    matches = get_close_matches(word, list(names), 1)
    return f"; did you mean {matches[0]}?" if matches else ""


class InputError(ValueError):
    """A file, or one entry of a file, cannot be used.

    Parameters
    ----------
    source : object
        The file, or whatever else the value comes from.
    key : str
        The entry in it.
    value : object
        The value of the entry.
    allowed : str
        Description of the accepted values. If it lists several names, and the value is
        a string, the message suggests the most similar name.
    """

    def __init__(self, source: object, key: str, value: object, allowed: str) -> None:
        """Build the message; the parameters are those of the class."""
        # If the user wrote a wrong name, suggest the most similar one. The names are
        # taken from the wording of `allowed`, see `_find_names`.
        names = _find_names(allowed)
        if isinstance(value, str) and len(names) > 1:
            allowed += did_you_mean(value, names)
        self.source = source
        self.key = key
        self.value = value
        self.allowed = allowed
        super().__init__(f"{source}: {key} is {shown(value)}; expected {allowed}")


def _find_names(allowed: str) -> list[str]:
    """Find the names in a description such as "one of a, b or c"."""
    items = allowed.removeprefix("one of ").replace(" or ", ", ").split(", ")
    return [item for item in items if item.isidentifier()]
