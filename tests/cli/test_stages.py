"""A verb as a stage: the files that its options name."""

from argparse import Namespace

import pytest

from repose.cli import main, stages


def test_files_are_those_of_inputs_by_name_of_plain_options_and_of_a_folders_dataset(tmp_path):
    for name in ("a.csv", "b=1.json", "dataset.csv"):
        (tmp_path / name).write_text("")
    options = {"input": [f"heap={tmp_path / 'a.csv'}"], "network": str(tmp_path / "b=1.json")}
    given = Namespace(verb="figure", out=str(tmp_path / "a.csv"), folder=str(tmp_path), level=3, **options)
    assert {path.name for path in stages.files_of(given)} == {"a.csv", "b=1.json", "dataset.csv"}


@pytest.mark.parametrize(("side", "status"), [(5, 0), (25, 0), (4.9, 2), (25.5, 2)])
def test_a_sheet_has_squares_of_5_to_25_mm(tmp_path, side, status):
    assert main(["marker", "--square-mm", str(side), "--out", str(tmp_path / "sheet.pdf")]) == status
