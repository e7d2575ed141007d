"""What the whole method buys over its plain counterpart: proposals from few simulations, judged by the truth.

For equal numbers of samples, each proposal is one set of parameters for the target:

  best_sample        the simulated sample whose means lie nearest to the target: no model at all
  linear             plane by least squares, inverted by a local search
  quadratic          all squares and products, ridge by leave-one-out, inverted by a local search
  network            the BP network as the study trains it, inverted by a local search
  network_miga       the same network, inverted by the island genetic algorithm
  network_all        the network trained on all of the samples, no validation or test part, local search

The local search is SLSQP on the squared deviations in widths of the target's box, from the centre of the ranges and
from random points; another start replaces the centre's only where it comes nearer by more than NEARER.

The truth is an emulator: a Gaussian process fitted to all samples that are given, its hyperparameters to at most 600 of
them. A proposal's error is that of the truth's responses there, free of noise. Data come in two kinds: `real`, random
subsets of the samples themselves (which the truth has seen too, so errors come out too small where the subset is most
of them), and `emulated`, new Latin hypercubes with the truth's responses and the scatter of real pours.
"""

import math
import tempfile
import warnings
from pathlib import Path

import numpy as np
from scipy import optimize, stats

from repose.chain import train
from repose.chain.train import r2_noise_corrected
from repose.core import variance
from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.search import miga
from repose.studies.comparison import scores
from repose.surrogate.bayesian_bp import RESPONSES, PlainBayesianBP, evaluate, load, r2, response_function
from repose.surrogate.support import quadratic_terms

METHODS = ("best_sample", "linear", "quadratic", "network", "network_miga", "network_all")
ERRORS = ("aor_se_deg", "height_se_mm")
MOST_FOR_SCALES = 600
FOLDS = 5
NEARER = 1e-4
RIDGES = np.geomspace(1e-4, 1e2, 13)


class Study:
    """Samples of one or several studies: unit (n, d) places in the ranges, means (n, 2), errors (n, 2), runs.

    datasets, runs: CSV files as `dataset` writes them, in pairs. runs is a list of (seeds, 2) arrays, one a
    sample. covariance (2, 2): of a single pour about its sample's mean. Raises InputError for bad files.
    """

    def __init__(self, datasets, runs, ranges):
        if len(datasets) != len(runs):
            raise InputError("command line", "runs", len(runs), f"as many files as datasets, {len(datasets)}")
        low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
        unit, means, singles, number = [], [], [], []
        for dataset_csv, runs_csv in zip(datasets, runs, strict=True):
            table = read_table(dataset_csv, ("sample", *PARAMETERS, "status", *RESPONSES))
            table = table[table["status"] == "ok"]
            single = read_table(runs_csv, ("sample", "status", *RESPONSES))
            groups = dict(list(single[single["status"] == "ok"].groupby("sample")))
            unit.append((table[list(PARAMETERS)].to_numpy(float) - low) / (high - low))
            means.append(table[list(RESPONSES)].to_numpy(float))
            for sample in table["sample"]:
                if sample not in groups:
                    raise InputError(
                        runs_csv, "sample", sample, f"runs of each usable sample of {dataset_csv}"
                    )
                singles.append(groups[sample][list(RESPONSES)].to_numpy(float))
                number += [len(singles) - 1] * len(singles[-1])
        self.ranges, self.low, self.high = ranges, low, high
        self.unit, self.means, self.runs = np.concatenate(unit), np.concatenate(means), singles
        values = np.concatenate(singles)
        try:
            parts = [
                variance.variance_components(values[:, k], np.array(number)) for k in range(len(RESPONSES))
            ]
            correlation = variance.residual_correlation(*values.T, np.array(number))[0]
        except ValueError as error:
            raise InputError(runs[0], "runs", str(error), "two or more of most samples") from None
        scatter = np.sqrt([part.within for part in parts])
        self.covariance = np.outer(scatter, scatter) * np.array([[1, correlation], [correlation, 1]])
        count = np.array([len(one) for one in singles])
        self.errors = scatter / np.sqrt(count)[:, None]
        self.seeds = round(float(count.mean()))

    def __len__(self):
        return len(self.unit)


class Truth:
    """Gaussian process of each response (Matern 5/2, a length for each parameter), on means with known errors.

    Called with places in the ranges (m, d), gives responses (m, 2). cross_validated: R2 of each, on the means and with
    their noise taken off, by five parts.
    """

    def __init__(self, study, seed):
        random = np.random.default_rng(seed)
        rows = random.permutation(len(study))
        self.models, self.cross_validated = [], {}
        for k, name in enumerate(RESPONSES):
            x, y, error = study.unit, study.means[:, k], study.errors[:, k]
            scaled = rows[:MOST_FOR_SCALES]
            kernel = _process(x[scaled], y[scaled], error[scaled], None).kernel_
            self.models.append(_process(x, y, error, kernel))
            predicted = np.empty(len(y))
            for fold in range(FOLDS):
                out = rows[fold::FOLDS]
                rest = np.setdiff1d(rows, out)
                predicted[out] = _process(x[rest], y[rest], error[rest], kernel).predict(x[out])
            self.cross_validated[name] = {
                "r2": r2(y, predicted),
                "r2_noise_corrected": r2_noise_corrected(y, predicted, error),
            }

    def __call__(self, unit):
        return np.column_stack([model.predict(np.atleast_2d(unit)) for model in self.models])


def _process(x, y, error, kernel):
    """A process on unit inputs; its kernel is fitted where none is given."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    width = y.std()
    first = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(np.ones(x.shape[1]), (0.1, 30.0), nu=2.5)
    model = GaussianProcessRegressor(
        kernel or first,
        alpha=(error / width) ** 2,
        normalize_y=True,
        optimizer="fmin_l_bfgs_b" if kernel is None else None,
    )
    with warnings.catch_warnings():
        # a length at its upper bound is a parameter without effect, which is no fault
        warnings.simplefilter("ignore", ConvergenceWarning)
        return model.fit(x, y)


# --- data for one proposal ------------------------------------------------------------------------


def real(study, count, random):
    """Places (count, d) and runs, a list of (seeds, 2), of a random subset of the samples."""
    rows = random.choice(len(study), count, replace=False)
    return study.unit[rows], [study.runs[row] for row in rows]


def emulated(study, truth, count, random):
    """The same of a new Latin hypercube, its pours scattering about the truth as real ones do."""
    unit = stats.qmc.LatinHypercube(len(PARAMETERS), rng=random).random(count)
    scatter = random.multivariate_normal(np.zeros(2), study.covariance, size=(count, study.seeds))
    return unit, list(truth(unit)[:, None, :] + scatter)


# --- models and their inversion -------------------------------------------------------------------


def surface(unit, means, terms):
    """A function of places (m, d), in the span of terms(unit), fitted by ridge regression with leave-one-out."""
    from sklearn.linear_model import RidgeCV

    models = [RidgeCV(RIDGES, fit_intercept=False).fit(terms(unit), y - y.mean()) for y in means.T]
    return lambda x: (
        np.column_stack([m.predict(terms(np.atleast_2d(x))) for m in models]) + means.mean(axis=0)
    )


def plane(unit, means):
    """A function of places (m, d), linear, fitted by least squares."""
    X = np.column_stack([np.ones(len(unit)), unit])
    found = np.linalg.lstsq(X, means, rcond=None)[0]
    return lambda x: np.column_stack([np.ones(len(np.atleast_2d(x))), np.atleast_2d(x)]) @ found


def local_search(respond, objective, starts, random):
    """Place (d,) by SLSQP on the squared deviations, and how often the model was evaluated.

    respond: places (m, d) to (m, 2); objective: `miga.Objective`; starts: the centre and random points.
    """
    evaluations = 0

    def deviation(x):
        nonlocal evaluations
        evaluations += 1
        off = (respond(np.clip(x, 0, 1)[None])[0] - objective.target) / objective.width
        return float(off @ off)

    best = None
    for start in [np.full(len(PARAMETERS), 0.5), *random.uniform(size=(starts - 1, len(PARAMETERS)))]:
        # tighter than its default, which ends far from where a squared deviation has no value left
        found = optimize.minimize(
            deviation, start, method="SLSQP", bounds=[(0, 1)] * len(PARAMETERS), options={"ftol": 1e-12}
        )
        if best is None or found.fun < best.fun - NEARER:
            best = found
    return np.clip(best.x, 0, 1), evaluations


def study_network(study, unit, runs, settings, folder):
    """The network as the study's stage trains it on these samples (`training.run`), read back."""
    import pandas as pd

    folder = Path(folder)
    table = pd.DataFrame(study.low + unit * (study.high - study.low), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(len(unit)))
    table["status"] = "ok"
    for k, (name, error) in enumerate(zip(RESPONSES, ERRORS, strict=True)):
        table[name] = [one[:, k].mean() for one in runs]
        table[error] = [
            one[:, k].std(ddof=1) / math.sqrt(len(one)) if len(one) > 1 else math.nan for one in runs
        ]
    single = pd.DataFrame(np.concatenate(runs), columns=list(RESPONSES))
    single.insert(0, "sample", np.repeat(np.arange(len(runs)), [len(one) for one in runs]))
    single["status"] = "ok"
    table.to_csv(folder / "dataset.csv", index=False)
    single.to_csv(folder / "runs.csv", index=False)
    train.run(folder / "dataset.csv", folder / "runs.csv", settings, folder)
    return load(folder / "network.json")


def proposals(study, unit, runs, objective, settings, random):
    """What each method proposes from one set of data: name to (place (d,), evaluations of the model)."""
    means = np.array([one.mean(axis=0) for one in runs])
    F, V = objective(means)
    found = {"best_sample": (unit[objective.fitness(F, V).argmin()], 0)}
    starts = settings["local_starts"]
    models = {"linear": plane(unit, means), "quadratic": surface(unit, means, quadratic_terms)}
    with tempfile.TemporaryDirectory() as folder:
        network = study_network(study, unit, runs, settings["network"], folder)
    models["network"] = lambda x: evaluate(network, study.low + x * (study.high - study.low))
    keys = ("hidden", "epochs", "goal", "starts", "seed", "prior")
    everything = PlainBayesianBP(
        **{key: settings["network"][key] for key in keys if key in settings["network"]}
    )
    covariance = study.covariance if settings["network"].get("correlated_noise", False) else None
    models["network_all"] = everything.fit(unit, means, noise_covariance=covariance).predict
    for name, model in models.items():
        found[name] = local_search(model, objective, starts, random)
    respond = response_function(network, study.low, study.high)
    section = settings["miga"] | {"seed": int(random.integers(2**31))}
    archive, history, _ = miga.search(respond, objective, section)
    found["network_miga"] = ((archive.points[0] + 1) / 2, history[-1][2])
    return found


# --- the study ------------------------------------------------------------------------------------


def run(datasets, runs, ranges, target, settings, out_dir):
    """Compare; write whole.csv and whole_proposals.csv; return the first.

    datasets, runs: lists of CSV files, in pairs. ranges: parameter to (low, high); target: that section of the
    configuration. settings: samples (a list of numbers), repetitions, local_starts, seed, and the sections network and
    miga to use. Numbers of samples beyond those that are there have emulated data alone. Raises InputError.
    """
    import pandas as pd

    study = Study(datasets, runs, ranges)
    truth = Truth(study, settings["seed"])
    box = np.array([target["aor_range_deg"], target["height_range_mm"]], dtype=float)
    objective = miga.Objective(box[:, 0], box[:, 1], (target["aor_deg"], target["height_mm"]))
    rows = []
    for count in settings["samples"]:
        for repetition in range(settings["repetitions"]):
            for kind in ("real", "emulated"):
                random = np.random.default_rng([settings["seed"], count, repetition, kind == "real"])
                if kind == "real" and count >= len(study):
                    continue
                data = real(study, count, random) if kind == "real" else emulated(study, truth, count, random)
                for name, (place, evaluations) in proposals(
                    study, *data, objective, settings, random
                ).items():
                    row = {"data": kind, "samples": count, "method": name, "repetition": repetition}
                    row |= {"simulations": sum(map(len, data[1])), "evaluations": evaluations}
                    row |= dict(zip(PARAMETERS, study.low + place * (study.high - study.low), strict=True))
                    rows.append(row | _judged(truth(place), objective))
    proposed = pd.DataFrame(rows)
    table = _table(pd, proposed, truth, len(study))
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    proposed.to_csv(out / "whole_proposals.csv", index=False)
    table.to_csv(out / "whole.csv", index=False)
    return table


def _judged(responses, objective):
    """A proposal's true responses (1, 2) beside the target, by name."""
    F, V = objective(responses)
    return {
        "aor_deg": responses[0, 0],
        "height_mm": responses[0, 1],
        "aor_off_deg": abs(responses[0, 0] - objective.target[0]),
        "height_off_mm": abs(responses[0, 1] - objective.target[1]),
        "objective": F[0],
        "inside": bool(V[0] == 0),
    }


def _table(pd, proposed, truth, samples):
    """Means with standard errors over the repetitions."""
    rows = []
    for (kind, count, method), group in proposed.groupby(["data", "samples", "method"], sort=False):
        row = {"data": kind, "samples": count, "method": method, "repetitions": len(group)}
        row |= {key: group[key].mean() for key in ("simulations", "evaluations")}
        for key in ("aor_off_deg", "height_off_mm", "objective", "inside"):
            row[key], row[f"{key}_se"] = scores.mean_and_error(group[key])
        rows.append(row)
    table = pd.DataFrame(rows)
    for name, values in truth.cross_validated.items():
        table[f"truth_{name}_r2"] = values["r2_noise_corrected"]
    return table.assign(truth_samples=samples)


def message(table):
    """The largest number of samples in words, one line a method."""
    lines = []
    for kind, group in table.groupby("data", sort=False):
        last = group[group["samples"] == group["samples"].max()]
        for row in last.itertuples():
            lines.append(
                f"{kind}, {row.samples} samples, {row.method}: {row.aor_off_deg:.2f} ± {row.aor_off_deg_se:.2f} deg, "
                f"{row.height_off_mm:.2f} ± {row.height_off_mm_se:.2f} mm off"
            )
    return "\n".join(lines)
