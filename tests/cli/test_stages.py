"""A verb as a stage: the files that its options name."""

import pytest

from repose.cli import main, parser, stages


def test_files_are_those_of_inputs_by_name_of_plain_options_and_of_a_folders_dataset(tmp_path):
    for name in ("a.csv", "b=1.json", "dataset.csv"):
        (tmp_path / name).write_text("")
    words = [
        ["figure", "figure09", f"--input=heap={tmp_path / 'a.csv'}", f"--out={tmp_path / 'b=1.json'}"],
        ["sensitivity", f"--network={tmp_path / 'b=1.json'}"],
        ["stage", "refine_propose", str(tmp_path)],
    ]
    named = [[path.name for path in stages.files_of(parser().parse_args(given))] for given in words]
    assert named == [["a.csv"], ["b=1.json"], ["dataset.csv"]]


@pytest.mark.parametrize(("side", "status"), [(5, 0), (25, 0), (4.9, 2), (25.5, 2)])
def test_a_sheet_has_squares_of_5_to_25_mm(tmp_path, side, status):
    assert main(["marker", "--square-mm", str(side), "--out", str(tmp_path / "sheet.pdf")]) == status
