"""The worked crops: their folders are sound and know nothing of the goji berry; each runs end to end at small size."""

import json
import shutil
from pathlib import Path

import pytest

from repose.calibrate.parameter_space import find_range
from repose.calibrate.responses import response
from repose.cli import STAGES
from repose.common import places
from repose.common.files import read_table
from repose.common.provenance import engine_hash
from repose.config import dependencies, loader
from repose.config.pipeline import PipelineConfig
from repose.stages import card
from repose.stages.card_study import describe_response
from repose.stages.published import read_parameter_sets

CROPS = places.find_program_folder() / "crops"
NAMES = sorted(path.parent.name for path in CROPS.glob("*/config.yaml"))

# A pour of a tenth of a second. The numbers mean nothing.
SMALL = {
    "label": "small",
    "design": {"samples": 18},
    "funnel": {"duration_s": 0.9, "seeds": 1, "rest_motion_mm": 100},
    "simulation": {"rest_energy_j": 1.0e-3},
    "measure": {"views": 2, "mm_per_pixel": 0.1},
    "network": {"hidden": 2, "starts": 1, "epochs": 50, "replicates": False},
    "miga": {
        "islands": 2,
        "population": 20,
        "rounds": 5,
        "generations": 5,
        "solutions": 10,
    },
    "validation": {"seeds": 1, "representative_seeds": 1},
}


def test_there_are_four_of_different_shape_and_size():
    assert NAMES == ["maize", "rapeseed", "soybean", "wheat"]
    shapes = {}
    for name in NAMES:
        long, major, minor = read_table(CROPS / name / "sizes.csv").iloc[-1][
            ["long_mm", "major_mm", "minor_mm"]
        ]
        shapes[name] = long / major, major / minor
    assert shapes["wheat"][0] > 2 > 1.5 > max(shapes["soybean"])
    assert shapes["maize"][0] > 1.4 < shapes["maize"][1]


@pytest.mark.parametrize("name", NAMES)
def test_a_crop_stands_on_its_own_numbers_and_so_does_its_card(name, monkeypatch):
    monkeypatch.chdir(CROPS / name)
    study = PipelineConfig.load(check_inputs=True)
    config = study.config
    PipelineConfig.of(config, name)
    assert not {"drum", "cylinder"} & set(config)
    assert config["berry"]["sizes"] == "sizes.csv"
    if config["validation"]["published"]:
        assert len(read_parameter_sets(config["validation"]["published"])) == 1
    text = Path("README.md").read_text()
    target = config["targets"][0]
    for value in (
        config["berry"]["density_kg_m3"],
        config["berry"]["poisson_ratio"],
        target["value"],
    ):
        assert f"{value:g}" in text or f"{value:.2f}" in text
    assert "assumed" in text
    shown = card.read_card(CROPS / "cards" / f"{name}.json")
    assert shown["material"] == name
    expected = [target["value"] for target in config["targets"]]
    assert [test["measured"] for test in shown["tests"]] == expected
    for parameter, entry in config["parameters"].items():
        low, high = find_range(parameter, entry)
        assert low <= shown["parameters"][parameter]["value"] <= high
    assert shown["grain"]["density_kg_m3"] == config["berry"]["density_kg_m3"]
    axes = dict(
        zip(
            ("long_mm", "major_mm", "minor_mm"),
            shown["grain"]["mean_axes_mm"],
            strict=True,
        )
    )
    for test in shown["tests"]:
        result = describe_response(study, response(test["response"]), axes)
        assert {key: test[key] for key in result} == result


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_it_runs_from_sizes_to_card_at_small_size(name, tmp_path, monkeypatch, command):
    shutil.copytree(
        CROPS / name,
        tmp_path,
        dirs_exist_ok=True,
        ignore=shutil.ignore_patterns("results", ".*"),
    )
    monkeypatch.chdir(tmp_path)
    # fewer seeds of 2 mm are no pile on this plate
    berries = {"rapeseed": 400}.get(name, 120)
    config = PipelineConfig.load(
        overrides=SMALL | {"funnel": SMALL["funnel"] | {"berries": berries}},
        check_inputs=True,
    ).config
    PipelineConfig.of(config, name).check_inputs()
    loader.write_resolved(config, "results/config.json")

    def do(verb, *arguments):
        stage = ["stage"] if verb in STAGES else []
        command(*stage, verb, *arguments, "--config", "results/config.json")

    def pour(samples, numbers, purpose, folder):
        for number in numbers:
            arguments = [
                "--samples",
                samples,
                "--sample",
                f"{number:03}",
                "--seeds",
                "1",
                "--purpose",
                purpose,
            ]
            do("pour", "--apparatus", "funnel", *arguments, "--out", folder)
            do("measure_runs", f"{folder}/{number:03}.pours.json", "--out", folder)

    for stage in ("berry", "shape", "design"):
        do(stage)
    pour(
        "results/design/samples.csv",
        range(1, SMALL["design"]["samples"] + 1),
        "design",
        "results/heaps",
    )
    for arguments in (
        ["dataset", "results/heaps"],
        ["network"],
        ["miga"],
        ["solutions"],
    ):
        do(*arguments)
    answer_file = "results/validation/solutions.csv"
    published = "results/validation/published_solutions.csv"
    poured = {answer_file: list(read_table(answer_file)["sample"]), published: []}
    if config["validation"]["published"]:
        do("published_solutions")
        poured[published] = [101]
    for table, numbers in poured.items():
        pour(table, numbers, "validation", "results/validation/heaps")
    do(
        "validate",
        *(
            f"results/validation/heaps/{number:03}.json"
            for number in poured[answer_file]
        ),
    )
    if poured[published]:
        do("published_sets", "results/validation/heaps/101.json")
        (row,) = read_table(
            "results/published_sets.csv", ("source", "n_seeds")
        ).to_dict("records")
        assert row["engine"] == engine_hash()
        assert row["scene"] == dependencies.hash_scene(config)
        # runs of other settings than today's are refused
        loader.write_resolved(
            config | {"wall": config["wall"] | {"poisson_ratio": 0.1}}, "other.json"
        )
        command(
            "stage",
            "published_sets",
            "results/validation/heaps/101.json",
            "--config",
            "other.json",
            status=2,
        )
    do("material_card")
    assert "mus_gg" in command("card", "show", "results/card.json").out
    assert json.loads(Path("results/card.json").read_text())["material"] == "small"


@pytest.mark.parametrize(
    "arguments",
    ["drum --seed 1", "pour --apparatus drum --samples s.csv --sample 1 --seeds 1"],
    ids=["drum", "pour"],
)
def test_what_a_crop_has_no_section_for_is_refused_in_one_line(
    arguments, monkeypatch, command
):
    monkeypatch.chdir(CROPS / "wheat")
    message = command(
        "stage", *arguments.split(), "--config", "config.yaml", status=2
    ).err
    assert "configuration: drum is None; expected a section of this name" in message
