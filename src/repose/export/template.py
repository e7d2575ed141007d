"""Make the template of a deck: names in double braces in place of its parameters.

The section `simulator` of a study reads such a template (docs/simulators.md). To find the
numbers of a deck that depend on a parameter, the deck is written again with another value
of this parameter.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from repose.common.errors import InputError
from repose.common.files import StrPath, write_text
from repose.export import PROGRAMS, check_laws
from repose.export.job import Job

# A number that is not a part of a word.
NUMBER = re.compile(r"((?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))")
# Ratio of the second value of a parameter to its first value.
CHANGE_FACTOR = 0.5
# Largest relative difference of numbers that are considered equal. Numbers in decks have
# at least eight digits.
ROUNDING = 1e-6
TEMPLATE_SUFFIX = ".j2"

JobFunction = Callable[[Mapping[str, float]], Job]
"""Function that makes the job for a mapping of parameters."""


def write_template(
    make_job: JobFunction,
    parameters: Mapping[str, float],
    *,
    names: Sequence[str],
    program: str,
    folder: StrPath,
) -> list[Path]:
    """Write the files of a deck, with a template in place of the main file.

    Parameters
    ----------
    make_job : callable
        Makes the `Job` for a mapping of parameters. It is called with `parameters`, and
        then for each of `names` with another value of this parameter.
    parameters : mapping
        Values of the parameters by name.
    names : sequence of str
        The parameters whose names replace their numbers.
    program : str
        One of `repose.export.PROGRAMS`.
    folder : path
        Folder for the files.

    Returns
    -------
    list of Path
        The written files, the template first.

    Raises
    ------
    InputError
        If a parameter is unknown, or if no number of the deck is in proportion to it.
    """
    for name in names:
        if name not in parameters:
            raise InputError(
                "command line",
                key="--names",
                value=name,
                allowed=f"some of {', '.join(parameters)}",
            )
    job = make_job(parameters)
    check_laws(job, program)

    # Only the main file becomes a template. It is the first file of the deck.
    make_deck = PROGRAMS[program]
    files = make_deck(job)
    main_name = next(iter(files))

    def write_main_file(values: Mapping[str, float]) -> str:
        """Write the text of the main file with other values of the parameters."""
        return make_deck(make_job(values))[main_name]

    template = make_template(write_main_file, parameters, names)
    texts = {f"{main_name}{TEMPLATE_SUFFIX}": template}
    texts |= {name: text for name, text in files.items() if name != main_name}

    # Write the files.
    paths = []
    for name, text in texts.items():
        path = Path(folder) / name
        write_text(path, text)
        paths.append(path)
    return paths


def make_template(
    render: Callable[[Mapping[str, float]], str],
    parameters: Mapping[str, float],
    names: Sequence[str],
) -> str:
    """Replace the numbers of a text that are in proportion to a parameter by its name.

    To find these numbers, the text is written again for each parameter, with another
    value of this parameter. The numbers that change depend on the parameter.

    Parameters
    ----------
    render : callable
        Writes the text for a mapping of parameters.
    parameters : mapping
        Values of the parameters by name.
    names : sequence of str
        The parameters whose names replace their numbers.

    Returns
    -------
    str
        The template. A number that is twice `mus_gg` becomes ``{{ 2 * mus_gg }}``.

    Raises
    ------
    InputError
        If a parameter changes no number, or a number that is not in proportion to it.
    """
    # Words and numbers alternate. Even entries are words, and odd entries are numbers.
    parts = NUMBER.split(render(parameters))
    template_parts = list(parts)
    for name in names:
        value = parameters[name]
        changed_parts = NUMBER.split(
            render({**parameters, name: CHANGE_FACTOR * value})
        )
        positions = _find_changed_positions(parts, changed_parts)
        if not positions:
            raise _make_proportion_error(name)

        # Replace each number that has changed, if it is in proportion to the parameter and
        # no other parameter has replaced it.
        for position in positions:
            is_number = position % 2 == 1
            is_replaced = template_parts[position] != parts[position]
            if not is_number or is_replaced:
                raise _make_proportion_error(name)
            number = float(parts[position])
            changed_number = float(changed_parts[position])
            if not _are_equal(changed_number, CHANGE_FACTOR * number):
                raise _make_proportion_error(name)
            template_parts[position] = _write_in_braces(name, number / value)
    return "".join(template_parts)


def _find_changed_positions(
    parts: Sequence[str], changed_parts: Sequence[str]
) -> list[int]:
    """Find the positions at which two split texts differ.

    Parameters
    ----------
    parts, changed_parts : sequence of str
        The words and numbers of the two texts.

    Returns
    -------
    list of int
        Empty if the texts are equal, or if they cannot be compared because one of them has
        more parts.
    """
    if len(parts) != len(changed_parts):
        return []
    pairs = zip(parts, changed_parts, strict=True)
    return [position for position, (old, new) in enumerate(pairs) if old != new]


def _are_equal(first: float, second: float) -> bool:
    """Tell whether two numbers differ only by rounding."""
    return abs(first - second) <= ROUNDING * abs(second)


def _write_in_braces(name: str, factor: float) -> str:
    """Write a parameter in double braces, with its factor unless this is 1."""
    if _are_equal(factor, 1.0):
        return f"{{{{ {name} }}}}"
    return f"{{{{ {factor:.7g} * {name} }}}}"


def _make_proportion_error(name: str) -> InputError:
    """Make the error for a parameter without a number in proportion to it."""
    return InputError(
        "command line",
        key="--names",
        value=name,
        allowed="parameters to which numbers of the deck are in proportion, such as coefficients "
        "of friction; give others by --set",
    )
