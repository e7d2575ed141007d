"""Tables that were cut, mixed or damaged are refused, by the row and the value."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
import shared
from refusals import input_error

from repose.chain.tables import read_dataset, read_runs
from repose.core.targets import Targets

STUDY = Path(__file__).parents[2] / "results/published/recommended"
TARGETS = Targets.of(shared.TARGETS)


@pytest.fixture
def tables(tmp_path):
    for name in ("dataset.csv", "runs.csv", "dataset_summary.json"):
        shutil.copy(STUDY / name, tmp_path)
    return tmp_path


def read(tables):
    dataset = read_dataset(tables / "dataset.csv", TARGETS)
    return dataset, read_runs(tables / "runs.csv", TARGETS, dataset, tables / "dataset.csv")


def test_a_whole_study_is_read(tables):
    dataset, runs = read(tables)
    assert (len(dataset), len(runs)) == (150, 900)


@pytest.mark.parametrize(("name", "rows"), [("dataset.csv", 150), ("runs.csv", 900)])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.51, 0.8])
def test_a_table_cut_anywhere_is_refused(tables, name, rows, share):
    content = (tables / name).read_bytes()
    (tables / name).write_bytes(content[: int(share * len(content))])
    input_error(rf"{name}.*(cells is|rows is \d+; expected {rows})", read, tables)


def changed(tables, name, row, column, value):
    table = pd.read_csv(tables / name, dtype=object, keep_default_na=False)
    table.loc[row, column] = value
    table.to_csv(tables / name, index=False)


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
def test_a_damaged_cell_is_reported(tables, name, column, value, message):
    changed(tables, name, 2, column, value)
    input_error(message, read, tables)


def test_runs_twice_lost_or_of_another_study_are_refused(tables):
    lines = (tables / "runs.csv").read_text().splitlines(keepends=True)
    (tables / "runs.csv").write_text("".join([*lines[:2], lines[1], *lines[3:]]))
    input_error(r"row 2: sample and seed is \[.*\]; expected each once", read, tables)
    (tables / "runs.csv").write_text("".join([lines[0], *lines[2:]]))
    input_error("rows is 899; expected 900", read, tables)
    shutil.copy(STUDY.parent / "paper/runs.csv", tables)
    input_error(r"runs\.csv: rows is 150; expected 900", read, tables)
    summary = json.loads((tables / "dataset_summary.json").read_text())
    (tables / "dataset_summary.json").write_text(json.dumps(summary | {"runs": 150}))
    input_error(r"sample 1: ok runs is 1; expected 6", read, tables)
