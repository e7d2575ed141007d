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
# An estimate from single runs needs at least this many of them for each parameter.
MIN_RUNS_PER_PARAMETER = 4
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
    """Find the noise, which is the scatter of single runs about the mean of a sample.

    The noise is estimated from replicates (further runs of a sample) if there are
    enough. Otherwise the standard deviation of each response is that of `noise_sd`, or
    else an estimate from single runs. If all replicates of each sample are equal, they
    count as one run. Such replicates come from a simulator without random numbers, or
    from rounded results.

    Parameters
    ----------
    observed : ObservedSamples
        The runs so far.
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
        If no run is good. Or if there are too few replicates, a response is missing in
        `noise_sd`, and there are too few single runs for an estimate of it.
    """
    if len(observed.unit_points) == 0:
        raise InputError(
            source="runs",
            key="samples with a good run",
            value=0,
            allowed="runs that did not fail",
        )
    # First choice: replicates. `ObservedSamples.estimate_noise` has the same limit.
    runs_per_sample = observed.counts
    has_enough_replicates = observed.degrees_of_freedom > len(names)
    if has_enough_replicates:
        try:
            covariance = observed.estimate_noise()
            return Noise(covariance, dict.fromkeys(names, REPLICATES))
        except ValueError:
            # The replicates do not show the noise, because they are equal or
            # proportional. So count all runs of a sample as one.
            runs_per_sample = np.ones_like(runs_per_sample)

    # Otherwise find the noise of each response separately, because the correlation of
    # two responses is unknown without replicates.
    if not set(names) <= set(noise_sd):
        _require_enough_samples(observed, names, has_enough_replicates)
    sources = {}
    variances = []
    for k, name in enumerate(names):
        if name in noise_sd:
            sources[name] = USER_GIVEN
            variance = noise_sd[name] ** 2
        else:
            sources[name] = ESTIMATED
            variance = estimate_nugget(
                observed.unit_points,
                observed.means[:, k],
                relative_variances=1.0 / runs_per_sample,
            )
        variances.append(variance)
    return Noise(np.diag(variances), sources)


def _require_enough_samples(
    observed: ObservedSamples, names: Sequence[str], has_enough_replicates: bool
) -> None:
    """Raise an error if the samples are too few to estimate the noise without replicates.

    The message names all three ways to determine the noise, which are described in
    `find_noise`.

    Parameters
    ----------
    observed : ObservedSamples
        The runs so far.
    names : sequence of str
        Names of the responses.
    has_enough_replicates : bool
        Whether the number of replicates is large enough. If so, the noise could not be
        estimated because their results are equal or proportional.

    Raises
    ------
    InputError
        If there are too few samples.
    """
    n_samples, n_parameters = observed.unit_points.shape
    min_samples = MIN_RUNS_PER_PARAMETER * n_parameters
    if n_samples >= min_samples:
        return

    value: object
    if has_enough_replicates:
        equal_responses = ", ".join(
            name
            for name, is_equal in zip(names, observed.equal_in_replicates, strict=True)
            if is_equal
        )
        key = "difference between the runs of a sample"
        # If no response is equal in all replicates, their covariance is singular.
        value = 0 if equal_responses else "proportional in several responses"
        needed = (
            f"results of {equal_responses or 'each response'} that differ between the "
            "runs of a sample: give each run different random numbers, and do not round "
            "the results"
        )
    else:
        key = "runs beyond the first of a sample"
        value = observed.degrees_of_freedom
        # `find_noise` requires more degrees of freedom than responses.
        needed = (
            f"at least {len(names) + 1}: replicates, rows with the same parameters, "
            "determine the noise"
        )
    raise InputError(
        source="runs",
        key=key,
        value=value,
        allowed=(
            f"{needed}; or targets.NAME.noise_sd for each response; or at least "
            f"{min_samples} samples, for an estimate of it"
        ),
    )


def estimate_nugget(
    unit_points: np.ndarray, means: np.ndarray, relative_variances: np.ndarray
) -> float:
    """Estimate the nugget, the variance of a single run about a smooth surface.

    The estimate is the mean over `NOISE_FRACTIONS`, weighted by their evidence (how
    probable the means are with this noise).

    Parameters
    ----------
    unit_points : array (n, d)
        Samples in the unit cube.
    means : array (n,)
        Their means of a response.
    relative_variances : array (n,)
        Variance of each mean divided by that of a single run: 1 / number of runs.
    """
    # A proposal and its answer need the same estimate, which takes minutes with many
    # runs. So it is cached.
    arrays = [
        np.ascontiguousarray(array, float)
        for array in (unit_points, means, relative_variances)
    ]
    return _estimate_cached_nugget(
        *(array.tobytes() for array in arrays), unit_points.shape[1]
    )


@lru_cache(maxsize=32)
def _estimate_cached_nugget(
    unit_points_bytes: bytes,
    means_bytes: bytes,
    relative_variances_bytes: bytes,
    d: int,
) -> float:
    """Compute the result of `estimate_nugget` from arrays that are passed as bytes.

    The cache needs hashable arguments. Bytes are hashable, unlike arrays.

    Parameters
    ----------
    unit_points_bytes, means_bytes, relative_variances_bytes : bytes
        The arrays of `estimate_nugget`, of 64-bit floats.
    d : int
        Number of parameters, the columns of `unit_points`.

    Returns
    -------
    float
        The nugget, which is the variance of a single run about the surface.
    """
    from repose.calibrate.surrogates.process import Process, make_smooth_kernel

    # `frombuffer` reads 64-bit floats, which `estimate_nugget` has written.
    unit_points = np.frombuffer(unit_points_bytes).reshape(-1, d)
    means = np.frombuffer(means_bytes)
    relative_variances = np.frombuffer(relative_variances_bytes)

    # Scale the means to variance 1, unless their differences are mere rounding errors.
    # A candidate, which is a fraction of this variance, is then a variance itself.
    rounding_error = ROUNDING_FRACTION * float(np.abs(means).max())
    scale = max(float(means.std()), rounding_error, MIN_SCALE)
    values = (means - means.mean()) / scale

    # Fit a smooth process for each candidate of the noise. The argument `errors` of a
    # process takes the variances of the means.
    kernel = make_smooth_kernel(
        1.0,
        np.ones(unit_points.shape[1]),
        (HYPERPARAMETER_BOUNDS, LENGTH_BOUNDS),
        SMOOTHNESS,
    )
    if len(unit_points) > MAX_EXACT_SAMPLES:
        log_evidence = _interpolate_evidence(
            kernel, unit_points, values, relative_variances
        )
        candidates = FINE_NOISE_FRACTIONS
    else:
        log_evidence = np.array(
            [
                Process(
                    kernel,
                    unit_points,
                    values,
                    noise_variances=noise_fraction * relative_variances,
                ).log_likelihood
                for noise_fraction in NOISE_FRACTIONS
            ]
        )
        candidates = NOISE_FRACTIONS

    # Weight the candidates by the evidence of the fits, and undo the scaling.
    # Subtracting the maximum avoids an overflow.
    weights = np.exp(log_evidence - log_evidence.max())
    return float(weights @ candidates / weights.sum()) * scale**2


def _interpolate_evidence(
    kernel: Any,
    unit_points: np.ndarray,
    values: np.ndarray,
    relative_variances: np.ndarray,
) -> np.ndarray:
    """Compute the log evidence of `FINE_NOISE_FRACTIONS`, for many samples.

    The evidence is the probability density of the samples, given the noise. Many
    samples can distinguish noise fractions that lie between the `NOISE_FRACTIONS`, so a
    spline interpolates the evidence between them. To save time, the variance and the
    lengths of the kernel are fitted to a subset of the samples, but the evidence is
    computed from all samples.

    Parameters
    ----------
    kernel : kernel of scikit-learn
        The covariance of the surface, with start values for its variance and lengths.
    unit_points : array (n, d)
        Samples in the unit cube.
    values : array (n,)
        Their means of a response, scaled to variance 1.
    relative_variances : array (n,)
        Variance of each mean divided by that of a single run: 1 / number of runs.

    Returns
    -------
    array
        The log evidence of each of `FINE_NOISE_FRACTIONS`.
    """
    from scipy.interpolate import CubicSpline

    from repose.calibrate.surrogates.process import Process

    rows = draw_subset(len(unit_points))
    log_evidence = []
    for noise_fraction in NOISE_FRACTIONS:
        noise_variances = noise_fraction * relative_variances
        # The fit to the subset finds variance and lengths. With these, the evidence of
        # all samples needs no further fit.
        fit = Process(
            kernel,
            unit_points[rows],
            values[rows],
            noise_variances=noise_variances[rows],
        )
        process = Process(
            fit.kernel,
            unit_points,
            values,
            noise_variances=noise_variances,
            optimizer=None,
        )
        log_evidence.append(process.log_likelihood)
    return CubicSpline(np.log(NOISE_FRACTIONS), log_evidence)(
        np.log(FINE_NOISE_FRACTIONS)
    )
