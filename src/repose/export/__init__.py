"""Write the calibrated grain and its pour as input of other simulation programs.

`job` has the data of an export in SI units, independent of any program. Each program has
a module, which writes its deck from a template in this folder, or its table of values;
the head of a deck states the differences of the program from this engine.
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

__all__ = ["PROGRAMS", "write"]

Deck = Callable[["Job"], dict[str, str]]
"""Makes the files of a deck by name, the deck itself first."""


def _deck_of(module: str) -> Deck:
    """Return the deck of a module of this package, which is imported when it writes."""

    def deck(job: "Job") -> dict[str, str]:
        files: dict[str, str] = import_module(f".{module}", __name__).deck(job)
        return files

    return deck


PROGRAMS = {name: _deck_of(name) for name in ("liggghts", "lammps", "yade", "edem")}
# Laws that every program has. A law that is in no list here is refused.
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
        allowed=_laws_of(program, CONTACT_LAWS, CONTACT_LAWS_OF_ALL),
    )
    _check_law(
        "rolling_law",
        job.simulation.rolling_law,
        program=program,
        allowed=_laws_of(program, ROLLING_LAWS, ROLLING_LAWS_OF_ALL),
    )


def _laws_of(
    program: str, engine_laws: Iterable[str], laws_of_all: Sequence[str]
) -> list[str]:
    """List the laws of the engine that a program has, first those of all programs."""
    other_laws = [name for name in engine_laws if name in OTHER_LAWS[program]]
    return [*laws_of_all, *other_laws]


def _check_law(key: str, law: str, program: str, allowed: Sequence[str]) -> None:
    """Refuse a law of the study that is not among the allowed ones of a program."""
    if law in allowed:
        return
    text = f"for {program} {' or '.join(allowed)}"
    if (program, law) in REASONS:
        text += f" ({REASONS[program, law]})"
    raise InputError("configuration", f"simulation.{key}", law, text)


def write(job: "Job", program: str, folder: str | PathLike) -> list[Path]:
    """Write the input files of another program, its deck, into a folder.

    Parameters
    ----------
    job : Job
        The calibrated grain and its pour.
    program : str
        One of `PROGRAMS`.
    folder : path
        Folder to write.

    Returns
    -------
    list of Path
        The written files. The first one is the deck itself.

    Raises
    ------
    InputError
        If the program has no equivalent for a contact law of the study.
    """
    check_laws(job, program)
    paths = []
    for name, text in PROGRAMS[program](job).items():
        path = Path(folder) / name
        write_text(path, text)
        paths.append(path)
    return paths
