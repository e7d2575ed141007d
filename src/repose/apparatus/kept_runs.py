"""Runs kept one by one, so that none is made twice.

A kept run is taken again only if it is the same: of the same parameters, settings, berry, particle and engine, by its
record of provenance, and unchanged, by the ledger of its folder.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from repose.apparatus.bench_test import Run
from repose.core import attached, provenance
from repose.core.errors import InputError
from repose.core.files import json_text, read_npz, write_npz
from repose.core.ledger import is_own_file

ABOUT = "about"  # name of the array that holds job and record as JSON


def write(path: Path, about: Mapping[str, Any], run: Run) -> None:
    """Keep a run without its frames, unless a damaged or foreign file has its name."""
    if path.exists() and not is_own_file(path):
        return
    write_npz(path, {**run.arrays, ABOUT: np.array(json_text([about, run.record]))})


def read(path: Path, about: Mapping[str, Any]) -> Run | None:
    """A kept run if it equals the run that the stage would make; `about` is the description in each file of its job."""
    now, then = provenance.current(), attached.read(path) if is_own_file(path) else None
    if now is None or then is None or then["origin"] != now["origin"]:
        return None
    try:
        arrays = read_npz(path, (ABOUT,))
    except InputError:
        return None
    its_job, record = json.loads(str(arrays.pop(ABOUT)))
    return Run(record, arrays) if its_job == about else None
