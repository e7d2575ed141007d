"""The folder of results, and what a stage stands on."""

import copy
import os
from pathlib import Path

import pandas as pd
from refusals import input_error, raised
from shared import ROOT, check_all, put

from repose.bench import bench, names
from repose.common import ledger, provenance
from repose.common.files import write_json, write_table, write_text
from repose.config import dependencies, results_folder
from repose.config.models import list_file_keys
from repose.config.pipeline import PipelineConfig


def test_the_wildcards_of_outputs_stand_for_what_rules_write():
    outputs = [
        "r/{runs}/{sample}.json",
        r"r/{strategy,a|b}/batch_{batch,\d{1,4}}/a.csv",
    ]
    ours = results_folder.make_output_pattern(outputs).fullmatch
    assert all(
        map(
            ours,
            ("r/heaps/001.json", "r/drum_runs/012.json", "r/refined/batch_1/a.csv"),
        )
    )
    assert not any(
        map(
            ours,
            (
                "r/heaps/a.json",
                "r/network/001.json",
                "r/published/batch_1/a.csv",
                "s/heaps/001.json",
            ),
        )
    )


NOT_A_STUDYS = (
    "/",
    ".",
    "..",
    "./",
    "~",
    "results/..",
    "results/../src",
    "/etc/../src",
    ".git",
    ".snakemake",
    "results/.git",
    "-rf",
    "results/-rf",
    "src",
    "src/repose",
    "examples",
    "tests/mine",
    "results/published",
    "a b",
    "a;b",
    "a\nb",
    "results\n",
    "$HOME",
    "{a}",
    "*",
    "",
    "a//b",
    "a'b",
    "a" * 1001,
    str(ROOT),
    str(ROOT / "src"),
    str(ROOT.parent),
    str(Path.home()),
)


def test_a_folder_that_is_not_a_studys_own_or_around_the_working_one_is_refused(
    config, tmp_path, monkeypatch
):
    def refused(folder):
        config["results_dir"] = folder
        input_error(r"results_dir is .*; expected a folder", PipelineConfig.of, config)

    check_all(refused, [(repr(folder), folder) for folder in NOT_A_STUDYS])
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    for folder in (tmp_path, tmp_path / "work", tmp_path / "work/resources"):
        config["results_dir"] = str(folder)
        input_error("results_dir", PipelineConfig.of, config)
    config["results_dir"] = str(tmp_path / "results")
    PipelineConfig.of(config)


def test_a_folder_that_has_lost_its_lists_is_taken_over_by_the_records_of_its_results(
    config, tmp_path
):
    """As after a copy without hidden files."""
    folder = tmp_path / "data"
    outputs = [f"{folder}/{name}" for name in ("dataset.csv", "heaps/{sample}.json")]
    config["results_dir"] = str(folder)

    def check():
        results_folder.check_no_foreign_files(str(folder), outputs)

    (folder / "published").mkdir(parents=True)
    (folder / "published/table.csv").write_text("theirs")
    table = pd.DataFrame({"x": [1]})
    with provenance.record_stage("dataset", (), lambda *_: {}):
        provenance.note_config(config)
        write_table(folder / "dataset.csv", table)
        write_json(folder / "heaps/001.json", {"x": 1})
    write_json(folder / "config.json", config)
    check()
    for path in folder.rglob(ledger.LEDGER):
        path.unlink()
    check()
    (folder / "heaps/002.json").write_text("theirs")
    input_error("heaps/002.json: file is 'there already'", check)
    (folder / "heaps/002.json").unlink()

    assert len(results_folder.restore_ledgers(str(folder), outputs)) == 2
    assert results_folder.restore_ledgers(str(folder), outputs) == []
    check()
    kept = {*folder.rglob("*")}
    assert folder / "published/.repose" not in kept
    (folder / "heaps/001.json").write_text("edited")
    input_error("heaps/001.json: content is 'something else'", check)
    write_json(folder / "config.json", {})
    write_table(folder / "dataset.csv", table)
    assert {*folder.rglob("*")} == kept


def test_a_folder_that_cannot_be_listed_is_reported(tmp_path, monkeypatch):
    (tmp_path / "heaps").mkdir()
    (tmp_path / ledger.LEDGER).touch()
    scandir = os.scandir

    def denied(path):
        if str(path).endswith("heaps"):
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", denied)
    raised(
        PermissionError,
        "heaps",
        results_folder.check_no_foreign_files,
        str(tmp_path),
        [f"{tmp_path}/heaps/{{sample}}.json"],
    )


def test_a_folder_with_somebodys_files_is_refused_and_a_studys_is_taken(
    config, tmp_path
):
    config["results_dir"] = str(tmp_path / "data")
    config["berry"] |= {"sizes": str(ROOT / "resources/berries.csv")}
    PipelineConfig.of(config).check_inputs()
    (tmp_path / "data/figures").mkdir(parents=True)
    (tmp_path / "data/figures/figure02.png").write_text("mine")
    (tmp_path / "data/notes").mkdir()

    def check():
        folder = config["results_dir"]
        results_folder.check_no_foreign_files(
            folder, [f"{folder}/figures/{{name}}.svg"]
        )

    input_error("there is figures, which no study of repose wrote", check)
    write_json(tmp_path / "data/config.json", config)
    check()
    os.remove(tmp_path / "data/.repose")
    input_error("move it away, or choose another folder", check)
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    figure = "data/figures/figure02.png"
    for way in (f"{figure}/results", "link", "link/results", "loop", "loop/results"):
        config["results_dir"] = str(tmp_path / way)
        input_error(
            "a file, or a link to nothing, is in its way",
            PipelineConfig.of(config).check_inputs,
        )


def test_a_changed_result_and_somebodys_file_in_the_place_of_a_result_are_reported_at_once(
    tmp_path,
):
    study = tmp_path / "study"
    for name in ("dataset.csv", "design/samples.csv"):
        write_text(study / name, "1\n")
    mine = [
        study / name
        for name in (
            "report.html",
            "network/network.json",
            "network/notes.txt",
            "logs/berry.log",
        )
    ]
    for path in mine:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    (study / "runs.csv").touch()
    results = (
        "dataset.csv",
        "design/samples.csv",
        "report.html",
        "network/network.json",
        "logs/berry.log",
        "runs.csv",
    )

    def reported():
        files = str(study), [f"{study}/{name}" for name in results]
        message = str(
            input_error("expected", results_folder.check_no_foreign_files, *files)
        )
        return [
            line.removeprefix(f"{study}/").partition(" is ")[0]
            for line in message.splitlines()
        ]

    assert reported() == ["network/network.json: file", "report.html: file"]
    (study / "dataset.csv").write_text("2\n")
    assert reported() == [
        "dataset.csv: content",
        "network/network.json: file",
        "report.html: file",
    ]
    (study / "design/samples.csv").unlink()
    (study / "design/samples.csv").mkdir()
    assert reported()[1] == "design/samples.csv: file"
    assert all(path.read_text() == "mine" for path in mine)


def in_reverse_order(value):
    """A configuration whose sections have their keys in reverse order."""
    if not isinstance(value, dict):
        return value
    return {key: in_reverse_order(value[key]) for key in reversed(value)}


def changed_key(config, section, key):
    return put(copy.deepcopy(config), f"{section}.{key}", "another")


def test_a_run_stands_on_its_scene_and_not_on_its_measurement(config):
    def check(name):
        measured_by = bench(name).measured_by
        scene = [("design", "seed")]
        scene += [("wall", key) for key in config["wall"]]
        scene += [("simulation", key) for key in config["simulation"]]
        scene += [(name, key) for key in {*config[name]} - {"seeds", *measured_by}]
        run = dependencies.select_simulation_settings(config, name)
        for section, key in scene:
            changed = changed_key(config, section, key)
            where = f"{section}.{key}"
            assert dependencies.select_simulation_settings(changed, name) != run, where

        measurement = [("measure", key) for key in config["measure"]]
        measurement += [(name, key) for key in measured_by]
        measured = dependencies.select_measurement_settings(config, name)
        following = dependencies.select_stage_settings(config, "next")
        for section, key in measurement:
            changed = changed_key(config, section, key)
            where = f"{section}.{key}"
            assert dependencies.select_simulation_settings(changed, name) == run, where
            assert (
                dependencies.select_measurement_settings(changed, name) != measured
            ), where
            assert dependencies.select_stage_settings(changed, "next") != following, (
                where
            )

    check_all(check, [(name, name) for name in names() if name in config])


def test_the_order_of_keys_changes_no_settings(config):
    other = in_reverse_order(config)
    for select in (
        dependencies.select_simulation_settings,
        dependencies.select_measurement_settings,
    ):
        for name in names():
            if name in config:
                assert str(select(other, name)) == str(select(config, name)), name
    settings = dependencies.select_sections(config, "berry", "miga")
    assert str(dependencies.select_sections(other, "berry", "miga")) == str(settings)


def test_keys_of_a_bench_test_define_what_its_targets_are():
    """No rule runs again for a key of a bench test without a target, so the files of before must stay good."""
    study = PipelineConfig.load()
    assert "height_mm" in study.definitions
    assert "drum_slip_deg" not in study.definitions
    other = copy.deepcopy(study.config)
    other["cylinder"]["diameter_mm"] *= 2
    other["drum"]["fit_share"] /= 2
    assert PipelineConfig.of(other).definitions == study.definitions
    other["targets"][1] |= {"response": "drum_slip_deg", "apparatus": "drum"}
    assert (
        PipelineConfig.of(other).definitions["drum_slip_deg"]["drum.fit_share"]
        == other["drum"]["fit_share"]
    )


def test_results_stand_on_the_content_of_named_files_and_not_on_figures(
    config, tmp_path
):
    for verb in ("material_card", "network", "report"):
        settings = dependencies.select_stage_settings(
            config | {"figures": {"format": ["png", "pdf"]}}, verb
        )
        assert settings == dependencies.select_stage_settings(config, verb)

    def settings_with(key, name, content):
        section, _, last = key.rpartition(".")
        path = tmp_path / name
        changed = copy.deepcopy(config)
        path.write_text(content)
        (changed[section] if section else changed)[last] = str(path)
        return dependencies.select_stage_settings(changed, "report")

    keys = list_file_keys()
    assert {"photograph", "berry.sizes", "validation.published"} <= set(keys)
    for key in keys:
        assert (
            settings_with(key, "a", "one")
            == settings_with(key, "b", "one")
            != settings_with(key, "b", "two")
        ), key
