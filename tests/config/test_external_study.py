"""The configuration of a study whose runs another program makes."""

import sys

import pytest
import yaml

from repose.calibrate.targets import OWN_BENCH
from repose.common import places
from repose.common.errors import InputError
from repose.config import dependencies, loader, results_folder
from repose.config.external import ExternalConfig
from repose.config.external_check import (
    describe_program,
    describe_strategy,
    list_runs,
    make_trial_run,
)
from repose.config.pipeline import PipelineConfig
from repose.stages import simulate

STUDY = {
    "simulator": {
        "name": "toy 1.0",
        "command": ["python", "toy.py"],
        "template": "deck.in.j2",
        "output": "out.json",
    },
    "label": "toy",
    "seed": 7,
    "strategy": "published",
    "seeds": 3,
    "parameters": {"friction": [0.2, 0.8], "rolling": {"fixed": 0.1}},
    "targets": {"angle": {"value": 30, "sd": 1, "repetitions": 4, "unit": "deg"}},
    "design": {"samples": 14},
    "validation": {"solutions": 2, "seeds": 4, "representative_seeds": 5},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.in.j2").write_text("{{ friction }} {{ rolling }}")


def loaded(check_inputs=False, **changes):
    with open("study.yaml", "w") as file:
        yaml.safe_dump(STUDY | changes, file)
    return PipelineConfig.load("study.yaml", check_inputs=check_inputs)


def simulator(**changes):
    return {"simulator": STUDY["simulator"] | changes}


def test_the_short_form_takes_a_note_for_the_report():
    assert loaded().settings.note is None
    assert loaded(note="Measured by A.").settings.note == "Measured by A."


def test_the_short_form_becomes_that_of_the_stages():
    study = loaded(check_inputs=True)
    assert isinstance(study, ExternalConfig)
    assert study.parameter_names == ("friction", "rolling")
    assert study.targets.apparatus == (OWN_BENCH,)
    assert study.targets[0].response.unit == "deg"
    # Two standard errors about the mean.
    assert study.targets[0].low == 29.0
    assert study.targets[0].high == 31.0
    assert study.settings.count_design_seeds(OWN_BENCH) == 3
    assert study.settings.design.seed == 7
    assert study.settings.measure is None
    assert study.settings.sequential.checks == 5
    assert study.study().settings.simulator == "toy 1.0"
    assert study.simulator.time_limit_s == 3600


def test_jobs_read_the_resolved_configuration_unchanged():
    study = loaded()
    loader.write_resolved(study.config, "config.json")
    again = PipelineConfig.of_results("config.json")
    assert isinstance(again, ExternalConfig)
    assert again.config == study.config
    assert again.settings.miga == study.settings.miga


def test_the_values_of_snakemake_give_the_same_study():
    study = loaded()
    layers = loader.locate_workflow_values(
        loader.read_file("study.yaml"), ["study.yaml"]
    )
    assert ExternalConfig.from_merged(layers).config == study.config


def test_a_pile_of_particles_has_a_section_measure():
    study = loaded(
        simulator={**STUDY["simulator"], "particles": {"file": "pile.dump"}},
        targets={"aor_deg": {"value": 30, "sd": 1, "repetitions": 4}},
        measure={"response": "flank"},
    )
    assert study.settings.measure.response == "flank"
    assert study.settings.measure.mm_per_pixel == "auto"
    assert study.definitions["aor_deg"]["measure.response"] == "flank"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            simulator(command="python toy.py"),
            r"simulator\.command .* a list of strings",
        ),
        (simulator(command=[]), r"simulator\.command"),
        (simulator(output="../out.json"), r"simulator\.output"),
        (simulator(shell=True), r"simulator\.shell .* known key"),
        (
            {"simulator": {"name": "toy", "command": ["python"]}},
            r"simulator\.output .* or `particles`",
        ),
        ({"validation": {"published": "sets.csv"}}, r"validation\.published .* null"),
    ],
)
def test_bad_sections_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        loaded(**changes)


def test_what_needs_our_simulator_is_refused():
    with pytest.raises(InputError, match="whose runs repose makes itself"):
        loaded().scene({"friction": 0.5})


def test_a_run_depends_on_deck_and_command_alone():
    def settings(**changes):
        return dependencies.select_stage_settings(loaded(**changes).config, "simulate")

    before = settings()
    assert settings(**simulator(name="toy 2.0", memory_mb=5000)) == before
    assert settings(network={"hidden": 3}) == before
    assert settings(**simulator(command=["python", "toy.py", "-x"])) != before
    assert settings(seed=8) != before
    with open("deck.in.j2", "a") as file:
        file.write("{{ seed }}")
    assert settings() != before


def test_the_runs_of_a_study_are_counted():
    assert list_runs(loaded().settings) == (
        ("design", 14, 3),
        ("answer", 1, 5),
        ("other solutions", 2, 4),
    )


def test_the_program_its_deck_and_its_runs_are_described(monkeypatch):
    monkeypatch.setattr(simulate, "find_program", lambda command: "/bin/python")
    study = loaded()
    program, deck, *_, responses, run = describe_program(study, study.simulator)
    assert program == "toy 1.0: python toy.py; the program is /bin/python"
    assert deck == "deck: deck.in, from deck.in.j2"
    assert responses == "responses: angle, from out.json"
    assert run == "resources of a run: cores 1, memory 1000 MB, at most 3600 s"


PROGRAM_OF_SEEDS = """
import json

given = json.load(open("parameters.json"))
json.dump({"angle": given["seed"]}, open("out.json", "w"))
"""


def test_a_trial_has_the_seed_of_the_first_run_of_the_design(tmp_path):
    """So what the trial shows is what the first run of the first sample meets."""
    (tmp_path / "toy.py").write_text(PROGRAM_OF_SEEDS)
    command = [sys.executable, str(tmp_path / "toy.py")]
    study = loaded(check_inputs=True, **simulator(command=command))
    lines = list(make_trial_run(study, study.simulator, 2))
    expected = simulate.draw_seed(STUDY["seed"], "design", sample=1, run=1)
    assert lines[0].startswith(f"trial run, seed {expected}, ")
    assert f"angle {expected:.4g} deg" in lines[1]
    elapsed_s = float(lines[0].split(", ")[2].removesuffix(" s"))
    # The design has 14 samples of 3 runs, and the check 5 and 2 times 4.
    assert lines[-1].startswith("55 runs as long as this one: about ")
    hours = float(lines[-1].split()[8])
    # The time is printed to a tenth of a second, the hours to two digits.
    hours_per_s = 55 / 2 / 3600
    rounding_h = 0.05 * hours_per_s + 0.05 * hours
    assert hours == pytest.approx(hours_per_s * elapsed_s, abs=rounding_h)


@pytest.mark.parametrize(("angle", "warns"), [("0.55", True), ("31.5", False)])
def test_a_trial_warns_of_an_angle_in_radians(angle, warns, tmp_path):
    program = PROGRAM_OF_SEEDS.replace('given["seed"]', angle)
    (tmp_path / "toy.py").write_text(program)
    command = [sys.executable, str(tmp_path / "toy.py")]
    study = loaded(check_inputs=True, **simulator(command=command))
    lines = list(make_trial_run(study, study.simulator, 2))
    warning = "  WARNING: column angle has 0.55, although its target is 30 deg; "
    assert lines[2].startswith(warning) is warns


def test_records_are_handed_over_as_counted_folders():
    records = results_folder.list_run_records("results/runs", {"001": 2, "002": 1})
    assert records == [
        "results/runs/001/1.json",
        "results/runs/001/2.json",
        "results/runs/002/1.json",
    ]
    folders = results_folder.count_records_by_folder(records)
    assert folders == ["results/runs/001=2", "results/runs/002=1"]


OURS = {
    "label": "pile",
    "funnel": {"seeds": 3, "berries": 150},
    "parameters": {"mus_gg": [0.3, 0.9], "e_gg": {"fixed": 0.3}},
    "targets": [
        {
            "response": "aor_deg",
            "apparatus": "funnel",
            "value": 30.0,
            "sd": 1.0,
            "repetitions": 4,
            "weight": 2.0,
        }
    ],
    "strategy": "published",
    "surrogate": "network",
    "design": {"samples": 20, "seed": 5},
}
ADDED = {
    "simulator": {
        "name": "LAMMPS",
        "command": ["lmp", "-var", "mu", "{{ mus_gg }}"],
        "particles": {"file": "pile.dump"},
    }
}


def merged(ours, added):
    for name, content in {"ours.yaml": ours, "added.yaml": added}.items():
        with open(name, "w") as file:
            yaml.safe_dump(content, file)
    return PipelineConfig.load("ours.yaml", "added.yaml")


def test_a_program_is_added_to_a_study_with_our_simulator():
    study = merged(OURS, ADDED)
    assert isinstance(study, ExternalConfig)
    assert study.parameters.free == ("mus_gg",)
    assert study.parameters.fixed == {"e_gg": 0.3}
    target = study.targets[0]
    assert (target.name, target.value, target.response.unit) == ("aor_deg", 30, "deg")
    assert study.settings.count_design_seeds(OWN_BENCH) == 3
    assert study.settings.design.seed == 5
    assert study.settings.design.samples == 20
    assert "funnel" not in study.config


def test_seeds_of_the_added_file_count():
    study = merged(OURS, ADDED | {"seeds": 2, "seed": 9})
    assert study.settings.count_design_seeds(OWN_BENCH) == 2
    assert study.settings.design.seed == 9


def test_a_faulty_target_of_such_a_study_is_named_with_its_file():
    targets = [OURS["targets"][0] | {"sd": -1.0}]
    with pytest.raises(InputError, match=r"^ours\.yaml: targets\.aor_deg\.sd is -1"):
        merged(OURS | {"targets": targets}, ADDED)


def test_missing_keys_have_the_defaults_of_a_study_with_our_simulator():
    """So a study stays the same when another program makes its runs."""
    names = ("label", "parameters", "targets", "funnel")
    ours = {name: OURS[name] for name in names} | {"funnel": {"berries": 150}}
    study = merged(ours, ADDED)
    defaults = loader.read_file(places.find_file(places.METHOD_CONFIG))
    assert study.settings.strategy == defaults["strategy"] == "published"
    assert study.settings.surrogate == defaults["surrogate"]
    assert study.settings.seeds == defaults["funnel"]["seeds"]
    assert study.settings.design.seed == defaults["design"]["seed"]
    assert study.settings.design.samples == defaults["design"]["samples"]


def test_a_mistyped_section_of_such_a_study_is_refused():
    with pytest.raises(InputError, match=r"^ours\.yaml: funel is .* a known key"):
        merged(OURS | {"funel": {"seeds": 9}}, ADDED)


def test_published_sets_are_to_be_deleted_from_the_file_that_names_them():
    ours = OURS | {"validation": {"published": "table4.csv"}}
    with pytest.raises(InputError, match=r"^ours\.yaml: .* delete this key$"):
        merged(ours, ADDED)


def test_a_program_without_a_study_says_what_is_missing():
    for name, content in {"lmp.yaml": ADDED, "t.yaml": {"seeds": 3}}.items():
        with open(name, "w") as file:
            yaml.safe_dump(content, file)
    message = (
        r"^lmp\.yaml: parameters is null; .*`--configfile config\.yaml lmp\.yaml`$"
    )
    with pytest.raises(InputError, match=message):
        PipelineConfig.load("lmp.yaml", "t.yaml")


def test_the_check_names_the_strategy_and_the_keys_that_are_not_read():
    ours = OURS | {
        "surrogate": "gaussian_process",
        "berry": {"density_kg_m3": 1250},
        "network": {"hidden": 3, "seed": 1},
    }
    study = merged(ours, ADDED)
    assert list(describe_strategy(study, ["ours.yaml", "added.yaml"])) == [
        "strategy: published, surrogate gaussian_process",
        "keys: the strategy published does not read network.hidden, network.seed",
        "keys: LAMMPS makes the runs, so these are not read: berry, funnel (except "
        "seeds); make sure that the program's own input agrees with them",
    ]
    study = loaded(strategy="sequential")
    lines = list(describe_strategy(study, ["study.yaml"]))
    assert lines[0] == "strategy: sequential"
    assert "design.samples" in lines[1]
    assert len(lines) == 2


def test_a_fixed_parameter_may_be_a_number_of_the_deck():
    with open("deck.in.j2", "w") as file:
        file.write("{{ friction }}")
    loaded(check_inputs=True, simulator=STUDY["simulator"] | {"command": ["python"]})
    parameters = STUDY["parameters"] | {"rolling": [0.1, 0.2]}
    with pytest.raises(InputError, match=r"parameters\.rolling is 'rolling'"):
        loaded(check_inputs=True, parameters=parameters)
