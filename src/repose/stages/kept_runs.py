"""Runs kept beside the files of their job, in the folder `runs`, so that none is made or measured twice.

Snakemake removes outputs before it makes them anew, and knows nothing of this folder. While a job runs, each of its
runs is a file there; once it is complete, its own files have a second name there instead, so a pile lies once on the
disk. A kept run is taken again only if it is the same: of the same parameters, settings, grain, particle and engine, by
its record of provenance, and unchanged, by the ledger of its folder. A kept measurement also is of the same file, code
and versions.
"""

import json
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from repose.bench.bench_test import Run
from repose.common import attached, ledger, provenance
from repose.common.errors import InputError
from repose.common.files import json_text, read_json, read_npz, write_json, write_npz
from repose.common.ledger import is_own_file
from repose.common.source_code import code_hash
from repose.measure.saved_pours import POURS, positions_file, pour_arrays, read_pours

FOLDER = "runs"
ABOUT = "about"  # name of the array that holds job and record as JSON
MEASURING = (
    "dem",
    "bench",
    "measure",
    "grain",
    "common",
)  # rooms whose code may change a measurement


def write(path: Path, about: Mapping[str, Any], run: Run) -> None:
    """Keep a run without its frames, unless a damaged or foreign file has its name."""
    if not path.exists() or is_own_file(path):
        write_npz(path, {**run.arrays, ABOUT: np.array(json_text([about, run.record]))})


def read(path: Path, about: Mapping[str, Any]) -> Run | None:
    """Read a kept run if it equals the run that the stage would make; `about` describes the job in its files."""
    if not _is_current(path):
        return None
    try:
        arrays = read_npz(path, (ABOUT,))
    except InputError:
        return None
    its_job, record = json.loads(str(arrays.pop(ABOUT)))
    return Run(record, arrays) if its_job == about else None


class KeptRuns:
    """The kept runs of the job NAME in a folder."""

    def __init__(self, folder: Path, name: str, about: Mapping[str, Any]) -> None:
        self.job, self.about = folder / name, about

    def _kept(self, ending: str) -> Path:
        """Return the path of a file of the job among the kept ones."""
        return self.job.parent / FOLDER / f"{self.job.name}{ending}"

    def read(self, seed: int) -> Run | None:
        """Read the run of a seed as `read`, from its own file or the files of a complete job."""
        run = read(self._kept(f"_{seed}.npz"), self.about)
        return self._complete.get(seed) if run is None else run

    def write(self, run: Run) -> None:
        """Keep a run as `write`."""
        write(self._kept(f"_{run.record['seed']}.npz"), self.about, run)

    @cached_property
    def _complete(self) -> dict[int, Run]:
        """Runs of a complete job by seed, if they are current."""
        pours = self._kept(POURS)
        if not (_is_current(pours) and _is_current(positions_file(pours))):
            return {}
        job, arrays = read_pours(pours), read_npz(positions_file(pours))
        records = job.pop("pours")
        if job != self.about:
            return {}
        return {
            one["seed"]: Run(one, pour_arrays(arrays, one["seed"], pours, ()))
            for one in records
        }

    def join(self, seeds: list[int]) -> None:
        """Let the files of the complete job, which hold the runs of these seeds, take the place of the single runs."""
        if self._complete.keys() <= set(seeds) and all(
            ledger.link(
                self.job.with_name(f"{self.job.name}{ending}"), self._kept(ending)
            )
            for ending in (".npz", POURS)
        ):
            for path in (self._kept(f"_{seed}.npz") for seed in seeds):
                if is_own_file(path):
                    path.unlink()


def _is_current(path: Path) -> bool:
    """Tell whether a file is ours, and from the stage that is running, by its record."""
    now, then = provenance.current(), attached.read(path) if is_own_file(path) else None
    return now is not None and then is not None and then["origin"] == now["origin"]


def _measurement_of(pours: Path) -> tuple[Path, dict[str, str]]:
    """Say where the measurement of a job is kept, and hash what it depends on besides its record."""
    files = {
        path.name: provenance.hash_of_file(path)
        for path in (pours, positions_file(pours))
    }
    kept = pours.parent / FOLDER / f"{pours.name.removesuffix(POURS)}.json"
    return kept, files | {"code": code_hash("stages.job")}


def read_measurement(pours: Path) -> dict[str, Any] | None:
    """Read the kept measurement of a saved job if it equals what the stage would measure."""
    path, of = _measurement_of(pours)
    if not is_own_file(path) or attached.read(path) != provenance.current():
        return None
    kept = read_json(path)
    return kept["result"] if kept["of"] == of else None


def write_measurement(pours: Path, result: Mapping[str, Any]) -> None:
    """Keep the measurement of a saved job, unless a damaged or foreign file has its name."""
    path, of = _measurement_of(pours)
    if not path.exists() or is_own_file(path):
        write_json(path, {"of": of, "result": result})
