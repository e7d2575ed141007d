"""A strategy's answer goes through the same message, material card and report as the chain's."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from shared import ROOT, says, studied, target
from stage_runs import answer_of
from synthetic import SPACE, TARGETS, configuration, responses
from test_sequential import HEIGHT, SECTION, campaign

from repose.bench.parameters import PARAMETERS
from repose.calibrate.card import SOLUTION_RANGE
from repose.calibrate.runs import name_error_column
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.answer import select_separated
from repose.config.pipeline import PipelineConfig
from repose.grain.particle import Particle
from repose.measure.angles import MEAN_KEYS
from repose.report.page import page, sections
from repose.report.page.study import read_results
from repose.stages import batches, card, card_study

SPHERE = Particle(
    "ellipsoid",
    np.full((1, 3), 4e-3),
    1000.0,
    2.7e-7,
    2.7e-4,
    [1e-9] * 3,
    4e-3,
    0.0,
    0.0,
)
BERRY = {
    "long_mm": 8.0,
    "major_mm": 8.0,
    "minor_mm": 8.0,
    "n": 20,
    "density_kg_m3": 1000.0,
}
FILES = {
    "dataset": "dataset.csv",
    "runs": "runs.csv",
    "feasible": "solutions.csv",
    "summary": "summary.json",
    "table4": "table4.csv",
}
BERRY |= {
    "elastic_modulus_pa": 1e6,
    "shear_modulus_pa": 4e5,
    "poisson_ratio": 0.25,
    "scale_sd": 0.0,
}


def apart(solutions):
    """The section `miga` of so many solutions."""
    return MigaSettings.model_construct(distance=0.02, solutions=solutions)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("answer")
    campaign(folder)
    sections = {
        "wall": {"shear_modulus_pa": 1e9, "poisson_ratio": 0.3},
        "berry": {"size_distribution": "none"},
    }
    whole = PipelineConfig.load(ROOT / "config/config.yaml").config
    # The line is set here, as a study may change it.
    sections |= {
        "measure": whole["measure"] | {"response": "flank"},
        "funnel": whole["funnel"],
    }
    config = configuration(TARGETS, SPACE, sequential=SECTION, **sections)
    step = {"time_step_s": 1e-4, "gravity_m_s2": 9.81, "rest_energy_j": 1e-9}
    return folder, config | {
        "simulation": step
        | {"tension": "keep", "contact_law": "hertz_mindlin", "rolling_law": "budget"}
    }


def number(folder):
    return int(folder.name.rpartition("_")[2])


def of_files(folder, config):
    names = ("summary.json", "representative.csv", "solutions.csv")
    return answer_of(
        studied(config, strategy="sequential"), *(folder / name for name in names)
    )


def test_the_message_the_sets_and_the_card_report_the_answer_of_the_strategy(study):
    folder, config = study
    found = of_files(folder, config)
    expected = json.loads((folder / "summary.json").read_text())["answer"]
    assert dict(found.parameters) == pytest.approx(expected)
    assert found.feasible
    assert found.checks[0].runs == SECTION["checks"]
    assert f"all solutions: {folder}/solutions.csv" in str(found)
    table = pd.read_csv(folder / "solutions.csv")
    made = card_study.make_card(studied(config), found, BERRY, SPHERE, table)
    card.check_card(made, "card")
    assert made["interval"] == SOLUTION_RANGE
    assert made["out_of_reach"] is False
    assert made["reason"].startswith("The simulated ")
    assert made["tests"][0]["runs"] == SECTION["checks"]
    assert [test["definition"]["name"] for test in made["tests"]] == [
        "angle, flank",
        "Height",
    ]
    assert table["representative"].tolist() == [True] + [False] * (len(table) - 1)
    assert len(table) > 5
    for entry in TARGETS:
        assert table[entry.response.predicted].between(entry.low, entry.high).all()
    # and so does the simulator, within what a prediction of a few pours can be off: the ranges are 12 and 9 % wide
    assert abs(responses(table) / TARGETS.aim - 1).max() < 0.12
    unit = SPACE.unit(table[list(PARAMETERS)].to_numpy())
    assert len(select_separated(unit[1:], apart(99))) == len(unit) - 1
    assert select_separated(
        pd.DataFrame({"a": [0.0, 0.005, 0.3, 0.3, 0.5, 0.9]}).to_numpy(), apart(3)
    ).tolist() == [0, 2, 4]


def test_a_target_out_of_reach_is_no_success(study, tmp_path):
    targets = type(HEIGHT).of([target("height_mm", 140.0, 4.0, 130, 150)])
    campaign(tmp_path, targets)
    config = study[1] | configuration(targets, SPACE, sequential=SECTION)
    found = of_files(tmp_path, config)
    assert not found.feasible
    assert str(found).startswith("made_up: targets NOT met. Height ")
    assert (
        "No parameter set is predicted inside the range; the simulated Height lies "
        in found.reason
    )
    says(str(found), "a larger sequential.most_pours", "probably out of reach")
    assert json.loads((tmp_path / "summary.json").read_text())["stop"] == "out_of_reach"
    made = card_study.make_card(
        studied(config), found, BERRY, SPHERE, pd.read_csv(tmp_path / "solutions.csv")
    )
    card.check_card(made, "card")
    assert made["out_of_reach"] is True
    assert made["met"] is False


def test_the_report_of_a_strategy_has_the_answer_sliders_and_how_it_went(study):
    folder, config = study
    files = {name: folder / path for name, path in FILES.items()}
    runs = (
        pd.read_csv(sorted(folder.glob("batch_*"), key=number)[-1] / "runs.csv")
        .assign(reason="")
        .to_dict("records")
    )
    job = {"parameters": {}, "sample": 1, "runs": runs, "apparatus": "funnel"}
    (folder / "job.json").write_text(json.dumps(job))
    page.write_report(config, [folder / "job.json"], files, {}, folder / "report.html")
    shown = (folder / "report.html").read_text()
    for phrase in ("Batches:", "kriging", "Other parameters", "With a probability of "):
        assert phrase in shown
    study = read_results(config, [folder / "job.json"], files)
    predicted = page.make_script_data(study)["model"]["curves"]["mus_gg"]["mean"]
    assert predicted[-1][1] > predicted[0][1], "more friction, a higher pile"
    study.surrogate = None
    assert sections.make_other_parameters_section(study) is None
    assert page.make_script_data(study)["model"] is None


@pytest.mark.slow
def test_the_verbs_that_the_rules_call_write_card_and_report(
    tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    campaign(tmp_path, HEIGHT)
    config = PipelineConfig.load("config/quick.yaml").config
    expected = configuration(HEIGHT, SPACE)
    config |= {
        "targets": expected["targets"],
        "parameters": expected["parameters"],
        "strategy": "sequential",
    }
    config["sequential"] = SECTION
    # of the kept grain below, which was made with config/config.yaml
    config["berry"]["spheres"] = "fewest"
    Path("config.json").write_text(json.dumps(config))
    batches = map(str, sorted(tmp_path.glob("batch_*"), key=number))
    options = ["--config=config.json"]
    command("stage", "conclude", "sequential", *batches, *options, "--out=.")
    answered = [
        "--feasible=solutions.csv",
        "--summary=summary.json",
        "--representative=representative.csv",
    ]
    grain = [
        f"--{name}={ROOT / 'results/published/goji_berry/berry' / name}.json"
        for name in ("berry", "particle")
    ]
    command("stage", "material_card", *options, *grain, *answered, "--out=card.json")
    assert card.read_card("card.json")["met"] is True
    inputs = [f"--input={name}={path}" for name, path in FILES.items()]
    command(
        "stage",
        "report",
        *options,
        *inputs,
        "--table=Batches=batches.csv",
        "--out=report.html",
    )
    assert "Batches" in Path("report.html").read_text()


def test_the_answer_has_its_piles_by_every_definition_of_the_angle(tmp_path):
    runs = pd.DataFrame({"seed": range(4), "status": ["ok", "ok", "ok", "jammed"]})
    for name in (*TARGETS.names, *MEAN_KEYS.values()):
        runs[name] = [30.0, 32.0, 34.0, np.nan]
    best = dict.fromkeys(PARAMETERS, 0.3) | dict.fromkeys(TARGETS.predicted, 31.0)
    found = dict(notes={}, solutions=[best], predicted_error=[0.1] * len(TARGETS))
    found |= dict(feasible=True, message="", why="", pours=12)
    measure = PipelineConfig.load(ROOT / "config/config.yaml").settings.measure
    batches.write_answer(
        found,
        runs,
        tmp_path,
        parameters=SPACE,
        targets=TARGETS,
        measure=measure.model_copy(update={"response": "secant"}),
    )
    (row,) = pd.read_csv(tmp_path / "table4.csv").to_dict("records")
    for name in MEAN_KEYS.values():
        assert row[name] == pytest.approx(32.0)
        assert row[name_error_column(name)] == pytest.approx(2 / np.sqrt(3))
    assert row["line"] == "secant, foot to crest"
    lines = (
        pd.read_csv(tmp_path / "representative.csv")
        .set_index("response")["line"]
        .fillna("")
    )
    expected = {
        name: "secant, foot to crest" if name == "aor_deg" else ""
        for name in TARGETS.names
    }
    assert lines.to_dict() == expected
