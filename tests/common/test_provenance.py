"""What results stand on: written with them, read again, and compared before they are put together."""

import json
import os

import cv2
import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from shared import written

from repose.common import attached, files, places, provenance
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig

CONFIG = PipelineConfig.load(places.find_program_folder() / "config/quick.yaml").config
KEYS = {
    "verb",
    "settings",
    "engine",
    "origin",
    "seed",
    "repose",
    "commit",
    "processor",
    "python",
    "numpy",
    "numba",
}
WRITERS = {
    "a.json": lambda path: files.write_json(path, {"x": 1}),
    "a.npz": lambda path: files.write_npz(path, {"x": np.arange(3)}),
    "a.png": lambda path: files.write_image(path, np.full((4, 5, 3), 7, np.uint8)),
    "a.csv": lambda path: files.write_table(path, pd.DataFrame({"x": [1, 2]})),
    "a.html": lambda path: files.write_text(path, "<p>"),
}


def changed(**sections):
    return CONFIG | {name: CONFIG[name] | keys for name, keys in sections.items()}


def run(
    verb,
    paths,
    write,
    config=CONFIG,
    apparatus=None,
    strategy=None,
    check=None,
):
    def settings_of(configuration, bench_test):
        return dependencies.select_stage_settings(
            configuration, verb, bench_test, strategy_name=strategy
        )

    runs = {"pour": "made", "measure_runs": "measured"}.get(verb, "")
    with provenance.record_stage(
        verb, paths, settings_of, apparatus, runs, strategy, check
    ):
        provenance.note_config(config)
        write()


def pour(path, config=CONFIG, apparatus="funnel"):
    run("pour", (), lambda: files.write_json(path, {"pours": []}), config, apparatus)
    return path


@pytest.mark.parametrize("name", WRITERS)
def test_every_type_of_file_carries_the_record_and_equal_runs_are_equal_bytes(
    tmp_path, name
):
    paths = [tmp_path / folder / name for folder in ("one", "two")]
    for path in paths:
        run("design", (), lambda path=path: WRITERS[name](path))
    record = attached.read_record(paths[0])
    assert set(record) == KEYS
    assert record["verb"] == "design"
    assert record["seed"] == CONFIG["design"]["seed"]
    assert record["engine"] is None
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes()


def test_readers_leave_the_record_out_and_without_a_stage_a_file_is_plain(tmp_path):
    for name, write in WRITERS.items():
        write(tmp_path / name)
        assert attached.read_record(tmp_path / name) is None
    assert {path.name for path in tmp_path.iterdir()} == {*WRITERS, ".repose"}
    run(
        "design",
        (),
        lambda: [write(tmp_path / name) for name, write in WRITERS.items()],
    )
    assert files.read_json(tmp_path / "a.json") == {"x": 1}
    assert list(files.read_npz(tmp_path / "a.npz")) == ["x"]
    assert list(files.read_table(tmp_path / "a.csv")) == ["x"]
    expected = np.full((4, 5, 3), 7)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png")), expected)


@pytest.mark.parametrize(
    ("verb", "same", "other"),
    [
        ("pour", {"network": {"hidden": 3}}, {"simulation": {"gravity_m_s2": 1.62}}),
        ("pour", {"funnel": {"seeds": 9}}, {"funnel": {"berries": 9}}),
        ("measure_runs", {"miga": {"islands": 9}}, {"measure": {"mm_per_pixel": 9.0}}),
        ("network", {"miga": {"islands": 9}}, {"network": {"hidden": 3}}),
        ("network", {"drum": {"seeds": 9}}, {"simulation": {"gravity_m_s2": 1.62}}),
        ("miga", {"posterior": {"walkers": 99}}, {"network": {"hidden": 3}}),
        ("material_card", {}, {"funnel": {"berries": 9}}),
    ],
)
def test_settings_are_those_that_the_stage_and_the_results_it_reads_stand_on(
    tmp_path, verb, same, other
):
    settings = []
    for k, changes in enumerate(({}, {"design": {}}, same, other)):
        path = tmp_path / f"{k}.json"
        config = changed(**changes) | {"label": f"study {k}", "results_dir": str(k)}
        run(verb, (), lambda path=path: files.write_json(path, {}), config)
        settings.append(attached.read_record(path)["settings"])
    assert settings[0] == settings[1] == settings[2] != settings[3]


def test_a_berrys_sizes_count_by_their_content(tmp_path):
    sizes = tmp_path / "sizes.csv"
    hashes = []
    for folder, text in (("a", "1"), ("b", "1"), ("b", "2")):
        sizes = written(tmp_path / f"{folder}.csv", text)
        hashes.append(
            provenance.hash_content(
                dependencies.select_stage_settings(
                    changed(berry={"sizes": str(sizes)}), "berry"
                )
            )
        )
    assert hashes[0] == hashes[1] != hashes[2]


def test_the_origin_follows_the_files_and_names_the_engine(tmp_path):
    pours = [
        pour(tmp_path / "a.json"),
        pour(tmp_path / "b.json", changed(wall={"poisson_ratio": 0.2})),
    ]
    origins = []
    for path in pours:
        out = path.with_suffix(".measured.json")
        run("measure_runs", [path], lambda out=out: files.write_json(out, {}))
        record = attached.read_record(out)
        assert record["apparatus"] == "funnel"
        assert record["engine"] == provenance.engine_hash()
        origins.append(record["origin"])
    assert origins[0] != origins[1]


def test_runs_and_results_of_two_settings_or_engines_are_refused_and_named(
    tmp_path, monkeypatch
):
    paths = [
        pour(tmp_path / "a.json"),
        pour(tmp_path / "b.json", changed(simulation={"gravity_m_s2": 1.62})),
    ]
    other = r"b\.json: provenance\.origin is '\w{16}'; expected .* as in .*a\.json"
    input_error(other, run, "measure_runs", paths, lambda: None)
    run(
        "measure_runs",
        [paths[0], pour(tmp_path / "c.json", apparatus="drum")],
        lambda: None,
    )
    first = pour(tmp_path / "a.json")
    monkeypatch.setattr(
        provenance, "describe_machine", lambda: {"processor": "another"}
    )
    run("measure_runs", [first, pour(tmp_path / "b.json")], lambda: None)
    run(
        "dataset",
        [first],
        lambda: files.write_table(tmp_path / "dataset.csv", pd.DataFrame({"x": [1]})),
    )
    monkeypatch.setattr(provenance, "engine_hash", lambda: "edited")
    second = pour(tmp_path / "b.json")
    other = r"b\.json: provenance\.engine is 'edited'; .* as in .*dataset\.csv"
    input_error(
        other, run, "validate", [tmp_path / "dataset.csv", second], lambda: None
    )


def test_results_of_other_settings_or_another_engine_are_found(tmp_path, monkeypatch):
    path = pour(tmp_path / "a.json")
    empty_file = tmp_path / "own.json"
    empty_file.write_text("{}")
    paths = [path, empty_file, tmp_path / "missing.json"]
    assert dependencies.find_outdated_files(CONFIG, paths) == []
    assert dependencies.find_outdated_files(changed(network={"hidden": 3}), paths) == []
    assert dependencies.find_outdated_files(
        changed(simulation={"gravity_m_s2": 1.62}), paths
    ) == [str(path)]
    monkeypatch.setattr(dependencies, "engine_hash", lambda: "edited")
    assert dependencies.find_outdated_files(CONFIG, paths) == [str(path)]


OTHER_TARGETS = [CONFIG["targets"][0] | {"value": 31.0}, *CONFIG["targets"][1:]]
MOON = {"simulation": {"gravity_m_s2": 1.62}}
# A file that a stage made, the stage that reads it, another study, and the setting that is named.
INPUTS = {
    "a pour of another gravity": (
        "pour",
        "measure_runs",
        MOON,
        "simulation.gravity_m_s2 is 9.81; expected 1.62",
    ),
    "its piles, behind a table": (
        "dataset",
        "network",
        MOON,
        "simulation.gravity_m_s2 is 9.81; expected 1.62",
    ),
    "its piles, behind a network": (
        "network",
        "miga",
        MOON,
        "simulation.gravity_m_s2 is 9.81; expected 1.62",
    ),
    "its piles, behind an answer": (
        "miga",
        "material_card",
        MOON,
        "simulation.gravity_m_s2 is 9.81; expected 1.62",
    ),
    "other ranges": (
        "network",
        "miga",
        {"parameters": {"mus_gg": [0.2, 0.9]}},
        "parameters.mus_gg is ",
    ),
    "another target": (
        "miga",
        "solutions",
        {"targets": OTHER_TARGETS},
        "targets.0.value is ",
    ),
    "another grain": (
        "pour",
        "measure_runs",
        {"berry": {"density_kg_m3": 900.0}},
        "berry.density_kg_m3 is ",
    ),
    "what a section has besides": (
        "design",
        "dataset",
        {"design": {"optimum": 1}},
        "design.optimum is None; expected 1",
    ),
}


@pytest.mark.parametrize("name", INPUTS)
def test_an_input_of_another_study_is_refused_with_the_key_and_both_values(
    tmp_path, name
):
    made_by, read_by, sections, message = INPUTS[name]
    path = tmp_path / "result.csv"
    run(
        made_by,
        (),
        lambda: files.write_table(path, pd.DataFrame({"x": [1]})),
        apparatus="funnel",
    )
    lists = {key: value for key, value in sections.items() if isinstance(value, list)}
    mappings = {key: sections[key] for key in set(sections) - set(lists)}
    other = changed(**mappings) | lists

    def checked(config, inputs):
        dependencies.require_same_study(config, inputs, "other.json")

    def read_it(config):
        out = tmp_path / "out.json"
        run(read_by, [path], lambda: files.write_json(out, {}), config, check=checked)

    fault = input_error(f"result.csv: {message}", read_it, other)
    assert "as in other.json, because all files must be results of one study" in str(
        fault
    )
    assert not (tmp_path / "out.json").exists()
    read_it(CONFIG | {"label": "other", "results_dir": "other"})
    read_it(changed(sensitivity={"samples": 128}))


@pytest.mark.parametrize("content", [{}, {"x": [1, {"y": 2}]}])
def test_the_record_is_the_last_line_of_a_json_file(tmp_path, content):
    path = tmp_path / "a.json"
    run("design", (), lambda: files.write_json(path, content))
    lines = path.read_text().splitlines()
    assert lines[-2].startswith(' "provenance": {')
    assert lines[-1] == "}"
    assert files.read_json(path) == content


def test_the_datasets_piles_are_a_studys_own_while_its_settings_and_files_are_theirs(
    tmp_path,
):
    config = CONFIG | {"results_dir": str(tmp_path)}
    piles = tmp_path / "heaps/001.json"
    table = tmp_path / "dataset.csv"
    assert dependencies.find_own_dataset(config) is None
    run("berry", (), lambda: files.write_json(tmp_path / "berry/berry.json", {}))
    poured = pour(tmp_path / "heaps/001.pours.json")

    def measured(configuration=CONFIG):
        run(
            "measure_runs",
            [poured],
            lambda: files.write_json(piles, {"runs": []}),
            configuration,
            "funnel",
        )
        run(
            "dataset",
            [piles],
            lambda: files.write_table(table, pd.DataFrame({"x": [1]})),
        )

    measured()
    assert dependencies.find_own_dataset(config) == table
    for section in (
        {"berry": {"density_kg_m3": 900.0}},
        {"measure": {"views": 3}},
        {"funnel": {"berries": 7}},
    ):
        assert (
            dependencies.find_own_dataset(
                changed(**section) | {"results_dir": str(tmp_path)}
            )
            is None
        ), section
    measured(changed(measure={"views": 3}))
    assert dependencies.find_own_dataset(config) is None
    measured()
    os.utime(table, (0, 0))  # older than a pile
    assert dependencies.find_own_dataset(config) is None
    table.write_text("x")
    (tmp_path / "dataset.csv.provenance.json").unlink()
    assert dependencies.find_own_dataset(config) is None


def test_an_outdated_batch_and_what_a_study_no_longer_has(tmp_path):
    path = tmp_path / "proposal.json"
    run("propose", (), lambda: files.write_json(path, {}), strategy="sequential")
    assert (
        dependencies.find_outdated_files(changed(network={"hidden": 3}), [path]) == []
    )
    assert dependencies.find_outdated_files(
        changed(sequential={"checks": 3}), [path]
    ) == [str(path)]
    paths = [
        tmp_path / "a.json",
        pour(tmp_path / "b.json", apparatus="drum"),
        tmp_path / "c.json",
    ]
    earlier = {"verb": "propose", "settings": "0123456789abcdef", "origin": ""}
    files.write_json(paths[0], {"provenance": earlier | {"seed": 1, "engine": None}})
    run("propose", (), lambda: files.write_json(paths[2], {}), strategy="sequential")
    lacking = {
        key: value
        for key, value in changed(sequential={"checks": 3}).items()
        if key != "drum"
    }
    assert dependencies.find_outdated_files(lacking, paths) == [str(paths[2])]


def test_the_processor_type_is_reported_with_what_stands_in_for_another(
    tmp_path, monkeypatch
):
    told = "processor\t: 0\ncpu family\t: 26\nmodel\t\t: 2\nmodel name\t: AMD EPYC\n\nprocessor\t: 1\n"
    monkeypatch.setattr(provenance, "CPU_INFO", written(tmp_path / "cpuinfo", told))
    for name in provenance.FORCED_TYPES:
        monkeypatch.delenv(name, raising=False)
    assert provenance._describe_processor() == "AMD EPYC, family 26, model 2"
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    assert (
        provenance._describe_processor()
        == "AMD EPYC, family 26, model 2, OPENBLAS_CORETYPE=Haswell"
    )
    monkeypatch.setattr(provenance, "CPU_INFO", tmp_path / "none")
    assert provenance._describe_processor().endswith(", OPENBLAS_CORETYPE=Haswell")


def test_the_version_and_commit_are_those_of_the_code_that_runs(monkeypatch, tmp_path):
    monkeypatch.setattr(provenance, "__version__", "9.9")
    assert provenance.describe_machine.__wrapped__()["repose"] == "9.9"
    monkeypatch.setattr(
        provenance, "PACKAGE", tmp_path / "lib" / "site-packages" / "repose"
    )
    monkeypatch.setattr(provenance.places, "find_program_folder", lambda: tmp_path)
    assert provenance._find_commit() is None
    (tmp_path / provenance.COMMIT_FILE).write_text("0123456789ab\n")
    assert provenance._find_commit() == "0123456789ab"


def test_the_verbs_write_it_and_a_verb_prints_it(tmp_path, command):
    config = "config/quick.yaml"
    made = tmp_path / "samples.csv"
    command("design", "--config", config, "--out", tmp_path)
    output = dict(
        line.split(maxsplit=1) for line in command("provenance", made).out.splitlines()
    )
    assert output["verb"] == "design"
    assert output["seed"] == str(CONFIG["design"]["seed"])
    assert set(json.loads(command("provenance", made, "--json").out)) == KEYS
    assert (
        "provenance is None; expected a result"
        in command("provenance", config, status=2).err
    )
