"""Read the responses of runs that the user's own program made.

The responses come from the table that a run leaves, or from its particles. The pile of
the particles is measured like that of a photograph.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.calibrate.runs import Recorded, summarise_runs
from repose.calibrate.strategies.runs import (
    FAILED,
    OK,
    judge_runs,
    make_cells,
)
from repose.common.errors import InputError, NoFlankError
from repose.common.files import StrPath, read_json, write_json
from repose.stages.settings import SimulatorSettings
from repose.stages.simulate import MAX_REASON_LENGTH, Ending, find_file_fault

if TYPE_CHECKING:
    from repose.measure.settings import MeasureSettings

# Entries in the record of a run that describe its sample.
DESCRIPTION_KEYS = ("apparatus", "sample", "parameters")


def list_record_files(entries: Iterable[str]) -> dict[Path, list[Path]]:
    """List the records of runs by the folder of their sample.

    Parameters
    ----------
    entries : iterable of str
        Entries of the form FOLDER=COUNT, with the folder of a sample and the number of
        its runs.

    Returns
    -------
    dict
        The paths of the records in each folder. Runs are numbered from 1.

    Raises
    ------
    InputError
        If an entry has another form.
    """
    files = {}
    for entry in entries:
        folder, _, count = entry.rpartition("=")
        if not folder or not count.isdecimal():
            raise InputError(
                "command line",
                key="runs",
                value=entry,
                allowed=(
                    "FOLDER=COUNT, the folder of a sample with the number of its runs"
                ),
            )
        path = Path(folder)
        files[path] = [path / f"{run}.json" for run in range(1, int(count) + 1)]
    return files


def measure_sample(
    records: Iterable[StrPath],
    out_json: StrPath,
    *,
    settings: SimulatorSettings,
    responses: Sequence[str],
    measure: "MeasureSettings | None",
) -> dict[str, Any]:
    """Read the responses of all runs of a sample, and write its job.

    Parameters
    ----------
    records : iterable of path
        Records of the runs, each next to the folder of its run.
    out_json : path
        The file to write.
    settings : SimulatorSettings
        The section `simulator`.
    responses : sequence of str
        Names of the targets.
    measure : MeasureSettings or None
        How a pile of particles is measured.

    Returns
    -------
    dict
        The job, as `repose.stages.dataset` reads it.
    """
    keys = {"sample": int, "run": int, "seed": int, "parameters": dict, "status": str}
    runs = []
    description: dict[str, Any] = {}
    for path in map(Path, records):
        record = read_json(path, keys, "the record of a run")
        # These entries are the same for all runs of a sample.
        description = {key: record[key] for key in DESCRIPTION_KEYS}
        ending = Ending(record["status"], record["reason"])
        numbers: dict[str, float | None] = dict.fromkeys(responses)
        # A run that failed has no files to read.
        if ending.status == OK:
            # The folder of a run has the name of its record without the ending.
            folder = path.with_suffix("")
            ending, numbers = read_responses(folder, settings, responses, measure)
        runs.append({"seed": record["seed"], **ending._asdict(), **numbers})

    names = tuple(responses)
    summary = summarise_runs(runs, Recorded(means=names, single=names))
    job = description | {"summary": summary, "runs": runs}
    write_json(out_json, job)
    return job


def read_responses(
    folder: Path,
    settings: SimulatorSettings,
    responses: Sequence[str],
    measure: "MeasureSettings | None",
) -> tuple[Ending, dict[str, float | None]]:
    """Read the responses of a run that ended normally.

    The run counts as failed if a response cannot be read.

    Parameters
    ----------
    folder : Path
        Folder of the run, with the files that it left.
    settings : SimulatorSettings
        The simulator, which states which of these files have the responses.
    responses : sequence of str
        Names of the targets.
    measure : MeasureSettings or None
        How a pile of particles is measured.

    Returns
    -------
    Ending
        Its status is ``ok``, or it has the reason why the run counts as failed.
    dict
        A number for each response. All are None for a failed run.

    Raises
    ------
    InputError
        If a file of the run has been lost or changed since the run.
    """
    for name in settings.files_read:
        fault = find_file_fault(folder, name)
        if fault is not None:
            raise fault

    no_numbers: dict[str, float | None] = dict.fromkeys(responses)
    contents: dict[str, Any] = {}
    try:
        if settings.particles is not None:
            contents |= measure_pile(folder, settings, measure)
        # Responses in the table replace those of the pile.
        if settings.output is not None:
            contents |= read_response_table(folder / settings.output)
    except NoFlankError as error:
        return Ending("no_pile", error.reason), no_numbers
    except (InputError, OSError, ValueError) as error:
        return Ending("bad_output", _shorten(error)), no_numbers
    return _judge_contents(contents, responses)


def _judge_contents(
    contents: dict[str, Any], responses: Sequence[str]
) -> tuple[Ending, dict[str, float | None]]:
    """Judge a run by what it left, and return its responses.

    Parameters
    ----------
    contents : dict
        The responses that the run left, and perhaps a `status` that the program gave.
    responses : sequence of str
        Names of the responses that the run must have.

    Returns
    -------
    Ending, dict
        As in `read_responses`.
    """
    # A table of runs follows the same rules, so judge the run as a table with one row.
    cells, _ = make_cells(contents, responses)
    outcome = judge_runs({name: [cell] for name, cell in cells.items()}, responses)
    status = outcome.statuses[0]
    if status == OK:
        return Ending(OK), {name: outcome.values[name][0] for name in responses}

    no_numbers: dict[str, float | None] = dict.fromkeys(responses)
    missing_responses = [name for name in responses if not math.isfinite(cells[name])]
    if status == FAILED and missing_responses:
        names = ", ".join(missing_responses)
        reason = f"no finite number for {names}; the run left {contents}"
        return Ending("bad_output", _shorten(reason)), no_numbers
    return Ending("failed", f"its status is {_shorten(status)}"), no_numbers


def _shorten(text: object) -> str:
    """Shorten a text to one line of at most `MAX_REASON_LENGTH` characters."""
    return " ".join(str(text).split())[:MAX_REASON_LENGTH]


def read_response_table(path: Path) -> dict[str, Any]:
    """Read the responses of a run: a mapping in JSON, or a CSV file with one row.

    Raises
    ------
    InputError, ValueError
        If the file is neither.
    """
    from repose.common import tables

    if path.suffix.lower() == ".json":
        return read_json(path, what="responses by name")

    # The caller checks the cells. Here they may be of any kind, so no column is treated
    # as a column of numbers.
    table = tables.read(
        path,
        columns=(),
        what="a CSV file of responses",
        is_number_column=lambda cells: False,
    )
    rows = table.rows()
    if len(rows) != 1:
        raise InputError(
            path, key="rows", value=len(rows), allowed="one row, of this run"
        )
    return rows[0]


def measure_pile(
    folder: Path, settings: SimulatorSettings, measure: "MeasureSettings | None"
) -> dict[str, float | None]:
    """Measure the pile of a run as `repose measure` does.

    Returns
    -------
    dict
        The responses of the pile by name. A response that cannot be measured is None.

    Raises
    ------
    InputError
        If the file cannot be read.
    NoFlankError
        If there is no pile.
    """
    from repose.measure import particle_files
    from repose.measure.particles import measure_particles

    section = settings.particles
    assert section is not None
    path = folder / section.file
    pile = measure_particles(
        particle_files.read_particles(path),
        measure,
        unit=section.unit,
        up=section.up,
        base=section.base,
        source=path,
    )
    return pile.result.record()
