"""A study's samples to a surrogate of the simulator (`repose.calibrate.surrogates`): section 3.2.2 of the paper."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS, named
from repose.calibrate.responses import (
    Definitions,
    derived,
    require_same_definitions,
    response,
)
from repose.calibrate.runs import of_bench
from repose.calibrate.studied import Studied
from repose.calibrate.surrogates.accuracy import r2
from repose.calibrate.surrogates.base import Surrogate, load, make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.calibrate.variance import within_covariance
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_table, write_json, write_table
from repose.stages.dataset import read_definitions
from repose.stages.tables import read_dataset, read_runs

SPLITS = ("train", "validation", "test")
FEWEST_SAMPLES = (
    12  # 8 to train, 1 to validate, 3 to test: below that no R2 means anything
)


class Training(NamedTuple):
    """Result of `train`; predictions are by the training part, and by the fit to all samples if there is one."""

    model: Surrogate  # of all usable samples, or of the training part: `Surrogate.of_all_samples`
    metrics: dict[
        str, Any
    ]  # numbers of samples, R2 and RMSE by response and part, the surrogate's report
    predictions: pd.DataFrame
    starts: (
        pd.DataFrame
    )  # a row for each start of the training; empty for a surrogate without starts


class Replicates(NamedTuple):
    """Noise of the responses, from the repeated runs of each sample, as `repose.calibrate.surrogates.base.Surrogate.fit` takes it.

    Responses of different bench tests are independent. With several bench tests, `precision` counts in runs of the
    first one, and each block of the covariance is scaled by the runs that a sample of its bench test has.
    """

    precision: np.ndarray  # (samples,), runs of each sample: its weight
    noise_covariance: np.ndarray  # (k, k), of a single run about its sample's mean
    noise_freedom: (
        float  # degrees of freedom of the covariance, mean over the responses
    )

    @classmethod
    def of(
        cls, runs: pd.DataFrame, samples: Sequence[int], targets: Targets
    ) -> Self | None:
        """Estimate the noise of some samples; None if the scatter of a bench test has no full rank."""
        ok = runs[(runs["status"] == "ok") & runs["sample"].isin(samples)]
        covariance, freedom, weights = np.zeros((len(targets), len(targets))), 0.0, []
        for apparatus, columns in targets.benches.items():
            own = of_bench(ok, apparatus)
            block, count = within_covariance(
                own[[targets.names[k] for k in columns]], own["sample"]
            )
            if not (count > len(columns) and np.linalg.eigvalsh(block)[0] > 0):
                return None
            weights.append(
                own["sample"]
                .value_counts()
                .reindex(samples, fill_value=0)
                .to_numpy(float)
            )
            share = weights[0].mean() / weights[-1].mean()
            weights[-1] = weights[-1] * share
            covariance[np.ix_(columns, columns)] = block * share
            freedom += count * len(columns) / len(targets)
        return cls(np.mean(weights, axis=0), covariance, float(freedom))


def train(
    dataset: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Targets,
    settings: NetworkSettings,
    definitions: Definitions | None = None,
    source: object = "dataset",
    names: Sequence[str] | None = None,
    surrogate: str = "network",
) -> Training:
    """Train a surrogate on the usable samples of a study; InputError for fewer than `FEWEST_SAMPLES`.

    With `replicates` the runs of each sample give the noise (`Replicates`). With `validation_noise` the errors of a
    first fit at the validation samples give the correlation of the noises (`error_covariance`) for a second fit.
    """
    names = named(dataset) if names is None else names
    usable = dataset[dataset["status"] == "ok"].reset_index(drop=True)
    if len(usable) < FEWEST_SAMPLES:
        raise InputError(
            source,
            "usable samples",
            len(usable),
            f"at least {FEWEST_SAMPLES} with status ok",
        )
    X, Y = (
        usable[list(names)].to_numpy(float),
        usable[list(targets.names)].to_numpy(float),
    )
    rows = rows_of(usable, settings.split, settings.seed)

    def fitted(
        part: np.ndarray, covariance: np.ndarray | None = None
    ) -> tuple[Surrogate, dict[str, Any]]:
        learned = usable["sample"].iloc[part]
        replicates = (
            Replicates.of(runs, learned, targets) if settings.replicates else None
        )
        noise = (
            {"noise_covariance": covariance}
            if replicates is None
            else replicates._asdict()
        )
        model = make(surrogate, settings).describe(
            names, targets.names, definitions, learned
        )
        return model.fit(X[part], Y[part], **noise), noise

    model, noise = fitted(rows["train"])
    covariance = None
    if settings.validation_noise:
        unseen = rows["validation"]
        covariance = error_covariance(
            Y[unseen] - model.predict(X[unseen]), targets, source
        )
        model, noise = fitted(rows["train"], covariance)
    P = model.predict(X)

    metrics: dict[str, Any] = {"n_samples": len(X), "left_out": len(dataset) - len(X)}
    metrics |= _accuracy(Y, P, targets.names, rows)
    metrics["r2_three_ways"] = _three_ways(usable, runs, P, rows["test"], targets)
    table = pd.DataFrame({"sample": usable["sample"], "split": ""})
    for name in SPLITS:
        table.loc[rows[name], "split"] = name
    for k, target in enumerate(targets):
        table[target.name], table[target.response.predicted] = Y[:, k], P[:, k]
    if model.of_all_samples:
        model, noise = fitted(np.arange(len(X)), covariance)
        table[_finally(targets.names)] = model.predict(X)
    metrics["n_fitted"] = len(model.samples)
    metrics |= model.report()
    covariance = noise["noise_covariance"]
    metrics["noise_covariance"] = None if covariance is None else covariance.tolist()
    metrics["noise_freedom"] = noise.get("noise_freedom")
    starts = pd.DataFrame(model.start_rows())
    return Training(
        model,
        metrics,
        table,
        starts if len(starts) else pd.DataFrame(columns=["start", "chosen"]),
    )


def run(
    dataset_csv: Path_,
    runs_csv: Path_,
    study: Studied,
    out_dir: Path_,
    source: object = "configuration",
) -> dict[str, Any]:
    """Train on files; write network.json, metrics.json, predictions.csv and starts.csv; return the metrics."""
    targets, settings, definitions = study.targets, study.settings, study.definitions
    dataset = read_dataset(dataset_csv, targets)
    runs = read_runs(runs_csv, targets, dataset, dataset_csv)
    of_dataset, summary_json = read_definitions(dataset_csv)
    require_same_definitions(of_dataset, summary_json, definitions, source)
    about = {
        "definitions": definitions or of_dataset,
        "source": dataset_csv,
        "surrogate": settings.surrogate,
    }
    training = train(dataset, runs, targets, settings.network, **about)
    out = Path(out_dir)
    training.model.save(out / "network.json")
    write_json(out / "metrics.json", training.metrics)
    write_table(out / "predictions.csv", training.predictions)
    write_table(out / "starts.csv", training.starts)
    return training.metrics


def message(metrics: Mapping[str, Any]) -> str:
    """Write the training as text: errors at unseen samples, and for a network the result of its starts."""
    responses = metrics["test"].items()
    words = [
        f"{name}: R2 {score['r2']:.3f}, error {score['rmse']:.3g}"
        for name, score in responses
        if score["r2"]
    ]
    lines = [f"{metrics['n_test']} samples for the test: " + ", ".join(words)]
    if metrics["n_fitted"] == metrics["n_samples"]:
        lines.append(f"then fitted to all {metrics['n_fitted']} samples")
    if "starts" in metrics:
        determined = f"{metrics['gamma']:.1f} of {metrics['n_weights']} weights of the kept network"
        converged = (
            f"{metrics['converged_starts']} of {metrics['starts']} starts converged"
        )
        lines.append(f"{converged}; the data determine {determined}")
    if "members" in metrics:
        lines.append(
            f"{metrics['members']} networks predict; their disagreement is part of the error"
        )
    if metrics.get("at_cap"):
        lines.append(
            f"at the cap of their regularisation, so held at zero: {', '.join(metrics['at_cap'])}"
        )
    return "\n".join(lines)


def restore(
    surrogate_json: Path_, predictions_csv: Path_, dataset_csv: Path_
) -> Surrogate:
    """Load the trained surrogate; InputError if its files are not of one training."""
    model = load(surrogate_json)
    predicted = [response(name, surrogate_json).predicted for name in model.outputs]
    predictions = read_table(predictions_csv, ("sample", "split", *predicted))
    of_all = set(_finally(model.outputs)) <= set(predictions)
    predicted = _finally(model.outputs) if of_all else predicted
    table = read_table(dataset_csv, ("sample", *PARAMETERS, "status"))
    definitions, summary_json = read_definitions(dataset_csv)
    require_same_definitions(
        model.definitions, surrogate_json, definitions, summary_json
    )
    usable = table[table["status"] == "ok"].set_index("sample")
    trained = predictions[(predictions["split"] == "train") | of_all]
    missing = sorted(set(trained["sample"]) - set(usable.index))
    require(
        not missing and not trained.empty,
        predictions_csv,
        "samples",
        missing,
        f"usable samples of {dataset_csv}",
    )
    X = usable.loc[trained["sample"], list(model.inputs or PARAMETERS)].to_numpy(float)
    if not np.allclose(model.predict(X), trained[predicted], rtol=1e-6):
        raise InputError(
            predictions_csv,
            "predictions",
            "others",
            f"those of {surrogate_json} on {dataset_csv}",
        )
    return model


def require_targets(
    model: Surrogate,
    path: object,
    targets: Targets,
    definitions: Definitions,
    source: object,
) -> None:
    """Refuse a surrogate with other responses than the targets, in another order, or with other definitions of them."""
    allowed = f"the responses of the targets, {', '.join(targets.names)}"
    require(
        model.outputs == targets.names, path, "outputs", list(model.outputs), allowed
    )
    require_same_definitions(model.definitions, path, definitions, source)


def split(samples: int, shares: Sequence[float], seed: int) -> dict[str, np.ndarray]:
    """Split row numbers into train, validation and test: a permutation by RandomState(seed), cut in three.

    Train and validation are rounded down and test takes the rest: the paper's 95, 20, 22 of 137.
    """
    # 0.7 * 90 is 62.99999999999999
    train, validation = (math.floor(share * samples + 1e-9) for share in shares[:2])
    order = np.random.RandomState(seed).permutation(samples)
    return dict(zip(SPLITS, np.split(order, [train, train + validation]), strict=True))


def rows_of(
    samples: pd.DataFrame, shares: Sequence[float], seed: int
) -> dict[str, np.ndarray]:
    """Split a table's rows into train, validation and test; samples with a `round` of refinement all train.

    The others are split as if they were alone, so every round has the same test samples as the design.
    """
    added = (
        samples["round"].notna().to_numpy()
        if "round" in samples
        else np.zeros(len(samples), bool)
    )
    designed = np.flatnonzero(~added)
    rows = {name: designed[i] for name, i in split(len(designed), shares, seed).items()}
    rows["train"] = np.concatenate([rows["train"], np.flatnonzero(added)])
    return rows


def error_covariance(
    errors: np.ndarray, targets: Targets, source: object
) -> np.ndarray:
    """Estimate covariance (k, k) of errors (m, k) at unseen samples, 0 between bench tests; InputError below rank k.

    An error is the noise of the sample less what the fit had learned of the noise of others. Both are correlated as the
    noise is, so even a fit that has learned its noise by heart shows the correlation; the size is too large.
    """
    covariance = np.where(
        targets.same_bench, errors.T @ errors / max(len(errors), 1), 0.0
    )
    allowed = f"more than {len(targets)}, with errors of full rank, or network.validation_noise: false"
    enough = len(errors) > len(targets) and np.linalg.eigvalsh(covariance)[0] > 0
    require(enough, source, "validation samples", len(errors), allowed)
    return covariance


def r2_noise_corrected(
    y: np.ndarray, predicted: np.ndarray, errors: np.ndarray
) -> float | None:
    """Compute R2 against the unknown means of the responses, without noise; arguments (m,).

    With y = mean + noise of variance se^2, independent of predictions made from other samples, E[SSE] = sum (mean -
    predicted)^2 + sum se^2 and E[SST] = sum (mean - its average)^2 + (1 - 1/m) sum se^2. Without the noise in both sums
    R2 is 1 - (SSE - sum se^2) / (SST - (1 - 1/m) sum se^2). It is an estimate and may exceed 1 by chance. None without
    standard errors, or if the noise explains all of SST.
    """
    noise = np.sum(errors**2)
    between = np.sum((y - np.mean(y)) ** 2) - (1 - 1 / len(y)) * noise
    return (
        float(1 - (np.sum((y - predicted) ** 2) - noise) / between)
        if between > 0
        else None
    )


def _accuracy(
    Y: np.ndarray, P: np.ndarray, names: Sequence[str], rows: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """Count the samples of each part, and compute R2 and RMSE of each response there."""
    counts = {f"n_{name}": len(rows[name]) for name in SPLITS}
    return counts | {
        name: {
            response: {
                "r2": r2(Y[i, k], P[i, k]),
                "rmse": float(np.sqrt(np.mean((Y[i, k] - P[i, k]) ** 2))),
            }
            for k, response in enumerate(names)
        }
        for name, i in rows.items()
    }


def _three_ways(
    usable: pd.DataFrame,
    runs: pd.DataFrame,
    P: np.ndarray,
    test: np.ndarray,
    targets: Targets,
) -> dict[str, dict[str, float | None]]:
    """Compute R2 of the test samples: on means, on single runs, and corrected for the noise of the means."""
    unseen, ok = usable.iloc[test], runs[runs["status"] == "ok"]
    scores = {}
    for name, error, predicted in zip(
        targets.names, targets.errors, P[test].T, strict=True
    ):
        single = ok[ok[name].notna() & ok["sample"].isin(unseen["sample"])]
        of_run = pd.Series(predicted, unseen["sample"])[single["sample"]].to_numpy()
        mean, errors = (unseen[column].to_numpy(float) for column in (name, error))
        scores[name] = {
            "sample_means": r2(mean, predicted),
            "single_runs": r2(single[name].to_numpy(float), of_run),
            "noise_corrected": r2_noise_corrected(mean, predicted, errors),
        }
    return scores


def _finally(names: Sequence[str]) -> list[str]:
    """Name the columns of the predictions by the fit to all samples."""
    return [derived(name, "final") for name in names]
