"""The parameter set of least expected loss: near the targets by the surrogate, and where the surrogate is sure.

The search (`repose.chain.invert`) asks for predictions on the targets. Thousands of sets have them, and the surrogate
is less sure of some. The expected square of the deviation from the aims is the square of the predicted deviation plus
the variance of the prediction, so its minimum weighs both.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from repose.chain.chance import PERCENT
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.probability import within
from repose.core.targets import Targets
from repose.search.objective import Preference
from repose.surrogate.base import Surrogate

CANDIDATES = 1024  # points of a Sobol sequence, a power of two
DESCENTS = 6  # from the best of them
STEP = 1e-4  # of the differences, in ranges
PRIOR = 1e-3  # a standard deviation from a prior costs as much as this relative deviation of every response


def expected_loss(surrogate: Surrogate, X: np.ndarray, targets: Targets) -> np.ndarray:
    """Expected mean square of the relative deviations from the aims.

    Parameters
    ----------
    surrogate : Surrogate
        With the errors of its predictions.
    X : numpy.ndarray, (n, d)
        Parameter sets.
    targets : Targets
        Deviations count by their weights.

    Returns
    -------
    numpy.ndarray, (n,)
    """
    variance = np.diagonal(surrogate.covariance(X), axis1=1, axis2=2)
    square = ((surrogate.predict(X) - targets.aim) ** 2 + variance) / targets.aim**2
    return square @ targets.weight / targets.weight.sum()


def least(surrogate: Surrogate, space: ParameterSpace, targets: Targets) -> dict[str, Any]:
    """The parameter set of least expected loss.

    Parameters
    ----------
    surrogate : Surrogate
        With the errors of its predictions.
    space : ParameterSpace
        Fixed parameters keep their values. Of sets that are equally good, those near the means of priors come first.
    targets : Targets

    Returns
    -------
    dict
        The six parameters, the predicted responses, and what `judged` gives.
    """

    preference = Preference.of(space)

    def loss(unit):
        expected = expected_loss(surrogate, space.values(unit), targets)
        return expected if preference is None else expected + (PRIOR * preference.distance(2 * unit - 1)) ** 2

    def with_gradient(place):
        steps = STEP * np.eye(len(place))
        near = loss(np.concatenate([place[None], place + steps, place - steps]))
        forth, back = np.split(near[1:], 2)
        return near[0], (forth - back) / (2 * STEP)

    points = qmc.Sobol(space.dimensions, scramble=False).random(CANDIDATES)
    first = points[np.argsort(loss(points))[:DESCENTS]]
    # differences reach a step beyond the place
    bounds = [(STEP, 1 - STEP)] * space.dimensions
    ends = [minimize(with_gradient, place, jac=True, method="L-BFGS-B", bounds=bounds) for place in first]
    best = min(ends, key=lambda end: end.fun)
    X = space.values(best.x[None])
    found = dict(zip(PARAMETERS, X[0].tolist(), strict=True))
    predicted = dict(zip(targets.predicted, surrogate.predict(X)[0].tolist(), strict=True))
    return found | predicted | judged(surrogate, found, targets)


def judged(surrogate: Surrogate, parameters: Mapping[str, float], targets: Targets) -> dict[str, Any]:
    """What the surrogate says of a parameter set.

    Parameters
    ----------
    surrogate : Surrogate
        With the errors of its predictions.
    parameters : mapping
        The six parameters.
    targets : Targets

    Returns
    -------
    dict
        `predicted_se`, standard errors of the predicted means by the name of the response; `expected_error_percent`,
        the root of the expected loss; `within`, the probability that all means lie within so many percent of the aims.
    """
    X = np.array([[parameters[name] for name in PARAMETERS]])
    mean, covariance, aim = surrogate.predict(X), surrogate.covariance(X), targets.aim
    error, reach = np.sqrt(np.diagonal(covariance[0])), np.abs(aim) / 100
    chances = {
        f"{one:g} %": within(mean, covariance, aim - one * reach, aim + one * reach) for one in PERCENT
    }
    return {
        "predicted_se": dict(zip(targets.names, error.tolist(), strict=True)),
        "expected_error_percent": float(100 * np.sqrt(expected_loss(surrogate, X, targets)[0])),
        "within": {key: float(chance[0]) for key, chance in chances.items()},
    }
