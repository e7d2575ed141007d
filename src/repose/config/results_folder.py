"""The folder of a study's results: what `results_dir` may be.

Snakemake removes outputs before it makes them anew, and knows only their names. So a study starts in a folder that is
new, holds nothing of these names, or is a study's already.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from repose.core import ledger, places
from repose.core.errors import InputError, raise_together
from repose.core.ledger import LEDGER

# Folders of the project that results must never be written into.
OUR_OWN = (
    *("src", "config", "resources", "workflow", "profiles", "tests", "docs", "examples", "benchmarks"),
    "results/published",
)
# What the rules write there, first part of the path.
WRITTEN = (
    *(
        "card.json",
        "config.json",
        "dataset.csv",
        "dataset_summary.json",
        "report.html",
        "runs.csv",
        "snapshot.txt",
    ),
    *("benchmarks", "berry", "comparison", "cylinder_runs", "design", "discharge_runs", "drum", "drum_runs"),
    *("figures", "film", "heaps", "joint_targets", "logs", "measure", "measurement_study", "miga", "network"),
    *("noise", "pool", "posterior"),
    *("refined", "response_surface", "responses", "sensitivity", "sequential", "shape", "turning_runs"),
    *("validation", "warm_up"),
)
Faults = Iterator[tuple[str, str]]


def contradictions(results_dir: str) -> Faults:
    """Faults of the path alone.

    Parameters
    ----------
    results_dir : str
        Of the schema's pattern.

    Yields
    ------
    tuple of str
        Key, and what is allowed.
    """
    folder = Path(results_dir).resolve()
    roots = {Path.cwd(), places.root().resolve()}
    kept = [root / own for root in roots for own in OUR_OWN]
    around = {*roots, Path.home()}
    inside = any(folder.is_relative_to(own) for own in (*kept, places.PACKAGE))
    if inside or any(one.is_relative_to(folder) for one in around):
        yield "results_dir", f"a folder of its own, not around the project and outside {', '.join(OUR_OWN)}"


def taken(results_dir: str) -> Faults:
    """What is in the way of results.

    Parameters
    ----------
    results_dir : str

    Yields
    ------
    tuple of str
        Key, and what is allowed.
    """
    folder = Path(results_dir)
    if any(one.exists() and not one.is_dir() for one in (folder, *folder.parents)):
        yield "results_dir", "a folder; a file is in its way"
    elif folder.is_dir() and not _is_a_study(folder):
        there = [name for name in WRITTEN if (folder / name).exists()]
        if there:
            yield (
                "results_dir",
                f"a new folder, or one that a study wrote; there is {there[0]}, which no study of repose wrote",
            )


def refuse_changed(results_dir: str) -> None:
    """Refuse results that hold something else than what was written: nothing that stands on them would be right.

    Parameters
    ----------
    results_dir : str

    Raises
    ------
    InputError
        For all of them at once.
    """
    top = Path(results_dir)
    found = [path for path in ledger.changed(top) if path.name in WRITTEN]
    for part in WRITTEN:
        for folder, _, files in os.walk(top / part):
            found += ledger.changed(folder) if LEDGER in files else []
    allowed = (
        "what repose wrote; remove this file, which is damaged or edited, and give the same command again"
    )
    raise_together([InputError(path, "content", "something else", allowed) for path in sorted(found)])


def _is_a_study(folder):
    """Whether a study wrote its configuration there."""
    if (folder / LEDGER).is_file():
        return True
    for path in folder.glob("config*.json"):
        try:
            found = json.loads(path.read_bytes())
        except ValueError:
            continue
        if isinstance(found, dict) and {"label", "results_dir"} <= set(found):
            return True
    return False
