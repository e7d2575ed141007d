"""The folder of a study's results: allowed values of `results_dir`.

Snakemake removes outputs before it makes them anew, and knows only their names. So a study starts only in a folder that
is new or a study's already, and where no foreign file has the name of a result.
"""

import itertools
import os
import re
from collections.abc import Iterable
from pathlib import Path

from repose import bench as apparatus
from repose.calibrate import strategies
from repose.calibrate.seeds import UNNAMED
from repose.common import ledger, places
from repose.common.errors import InputError, raise_together
from repose.common.ledger import LEDGER
from repose.common.section import Contradictions, refuse

# Folders of the project that results must never be written into.
PROJECT_FOLDERS = (
    *(
        "src",
        "config",
        "resources",
        "workflow",
        "profiles",
        "tests",
        "docs",
        "examples",
        "benchmarks",
    ),
    *("research", ".ci", "results/published"),
)


def run_folder(test: str) -> str:
    """Return the folder of a bench test's runs in the folder of results."""
    return "heaps" if test == UNNAMED else f"{test}_runs"


WITHOUT_RESULTS = ("benchmarks", "logs")  # written anew by every job
NUMBERS = ("sample", "job", "seed", "batch")  # wildcards of rules
WILDCARD = re.compile(
    r"\{(\w+)(?:,(?:[^{}]|\{[^{}]*\})*)?\}"
)  # with its constraint, where it has one
CHANGED = (
    *("content", "something else"),
    "a result as repose wrote it; remove this file, which is damaged or edited, and give the same command again",
)
FOREIGN = (
    *("file", "there already"),
    "a file that repose wrote; a result of the study has this name: move yours away",
)


def apart(results_dir: str) -> str:
    """Return the path; refuse, as a validator, a folder of the project or around it."""
    folder = Path(results_dir).resolve()
    roots = {Path.cwd(), places.root().resolve()}
    kept = [root / own for root in roots for own in PROJECT_FOLDERS]
    around = {*roots, Path.home()}
    inside = any(folder.is_relative_to(own) for own in (*kept, places.PACKAGE))
    if inside or any(path.is_relative_to(folder) for path in around):
        refuse(
            [
                (
                    "",
                    f"a folder of its own, not around the project and outside {', '.join(PROJECT_FOLDERS)}",
                )
            ]
        )
    return results_dir


def existing_results(results_dir: str) -> Contradictions:
    """Yield faults of the path as it is now, as (key, allowed values)."""
    folder = Path(results_dir)
    if any(
        os.path.lexists(path) and not path.is_dir()
        for path in (folder, *folder.parents)
    ):
        yield "results_dir", "a folder; a file, or a link to nothing, is in its way"


def pattern_of(outputs: Iterable[str]) -> re.Pattern[str]:
    """Make the pattern of the paths that rules write; their wildcards stand in braces."""
    words = dict.fromkeys(NUMBERS, r"\d+") | {
        "runs": "|".join(map(run_folder, apparatus.names()))
    }
    words["strategy"] = "|".join(
        name for name in strategies.names() if name != "published"
    )

    def regex(path: str) -> str:
        parts = re.split(WILDCARD, path)
        parts[::2] = map(re.escape, parts[::2])
        parts[1::2] = [f"(?:{words.get(name, '[^/]+')})" for name in parts[1::2]]
        return "".join(parts)

    return re.compile("|".join(map(regex, dict.fromkeys(outputs))))


def check_no_foreign_files(results_dir: str, outputs: Iterable[str]) -> None:
    """Raise InputError, with all faults, if a result was changed, or if a foreign file has the name of a result.

    `outputs` are the paths that rules write, with their wildcards in braces.
    """
    if not os.path.isdir(results_dir):
        return
    outputs = list(outputs)
    below = {path.removeprefix(f"{results_dir}/").partition("/")[0] for path in outputs}
    is_ours, is_result = (
        pattern_of({*WITHOUT_RESULTS, *below}).fullmatch,
        pattern_of(outputs).fullmatch,
    )
    names = sorted(filter(is_ours, os.listdir(results_dir)))
    if names and not (Path(results_dir) / LEDGER).is_file():
        allowed = f"a new folder, or the folder of a study; there is {names[0]}, which no study of repose wrote"
        raise InputError("configuration", "results_dir", results_dir, allowed)
    faults: dict[str, tuple[str, str, str]] = {}
    below_each = (
        os.walk(f"{results_dir}/{name}")
        for name in names
        if name not in WITHOUT_RESULTS
    )
    for folder, _, files in itertools.chain([(results_dir, [], names)], *below_each):
        known = ledger.names(folder)
        faults |= {
            str(path): CHANGED for path in ledger.changed(folder) if path.name in files
        }
        for path in (f"{folder}/{name}" for name in files if name not in known):
            # an empty file holds nothing to lose; snakemake makes such marks
            if os.path.isfile(path) and os.path.getsize(path) and is_result(path):
                faults[path] = FOREIGN
    raise_together([InputError(path, *fault) for path, fault in sorted(faults.items())])
