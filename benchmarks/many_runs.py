"""Many runs that exist already: how long an answer takes, and whether it is as good as that of the exact model.

    python benchmarks/many_runs.py time --runs 300 1200
    python benchmarks/many_runs.py compare --runs 400 --seeds 6

The runs are those of two formulas of four parameters, one run of each parameter set. `time` prints CPU seconds of one core.
`compare` fits both models of the same runs: the exact one, which draws variance and lengths of its processes, and the sparse one. It
prints, in standard deviations of a run, the error of the predicted means, their bias and their stated error; the share of points
whose true mean lies within 1.96 stated errors; the share of the 95 % intervals of the parameters that hold the true value, over
made-up measurements, and their width in ranges; and how far the true response of the answer is from the target, in tolerances of 1 %.
`--limit` makes the sparse model begin at fewer samples.
"""

import argparse
import time

import numpy as np
import pandas as pd
from scipy.stats import qmc

import repose
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.strategies.sequential import kriging

POINTS = 2048
MEASUREMENTS = 100  # made up for each set of runs
ANSWERS = 40  # of these measurements
RUN_SD = np.array([0.3, 0.5])
MEASURED_SD = np.array([0.5, 0.8])
REPETITIONS = 10
EXACT = 10**9


def plain(unit):
    """Means (n, 2): nearly straight, and one parameter that matters little."""
    a, b, c, d = unit.T
    return np.column_stack([20 + 10 * a + 5 * b + np.sin(3 * c), 50 + 8 * a - 3 * d])


def curved(unit):
    """Means (n, 2): saturation, products, a wave and a step."""
    a, b, c, d = unit.T
    angle = 18 + 22 * (1 - np.exp(-3 * a)) * (0.6 + 0.8 * b) - 4 * a * c
    height = 40 + 12 * np.sqrt(0.05 + b) - 10 * a * b
    return np.column_stack(
        [
            angle + 1.5 * np.sin(2 * np.pi * d),
            height + 6 / (1 + np.exp(-10 * (c - 0.5))),
        ]
    )


FORMULAS = {"plain": plain, "curved": curved}


def simulated(formula, n, random):
    """Parameter sets (n, 4) and their runs (n, 2)."""
    unit = random.random((n, 4))
    return unit, formula(unit) + RUN_SD * random.standard_normal((n, 2))


def print_times(n):
    """Print CPU seconds of `tell` and `answer`."""
    unit, runs = simulated(plain, n, np.random.default_rng(0))
    table = pd.DataFrame(unit, columns=["a", "b", "c", "d"])
    table[["angle", "height"]] = runs
    targets = {"angle": (27.0, 0.5, 10), "height": (53.0, 0.8, 10)}
    study = repose.Study(dict.fromkeys("abcd", (0, 1)), targets, seeds=1, seed=1)
    start = time.process_time()
    study.tell(table)
    told = time.process_time()
    study.answer()
    end = time.process_time()
    print(f"{n} runs: tell {told - start:.0f} s, answer {end - told:.0f} s", flush=True)


def weighted_interval(values, weights):
    """The central 95 % interval of weighted values."""
    order = np.argsort(values)
    share = np.cumsum(weights[order]) - 0.5 * weights[order]
    return np.interp([0.025, 0.975], share, values[order])


def judge(model, formula, points, random):
    """The numbers that `compare` prints, by name."""
    mean, covariance = model.predict(points)
    truth = formula(points)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    errors = mean - truth
    # Posterior of the parameters for made-up measurements, by weights of the points.
    measured_se = MEASURED_SD / np.sqrt(REPETITIONS)
    hidden = random.random((MEASUREMENTS, 4))
    measured = formula(hidden) + measured_se * random.standard_normal((MEASUREMENTS, 2))
    total = covariance + np.diag(measured_se**2)
    inverse = np.linalg.inv(total)
    log_det = np.linalg.slogdet(total)[1]
    held = []
    widths = []
    off = []
    for k, target in enumerate(measured):
        deviation = target - mean
        distance = np.einsum("mi,mij,mj->m", deviation, inverse, deviation)
        log_density = -0.5 * (distance + log_det)
        weights = np.exp(log_density - log_density.max())
        weights /= weights.sum()
        for j, value in enumerate(hidden[k]):
            low, high = weighted_interval(points[:, j], weights)
            held.append(low <= value <= high)
            widths.append(high - low)
        if k < ANSWERS:
            half = 0.01 * np.abs(target)
            chance = compute_box_probability(
                mean, covariance, target - half, target + half
            )
            off.append((truth[chance.argmax()] - target) / half)
    return {
        "error": np.sqrt((errors**2 / RUN_SD**2).mean()),
        "bias": np.abs((errors / RUN_SD).mean(axis=0)).max(),
        "stated": np.sqrt((sd**2 / RUN_SD**2).mean()),
        "within": (np.abs(errors) <= 1.96 * sd).mean(),
        "held": np.mean(held),
        "width": np.mean(widths),
        "off": np.sqrt(np.mean(np.square(off))),
    }


def fit_and_judge(formula, seed, n, limit, points):
    """Fit a model that is exact up to `limit` samples to n runs, and judge it."""
    unit, runs = simulated(formula, n, np.random.default_rng([seed, 7]))
    observed = kriging.ObservedSamples(unit, runs[:, None])
    kriging.MAX_EXACT_SAMPLES = limit
    start = time.process_time()
    model = kriging.Kriging(observed, np.diag(RUN_SD**2))
    seconds = time.process_time() - start
    row = judge(model, formula, points, np.random.default_rng([seed, 8]))
    return row | {"seconds": seconds}


def compare(n, args):
    """Print the numbers of both models for each seed, and means with standard errors."""
    points = qmc.Sobol(4, rng=1).random(POINTS)
    models = {"sparse": args.limit, "exact": EXACT}
    if args.sparse_only:
        del models["exact"]
    rows = []
    for seed in range(args.seeds):
        for name, formula in FORMULAS.items():
            for model, limit in models.items():
                row = fit_and_judge(formula, seed, n, limit, points)
                text = ", ".join(f"{key} {value:.4g}" for key, value in row.items())
                print(f"{name} seed {seed} {model}: {text}", flush=True)
                rows.append({"formula": name, "model": model} | row)
    groups = pd.DataFrame(rows).groupby(["formula", "model"])
    print(f"{n} runs, means:\n{groups.mean().round(4).to_string()}")
    print(f"standard errors:\n{groups.sem().round(4).to_string()}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("part", choices=["time", "compare"])
    parser.add_argument("--runs", type=int, nargs="+", default=[1200])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--limit", type=int, default=kriging.MAX_EXACT_SAMPLES)
    parser.add_argument("--sparse-only", action="store_true")
    args = parser.parse_args()
    for n in args.runs:
        if args.part == "time":
            print_times(n)
        else:
            compare(n, args)


if __name__ == "__main__":
    main()
