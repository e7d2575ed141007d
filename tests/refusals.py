"""Wrong inputs: one alone, or many in one test, with all that are not refused as they should be in one message."""

import re
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from repose.common.errors import InputError


def input_error(
    message: str, call: Callable[..., object], *arguments: Any, **keywords: Any
) -> InputError:
    """Expect an `InputError` whose message has these words, a pattern, from a call with these arguments."""
    with pytest.raises(InputError, match=message) as caught:
        call(*arguments, **keywords)
    return caught.value


def raised(
    error: type[BaseException],
    message: str | None,
    call: Callable[..., Any],
    *given: Any,
    **more: Any,
) -> None:
    """Expect an error of this type as `input_error` does; without words whatever its message."""
    with pytest.raises(error, match=message):
        call(*given, **more)


def value_error(
    message: str, call: Callable[..., object], *arguments: Any, **keywords: Any
) -> None:
    """Expect a `ValueError` as `input_error` does."""
    raised(ValueError, message, call, *arguments, **keywords)


def not_refused(
    call: Callable[[Any], object],
    cases: Iterable[tuple[Any, str]],
    error: type[Exception],
) -> list[str]:
    """Of (case, pattern of the message), those that `call(case)` takes, or refuses with another message."""
    found = []
    for case, message in cases:
        try:
            call(case)
        except error as raised:
            if not re.search(message, str(raised)):
                found.append(f"{case}: {raised}; wanted: {message}")
        else:
            found.append(f"{case}: no {error.__name__}; wanted: {message}")
    return found
