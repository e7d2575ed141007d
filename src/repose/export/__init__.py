"""The calibrated grain and its bench test as input of other simulation programs.

`job` is the export in SI units, independent of any program. Each other module writes the deck of a program from a
template in this folder; a deck's head states the differences of the program from this engine.
"""

from collections.abc import Callable
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from repose.common.errors import require
from repose.common.files import write_text
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

if TYPE_CHECKING:
    from repose.export.job import Job

__all__ = ["PROGRAMS", "write"]

Deck = Callable[["Job"], dict[str, str]]


def _written_by(module: str, name: str = "deck") -> Deck:
    """Import a function of a module of this package when it writes: the help lists programs alone."""
    return lambda job: getattr(import_module(f".{module}", __name__), name)(job)


PROGRAMS = {
    name: _written_by(name) for name in ("liggghts", "lammps", "yade", "mercurydpm")
}
PROGRAMS |= {name: _written_by("tables", name) for name in ("edem", "rocky")}
# The laws that a deck can hold, besides Hertz and Mindlin's contact and the rolling law `budget`.
FURTHER_LAWS = {
    "liggghts": ("sjkr", "constant_torque", "epsd", "epsd2"),
    "lammps": ("epsd", "epsd2"),
    "edem": ("jkr",),
}
# Reasons why a program's law of the same name cannot be used.
REASONS = {
    (
        "lammps",
        "jkr",
    ): "its damping coeff_restitution refuses cohesion; its other dampings are not the study's"
}
HERTZ = ("hertz_mindlin", "hertz_mindlin_rescaled")


def check_laws(job: "Job", program: str) -> None:
    """Raise InputError if a program has no equivalent of one of the study's laws."""
    for key, law, laws, common in (
        ("contact_law", job.simulation.contact_law, CONTACT_LAWS, HERTZ),
        ("rolling_law", job.simulation.rolling_law, ROLLING_LAWS, ("budget",)),
    ):
        allowed = [
            *common,
            *(name for name in laws if name in FURTHER_LAWS.get(program, ())),
        ]
        why = f" ({REASONS[program, law]})" if (program, law) in REASONS else ""
        require(
            law in allowed,
            "configuration",
            f"simulation.{key}",
            law,
            f"for {program} {' or '.join(allowed)}{why}",
        )


def write(job: "Job", program: str, folder: str | PathLike) -> list[Path]:
    """Write the deck of a program of `PROGRAMS`, return its files, itself first; InputError as by `check_laws`."""
    check_laws(job, program)
    paths = []
    for name, text in PROGRAMS[program](job).items():
        paths.append(Path(folder) / name)
        write_text(paths[-1], text)
    return paths
