"""Whether the posterior holds the true parameters of another engine's piles.

    python -m research.answers.known_truth piles
    python -m research.answers.known_truth simulated
    python -m research.answers.known_truth three_tests

The data are the tables of examples/lifted_piles, of both engines. A row of theirs counts as a measured pile with
unknown parameters; what we simulated at the other rows is the surrogate's data. docs/known_truth.md has the rule.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import optimize, stats

from repose.calibrate.surrogates import Surrogate
from repose.calibrate.surrogates.gaussian_process import GaussianProcess
from repose.calibrate.uncertainty.implausibility import joint_bits
from repose.common.files import read_table, write_table
from research.script import Script, option

DATA = Path("results/published/lifted_piles")
NAMES = ["fric", "rollfric", "rest"]  # static and rolling friction, restitution
LOW, HIGH = np.array([0.2, 0.0, 0.3]), np.array([0.6, 0.25, 0.7])
CELLS = (40, 80, 20)  # of the grid
POWERS = np.array([1.0, 0.5, 1.0])  # of the parameters, as inputs of the surrogate
SEEDS_THERE = 2
REGIONS = (0.5, 0.9)
SIMULATED_DISCREPANCY_DEG, SIMULATED_NOISE_DEG = 0.5, (0.94, 0.75)
LARGEST_FACTOR = 100.0
STREAM = 112  # of random numbers, of this study alone
# For each test: our number and theirs in the tables of comparison.
COLUMNS = {
    "row": ("angle_deg", "aor"),
    "drum": ("angle_deg", "drum_aor"),
    "discharge": ("rate_g_s", "flow_gs"),
}

script = Script("answers.known_truth", __doc__)


# --- the data ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Results:
    """Results of one test at n places, here and there.

    Attributes
    ----------
    places : array (n, 3)
        Parameters.
    here, there : array (n,)
        Means over the seeds; NaN where there is none.
    here_sd, there_sd : array (n,)
        Standard deviations of one seed; NaN where there is one seed or none.
    seeds : array (n,)
        Number of seeds here. There it is 2.
    """

    places: np.ndarray
    here: np.ndarray
    there: np.ndarray
    here_sd: np.ndarray
    there_sd: np.ndarray
    seeds: np.ndarray

    def where(self, kept: np.ndarray) -> "Results":
        """Keep some places, by a mask or by numbers."""
        columns = dataclasses.asdict(self).items()
        return Results(**{name: values[kept] for name, values in columns})


def results_of(table: pd.DataFrame, here: str, there: str) -> Results:
    """Take the results from a table of comparison."""
    return Results(
        places=table[NAMES].to_numpy(),
        here=table[here].to_numpy(),
        there=table[there].to_numpy(),
        here_sd=table["seeds_sd"].to_numpy(),
        there_sd=table["seeds_sd_theirs"].to_numpy(),
        seeds=table["seeds"].to_numpy(float),
    )


def read(test: str) -> Results:
    """Read the results of a test; drums and discharges with those of the further places."""
    here, there = COLUMNS[test]
    needed = [*NAMES, here, there, "seeds", "seeds_sd", "seeds_sd_theirs"]
    table = read_table(DATA / f"compared_{test}.csv", needed)
    if test != "row":
        more = read_table(DATA / f"more_{test}.csv", [*NAMES, here])
        table = pd.concat([table[needed], more[[*NAMES, here]].assign(seeds=1)])
    return results_of(table, here, there)


# --- surrogate and errors ---------------------------------------------------------------


def inputs(places: np.ndarray) -> np.ndarray:
    """Transform parameters to the inputs of the surrogate."""
    return places**POWERS


def left_out(model: GaussianProcess) -> tuple[np.ndarray, np.ndarray]:
    """Predict each sample from the others: means (n,) and variances (n,) of these."""
    means, variances = model.processes_[0].left_out()
    covariance = model._covariance(variances[:, np.newaxis])
    return model.unmixed(means[:, np.newaxis])[:, 0], covariance[:, 0, 0]


def root_mean_square(values: np.ndarray) -> float:
    """Compute the root of the mean square of the values that are there."""
    return float(np.sqrt(np.nanmean(values**2)))


def factor_of_errors(
    errors: np.ndarray, variances: np.ndarray, noise: np.ndarray
) -> float:
    """Find by what factor, at least 1, the surrogate's standard errors are too small."""

    def excess(factor: float) -> float:
        return float(np.mean(errors**2 / (factor**2 * variances + noise)) - 1.0)

    if excess(1.0) <= 0.0:
        return 1.0
    return float(optimize.brentq(excess, 1.0, LARGEST_FACTOR))


class Model(NamedTuple):
    """What predicts the mean of their seeds at any parameters, with its errors.

    `factor` multiplies the standard error of the surrogate. The others are standard deviations: of one seed here, of
    one seed there, and the discrepancy of the engines.
    """

    surrogate: Surrogate
    factor: float
    noise_here: float
    noise_there: float
    discrepancy: float

    @classmethod
    def of(cls, results: Results) -> "Model":
        """Fit the surrogate to our results, and estimate its errors and the discrepancy."""
        surrogate = GaussianProcess().fit(
            inputs(results.places),
            results.here[:, np.newaxis],
            precision=results.seeds,
        )
        noise_here = root_mean_square(results.here_sd)
        noise_there = root_mean_square(results.there_sd)
        means, variances = left_out(surrogate)
        noise = noise_here**2 / results.seeds
        factor = factor_of_errors(results.here - means, variances, noise)

        # Equal engines would differ by the noise of both means.
        differences = results.there - results.here
        pairs = np.isfinite(differences)
        equal = np.mean(noise[pairs]) + noise_there**2 / SEEDS_THERE
        excess = np.mean(differences[pairs] ** 2) - equal
        discrepancy = float(np.sqrt(max(0.0, excess)))
        return cls(surrogate, factor, noise_here, noise_there, discrepancy)

    def log_likelihood(self, places: np.ndarray, there: float) -> np.ndarray:
        """Compute the log likelihood (n,) of places for a mean of their seeds."""
        mean, error = self.surrogate.predict(
            inputs(places), return_std=True, noise=False
        )
        variance = (self.factor * error[:, 0]) ** 2
        variance += self.noise_there**2 / SEEDS_THERE + self.discrepancy**2
        return stats.norm.logpdf(there, mean[:, 0], np.sqrt(variance))


# --- the posterior ----------------------------------------------------------------------


def grid(cells: tuple[int, ...] = CELLS) -> np.ndarray:
    """List the middles (n, 3) of the cells of the box."""
    axes = [(np.arange(count) + 0.5) / count for count in cells]
    unit = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return LOW + unit.reshape(-1, len(cells)) * (HIGH - LOW)


def judged(
    log_likelihood: np.ndarray,
    at_truth: float,
    truth: np.ndarray,
    cells: tuple[int, ...] = CELLS,
) -> dict[str, float]:
    """Judge the posterior on the grid by the true parameters.

    Parameters
    ----------
    log_likelihood : array (n,)
        At the points of `grid`.
    at_truth : float
        At the true parameters.
    truth : array (3,)
    cells : tuple of int, optional
        Of the grid.

    Returns
    -------
    dict
        The level of the truth; bits of the posterior, of each marginal, and at the truth; the distance from the truth
        in ranges.
    """
    weight = np.exp(log_likelihood - log_likelihood.max())
    mean_weight = weight.mean()
    at_truth_weight = np.exp(at_truth - log_likelihood.max())
    weight /= weight.sum()
    found = {
        "level": float(weight[log_likelihood > at_truth].sum()),
        "bits": joint_bits(weight),
        "bits_at_truth": float(np.log2(at_truth_weight / mean_weight)),
        "distance": distance(weight, truth, cells),
    }
    shaped = weight.reshape(cells)
    for axis, name in enumerate(NAMES):
        others = tuple(k for k in range(len(cells)) if k != axis)
        found[f"bits_{name}"] = joint_bits(shaped.sum(axis=others))
    return found


def distance(
    weight: np.ndarray, truth: np.ndarray, cells: tuple[int, ...] = CELLS
) -> float:
    """Compute the root of the mean squared distance from the truth, in ranges."""
    steps = (grid(cells) - truth) / (HIGH - LOW)
    return float(np.sqrt(weight @ (steps**2).sum(axis=1)))


def judge_piles(results: Results) -> pd.DataFrame:
    """Judge the posterior of each pile, which is left out of all that predicts it."""
    points = grid()
    rows = []
    for i, truth in enumerate(results.places):
        model = Model.of(results.where(np.arange(len(results.places)) != i))
        there = results.there[i]
        at_truth = model.log_likelihood(truth[np.newaxis], there)[0]
        found = judged(model.log_likelihood(points, there), at_truth, truth)
        known = {"row": i + 1, **dict(zip(NAMES, truth, strict=True)), "there": there}
        rows.append(known | found | model._asdict())
    return pd.DataFrame(rows).drop(columns="surrogate")


# --- simulated piles --------------------------------------------------------------------


def simulated_results(model: Model, rng: np.random.Generator, count: int) -> Results:
    """Simulate piles of both engines, of which the surrogate is the truth."""
    places = LOW + rng.random((count, len(LOW))) * (HIGH - LOW)
    mean = model.surrogate.predict(inputs(places))
    offset = rng.normal(0.0, SIMULATED_DISCREPANCY_DEG, count)
    here, there = (
        mean + rng.normal(0.0, noise, (count, SEEDS_THERE))
        for noise in SIMULATED_NOISE_DEG
    )
    return Results(
        places=places,
        here=here.mean(axis=1),
        there=there.mean(axis=1) + offset,
        here_sd=here.std(axis=1, ddof=1),
        there_sd=there.std(axis=1, ddof=1),
        seeds=np.full(count, float(SEEDS_THERE)),
    )


# --- what is reported -------------------------------------------------------------------


def summary(table: pd.DataFrame) -> str:
    """Write the shares inside the regions, the levels' test, and the bits."""
    count = len(table)
    lines = [f"{count} truths"]
    for region in REGIONS:
        share = (table["level"] <= region).mean()
        error = np.sqrt(region * (1.0 - region) / count)
        lines.append(f"inside {region:.0%}: {share:.3f}, expected +- {error:.3f}")
    p_value = stats.kstest(table["level"], "uniform").pvalue
    lines.append(f"levels uniform: p {p_value:.2g}")
    gains = ["bits", "bits_at_truth", *(f"bits_{name}" for name in NAMES)]
    for name in gains:
        values = table[name]
        lines.append(f"{name}: {values.mean():.2f} +- {values.sem():.2f}")
    return "\n".join(lines)


@script.part("piles", str(DATA / "known_truth_piles.csv"))
def piles(args, config):
    """Judge the posteriors of the 45 piles."""
    table = judge_piles(read("row"))
    write_table(args.out, table, float_format="%.5g")
    return summary(table)


@script.part(
    "simulated",
    str(DATA / "known_truth_simulated.csv"),
    option("--sets", type=int, default=10, help="sets of 45 piles (10)"),
)
def simulated(args, config):
    """Judge posteriors of simulated piles, for which the error model is right."""
    results = read("row")
    truth = Model.of(results)
    tables = []
    for number in range(args.sets):
        rng = np.random.default_rng([STREAM, number])
        piles_of_set = simulated_results(truth, rng, len(results.places))
        tables.append(judge_piles(piles_of_set).assign(set=number))
    table = pd.concat(tables)
    write_table(args.out, table, float_format="%.5g")
    return summary(table)


def in_all_tests(pile: Results, others: Mapping[str, Results]) -> pd.DataFrame:
    """List the places of `others` that are among the piles: their rows in each test."""
    drums = others["drum"].places
    rows = []
    for i, place in enumerate(pile.places):
        same = np.flatnonzero((drums == place).all(axis=1))
        rows.extend({"row": i, "drum": k, "discharge": k} for k in same)
    return pd.DataFrame(rows)


@script.part("three_tests", str(DATA / "known_truth_three_tests.csv"))
def three_tests(args, config):
    """Judge the posteriors of pile, drum and discharge together."""
    tests = {test: read(test) for test in COLUMNS}
    points = grid()
    even = np.full(len(points), 1.0 / len(points))
    rows = []
    for _, numbers in in_all_tests(tests["row"], tests).iterrows():
        truth = tests["row"].places[numbers["row"]]
        known = {"row": numbers["row"] + 1, **dict(zip(NAMES, truth, strict=True))}
        total = np.zeros(len(points))
        total_at_truth = 0.0
        rows.append(known | {"tests": "none", "distance": distance(even, truth)})
        so_far = []
        for test, results in tests.items():
            k = numbers[test]
            model = Model.of(results.where(np.arange(len(results.places)) != k))
            log_likelihood = model.log_likelihood(points, results.there[k])
            at_truth = model.log_likelihood(truth[np.newaxis], results.there[k])[0]
            errors = model._asdict()
            del errors["surrogate"]
            alone = judged(log_likelihood, at_truth, truth)
            rows.append(known | {"tests": test} | alone | errors)
            total += log_likelihood
            total_at_truth += at_truth
            so_far.append(test)
            if len(so_far) > 1:
                together = judged(total, total_at_truth, truth)
                rows.append(known | {"tests": "+".join(so_far)} | together)
    table = pd.DataFrame(rows)
    write_table(args.out, table, float_format="%.5g")
    means = table.groupby("tests", sort=False)[["bits", "bits_at_truth", "distance"]]
    return means.mean().round(2).to_string()


if __name__ == "__main__":
    script.run()
