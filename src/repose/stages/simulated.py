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
from repose.stages.simulate import MAX_REASON_LENGTH, Outcome, make_file_error

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
    """Read the responses of all runs of a sample, and write them as a measured job.

    A job is all runs of one sample. Its file has the same form as that of a bench test.

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
        # These entries are the same for all runs of a sample, so those of the last run
        # describe the job.
        description = {key: record[key] for key in DESCRIPTION_KEYS}
        outcome = Outcome(record["status"], record["reason"])
        values: dict[str, float | None] = dict.fromkeys(responses)
        # A run that failed has no files to read.
        if outcome.status == OK:
            # The folder of a run has the name of its record without the suffix .json.
            folder = path.with_suffix("")
            outcome, values = read_responses(folder, settings, responses, measure)
        runs.append({"seed": record["seed"], **outcome._asdict(), **values})

    # Every response is summarised by its mean, and is also a column of single runs.
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
) -> tuple[Outcome, dict[str, float | None]]:
    """Read the responses of a run whose program ended normally.

    The run counts as failed if one of the responses cannot be read.

    Parameters
    ----------
    folder : Path
        Folder of the run, with the files that it left.
    settings : SimulatorSettings
        The simulator, which states which of these files have the responses.
    responses : sequence of str
        Names of the responses to read, those of the targets.
    measure : MeasureSettings or None
        How a pile of particles is measured.

    Returns
    -------
    Outcome
        Its status is ``ok``, or it has the reason why the run counts as failed.
    dict
        A number for each response. All are None for a failed run.

    Raises
    ------
    InputError
        If a file of the run has been lost or changed since the run.
    """
    for name in settings.files_read:
        error = make_file_error(folder, name)
        if error is not None:
            raise error

    # The responses of a failed run.
    empty_responses: dict[str, float | None] = dict.fromkeys(responses)
    contents: dict[str, Any] = {}
    try:
        if settings.particles is not None:
            contents |= measure_pile(folder, settings, measure)
        # Responses in the table replace those of the pile.
        if settings.output is not None:
            contents |= read_response_table(folder / settings.output)
    except NoFlankError as no_flank:
        return Outcome("no_pile", no_flank.reason), empty_responses
    except (InputError, OSError, ValueError) as read_error:
        return Outcome("bad_output", _shorten(read_error)), empty_responses
    return _check_contents(contents, responses)


def _check_contents(
    contents: dict[str, Any], responses: Sequence[str]
) -> tuple[Outcome, dict[str, float | None]]:
    """Check whether the output files of a run have all responses.

    Parameters
    ----------
    contents : dict
        The responses in the output files, and perhaps a `status` that the program gave.
    responses : sequence of str
        Names of the responses that the run must have.

    Returns
    -------
    Outcome
        Its status is ``ok``. It is ``bad_output`` if a response is missing, and
        ``failed`` if the program gave another status itself.
    dict
        A number for each response. All are None for a failed run.
    """
    # A table of many runs follows the same rules, so check a table with this one row.
    # `judge_runs` gives the status FAILED to a row without a finite number for each
    # response, and keeps a status that the row states itself.
    cells, _ = make_cells(contents, responses)
    checked = judge_runs({name: [cell] for name, cell in cells.items()}, responses)
    status = checked.statuses[0]
    if status == OK:
        return Outcome(OK), {name: checked.values[name][0] for name in responses}

    empty_responses: dict[str, float | None] = dict.fromkeys(responses)
    missing_responses = [name for name in responses if not math.isfinite(cells[name])]
    if status == FAILED and missing_responses:
        names = ", ".join(missing_responses)
        reason = f"no finite number for {names}; the run left {contents}"
        return Outcome("bad_output", _shorten(reason)), empty_responses
    return Outcome("failed", f"its status is {_shorten(status)}"), empty_responses


def _shorten(text: object) -> str:
    """Shorten a text to one line of at most `MAX_REASON_LENGTH` characters."""
    return " ".join(str(text).split())[:MAX_REASON_LENGTH]


def read_response_table(path: Path) -> dict[str, Any]:
    """Read the responses of a run: a mapping in JSON, or a CSV file with one row.

    Raises
    ------
    InputError, ValueError
        If the file is neither. The readers of the two formats raise different errors.
    """
    from repose.common import tables

    if path.suffix.lower() == ".json":
        return read_json(path, what="responses by name")

    # Declare no columns, and let no column count as numbers, so that the cells stay
    # texts of any kind. `_check_contents` converts and checks them.
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

    Parameters
    ----------
    folder : Path
        Folder of the run.
    settings : SimulatorSettings
        The simulator. Its section `particles` names the file with the positions of the
        particles, their unit of length, the direction that points up, and the height of
        the base.
    measure : MeasureSettings or None
        How a pile of particles is measured.

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
    # The caller has checked this.
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
    # `record` returns the responses by name.
    return pile.result.record()
