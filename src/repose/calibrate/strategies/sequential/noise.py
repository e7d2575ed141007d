"""The noise of a single run: from replicates, as given, or estimated from single runs.

Without replicates only the scatter about a smooth surface is left: a Gaussian process whose errors have one unknown
variance, the nugget (Rasmussen & Williams 2006, section 2.2). A rough surface without noise fits few runs as well as
a smooth one with noise. So the variance is averaged over all shares of noise that the runs allow.

The kernel differs from `repose.calibrate.strategies.sequential.kriging`, which takes the noise as known: the lengths
there have a prior and no bound of their own, and may be so short that a rough surface explains the noise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from repose.calibrate.strategies.sequential.kriging import BOUNDS, SMOOTHNESS, Observed
from repose.common.errors import require

REPLICATES, GIVEN, ESTIMATED = "replicates", "noise_sd", "estimated from single runs"
RUNS_PER_PARAMETER = 4  # least number of single runs for an estimate
SHARES = np.geomspace(
    1e-4, 1.0, 9
)  # of the variance over the runs that may be noise, all equally probable a priori
LENGTHS = (
    0.3,
    30.0,
)  # of the surface, in ranges of a parameter: shorter waves look like noise


class Noise(NamedTuple):
    """The noise of a single run."""

    covariance: np.ndarray  # (k, k), of the responses about their means
    sources: dict[str, str]  # for each response `REPLICATES`, `GIVEN` or `ESTIMATED`

    @property
    def warning(self) -> str | None:
        """Warning for too few replicates; None if there are enough."""
        if REPLICATES in self.sources.values():
            return None
        sources = zip(
            self.sources.items(), np.sqrt(np.diagonal(self.covariance)), strict=True
        )
        deviations = [f"{name} {sd:.2g} ({source})" for (name, source), sd in sources]
        return (
            "too few replicates that differ for the noise of a run; taken as standard deviations: "
            f"{', '.join(deviations)}. Intervals and probabilities are as good as these "
            "numbers, and the noise of two responses is taken as independent. "
            "Simulate some parameter sets twice, with other random numbers, or give targets.NAME.noise_sd."
        )


def noise_of(
    observed: Observed, names: Sequence[str], noise_sd: Mapping[str, float]
) -> Noise:
    """Find the noise of a single run from replicates, or from given standard deviations `noise_sd` and an estimate.

    Replicates that are all alike, of a simulator without random numbers or of rounded results, count as one run.
    InputError if replicates, `noise_sd` and single runs are all too few.
    """
    counts = observed.counts
    require(len(counts), "runs", "samples with a good run", 0, "runs that did not fail")
    if observed.freedom > len(names):
        try:
            return Noise(observed.noise(), dict.fromkeys(names, REPLICATES))
        except ValueError:
            counts = np.ones_like(counts)
    fewest = RUNS_PER_PARAMETER * observed.unit.shape[1]
    allowed = (
        f"at least {len(names) + 1}: replicates, rows with the same parameters, determine the noise; or "
        f"targets.NAME.noise_sd for each response; or at least {fewest} samples, for an estimate of it"
    )
    good = set(names) <= set(noise_sd) or len(observed.unit) >= fewest
    require(
        good, "runs", "runs beyond the first of a sample", observed.freedom, allowed
    )
    sources = {name: GIVEN if name in noise_sd else ESTIMATED for name in names}
    variances = [
        noise_sd[name] ** 2
        if name in noise_sd
        else nugget(observed.unit, observed.means[:, k], 1.0 / counts)
        for k, name in enumerate(names)
    ]
    return Noise(np.diag(variances), sources)


def nugget(unit: np.ndarray, means: np.ndarray, shares: np.ndarray) -> float:
    """Estimate the variance of a run about a smooth surface: its mean over `SHARES`, weighted by their evidence.

    `shares` (n,) is the variance of each of the `means` (n,) in variances of a single run.
    """
    from repose.calibrate.surrogates.process import Process, smooth

    scale = max(float(means.std()), 1e-9 * float(np.abs(means).max()), 1e-300)
    value = (means - means.mean()) / scale
    kernel = smooth(1.0, np.ones(unit.shape[1]), (BOUNDS, LENGTHS), SMOOTHNESS)
    evidence = np.array(
        [
            Process(kernel, unit, value, share * shares).log_likelihood
            for share in SHARES
        ]
    )
    weights = np.exp(evidence - evidence.max())
    return float(weights @ SHARES / weights.sum()) * scale**2
