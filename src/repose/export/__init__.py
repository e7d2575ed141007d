"""The calibrated grain and its pour as input of other simulation programs.

`job` has the data of an export in SI units, independent of any program. Each program has
a module, which writes its deck from a template in this folder, or its table of values;
the head of a deck states the differences of the program from this engine.
"""

from collections.abc import Callable
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
# Laws that every program has.
CONTACT_LAWS_OF_ALL = ("hertz_mindlin", "hertz_mindlin_rescaled")
ROLLING_LAWS_OF_ALL = ("budget",)
# Further laws of each program.
FURTHER_LAWS = {
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
    further = FURTHER_LAWS[program]
    for key, law, known, of_all in (
        (
            "contact_law",
            job.simulation.contact_law,
            CONTACT_LAWS,
            CONTACT_LAWS_OF_ALL,
        ),
        (
            "rolling_law",
            job.simulation.rolling_law,
            ROLLING_LAWS,
            ROLLING_LAWS_OF_ALL,
        ),
    ):
        allowed = [*of_all, *(name for name in known if name in further)]
        if law in allowed:
            continue
        text = f"for {program} {' or '.join(allowed)}"
        if (program, law) in REASONS:
            text += f" ({REASONS[program, law]})"
        raise InputError("configuration", f"simulation.{key}", law, text)


def write(job: "Job", program: str, folder: str | PathLike) -> list[Path]:
    """Write the deck of a program.

    Parameters
    ----------
    job : Job
        The data of the export.
    program : str
        One of `PROGRAMS`.
    folder : path
        Folder of the files.

    Returns
    -------
    list of Path
        Its files, the deck itself first.

    Raises
    ------
    InputError
        If the program has no equivalent of one of the study's laws.
    """
    check_laws(job, program)
    paths = []
    for name, text in PROGRAMS[program](job).items():
        path = Path(folder) / name
        write_text(path, text)
        paths.append(path)
    return paths
