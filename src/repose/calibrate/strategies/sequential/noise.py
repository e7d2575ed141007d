"""Find the noise of a single run: from replicates, from the user, or from single runs.

Without replicates, the noise is estimated from the scatter of single runs about a
smooth surface. The surface is a Gaussian process whose errors have one unknown
variance, the nugget (Rasmussen & Williams 2006, section 2.2). A rough surface without
noise fits a few runs as well as a smooth surface with noise. So the estimate is an
average over all fractions of noise that the runs allow.

The kernel differs from that of `repose.calibrate.strategies.sequential.kriging`, where
the noise is known. The lengths of that kernel have a prior but no bound, so they may be
so short that a rough surface explains the noise.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from repose.calibrate.strategies.sequential.kriging import (
    HYPERPARAMETER_BOUNDS,
    MAX_EXACT_SAMPLES,
    ROUNDING_FRACTION,
    SMOOTHNESS,
    ObservedSamples,
    draw_subset,
)
from repose.common.errors import InputError
from repose.common.numbers import format_significant

# Sources of the noise.
REPLICATES = "replicates"
USER_GIVEN = "noise_sd"
ESTIMATED = "estimated from single runs"
RUNS_PER_PARAMETER = 4  # least number of single runs for an estimate
# Candidates for the fraction of the runs' variance that is noise. They are equally
# probable a priori.
NOISE_FRACTIONS = np.geomspace(1e-4, 1.0, 9)
# A finer grid of candidates, which many samples can distinguish.
FINE_NOISE_FRACTIONS = np.geomspace(1e-4, 1.0, 401)
# Bounds of the surface's lengths, in ranges of a parameter: shorter waves look like
# noise.
LENGTH_BOUNDS = (0.3, 30.0)
# Smallest number by which means are divided, to avoid a division by 0.
MIN_SCALE = 1e-300


class Noise(NamedTuple):
    """The noise of a single run."""

    covariance: np.ndarray  # (k, k), of the responses about their means
    sources: dict[
        str, str
    ]  # for each response `REPLICATES`, `USER_GIVEN` or `ESTIMATED`

    @property
    def warning(self) -> str | None:
        """Warning of too few replicates; None if there are enough."""
        if REPLICATES in self.sources.values():
            return None
        deviations = []
        for (name, source), variance in zip(
            self.sources.items(), np.diagonal(self.covariance), strict=True
        ):
            deviations.append(
                f"{name} {format_significant(np.sqrt(variance), 2)} ({source})"
            )
        return (
            "too few replicates that differ for the noise of a run; taken as standard "
            f"deviations: {', '.join(deviations)}. Intervals and probabilities are as "
            "good as these numbers, and the noise of two responses is taken as "
            "independent. Simulate some parameter sets twice, with other random "
            "numbers, or give targets.NAME.noise_sd."
        )


def find_noise(
    observed: ObservedSamples, names: Sequence[str], noise_sd: Mapping[str, float]
) -> Noise:
    """Find the noise of a single run.

    The noise is estimated from replicates if there are enough. Otherwise the standard
    deviation of each response is that of `noise_sd`, or else an estimate from single
    runs. If all replicates of each sample are equal, they count as one run. Such
    replicates come from a simulator without random numbers, or from rounded results.

    Parameters
    ----------
    observed : ObservedSamples
    names : sequence of str
        Names of the k responses.
    noise_sd : mapping
        Standard deviations of some responses, set by the user.

    Returns
    -------
    Noise
        The covariance, and the source of the noise of each response.

    Raises
    ------
    InputError
        If replicates, `noise_sd` and single runs are all too few.
    """
    if len(observed.unit) == 0:
        raise InputError(
            source="runs",
            key="samples with a good run",
            value=0,
            allowed="runs that did not fail",
        )
    runs_of_samples = observed.counts
    has_replicates = observed.degrees_of_freedom > len(names)
    if has_replicates:
        try:
            covariance = observed.estimate_noise()
            return Noise(covariance, dict.fromkeys(names, REPLICATES))
        except ValueError:
            # The replicates do not show the noise, so count them as one run.
            runs_of_samples = np.ones_like(runs_of_samples)

    # Without replicates the correlation is unknown, so treat the responses separately.
    if not set(names) <= set(noise_sd):
        _require_enough_samples(observed, names, has_replicates)
    sources = {}
    variances = []
    for k, name in enumerate(names):
        if name in noise_sd:
            sources[name] = USER_GIVEN
            variances.append(noise_sd[name] ** 2)
        else:
            sources[name] = ESTIMATED
            variance = estimate_nugget(
                observed.unit, observed.means[:, k], shares=1.0 / runs_of_samples
            )
            variances.append(variance)
    return Noise(np.diag(variances), sources)


def _require_enough_samples(
    observed: ObservedSamples, names: Sequence[str], has_replicates: bool
) -> None:
    """Refuse too few samples for an estimate of the noise from single runs.

    The error names all ways to determine the noise.

    Parameters
    ----------
    observed : ObservedSamples
    names : sequence of str
        Names of the responses.
    has_replicates : bool
        Whether there are enough replicates, which do not show the noise.

    Raises
    ------
    InputError
        If there are too few samples.
    """
    n_samples, n_parameters = observed.unit.shape
    fewest = RUNS_PER_PARAMETER * n_parameters
    if n_samples >= fewest:
        return
    key = "runs beyond the first of a sample"
    value: object = observed.degrees_of_freedom
    needed = (
        f"at least {len(names) + 1}: replicates, rows with the same parameters, "
        "determine the noise"
    )
    if has_replicates:
        alike = ", ".join(
            name
            for name, is_alike in zip(names, observed.alike, strict=True)
            if is_alike
        )
        key = "difference between the runs of a sample"
        value = 0 if alike else "proportional in several responses"
        needed = (
            f"other results of {alike or 'each response'} in the runs of a sample: give "
            "each run other random numbers, and do not round the results"
        )
    raise InputError(
        source="runs",
        key=key,
        value=value,
        allowed=(
            f"{needed}; or targets.NAME.noise_sd for each response; or at least "
            f"{fewest} samples, for an estimate of it"
        ),
    )


def estimate_nugget(unit: np.ndarray, means: np.ndarray, shares: np.ndarray) -> float:
    """Estimate the variance of a run about a smooth surface.

    The estimate is the mean over `NOISE_FRACTIONS`, weighted by their evidence.

    Parameters
    ----------
    unit : array (n, d)
        Samples in the unit cube.
    means : array (n,)
        Their means of a response.
    shares : array (n,)
        Variance of each of the means, in variances of a single run.
    """
    # A proposal and its answer need the same estimate, which takes minutes with many
    # runs. So it is cached.
    arrays = [np.ascontiguousarray(array, float) for array in (unit, means, shares)]
    return _estimate_cached_nugget(
        *(array.tobytes() for array in arrays), unit.shape[1]
    )


@lru_cache(maxsize=32)
def _estimate_cached_nugget(
    unit_bytes: bytes, means_bytes: bytes, fractions_bytes: bytes, d: int
) -> float:
    """Compute the result of `estimate_nugget` from arrays that are passed as bytes.

    The cache needs hashable arguments. Bytes are hashable, unlike arrays.

    Parameters
    ----------
    unit_bytes, means_bytes, fractions_bytes : bytes
        The arrays of `estimate_nugget`.
    d : int
        Number of parameters, the columns of `unit`.

    Returns
    -------
    float
        The nugget, which is the variance of a single run about the surface.
    """
    from repose.calibrate.surrogates.process import Process, make_smooth_kernel

    unit = np.frombuffer(unit_bytes).reshape(-1, d)
    means = np.frombuffer(means_bytes)
    shares = np.frombuffer(fractions_bytes)

    # Scale the means to variance 1, unless their differences are mere rounding errors.
    rounding_error = ROUNDING_FRACTION * float(np.abs(means).max())
    scale = max(float(means.std()), rounding_error, MIN_SCALE)
    values = (means - means.mean()) / scale

    # Fit a smooth process for each candidate of the noise, and weight the candidates by
    # the evidence of the fit.
    kernel = make_smooth_kernel(
        1.0, np.ones(unit.shape[1]), (HYPERPARAMETER_BOUNDS, LENGTH_BOUNDS), SMOOTHNESS
    )
    if len(unit) > MAX_EXACT_SAMPLES:
        log_evidence = _interpolate_evidence(kernel, unit, values, shares)
        candidates = FINE_NOISE_FRACTIONS
    else:
        log_evidence = np.array(
            [
                Process(kernel, unit, values, errors=share * shares).log_likelihood
                for share in NOISE_FRACTIONS
            ]
        )
        candidates = NOISE_FRACTIONS
    weights = np.exp(log_evidence - log_evidence.max())
    return float(weights @ candidates / weights.sum()) * scale**2


def _interpolate_evidence(
    kernel: Any, unit: np.ndarray, values: np.ndarray, shares: np.ndarray
) -> np.ndarray:
    """Compute the log evidence of `FINE_NOISE_FRACTIONS`, for many samples.

    To save time, variance and lengths are fitted to a subset of the samples. The
    evidence is that of all samples. Many samples can distinguish noise fractions that
    lie between the `NOISE_FRACTIONS`, so a spline interpolates the evidence between
    them.

    Parameters
    ----------
    kernel : kernel of scikit-learn
    unit : array (n, d)
        Samples in the unit cube.
    values : array (n,)
        Their means of a response, scaled to variance 1.
    shares : array (n,)
        Variance of each of the means, in variances of a single run.

    Returns
    -------
    array
        The log evidence of each of `FINE_NOISE_FRACTIONS`.
    """
    from scipy.interpolate import CubicSpline

    from repose.calibrate.surrogates.process import Process

    rows = draw_subset(len(unit))
    log_evidence = []
    for share in NOISE_FRACTIONS:
        errors = share * shares
        # The fit to the subset finds variance and lengths. With these, the evidence of
        # all samples needs no further fit.
        fit = Process(kernel, unit[rows], values[rows], errors=errors[rows])
        process = Process(fit.kernel, unit, values, errors=errors, optimizer=None)
        log_evidence.append(process.log_likelihood)
    return CubicSpline(np.log(NOISE_FRACTIONS), log_evidence)(
        np.log(FINE_NOISE_FRACTIONS)
    )
