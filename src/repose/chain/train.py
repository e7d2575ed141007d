"""Training of the network on a study's dataset: split, weights, R2 three ways, and the files it leaves."""

import json
import math
from pathlib import Path

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.core.variance import within_covariance
from repose.surrogate import load
from repose.surrogate.bayesian_bp import RESPONSES, PlainBayesianBP, r2, weights_from_errors

SPLITS = ("train", "validation", "test")
PREDICTED = ("aor_predicted_deg", "height_predicted_mm")
FEWEST_SAMPLES = 12  # 8 to train, 1 to validate, 3 to test: below that no R2 means anything


def run(dataset_csv, runs_csv, settings, out_dir):
    """Train; write network.json, metrics.json, predictions.csv and starts.csv; return the metrics.

    dataset_csv, runs_csv: as `repose.chain.dataset` writes them. settings: hidden, epochs, goal, starts, seed,
    split (three shares), prior ("one" unless given), and, both False unless given: weights_from_errors, weigh
    samples by their standard errors; correlated_noise, reckon with the covariance of the responses within
    the training samples. Both are left out where the samples have one run each. Raises InputError for a missing
    column or fewer than 12 usable samples.
    """
    import pandas as pd  # not needed by whoever wants the network alone

    table = read_table(
        dataset_csv, ("sample", *PARAMETERS, "status", *RESPONSES, "aor_se_deg", "height_se_mm")
    )
    runs = read_table(runs_csv, ("sample", "status", *RESPONSES))
    usable = table[table["status"] == "ok"].reset_index(drop=True)
    if len(usable) < FEWEST_SAMPLES:
        raise InputError(
            dataset_csv, "usable samples", len(usable), f"at least {FEWEST_SAMPLES} with status ok"
        )
    X, Y = usable[list(PARAMETERS)].to_numpy(float), usable[list(RESPONSES)].to_numpy(float)
    errors = usable[["aor_se_deg", "height_se_mm"]].to_numpy(float)
    rows = rows_of(usable, settings["split"], settings["seed"])

    weighted = bool(settings.get("weights_from_errors", False) and np.isfinite(errors).any(axis=0).all())
    covariance = None
    if settings.get("correlated_noise", False):
        covariance = _noise_covariance(runs, usable["sample"].iloc[rows["train"]])
    weight = precisions(errors, covariance is not None)[rows["train"]] if weighted else None
    network = PlainBayesianBP(
        **{key: settings[key] for key in ("hidden", "epochs", "goal", "starts", "seed")},
        prior=settings.get("prior", "one"),
    )
    network.fit(X[rows["train"]], Y[rows["train"]], precision=weight, noise_covariance=covariance)
    P = network.predict(X)

    metrics = {"n_samples": len(X), "left_out": len(table) - len(X)}
    metrics |= {f"n_{name}": len(rows[name]) for name in SPLITS}
    for name in SPLITS:
        i = rows[name]
        metrics[name] = {
            response: {"r2": r2(Y[i, k], P[i, k]), "rmse": float(np.sqrt(np.mean((Y[i, k] - P[i, k]) ** 2)))}
            for k, response in enumerate(RESPONSES)
        }
    metrics["r2_three_ways"] = _three_ways(usable, runs, Y, P, errors, rows["test"])
    for key in (
        "gamma",
        "beta",
        "log_evidence",
        "epochs",
        "stop_reason",
        "best_start",
        "n_residuals",
    ):
        metrics[key] = getattr(network, key + "_")
    metrics |= {"n_weights": int(sum(w.size for w in (network.W1_, network.b1_, network.W2_, network.b2_)))}
    metrics |= {"starts": network.starts, "weighted": weighted, "prior": network.prior}
    metrics["alpha"] = np.asarray(network.alpha_).tolist()
    metrics["noise_covariance"] = None if covariance is None else covariance.tolist()

    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    samples = usable["sample"].iloc[rows["train"]]
    network.describe(PARAMETERS, RESPONSES, samples=samples).save(out / "network.json")
    (out / "metrics.json").write_text(json.dumps(metrics, indent=1) + "\n")
    predictions = pd.DataFrame({"sample": usable["sample"], "split": ""})
    for name in SPLITS:
        predictions.loc[rows[name], "split"] = name
    for k, (response, predicted) in enumerate(zip(RESPONSES, PREDICTED, strict=True)):
        predictions[response], predictions[predicted] = Y[:, k], P[:, k]
    predictions.to_csv(out / "predictions.csv", index=False)
    starts = pd.DataFrame(network.starts_)
    starts["alpha"] = [
        " ".join(f"{a:.6g}" for a in np.atleast_1d(start["alpha"])) for start in network.starts_
    ]
    starts["chosen"] = starts["start"] == network.best_start_
    starts.to_csv(out / "starts.csv", index=False)
    return metrics


def restore(network_json, predictions_csv, dataset_csv):
    """The trained network with its error bars, from the files that `run` left and the dataset it read.

    Nothing is trained: the Hessian is that of the saved weights. Raises InputError for a bad file, and where the
    files are not of one training.
    """
    model = load(network_json, RESPONSES)
    predictions = read_table(predictions_csv, ("sample", "split", *PREDICTED))
    table = read_table(
        dataset_csv, ("sample", *PARAMETERS, "status", *RESPONSES, "aor_se_deg", "height_se_mm")
    )
    usable = table[table["status"] == "ok"].set_index("sample")
    trained = predictions[predictions["split"] == "train"]
    missing = sorted(set(trained["sample"]) - set(usable.index))
    if missing or trained.empty:
        raise InputError(predictions_csv, "samples", missing, f"usable samples of {dataset_csv}")
    X = usable.loc[trained["sample"], list(PARAMETERS)].to_numpy(float)
    if not np.allclose(model.predict(X), trained[list(PREDICTED)], rtol=1e-6):
        raise InputError(
            predictions_csv, "predictions", "others", f"those of {network_json} on {dataset_csv}"
        )
    return model


def split(samples, shares, seed):
    """Row numbers of train, validation and test: a permutation by RandomState(seed) cut in three.

    Train and validation are rounded down and test takes the rest, which is the paper's 95, 20, 22 of 137.
    """
    # 0.7 * 90 is 62.99999999999999
    train, validation = (math.floor(share * samples + 1e-9) for share in shares[:2])
    order = np.random.RandomState(seed).permutation(samples)
    return dict(zip(SPLITS, np.split(order, [train, train + validation]), strict=True))


def rows_of(samples, shares, seed):
    """Row numbers of train, validation and test of a table; samples with a `round` (`repose.studies.refine`) all train.

    The others are split as if they were alone, so every round has the same test samples as the design had.
    """
    added = samples["round"].notna().to_numpy() if "round" in samples else np.zeros(len(samples), bool)
    designed = np.flatnonzero(~added)
    rows = {name: designed[i] for name, i in split(len(designed), shares, seed).items()}
    rows["train"] = np.concatenate([rows["train"], np.flatnonzero(added)])
    return rows


def r2_noise_corrected(y, predicted, errors):
    """R2 against the responses' unknown noise-free means, from m noisy means y with standard errors.

    With y = mean + noise of variance se^2, independent of predictions made from other samples,
    E[SSE] = sum (mean - predicted)^2 + sum se^2 and E[SST] = sum (mean - its average)^2 + (1 - 1/m) sum se^2:
    taking the noise off both sums gives 1 - (SSE - sum se^2) / (SST - (1 - 1/m) sum se^2). An estimate, so it
    may exceed one by chance. None without standard errors, or where the noise explains all of SST.
    """
    noise = np.sum(errors**2)
    between = np.sum((y - np.mean(y)) ** 2) - (1 - 1 / len(y)) * noise
    if not between > 0:
        return None
    return float(1 - (np.sum((y - predicted) ** 2) - noise) / between)


def _noise_covariance(runs, samples):
    """Covariance (responses, responses) of single runs about their samples' means, None where it has no rank."""
    ok = runs[(runs["status"] == "ok") & runs["sample"].isin(samples)]
    covariance, freedom = within_covariance(ok[list(RESPONSES)], ok["sample"])
    enough = freedom > len(RESPONSES) and np.linalg.eigvalsh(covariance)[0] > 0
    return covariance if enough else None


def precisions(errors, one_a_sample):
    """Precisions (samples, responses) of the standard errors; those of a sample alike if one_a_sample."""
    precision = weights_from_errors(errors)
    return np.repeat(precision.mean(axis=1, keepdims=True), 2, axis=1) if one_a_sample else precision


def _three_ways(usable, runs, Y, P, errors, test):
    """R2 of the test samples: on means, on single runs, and corrected for the noise of the means."""
    position = {sample: i for i, sample in zip(test, usable["sample"].iloc[test], strict=True)}
    single = runs[(runs["status"] == "ok") & runs["sample"].isin(list(position))]
    row = [position[sample] for sample in single["sample"]]
    return {
        response: {
            "sample_means": r2(Y[test, k], P[test, k]),
            "single_runs": r2(single[response].to_numpy(float), P[row, k]),
            "noise_corrected": r2_noise_corrected(Y[test, k], P[test, k], errors[test, k]),
        }
        for k, response in enumerate(RESPONSES)
    }
