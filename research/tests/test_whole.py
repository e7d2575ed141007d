"""The method beside a response surface: its parts on known functions, and one small study."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import repose.bench  # noqa: F401  (makes the responses known)
from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.responses import name_derived_column
from repose.calibrate.search.objective import Objective
from repose.calibrate.surrogates.support import compute_quadratic_terms
from repose.calibrate.targets import Targets
from repose.common import attached
from repose.common.errors import InputError
from research.comparison import proposals, whole
from research.comparison.__main__ import script
from research.comparison.points import Points
from research.figures.__main__ import script as draw

SPACE = contact_space({name: (k, k + 2.0) for k, name in enumerate(PARAMETERS)})
LOW = np.arange(6.0)
NAMES = ("aor_deg", "height_mm")


def objective_of(low, high):
    low = np.array(low)
    high = np.array(high)
    return Objective(
        SimpleNamespace(
            low=low, high=high, aim=(low + high) / 2, weight=np.ones(len(low))
        )
    )


OBJECTIVE = objective_of([28.0, 55.0], [32.0, 65.0])


def responses(unit):
    """AoR and Height of places in the ranges: linear with a little curvature, both 30 and 60 at the centre."""
    bent = (unit[:, 4] - 0.5) ** 2
    aor = 30 + 12 * (unit[:, 0] - 0.5) + 8 * (unit[:, 1] - 0.5) + 4 * bent
    return np.column_stack(
        [aor, 60 + 30 * (unit[:, 2] - 0.5) - 10 * (unit[:, 3] - 0.5)]
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    random = np.random.default_rng(4)
    unit = random.uniform(size=(60, 6))
    scatter = random.multivariate_normal(
        [0, 0], [[0.25, 0.4], [0.4, 1.0]], size=(60, 4)
    )
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


def one_study(files):
    return whole.read_samples(
        [files / "dataset.csv"], [files / "runs.csv"], SPACE, NAMES
    )


@pytest.mark.slow
def test_the_script_writes_tables_with_a_record_and_the_figure_is_drawn(
    files, tmp_path
):
    arguments = [
        "--config",
        "config/quick.yaml",
        "--dataset",
        str(files / "dataset.csv"),
        "--runs",
        str(files / "runs.csv"),
        "--out",
        str(tmp_path),
    ]
    script.run(["whole", *arguments])
    assert attached.read_record(tmp_path / "whole.csv")["verb"] == "comparison_whole"
    shown = [
        "whole",
        "--config",
        "config/quick.yaml",
        "--input",
        f"whole={tmp_path / 'whole.csv'}",
    ]
    draw.run(["draw", *shown, "--out", str(tmp_path / "whole.png")])
    assert (tmp_path / "whole.png").stat().st_size > 10_000


def test_samples_join_datasets_and_know_the_scatter_of_a_pour(files):
    samples = whole.read_samples(
        [files / "dataset.csv"] * 2, [files / "runs.csv"] * 2, SPACE, NAMES
    )
    assert len(samples.points.X) == 120
    assert samples.seeds == 4
    expected = np.array([[0.25, 0.4], [0.4, 1.0]])
    assert samples.covariance == pytest.approx(expected, rel=0.2)
    assert samples.errors[0] == pytest.approx(np.sqrt(np.diag(samples.covariance) / 4))
    assert samples.points.X.max() <= 1
    with pytest.raises(InputError, match="as many files as datasets, 2"):
        whole.read_samples(
            [files / "dataset.csv"] * 2, [files / "runs.csv"], SPACE, NAMES
        )


def test_a_usable_sample_without_runs_is_named(files, tmp_path):
    runs = pd.read_csv(files / "runs.csv")
    runs[runs["sample"] != 7].to_csv(tmp_path / "runs.csv", index=False)
    with pytest.raises(
        InputError, match="sample is 7; expected runs of each usable sample"
    ):
        whole.read_samples(
            [files / "dataset.csv"], [tmp_path / "runs.csv"], SPACE, NAMES
        )


def test_truth_is_what_the_samples_came_from(files):
    samples = one_study(files)
    truth = whole.truth_of(samples, 1)
    unit = np.random.default_rng(9).uniform(size=(200, 6))
    errors = np.sqrt(((truth.mean(unit) - responses(unit)) ** 2).mean(axis=0))
    assert (errors < [0.4, 0.8]).all()  # of deviations of 4 and 9 over the design
    assert (truth.explainable > 0.95).all()
    data = whole.emulated(samples, truth, 300, np.random.default_rng(1))
    scatter = (data.values - truth.mean(data.X)[:, None]).reshape(-1, 2)
    assert np.cov(scatter.T) == pytest.approx(samples.covariance, rel=0.2)


def test_surfaces_are_exact_on_their_own_kind_and_local_search_inverts_them():
    unit = np.random.default_rng(2).uniform(size=(60, 6))
    quadratic = proposals.surface(unit, responses(unit), compute_quadratic_terms)
    fresh = np.random.default_rng(3).uniform(size=(20, 6))
    assert quadratic(fresh) == pytest.approx(responses(fresh), abs=0.02)
    plane = proposals.plane(unit, responses(unit)[:, 1:])
    assert plane(fresh) == pytest.approx(responses(fresh)[:, 1:], abs=1e-9)
    goal = objective_of([32.0, 60.0], [36.0, 70.0])
    place, evaluations = proposals.local_search(
        responses, goal, 6, 3, np.random.default_rng(1)
    )
    assert responses(place[None])[0] == pytest.approx([34, 65], abs=1e-3)
    assert 10 < evaluations < 1000
    nearest, _ = proposals.local_search(
        responses, OBJECTIVE, 6, 3, np.random.default_rng(1)
    )
    # the centre meets its target and is kept
    assert nearest == pytest.approx(np.full(6, 0.5), abs=1e-6)


def target(name, value, half):
    return {
        "response": name,
        "value": value,
        "sd": 1.0,
        "repetitions": 4,
        "range": [value - half, value + half],
    }


def small(samples, repetitions=2):
    network = {
        "hidden": 3,
        "epochs": 60,
        "goal": 0.0,
        "starts": 2,
        "seed": 1,
        "prior": "inputs",
        "split": [0.7, 0.15, 0.15],
        "replicates": True,
    }
    search = {
        "islands": 2,
        "population": 20,
        "rounds": 5,
        "generations": 10,
        "tournament": 3,
        "mutation_probability": 0.05,
        "mutation_amplitude": 0.1,
        "solutions": 10,
        "distance": 0.02,
    }
    settings = {
        "samples": samples,
        "repetitions": repetitions,
        "local_starts": 2,
        "seed": 1,
    }
    return settings | {"network": network, "miga": search | {"seed": 1}}


def test_small_study_judges_every_method_by_the_truth(files, tmp_path):
    targets = Targets.of([target("aor_deg", 31.0, 2.0), target("height_mm", 62.0, 5.0)])
    table = whole.run(one_study(files), SPACE, targets, small([40, 60]), tmp_path)
    # all 60 samples are no random subset
    assert set(zip(table["data"], table["samples"], strict=True)) == {
        ("real", 40),
        ("emulated", 40),
        ("emulated", 60),
    }
    assert set(table["method"]) == set(proposals.METHODS)
    proposed = pd.read_csv(tmp_path / "whole_proposals.csv")
    at = (proposed[list(PARAMETERS)].to_numpy() - LOW) / 2
    assert proposed[["aor_deg", "height_mm"]].to_numpy() == pytest.approx(
        responses(at), abs=2.5
    )
    quadratic = table[table["method"] == "quadratic"]
    assert (quadratic["aor_off_deg"] < 0.6).all()
    assert (table.loc[table["method"] == "best_sample", "evaluations"] == 0).all()
    assert (table["simulations"] == 4 * table["samples"]).all()
    assert "quadratic" in whole.message(table, targets)


@pytest.mark.parametrize(
    "names",
    [["height_mm"], ["aor_deg", "height_mm", "packing_percent", "drum_slip_deg"]],
)
def test_any_number_of_targets(names):
    """Each response follows a parameter of its own; one parameter is fixed."""
    k = len(names)
    rng = np.random.default_rng(3)
    ranges = dict.fromkeys(PARAMETERS, (0.0, 1.0)) | {"mur_gp": {"fixed": 0.2}}
    space = contact_space(ranges)
    unit = rng.uniform(size=(50, 5))
    values = 40 + 20 * unit[:, None, :k] + rng.normal(0, 0.5, (50, 3, k))
    samples = whole.samples_of(Points(unit, values))
    assert samples.covariance == pytest.approx(0.25 * np.eye(k), abs=0.12)
    targets = Targets.of([target(name, 52.0, 1.0) for name in names])
    table, proposed = whole.compared(
        samples, space, targets, small([40], repetitions=2)
    )
    error_columns = [name_derived_column(name, "off") for name in names]
    assert (table.loc[table["method"] == "linear", error_columns] < 0.6).all(axis=None)
    assert (proposed["mur_gp"] == 0.2).all()
    assert set(f"truth_{name}_r2" for name in names) <= set(table.columns)
