"""The calibrated grain and its bench test as input of other simulation programs.

`job` says what is exported, in SI units and in the words of no program. Each other module writes the deck of one
program; the text of a deck stands in a template beside it. What a program does otherwise than this engine is a note
that the deck begins with.
"""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from repose.core.files import write_text
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


def write(job: Job, program: str, folder: str | PathLike) -> list[Path]:
    """Write the deck of a program."""
    paths = []
    for name, text in PROGRAMS[program](job).items():
        paths.append(Path(folder) / name)
        write_text(paths[-1], text)
    return paths
