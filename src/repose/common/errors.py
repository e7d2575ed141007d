"""Define the exceptions: faults of a user's input, and a pile without an angle."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from repose.dem.errors import MOST_SHOWN, shown
from repose.dem.errors import InputError as InputError
from repose.dem.errors import did_you_mean as did_you_mean

# Exit status of a subcommand and of the workflow for a fault of the input.
BAD_INPUT = 2
# Largest number of faults that are reported one by one. A file of another program may
# have a fault in every key.
MAX_REPORTED = 30


class YamlError(InputError):
    """A fault of a YAML file, whose message shows null, true and false as in YAML."""

    def __str__(self) -> str:
        """Write the message: the file, the key, its value, and the allowed values."""
        key = self.key if self.key.isprintable() else repr(self.key)
        value = _format_yaml(self.value)
        return f"{self.source}: {key} is {value}; expected {self.allowed}"


class InputErrors(InputError):
    """Several faults at once, each on its own line of the message.

    Parameters
    ----------
    faults : list of InputError
        At least one fault. The attributes `source`, `key`, `value` and `allowed` are
        those of the first one.
    """

    def __init__(self, faults: list[InputError]) -> None:
        first = faults[0]
        super().__init__(first.source, first.key, first.value, first.allowed)
        self.faults = faults

    def __str__(self) -> str:
        """Write the messages of the first faults, and the number of the others."""
        lines = [str(fault) for fault in self.faults[:MAX_REPORTED]]
        unreported = self.faults[MAX_REPORTED:]
        if unreported:
            lines.append(f"{unreported[0].source}: {len(unreported)} more faults")
        return "\n".join(lines)


class NoFlankError(ValueError):
    """The picture or the pile has no flank to measure, for the given `reason`."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


def require_flank(condition: object, reason: str) -> None:
    """Raise a NoFlankError with this reason unless the condition is true."""
    if not condition:
        raise NoFlankError(reason)


def raise_together(faults: Iterable[InputError]) -> None:
    """Raise all faults as one exception; do nothing if there are none.

    Faults with the same message count once. A single fault is raised unchanged. Several
    faults are raised as `InputErrors`.
    """
    distinct = list({str(fault): fault for fault in faults}.values())
    if len(distinct) == 1:
        raise distinct[0]
    if distinct:
        raise InputErrors(distinct)


def print_fault(fault: object) -> None:
    """Print a fault of the input on stderr, with a prefix before each of its lines.

    Parameters
    ----------
    fault : object
        An exception or its message. An OSError that names a file is printed in the form
        of an InputError.
    """
    if isinstance(fault, OSError) and fault.filename is not None:
        fault = InputError(
            fault.filename,
            key="file",
            value=fault.strerror,
            allowed="a path that can be read or written there",
        )
    for line in str(fault).splitlines():
        # Text from a file may contain control characters, which would act on the
        # terminal. Print them as escape sequences, such as \x1b.
        characters = [
            character if character.isprintable() else repr(character)[1:-1]
            for character in line
        ]
        print(f"repose: error: {''.join(characters)}", file=sys.stderr, flush=True)


@contextmanager
def exit_on_fault() -> Iterator[None]:
    """End the program with a message if the block raises a fault of the input.

    The message and the exit status are those of a subcommand.
    """
    try:
        yield
    except (InputError, OSError) as error:
        print_fault(error)
        sys.exit(BAD_INPUT)


def _format_yaml(value: object) -> str:
    """Write a value as it would appear in a YAML file, for a message.

    Parameters
    ----------
    value : object
        Any value of a configuration.

    Returns
    -------
    str
        The value as text. Long lists, lists of lists and mappings are shortened, and
        written as in Python.
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list) and not _is_nested(value):
        # `MOST_SHOWN` is the largest number of characters. Each item has at least one,
        # so any more items would not fit anyway.
        items = [_format_yaml(item) for item in value[:MOST_SHOWN]]
        text = f"[{', '.join(items)}]"
        if len(text) <= MOST_SHOWN:
            return text
    # All other values are shown as in Python, such as text in quotes.
    return shown(value)


def _is_nested(values: list) -> bool:
    """Tell whether a list contains lists or mappings."""
    return any(isinstance(item, list | dict) for item in values)
