"""The parameter set of least expected loss: predicted near the targets, where the error of the surrogate is small.

The search (`repose.calibrate.inversion`) takes the least Eq. 11 of the predictions. Thousands of sets have it, and the
errors of the surrogate differ among them. The loss is Eq. 11 of the true means; its expectation weighs the predicted
deviations and their errors.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import erf

from repose.calibrate.chance import PERCENT
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import within
from repose.calibrate.search.objective import Preference
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets

CANDIDATES = 1024  # points of a Sobol sequence, a power of two
DESCENTS = 6  # from the best of them
STEP = 1e-4  # of the differences, in ranges
TINY = 1e-12  # least error of a prediction, so that one can divide by it


def expected_loss(surrogate: Surrogate, X: np.ndarray, targets: Targets) -> np.ndarray:
    """Compute the expected Eq. 11 (n,) at parameter sets X (n, d), for true means normal about their predictions."""
    error = np.sqrt(np.diagonal(surrogate.covariance(X), axis1=1, axis2=2))
    off = surrogate.predict(X) - targets.aim
    z = np.abs(off) / np.maximum(error, TINY)
    # the mean of a folded normal
    size = error * np.sqrt(2 / np.pi) * np.exp(-0.5 * z**2) + np.abs(off) * erf(
        z / np.sqrt(2)
    )
    return size @ (targets.weight / (targets.high - targets.low))


def least(
    surrogate: Surrogate, space: ParameterSpace, targets: Targets
) -> dict[str, Any]:
    """Find the parameter set of least expected loss, with the entries of `judged`; of equals the nearest to priors."""
    from scipy.optimize import minimize
    from scipy.stats import qmc

    preference = Preference.of(space)

    def loss(unit: np.ndarray) -> np.ndarray:
        expected = expected_loss(surrogate, space.values(unit), targets)
        return expected if preference is None else expected + preference(2 * unit - 1)

    def with_gradient(place: np.ndarray) -> tuple[float, np.ndarray]:
        steps = STEP * np.eye(len(place))
        near = loss(np.concatenate([place[None], place + steps, place - steps]))
        forth, back = np.split(near[1:], 2)
        return near[0], (forth - back) / (2 * STEP)

    points = qmc.Sobol(space.dimensions, scramble=False).random(CANDIDATES)
    first = points[np.argsort(loss(points))[:DESCENTS]]
    # differences reach a step beyond the place
    bounds = [(STEP, 1 - STEP)] * space.dimensions
    ends = [
        minimize(with_gradient, place, jac=True, method="L-BFGS-B", bounds=bounds)
        for place in first
    ]
    X = space.values(min(ends, key=lambda end: end.fun).x[None])
    values = dict(zip(space.names, X[0].tolist(), strict=True))
    predicted = dict(
        zip(targets.predicted, surrogate.predict(X)[0].tolist(), strict=True)
    )
    return values | predicted | judged(surrogate, values, targets, space.names)


def judged(
    surrogate: Surrogate,
    parameters: Mapping[str, float],
    targets: Targets,
    names: Sequence[str],
) -> dict[str, Any]:
    """Judge a parameter set by the errors and probabilities of the surrogate.

    Parameters
    ----------
    surrogate : Surrogate
    parameters : mapping
        The set by name.
    targets : Targets
    names : sequence of str
        Inputs of a surrogate that does not name them itself.

    Returns
    -------
    dict
        ``predicted_se``: standard errors of the predicted means by response;
        ``expected_error_percent``: root of the expected mean square of the relative
        deviations; ``within``: probability that all means lie within some percent of
        the aims.
    """
    X = np.array([[parameters[name] for name in surrogate.inputs or names]])
    mean, covariance, aim = surrogate.predict(X), surrogate.covariance(X), targets.aim
    error, reach = np.sqrt(np.diagonal(covariance[0])), targets.whole / 100
    square = ((mean[0] - aim) ** 2 + error**2) / targets.whole**2
    return {
        "predicted_se": dict(zip(targets.names, error.tolist(), strict=True)),
        "expected_error_percent": float(
            100 * np.sqrt(np.average(square, weights=targets.weight))
        ),
        "within": {
            f"{percent:g} %": float(
                within(mean, covariance, aim - percent * reach, aim + percent * reach)[
                    0
                ]
            )
            for percent in PERCENT
        },
    }
