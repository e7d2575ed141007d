"""Check the folder of a study's results before a run writes into it.

Snakemake removes the outputs of a rule before it makes them again, whoever wrote them.
Therefore a study starts only in a new folder or in the folder of a study, and only if
no file of the user has the name of a result.

Each folder of results has a ledger, a hidden list of the files that this program wrote
there (`repose.common.ledger`). A result that is on this list and has the same content
may be replaced. Any other file with the name of a result is a file of the user.
"""

import os
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from repose import bench
from repose.calibrate import strategies
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.targets import OWN_BENCH
from repose.common import attached, ledger, places
from repose.common.errors import InputError, raise_together
from repose.common.ledger import LEDGER
from repose.common.section import Contradictions, refuse
from repose.config.loader import RESOLVED_FILE

# Folders of the project into which no results may be written.
PROJECT_FOLDERS = (
    "src",
    "config",
    "resources",
    "workflow",
    "profiles",
    "tests",
    "docs",
    "examples",
    "benchmarks",
    "research",
    ".ci",
    "results/published",
)
# Folders in the folder of results whose files every job replaces.
FOLDERS_WITHOUT_RESULTS = ("benchmarks", "logs")
# Table of the times of all runs of the workflow in the folder of results.
RUN_TIMES_FILE = "benchmarks/calls.csv"
# Files that a run writes without a record of provenance, because they are not results.
FILES_WITHOUT_RECORD = (RESOLVED_FILE, RUN_TIMES_FILE)
# Names of the wildcards in rules that stand for a number.
NUMBER_WILDCARDS = ("sample", "job", "run", "seed", "batch")
# A wildcard in braces, such as {sample}, or {sample,\d+} with a constraint.
WILDCARD_PATTERN = re.compile(r"\{(\w+)(?:,(?:[^{}]|\{[^{}]*\})*)?\}")

# The path of a folder, and the names of the files in it.
FolderWithFiles = tuple[str, list[str]]


def name_run_folder(test: str) -> str:
    """Return the folder of a bench test's runs in the folder of results."""
    if test == UNNAMED:
        return "heaps"
    if test == OWN_BENCH:
        return "runs"
    return f"{test}_runs"


def list_run_records(folder: str, counts: Mapping[str, int]) -> list[str]:
    """List the paths of the records of runs in a folder.

    Parameters
    ----------
    folder : str
        The folder, which has a folder for each sample.
    counts : mapping of str to int
        Number of runs by the name of the sample.
    """
    return [
        f"{folder}/{sample}/{run}.json"
        for sample, count in counts.items()
        for run in range(1, count + 1)
    ]


def count_records_by_folder(records: Iterable[str]) -> list[str]:
    """Count the records in each folder, for the command line of `measure_simulated`.

    The paths of thousands of records would be too long for a command line.

    Parameters
    ----------
    records : iterable of str
        Paths of records.

    Returns
    -------
    list of str
        For each folder, a string such as ``results/runs/001=2``.
    """
    counts = Counter(record.rpartition("/")[0] for record in records)
    return [f"{folder}={count}" for folder, count in counts.items()]


def require_separate_folder(results_dir: str) -> str:
    """Reject a folder of results that lies in a project folder or contains the project.

    Parameters
    ----------
    results_dir : str
        The folder, which need not exist.

    Returns
    -------
    str
        The same path, because pydantic expects this of a validator.

    Raises
    ------
    PydanticCustomError
        If the folder lies inside one of `PROJECT_FOLDERS`, or if it contains the
        project or the home folder. Results would then lie among other files.
    """
    # Unlike `Path.resolve`, this function accepts a link to itself.
    folder = Path(os.path.realpath(results_dir))

    # The project may be in the working folder, or where the program is installed.
    project_roots = {Path.cwd(), places.find_program_folder().resolve()}
    project_folders = [places.PACKAGE]
    for root in project_roots:
        project_folders += [root / name for name in PROJECT_FOLDERS]
    is_in_project_folder = any(folder.is_relative_to(path) for path in project_folders)
    # Results must not be spread over the home folder either.
    contains_project_or_home = any(
        path.is_relative_to(folder) for path in {*project_roots, Path.home()}
    )
    if is_in_project_folder or contains_project_or_home:
        allowed = (
            "a folder of its own, which does not contain the project and lies outside "
            f"{', '.join(PROJECT_FOLDERS)}"
        )
        # `refuse` raises the error that pydantic expects. An empty key stands for the
        # value itself.
        refuse([("", allowed)])
    return results_dir


def find_folder_problems(results_dir: str) -> Contradictions:
    """Find out whether an existing file prevents the creation of the results folder.

    Yields
    ------
    tuple of str
        The key and its allowed values, if there is such a file.
    """
    folder = Path(results_dir)
    for path in (folder, *folder.parents):
        if os.path.lexists(path) and not path.is_dir():
            yield "results_dir", "a folder; a file, or a link to nothing, is in its way"
            return


def make_output_pattern(outputs: Iterable[str]) -> re.Pattern[str]:
    """Make a regular expression for the paths that rules write.

    Parameters
    ----------
    outputs : iterable of str
        The outputs of rules, with wildcards in braces.

    Returns
    -------
    re.Pattern
        It matches the whole path of an output.
    """
    # Map the wildcards with known values to expressions. The article's method, called
    # published, has no batches.
    names = [name for name in strategies.names() if name != "published"]
    wildcards = dict.fromkeys(NUMBER_WILDCARDS, r"\d+")
    wildcards["runs"] = "|".join(map(name_run_folder, (*bench.names(), OWN_BENCH)))
    wildcards["strategy"] = "|".join(names)
    patterns = [_make_path_pattern(path, wildcards) for path in dict.fromkeys(outputs)]
    return re.compile("|".join(patterns))


def _make_path_pattern(path: str, wildcards: dict[str, str]) -> str:
    """Turn the path of an output into a regular expression.

    A wildcard that occurs twice in a path may match two different texts.

    Parameters
    ----------
    path : str
        The path, with wildcards in braces, such as ``heaps/{sample}.json``.
    wildcards : dict of str to str
        Expressions of wildcards by name. Any other wildcard matches the name of one
        file or folder.

    Returns
    -------
    str
        The regular expression.
    """
    # `WILDCARD_PATTERN` has exactly one group, the name of the wildcard. Therefore the
    # parts alternate between plain text and names of wildcards, beginning with text.
    parts = re.split(WILDCARD_PATTERN, path)
    expression = ""
    for position, part in enumerate(parts):
        is_text = position % 2 == 0
        if is_text:
            expression += re.escape(part)
        else:
            expression += f"(?:{wildcards.get(part, '[^/]+')})"
    return expression


def check_no_foreign_files(results_dir: str, outputs: Iterable[str]) -> None:
    """Check that a study can write its results without replacing files of the user.

    A foreign file is one that no study wrote, but that has the name of a result.

    Parameters
    ----------
    results_dir : str
        The folder of results.
    outputs : iterable of str
        Paths that rules of the workflow write, with wildcards in braces.

    Raises
    ------
    InputError
        With all problems: a result was edited, a foreign file has the name of a result,
        or the folder does not belong to a study.
    OSError
        If a folder cannot be listed.
    """
    if not os.path.isdir(results_dir):
        return

    # A study has written into the folder if the folder has a ledger, the list of its
    # results. A copied folder may lack this hidden file. Its results are then
    # recognised by their records of provenance.
    outputs = list(outputs)
    names = _list_names_of_results(results_dir, outputs)
    results_without_ledger = set(_find_results_without_ledger(results_dir, names))
    if names and not results_without_ledger:
        _require_ledger(results_dir, name_of_result=names[0])

    # Find the results that were changed.
    folders = list(_walk_folders_of_results(results_dir, names))
    errors_by_path: dict[str, InputError] = {}
    for folder, _ in folders:
        for path in _find_changed_results(folder, results_dir, names):
            errors_by_path[str(path)] = _make_changed_result_error(path, Path(folder))

    # Find files that have the name of a result but are not results. Other files of the
    # user may stay.
    foreign_files = [
        file
        for file in _find_unlisted_files(folders)
        if file not in results_without_ledger
    ]
    foreign_paths = [
        *_find_folders_named_as_results(folders),
        *_select_files_to_be_replaced(foreign_files, outputs),
    ]
    for foreign_path in foreign_paths:
        errors_by_path[foreign_path] = _make_foreign_file_error(foreign_path)
    raise_together(errors_by_path[path] for path in sorted(errors_by_path))


def _require_ledger(results_dir: str, name_of_result: str) -> None:
    """Raise an InputError if no study has written in a folder.

    Parameters
    ----------
    results_dir : str
        The folder. None of its files has a record of provenance.
    name_of_result : str
        The name of a file or folder in it that has the name of a result.
    """
    if (Path(results_dir) / LEDGER).is_file():
        return
    raise InputError(
        "configuration",
        key="results_dir",
        value=results_dir,
        allowed=f"a new folder, or the folder of a study; there is {name_of_result}, which "
        "no study of repose wrote: move it away, or choose another folder",
    )


def _find_changed_results(
    folder: str, results_dir: str, names: Collection[str]
) -> list[Path]:
    """Find the listed results of a folder that were edited or damaged later.

    Parameters
    ----------
    folder : str
        A folder of results.
    results_dir : str
        The top folder of the results. Only this folder may contain other files, which
        may be changed.
    names : collection of str
        Names of results in the top folder.

    Returns
    -------
    list of Path
        The paths of the results.
    """
    changed_files = ledger.find_changed_files(folder)
    if folder != results_dir:
        return changed_files
    return [path for path in changed_files if path.name in names]


def _find_unlisted_files(folders: Iterable[FolderWithFiles]) -> Iterator[str]:
    """Yield the paths of the files that the ledgers of their folders do not list."""
    for folder, names in folders:
        listed_names = ledger.list_names(folder)
        for name in names:
            if name not in listed_names:
                yield f"{folder}/{name}"


def _find_folders_named_as_results(
    folders: Iterable[FolderWithFiles],
) -> Iterator[str]:
    """Yield the paths of folders that have the name of a result in a ledger.

    Snakemake would mistake such a folder for the result.
    """
    for folder, _ in folders:
        for name in ledger.list_names(folder):
            if os.path.isdir(f"{folder}/{name}"):
                yield f"{folder}/{name}"


def _select_files_to_be_replaced(
    paths: Sequence[str], outputs: Iterable[str]
) -> list[str]:
    """Select the files that a rule would replace, except empty ones.

    An empty file contains nothing that could be lost. Snakemake itself makes such
    files.

    Parameters
    ----------
    paths : sequence of str
        Files in the folder of results.
    outputs : iterable of str
        Paths that rules write, with wildcards in braces.
    """
    # The pattern is slow to make. Most studies do not need it.
    if not paths:
        return []
    is_output = make_output_pattern(outputs).fullmatch
    files = [path for path in paths if is_output(path) and os.path.isfile(path)]
    return [path for path in files if os.path.getsize(path) > 0]


def _list_names_of_results(results_dir: str, outputs: Iterable[str]) -> list[str]:
    """List the files and folders in the folder of results that have names of results.

    The names are in alphabetical order. Inner folders are not searched.
    """
    top_level = {
        path.removeprefix(f"{results_dir}/").partition("/")[0] for path in outputs
    }
    is_name_of_study = make_output_pattern(
        {*FOLDERS_WITHOUT_RESULTS, *top_level}
    ).fullmatch
    return sorted(name for name in os.listdir(results_dir) if is_name_of_study(name))


def _walk_folders_of_results(
    results_dir: str, names: list[str]
) -> Iterator[FolderWithFiles]:
    """Yield the folder of results and the folders below it, each with its files.

    Parameters
    ----------
    results_dir : str
        The folder of results.
    names : list of str
        The files and folders in it that belong to a study. Others are ignored.

    Yields
    ------
    folder : str
        The path of a folder.
    files : list of str
        The names of the files in it. For the folder of results these are `names`, which
        include folders.
    """
    yield results_dir, names
    for name in names:
        path = f"{results_dir}/{name}"
        if name not in FOLDERS_WITHOUT_RESULTS and os.path.isdir(path):
            yield from _walk_folder(path)


def _walk_folder(folder: str) -> Iterator[FolderWithFiles]:
    """Yield a folder and the folders below it, each with the names of its files.

    If a folder cannot be listed, an OSError is raised.
    """

    # By default `os.walk` ignores such errors.
    def reject_folder(error: OSError) -> None:
        raise error

    for inner, _, files in os.walk(folder, onerror=reject_folder):
        yield inner, files


def _find_results_without_ledger(results_dir: str, names: list[str]) -> Iterator[str]:
    """Yield the results in folders whose ledger is missing.

    A copy of a folder often lacks hidden files, including the ledger. Each result then
    still has a record of provenance, by which it is recognised.

    Parameters
    ----------
    results_dir : str
        The folder of results.
    names : list of str
        Names of the files and folders in it to search.

    Yields
    ------
    str
        The path of a file with a record of provenance, in a folder without a ledger.
    """
    for folder, files in _walk_folders_of_results(results_dir, names):
        if not (Path(folder) / LEDGER).is_file():
            for name in files:
                path = f"{folder}/{name}"
                if attached.read_record(path) is not None:
                    yield path


def restore_ledgers(results_dir: str, outputs: Iterable[str]) -> list[str]:
    """Write the missing ledgers in the folders of results.

    The ledger of a folder is a hidden list of the files that this program wrote there.
    It gets lost, for example, if the folder is copied without hidden files. Results are
    recognised by their records of provenance, which say how a file was made. The files
    in `FILES_WITHOUT_RECORD` have no such records, but are listed as well.

    Parameters
    ----------
    results_dir : str
        The folder of results.
    outputs : iterable of str
        Paths that rules of the workflow write, with wildcards in braces.

    Returns
    -------
    list of str
        The paths of the results that were recognised and listed, without the other
        files that were listed with them. The list is empty if no ledger was missing.
    """
    names = _list_names_of_results(results_dir, outputs)
    results = list(_find_results_without_ledger(results_dir, names))
    if not results:
        return []

    # A record may be inside the result, or in a file next to it, called its sidecar.
    sidecars = [f"{path}{attached.SIDECAR_SUFFIX}" for path in results]
    files_without_record = [f"{results_dir}/{name}" for name in FILES_WITHOUT_RECORD]
    for path in (*results, *sidecars, *files_without_record):
        # This program never writes a link, so a link is a file of the user.
        if os.path.isfile(path) and not os.path.islink(path):
            # Add the file to the ledger of its folder, which is made if necessary.
            ledger.list_file(path)
    return results


def _make_changed_result_error(path: Path, folder: Path) -> InputError:
    """Make the error for a result that was changed after a study wrote it.

    Parameters
    ----------
    path : Path
        The result.
    folder : Path
        The folder whose ledger, the list of its results, has an entry for this result.
        A file of a run of the user's own program lies deeper: FOLDER/RUN/FILE. The
        record of this run is FOLDER/RUN.json.
    """
    writer = "repose"
    files_to_remove = "this file, which is damaged or edited"
    is_file_of_own_program = path.parent != folder
    if is_file_of_own_program:
        # Snakemake repeats the run only if the record of the run is missing as well.
        run = path.relative_to(folder).parts[0]
        writer = "its run"
        files_to_remove += f", and {folder / run}.json"
    return InputError(
        path,
        key="content",
        value="something else",
        allowed=f"a result as {writer} wrote it; remove {files_to_remove}, and give the same "
        "command again",
    )


def _make_foreign_file_error(path: str) -> InputError:
    """Make the error for a file that has the name of a result, but that no study wrote."""
    return InputError(
        path,
        key="file",
        value="there already",
        allowed="a file that repose wrote; a result of the study has this name: move yours away",
    )
