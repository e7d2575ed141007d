"""Design to validation on made-up runs: one target, four targets, another bench test, fixed and measured parameters."""

from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from shared import (
    MIGA,
    RANGES,
    every_bench_test,
    good_run,
    study_of,
    target,
    write_jobs,
)
from stage_runs import compared, searched, trained

from repose.bench.space import contact_space
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.measure.settings import MeasureSettings
from repose.stages import dataset, design, validate

pytestmark = pytest.mark.slow

MEASURE = MeasureSettings.model_validate(every_bench_test()["measure"])
NETWORK = NetworkSettings.from_keys(
    {"hidden": 6, "epochs": 150, "goal": 0.0, "starts": 2, "seed": 1}
)
SMALL = {
    "islands": 3,
    "population": 30,
    "rounds": 20,
    "mutation_probability": 0.1,
    "solutions": 10,
    "distance": 0.02,
}
SEARCH = MigaSettings(**(MIGA | SMALL | {"seed": 1}))
PRIORS = {
    "e_gp": {"fixed": 0.3},
    "mus_gp": {"prior": {"mean": 0.5, "sd": 0.02}, "range": [0.4, 0.8]},
}
# Each response: its value where all parameters are in the middle, what rolling and wall friction add, a run's scatter.
LAW = {
    "aor_deg": (30.0, 8.0, 4.0, 0.3),
    "height_mm": (60.0, 10.0, 12.0, 0.5),
    "radius_90_mm": (110.0, -20.0, -16.0, 1.0),
    "base_radius_mm": (120.0, -24.0, -18.0, 1.0),
    "drum_slip_deg": (40.0, 6.0, 0.0, 0.4),
}
WANTED = {"mur_gg": 0.055, "mus_gp": 0.55}  # what gives the targets


def means(parameters):
    rolling = (parameters["mur_gg"] - 0.045) / 0.05
    wall = (parameters["mus_gp"] - 0.6) / 0.4
    return {name: at + a * rolling + b * wall for name, (at, a, b, _) in LAW.items()}


def targets_of(*names):
    expected = {name: means(WANTED)[name] for name in names}
    return Targets.of(
        [
            target(name, value, 1.0, value - 1.5, value + 1.5, 5)
            for name, value in expected.items()
        ]
    )


def runs_of(targets, name, row, seeds=4):
    names = [target.name for target in targets if target.response.apparatus == name]
    for seed in range(seeds):
        random = np.random.default_rng([seed, row["sample"], len(name)])
        yield good_run(
            seed,
            **{key: means(row)[key] + LAW[key][3] * random.normal() for key in names},
        )


def pour(table, targets, folder):
    paths = []
    for name in targets.apparatus:
        paths += write_jobs(
            table, folder, partial(runs_of, targets, name), apparatus=name
        )
    return paths


def whole_chain(out: Path, targets, space, surrogate="network", replicates=False):
    definitions = {name: {"measure.views": 6} for name in targets.names}
    network = NETWORK.model_copy(update={"replicates": replicates})
    study = study_of(
        targets, space, definitions, MEASURE, surrogate, network=network, miga=SEARCH
    )
    samples, _ = design.write_design(
        space, DesignSettings(samples=40, method="lhsdesign", seed=1), out / "design"
    )
    dataset.write_dataset(
        out / "design/samples.csv",
        pour(samples, targets, out / "jobs"),
        targets,
        definitions,
        out,
    )
    metrics = trained(out / "dataset.csv", out / "runs.csv", study, out / "network")
    support = Support.from_dataset(out / "dataset.csv", space)
    surrogate = out / "network/network.json"
    summary = searched(surrogate, study, None, out / "miga", support)
    again = validate.write_solutions(
        out / "miga/feasible.csv", space, targets, 3, out / "validation/solutions.csv"
    )
    jobs = pour(again, targets, out / "validation/jobs")
    theirs = validate.compare_with_published(
        None,
        parameter_names=space.names,
        targets=targets,
        measure=study.settings.measure,
        simulated_by={},
    )
    tables = compared(
        out / "validation/solutions.csv",
        jobs,
        study,
        theirs,
        out / "validation",
        support,
    )
    return SimpleNamespace(
        samples=samples, metrics=metrics, summary=summary, solutions=again, **tables
    )


@pytest.mark.parametrize(
    "names",
    [
        ("height_mm",),
        ("aor_deg", "height_mm", "radius_90_mm", "base_radius_mm"),
        ("height_mm", "drum_slip_deg"),
    ],
    ids=["one", "four", "two bench tests"],
)
def test_the_chain_finds_parameter_sets_that_give_the_targets(tmp_path, names):
    targets = targets_of(*names)
    found = whole_chain(tmp_path, targets, contact_space(RANGES))
    assert all(found.metrics["test"][name]["r2"] > 0.8 for name in names)
    assert found.summary["feasible"]
    assert set(found.summary["target_distance"]) == set(names)
    table = found.representative.set_index("response")
    assert table.index.tolist() == list(names)
    assert (table["simulated"] - targets.value).abs().max() < 1.5
    responses = [
        column
        for target in targets
        for column in (target.response.predicted, target.response.simulated)
    ]
    assert set(responses) < set(found.table4.columns)
    assert len(found.table4) == 4
    assert found.published.empty


def test_a_fixed_parameter_stays_and_a_measured_one_is_preferred(tmp_path):
    found = whole_chain(
        tmp_path, targets_of("height_mm"), contact_space(RANGES | PRIORS)
    )
    assert (found.samples["e_gp"] == 0.3).all()
    assert found.samples["mus_gp"].max() > 0.75  # the design fills the whole range
    assert (found.solutions["e_gp"] == 0.3).all()
    feasible = pd.read_csv(tmp_path / "miga/feasible.csv")
    assert feasible["feasible"].all()
    # rolling friction can make up for any wall friction; the prior says which of them
    assert abs(feasible["mus_gp"].iloc[0] - 0.5) < 0.02
    expected = (feasible["mus_gp"] - 0.5).abs() / 0.02
    np.testing.assert_allclose(feasible["prior_distance_sd"], expected, atol=1e-9)
    assert feasible["objective"].iloc[0] < 0.02
    assert pd.read_csv(tmp_path / "miga/intervals.csv").set_index("variable").loc[
        "e_gp"
    ].tolist() == [0.3, 0.3, 0.0]


@pytest.mark.parametrize("name", ["gaussian_process", "quadratic"])
def test_the_chain_runs_with_another_surrogate(tmp_path, name):
    targets = targets_of("aor_deg", "height_mm")
    space = contact_space(
        RANGES
        | {key: {"fixed": sum(RANGES[key]) / 2} for key in ("e_gg", "mus_gg", "e_gp")}
    )
    found = whole_chain(tmp_path, targets, space, name, replicates=True)
    assert found.metrics["noise_covariance"] is not None
    assert found.metrics["test"]["aor_deg"]["r2"] > 0.9
    assert (found.representative["simulated"] - targets.value).abs().max() < 1.5
