"""Discrepancies that are a share of each response, but no less than a smallest one in the response's unit.

Two percent of a share of five percent would be half a grain.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from repose.calibrate.responses import response
from repose.calibrate.uncertainty import discrepancy


def sizes(
    names: Sequence[str],
    means: np.ndarray,
    percent: Mapping[str, float] | float,
    smallest: Mapping[str, float],
) -> np.ndarray:
    """Compute the standard deviations (k,) of discrepancies: `percent` of the mean, at least `smallest` of the unit."""
    discrepancies = []
    for name, mean in zip(names, means, strict=True):
        share = percent[name] if isinstance(percent, Mapping) else percent
        least = smallest.get(response(name).unit, 0.0)
        discrepancies.append(max(share / 100 * abs(mean), least) if share > 0 else 0.0)
    return np.array(discrepancies)


def covariance(
    names: Sequence[str], sd: np.ndarray, means: np.ndarray, correlation: float
) -> np.ndarray:
    """Compute the covariance S_d (k, k) of the discrepancies of registered responses."""
    return discrepancy.compute_covariance(
        [response(name).apparatus for name in names], sd, means, correlation
    )
