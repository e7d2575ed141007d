"""Probability that the pile of a parameter set meets all targets, by its own runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repose.calibrate.targets import Targets

# Percents of the aims that are reported with every answer.
PERCENT = (1.0, 2.0)
DRAWS = 200_000
SEED = 2026
# Runs of a parameter set by bench test.
Runs = Mapping[str, Sequence[Mapping[str, Any]]]


def chance_of_meeting(
    runs: Runs, targets: Targets, percent: float | None = None
) -> dict[str, float | None]:
    """Compute how probably the true means of the simulator meet the targets.

    Without prior knowledge the mean, given n runs, has a multivariate t distribution
    about the mean of the runs, with n - 1 degrees of freedom.

    Parameters
    ----------
    runs : mapping
        Runs of a parameter set by bench test.
    targets : Targets
    percent : float, optional
        Tolerance in percent of the aims; by default the ranges of the targets count.

    Returns
    -------
    dict
        A probability for each target, and one for `all` together; None where fewer than
        two runs gave the response.
    """
    random = np.random.default_rng(SEED)
    chances: dict[str, float | None] = dict.fromkeys((*targets.names, "all"))
    all_met = np.ones(DRAWS, dtype=bool)
    for bench in targets.apparatus:
        of_bench = [target for target in targets if target.response.apparatus == bench]
        rows = []
        for run in runs.get(bench, ()):
            if run["status"] == "ok":
                rows.append([run[target.name] for target in of_bench])
        if len(rows) < 2:
            return chances
        means = _draw_means(np.array(rows, dtype=float), random)
        for k, target in enumerate(of_bench):
            low, high = target.low, target.high
            if percent is not None:
                tolerance = percent / 100 * target.whole
                low, high = target.aim - tolerance, target.aim + tolerance
            is_met = (means[:, k] >= low) & (means[:, k] <= high)
            chances[target.name] = float(is_met.mean())
            all_met &= is_met
    chances["all"] = float(all_met.mean())
    return chances


def _draw_means(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Draw the true mean (DRAWS, k), given runs (n, k)."""
    n, k = values.shape
    covariance = np.cov(values, rowvar=False).reshape(k, k) / n
    # The root of the covariance, also where it is singular.
    eigenvalues, eigenvectors = np.linalg.eigh(covariance)
    root = eigenvectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    normal = random.normal(size=(DRAWS, k)) @ root.T
    chi_square = random.chisquare(n - 1, size=(DRAWS, 1))
    return values.mean(axis=0) + normal / np.sqrt(chi_square / (n - 1))
