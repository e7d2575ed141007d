"""Tables that were cut, mixed or damaged are refused, by the row and the value."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
import shared

from repose.chain.tables import read_dataset, read_runs
from repose.core.errors import InputError
from repose.core.targets import Targets

STUDY = Path(__file__).parents[2] / "results/published/recommended"
TARGETS = Targets.of(shared.TARGETS)


@pytest.fixture
def study(tmp_path):
    """The tables of a finished study."""
    for name in ("dataset.csv", "runs.csv", "dataset_summary.json"):
        shutil.copy(STUDY / name, tmp_path)
    return tmp_path


def read(study):
    """Both tables of a folder."""
    dataset = read_dataset(study / "dataset.csv", TARGETS)
    return dataset, read_runs(study / "runs.csv", TARGETS, dataset, study / "dataset.csv")


def test_a_whole_study_is_read(study):
    dataset, runs = read(study)
    assert (len(dataset), len(runs)) == (150, 900)


@pytest.mark.parametrize(("name", "rows"), [("dataset.csv", 150), ("runs.csv", 900)])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.51, 0.8])
def test_a_table_cut_anywhere_is_refused(study, name, rows, share):
    content = (study / name).read_bytes()
    (study / name).write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=rf"{name}.*(cells is|rows is \d+; expected {rows})"):
        read(study)


def changed(study, name, row, column, value):
    """One cell of a table changed."""
    table = pd.read_csv(study / name, dtype=object, keep_default_na=False)
    table.loc[row, column] = value
    table.to_csv(study / name, index=False)


@pytest.mark.parametrize(
    ("name", "column", "value", "message"),
    [
        ("dataset.csv", "aor_deg", "inf", "row 3: aor_deg is inf; expected a finite number"),
        ("dataset.csv", "aor_deg", "nan", "row 3: aor_deg is nan; expected a number from 1 to 89"),
        ("dataset.csv", "aor_deg", "", "row 3: aor_deg is nan; expected a number from 1 to 89"),
        ("dataset.csv", "aor_deg", "1000", "row 3: aor_deg is 1000.0; expected a number from 1 to 89"),
        ("dataset.csv", "aor_deg", "steep", "row 3: aor_deg is 'steep'; expected a finite number"),
        ("dataset.csv", "aor_deg", "31.0", "mean of aor_deg is .*; expected 31, its mean in"),
        ("dataset.csv", "aor_se_deg", "", "standard error of aor_deg is .*; expected nan, its standard error in"),
        ("dataset.csv", "aor_se_deg", "-0.5", "standard error of aor_deg is .*; expected -0.5, its"),
        ("dataset.csv", "e_gg", "", "row 3: e_gg is nan; expected 0.01 to 1"),
        ("dataset.csv", "e_gg", "-0.2", "row 3: e_gg is -0.2"),
        ("dataset.csv", "sample", "2", "row 3: sample is .2.; expected each once"),
        ("runs.csv", "sample", "2", "sample and seed|sample 1: ok runs is 5; expected 6"),
        ("runs.csv", "sample", "151", "sample is 151"),
        ("runs.csv", "aor_deg", "-inf", "row 3: aor_deg is -inf; expected a finite number"),
        ("runs.csv", "aor_deg", "1000", "row 3: aor_deg is 1000.0"),
        ("runs.csv", "aor_deg", "30.5", "sample 1: mean of aor_deg is"),
        ("runs.csv", "status", "jammed", "sample 1: ok runs is 5; expected 6"),
    ],
)
def test_a_damaged_cell_is_reported(study, name, column, value, message):
    changed(study, name, 2, column, value)
    with pytest.raises(InputError, match=message):
        read(study)


def test_a_seed_that_is_there_twice_or_lost_is_reported(study):
    lines = (study / "runs.csv").read_text().splitlines(keepends=True)
    (study / "runs.csv").write_text("".join([*lines[:2], lines[1], *lines[3:]]))
    with pytest.raises(InputError, match=r"row 2: sample and seed is \[.*\]; expected each once"):
        read(study)
    (study / "runs.csv").write_text("".join([lines[0], *lines[2:]]))
    with pytest.raises(InputError, match="rows is 899; expected 900"):
        read(study)


def test_runs_of_another_study_are_refused(study):
    shutil.copy(STUDY.parent / "paper/runs.csv", study)
    with pytest.raises(InputError, match=r"runs\.csv: rows is 150; expected 900"):
        read(study)
    summary = json.loads((study / "dataset_summary.json").read_text())
    (study / "dataset_summary.json").write_text(json.dumps(summary | {"runs": 150}))
    with pytest.raises(InputError, match=r"sample 1: ok runs is 1; expected 6"):
        read(study)
