"""Keep runs next to the files of their job, so that none is made or measured twice.

Snakemake removes outputs before it makes them again, but it does not know the folder
`runs`. This folder has a file for each run of a job, and a file for the measurement of
all runs of the job. A kept run is used again under two conditions. First, its record of
provenance must name the same parameters, settings, grain, particle and engine. Second,
the ledger of its folder must show that the file is unchanged. A measurement must also
come from the same files and the same code.
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
# Name of the array with the description of the job and the record of the run, as a
# single JSON string.
DESCRIPTION_ARRAY = "about"
# Keys in the file of a measurement: the hashes of what was measured, and the result.
SOURCES_KEY = "of"
RESULT_KEY = "result"


class KeptRuns:
    """The kept runs of a job.

    Parameters
    ----------
    folder : Path
        The folder of the job's files.
    name : str
        Name of the job.
    description : mapping
        The description of the job, with which its files begin.
    """

    def __init__(self, folder: Path, name: str, description: Mapping[str, Any]) -> None:
        self.folder = folder / RUNS_FOLDER
        self.name = name
        self.description = description

    def read(self, seed: int) -> Run | None:
        """Read the run of a seed, if it was kept and is still valid.

        Returns
        -------
        Run or None
            None if the caller must make the run. This is the case if it has no file, if
            the file is damaged or was made by another program, or if parameters,
            settings or the engine have changed since then.
        """
        path = self._path(seed)
        if not _is_current(path):
            return None
        try:
            arrays = read_npz(path, (DESCRIPTION_ARRAY,))
        except InputError:
            return None
        # `write` has stored the list [description, record] as text in one of the
        # arrays. The other arrays are those of the run.
        description, record = json.loads(str(arrays.pop(DESCRIPTION_ARRAY)))
        if description != self.description:
            return None
        return Run(record, arrays)

    def write(self, run: Run) -> None:
        """Keep a run without its frames.

        A file that is damaged, or was made by another program, is not replaced.
        """
        path = self._path(run.record["seed"])
        if _is_replaceable(path):
            description_and_record = format_json([self.description, run.record])
            write_npz(
                path,
                {**run.arrays, DESCRIPTION_ARRAY: np.array(description_and_record)},
            )

    def _path(self, seed: int) -> Path:
        return self.folder / f"{self.name}_{seed}.npz"


def read_measurement(pours_json: Path) -> dict[str, Any] | None:
    """Read the measurement of a saved job that `write_measurement` has kept.

    Parameters
    ----------
    pours_json : Path
        The file NAME.pours.json of the job.

    Returns
    -------
    dict or None
        The result that was kept, as `repose.stages.job.measure_runs` returned it. None
        if the job must be measured, because there is no such result, or because
        settings, files or code have changed since then.
    """
    path = _find_measurement_file(pours_json)
    # This is also False if there is no file.
    if not is_own_file(path):
        return None
    # Each file has a record of the stage and the settings with which it was made.
    # Compare it with the record that files of the current stage get. The file has the
    # keys of `write_measurement`, because no other function writes it.
    if attached.read_record(path) != provenance.get_current_record():
        return None
    content = read_json(path)
    if content[SOURCES_KEY] != _hash_sources(pours_json):
        return None
    return content[RESULT_KEY]


def write_measurement(pours_json: Path, result: Mapping[str, Any]) -> None:
    """Keep the measurement of a saved job, for `read_measurement`.

    A file that is damaged, or was made by another program, is not replaced.
    """
    path = _find_measurement_file(pours_json)
    if _is_replaceable(path):
        content = {SOURCES_KEY: _hash_sources(pours_json), RESULT_KEY: result}
        write_json(path, content)


def _find_measurement_file(pours_json: Path) -> Path:
    """Find the file in which the measurement of a saved job is kept."""
    name = pours_json.name.removesuffix(POURS_ENDING)
    return pours_json.parent / RUNS_FOLDER / f"{name}.json"


def _hash_sources(pours_json: Path) -> dict[str, str]:
    """Hash the files of a saved job, and the code that measures it."""
    files = (pours_json, positions_file(pours_json))
    hashes = {path.name: provenance.hash_file(path) for path in files}
    return hashes | {"code": code_hash("stages.job")}


def _is_current(path: Path) -> bool:
    """Tell whether the current stage would make this file again as it is.

    The file must be unchanged. It must also have the origin of the stage, which is a
    hash of the settings, the engine and all inputs.
    """
    stage_record = provenance.get_current_record()
    if stage_record is None or not is_own_file(path):
        return False
    file_record = attached.read_record(path)
    return file_record is not None and file_record["origin"] == stage_record["origin"]


def _is_replaceable(path: Path) -> bool:
    """Tell whether a path has no file, or an unchanged file of this program."""
    return not path.exists() or is_own_file(path)
