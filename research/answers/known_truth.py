"""Whether the posterior holds the true parameters of another engine's piles.

    python -m research.answers.known_truth piles
    python -m research.answers.known_truth simulated
    python -m research.answers.known_truth three_tests
    python -m research.answers.known_truth figure

The data are the tables of examples/lifted_piles, of both engines. A row of theirs counts as a measured pile with
unknown parameters; what we simulated at the other rows is the surrogate's data. docs/known_truth.md has the rule.
"""

import argparse
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import optimize, stats

from repose.calibrate.surrogates import Surrogate
from repose.calibrate.surrogates.gaussian_process import GaussianProcess
from repose.calibrate.uncertainty.implausibility import compute_joint_bits
from repose.common.files import read_table, write_table
from repose.report.figures import style

DATA = Path("results/published/lifted_piles")
NAMES = ["fric", "rollfric", "rest"]  # static and rolling friction, restitution
LOW, HIGH = np.array([0.2, 0.0, 0.3]), np.array([0.6, 0.25, 0.7])
CELLS = (40, 80, 20)  # of the grid
POWERS = np.array([1.0, 0.5, 1.0])  # of the parameters, as inputs of the surrogate
SEEDS_THERE = 2
REGIONS = (0.5, 0.9)
SIMULATED_DISCREPANCY_DEG, SIMULATED_NOISE_DEG = 0.5, (0.94, 0.75)
LARGEST_FACTOR = 100.0
SIMULATED_SETS = 10
INTERVAL = (0.05, 0.95)  # of each parameter: quantiles
STREAM = 112  # of random numbers, of this study alone
# For each test: our number and theirs in the tables of comparison.
COLUMNS = {
    "row": ("angle_deg", "aor"),
    "drum": ("angle_deg", "drum_aor"),
    "discharge": ("rate_g_s", "flow_gs"),
}
# Tests whose likelihoods are multiplied.
TOGETHER = (
    ("row",),
    ("drum",),
    ("discharge",),
    ("row", "drum"),
    ("row", "discharge"),
    ("row", "drum", "discharge"),
)


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
    """Read the results of a test, with those of the further places where there are any."""
    here, there = COLUMNS[test]
    needed = [*NAMES, here, there, "seeds", "seeds_sd", "seeds_sd_theirs"]
    table = read_table(DATA / f"compared_{test}.csv", needed)
    further = DATA / f"more_{test}.csv"
    if further.exists():
        more = read_table(further, [*NAMES, here])
        table = pd.concat([table[needed], more[[*NAMES, here]].assign(seeds=1)])
    return results_of(table, here, there)


# --- surrogate and errors ---------------------------------------------------------------


def inputs(places: np.ndarray) -> np.ndarray:
    """Transform parameters to the inputs of the surrogate."""
    return places**POWERS


def left_out(model: GaussianProcess) -> tuple[np.ndarray, np.ndarray]:
    """Predict each sample from the others: means (n,) and variances (n,) of these."""
    means, variances = model.processes_[0].predict_left_out()
    covariance = model._covariance(variances[:, np.newaxis])
    return model.unmix(means[:, np.newaxis])[:, 0], covariance[:, 0, 0]


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
        The level of the truth; bits of the posterior and at the truth; the distance from the truth in ranges; bits and
        the 90 % interval of each parameter.
    """
    weight = np.exp(log_likelihood - log_likelihood.max())
    mean_weight = weight.mean()
    at_truth_weight = np.exp(at_truth - log_likelihood.max())
    weight /= weight.sum()
    found = {
        "level": float(weight[log_likelihood > at_truth].sum()),
        "bits": compute_joint_bits(weight),
        "bits_at_truth": float(np.log2(at_truth_weight / mean_weight)),
        "distance": distance(weight, truth, cells),
    }
    shaped = weight.reshape(cells)
    for axis, name in enumerate(NAMES):
        others = tuple(k for k in range(len(cells)) if k != axis)
        marginal = shaped.sum(axis=others)
        found[f"bits_{name}"] = compute_joint_bits(marginal)
        below = np.concatenate([[0.0], marginal.cumsum()])
        edges = np.linspace(LOW[axis], HIGH[axis], cells[axis] + 1)
        low, high = np.interp(INTERVAL, below, edges)
        found |= {f"low_{name}": low, f"high_{name}": high}
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


def table_path(part: str) -> Path:
    """Name the table of a part."""
    return DATA / f"known_truth_{part}.csv"


def piles() -> str:
    """Judge the posteriors of the 45 piles."""
    table = judge_piles(read("row"))
    write_table(table_path("piles"), table, float_format="%.5g")
    return summary(table)


def simulated() -> str:
    """Judge posteriors of simulated piles, for which the error model is right."""
    results = read("row")
    truth = Model.of(results)
    tables = []
    for number in range(SIMULATED_SETS):
        rng = np.random.default_rng([STREAM, number])
        piles_of_set = simulated_results(truth, rng, len(results.places))
        tables.append(judge_piles(piles_of_set).assign(set=number))
    table = pd.concat(tables)
    write_table(table_path("simulated"), table, float_format="%.5g")
    return summary(table)


def in_all_tests(tests: Mapping[str, Results]) -> list[dict[str, int]]:
    """List the numbers, in each test, of the places that all tests have."""
    first, *others = tests
    found = []
    for number, place in enumerate(tests[first].places):
        same = {test: (tests[test].places == place).all(axis=1) for test in others}
        if all(mask.any() for mask in same.values()):
            numbers = {test: int(mask.argmax()) for test, mask in same.items()}
            found.append({first: number, **numbers})
    return found


def judge_together(
    tests: Mapping[str, Results], numbers: Mapping[str, int]
) -> list[dict]:
    """Judge the posteriors of one place by single tests and by several together."""
    points = grid()
    truth = tests["row"].places[numbers["row"]]
    even = np.full(len(points), 1.0 / len(points))
    rows = [{"tests": "none", "distance": distance(even, truth)}]
    models = {}
    on_grid = {}
    at_truth = {}
    for test, results in tests.items():
        k = numbers[test]
        models[test] = Model.of(results.where(np.arange(len(results.places)) != k))
        there = results.there[k]
        on_grid[test] = models[test].log_likelihood(points, there)
        at_truth[test] = models[test].log_likelihood(truth[np.newaxis], there)[0]
    for together in TOGETHER:
        likelihood = sum(on_grid[test] for test in together)
        found = judged(likelihood, sum(at_truth[test] for test in together), truth)
        errors = models[together[0]]._asdict() if len(together) == 1 else {}
        rows.append({"tests": "+".join(together), **found, **errors})
    known = {"row": numbers["row"] + 1, **dict(zip(NAMES, truth, strict=True))}
    return [known | row for row in rows]


def three_tests() -> str:
    """Judge the posteriors of pile, drum and discharge together."""
    tests = {test: read(test) for test in COLUMNS}
    rows = [judge_together(tests, numbers) for numbers in in_all_tests(tests)]
    table = pd.DataFrame(chain.from_iterable(rows)).drop(columns="surrogate")
    write_table(table_path("three_tests"), table, float_format="%.5g")
    means = table.groupby("tests", sort=False)[["bits", "bits_at_truth", "distance"]]
    return means.mean().round(2).to_string()


def figure() -> str:
    """Draw the levels of the truths, and the intervals of the rolling friction."""
    table = read_table(table_path("piles"), ["level"])
    with style.applied():
        page = style.new_figure(style.PAGE, 2.8)
        left, right = page.subplots(1, 2)
        count = len(table)
        sizes = np.linspace(0.0, 1.0, 401)
        chance = stats.binom(count, sizes).interval(0.95)
        band = np.divide(chance, count)
        left.fill_between(sizes, *band, color=style.GREY, alpha=0.3, lw=0)
        left.plot(sizes, sizes, color=style.GREY, label="a right posterior")
        inside = [np.mean(table["level"] <= size) for size in sizes]
        left.plot(sizes, inside, color=style.BLUE, label=f"{count} piles")
        left.set(xlabel="size of the region", ylabel="share of truths inside")
        left.legend()

        truth = table["rollfric"]
        right.plot([LOW[1], HIGH[1]], [LOW[1], HIGH[1]], color=style.GREY)
        right.vlines(
            truth, table["low_rollfric"], table["high_rollfric"], color=style.BLUE
        )
        right.set(xlabel="true rolling friction", ylabel="90 % interval")
        style.label_panels([left, right])
        path = table_path("piles").with_name("known_truth.png")
        style.save(page, path, small_run=False)
    return str(path)


PARTS = {part.__name__: part for part in (piles, simulated, three_tests, figure)}


def main() -> None:
    """Run the part that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", choices=PARTS)
    print(PARTS[parser.parse_args().part]())


if __name__ == "__main__":
    main()
