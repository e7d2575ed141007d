"""The method beside a response surface: its parts on known functions, and one small study."""

import numpy as np
import pandas as pd
import pytest

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.search.miga import Objective
from repose.studies.comparison import whole
from repose.surrogate.support import quadratic_terms

RANGES = {name: (k, k + 2.0) for k, name in enumerate(PARAMETERS)}
LOW = np.arange(6.0)
OBJECTIVE = Objective(np.array([28.0, 55.0]), np.array([32.0, 65.0]))


def responses(unit):
    """AoR and Height of places in the ranges: linear with a little curvature, both 30 and 60 at the centre."""
    bent = (unit[:, 4] - 0.5) ** 2
    aor = 30 + 12 * (unit[:, 0] - 0.5) + 8 * (unit[:, 1] - 0.5) + 4 * bent
    return np.column_stack([aor, 60 + 30 * (unit[:, 2] - 0.5) - 10 * (unit[:, 3] - 0.5)])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    random = np.random.default_rng(4)
    unit = random.uniform(size=(60, 6))
    scatter = random.multivariate_normal([0, 0], [[0.25, 0.4], [0.4, 1.0]], size=(60, 4))
    values = responses(unit)[:, None] + scatter
    table = pd.DataFrame(LOW + 2 * unit, columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, 61))
    table["status"] = "ok"
    table["aor_deg"], table["height_mm"] = values.mean(axis=1).T
    runs = pd.DataFrame({"sample": np.repeat(table["sample"], 4), "status": "ok"})
    runs["aor_deg"], runs["height_mm"] = values.reshape(-1, 2).T
    table.to_csv(folder / "dataset.csv", index=False)
    runs.to_csv(folder / "runs.csv", index=False)
    return folder


def test_study_joins_datasets_and_knows_the_scatter_of_a_pour(files):
    study = whole.Study([files / "dataset.csv"] * 2, [files / "runs.csv"] * 2, RANGES)
    assert len(study) == 120
    assert study.seeds == 4
    assert study.covariance == pytest.approx(np.array([[0.25, 0.4], [0.4, 1.0]]), rel=0.2)
    assert study.errors[0] == pytest.approx(np.sqrt(np.diag(study.covariance) / 4))
    with pytest.raises(InputError, match="as many files as datasets, 2"):
        whole.Study([files / "dataset.csv"] * 2, [files / "runs.csv"], RANGES)


def test_truth_is_what_the_samples_came_from(files):
    study = whole.Study([files / "dataset.csv"], [files / "runs.csv"], RANGES)
    truth = whole.Truth(study, 1)
    unit = np.random.default_rng(9).uniform(size=(200, 6))
    off = np.sqrt(((truth(unit) - responses(unit)) ** 2).mean(axis=0))
    assert (off < [0.4, 0.8]).all()  # of deviations of 4 and 9 over the design
    assert all(values["r2_noise_corrected"] > 0.95 for values in truth.cross_validated.values())
    places, runs = whole.emulated(study, truth, 300, np.random.default_rng(1))
    scatter = np.concatenate(runs) - np.repeat(truth(places), 4, axis=0)
    assert np.cov(scatter.T) == pytest.approx(study.covariance, rel=0.2)


def test_surfaces_are_exact_on_their_own_kind_and_local_search_inverts_them():
    unit = np.random.default_rng(2).uniform(size=(60, 6))
    quadratic = whole.surface(unit, responses(unit), quadratic_terms)
    fresh = np.random.default_rng(3).uniform(size=(20, 6))
    assert quadratic(fresh) == pytest.approx(responses(fresh), abs=0.02)
    plane = whole.plane(unit, responses(unit)[:, 1:])
    assert plane(fresh) == pytest.approx(responses(fresh)[:, 1:], abs=1e-9)
    goal = Objective(np.array([32.0, 60.0]), np.array([36.0, 70.0]))
    place, evaluations = whole.local_search(responses, goal, 3, np.random.default_rng(1))
    assert responses(place[None])[0] == pytest.approx([34, 65], abs=1e-3)
    assert 10 < evaluations < 1000
    nearest, _ = whole.local_search(responses, OBJECTIVE, 3, np.random.default_rng(1))
    assert nearest == pytest.approx(np.full(6, 0.5), abs=1e-6)  # the centre meets its target and is kept


def test_small_study_judges_every_method_by_the_truth(files, tmp_path):
    network = {"hidden": 3, "epochs": 60, "goal": 0.0, "starts": 2, "seed": 1, "prior": "inputs"}
    network |= {"split": [0.7, 0.15, 0.15], "weights_from_errors": False, "correlated_noise": True}
    search = {"islands": 2, "population": 20, "rounds": 5, "generations": 10, "tournament": 3}
    search |= {"mutation_probability": 0.05, "mutation_amplitude": 0.1, "solutions": 10, "distance": 0.02}
    target = {"aor_deg": 31.0, "height_mm": 62.0, "aor_range_deg": [29, 33], "height_range_mm": [57, 67]}
    settings = {"samples": [40, 60], "repetitions": 2, "local_starts": 2, "seed": 1}
    settings |= {"network": network, "miga": search | {"seed": 1}}
    table = whole.run([files / "dataset.csv"], [files / "runs.csv"], RANGES, target, settings, tmp_path)
    # all 60 samples are no random subset
    assert set(zip(table["data"], table["samples"], strict=True)) == {
        ("real", 40),
        ("emulated", 40),
        ("emulated", 60),
    }
    assert set(table["method"]) == set(whole.METHODS)
    proposed = pd.read_csv(tmp_path / "whole_proposals.csv")
    at = (proposed[list(PARAMETERS)].to_numpy() - LOW) / 2
    assert proposed[["aor_deg", "height_mm"]].to_numpy() == pytest.approx(responses(at), abs=2.5)
    quadratic = table[table["method"] == "quadratic"]
    assert (quadratic["aor_off_deg"] < 0.6).all()
    assert (table.loc[table["method"] == "best_sample", "evaluations"] == 0).all()
    assert (table["simulations"] == 4 * table["samples"]).all()
    assert "quadratic" in whole.message(table)
