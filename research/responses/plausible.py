"""Hypothetical observations: points of the prior, plausible truths among them, and the scatter of means."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from research.responses import information
from research.responses.responses_over_design import Data


def prior_points(
    space: ParameterSpace,
    settings: Mapping[str, Any],
    predict: Callable[[np.ndarray], np.ndarray],
) -> information.Prior:
    """Draw a Sobol sequence over the prior, with predictions.

    `settings` holds ``points`` and ``seed``; `predict` maps parameter sets (n, 6) to responses (n, k).
    """
    quantile = stats.qmc.Sobol(space.dimensions, rng=settings["seed"]).random(
        settings["points"]
    )
    place = information.places_of(space, quantile)
    return information.Prior(
        quantile, predict(space.values(place)), place, information.prior_widths(space)
    )


def measured_covariance(
    data: Data, names: Sequence[str], correlation: np.ndarray, targets: Targets
) -> np.ndarray:
    """Covariance S_y (k, k) of the means of all repetitions.

    A response that is no target is measured as often as the target that was measured least. Two responses have the
    repetitions of the one that was measured less often in common, so the larger number divides their covariance.
    `correlation` (k, k) is of the noise from run to run.
    """
    counts = {target.name: target.repetitions for target in targets}
    least = min(target.repetitions for target in targets)
    repetitions = np.array([counts.get(name, least) for name in names])
    within = np.array([data.known[name].row["sd_within"] for name in names])
    return (
        np.outer(within, within)
        * correlation
        / np.maximum.outer(repetitions, repetitions)
    )


def plausible_truths(
    predicted: np.ndarray,
    names: Sequence[str],
    targets: Targets,
    settings: Mapping[str, Any],
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the prior that meet all targets, drawn at random, and unit normal numbers for their observations.

    Row numbers (truths,) of `predicted` (n, k), and numbers (truths, k). `settings` holds ``truths`` and ``seed``.
    InputError if fewer than ``truths`` points meet all targets.
    """
    values = predicted[:, [list(names).index(name) for name in targets.names]]
    rows = np.flatnonzero(
        ((values >= targets.low) & (values <= targets.high)).all(axis=1)
    )
    if len(rows) < settings["truths"]:
        allowed = f"at least {settings['truths']}, inside the ranges of all targets"
        raise InputError("targets", "feasible points of the prior", len(rows), allowed)
    random = np.random.default_rng(settings["seed"])
    chosen = random.choice(rows, settings["truths"], replace=False)
    return chosen, random.normal(size=(len(chosen), predicted.shape[1]))
