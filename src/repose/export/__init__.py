"""Write the calibrated grain and its pour as input for other simulation programs.

The module `job` collects the data of an export in SI units, independently of any
program. For each program, one module writes the input files, which together are called
a deck. Most decks are written from a template in this folder. The head of a deck lists
the differences between the program and this engine.
"""

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from repose.common.errors import InputError
from repose.common.files import write_text
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

if TYPE_CHECKING:
    from repose.export.job import Job

__all__ = ["PROGRAMS", "write_deck"]

DeckFunction = Callable[["Job"], dict[str, str]]
"""Function that returns the contents of a deck's files by name, the main file first."""


def _import_deck_when_called(module: str) -> DeckFunction:
    """Return a function that imports a module of this package and calls its `make_deck`.

    The module is imported only in the call, so that making the table of programs
    imports none of them.
    """

    def make_deck(job: "Job") -> dict[str, str]:
        """Make the files of the deck by name."""
        files: dict[str, str] = import_module(f".{module}", __name__).make_deck(job)
        return files

    return make_deck


PROGRAMS = {
    name: _import_deck_when_called(name)
    for name in ("liggghts", "lammps", "yade", "edem")
}
# Laws that every program has. An export refuses a law that is in neither list of a
# program.
CONTACT_LAWS_OF_ALL = ("hertz_mindlin", "hertz_mindlin_rescaled")
ROLLING_LAWS_OF_ALL = ("budget",)
# Laws that only some programs have.
OTHER_LAWS = {
    "liggghts": ("sjkr", "constant_torque", "epsd", "epsd2"),
    "lammps": ("epsd", "epsd2"),
    "yade": (),
    "edem": ("jkr",),
}
# Reasons why a program's law of the same name cannot be used.
REASONS = {
    ("lammps", "jkr"): "its damping coeff_restitution refuses cohesion; its other "
    "dampings are not the study's"
}


def check_laws(job: "Job", program: str) -> None:
    """Raise InputError if a program has no equivalent of one of the study's laws."""
    _check_law(
        "contact_law",
        job.simulation.contact_law,
        program=program,
        allowed=_list_laws(program, CONTACT_LAWS, CONTACT_LAWS_OF_ALL),
    )
    _check_law(
        "rolling_law",
        job.simulation.rolling_law,
        program=program,
        allowed=_list_laws(program, ROLLING_LAWS, ROLLING_LAWS_OF_ALL),
    )


def _list_laws(
    program: str, engine_laws: Iterable[str], laws_of_all: Sequence[str]
) -> list[str]:
    """List the laws that a program has, under the names of this engine.

    Parameters
    ----------
    program : str
        One of `PROGRAMS`.
    engine_laws : iterable of str
        All contact laws of the engine, or all its rolling laws.
    laws_of_all : sequence of str
        Those of them that every program has; they come first in the result.

    Returns
    -------
    list of str
        The names of the laws.
    """
    other_laws = [name for name in engine_laws if name in OTHER_LAWS[program]]
    return [*laws_of_all, *other_laws]


def _check_law(key: str, law: str, program: str, allowed: Sequence[str]) -> None:
    """Raise InputError for a law of the study that a program does not have.

    Parameters
    ----------
    key : str
        The key of the law in the section `simulation`.
    law : str
        The law of the study.
    program : str
        One of `PROGRAMS`.
    allowed : sequence of str
        The laws that the program has.
    """
    if law in allowed:
        return
    expected = f"for {program} {' or '.join(allowed)}"
    if (program, law) in REASONS:
        expected += f" ({REASONS[program, law]})"
    raise InputError(
        "configuration", key=f"simulation.{key}", value=law, allowed=expected
    )


def write_deck(job: "Job", program: str, folder: str | PathLike) -> list[Path]:
    """Write the deck of another program, that is, all its input files, into a folder.

    Parameters
    ----------
    job : Job
        The calibrated grain and its pour.
    program : str
        One of `PROGRAMS`.
    folder : path
        Folder to which the files are written.

    Returns
    -------
    list of Path
        The written files, the main file first.

    Raises
    ------
    InputError
        If the program has no equivalent for a law of the study.
    """
    check_laws(job, program)
    paths = []
    for name, text in PROGRAMS[program](job).items():
        path = Path(folder) / name
        write_text(path, text)
        paths.append(path)
    return paths
