"""The exception that a file given by the user can cause."""

import reprlib

MOST_SHOWN = 400  # characters of a value in a message

_short = reprlib.Repr()
_short.maxlevel = 3
_short.maxdict = _short.maxlist = _short.maxtuple = _short.maxset = 20
_short.maxstring = _short.maxlong = _short.maxother = MOST_SHOWN


def shown(value: object) -> str:
    """A value as a message shows it, in at most `MOST_SHOWN` characters."""
    text = _short.repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


class InputError(ValueError):
    """A file, or an entry of it, that cannot be used.

    Parameters
    ----------
    source : str or path
        The file.
    key : str
        What is wrong in it.
    value : object
        What was found.
    allowed : str
        What is allowed there.
    """

    def __init__(self, source: object, key: str, value: object, allowed: str) -> None:
        self.source, self.key, self.value, self.allowed = source, key, value, allowed
        super().__init__(f"{source}: {key} is {shown(value)}; allowed: {allowed}")
