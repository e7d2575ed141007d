"""Keep runs beside the files of their job, so that none is made or measured twice.

Snakemake removes outputs before it makes them anew, but it does not know the folder
`runs`. There each run of a job is a file. A kept run is used again only under two
conditions. Its record of provenance must name the same parameters, settings, grain,
particle and engine. And the ledger of its folder must show that the file is unchanged.
A kept measurement must also come from the same files and code.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from repose.bench.bench_test import Run
from repose.common import attached, provenance
from repose.common.errors import InputError
from repose.common.files import format_json, read_json, read_npz, write_json, write_npz
from repose.common.ledger import is_own_file
from repose.common.source_code import code_hash
from repose.measure.saved_pours import POURS_ENDING, positions_file

RUNS_FOLDER = "runs"
# Name of the array that holds job and record as JSON.
DESCRIPTION_ARRAY = "about"


class KeptRuns:
    """The kept runs of a job.

    Parameters
    ----------
    folder : Path
        The folder of the job's files.
    name : str
        Name of the job.
    description : mapping
        The description of the job that its files begin with.
    """

    def __init__(self, folder: Path, name: str, description: Mapping[str, Any]) -> None:
        self.folder = folder / RUNS_FOLDER
        self.name = name
        self.description = description

    def read(self, seed: int) -> Run | None:
        """Read the kept run of a seed.

        Parameters
        ----------
        seed : int

        Returns
        -------
        Run or None
            None if the run must be made: there is no file of it, the file is damaged or
            foreign, or the job would now make a different run, because its parameters,
            its settings or the engine have changed.
        """
        path = self._path(seed)
        if not _is_current(path):
            return None
        try:
            arrays = read_npz(path, (DESCRIPTION_ARRAY,))
        except InputError:
            return None
        # One array of the file is a JSON text with the description of the job and the
        # record of the run.
        description, record = json.loads(str(arrays.pop(DESCRIPTION_ARRAY)))
        if description != self.description:
            return None
        return Run(record, arrays)

    def write(self, run: Run) -> None:
        """Keep a run without its frames, unless a damaged or foreign file is there."""
        path = self._path(run.record["seed"])
        if _is_replaceable(path):
            description_and_record = format_json([self.description, run.record])
            write_npz(
                path,
                {**run.arrays, DESCRIPTION_ARRAY: np.array(description_and_record)},
            )

    def _path(self, seed: int) -> Path:
        return self.folder / f"{self.name}_{seed}.npz"


def read_measurement(pours: Path) -> dict[str, Any] | None:
    """Read the kept measurement of a saved job.

    Returns
    -------
    dict or None
        None if the job must be measured: there is no kept measurement of it, or settings,
        files or code have changed since then.
    """
    path = _measurement_file(pours)
    if not is_own_file(path):
        return None
    if attached.read_record(path) != provenance.get_current_record():
        return None
    kept = read_json(path)
    has_same_sources = kept["of"] == _hash_sources(pours)
    return kept["result"] if has_same_sources else None


def write_measurement(pours: Path, result: Mapping[str, Any]) -> None:
    """Keep the measurement of a saved job, unless a damaged or foreign file is there."""
    path = _measurement_file(pours)
    if _is_replaceable(path):
        write_json(path, {"of": _hash_sources(pours), "result": result})


def _measurement_file(pours: Path) -> Path:
    """Return the file that keeps the measurement of a saved job."""
    return pours.parent / RUNS_FOLDER / f"{pours.name.removesuffix(POURS_ENDING)}.json"


def _hash_sources(pours: Path) -> dict[str, str]:
    """Hash what a measurement depends on besides its record."""
    files = (pours, positions_file(pours))
    hashes = {path.name: provenance.hash_file(path) for path in files}
    return hashes | {"code": code_hash("stages.job")}


def _is_current(path: Path) -> bool:
    """Tell whether a file is ours, unchanged, and of the origin of the current stage."""
    stage_record = provenance.get_current_record()
    if stage_record is None or not is_own_file(path):
        return False
    file_record = attached.read_record(path)
    return file_record is not None and file_record["origin"] == stage_record["origin"]


def _is_replaceable(path: Path) -> bool:
    """Tell whether a file may be written here."""
    return not path.exists() or is_own_file(path)
