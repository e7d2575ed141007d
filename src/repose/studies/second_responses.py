"""What to measure next: how far a further response of the same pile narrows the posterior of the six parameters.

Two numbers do not determine six parameters. For each further response r of `further_responses`, and for AoR and Height
with it:

  signal to noise   sd between samples over the sd of a pour about its sample's mean (`repose.studies.noise`)
  surrogate         a network of its own, trained on the means of all samples; its R2 by cross-validation, on the means
                    and with their noise taken off
  information       of a set of responses, over the prior: KL of the posterior from the prior, in bits, and of each
                    parameter the bits and the width of its 95 % interval over the prior's

Nobody has measured these responses, so observations are made up: a plausible truth theta* is a point whose predicted
AoR and Height lie in the target's box, and

    y = f(theta*) + e,  e ~ N(0, S_y + S_s + S_d)

    S_y  mean of `physical_piles` piles, each scattering as pours of one sample do, with the correlations they have
    S_s  the surrogates' own error: covariance of the cross-validated residuals, less what the noise of the means adds
    S_d  what the model cannot do with any parameters: a share of each response's mean, independent; once none, once
         `discrepancy_percent`

The posterior is that of importance sampling: a Sobol sequence over the prior, weighted by the likelihood, the same for
all sets, truths and draws of e, so that sets differ by what is in them alone. It is deterministic.
"""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import stats

from repose.chain.train import r2_noise_corrected
from repose.core import variance
from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.measure import further_responses
from repose.surrogate.bayesian_bp import RESPONSES, PlainBayesianBP, r2, weights_from_errors

BASE = RESPONSES
CREDIBLE = 0.95
BINS = 40
FEWEST_SAMPLES = 12
NOISY = 0.5  # a response with less signal than this share of its noise is not modelled
WORST_R2 = 0.2  # nor is one whose surrogate explains less, as after few runs of the drum
FEWEST_EFFECTIVE = 30
EPOCHS = 300  # of the surrogates, most


class Known(NamedTuple):
    """One response over the design: mean and standard error of each sample (samples,), NaN where it has none, the
    variance within samples, and numbers for the table."""

    mean: np.ndarray
    error: np.ndarray
    row: dict


# --- the data -------------------------------------------------------------------------------------


def over_design(values, groups, samples):
    """Means and errors of a response over the samples, and its signal to noise.

    values (n,), groups (n,): of single runs; NaN values are left out. samples (m,): order of the result. Errors come
    from the pooled variance within samples, which few runs of one sample do not tell.
    """
    good = np.isfinite(values)
    values, groups = values[good], groups[good]
    found = variance.variance_components(values, groups)
    mean, error, count = _means(values, groups, samples, found.within)
    signal = math.sqrt(found.between / found.within) if found.within > 0 else math.inf
    row = {
        "mean": found.mean,
        "sd_within": math.sqrt(found.within),
        "sd_between": math.sqrt(found.between),
        "signal_to_noise": signal,
        "icc": found.icc,
        "samples": int((count > 0).sum()),
        "runs": found.values,
    }
    return Known(mean, error, row)


def _means(values, groups, samples, within):
    """Means of single runs (n,) over their samples, their errors by the variance within, and how many runs; (m,) each.

    Mean and error are NaN without a run.
    """
    count = np.array([np.count_nonzero(groups == sample) for sample in samples])
    total = np.array([values[groups == sample].sum() for sample in samples])
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean, np.where(count > 0, np.sqrt(within / np.maximum(count, 1)), np.nan), count


def read_drum(samples_json, runs_csv, samples):
    """The drum's responses over the design, by name: `Known` of means over its runs, from files of `drum_design`.

    runs_csv: of `drum_tables`, the representative solution with several seeds, for the scatter from run to run. Raises
    InputError for another sample, and with fewer than two good runs there.
    """
    columns = {"drum_slip_deg": "before_surface_deg", "drum_rest_deg": "after_surface_deg"}
    repeated = read_table(runs_csv, ("status", *columns.values()))
    repeated = repeated[repeated["status"] == "ok"]
    if len(repeated) < 2:
        raise InputError(runs_csv, "good runs", len(repeated), "2 or more, for the scatter from run to run")
    runs = {}
    for path in samples_json:
        try:
            job = json.loads(Path(path).read_text())
            runs[job["sample"]] = [run for run in job["runs"] if run["status"] == "ok"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(path, "drum", str(error), "a file of the verb drum_design") from error
        if job["sample"] not in samples:
            raise InputError(path, "sample", job["sample"], "a sample of the design")
    found = {}
    for name, column in columns.items():
        within = float(repeated[column].var(ddof=1))
        values = np.array([run[column] for good in runs.values() for run in good])
        groups = np.array([sample for sample, good in runs.items() for _ in good])
        mean, error, count = _means(values, groups, samples, within)
        spread = max(0.0, float(np.nanvar(mean, ddof=1)) - float(np.nanmean(error**2)))
        row = {
            "mean": float(np.nanmean(mean)),
            "sd_within": math.sqrt(within),
            "sd_between": math.sqrt(spread),
            "signal_to_noise": math.sqrt(spread / within),
            "icc": spread / (spread + within),
            "samples": int((count > 0).sum()),
            "runs": int(count.sum()),
        }
        found[name] = Known(mean, error, row)
    return found


def noise_correlation(runs, names):
    """Correlation (k, k) of responses from pour to pour within samples; 0 of what is not in the runs (the drum)."""
    there = [name for name in names if name in runs]
    table = runs[["sample", *there]].dropna()
    off = table[there] - table.groupby("sample")[there].transform("mean")
    found = np.eye(len(names))
    rows = [names.index(name) for name in there]
    found[np.ix_(rows, rows)] = np.corrcoef(off.to_numpy().T)
    return found


# --- surrogates -----------------------------------------------------------------------------------


def trained(X, known, settings):
    """A network of one response on all samples that have it."""
    there = np.isfinite(known.mean)
    model = PlainBayesianBP(
        hidden=settings["hidden"],
        epochs=min(EPOCHS, settings["epochs"]),
        goal=0.0,
        starts=settings["starts"],
        seed=settings["seed"],
        prior="inputs",
    )
    weight = None
    if np.ptp(known.error[there]) > 0:
        weight = weights_from_errors(known.error[there][:, None])[:, 0]
    return model.fit(X[there], known.mean[there], precision=weight)


def left_out(X, known, settings):
    """Predictions (samples,) of each sample by networks that were trained without it, NaN where it has none."""
    there = np.flatnonzero(np.isfinite(known.mean))
    fold = np.random.RandomState(settings["seed"]).permutation(len(there)) % settings["folds"]
    predicted = np.full(len(known.mean), np.nan)
    for k in range(settings["folds"]):
        mean = np.full(len(known.mean), np.nan)
        mean[there[fold != k]] = known.mean[there[fold != k]]
        model = trained(X, known._replace(mean=mean), settings)
        predicted[there[fold == k]] = model.predict(X[there[fold == k]])
    return predicted


def surrogate_covariance(residuals, errors, correlation):
    """S_s (k, k) of cross-validated residuals (samples, k), less the noise of the means, made positive.

    errors (samples, k): standard errors of the means; correlation (k, k): of their noise. Two responses are compared
    over the samples that have both.
    """
    k = residuals.shape[1]
    found = np.zeros((k, k))
    for i in range(k):
        for j in range(k):
            both = np.isfinite(residuals[:, i] * residuals[:, j])
            noise_part = correlation[i, j] * errors[both, i] * errors[both, j]
            found[i, j] = np.mean(residuals[both, i] * residuals[both, j] - noise_part)
    scale = np.sqrt(np.nanmean(residuals**2, axis=0))
    values, vectors = np.linalg.eigh(found / np.outer(scale, scale))
    # pairwise estimates need not fit together; an error of 1 % of a residual is as good as none
    values = np.maximum(values, 1e-4)
    return (vectors * values) @ vectors.T * np.outer(scale, scale)


# --- information ----------------------------------------------------------------------------------


class Prior:
    """Points of the prior with what the surrogates predict there.

    unit (n, d): places in the ranges; predicted (n, k).
    """

    def __init__(self, unit, predicted):
        self.unit, self.predicted = unit, predicted
        self.bin = np.minimum((unit * BINS).astype(int), BINS - 1)
        self.order = np.argsort(unit, axis=0)

    def weights(self, observed, columns, covariance):
        """Posterior probability (n,) of each point."""
        root = np.linalg.cholesky(covariance[np.ix_(columns, columns)])
        off = np.linalg.solve(root, (observed[columns] - self.predicted[:, columns]).T)
        log_weight = -0.5 * (off**2).sum(axis=0)
        weight = np.exp(log_weight - log_weight.max())
        return weight / weight.sum()

    def posterior(self, observed, columns, covariance):
        """What observing some responses tells: joint bits, bits (d,) and widths over the prior's (d,) of the
        parameters, effective points.

        observed (k,), covariance (k, k): of all responses; columns: those observed. Bits of a parameter as
        `posterior.information_bits` has them, for weighted points.
        """
        weight = self.weights(observed, columns, covariance)
        effective = 1 / (weight**2).sum()
        bits, widths = [], []
        for k in range(self.unit.shape[1]):
            share = np.bincount(self.bin[:, k], weight, BINS)
            filled = share[share > 1e-12]
            excess = (len(filled) - 1) / (2 * effective * math.log(2))
            bits.append(max(0.0, float(filled @ np.log2(filled * BINS)) - excess))
            order = self.order[:, k]
            tail = (1 - CREDIBLE) / 2
            ends = np.searchsorted(np.cumsum(weight[order]), [tail, 1 - tail])
            low, high = self.unit[order[np.minimum(ends, len(order) - 1)], k]
            widths.append((high - low) / CREDIBLE)
        return joint_bits(weight), np.array(bits), np.array(widths), effective


def joint_bits(weight):
    """KL of weighted points (n,) from equal weights, in bits."""
    positive = weight[weight > 0]
    return float(positive @ np.log2(positive * len(weight)))


def averaged(prior, truths, errors, columns, covariance):
    """Means over the truths, and their standard errors, of what a set of responses tells.

    truths: row numbers of the prior's points; errors (truths, k): unit normal numbers. Returns a dict: bits, bits_se,
    parameter_bits (d,), widths (d,), widths_se (d,), effective (the least), and all (truths,) joint bits.
    """
    root = np.linalg.cholesky(covariance)
    found = [
        prior.posterior(prior.predicted[row] + root @ error, columns, covariance)
        for row, error in zip(truths, errors, strict=True)
    ]
    joint, bits, widths, effective = (np.array([one[i] for one in found]) for i in range(4))
    count = math.sqrt(len(truths))
    return {
        "bits": joint.mean(),
        "bits_se": joint.std(ddof=1) / count,
        "parameter_bits": bits.mean(axis=0),
        "widths": widths.mean(axis=0),
        "widths_se": widths.std(axis=0, ddof=1) / count,
        "effective": effective.min(),
        "all": joint,
    }


def sets_of(names):
    """Sets of responses to compare, by label: none but the base, the base with each, all that the pile gives, all."""
    extra = [name for name in names if name not in BASE]
    heap = [name for name in extra if name not in further_responses.DRUM]
    drum = [name for name in extra if name in further_responses.DRUM]
    found = {"AoR alone": (BASE[0],), "AoR and Height": BASE}
    found |= {name: (*BASE, name) for name in extra}
    found["whole pile"] = (*BASE, *heap)
    if drum:
        found["pile and drum"] = (*BASE, *extra)
    return found


def in_order(prior, truths, errors, names, covariance):
    """Greedy order of the further responses: rows (response, bits, gain), each the one that adds most."""
    root, rows = np.linalg.cholesky(covariance), []
    observed = prior.predicted[truths] + errors @ root.T

    def bits(columns):
        return np.mean([joint_bits(prior.weights(y, columns, covariance)) for y in observed])

    columns = [names.index(name) for name in BASE]
    before = bits(columns)
    left = [name for name in names if name not in BASE]
    while left:
        tried = {name: bits([*columns, names.index(name)]) for name in left}
        best = max(left, key=tried.get)
        rows.append(
            {"place": len(rows) + 1, "response": best, "bits": tried[best], "gain_bits": tried[best] - before}
        )
        before = tried[best]
        columns.append(names.index(best))
        left.remove(best)
    return rows


# --- the study ------------------------------------------------------------------------------------


def run(files, ranges, target, settings, out_dir):
    """Write responses.csv, information.csv, narrowing.csv, order.csv and responses.json; return the summary.

    files: runs (of `responses.run`), dataset, and, for the drum, drum (a list of files of `drum_design`) and drum_runs.
    ranges: parameter to (low, high). target: that section of the configuration. settings: points, truths, folds, seed,
    discrepancy_percent, and hidden, epochs and starts of the surrogates. Raises InputError for a bad file, fewer than
    12 usable samples, or a target that no point of the prior meets.
    """
    import pandas as pd

    X, samples, known, runs = _data(files, ranges)
    names = [name for name in known if name in BASE or known[name].row["signal_to_noise"] >= NOISY]
    predicted = {name: left_out(X, known[name], settings) for name in names}
    names = [name for name in names if name in BASE or _r2(known[name], predicted[name]) >= WORST_R2]
    correlation = noise_correlation(runs, names)
    rows = [_row(name, one, predicted.get(name), name in names) for name, one in known.items()]
    residuals = np.column_stack([predicted[name] - known[name].mean for name in names])
    errors = np.column_stack([known[name].error for name in names])
    surrogate = surrogate_covariance(residuals, errors, correlation)
    within = np.array([known[name].row["sd_within"] for name in names])
    measured = np.outer(within, within) * correlation / target["physical_piles"]

    unit = stats.qmc.Sobol(len(PARAMETERS), rng=settings["seed"]).random(settings["points"])
    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
    points = low + unit * (high - low)
    prior = Prior(
        unit, np.column_stack([trained(X, known[name], settings).predict(points) for name in names])
    )
    truths, normal = _truths(prior.predicted, names, target, settings, files["runs"])
    tables = {"information": [], "narrowing": []}
    order, least = [], math.inf
    for percent in dict.fromkeys((0.0, float(settings["discrepancy_percent"]))):
        means = np.array([known[name].row["mean"] for name in names])
        covariance = measured + surrogate + np.diag((percent / 100 * means) ** 2)
        base = None
        for label, chosen in sets_of(names).items():
            found = averaged(prior, truths, normal, [names.index(name) for name in chosen], covariance)
            base = found if label == "AoR and Height" else base
            least = min(least, found["effective"])
            tables["information"].append(_information(percent, label, found, base))
            tables["narrowing"] += _narrowing(percent, label, found, base)
        order += [
            {"discrepancy_percent": percent, **row}
            for row in in_order(prior, truths, normal, names, covariance)
        ]
    summary = {
        "samples": len(samples),
        "physical_piles": target["physical_piles"],
        "truths": len(truths),
        "least_effective_points": least,
        "left_out": [name for name in known if name not in names],
        "modelled": names,
        "noise_correlation": correlation.round(3).tolist(),
    }
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(out / "responses.csv", index=False)
    for name, content in tables.items():
        pd.DataFrame(content).to_csv(out / f"{name}.csv", index=False)
    pd.DataFrame(order).to_csv(out / "order.csv", index=False)
    (out / "responses.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary | {"information": tables["information"]}


def _data(files, ranges):
    """Parameters (samples, d) in the ranges' units, sample numbers, `Known` of each response by name, single runs."""
    table = read_table(files["dataset"], ("sample", *PARAMETERS, "status"))
    table = table[table["status"] == "ok"]
    if len(table) < FEWEST_SAMPLES:
        raise InputError(
            files["dataset"], "usable samples", len(table), f"at least {FEWEST_SAMPLES} with status ok"
        )
    runs = read_table(files["runs"], ("sample", "seed", "status", *BASE, *further_responses.HEAP))
    runs = runs[(runs["status"] == "ok") & runs["sample"].isin(table["sample"])]
    samples, groups = table["sample"].to_numpy(), runs["sample"].to_numpy()
    try:
        known = {
            name: over_design(runs[name].to_numpy(float), groups, samples)
            for name in (*BASE, *further_responses.HEAP)
        }
    except ValueError as error:
        raise InputError(files["runs"], "runs", str(error), "two or more of most samples") from None
    if files.get("drum"):
        known |= read_drum(files["drum"], files["drum_runs"], samples)
    return table[list(PARAMETERS)].to_numpy(float), samples, known, runs


def _truths(predicted, names, target, settings, source):
    """Row numbers of plausible truths, spread over the feasible points of the prior, and unit normal numbers."""
    inside = np.ones(len(predicted), bool)
    for name, box in zip(BASE, ("aor_range_deg", "height_range_mm"), strict=True):
        low, high = target[box]
        value = predicted[:, names.index(name)]
        inside &= (value >= low) & (value <= high)
    rows = np.flatnonzero(inside)
    if len(rows) < settings["truths"]:
        allowed = f"at least {settings['truths']} points of the prior inside the target's box"
        raise InputError(source, "feasible points", len(rows), allowed)
    random = np.random.default_rng(settings["seed"])
    chosen = random.choice(rows, settings["truths"], replace=False)
    return chosen, random.normal(size=(len(chosen), predicted.shape[1]))


def _r2(known, predicted):
    """Cross-validated R2."""
    there = np.isfinite(predicted)
    return r2(known.mean[there], predicted[there])


def _row(name, known, predicted, modelled):
    """The row of responses.csv of one response."""
    row = {"response": name, "source": "drum" if name in further_responses.DRUM else "pile", **known.row}
    row |= {"modelled": modelled, "r2": None, "r2_noise_corrected": None, "rmse": None}
    if predicted is not None:
        there = np.isfinite(predicted)
        y, p, error = known.mean[there], predicted[there], known.error[there]
        row |= {"r2": _r2(known, predicted), "r2_noise_corrected": r2_noise_corrected(y, p, error)}
        row["rmse"] = float(np.sqrt(np.mean((y - p) ** 2)))
    return row


def _information(percent, label, found, base):
    """The row of information.csv of one set."""
    row = {"discrepancy_percent": percent, "set": label, "bits": found["bits"], "bits_se": found["bits_se"]}
    if base is not None:
        gain = found["all"] - base["all"]
        row |= {"gain_bits": gain.mean(), "gain_se_bits": gain.std(ddof=1) / math.sqrt(len(gain))}
        row["mean_width"] = float(found["widths"].mean())
    return row | {"least_effective_points": found["effective"]}


def _narrowing(percent, label, found, base):
    """The rows of narrowing.csv of one set, one a parameter."""
    rows = []
    for k, name in enumerate(PARAMETERS):
        row = {"discrepancy_percent": percent, "set": label, "parameter": name}
        row |= {"bits": found["parameter_bits"][k], "width_ratio": found["widths"][k]}
        row["width_ratio_se"] = found["widths_se"][k]
        row["over_base"] = found["widths"][k] / base["widths"][k] if base is not None else None
        rows.append(row)
    return rows


def message(summary):
    """What to measure next, in words."""
    rows = [row for row in summary["information"] if row["set"] not in ("AoR alone", "AoR and Height")]
    first = rows[0]["discrepancy_percent"]
    single = [
        row for row in rows if row["discrepancy_percent"] == first and row["set"] in further_responses.LABELS
    ]
    lines = [
        f"{further_responses.LABELS[row['set']]}: {row['gain_bits']:.2f} ± {row['gain_se_bits']:.2f} bits more"
        for row in sorted(single, key=lambda row: -row["gain_bits"])
    ]
    if summary["left_out"]:
        names = ", ".join(further_responses.LABELS[name] for name in summary["left_out"])
        lines.append(f"left out, too little signal or too few runs for a surrogate: {names}")
    if summary["least_effective_points"] < FEWEST_EFFECTIVE:
        lines.append(
            f"FEW POINTS: a posterior rests on {summary['least_effective_points']:.0f} of the prior's points; raise "
            "second_responses.points"
        )
    return "\n".join(lines)
