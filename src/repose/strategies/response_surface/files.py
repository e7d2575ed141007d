"""The response surface strategy on files: each step reads the runs of the steps before it."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from repose.core.files import write_json, write_table
from repose.strategies import answer
from repose.strategies.base import Studied, strategy
from repose.strategies.batches import propose, read, tables_of, write_samples

NAME = "response_surface"
Path_ = str | os.PathLike


def run_step(folders: Sequence[Path_], study: Studied, out_dir: Path_, samples_csv: Path_) -> str:
    """Write the analysis of the steps in `folders`, and the samples of the next step; return a message.

    Tables are written as CSV, mappings as JSON, by the names of the proposal's notes.
    """
    proposal = propose(NAME, study, folders)
    for name, found in proposal.notes.items():
        if isinstance(found, pd.DataFrame):
            write_table(Path(out_dir) / f"{name}.csv", found)
        elif isinstance(found, Mapping):
            write_json(Path(out_dir) / f"{name}.json", found)
    write_samples(proposal, samples_csv)
    return str(proposal.notes.get("why", ""))


def run_check(folders: Sequence[Path_], study: Studied, out_dir: Path_) -> pd.DataFrame:
    """Write check.csv and the files of `repose.strategies.answer.write`; return the table of check.csv.

    `folders` hold all steps, the check last; their runs are counted.
    """
    targets, section = study.targets, study.config[NAME]
    found = strategy(NAME).answer(study, read(folders, targets))
    check, best = found.notes["check"], found.notes["optimum"]
    write_table(Path(out_dir) / "check.csv", check)
    pours = len(tables_of(folders, targets)[1])
    of_surface, (_, checked) = tables_of(folders[-2:-1], targets)[0], tables_of(folders[-1:], targets)
    steps = (
        f"Screening: {section['screening_runs']} runs of a Plackett-Burman design and "
        f"{section['centres']} of the centre; kept: {', '.join(best['coded'])}.",
        "Steepest ascent towards the targets, to the best point of the path.",
        f"Surface: {len(of_surface)} parameter sets about it ({section['surface']}), a quadratic "
        "model for each response, and its optimum.",
        f"Check: the optimum was poured {len(checked)} more times. {pours} pours in all.",
    )
    details = {"surfaces_meet_targets": best["met"], "pours": pours}
    answer.write(found, checked, study, out_dir, steps, details)
    return check
