"""Noise floor of a study: the tables."""

import json

import numpy as np
import pandas as pd
import pytest

from repose.core.errors import InputError
from repose.studies import noise

TARGET = {"aor_deg": 32.0, "height_mm": 64.0}


def write_runs(folder, seeds):
    random = np.random.default_rng(1)
    runs = pd.DataFrame({"sample": np.repeat(np.arange(1, 31), seeds), "seed": np.arange(30 * seeds)})
    runs["status"], runs["aor_deg"] = "ok", 25 + np.repeat(random.normal(size=30), seeds)
    runs["aor_deg"] += random.normal(size=len(runs))
    runs["height_mm"] = 2 * runs["aor_deg"] + random.normal(size=len(runs))
    runs.loc[[0, 1, 2, 3], ["status", "aor_deg", "height_mm"]] = ["jammed", np.nan, np.nan]
    runs.to_csv(folder / "runs.csv", index=False)
    return folder / "runs.csv"


def test_tables_of_a_study_with_failed_pours(tmp_path):
    summary = noise.run(write_runs(tmp_path, 4), TARGET, tmp_path / "out")
    row = pd.read_csv(tmp_path / "out/noise.csv").iloc[0]
    assert (row["samples"], row["runs"], row["failed_runs"], row["samples_without_runs"]) == (29, 116, 4, 1)
    seeds = pd.read_csv(tmp_path / "out/seeds.csv")
    assert seeds["seeds"].tolist() == list(range(1, 65))
    assert seeds["aor_se_deg"][3] == pytest.approx(row["sd_within"] / 2)
    assert seeds["aor_reachable_r2"][0] == pytest.approx(row["icc"])
    assert seeds["aor_se_percent"][row["seeds_for_1_percent"] - 1] <= 1 < seeds["aor_se_percent"][0]
    assert json.loads((tmp_path / "out/noise.json").read_text()) == summary
    assert "intraclass correlation" in noise.message(summary)


def test_one_seed_a_sample_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"runs a sample is 1; allowed: 2 or more"):
        noise.run(write_runs(tmp_path, 1), TARGET, tmp_path / "out")
