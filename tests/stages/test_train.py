"""Training on a study's samples: split, accuracy in three ways, files; with one target and with several."""

import json
import warnings

import numpy as np
import pandas as pd
import pytest
import shared
import synthetic
from known_responses import known_function
from refusals import input_error
from stage_runs import trained

from repose.bench.parameters import PARAMETERS
from repose.calibrate import training as train
from repose.calibrate.responses import response
from repose.calibrate.surrogates import load
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets

SETTINGS = NetworkSettings.from_keys({"hidden": 6, "epochs": 200, "starts": 3})
NOISE = np.array([[1.0, 1.8], [1.8, 4.0]])


def but(**keys):
    return SETTINGS.model_copy(update=keys)


TARGETS = Targets.of(shared.TARGETS)


def study(settings=SETTINGS, targets=TARGETS, **more):
    return shared.study_of(targets, network=settings, **more)


@pytest.mark.parametrize(
    ("samples", "sizes"),
    [(137, (95, 20, 22)), (150, (105, 22, 23)), (90, (63, 13, 14))],
)
def test_split_is_the_published_one_and_a_partition(samples, sizes):
    rows = train.split_samples(samples, [0.70, 0.15, 0.15], 2026)
    assert tuple(len(rows[name]) for name in train.SPLITS) == sizes
    assert sorted(np.concatenate(list(rows.values()))) == list(range(samples))


def test_a_part_without_samples_has_no_accuracy_and_gives_no_warning():
    """Surrogates that are no networks have no validation samples by default."""
    Y = np.arange(6.0)[:, np.newaxis]
    rows = train.split_samples(6, [0.85, 0.0, 0.15], 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        accuracy = train._compute_accuracy(Y, Y + 0.5, ("y",), rows)
    assert accuracy["n_validation"] == 0
    assert accuracy["validation"] == {"y": {"r2": None, "rmse": None}}
    assert accuracy["train"]["y"]["rmse"] == pytest.approx(0.5)


def test_noise_correction_recovers_r2():
    random = np.random.RandomState(3)
    m = 20_000
    truth = random.normal(size=m) * 2
    predicted = truth + random.normal(size=m) * 0.5
    errors = random.uniform(0.5, 1.5, m)
    y = truth + random.normal(size=m) * errors
    assert train.compute_corrected_r2(y, predicted, errors) == pytest.approx(
        compute_r2(truth, predicted), abs=0.01
    )
    assert compute_r2(y, predicted) < 0.8
    assert train.compute_corrected_r2(y, predicted, np.full(m, np.nan)) is None
    assert train.compute_corrected_r2(y, predicted, np.full(m, 10.0)) is None


def test_shared_noise_is_no_signal():
    _, learned, _ = of_single_pours(0.0, starts=1)
    training, flat, _ = of_single_pours(0.0, starts=1, validation_noise=True)
    assert learned.min() > 2
    assert flat.max() < 0.25
    covariance = np.array(training.metrics["noise_covariance"])
    assert covariance[0, 1] > 0.8 * np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert training.metrics["noise_freedom"] is None


def write_tables(folder, samples=40, seeds=4):
    random = np.random.RandomState(11)
    U = random.uniform(-1, 1, (samples, 6))
    table = pd.DataFrame(0.5 + 0.4 * U, columns=PARAMETERS).assign(
        sample=range(1, samples + 1)
    )
    runs = (
        table[["sample"]]
        .loc[table.index.repeat(seeds)]
        .assign(seed=samples * [*range(seeds)], status="ok")
    )
    noise = random.normal(size=(samples * seeds, 2)) * (0.5, 1.0)
    runs[["aor_deg", "height_mm"]] = known_function(U).repeat(seeds, axis=0) + noise
    runs.loc[runs["sample"] == 4, "status"] = "jammed"
    synthetic.write_tables(folder, table, runs)
    return folder / "dataset.csv", folder / "runs.csv"


def test_run_writes_what_it_returns(tmp_path):
    paths = write_tables(tmp_path)
    metrics = trained(*paths, study(), tmp_path / "out")
    assert json.loads((tmp_path / "out/metrics.json").read_text()) == metrics
    assert metrics["n_samples"] == 39
    assert metrics["left_out"] == 1
    predictions = pd.read_csv(tmp_path / "out/predictions.csv")
    assert 4 not in set(predictions["sample"])
    test = predictions[predictions["split"] == "test"]
    left = test.aor_deg - test.aor_predicted_deg
    whole = test.aor_deg - test.aor_deg.mean()
    expected = 1 - (left**2).sum() / (whole**2).sum()
    assert metrics["test"]["aor_deg"]["r2"] == pytest.approx(expected)
    runs = pd.read_csv(paths[1]).merge(
        test[["sample", "height_predicted_mm"]], on="sample"
    )
    assert len(runs) == 4 * metrics["n_test"]
    single = compute_r2(
        runs["height_mm"].to_numpy(), runs["height_predicted_mm"].to_numpy()
    )
    assert metrics["r2_three_ways"]["height_mm"]["single_runs"] == pytest.approx(single)
    starts = pd.read_csv(tmp_path / "out/starts.csv")
    expected = starts["log_evidence"].max()
    assert starts.loc[starts["chosen"], "log_evidence"].item() == expected
    saved = load(tmp_path / "out/network.json")
    assert saved.inputs == PARAMETERS
    assert saved.outputs == ("aor_deg", "height_mm")


def test_a_run_with_replicates_knows_their_noise(tmp_path):
    metrics = trained(
        *write_tables(tmp_path),
        study(but(replicates=True, prior="inputs")),
        tmp_path / "out",
    )
    assert metrics["noise_freedom"] == 3 * metrics["n_train"]
    sd = np.sqrt(np.diagonal(metrics["noise_covariance"]))
    assert np.concatenate(
        [load(tmp_path / "out/network.json").noise_std_]
    ) / sd == pytest.approx(1.0, abs=0.1)
    # of one seed there is none to correct for
    once = trained(
        *write_tables(tmp_path, seeds=1), study(but(replicates=True)), tmp_path / "once"
    )
    ways = once["r2_three_ways"]["aor_deg"]
    assert ways["noise_corrected"] is None
    assert ways["single_runs"] == pytest.approx(ways["sample_means"])
    assert once["noise_freedom"] is None


def single_pours(signal):
    """A study of 150 single runs: noises of 1 and 2 with correlation 0.9, and `signal` times two smooth responses."""
    random = np.random.default_rng(12)
    U = random.uniform(-1, 1, (150, 6))
    Y = signal * known_function(U) + random.multivariate_normal([0, 0], NOISE, 150)
    dataset = pd.DataFrame(0.5 + 0.4 * U, columns=PARAMETERS)
    dataset.insert(0, "sample", np.arange(1, 151))
    dataset[["aor_deg", "height_mm"]] = Y
    dataset = dataset.assign(
        status="ok", **{"aor_se_deg": np.nan, "height_se_mm": np.nan}
    )
    return dataset, dataset[["sample", "status", "aor_deg", "height_mm"]].assign(seed=1)


SINGLE = but(hidden=12, starts=2, epochs=300, seed=2)


def of_single_pours(signal, **settings):
    """The training, and the spread and the error of predictions at unseen points, both in sd of the noise."""
    training = train.train_surrogate(
        *single_pours(signal),
        TARGETS,
        SINGLE.model_copy(update=settings),
        names=PARAMETERS,
    )
    U = np.random.default_rng(13).uniform(-1, 1, (500, 6))
    P = training.model.predict(0.5 + 0.4 * U)
    sd = np.sqrt(np.diagonal(NOISE))
    return (
        training,
        P.std(axis=0) / sd,
        np.sqrt(np.mean((P - signal * known_function(U)) ** 2, axis=0)) / sd,
    )


@pytest.mark.slow
def test_a_signal_of_single_runs_is_found_with_the_noise_of_the_validation_samples():
    _, _, error = of_single_pours(1.0)
    assert error.min() > 1.2
    for name in ("network", "gaussian_process"):
        training, _, error = of_single_pours(1.0, validation_noise=True, surrogate=name)
        assert error.max() < 0.6
        assert np.shape(training.metrics["noise_covariance"]) == (2, 2)


def test_the_covariance_of_errors_and_too_few_samples(tmp_path):
    errors = np.random.default_rng(14).normal(size=(5, 3)) @ [
        [1, 0.5, 0.2],
        [0, 1, 0.3],
        [0, 0, 1],
    ]
    three = Targets.of([*shared.TARGETS, shared.SLIP])
    covariance = train.estimate_error_covariance(errors, three, "my.csv")
    for i, j in np.ndindex(3, 3):
        apart = i != j and 2 in (i, j)
        expected = 0 if apart else np.mean(errors[:, i] * errors[:, j])
        assert covariance[i, j] == pytest.approx(expected)
    few = r"my\.csv: validation samples is \d; expected more than 3"
    for wrong in (errors[:3], np.zeros((5, 3)), errors[:0]):
        input_error(few, train.estimate_error_covariance, wrong, three, "my.csv")
    paths = write_tables(tmp_path, samples=12)
    input_error(
        r"usable samples is 11; expected at least 12",
        trained,
        *paths,
        study(),
        tmp_path,
    )
    pd.read_csv(paths[0]).drop(columns="mus_gp").to_csv(paths[0], index=False)
    input_error(r"dataset.csv: column mus_gp", trained, *paths, study(), tmp_path)


def test_definitions_are_kept_and_others_are_refused(tmp_path):
    dataset_csv, runs_csv = write_tables(tmp_path)
    flank = {"aor_deg": {"measure.response": "flank"}}
    secant = {"aor_deg": {"measure.response": "secant"}}
    arguments = (
        dataset_csv,
        runs_csv,
        study(but(starts=1), definitions=flank),
        tmp_path / "out",
        "my.yaml",
    )
    trained(*arguments)
    assert load(tmp_path / "out/network.json").definitions == flank
    files = (
        tmp_path / "out/network.json",
        tmp_path / "out/predictions.csv",
        dataset_csv,
    )
    train.restore_surrogate(*files)
    (tmp_path / "dataset_summary.json").write_text(json.dumps({"definitions": secant}))
    input_error(
        r"dataset_summary\.json: definition of aor_deg is .*secant.*flank.*my\.yaml",
        trained,
        *arguments,
    )
    input_error(
        r"network\.json: definition of aor_deg .*as in .*dataset_summary\.json",
        train.restore_surrogate,
        *files,
    )
    trained(dataset_csv, runs_csv, study(but(starts=1)), tmp_path / "out")
    assert load(tmp_path / "out/network.json").definitions == secant


@pytest.mark.parametrize("name", ["network", "network_ensemble", "gaussian_process"])
def test_the_split_is_reported_and_the_saved_model_knows_all_samples(tmp_path, name):
    dataset_csv, runs_csv = write_tables(tmp_path)
    out = tmp_path / "out"
    metrics = trained(dataset_csv, runs_csv, study(but(starts=1), surrogate=name), out)
    saved = load(out / "network.json")
    table = pd.read_csv(out / "predictions.csv")
    test = table[table["split"] == "test"]
    error = np.sqrt(np.mean((test["height_mm"] - test["height_predicted_mm"]) ** 2))
    assert metrics["test"]["height_mm"]["rmse"] == pytest.approx(error)
    X = (
        pd.read_csv(dataset_csv)
        .set_index("sample")
        .loc[test["sample"], list(PARAMETERS)]
        .to_numpy()
    )
    as_reported = np.allclose(saved.predict(X)[:, 1], test["height_predicted_mm"])
    # the article's network is the one that was reported
    assert as_reported == (name == "network")
    assert (
        metrics["n_fitted"]
        == len(saved.samples)
        == (metrics["n_train"] if name == "network" else 39)
    )
    files = (out / "network.json", out / "predictions.csv", dataset_csv)
    train.restore_surrogate(*files)
    column = "height_predicted_mm" if name == "network" else "height_final_mm"
    table.assign(**{column: table[column] + 1}).to_csv(
        out / "predictions.csv", index=False
    )
    input_error(
        r"predictions is 'others'; expected those of .*network\.json",
        train.restore_surrogate,
        *files,
    )


@pytest.mark.parametrize("name", ["aor_deg", "height_mm"])
def test_one_target_is_trained_alone(tmp_path, name):
    dataset_csv, runs_csv = write_tables(tmp_path)
    single_target = Targets([target for target in TARGETS if target.name == name])
    metrics = trained(
        dataset_csv,
        runs_csv,
        study(but(replicates=True), single_target),
        tmp_path / "out",
    )
    assert set(metrics["test"]) == set(metrics["r2_three_ways"]) == {name}
    assert np.shape(metrics["noise_covariance"]) == (1, 1)
    predictions = pd.read_csv(tmp_path / "out/predictions.csv")
    expected = [
        "sample",
        "split",
        name,
        response(name).predicted,
    ]
    assert predictions.columns.tolist() == expected


def test_a_parameter_of_the_law_is_an_input(tmp_path):
    dataset_csv, runs_csv = write_tables(tmp_path)
    dataset = pd.read_csv(dataset_csv)
    dataset.insert(7, "gamma_gg", np.linspace(0.0, 0.1, len(dataset)))
    dataset.to_csv(dataset_csv, index=False)
    trained(dataset_csv, runs_csv, study(), tmp_path / "out")
    assert load(tmp_path / "out/network.json").inputs == (*PARAMETERS, "gamma_gg")
    assert train.restore_surrogate(
        *(
            tmp_path / name
            for name in ("out/network.json", "out/predictions.csv", "dataset.csv")
        )
    )
    dataset.assign(gamma_gg=-0.1).to_csv(dataset_csv, index=False)
    input_error(
        r"gamma_gg is -0\.1",
        trained,
        dataset_csv,
        runs_csv,
        study(),
        tmp_path / "out",
    )


def test_noise_of_bench_tests_is_independent():
    random = np.random.default_rng(6)
    samples = np.arange(400)
    pours = pd.DataFrame(
        {"sample": samples.repeat(4), "apparatus": "funnel", "status": "ok"}
    )
    pours[["aor_deg", "height_mm"]] = random.multivariate_normal(
        [30, 60], [[1, 1], [1, 4]], size=1600
    )
    turns = pd.DataFrame(
        {"sample": samples.repeat(2), "apparatus": "drum", "status": "ok"}
    )
    turns["drum_slip_deg"] = random.normal(40, 3.0, size=800)
    targets = Targets.of([shared.TARGETS[0], shared.SLIP, shared.TARGETS[1]])
    found = train.Replicates.estimate(pd.concat([pours, turns]), samples, targets)
    covariance = found.noise_covariance
    assert found.precision.tolist() == [4.0] * 400
    assert found.noise_freedom == pytest.approx((2 * 1200 + 400) / 3)
    assert covariance[[0, 1, 2], [1, 0, 1]].tolist() == [0.0, 0.0, 0.0]
    expected = np.array([[1.0, 1.0], [1.0, 4.0]])
    assert covariance[::2, ::2] == pytest.approx(expected, rel=0.15)
    # means of two runs beside means of four
    assert covariance[1, 1] == pytest.approx(2 * 9.0, rel=0.15)
    assert (
        train.Replicates.estimate(
            pd.concat([pours, turns.drop_duplicates("sample")]), samples, targets
        )
        is None
    )
