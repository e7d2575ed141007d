"""Find the parameter set of least expected loss, given the errors of a surrogate.

The search (`repose.calibrate.inversion`) minimises Eq. 11 of the predicted responses.
Thousands of sets reach the same minimum, but the errors of the surrogate differ among
them. The loss is Eq. 11 of the true mean responses. Its expectation is small where the
prediction is near the targets and the error of the surrogate is also small.

Eq. 11 divides the deviation from the aim by the width of the target's range. Otherwise
the range has no influence, so the set of least expected loss may be infeasible.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import erf

from repose.calibrate.chance import REPORTED_PERCENTS
from repose.calibrate.designs.allowed import take_allowed_points
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.search.objective import Preference
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets

# Points of the Sobol sequence that are compared. A power of two keeps it balanced.
N_CANDIDATES = 1024
# Number of the best candidates from which a local search starts.
N_DESCENTS = 6
# Step of the finite differences, as a fraction of each parameter's range. It is far
# above the rounding errors of the loss.
DIFFERENCE_STEP = 1e-4
# Distance that a local search keeps from a constraint, as a fraction of the largest
# value, because the search satisfies constraints only approximately.
CONSTRAINT_MARGIN = 1e-6
# Smallest standard error by which a deviation is divided, to avoid a division by 0.
MIN_ERROR = 1e-12

Loss = Callable[[np.ndarray], np.ndarray]
"""Function of points (n, d) of the unit cube that returns losses (n,)."""


def compute_expected_loss(
    surrogate: Surrogate, X: np.ndarray, targets: Targets
) -> np.ndarray:
    """Compute the expected deviation of parameter sets from the targets (Eq. 11).

    The result is the weighted sum of the absolute deviations of the responses. Each
    deviation is divided by the width of the target's range. The true mean of a response
    is assumed to be normally distributed about its prediction, so its absolute
    deviation from the target has a folded normal distribution.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate whose `can_predict_errors` is True.
    X : numpy.ndarray, (n, d)
        Parameter sets.
    targets : Targets
        The targets of the study.

    Returns
    -------
    numpy.ndarray, (n,)
        The expected loss of each parameter set.
    """
    variance = np.diagonal(surrogate.covariance(X), axis1=1, axis2=2)
    error = np.sqrt(variance)
    deviation = surrogate.predict(X) - targets.aim
    z = np.abs(deviation) / np.maximum(error, MIN_ERROR)
    # The mean of the folded normal distribution, for each response.
    density_term = error * np.sqrt(2 / np.pi) * np.exp(-0.5 * z**2)
    mean_deviation = density_term + np.abs(deviation) * erf(z / np.sqrt(2))
    return mean_deviation @ (targets.weight / (targets.high - targets.low))


def minimise_expected_loss(
    surrogate: Surrogate, space: ParameterSpace, targets: Targets
) -> dict[str, Any]:
    """Find the parameter set with the smallest expected loss.

    Among sets of equal loss, the set nearest to the means of the priors is chosen.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate whose `can_predict_errors` is True.
    space : ParameterSpace
        Ranges, priors and constraints of the parameters.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        The parameters and the predicted responses by name, and the entries of
        `assess_by_errors`.
    """
    best_point = _minimise(_make_loss(surrogate, space, targets), space)
    # These functions take tables, so make a table with a single row.
    X = space.values(best_point[None])
    parameters = dict(zip(space.names, X[0].tolist(), strict=True))
    responses = surrogate.predict(X)[0].tolist()
    predicted = dict(zip(targets.predicted, responses, strict=True))
    assessment = assess_by_errors(surrogate, parameters, targets, space.names)
    return parameters | predicted | assessment


def _minimise(loss: Loss, space: ParameterSpace) -> np.ndarray:
    """Find the allowed point with the smallest loss, by local searches.

    The searches start from the best points of a space-filling sequence.

    Parameters
    ----------
    loss : callable
        Function of points (n, d) of the unit cube that returns losses (n,).
    space : ParameterSpace
        The parameters with their constraints.

    Returns
    -------
    numpy.ndarray, (d,)
        A point of the unit cube.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    # Choose the starts.
    sequence = qmc.Sobol(space.dimensions, scramble=False)
    candidates = take_allowed_points(sequence, N_CANDIDATES, space, follows_prior=False)
    starts = candidates[np.argsort(loss(candidates))[:N_DESCENTS]]
    # Leave room for the steps of finite differences at both bounds.
    bounds = [(DIFFERENCE_STEP, 1 - DIFFERENCE_STEP)] * space.dimensions
    # Without constraints, use L-BFGS-B: the published results were computed with it, so
    # another method would change them. It cannot treat constraints; SLSQP can.
    method = "L-BFGS-B"
    constraints = []
    if space.constraints:
        method = "SLSQP"
        # An inequality of SciPy is obeyed where its function is 0 or more, so negate
        # the excesses.
        obeys_constraints = {
            "type": "ineq",
            "fun": lambda point: -_compute_excesses(space, point),
        }
        constraints = [obeys_constraints]
    minima = [
        minimize(
            _compute_loss_and_gradient,
            start,
            args=(loss,),
            jac=True,  # the function also returns the gradient
            bounds=bounds,
            method=method,
            constraints=constraints,
        )
        for start in starts
    ]
    points = np.array([minimum.x for minimum in minima])
    losses = np.array([minimum.fun for minimum in minima])

    # A local search may violate a constraint by its tolerance, so give such points an
    # infinite loss. In case all points violate one, add the starts, which are allowed.
    if space.constraints:
        points = np.vstack([points, starts])
        losses = np.concatenate([losses, loss(starts)])
        losses = np.where(space.is_allowed(points), losses, np.inf)
    return points[losses.argmin()]


def _compute_excesses(space: ParameterSpace, point: np.ndarray) -> np.ndarray:
    """Compute by how much a point (d,) violates each constraint, plus a margin.

    With the margin, a local search ends inside the allowed region.
    """
    values = space.values(point[None])
    excesses = [
        constraint.compute_excess(values, space.names)[0]
        for constraint in space.constraints
    ]
    return np.array(excesses) + CONSTRAINT_MARGIN * np.abs(values).max()


def _make_loss(surrogate: Surrogate, space: ParameterSpace, targets: Targets) -> Loss:
    """Make the function to minimise.

    It is the expected loss, plus a cost that increases with the distance from the means
    of the priors (`Preference`).

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate whose `can_predict_errors` is True.
    space : ParameterSpace
        The parameters with their priors.
    targets : Targets
        The targets of the study.

    Returns
    -------
    callable
        Function of points (n, d) of the unit cube, from 0 to 1, that returns the loss
        (n,) of each.
    """
    preference = Preference.from_priors(space)

    def loss(unit: np.ndarray) -> np.ndarray:
        expected = compute_expected_loss(surrogate, space.values(unit), targets)
        if preference is None:
            return expected
        # The preference takes points in [-1, 1].
        return expected + preference(2 * unit - 1)

    return loss


def _compute_loss_and_gradient(
    point: np.ndarray, loss: Loss
) -> tuple[float, np.ndarray]:
    """Return the loss at a point (d,) and its gradient by central differences."""
    steps = DIFFERENCE_STEP * np.eye(len(point))
    # Evaluate the point and its 2 d neighbours in one call.
    losses = loss(np.concatenate([point[None], point + steps, point - steps]))
    upper, lower = np.split(losses[1:], 2)
    return losses[0], (upper - lower) / (2 * DIFFERENCE_STEP)


def assess_by_errors(
    surrogate: Surrogate,
    parameters: Mapping[str, float],
    targets: Targets,
    names: Sequence[str],
) -> dict[str, Any]:
    """Assess a parameter set by its prediction and the error of the prediction.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate whose `can_predict_errors` is True.
    parameters : mapping
        The parameter set by name.
    targets : Targets
        The targets of the study.
    names : sequence of str
        Names of the inputs, if the surrogate does not name them itself.

    Returns
    -------
    dict
        ``predicted_se`` has the standard error of the predicted mean of each response.
        ``expected_error_percent`` is the root of the expected mean square of the
        relative deviations from the aims, the target values. ``within`` has a
        probability for each tolerance in `REPORTED_PERCENTS`: that all means lie no
        farther from their aims than this percentage.
    """
    inputs = surrogate.inputs or names
    X = np.array([[parameters[name] for name in inputs]])
    mean = surrogate.predict(X)
    covariance = surrogate.covariance(X)
    error = np.sqrt(np.diagonal(covariance[0]))
    aim = targets.aim

    # The expected squared deviation of a response is the squared deviation of its
    # prediction plus the variance of the error of the prediction. `targets.whole` has
    # the number that counts as 100 % of each aim.
    squares = ((mean[0] - aim) ** 2 + error**2) / targets.whole**2
    mean_square = np.average(squares, weights=targets.weight)

    one_percent = targets.whole / 100
    probabilities = {}
    for percent in REPORTED_PERCENTS:
        tolerance = percent * one_percent
        probability = compute_box_probability(
            mean, covariance, aim - tolerance, aim + tolerance
        )
        probabilities[f"{percent:g} %"] = float(probability[0])
    return {
        "predicted_se": dict(zip(targets.names, error.tolist(), strict=True)),
        "expected_error_percent": float(100 * np.sqrt(mean_square)),
        "within": probabilities,
    }
