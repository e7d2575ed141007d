"""Many wrong inputs in one test, with all that are not refused as they should be in one message."""

import re
from collections.abc import Callable, Iterable
from typing import Any


def not_refused(call: Callable[[Any], object], cases: Iterable[tuple[Any, str]], error: type[Exception]) -> list[str]:
    """Of (case, pattern of the message), those that `call(case)` takes, or refuses with another message."""
    found = []
    for case, words in cases:
        try:
            call(case)
        except error as raised:
            if not re.search(words, str(raised)):
                found.append(f"{case}: {raised}; wanted: {words}")
        else:
            found.append(f"{case}: no {error.__name__}; wanted: {words}")
    return found
