"""Configuration files: how one is read, which of several counts, and the study that they make."""

import dataclasses
import json
from types import SimpleNamespace

import pytest
from pydantic import ValidationError
from refusals import input_error, raised
from shared import ROOT, written

import repose
from repose.calibrate.study import Study
from repose.common import places, reading
from repose.config import loader
from repose.config.loader import find_substitute_crop
from repose.config.pipeline import PipelineConfig
from repose.config.validation import ConfigChecks


@pytest.mark.parametrize(
    "text", ["2e-4", "2.0e-4", "2E-4", "+2e-04", "0.0002", ".2e-3"]
)
def test_numbers_may_be_written_in_any_way(tmp_path, text):
    path = written(tmp_path / "my.yaml", f"simulation: {{time_step_s: {text}}}\n")
    assert reading.read_yaml(path)["simulation"]["time_step_s"] == 2e-4
    written(path, f"one: &one {{a: {text}, b: 1}}\ntwo: {{<<: *one, b: 2}}\n")
    assert reading.read_yaml(path)["two"] == {"a": 2e-4, "b": 2}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("label: x\nyes: 3\n", "line 2: key is 'yes'; expected text"),
        ("label: x\n2020-01-02: 3\n", "line 2: key is '2020-01-02'; expected text"),
        (
            "heap:\n  seeds: 3\n  seeds: 4\n",
            "line 3: seeds is 'given again'; expected each key once",
        ),
        ("heap:\n  seeds: [3\n", "valid YAML"),
        ("- 3\n", "keys with values"),
        (None, "file is 'No such file"),
        ("heap:\n\tseeds: 3\n", "line 2 .*expected spaces in place of the tab"),
        ("", "content is 'empty'"),
        (
            "# mine\nlabel lentil\n\nberry:\n  sizes: a.csv\n",
            "line 2 is 'label lentil'; expected KEY: VALUE",
        ),
        (
            "berry:\n  sizes: a.csv\nlabel:lentil\n",
            "line 3 is 'label:lentil'; expected KEY: VALUE",
        ),
        *(
            (
                f"label: a\nb: {text}\n",
                f"line 2: value is '{text}'; expected a plain number",
            )
            for text in (
                "0100",
                "8:20",
                "1:30.5",
                "3_2.5",
                "5_00",
                "0x10",
                "0b11",
                "-010",
            )
        ),
        # lines that are good, and an error below
        ("a: [1,\n2,\n3]\nb: {x: 1\n", "valid YAML"),
        ('a: "one\ntwo words"\nb: [\n', "valid YAML"),
        ("? a\n: 1\nhttp://x: 1\nb: [\n", "valid YAML"),
    ],
)
def test_files_that_are_no_configuration(tmp_path, text, message):
    path = tmp_path / "my.yaml"
    if text is not None:
        path.write_text(text)
    input_error(f"my.yaml(.|\n)*{message}", reading.read_yaml, path)


def test_files_and_command_line_lie_over_each_other_for_verbs_and_workflow_alike(
    tmp_path,
):
    mine = written(
        tmp_path / "mine.yaml", "funnel: {seeds: 5, duration_s: 20}\nlabel: mine\n"
    )
    config = PipelineConfig.load(
        str(mine), overrides={"funnel": {"seeds": "6"}}, check_inputs=True
    ).config
    assert config["label"] == "mine"
    assert config["funnel"]["seeds"] == 6
    assert config["funnel"]["duration_s"] == 20
    assert config["funnel"]["berries"] == 500
    mine.write_text("funnel: {seeds: 5}\nparameters: {e_gg: {fixed: 0.3}}\n")
    expected = PipelineConfig.load(mine, check_inputs=True).config
    assert PipelineConfig.load(mine).config == expected
    input_error("nowhere.yaml", PipelineConfig.load, mine, tmp_path / "nowhere.yaml")
    first = written(tmp_path / "first.yaml", "parameters: {e_gg: {fixed: 0.3}}\n")
    second = written(
        tmp_path / "second.yaml", "parameters: {e_gg: {prior: {mean: 0.3, sd: 0.01}}}\n"
    )
    assert PipelineConfig.load(first, second).config["parameters"]["e_gg"] == {
        "prior": {"mean": 0.3, "sd": 0.01}
    }


def test_a_job_of_a_cluster_does_not_check_the_inputs_again(monkeypatch):
    monkeypatch.setattr(
        "repose.config.validation.ConfigChecks._check_named_files",
        lambda _: pytest.fail("the inputs were checked"),
    )
    assert PipelineConfig.load().config["label"]
    raised(pytest.fail.Exception, None, PipelineConfig.load, check_inputs=True)


def test_a_complete_file_and_the_built_in_crop_stand_in_for_the_folders_own(
    tmp_path, monkeypatch
):
    path = tmp_path / "results" / "config.json"
    config = PipelineConfig.load(check_inputs=True).config
    loader.write_resolved(config, path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("in the middle of an ed: [")
    assert PipelineConfig.load(path).config["funnel"] == config["funnel"]
    (tmp_path / "config.yaml").unlink()
    (tmp_path / "mine.yaml").write_text("label: mine\n")
    default_config = places.find_program_folder() / places.DEFAULT_CONFIG
    assert find_substitute_crop("mine.yaml") == default_config
    assert find_substitute_crop(str(default_config.parent / "quick.yaml")) is None


def test_a_fault_names_the_file_it_came_from(tmp_path):
    mine = tmp_path / "mine.yaml"
    layers = [
        ("funnel: {seeds: 0}\n", {}),
        ("label: mine\n", {"funnel": {"seeds": "0"}}),
    ]
    for text, overrides in (
        *layers,
        ("targets: [{response: height_mm, value: null}]\n", {}),
    ):
        mine.write_text(text)
        error = input_error(
            "expected",
            PipelineConfig.load,
            str(mine),
            overrides=overrides,
            check_inputs=True,
        )
        source = loader.COMMAND_LINE if overrides else str(mine)
        assert {fault.source for fault in getattr(error, "faults", [error])} == {source}


@pytest.mark.parametrize(
    "path",
    sorted((ROOT / "examples/bench_tests").glob("*.yaml")),
    ids=lambda path: path.stem,
)
def test_an_example_of_a_bench_test_goes_over_the_default(path):
    assert PipelineConfig.load(ROOT / "config/config.yaml", path).particle is not None


def test_a_key_of_a_section_with_a_fault_is_not_used():
    of_section = SimpleNamespace(invalid_keys={"funnel"})
    of_key = SimpleNamespace(invalid_keys={"funnel.seeds"})
    assert not ConfigChecks._is_key_valid(of_section, "funnel.seeds")
    assert not ConfigChecks._is_key_valid(of_key, "funnel.seeds")
    assert ConfigChecks._is_key_valid(of_key, "funnel.berries")


def test_a_study_stands_beside_the_package_has_its_parts_and_stays_as_it_is(quick):
    assert repose.Study is Study
    assert repose.PipelineConfig is PipelineConfig
    assert quick.settings.funnel.seeds == quick.config["funnel"]["seeds"] == 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        quick.config = {}
    with pytest.raises(ValidationError, match="frozen"):
        quick.settings.funnel.seeds = 3
    config = quick.config | {"network": {**quick.config["network"]}}
    del config["network"]["split"]
    assert PipelineConfig.of(config).config["network"]["split"] == [0.70, 0.15, 0.15]
    assert quick.parameters.dimensions == 6
    assert quick.targets.names == ("aor_deg", "height_mm")
    assert quick.folder.as_posix() == "results/quick"
    description = "e_gg, mus_gg, mur_gg, e_gp, mus_gp, mur_gp by aor_deg, height_mm, strategy published"
    assert repr(quick) == f"<PipelineConfig quick: {description}>"
    assert quick.grain is quick.grain
    assert quick.particle is quick.particle
    assert quick.grain["density_kg_m3"] == 840.47


def test_a_job_reads_what_was_checked_and_checks_it_only_if_somebody_changed_it(
    quick, tmp_path
):
    path = tmp_path / "config.json"
    wrong = quick.config | {"surrogate": "cubic"}
    # no study writes such a file: it loads, so nothing is checked
    loader.write_resolved(wrong, path)
    assert PipelineConfig.load(path).config == wrong
    path.write_text(json.dumps(wrong))
    input_error(r"config\.json: surrogate is 'cubic'", PipelineConfig.load, path)


def test_what_stands_on_a_fault_is_not_reported_beside_it(quick):
    """Each rule and file is checked where the sections that it reads are good."""
    config = quick.config | {
        "funnel": quick.config["funnel"] | {"outlet_diameter_mm": 150.0, "seeds": 0},
        "berry": quick.config["berry"] | {"sizes": "nowhere.csv", "stl": "nowhere.stl"},
        "validation": quick.config["validation"] | {"published": "nowhere.csv"},
        "simulation": quick.config["simulation"] | {"time_step_s": "auto"},
        "miga": quick.config["miga"] | {"tournament": 900},
    }
    found = {
        fault.key
        for fault in input_error(
            "expected", PipelineConfig.of, config, "mine.yaml", check_inputs=True
        ).faults
    }
    assert found == {
        "funnel.seeds",
        "miga.tournament",
        "berry.sizes",
        "berry.stl",
        "validation.published",
    }


def test_values_of_snakemake_are_read_as_the_file_of_each_key_has_them(tmp_path):
    path = written(
        tmp_path / "mine.yaml",
        "simulation: {time_step_s: 2e-4}\nmiga: {rounds: 20}\n",
    )
    # Snakemake's reader takes 2e-4 for a text, and its command line gives texts alone.
    values = {
        "simulation": {"time_step_s": "2e-4", "gravity_m_s2": "1.62"},
        "miga": {"rounds": 20, "seed": "7"},
    }
    config, origin = loader.merge_workflow_values(values, [path])
    assert config["simulation"]["time_step_s"] == 2e-4
    assert config["simulation"]["gravity_m_s2"] == 1.62
    assert config["miga"]["rounds"] == 20
    assert config["miga"]["seed"] == 7
    assert origin.find_file("simulation.time_step_s") == str(path)
    assert origin.find_file("miga.rounds") == str(path)
    assert origin.find_file("simulation.gravity_m_s2") == loader.COMMAND_LINE
    assert origin.find_file("miga.seed") == loader.COMMAND_LINE


def test_texts_of_the_command_line_are_read_wherever_they_stand():
    texts = {"seed": "7", "ranges": ["0.2", ("1e-3", "true")], "empty": " ", "two": 2}
    values = {"seed": 7, "ranges": [0.2, [1e-3, True]], "empty": " ", "two": 2}
    assert loader._parse_strings(texts) == values
