"""A verb as a stage: the files that its options name."""

import pytest

from repose.cli import VERBS, main, parser, stages


def test_files_are_those_of_inputs_by_name_of_plain_options_and_of_a_folders_dataset(tmp_path):
    for name in ("a.csv", "b=1.json", "dataset.csv"):
        (tmp_path / name).write_text("")
    words = [
        ["figure", "figure05", f"--input=heap={tmp_path / 'a.csv'}", f"--out={tmp_path / 'b=1.json'}"],
        ["sensitivity", f"--network={tmp_path / 'b=1.json'}"],
        ["stage", "propose", "refined", str(tmp_path)],
    ]
    named = [[path.name for path in stages.files_of(parser().parse_args(given))] for given in words]
    assert named == [["a.csv"], ["b=1.json"], ["dataset.csv"]]


def test_the_files_that_a_step_writes_are_not_among_its_inputs(tmp_path):
    # the samples of the next step, from an earlier run, were once an input of the step that writes them
    (tmp_path / "samples.csv").write_text("")
    words = ["stage", "propose", "sequential", f"--out={tmp_path}"]
    assert not list(stages.files_of(parser().parse_args(words)))


@pytest.mark.parametrize("name", ["config", "out"])
def test_no_verb_takes_its_folder_or_its_configuration_for_an_input(name):
    found = [option for verb in VERBS.values() for option in verb.options if option.attribute == name]
    assert len(found) > 5
    assert not any(option.recorded for option in found)


@pytest.mark.parametrize(("side", "status"), [(5, 0), (25, 0), (4.9, 2), (25.5, 2)])
def test_a_sheet_has_squares_of_5_to_25_mm(tmp_path, side, status):
    assert main(["marker", "--square-mm", str(side), "--out", str(tmp_path / "sheet.pdf")]) == status
