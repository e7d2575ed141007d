"""Make the template of an input file, in which names in braces replace parameters.

The section `simulator` of a study reads such a template (docs/simulators.md). To find
out which numbers of the file depend on a parameter, the file is written again with
another value of this parameter. All input files of a program are called its deck.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from repose.common.errors import InputError
from repose.common.files import StrPath, write_text
from repose.export import PROGRAMS, check_laws
from repose.export.job import Job

# A number that is not part of a word.
NUMBER = re.compile(r"((?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))")
# Ratio of the second value of a parameter to its first value.
CHANGE_FACTOR = 0.5
# Largest relative difference between numbers that are considered equal. The numbers in
# input files are rounded to eight or nine digits.
ROUNDING = 1e-6
TEMPLATE_SUFFIX = ".j2"

JobFunction = Callable[[Mapping[str, float]], Job]
"""Function that makes the job for given parameters."""


def write_template(
    make_job: JobFunction,
    parameters: Mapping[str, float],
    *,
    names: Sequence[str],
    program: str,
    folder: StrPath,
) -> list[Path]:
    """Write the input files of a program, with a template in place of the main file.

    In the template, names of parameters take the place of the numbers that are
    proportional to them.

    Parameters
    ----------
    make_job : callable
        Function that makes the `Job` for a mapping of parameters. It is called with
        `parameters`, and then for each of `names` with another value of this parameter.
    parameters : mapping
        Values of the parameters by name.
    names : sequence of str
        The parameters whose names appear in the template.
    program : str
        One of `repose.export.PROGRAMS`.
    folder : path
        Folder to which the files are written.

    Returns
    -------
    list of Path
        The written files, the template first.

    Raises
    ------
    InputError
        If a parameter is unknown, or if no number of the main file is proportional to
        it.
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

    # Only the main file becomes a template. Every function in `PROGRAMS` puts it first.
    make_deck = PROGRAMS[program]
    files = make_deck(job)
    main_name = next(iter(files))

    def write_main_file(values: Mapping[str, float]) -> str:
        """Write the main file for other values of the parameters."""
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
    """Make a template from a text that depends on parameters.

    A number that is proportional to a parameter is replaced by the name of the
    parameter and a factor. To find these numbers, the text is written again for each
    parameter, with another value of this parameter. The numbers that change depend on
    the parameter.

    Parameters
    ----------
    render : callable
        Function that writes the text for a mapping of parameters.
    parameters : mapping
        Values of the parameters by name.
    names : sequence of str
        The parameters whose names appear in the template. Their values are not 0.

    Returns
    -------
    str
        The template. A number that is twice `mus_gg` becomes ``{{ 2 * mus_gg }}``.

    Raises
    ------
    InputError
        If a parameter changes no number, changes a number that is not proportional to
        it, or changes the text between the numbers.
    """
    # The pattern `NUMBER` has one group, the whole number. Text and numbers therefore
    # alternate: entries with even indices are text, the others numbers.
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

        # Replace each number that has changed. It must be proportional to the
        # parameter, and no other parameter may have replaced it.
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
        The two texts, split into numbers and the text between them.

    Returns
    -------
    list of int
        The positions. The list is empty if the texts are equal, or if they cannot be
        compared because one of them has more parts.
    """
    if len(parts) != len(changed_parts):
        return []
    pairs = zip(parts, changed_parts, strict=True)
    return [position for position, (old, new) in enumerate(pairs) if old != new]


def _are_equal(first: float, second: float) -> bool:
    """Tell whether two numbers differ only by rounding."""
    return abs(first - second) <= ROUNDING * abs(second)


def _write_in_braces(name: str, factor: float) -> str:
    """Write a parameter in double braces, with its factor unless the factor is 1."""
    if _are_equal(factor, 1.0):
        return f"{{{{ {name} }}}}"
    return f"{{{{ {factor:.7g} * {name} }}}}"


def _make_proportion_error(name: str) -> InputError:
    """Make the error for a parameter to which no number is proportional."""
    return InputError(
        "command line",
        key="--names",
        value=name,
        allowed="parameters to which numbers of the deck are in proportion, such as coefficients "
        "of friction; give others by --set",
    )
