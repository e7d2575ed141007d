"""The exceptions: faults of a user's input, and a pile without an angle."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from repose.dem.errors import MOST_SHOWN, shown
from repose.dem.errors import InputError as InputError
from repose.dem.errors import did_you_mean as did_you_mean

BAD_INPUT = 2  # exit status of a verb and of the workflow for a fault of the input

MOST_REPORTED = 30  # or a file of another program would be reported key by key


class YamlError(InputError):
    """A fault of a file in YAML: null, true and false are printed as they are written there."""

    def __init__(self, source: object, key: str, value: object, allowed: str) -> None:
        super().__init__(source, key, value, allowed)
        name = key if key.isprintable() else repr(key)
        self.args = (f"{source}: {name} is {_in_yaml(value)}; expected {self.allowed}",)


class InputErrors(InputError):
    """Several faults at once, one a line; `source`, `key`, `value` and `allowed` are those of the first."""

    def __init__(self, faults: list[InputError]) -> None:
        self.faults, first = faults, faults[0]
        super().__init__(first.source, first.key, first.value, first.allowed)
        lines = [str(fault) for fault in faults[:MOST_REPORTED]]
        if len(faults) > MOST_REPORTED:
            lines.append(
                f"{faults[MOST_REPORTED].source}: {len(faults) - MOST_REPORTED} more faults"
            )
        self.args = ("\n".join(lines),)


class NoFlankError(ValueError):
    """The picture or the pile has no flank to measure, for this `reason`."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


def require(
    holds: object, source: object, key: str, value: object, allowed: str
) -> None:
    """Raise InputError, as it takes them, unless something holds."""
    if not holds:
        raise InputError(source, key, value, allowed)


def require_flank(holds: object, reason: str) -> None:
    """Raise NoFlankError with a reason unless something holds."""
    if not holds:
        raise NoFlankError(reason)


def raise_together(faults: Iterable[InputError]) -> None:
    """Raise all faults, each once: a single one as itself, several as `InputErrors`; without faults do nothing."""
    distinct = list({str(fault): fault for fault in faults}.values())
    if distinct:
        raise distinct[0] if len(distinct) == 1 else InputErrors(distinct)


def print_fault(fault: object) -> None:
    """Print a fault of the input, an exception or its text, on stderr; one line for each fault."""
    for line in str(fault).splitlines():
        safe = "".join(
            one if one.isprintable() else repr(one)[1:-1] for one in line
        )  # no escape code of a file
        print(f"repose: error: {safe}", file=sys.stderr, flush=True)


@contextmanager
def one_message() -> Iterator[None]:
    """End the program with one message, and as the verbs do, at a fault of the input."""
    try:
        yield
    except (InputError, OSError) as error:
        print_fault(error)
        sys.exit(BAD_INPUT)


def _in_yaml(value: object) -> str:
    """Write a value as YAML has it, texts in quotes."""
    if isinstance(value, list) and not any(
        isinstance(item, list | dict) for item in value
    ):
        text = f"[{', '.join(map(_in_yaml, value[:MOST_SHOWN]))}]"
        return text if len(text) <= MOST_SHOWN else shown(value)
    words = ("null", None), ("true", True), ("false", False)
    return next((word for word, constant in words if constant is value), shown(value))
