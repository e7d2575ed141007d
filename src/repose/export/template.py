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
            allowed = f"some of {', '.join(parameters)}"
            raise InputError("command line", key="--names", value=name, allowed=allowed)
    job = make_job(parameters)
    check_laws(job, program)
    # The first file is the main file. Only this file becomes a template.
    files = PROGRAMS[program](job)
    deck_name = next(iter(files))

    def write_deck(values: Mapping[str, float]) -> str:
        """Write the text of the deck with other values of the parameters."""
        return PROGRAMS[program](make_job(values))[deck_name]

    files[deck_name] = make_template(write_deck, parameters, names)
    paths = []
    for name, text in files.items():
        path = Path(folder) / (
            f"{name}{TEMPLATE_SUFFIX}" if name == deck_name else name
        )
        write_text(path, text)
        paths.append(path)
    return paths


def make_template(
    render: Callable[[Mapping[str, float]], str],
    parameters: Mapping[str, float],
    names: Sequence[str],
) -> str:
    """Replace the numbers of a text that are in proportion to a parameter by its name.

    The text is written again with another value of each parameter. The numbers that
    change depend on this parameter.

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
    template = list(parts)
    for name in names:
        value = parameters[name]
        changed_parts = NUMBER.split(
            render({**parameters, name: CHANGE_FACTOR * value})
        )
        if len(changed_parts) != len(parts):
            raise _make_proportion_error(name)
        changed = [k for k, part in enumerate(parts) if part != changed_parts[k]]
        if not changed:
            raise _make_proportion_error(name)
        for k in changed:
            # Only a number that no other parameter has replaced may be replaced.
            is_free_number = k % 2 == 1 and template[k] == parts[k]
            if not is_free_number:
                raise _make_proportion_error(name)
            number = float(parts[k])
            if not _are_equal(float(changed_parts[k]), CHANGE_FACTOR * number):
                raise _make_proportion_error(name)
            template[k] = _write_in_braces(name, number / value)
    return "".join(template)


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
    words = (
        "parameters to which numbers of the deck are in proportion, such as coefficients "
        "of friction; give others by --set"
    )
    return InputError("command line", key="--names", value=name, allowed=words)
