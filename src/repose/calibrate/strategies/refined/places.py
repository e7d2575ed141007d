"""Places for further runs: where the fit of the first runs may meet the targets.

The first stage samples the whole ranges, so most of its runs are far from the targets.
Near the targets the errors of the fit decide which place seems to meet the targets. The
second stage therefore runs the simulator at many such places, once at each. The next
fit then learns the level of the whole region, and no place is chosen because of its
noise.
"""

import numpy as np

from repose.calibrate.designs.allowed import take_allowed_points
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.search.objective import Objective
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets

# Points of the Sobol sequence that are predicted; a power of two.
N_CANDIDATES = 32768
# Number of points with the smallest objective (Eq. 11), whose errors are computed.
N_NEAREST = 4096
# Number of points that are predicted at once.
CHUNK_SIZE = 4096
# Largest additional weight of a place for its nearness to the targets. It is far below
# any probability that matters.
NEARNESS_WEIGHT = 1e-12


def draw_near_targets(
    surrogate: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    *,
    count: int,
    tolerance_percent: float,
    random: np.random.Generator,
) -> np.ndarray:
    """Draw places at random, weighted by the probability that they meet the targets.

    A place is a parameter set. It meets the targets if its true mean responses lie
    within the tolerance of all targets. The probability follows from the predictions
    and their errors. No place is drawn twice.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate with error estimates.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    count : int
        Number of places, at most `N_NEAREST`.
    tolerance_percent : float
        The tolerance, in percent of each target.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    numpy.ndarray, (count, d)
        The places as points of the unit cube, the nearest to the targets first.
    """
    from scipy.stats import qmc

    # Choose the places nearest to the targets by their predictions, which are fast to
    # compute.
    sequence = qmc.Sobol(space.dimensions, scramble=False)
    unit = take_allowed_points(sequence, N_CANDIDATES, space, follows_prior=False)
    predictions = [
        surrogate.predict(space.values(part))
        for part in np.split(unit, N_CANDIDATES // CHUNK_SIZE)
    ]
    deviations, _ = Objective(targets)(np.concatenate(predictions))
    nearest = unit[np.argsort(deviations, kind="stable")[:N_NEAREST]]

    # Compute the probability of these places from the errors of the predictions.
    parameter_sets = space.values(nearest)
    tolerance = tolerance_percent * (targets.whole / 100)
    probability = compute_box_probability(
        surrogate.predict(parameter_sets),
        surrogate.covariance(parameter_sets),
        targets.aim - tolerance,
        targets.aim + tolerance,
    )

    # Draw places by their probabilities. If the targets are out of reach, all
    # probabilities are about 0. Then a small additional weight decides, which falls
    # from the nearest place to the last one. The smallest positive float keeps every
    # weight above 0.
    nearness = np.arange(len(nearest), 0, -1) / len(nearest)
    weight = probability + np.finfo(float).tiny + NEARNESS_WEIGHT * nearness
    rows = random.choice(len(nearest), count, replace=False, p=weight / weight.sum())
    return nearest[np.sort(rows)]
