"""Probability that the pile of a parameter set meets all targets, by its own runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repose.calibrate.targets import Targets

PERCENT = (1.0, 2.0)  # of the aims, reported with every answer
DRAWS = 200_000
SEED = 2026
Runs = Mapping[str, Sequence[Mapping[str, Any]]]  # of a parameter set, by bench test


def chance_of_meeting(
    runs: Runs, targets: Targets, percent: float | None = None
) -> dict[str, float | None]:
    """Compute how probably the simulator's own mean meets the target, for each target and for `all` together.

    Without prior knowledge the mean, given n runs, has a multivariate t distribution about the runs' mean, with
    n - 1 degrees of freedom. None where fewer than two runs gave the response.
    """
    random = np.random.default_rng(SEED)
    chances: dict[str, float | None] = dict.fromkeys((*targets.names, "all"))
    together = np.ones(DRAWS, dtype=bool)
    for bench in targets.apparatus:
        own = [target for target in targets if target.response.apparatus == bench]
        rows = [
            [run[target.name] for target in own]
            for run in runs.get(bench, ())
            if run["status"] == "ok"
        ]
        if len(rows) < 2:
            return chances
        drawn = _means(np.array(rows, dtype=float), random)
        for k, target in enumerate(own):
            low, high = target.low, target.high
            if percent is not None:
                low, high = (
                    target.aim + side * percent / 100 * target.whole for side in (-1, 1)
                )
            inside = (drawn[:, k] >= low) & (drawn[:, k] <= high)
            chances[target.name] = float(inside.mean())
            together &= inside
    chances["all"] = float(together.mean())
    return chances


def _means(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Draw the true mean (DRAWS, k), given runs (n, k)."""
    n, k = values.shape
    sizes, axes = np.linalg.eigh(
        np.cov(values, rowvar=False).reshape(k, k) / n
    )  # also where it is singular
    normal = random.normal(size=(DRAWS, k)) @ (axes * np.sqrt(np.maximum(sizes, 0.0))).T
    return values.mean(axis=0) + normal / np.sqrt(
        random.chisquare(n - 1, size=(DRAWS, 1)) / (n - 1)
    )
