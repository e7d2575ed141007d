"""Train a surrogate on the simulated samples of a study (paper, section 3.2.2).

`repose.calibrate.surrogates` has the surrogates.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from repose.calibrate.dataset_files import read_definitions
from repose.calibrate.responses import (
    Definitions,
    name_derived_column,
    reject_other_definitions,
)
from repose.calibrate.runs import select_bench_runs
from repose.calibrate.surrogates import Surrogate, load, make, wrap_for_scale
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.calibrate.variance import estimate_within_covariance
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table
from repose.common.numbers import format_significant

SPLITS = ("train", "validation", "test")
# The split of 12 samples has 8 for training, 1 for validation and 3 for the test. With
# fewer test samples, R2 has no meaning.
MIN_SAMPLES = 12
# Added to a product before it is rounded down, because rounding errors may make the
# product too small: 0.7 * 90 is 62.99999999999999.
ROUNDING_ERROR = 1e-9
# Two predictions count as the same if they differ by no more than this relative
# difference.
PREDICTION_TOLERANCE = 1e-6


class Training(NamedTuple):
    """Result of `train_surrogate`.

    Attributes
    ----------
    model : Surrogate
        Fitted to all usable samples, or to the training part:
        `Surrogate.of_all_samples` says which.
    metrics : dict
        Numbers of samples, R2 and RMSE by part and response, and the report of the
        surrogate.
    predictions : pandas.DataFrame
        Predictions of the fit to the training part, and of the fit to all samples if
        there is one.
    starts : pandas.DataFrame
        A row for each start of the training; empty for a surrogate without starts.
    """

    model: Surrogate
    metrics: dict[str, Any]
    predictions: pd.DataFrame
    starts: pd.DataFrame


class Replicates(NamedTuple):
    """Noise of the responses, estimated from the repeated runs of each sample.

    The fields are arguments of `repose.calibrate.surrogates.base.Surrogate.fit`.
    Responses of different bench tests are independent. With several bench tests,
    `precision` is expressed in runs of the first one, and each block of the covariance
    is scaled accordingly.

    Attributes
    ----------
    precision : numpy.ndarray, (samples,)
        Number of runs of each sample, which is its weight.
    noise_covariance : numpy.ndarray, (k, k)
        Covariance of a single run about the mean of its sample.
    noise_freedom : float
        Degrees of freedom of the covariance, mean over the responses.
    """

    precision: np.ndarray
    noise_covariance: np.ndarray
    noise_freedom: float

    @classmethod
    def estimate(
        cls, runs: pd.DataFrame, samples: Sequence[int], targets: Targets
    ) -> Self | None:
        """Estimate the noise of some samples from their repeated runs.

        Parameters
        ----------
        runs : pandas.DataFrame
            Single runs: `sample`, `apparatus`, `status` and the responses.
        samples : sequence of int
            Numbers of the samples.
        targets : Targets
            The k responses.

        Returns
        -------
        Replicates or None
            None if a bench test has too few runs, or if their covariance is singular.
        """
        is_good = (runs["status"] == "ok") & runs["sample"].isin(samples)
        good_runs = runs[is_good]
        covariance = np.zeros((len(targets), len(targets)))
        mean_degrees_of_freedom = 0.0
        weights_by_bench_test: list[np.ndarray] = []
        for bench_test, columns in targets.benches.items():
            # Estimate the covariance of the responses of this bench test.
            bench_runs = select_bench_runs(good_runs, bench_test)
            names = [targets.names[k] for k in columns]
            bench_covariance, degrees_of_freedom = estimate_within_covariance(
                bench_runs[names], bench_runs["sample"]
            )
            has_too_few_runs = degrees_of_freedom <= len(columns)
            if has_too_few_runs or not _is_positive_definite(bench_covariance):
                return None

            # Weight each sample by its number of runs in this bench test. A surrogate
            # takes a single weight for a sample. So if samples have r times as many
            # runs in the first bench test as in this one, multiply the weights by r.
            # The noise variance of a mean, which is the variance of a run over the
            # weight, must stay the same. So multiply the covariance by r, too.
            runs_of_sample = bench_runs["sample"].value_counts()
            weights = runs_of_sample.reindex(samples, fill_value=0).to_numpy(float)
            if weights_by_bench_test:
                ratio = weights_by_bench_test[0].mean() / weights.mean()
            else:
                ratio = 1.0
            weights_by_bench_test.append(weights * ratio)
            covariance[np.ix_(columns, columns)] = bench_covariance * ratio

            # A surrogate takes a single number, so average it over the responses.
            mean_degrees_of_freedom += degrees_of_freedom * len(columns) / len(targets)
        return cls(
            precision=np.mean(weights_by_bench_test, axis=0),
            noise_covariance=covariance,
            noise_freedom=float(mean_degrees_of_freedom),
        )


def train_surrogate(
    dataset: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Targets,
    settings: NetworkSettings,
    *,
    names: Sequence[str],
    definitions: Definitions | None = None,
    source: object = "dataset",
    surrogate: str = "network",
    scale: Mapping[str, str] | None = None,
) -> Training:
    """Train a surrogate on the usable samples of a study.

    With ``settings.replicates``, the noise is estimated from the runs of each sample
    (`Replicates`). With ``settings.validation_noise``, the errors of a first fit at the
    validation samples show the correlation of the noises (`estimate_error_covariance`),
    which a second fit uses.

    Parameters
    ----------
    dataset : pandas.DataFrame
        A row for each sample: ``sample``, ``status``, parameters, responses.
    runs : pandas.DataFrame
        Their single runs.
    targets : Targets
        The responses to learn.
    settings : NetworkSettings
        The section `network`.
    names : sequence of str
        Columns of the parameters, the inputs of the surrogate.
    definitions : mapping, optional
        Definition of each response, which is stored with the surrogate.
    source : object, optional
        File of the dataset, for an error.
    surrogate : str, optional
        Kind of the surrogate.
    scale : mapping, optional
        Name of the scale of each parameter that is not linear, by name.

    Returns
    -------
    Training

    Raises
    ------
    InputError
        If fewer than `MIN_SAMPLES` samples are usable.
    """
    usable = dataset[dataset["status"] == "ok"].reset_index(drop=True)
    if len(usable) < MIN_SAMPLES:
        raise InputError(
            source=source,
            key="usable samples",
            value=len(usable),
            allowed=f"at least {MIN_SAMPLES} with status ok",
        )
    X = usable[list(names)].to_numpy(float)
    Y = usable[list(targets.names)].to_numpy(float)
    # Row numbers of the training, validation and test samples.
    rows = split_rows(usable, settings.split, settings.seed)

    def fit(part: np.ndarray, covariance: np.ndarray | None = None) -> _Fit:
        """Fit a new surrogate to the samples in some rows of `usable`.

        All else comes from the arguments of `train_surrogate`: the runs of the samples,
        the settings, and the names and scales of inputs and outputs.

        Parameters
        ----------
        part : numpy.ndarray
            Row numbers of the samples.
        covariance : numpy.ndarray, (k, k), optional
            Covariance of the noise of the responses. Only the ratios of its entries
            matter. It is used unless the noise is estimated from the runs. None means
            that it is unknown.

        Returns
        -------
        _Fit
            The surrogate, and the arguments of its fit about the noise.
        """
        samples = usable["sample"].iloc[part]
        noise: dict[str, Any] = {"noise_covariance": covariance}
        if settings.replicates:
            # The result is None if the samples have too few runs. Then the noise is
            # treated as unknown.
            replicates = Replicates.estimate(runs, samples, targets)
            if replicates is not None:
                noise = replicates._asdict()
        untrained = wrap_for_scale(make(surrogate, settings), scale or {})
        untrained.describe(
            inputs=names,
            outputs=targets.names,
            definitions=definitions,
            samples=samples,
        )
        return _Fit(untrained.fit(X[part], Y[part], **noise), noise)

    # Fit the training part. The errors at the validation part may show the noise.
    model, noise = fit(rows["train"])
    covariance = None
    if settings.validation_noise:
        unseen = rows["validation"]
        errors = Y[unseen] - model.predict(X[unseen])
        covariance = estimate_error_covariance(errors, targets, source)
        model, noise = fit(rows["train"], covariance)
    predicted = model.predict(X)

    # Measure how accurate the predictions are.
    metrics: dict[str, Any] = {"n_samples": len(X), "left_out": len(dataset) - len(X)}
    metrics |= _compute_accuracy(Y, predicted, targets.names, rows)
    metrics["r2_three_ways"] = _compute_r2_variants(
        usable, runs, predicted, rows["test"], targets
    )
    predictions = _tabulate_predictions(usable["sample"], Y, predicted, rows, targets)

    # Now that the accuracy is known, fit some kinds of surrogates to all samples.
    if model.of_all_samples:
        model, noise = fit(np.arange(len(X)), covariance)
        predictions[_name_final_columns(targets.names)] = model.predict(X)
    metrics["n_fitted"] = len(model.samples)
    metrics |= model.report()
    covariance = noise["noise_covariance"]
    metrics["noise_covariance"] = None if covariance is None else covariance.tolist()
    metrics["noise_freedom"] = noise.get("noise_freedom")
    starts = pd.DataFrame(model.start_rows())
    if starts.empty:
        starts = pd.DataFrame(columns=["start", "chosen"])
    return Training(model, metrics, predictions, starts)


class _Fit(NamedTuple):
    """A fitted surrogate, and the arguments of its fit about the noise."""

    model: Surrogate
    noise: dict[str, Any]


def _tabulate_predictions(
    samples: pd.Series,
    Y: np.ndarray,
    predicted: np.ndarray,
    rows: Mapping[str, np.ndarray],
    targets: Targets,
) -> pd.DataFrame:
    """Tabulate the simulated and predicted responses of the samples.

    Parameters
    ----------
    samples : pandas.Series, (n,)
        Numbers of the samples; its index must be 0 to n - 1.
    Y, predicted : numpy.ndarray, (n, k)
        Simulated and predicted responses.
    rows : mapping
        Row numbers of each part: train, validation, test.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        `sample`, `split` (the part to which the sample belongs), and the simulated and
        predicted values of each response.
    """
    # The rows of the table are numbered from 0, so `loc` takes the row numbers.
    table = pd.DataFrame({"sample": samples, "split": ""})
    for part in SPLITS:
        table.loc[rows[part], "split"] = part
    for k, target in enumerate(targets):
        table[target.name] = Y[:, k]
        table[target.response.predicted] = predicted[:, k]
    return table


def describe_training(metrics: Mapping[str, Any]) -> str:
    """Describe how accurate a surrogate is, and how a network was trained.

    Parameters
    ----------
    metrics : mapping
        The attribute `metrics` of `Training`. It has entries about the training only
        for networks: `starts`, `converged_starts`, `n_weights`, `gamma` (how many
        weights the data determine), and `at_cap` (the weights whose regularisation has
        reached its upper limit).

    Returns
    -------
    str
        One or more lines.
    """
    scores = []
    for name, score in metrics["test"].items():
        # A response that never varies has no R2 (None).
        if score["r2"] is not None:
            error = format_significant(score["rmse"], 3)
            scores.append(f"{name}: R2 {score['r2']:.3f}, error {error}")
    lines = [f"{metrics['n_test']} samples for the test: {', '.join(scores)}"]
    if metrics["n_fitted"] == metrics["n_samples"]:
        lines.append(f"then fitted to all {metrics['n_fitted']} samples")
    if "starts" in metrics:
        lines.append(
            f"{metrics['converged_starts']} of {metrics['starts']} starts converged; "
            f"the data determine {metrics['gamma']:.1f} of {metrics['n_weights']} "
            "weights of the kept network"
        )
    if "members" in metrics:
        lines.append(
            f"{metrics['members']} networks predict; their disagreement is part of the "
            "error"
        )
    if metrics.get("at_cap"):
        lines.append(
            "weights held at zero, because their regularisation is at its upper limit: "
            f"{', '.join(metrics['at_cap'])}"
        )
    return "\n".join(lines)


def restore_surrogate(
    surrogate_json: StrPath, predictions_csv: StrPath, dataset_csv: StrPath
) -> Surrogate:
    """Load a trained surrogate, and check that its files come from the same training.

    Parameters
    ----------
    surrogate_json : path
        The surrogate.
    predictions_csv : path
        Its predictions, as the training wrote them.
    dataset_csv : path
        The samples.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If the surrogate does not reproduce its predictions on the samples of the
        dataset.
    """
    model = load(surrogate_json)
    final_columns = _name_final_columns(model.outputs)
    test_columns = [name_derived_column(name, "predicted") for name in model.outputs]
    predictions = read_table(predictions_csv, ("sample", "split", *test_columns))
    dataset = read_table(dataset_csv, ("sample", *model.inputs, "status"))
    definitions, summary_json = read_definitions(dataset_csv)
    reject_other_definitions(
        model.definitions, surrogate_json, definitions, summary_json
    )

    # A surrogate that was fitted to all samples has additional columns with its
    # predictions for them. Any other surrogate was fitted to the training part only.
    if set(final_columns) <= set(predictions):
        columns_of_fit = final_columns
        fitted = predictions
    else:
        columns_of_fit = test_columns
        fitted = predictions[predictions["split"] == "train"]

    # Predict the samples of the fit again.
    usable = dataset[dataset["status"] == "ok"].set_index("sample")
    missing = sorted(set(fitted["sample"]) - set(usable.index))
    if missing or fitted.empty:
        raise InputError(
            source=predictions_csv,
            key="samples",
            value=missing,
            allowed=f"usable samples of {dataset_csv}",
        )
    X = usable.loc[fitted["sample"], list(model.inputs)].to_numpy(float)
    if not np.allclose(
        model.predict(X), fitted[columns_of_fit], rtol=PREDICTION_TOLERANCE
    ):
        raise InputError(
            source=predictions_csv,
            key="predictions",
            value="others",
            allowed=f"those of {surrogate_json} on {dataset_csv}",
        )
    return model


def reject_other_targets(
    model: Surrogate,
    path: object,
    targets: Targets,
    definitions: Definitions,
    source: object,
) -> None:
    """Raise InputError for a surrogate whose responses are not those of the targets.

    Parameters
    ----------
    model : Surrogate
        The surrogate.
    path : object
        Its file.
    targets : Targets
        The targets of the study.
    definitions : mapping
        How the responses of the targets are defined.
    source : object
        File of the definitions.

    Raises
    ------
    InputError
        If the surrogate has other responses, or has them in another order or with other
        definitions.
    """
    if model.outputs != targets.names:
        raise InputError(
            source=path,
            key="outputs",
            value=list(model.outputs),
            allowed=f"the responses of the targets, {', '.join(targets.names)}",
        )
    reject_other_definitions(model.definitions, path, definitions, source)


def split_samples(
    n_samples: int, fractions: Sequence[float], seed: int
) -> dict[str, np.ndarray]:
    """Split the numbers 0 to n_samples - 1 at random into train, validation and test.

    A random permutation is cut in three. `fractions` are those of train and validation.
    Their sizes are rounded down, and test has the rest. This gives 95, 20 and 22 of the
    paper's 137 samples.
    """
    n_train = math.floor(fractions[0] * n_samples + ROUNDING_ERROR)
    n_validation = math.floor(fractions[1] * n_samples + ROUNDING_ERROR)
    order = np.random.RandomState(seed).permutation(n_samples)
    parts = np.split(order, [n_train, n_train + n_validation])
    return dict(zip(SPLITS, parts, strict=True))


def split_rows(
    samples: pd.DataFrame, fractions: Sequence[float], seed: int
) -> dict[str, np.ndarray]:
    """Split the rows of a table into training, validation and test.

    The samples of the design are split at random (`split_samples`). A strategy with
    refinement adds samples in several rounds. These are all used for training. The
    split of the design is the same in each round, so the test samples stay the same.

    Parameters
    ----------
    samples : pandas.DataFrame
        A row for each sample. A sample that a refinement added has a number in the
        column `round`.
    fractions : sequence of float
        Fractions of the design for training and for validation. The rest is for the
        test.
    seed : int
        Seed of the random split.

    Returns
    -------
    dict
        Row numbers of the parts "train", "validation" and "test".
    """
    is_added = np.zeros(len(samples), bool)
    if "round" in samples:
        is_added = samples["round"].notna().to_numpy()
    design_rows = np.flatnonzero(~is_added)
    rows = {}
    for name, design_part in split_samples(len(design_rows), fractions, seed).items():
        rows[name] = design_rows[design_part]
    rows["train"] = np.concatenate([rows["train"], np.flatnonzero(is_added)])
    return rows


def estimate_error_covariance(
    errors: np.ndarray, targets: Targets, source: object
) -> np.ndarray:
    """Estimate the covariance of errors at unseen samples.

    An error combines the noise of the sample with the noise that the fit has learned
    from other samples. Both have the correlation of the noise, so it can be estimated
    even from an overfitted model. The variances are too large.

    Parameters
    ----------
    errors : numpy.ndarray, (m, k)
        Simulated minus predicted responses at unseen samples.
    targets : Targets
        The targets of the study.
    source : object
        File of the samples, for an error.

    Returns
    -------
    numpy.ndarray, (k, k)
        The covariance, which is 0 between different bench tests.

    Raises
    ------
    InputError
        If the covariance is singular.
    """
    product = errors.T @ errors / max(len(errors), 1)
    covariance = np.where(targets.same_bench, product, 0.0)
    has_enough_errors = len(errors) > len(targets)
    if not (has_enough_errors and _is_positive_definite(covariance)):
        raise InputError(
            source=source,
            key="validation samples",
            value=len(errors),
            allowed=(
                f"more than {len(targets)}, with errors of full rank, or "
                "network.validation_noise: false"
            ),
        )
    return covariance


def _is_positive_definite(matrix: np.ndarray) -> bool:
    """Return whether all eigenvalues of a symmetric matrix are above 0."""
    smallest, *_ = np.linalg.eigvalsh(matrix)  # in ascending order
    return bool(smallest > 0)


def compute_corrected_r2(
    y: np.ndarray, predicted: np.ndarray, errors: np.ndarray
) -> float | None:
    """Compute R2 against the unknown true means of the responses.

    Let y = mean + noise, where the noise has the variance se^2 and is independent of
    the predictions, which come from other samples. Then the sums of squares have the
    expectations

        E[SSE] = sum (mean - predicted)^2 + sum se^2
        E[SST] = sum (mean - its average)^2 + (1 - 1/m) sum se^2

    Removing the noise from both gives R2 = 1 - (SSE - sum se^2) / (SST - (1 - 1/m) sum
    se^2).

    Parameters
    ----------
    y, predicted, errors : numpy.ndarray, (m,)
        Simulated means, their predictions, and the standard errors of the means.

    Returns
    -------
    float or None
        An estimate, which may exceed 1 by chance. It is None if standard errors are
        missing, or if the noise explains all of SST.
    """
    noise = np.sum(errors**2)
    between = np.sum((y - np.mean(y)) ** 2) - (1 - 1 / len(y)) * noise
    if not between > 0:
        return None
    residual = np.sum((y - predicted) ** 2) - noise
    return float(1 - residual / between)


def _compute_accuracy(
    Y: np.ndarray,
    predicted: np.ndarray,
    names: Sequence[str],
    rows: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """Compute R2 and RMSE of each response on each part of the samples.

    Parameters
    ----------
    Y, predicted : numpy.ndarray, (n, k)
        Simulated and predicted responses.
    names : sequence of str
        Names of the responses.
    rows : mapping
        Row numbers of each part.

    Returns
    -------
    dict
        The keys `n_train`, `n_validation` and `n_test` have numbers of samples. The
        keys `train`, `validation` and `test` have `r2` and `rmse` by name of the
        response, which are None for a part without samples.
    """
    accuracy: dict[str, Any] = {f"n_{part}": len(rows[part]) for part in SPLITS}
    for part, rows_of_part in rows.items():
        scores = {}
        for k, name in enumerate(names):
            y = Y[rows_of_part, k]
            prediction = predicted[rows_of_part, k]
            rmse = None
            if len(rows_of_part):
                rmse = float(np.sqrt(np.mean((y - prediction) ** 2)))
            scores[name] = {"r2": compute_r2(y, prediction), "rmse": rmse}
        accuracy[part] = scores
    return accuracy


def _compute_r2_variants(
    usable: pd.DataFrame,
    runs: pd.DataFrame,
    predicted: np.ndarray,
    test_rows: np.ndarray,
    targets: Targets,
) -> dict[str, dict[str, float | None]]:
    """Compute R2 of the test samples in three ways.

    They differ in the simulated numbers that are compared with the predictions: the
    means of the samples, the single runs, or the unknown true means, for which the
    noise is subtracted from the sums of squares.

    Parameters
    ----------
    usable : pandas.DataFrame
        All n samples, with the means of their responses and their standard errors.
    runs : pandas.DataFrame
        Their single runs.
    predicted : numpy.ndarray, (n, k)
        Predicted means of the responses of the samples.
    test_rows : numpy.ndarray
        Row numbers of the test samples.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        For each response, three values of R2: `sample_means`, `single_runs`, and
        `noise_corrected`, which is the result of `compute_corrected_r2`.
    """
    test_samples = usable.iloc[test_rows]
    is_test_run = (runs["status"] == "ok") & runs["sample"].isin(test_samples["sample"])
    test_runs = runs[is_test_run]
    scores = {}
    for name, error_name, predicted_means in zip(
        targets.names, targets.errors, predicted[test_rows].T, strict=True
    ):
        means = test_samples[name].to_numpy(float)
        errors = test_samples[error_name].to_numpy(float)
        # The prediction of a single run is the predicted mean of its sample. The index
        # of the series is the number of the sample, so it finds the mean for each run.
        good_runs = test_runs[test_runs[name].notna()]
        mean_of_sample = pd.Series(predicted_means, index=test_samples["sample"])
        predicted_runs = mean_of_sample[good_runs["sample"]].to_numpy()
        run_values = good_runs[name].to_numpy(float)
        scores[name] = {
            "sample_means": compute_r2(means, predicted_means),
            "single_runs": compute_r2(run_values, predicted_runs),
            "noise_corrected": compute_corrected_r2(means, predicted_means, errors),
        }
    return scores


def _name_final_columns(names: Sequence[str]) -> list[str]:
    """Name the columns of the predictions by the fit to all samples."""
    return [name_derived_column(name, "final") for name in names]
