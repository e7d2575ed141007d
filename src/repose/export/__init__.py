"""The calibrated grain and its bench test as input of other simulation programs.

`job` is the export in SI units, independent of any program. Each other module writes the deck of a program from a
template beside it; a deck's head states the differences of the program from this engine.
"""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from repose.core.errors import InputError
from repose.core.files import write_text
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.export import lammps, liggghts, mercurydpm, tables, yade
from repose.export.job import Job, make

__all__ = ["PROGRAMS", "Job", "make", "write"]

PROGRAMS: dict[str, Callable[[Job], dict[str, str]]] = {
    "liggghts": liggghts.deck,
    "lammps": lammps.deck,
    "yade": yade.deck,
    "mercurydpm": mercurydpm.deck,
    "edem": tables.edem,
    "rocky": tables.rocky,
}
# The laws that a deck can hold, besides Hertz and Mindlin's contact and the rolling law `budget`.
FURTHER_LAWS: dict[str, tuple[str, ...]] = {
    "liggghts": ("sjkr", "constant_torque", "epsd", "epsd2"),
    "lammps": ("epsd", "epsd2"),
    "yade": (),
    "mercurydpm": (),
    "edem": ("jkr",),
    "rocky": (),
}
# Reasons why a program's law of the same name cannot be used.
REASONS = {
    (
        "lammps",
        "jkr",
    ): "its damping coeff_restitution refuses cohesion; its other dampings are not the study's"
}
HERTZ = ("hertz_mindlin", "hertz_mindlin_rescaled")


def check_laws(job: Job, program: str) -> None:
    """InputError if a program has no equivalent of one of the study's laws."""
    for key, law, laws, common in (
        ("contact_law", job.contact_law, CONTACT_LAWS, HERTZ),
        ("rolling_law", job.rolling_law, ROLLING_LAWS, ("budget",)),
    ):
        allowed = [*common, *(name for name in laws if name in FURTHER_LAWS[program])]
        if law not in allowed:
            why = f" ({REASONS[program, law]})" if (program, law) in REASONS else ""
            raise InputError(
                "configuration", f"simulation.{key}", law, f"for {program} {' or '.join(allowed)}{why}"
            )


def write(job: Job, program: str, folder: str | PathLike) -> list[Path]:
    """Write the deck of a program of `PROGRAMS`, return its files, itself first; InputError as by `check_laws`."""
    check_laws(job, program)
    paths = []
    for name, text in PROGRAMS[program](job).items():
        paths.append(Path(folder) / name)
        write_text(paths[-1], text)
    return paths
