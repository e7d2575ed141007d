"""The whole method compared with simpler ones: proposals from few simulations, judged by the truth.

For equal numbers of samples, each method of `proposals` proposes one set of parameters for the targets.

The truth is an emulator: a Gaussian process (Matern 5/2, a length for each parameter) fitted to all samples that are
given. The error of a proposal is that of the truth's noise-free responses there. Data come in two kinds:

real
    random subsets of the samples themselves; the truth has seen them too, so errors come out too small where the subset
    is most of them
emulated
    new Latin hypercubes with the truth's responses and the scatter of real runs
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from repose.bench.parameters import PARAMETERS
from repose.calibrate import variance
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import name_derived_column
from repose.calibrate.search.objective import Objective
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import write_table
from research.comparison import scores
from research.comparison.emulator import Emulator, with_process
from research.comparison.points import Points, joined, read
from research.comparison.proposals import proposed


class Samples(NamedTuple):
    """Samples of one or several studies."""

    points: Points  # X (n, d): places in the ranges
    covariance: np.ndarray  # (k, k), of a single run about its sample's mean

    @property
    def errors(self) -> np.ndarray:
        """Standard errors (n, k) of the means, by the scatter over all samples."""
        return (
            np.sqrt(np.diagonal(self.covariance))
            / np.sqrt(self.points.counts())[:, None]
        )

    @property
    def seeds(self) -> int:
        """Good runs of a sample, on average."""
        return round(float(self.points.counts().mean()))


def samples_of(points: Points) -> Samples:
    """Points with the covariance of a single run; X (n, d) are places in the ranges.

    ValueError if too few points have two runs.
    """
    good = points.good()
    values = points.values[good]
    number = np.nonzero(good)[0]
    within = [
        variance.variance_components(column, number).within for column in values.T
    ]
    correlation = np.eye(len(within))
    for i, j in zip(*np.triu_indices(len(within), 1), strict=True):
        pair = variance.estimate_residual_correlation(
            values[:, i], values[:, j], number
        )[0]
        correlation[i, j] = correlation[j, i] = pair
    scatter = np.sqrt(within)
    return Samples(points, np.outer(scatter, scatter) * correlation)


def read_samples(
    datasets: Sequence[str | Path],
    runs: Sequence[str | Path],
    space: ParameterSpace,
    names: Sequence[str],
) -> Samples:
    """Read samples of files that the verb dataset wrote, in pairs.

    InputError if a file is bad, the numbers of files differ, or too few samples have two runs.
    """
    if len(datasets) != len(runs):
        raise InputError(
            "command line",
            "runs",
            len(runs),
            f"as many files as datasets, {len(datasets)}",
        )
    points = joined([read(*pair, names) for pair in zip(datasets, runs, strict=True)])
    try:
        return samples_of(points._replace(X=space.unit(points.X)))
    except ValueError as error:
        raise InputError(
            runs[0], "runs", str(error), "two or more of most samples"
        ) from None


def matern(inputs: int) -> Any:
    """Kernel of the truth: Matern 5/2 with a length for each input."""
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    return ConstantKernel(1.0, (1e-2, 1e3)) * Matern(
        np.ones(inputs), (0.1, 30.0), nu=2.5
    )


def truth_of(samples: Samples, seed: int) -> Emulator:
    """Fit the emulator of all samples, the judge of proposals; `seed` draws points of the kernel fit and folds."""
    return with_process(
        samples.points, samples.errors, samples.covariance, matern, seed
    )


def emulated(
    samples: Samples, truth: Emulator, count: int, random: np.random.Generator
) -> Points:
    """Draw a new Latin hypercube of `count` samples whose runs scatter about the truth as real ones do.

    Each has as many runs as `samples` have on average.
    """
    dimensions = samples.points.X.shape[1]
    unit = stats.qmc.LatinHypercube(dimensions, rng=random).random(count)
    return truth.pour(unit, samples.seeds, random)


def compared(
    samples: Samples,
    space: ParameterSpace,
    targets: Targets,
    settings: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All methods on real and emulated data: means with standard errors over the repetitions, and every proposal.

    `settings` holds ``samples`` (a list of numbers), ``repetitions``, ``local_starts``, ``seed``, and the sections
    ``network`` and ``miga``. Numbers of samples above the available number have emulated data alone.
    """
    truth = truth_of(samples, settings["seed"])
    available = len(samples.points.X)
    rows = []
    for count in settings["samples"]:
        for repetition in range(settings["repetitions"]):
            for kind in ("real", "emulated"):
                if kind == "real" and count >= available:
                    continue
                random = np.random.default_rng(
                    [settings["seed"], count, repetition, kind == "real"]
                )
                if kind == "real":
                    data = samples.points.take(
                        random.choice(available, count, replace=False)
                    )
                else:
                    data = emulated(samples, truth, count, random)
                labels = {"data": kind, "samples": count, "repetition": repetition}
                rows += _rows(labels, data, truth, space, targets, settings, random)
    proposals = pd.DataFrame(rows)
    return _table(proposals, truth, targets, available), proposals


def run(
    samples: Samples,
    space: ParameterSpace,
    targets: Targets,
    settings: Mapping[str, Any],
    out_dir: str | Path,
) -> pd.DataFrame:
    """Write whole.csv and whole_proposals.csv; return the first."""
    table, proposals = compared(samples, space, targets, settings)
    write_table(Path(out_dir) / "whole_proposals.csv", proposals)
    write_table(Path(out_dir) / "whole.csv", table)
    return table


def _rows(labels, data, truth, space, targets, settings, random):
    """Rows of whole_proposals.csv of one set of data, a row for each method."""
    found = proposed(data, space, targets, settings, random)
    objective = Objective(targets)
    for name, (place, evaluations) in found.items():
        row = {key: labels[key] for key in ("data", "samples")} | {"method": name}
        row |= {
            "repetition": labels["repetition"],
            "simulations": int(data.counts().sum()),
        }
        row |= {"evaluations": evaluations}
        row |= dict(zip(PARAMETERS, space.values(place)[0], strict=True))
        yield row | _judged(truth.mean(place), objective, targets)


def _judged(responses, objective, targets):
    """Put a proposal's true responses (1, k) beside the targets, by name."""
    F, V = objective(responses)
    errors = np.abs(responses[0] - objective.target)
    return {
        **dict(zip(targets.names, responses[0], strict=True)),
        **{
            name_derived_column(name, "off"): value
            for name, value in zip(targets.names, errors, strict=True)
        },
        "objective": F[0],
        "inside": bool(V[0] == 0),
    }


def _table(proposals, truth, targets, available):
    """Means with standard errors over the repetitions."""
    rows = []
    for (kind, count, method), group in proposals.groupby(
        ["data", "samples", "method"], sort=False
    ):
        row = {
            "data": kind,
            "samples": count,
            "method": method,
            "repetitions": len(group),
        }
        row |= {key: group[key].mean() for key in ("simulations", "evaluations")}
        for key in (
            *(name_derived_column(name, "off") for name in targets.names),
            "objective",
            "inside",
        ):
            row[key], row[f"{key}_se"] = scores.mean_and_error(group[key])
        rows.append(row)
    table = pd.DataFrame(rows)
    for name, share in zip(targets.names, truth.explainable, strict=True):
        table[f"truth_{name}_r2"] = share
    return table.assign(truth_samples=available)


def message(table: pd.DataFrame, targets: Targets) -> str:
    """Results for the largest number of samples in words, a line for each method of whole.csv."""
    lines = []
    for kind, group in table.groupby("data", sort=False):
        last = group[group["samples"] == group["samples"].max()]
        for row in last.to_dict("records"):
            parts = []
            for response in targets.responses:
                column = name_derived_column(response.name, "off")
                parts.append(
                    f"{response.symbol} {row[column]:.2f} ± {row[f'{column}_se']:.2f} {response.unit}".rstrip()
                )
            lines.append(
                f"{kind}, {row['samples']} samples, {row['method']}: off by {', '.join(parts)}"
            )
    return "\n".join(lines)
