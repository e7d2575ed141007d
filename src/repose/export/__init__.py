"""The calibrated grain and its bench test as input of other simulation programs.

`job` is the export in SI units, independent of any program. Each other module writes the deck of one program; the text
of a deck stands in a template beside it. Differences of a program from this engine are notes at the head of the deck.
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
    """Write the deck of a program of `PROGRAMS` into a folder; return its files, the deck itself first."""
    paths = []
    for name, text in PROGRAMS[program](job).items():
        paths.append(Path(folder) / name)
        write_text(paths[-1], text)
    return paths
