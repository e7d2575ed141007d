"""Points for further runs: where the fit of the first runs may meet the targets.

The first stage samples the whole ranges, so most of its runs are far from the targets.
Near the targets the errors of the fit decide which point seems to meet the targets. The
second stage therefore runs the simulator at many such points, once at each. The next
fit then learns the level of the whole region, and no point is chosen because of its
noise.
"""

import numpy as np

from repose.calibrate.designs.allowed import take_allowed_points
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.search.objective import Objective
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets

# Points of the Sobol sequence that are predicted. A power of two is spread most evenly.
N_CANDIDATES = 32768
# Number of points with the smallest objective (Eq. 11), whose errors are computed. No
# more points can be drawn, see `MAX_POURS` in `repose.calibrate.strategies.refined`.
N_NEAREST = 4096
# Number of points that are predicted at once. It must divide `N_CANDIDATES`.
CHUNK_SIZE = 4096
# Largest additional weight of a point for its nearness to the targets. It is far below
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
    """Draw points at random, weighted by the probability that they meet the targets.

    A point is a parameter set in the unit cube. It meets the targets if its true mean
    responses lie within the tolerance of all targets. The probability follows from the
    predictions and their errors. No point is drawn twice.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate with error estimates.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    count : int
        Number of points, at most `N_NEAREST`.
    tolerance_percent : float
        The tolerance, in percent of each target.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    numpy.ndarray, (count, d)
        Points of the unit cube, the nearest to the targets first.
    """
    from scipy.stats import qmc

    # Choose the points nearest to the targets by their predictions, which are fast to
    # compute.
    sequence = qmc.Sobol(space.dimensions, scramble=False)
    unit_points = take_allowed_points(
        sequence, N_CANDIDATES, space, follows_prior=False
    )
    predictions = [
        surrogate.predict(space.values(part))
        for part in np.split(unit_points, N_CANDIDATES // CHUNK_SIZE)
    ]
    deviations, _ = Objective(targets)(np.concatenate(predictions))
    nearest = unit_points[np.argsort(deviations, kind="stable")[:N_NEAREST]]

    # Compute the probability of these points from the errors of the predictions.
    # `whole` is the number that counts as 100 % of each target, and `aim` the target.
    parameter_sets = space.values(nearest)
    tolerance = tolerance_percent * (targets.whole / 100)
    probability = compute_box_probability(
        surrogate.predict(parameter_sets),
        surrogate.covariance(parameter_sets),
        targets.aim - tolerance,
        targets.aim + tolerance,
    )

    # Draw points by their probabilities. If the targets are out of reach, all
    # probabilities are about 0. So add a small weight that prefers points near the
    # targets: `nearness` is 1 for the nearest point, and falls evenly to almost 0 for
    # the last one. The smallest positive float keeps every weight above 0.
    nearness = np.arange(len(nearest), 0, -1) / len(nearest)
    weight = probability + np.finfo(float).tiny + NEARNESS_WEIGHT * nearness
    rows = random.choice(len(nearest), count, replace=False, p=weight / weight.sum())
    return nearest[np.sort(rows)]
