"""Check the folder of a study's results before a run writes into it.

Snakemake removes the outputs of a rule before it makes them anew, and knows only their
names. So a study starts only in a folder that is new or a study's already, and where no
file of somebody else has the name of a result.
"""

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from repose import bench as apparatus
from repose.calibrate import strategies
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.targets import OWN
from repose.common import attached, ledger, places
from repose.common.errors import InputError, raise_together
from repose.common.ledger import LEDGER
from repose.common.section import Contradictions, refuse

# Folders of the project that results must not be written into.
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
# Folders in the folder of results whose files every job writes anew.
WITHOUT_RESULTS = ("benchmarks", "logs")
# Files that a run writes, which are no results.
WITHOUT_RECORD = ("config.json", "benchmarks/calls.csv")
# Wildcards of rules that stand for a number.
NUMBERS = ("sample", "job", "run", "seed", "batch")
# A wildcard in braces, as {sample} or with its constraint {sample,\d+}.
WILDCARD = re.compile(r"\{(\w+)(?:,(?:[^{}]|\{[^{}]*\})*)?\}")


def run_folder(test: str) -> str:
    """Return the folder of a bench test's runs in the folder of results."""
    if test == UNNAMED:
        return "heaps"
    if test == OWN:
        return "runs"
    return f"{test}_runs"


def records_of_runs(folder: str, counts: Mapping[str, int]) -> list[str]:
    """List the records of runs in a folder.

    Parameters
    ----------
    folder : str
    counts : mapping of str to int
        Number of runs by the name of the sample.
    """
    return [
        f"{folder}/{sample}/{run}.json"
        for sample, count in counts.items()
        for run in range(1, count + 1)
    ]


def counted_folders(records: Iterable[str]) -> list[str]:
    """Write the folders of records as the stage `measure_simulated` reads them.

    A command line has no room for thousands of records.
    """
    counts = Counter(record.rpartition("/")[0] for record in records)
    return [f"{folder}={count}" for folder, count in counts.items()]


def check_is_apart(results_dir: str) -> str:
    """Refuse a folder of results that is one of the project's, or contains the project.

    Returns the path unchanged, as pydantic expects from a validator.
    """
    folder = Path(os.path.realpath(results_dir))  # also of a link to itself
    roots = {Path.cwd(), places.root().resolve()}
    project_folders = [places.PACKAGE]
    for root in roots:
        project_folders += [root / name for name in PROJECT_FOLDERS]
    is_inside = any(folder.is_relative_to(path) for path in project_folders)
    is_around = any(path.is_relative_to(folder) for path in {*roots, Path.home()})
    if is_inside or is_around:
        allowed = (
            "a folder of its own, not around the project and outside "
            f"{', '.join(PROJECT_FOLDERS)}"
        )
        refuse([("", allowed)])
    return results_dir


def existing_results(results_dir: str) -> Contradictions:
    """Yield the key, with the allowed values, if the path cannot become a folder."""
    folder = Path(results_dir)
    for path in (folder, *folder.parents):
        if os.path.lexists(path) and not path.is_dir():
            yield "results_dir", "a folder; a file, or a link to nothing, is in its way"
            return


def pattern_of(outputs: Iterable[str]) -> re.Pattern[str]:
    """Make the pattern of the paths that rules write.

    Parameters
    ----------
    outputs : iterable of str
        The outputs of rules, with wildcards in braces.

    Returns
    -------
    re.Pattern
    """
    names = [name for name in strategies.names() if name != "published"]
    wildcards = dict.fromkeys(NUMBERS, r"\d+")
    wildcards["runs"] = "|".join(map(run_folder, (*apparatus.names(), OWN)))
    wildcards["strategy"] = "|".join(names)
    patterns = [_pattern_of_path(path, wildcards) for path in dict.fromkeys(outputs)]
    return re.compile("|".join(patterns))


def _pattern_of_path(path: str, wildcards: dict[str, str]) -> str:
    """Turn the path of an output into a regular expression.

    `wildcards` maps names of wildcards to expressions. Any other wildcard matches the
    name of one file or folder.
    """
    # Texts and names of wildcards alternate, beginning with a text.
    parts = re.split(WILDCARD, path)
    expression = ""
    for position, part in enumerate(parts):
        is_text = position % 2 == 0
        if is_text:
            expression += re.escape(part)
        else:
            expression += f"(?:{wildcards.get(part, '[^/]+')})"
    return expression


def check_no_foreign_files(results_dir: str, outputs: Iterable[str]) -> None:
    """Check that a study can write its results without destroying other files.

    Parameters
    ----------
    results_dir : str
        The folder of results.
    outputs : iterable of str
        Paths that rules of the workflow write, with wildcards in braces.

    Raises
    ------
    InputError
        With all faults: a result was edited, a file of another origin has the name of a
        result, or the folder does not belong to a study.
    OSError
        If a folder cannot be listed.
    """
    if not os.path.isdir(results_dir):
        return
    outputs = list(outputs)
    names = _names_of_results(results_dir, outputs)
    unlisted = set(_unlisted(results_dir, names))
    has_list = (Path(results_dir) / LEDGER).is_file()
    if names and not has_list and not unlisted:
        raise InputError(
            "configuration",
            "results_dir",
            results_dir,
            f"a new folder, or the folder of a study; there is {names[0]}, which no "
            "study of repose wrote: move it away, or choose another folder",
        )

    faults: dict[str, InputError] = {}
    unknown = []
    for folder, files in _folders_of_results(results_dir, names):
        for changed in ledger.changed(folder):
            # Beside the results of a study, other files may lie at the top.
            if folder != results_dir or changed.name in names:
                faults[str(changed)] = _changed_result(changed, Path(folder))
        listed = ledger.names(folder)
        # To snakemake a folder in the place of a result is the result.
        places = (f"{folder}/{name}" for name in listed)
        faults |= {path: _foreign_file(path) for path in filter(os.path.isdir, places)}
        for name in files:
            path = f"{folder}/{name}"
            if name not in listed and path not in unlisted:
                unknown.append(path)

    # A rule may write over a file of repose, and writes no other name.
    for path in _with_content_and_name_of_results(unknown, outputs):
        faults[path] = _foreign_file(path)
    raise_together(faults[path] for path in sorted(faults))


def _with_content_and_name_of_results(
    paths: Sequence[str], outputs: Iterable[str]
) -> list[str]:
    """Select the files that are not empty and that a rule would write over.

    An empty file holds nothing to lose; snakemake makes such marks.
    """
    # The pattern is slow to make, and most folders hold files of the study alone.
    if not paths:
        return []
    is_result = pattern_of(outputs).fullmatch
    named = [path for path in paths if is_result(path) and os.path.isfile(path)]
    return [path for path in named if os.path.getsize(path) > 0]


def _names_of_results(results_dir: str, outputs: Iterable[str]) -> list[str]:
    """List what lies in the folder of results and has the name of a study's file."""
    top_level = {
        path.removeprefix(f"{results_dir}/").partition("/")[0] for path in outputs
    }
    is_name_of_study = pattern_of({*WITHOUT_RESULTS, *top_level}).fullmatch
    return sorted(name for name in os.listdir(results_dir) if is_name_of_study(name))


def _folders_of_results(
    results_dir: str, names: list[str]
) -> Iterator[tuple[str, list[str]]]:
    """Yield each folder below the folder of results, itself first, with its files.

    Only those of the given `names` are searched.
    """
    yield results_dir, names
    for name in names:
        path = f"{results_dir}/{name}"
        if name not in WITHOUT_RESULTS and os.path.isdir(path):
            yield from _walk(path)


def _walk(folder: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each folder below a folder, itself first, with its files.

    A folder that cannot be listed is an OSError.
    """

    def refuse_folder(error: OSError) -> None:
        raise error

    for inner, _, files in os.walk(folder, onerror=refuse_folder):
        yield inner, files


def _unlisted(results_dir: str, names: list[str]) -> Iterator[str]:
    """Yield the results in folders that have lost their lists, by their records.

    Copies often leave out hidden files. Only those of the given `names` are searched.
    """
    for folder, files in _folders_of_results(results_dir, names):
        if not (Path(folder) / LEDGER).is_file():
            for name in files:
                path = f"{folder}/{name}"
                if attached.read(path) is not None:
                    yield path


def take_over(results_dir: str, outputs: Iterable[str]) -> int:
    """List the results again in folders that have lost their lists of files.

    Results are recognised by their records of provenance. The resolved configuration
    and the times of the runs have no records and are listed as well. `outputs` are as
    in `check_no_foreign_files`. Returns the number of results.
    """
    names = _names_of_results(results_dir, outputs)
    results = list(_unlisted(results_dir, names))
    if not results:
        return 0
    records = [f"{path}{attached.SIDECAR}" for path in results]
    files_of_runs = [f"{results_dir}/{name}" for name in WITHOUT_RECORD]
    for path in (*results, *records, *files_of_runs):
        if os.path.isfile(path) and not os.path.islink(path):
            ledger.adopt(path)
    return len(results)


def _changed_result(path: Path, folder: Path) -> InputError:
    """Make the fault of a result that was changed after a study wrote it.

    `folder` is that of the ledger that lists the result.
    """
    source = "repose"
    removed = "this file, which is damaged or edited"
    # A run of another program is made again where its record is missing.
    if path.parent != folder:
        run = path.relative_to(folder).parts[0]
        source = "its run"
        removed = f"{removed}, and {folder / run}.json"
    return InputError(
        path,
        "content",
        "something else",
        f"a result as {source} wrote it; remove {removed}, and give the same command "
        "again",
    )


def _foreign_file(path: str) -> InputError:
    """Make the fault of a file that no study wrote, with the name of a result."""
    return InputError(
        path,
        "file",
        "there already",
        "a file that repose wrote; a result of the study has this name: move yours away",
    )
