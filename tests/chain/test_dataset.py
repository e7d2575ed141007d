import json
import math

import pandas as pd
import pytest

from repose.chain import dataset
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.measure.angles import RECORDED

VALUES = (0.2, 0.6, 0.04, 0.25, 0.5, 0.18)


def one_run(seed, status="ok", aor=22.0, height=60.0, reason=""):
    ok = status == "ok"
    return {
        "seed": seed,
        "status": status,
        "reason": reason,
        "aor_deg": aor if ok else None,
        "height_mm": height if ok else None,
        "discharge_s": 15.0 + seed,
        "berries_on_plate": 500,
        "berries_in_pile": 460,
        "berries_off_plate": 0,
        "kinetic_energy_J": 1e-12,
    }


@pytest.fixture
def study(tmp_path):
    """Three samples with their heap jobs: ok, one of three failed, all but one failed."""
    samples = pd.DataFrame([(i, *VALUES) for i in (1, 2, 3)], columns=["sample", *PARAMETERS])
    samples.to_csv(tmp_path / "samples.csv", index=False)
    runs = {
        1: [one_run(1, aor=20.0), one_run(2, aor=22.0), one_run(3, aor=27.0)],
        2: [one_run(1), one_run(2, "no_flank", reason="too few points"), one_run(3, height=64.0)],
        3: [one_run(1), one_run(2, "jammed", reason="stuck"), one_run(3, "jammed", reason="stuck")],
    }
    paths = []
    for sample, its_runs in runs.items():
        job = {"sample": sample, "parameters": dict(zip(PARAMETERS, VALUES, strict=True)), "runs": its_runs}
        paths.append(tmp_path / f"{sample:03}.json")
        paths[-1].write_text(json.dumps(job))
    return tmp_path, paths


def test_run_writes_tables_and_counts(study):
    folder, paths = study
    summary = dataset.run(folder / "samples.csv", paths[::-1], folder / "out")
    table = pd.read_csv(folder / "out/dataset.csv")
    assert list(table.columns) == ["sample", *PARAMETERS, *RECORDED.summary]
    assert table["sample"].tolist() == [1, 2, 3]
    assert table["status"].tolist() == ["ok", "ok", "jammed"]
    assert table["n_seeds"].tolist() == [3, 2, 1]
    assert table["height_mm"].tolist()[:2] == [60.0, 62.0]
    assert pd.isna(table["aor_deg"][2])
    assert table["reason"][2] == "2 of 3 runs jammed (stuck)"
    runs = pd.read_csv(folder / "out/runs.csv")
    assert list(runs.columns) == ["sample", *dataset.RUN_COLUMNS]
    assert len(runs) == 9
    assert json.loads((folder / "out/dataset_summary.json").read_text()) == summary
    assert (summary["samples"], summary["ok"], summary["left_out"], summary["runs_ok"]) == (3, 2, 1, 6)
    assert summary["by_status"] == {"ok": 2, "jammed": 1}
    assert summary["reasons"] == {"3": "2 of 3 runs jammed (stuck)"}
    assert summary["text"] == "2 of 3 samples can be used; 1 left out: 1 jammed. 6 of 9 single runs are ok."


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
            r"002.json: parameters.mus_gg is 0.61; allowed: 0.6",
        ),
        (lambda job: job["parameters"].pop("e_gp"), r"002.json: parameters.e_gp is None"),
        (lambda job: job["runs"][0].update(status="fine"), r"002.json: runs\[0\].status is 'fine'"),
        (lambda job: job["runs"][0].update(aor_deg=None), r"002.json: runs\[0\].aor_deg is None"),
        (lambda job: job["runs"][0].update(height_mm=math.nan), r"002.json: runs\[0\].height_mm is nan"),
    ],
)
def test_a_bad_heap_job_is_named(study, change, message):
    folder, paths = study
    edit(paths[1], change)
    with pytest.raises(InputError, match=message):
        dataset.run(folder / "samples.csv", paths, folder)


def test_missing_and_corrupt_files_are_named(study):
    folder, paths = study
    with pytest.raises(InputError, match=r"samples without a file is \[2\]"):
        dataset.run(folder / "samples.csv", [paths[0], paths[2]], folder)
    with pytest.raises(InputError, match=r"absent.json"):
        dataset.run(folder / "samples.csv", [folder / "absent.json"], folder)
    paths[0].write_text(paths[0].read_text()[:50])
    with pytest.raises(InputError, match=r"001.json"):
        dataset.run(folder / "samples.csv", paths, folder)


def test_bad_tables_of_samples_are_named(study):
    folder, paths = study
    samples = pd.read_csv(folder / "samples.csv")
    samples.drop(columns="mur_gp").to_csv(folder / "short.csv", index=False)
    with pytest.raises(InputError, match=r"short.csv: mur_gp"):
        dataset.run(folder / "short.csv", paths, folder)
    pd.concat([samples, samples]).to_csv(folder / "twice.csv", index=False)
    with pytest.raises(InputError, match=r"twice.csv: sample is 1; allowed: each sample once"):
        dataset.run(folder / "twice.csv", paths, folder)
