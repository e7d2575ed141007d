"""Configuration files: how one is read, and which of several counts."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from repose.config import loader, reading
from repose.config.loader import own_crop_under
from repose.config.making import Making
from repose.config.study import Study
from repose.core import places
from repose.core.errors import InputError

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.mark.parametrize("text", ["2e-4", "2.0e-4", "2E-4", "+2e-04", "0.0002", ".2e-3"])
def test_numbers_may_be_written_in_any_way(tmp_path, text):
    path = tmp_path / "my.yaml"
    path.write_text(f"simulation: {{time_step_s: {text}}}\n")
    assert reading.read(path)["simulation"]["time_step_s"] == 2e-4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("heap:\n  seeds: 3\n  seeds: 4\n", "line 3: seeds is 'given again'; expected each key once"),
        ("heap:\n  seeds: [3\n", "valid YAML"),
        ("heap:\n\tseeds: 3\n", "line 2 .*valid YAML .indent by spaces, no tabs"),
        ("", "content is 'empty'"),
        ("# mine\nlabel lentil\n\nberry:\n  sizes: a.csv\n", "line 2 is 'label lentil'; expected KEY: VALUE"),
        ("berry:\n  sizes: a.csv\nlabel:lentil\n", "line 3 is 'label:lentil'; expected KEY: VALUE"),
        # lines that are good, and an error below
        ("a: [1,\n2,\n3]\nb: {x: 1\n", "valid YAML"),
        ('a: "one\ntwo words"\nb: [\n', "valid YAML"),
        ("? a\n: 1\nhttp://x: 1\nb: [\n", "valid YAML"),
        ("- 3\n", "keys with values"),
    ],
)
def test_files_that_are_no_configuration(tmp_path, text, message):
    path = tmp_path / "my.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        reading.read(path)
    assert "my.yaml" in str(caught.value)


def test_a_file_that_is_not_there():
    with pytest.raises(InputError, match=r"nowhere\.yaml: file is 'No such file"):
        reading.read("nowhere.yaml")


def test_files_and_command_line_lie_over_each_other(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("funnel: {seeds: 5, duration_s: 20}\nlabel: mine\n")
    config = Study.load(str(mine), overrides={"funnel": {"seeds": "6"}}, inputs=True).config
    assert (config["label"], config["funnel"]["seeds"], config["funnel"]["duration_s"]) == ("mine", 6, 20)
    assert config["funnel"]["berries"] == 500


def test_a_job_of_a_cluster_does_not_check_the_inputs_again(monkeypatch):
    def slow(*_):
        raise AssertionError("the inputs were checked")

    monkeypatch.setattr("repose.config.making.Making._read_files", slow)
    assert Study.load().config["label"]
    with pytest.raises(AssertionError):
        Study.load(inputs=True)


def test_a_verb_reads_a_partial_file_as_the_workflow_does(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("funnel: {seeds: 5}\nparameters: {e_gg: {fixed: 0.3}}\n")
    assert Study.load(mine).config == Study.load(mine, inputs=True).config
    with pytest.raises(InputError) as caught:
        Study.load(mine, tmp_path / "nowhere.yaml")
    assert "nowhere.yaml" in str(caught.value)


def test_a_parameter_of_a_later_file_replaces_that_of_an_earlier_one_as_a_whole(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("parameters: {e_gg: {fixed: 0.3}}\n")
    second.write_text("parameters: {e_gg: {prior: {mean: 0.3, sd: 0.01}}}\n")
    assert Study.load(first, second).config["parameters"]["e_gg"] == {"prior": {"mean": 0.3, "sd": 0.01}}


def test_a_complete_file_does_not_read_the_folders_own(tmp_path, monkeypatch):
    """An edit of config.yaml during a run does not reach the run's jobs."""
    path = tmp_path / "results" / "config.json"
    config = Study.load(inputs=True).config
    loader.write_resolved(config, path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("in the middle of an ed: [")
    assert Study.load(path).config["funnel"] == config["funnel"]


def test_a_fault_names_the_file_it_came_from(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("funnel: {seeds: 0}\n")
    with pytest.raises(InputError) as caught:
        Study.load(str(mine), inputs=True)
    assert caught.value.source == str(mine)
    with pytest.raises(InputError) as caught:
        Study.load(overrides={"funnel": {"seeds": "0"}}, inputs=True)
    assert caught.value.source == loader.COMMAND_LINE
    mine.write_text("targets: [{response: height_mm, value: null}]\n")
    with pytest.raises(InputError) as caught:
        Study.load(str(mine), inputs=True)
    assert all(fault.source == str(mine) for fault in caught.value.faults)


@pytest.mark.parametrize("path", sorted((ROOT / "examples/bench_tests").glob("*.yaml")), ids=lambda path: path.stem)
def test_an_example_of_a_bench_test_goes_over_the_default(path):
    """With the files that it names: the goji berry's shape study has no responses of other bench tests."""
    assert Study.load(ROOT / "config/config.yaml", path).particle is not None


def test_the_built_in_crop_stands_in_for_a_file_of_ones_own_alone(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text("label: mine\n")
    monkeypatch.chdir(tmp_path)
    own = places.root() / places.DEFAULT_CONFIG
    assert own_crop_under("mine.yaml") == own
    assert own_crop_under(str(own.parent / "quick.yaml")) is None


def test_a_key_of_a_section_with_a_fault_is_not_used():
    of_section, of_key = (SimpleNamespace(bad={bad}) for bad in ("funnel", "funnel.seeds"))
    assert not Making._may_use(of_section, "funnel.seeds")
    assert not Making._may_use(of_key, "funnel.seeds")
    assert Making._may_use(of_key, "funnel.berries")
