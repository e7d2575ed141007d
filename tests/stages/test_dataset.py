"""Tables of samples and runs: made, read, and refused where they are damaged."""

import json
import math
import shutil

import pandas as pd
import pytest
import shared
import yaml
from refusals import input_error
from shared import ROOT, one_run

from repose.bench import bench
from repose.bench.parameters import PARAMETERS
from repose.calibrate.dataset_files import read_definitions
from repose.calibrate.targets import Targets
from repose.stages import dataset
from repose.stages.parameter_sets import list_job_files
from repose.stages.tables import read_dataset, read_runs

TARGETS = Targets.of(shared.TARGETS)
RECORDED = bench("funnel").recorded
DEFINITIONS = {"aor_deg": {"measure.response": "whole"}}
VALUES = (0.2, 0.6, 0.04, 0.25, 0.5, 0.18)
STUDY = ROOT / "results/published/goji_berry"


@pytest.fixture
def study(tmp_path):
    """Three samples with their heap jobs: ok, one of three failed, all but one failed."""
    samples = pd.DataFrame(
        [(i, *VALUES) for i in (1, 2, 3)], columns=["sample", *PARAMETERS]
    )
    samples.to_csv(tmp_path / "samples.csv", index=False)
    runs = {
        1: [one_run(1, aor=20.0), one_run(2, aor=22.0), one_run(3, aor=27.0)],
        2: [
            one_run(1),
            one_run(2, "no_flank", reason="too few points"),
            one_run(3, height=64.0),
        ],
        3: [
            one_run(1),
            one_run(2, "jammed", reason="stuck"),
            one_run(3, "jammed", reason="stuck"),
        ],
    }
    return tmp_path, shared.write_jobs(
        samples, tmp_path, lambda row: runs[row["sample"]]
    )


def write(samples, paths, out):
    return dataset.write_dataset(samples, paths, TARGETS, DEFINITIONS, out)


def test_the_line_of_the_angle_is_in_the_summary(study):
    folder, paths = study
    angle = {
        "measure.response": "flank",
        "measure.flank": "levels",
        "measure.fit_from": 0.3,
    }
    for definitions in (
        {"aor_deg": angle | {"measure.fit_to": 0.7, "measure.views": 6}},
        {"height_mm": {}},
    ):
        summary = dataset.write_dataset(
            folder / "samples.csv", paths, TARGETS, definitions, folder / "out"
        )
        line = (
            "flank, 30 to 70 % of the height, levels"
            if "aor_deg" in definitions
            else None
        )
        assert summary.get("line") == line


def test_run_writes_tables_and_counts(study):
    folder, paths = study
    summary = write(folder / "samples.csv", paths[::-1], folder / "out")
    table = pd.read_csv(folder / "out/dataset.csv")
    assert list(table.columns) == ["sample", *PARAMETERS, *RECORDED.summary]
    assert table["sample"].tolist() == [1, 2, 3]
    assert table["status"].tolist() == ["ok", "ok", "jammed"]
    assert table["n_seeds"].tolist() == [3, 2, 1]
    assert table["height_mm"].tolist()[:2] == [60.0, 62.0]
    assert pd.isna(table["aor_deg"][2])
    assert table["reason"][2] == "2 of 3 runs jammed (stuck)"
    runs = pd.read_csv(folder / "out/runs.csv")
    assert list(runs.columns) == ["sample", *dataset.RUN_COLUMNS, *RECORDED.single]
    assert len(runs) == 9
    assert json.loads((folder / "out/dataset_summary.json").read_text()) == summary
    assert summary["samples"] == 3
    assert summary["ok"] == 2
    assert summary["left_out"] == 1
    assert summary["runs_ok"] == 6
    expected = (
        DEFINITIONS,
        folder / "out/dataset_summary.json",
    )
    assert read_definitions(folder / "out/dataset.csv") == expected
    assert read_definitions(folder / "samples.csv")[0] == {}
    assert summary["by_status"] == {"ok": 2, "jammed": 1}
    assert summary["reasons"] == {"3": "2 of 3 runs jammed (stuck)"}
    assert summary["text"] == (
        "2 of 3 samples can be used; 1 left out because grains got stuck on their way "
        "out. 6 of 9 single runs can be measured; 2 failed because grains got stuck on "
        "their way out, 1 failed because the grains made no pile with a side to measure."
    )


def test_side_views_are_counted_over_the_good_runs_that_have_them(study):
    """Runs that were measured by an earlier version have no numbers of views."""
    folder, paths = study
    for number, path in enumerate(paths[:2]):
        job = json.loads(path.read_text())
        for run in job["runs"]:
            run |= {"measured_views": 6, "doubtful_views": number + 1}
        path.write_text(json.dumps(job))
    summary = write(folder / "samples.csv", paths, folder / "out")
    runs = pd.read_csv(folder / "out/runs.csv")
    assert list(runs.columns)[-2:] == ["measured_views", "doubtful_views"]
    assert runs["doubtful_views"].sum() == 3 * 1 + 3 * 2
    # three good runs of the first sample, two of the second
    assert (summary["measured_views"], summary["doubtful_views"]) == (30, 7)
    assert summary["text"].endswith(
        " 7 of 30 side views have two sides that differ by more than 10 degrees; they "
        "count."
    )


def edit(path, change):
    job = json.loads(path.read_text())
    change(job)
    path.write_text(json.dumps(job))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda job: job.pop("runs"), r"002.json: runs is None"),
        (lambda job: job.update(runs=[]), r"002.json: runs is \[\]"),
        (lambda job: job.update(sample=9), r"002.json: sample is 9"),
        (lambda job: job.update(sample=1), r"002.json: sample is 1; .*001.json"),
        (
            lambda job: job["parameters"].update(mus_gg=0.61),
            r"002.json: parameters.mus_gg is 0.61; expected 0.6",
        ),
        (
            lambda job: job["parameters"].pop("e_gp"),
            r"002.json: parameters.e_gp is None",
        ),
        (
            lambda job: job["runs"][0].update(status="fine"),
            r"002.json: runs\[0\].status is 'fine'",
        ),
        (
            lambda job: job["runs"][0].update(aor_deg=None),
            r"002.json: runs\[0\].aor_deg is None",
        ),
        (
            lambda job: job["runs"][0].update(height_mm=math.nan),
            r"002.json: runs\[0\].height_mm is nan",
        ),
        (
            lambda job: job["runs"][0].update(aor_deg=1000),
            r"runs\[0\].aor_deg is 1000; expected .* up to 89",
        ),
        (
            lambda job: job["runs"][0].update(seed=2),
            r"002.json: seed is \[2, 2, 3\]; expected .* none twice",
        ),
        (lambda job: job["runs"][0].pop("seed"), r"002.json: seed is \[None, 2, 3\]"),
    ],
)
def test_a_bad_heap_job_is_named(study, change, message):
    folder, paths = study
    edit(paths[1], change)
    input_error(message, write, folder / "samples.csv", paths, folder)


def test_missing_corrupt_and_bad_tables_are_named(study):
    folder, paths = study
    samples = pd.read_csv(folder / "samples.csv")
    samples.drop(columns="mur_gp").to_csv(folder / "short.csv", index=False)
    input_error(r"short.csv: column mur_gp", write, folder / "short.csv", paths, folder)
    pd.concat([samples, samples]).to_csv(folder / "twice.csv", index=False)
    input_error(
        r"twice.csv, row 4: sample is 1; expected each sample once",
        write,
        folder / "twice.csv",
        paths,
        folder,
    )
    input_error(
        r"samples without a file is \[2\]",
        write,
        folder / "samples.csv",
        [paths[0], paths[2]],
        folder,
    )
    input_error(
        r"absent.json", write, folder / "samples.csv", [folder / "absent.json"], folder
    )
    paths[0].write_text(paths[0].read_text()[:50])
    input_error(r"001.json", write, folder / "samples.csv", paths, folder)


def several(study):
    """The study's samples in the drum, too: a second job each, whose runs give the angle of the slip."""
    folder, paths = study
    more = []
    for number in (1, 2, 3):
        job = json.loads((folder / f"{number:03}.json").read_text()) | {
            "apparatus": "drum"
        }
        job["runs"] = [
            shared.good_run(1, drum_slip_deg=30.0 + number),
            shared.good_run(2, drum_slip_deg=32.0),
        ]
        job["runs"][1]["status"] = "ok" if number != 2 else "unstable"
        more.append(folder / f"drum_{number:03}.json")
        more[-1].write_text(json.dumps(job))
    for path in paths:
        edit(path, lambda job: job.update(apparatus="funnel"))
    return folder, paths + more, Targets.of([shared.SLIP, *shared.TARGETS])


def test_bench_tests_of_one_sample_are_merged(study):
    folder, paths, targets = several(study)
    dataset.write_dataset(folder / "samples.csv", paths, targets, {}, folder / "out")
    table = pd.read_csv(folder / "out/dataset.csv")
    responses = (
        "drum_slip_deg",
        "drum_slip_se_deg",
        "aor_deg",
        "aor_se_deg",
        "height_mm",
        "height_se_mm",
    )
    assert table.columns[7:16].tolist() == ["status", "reason", "n_seeds", *responses]
    assert table["drum_slip_deg"].tolist() == [31.5, 32.0, 32.5]
    assert table["status"].tolist() == ["ok", "ok", "jammed"]
    assert table["n_seeds"].tolist() == [2, 1, 1]
    assert table["reason"][1].startswith(
        "drum: 1 of 2 runs unstable; funnel: 1 of 3 runs no_flank"
    )
    runs = pd.read_csv(folder / "out/runs.csv")
    assert runs.columns[:2].tolist() == ["sample", "apparatus"]
    assert runs["apparatus"].tolist() == 3 * (2 * ["drum"] + 3 * ["funnel"])
    assert runs.loc[runs["apparatus"] == "drum", "aor_deg"].isna().all()
    assert runs.loc[(runs["apparatus"] == "drum"), "drum_slip_deg"].notna().all()


def test_a_job_that_is_missing_or_twice_is_named(study):
    folder, paths, targets = several(study)
    wrong = [
        (paths[:-1], targets, r"jobs of the drum: samples without a file is \[3\]"),
        ([*paths, paths[-1]], targets, r"sample is 3; .*once; also in .*drum_003"),
        (
            paths,
            TARGETS,
            r"apparatus is 'drum'; expected a bench test of the targets, funnel",
        ),
    ]
    for jobs, expected, message in wrong:
        input_error(
            message,
            dataset.write_dataset,
            folder / "samples.csv",
            jobs,
            expected,
            {},
            folder / "out",
        )


def test_a_folder_stands_for_the_file_of_every_sample_in_it(tmp_path):
    (tmp_path / "heaps").mkdir()
    (tmp_path / "samples.csv").write_text("sample,e_gg\n1,0.3\n10000,0.3\n")
    arguments = [str(tmp_path / "heaps"), "other/001.json"]
    names = [str(path) for path in list_job_files(arguments, tmp_path / "samples.csv")]
    expected = [
        f"{tmp_path}/heaps/001.json",
        f"{tmp_path}/heaps/10000.json",
        "other/001.json",
    ]
    assert names == expected
    assert [str(path) for path in list_job_files(["a.json"], "no/table.csv")] == [
        "a.json"
    ]


@pytest.fixture
def tables(tmp_path):
    for name in ("dataset.csv", "runs.csv", "dataset_summary.json"):
        shutil.copy(STUDY / name, tmp_path)
    return tmp_path


def read(tables):
    dataset = read_dataset(tables / "dataset.csv", TARGETS)
    return dataset, read_runs(
        tables / "runs.csv", TARGETS, dataset, tables / "dataset.csv"
    )


def test_a_whole_study_is_read_and_runs_twice_lost_or_of_another_are_refused(tables):
    dataset, runs = read(tables)
    assert len(dataset) == 150
    assert len(runs) == 900
    lines = (tables / "runs.csv").read_text().splitlines(keepends=True)
    (tables / "runs.csv").write_text("".join([*lines[:2], lines[1], *lines[3:]]))
    input_error(r"row 2: sample and seed is \[.*\]; expected each once", read, tables)
    (tables / "runs.csv").write_text("".join([lines[0], *lines[2:]]))
    input_error("rows is 899; expected 900", read, tables)
    shutil.copy(STUDY.parent / "paper/runs.csv", tables)
    input_error(r"runs\.csv: rows is 150; expected 900", read, tables)
    summary = json.loads((tables / "dataset_summary.json").read_text())
    (tables / "dataset_summary.json").write_text(json.dumps(summary | {"runs": 150}))
    input_error(r"sample 1: ok runs is 1; expected 6", read, tables)


@pytest.mark.parametrize(("name", "rows"), [("dataset.csv", 150), ("runs.csv", 900)])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.51, 0.8])
def test_a_table_cut_anywhere_is_refused(tables, name, rows, share):
    content = (tables / name).read_bytes()
    (tables / name).write_bytes(content[: int(share * len(content))])
    input_error(
        rf"{name}.*(last row is|height_mm is nan|rows is \d+; expected {rows})",
        read,
        tables,
    )


DAMAGED = yaml.safe_load((ROOT / "tests/stages/damaged.yaml").read_text())


@pytest.mark.parametrize(("name", "column", "value", "message"), DAMAGED)
def test_a_damaged_cell_is_reported(tables, name, column, value, message):
    table = pd.read_csv(tables / name, dtype=object, keep_default_na=False)
    table.loc[2, column] = value
    table.to_csv(tables / name, index=False)
    input_error(message, read, tables)
