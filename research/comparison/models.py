"""Surrogates on equal terms: each takes points with their runs and returns a function of parameters.

Each fit uses all runs of the points: a model takes samples for its own validation from these. A model also takes the
section `network` of the configuration and a seed for its starts, trees or held-back samples.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from repose.calibrate.surrogates import Surrogate, make
from repose.calibrate.surrogates.quadratic import QuadraticSurface
from repose.calibrate.surrogates.settings import NetworkSettings
from research.comparison.early_stopping import EarlyStoppingBP
from research.comparison.points import Points

Settings = Mapping[str, Any]
"""The section `network` of the configuration."""
Predict = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray | None]]
"""From parameters (n, d) to the mean (n, k) and its standard deviation (n, k), None where the model has none."""

TREES = 300
ROUNDS = 300  # of boosting
PUBLISHED = {"surrogate": "network", "prior": "one", "goal": 1e-4, "replicates": False}


def configured_network(points: Points, settings: Settings, seed: int) -> Predict:
    """Train the network as the main chain does, with the noise from the points' own runs."""
    kind = (
        "network_ensemble"
        if settings.get("surrogate") == "network_ensemble"
        else "network"
    )
    noise = points.replicates() if settings["replicates"] else {}
    network = make(kind, NetworkSettings.from_keys({**settings, "seed": seed}))
    return _of_the_mean(network.fit(points.X, points.means(), **noise))


def best_network(points: Points, settings: Settings, seed: int) -> Predict | None:
    """Take the best network of an ensemble's starts alone; None if the configured network is no ensemble."""
    if settings.get("surrogate") != "network_ensemble":
        return None
    return configured_network(points, {**settings, "surrogate": "network"}, seed)


def published_network(points: Points, settings: Settings, seed: int) -> Predict:
    """Train the same network with the published prior and goal, its samples weighed alike, its outputs independent.

    Section 3.2.2 of the paper.
    """
    return configured_network(points, {**settings, **PUBLISHED}, seed)


def unregularised_network(points: Points, settings: Settings, seed: int) -> Predict:
    """Train a network of the same shape without regularisation, `EarlyStoppingBP`; no standard deviation."""
    train, validation, _ = settings["split"]
    network = EarlyStoppingBP(
        hidden=settings["hidden"],
        epochs=settings["epochs"],
        starts=settings["starts"],
        held_back=(validation or 0.15) / (train + (validation or 0.15)),
        seed=seed,
    ).fit(points.X, points.means())
    return lambda X: (network.predict(X), None)


def quadratic_surface(points: Points, settings: Settings, seed: int) -> Predict | None:
    """Fit the surrogate `quadratic`; None with too few points for its terms."""
    varying = np.count_nonzero(np.ptp(points.X, axis=0))
    if len(points.X) < QuadraticSurface.least_samples(int(varying)):
        return None
    return _of_the_mean(QuadraticSurface().fit(points.X, points.means()))


def gaussian_process(points: Points, settings: Settings, seed: int) -> Predict:
    """Fit the surrogate `gaussian_process`, one process for each response."""
    return _of_the_mean(make("gaussian_process").fit(points.X, points.means()))


def random_forest(points: Points, settings: Settings, seed: int) -> Predict:
    """Random forest of `TREES` trees; no standard deviation."""
    from sklearn.ensemble import RandomForestRegressor

    forest = RandomForestRegressor(
        TREES, min_samples_leaf=2, max_features=0.5, random_state=seed
    )
    means = points.means()
    forest.fit(points.X, means if means.shape[1] > 1 else means[:, 0])
    return lambda X: (forest.predict(X).reshape(len(X), -1), None)


def gradient_boosting(points: Points, settings: Settings, seed: int) -> Predict:
    """Gradient boosting with `ROUNDS` trees of depth 3 for each response; no standard deviation."""
    from sklearn.ensemble import GradientBoostingRegressor

    boosts = [
        GradientBoostingRegressor(
            n_estimators=ROUNDS,
            learning_rate=0.05,
            max_depth=3,
            subsample=0.5,
            random_state=seed,
        ).fit(points.X, y)
        for y in points.means().T
    ]
    return lambda X: (np.column_stack([boost.predict(X) for boost in boosts]), None)


MODELS: dict[str, Callable[[Points, Settings, int], Predict | None]] = {
    "network": configured_network,
    "network, best start alone": best_network,
    "network, published prior": published_network,
    "network, unregularised": unregularised_network,
    "quadratic surface": quadratic_surface,
    "Gaussian process": gaussian_process,
    "random forest": random_forest,
    "gradient boosting": gradient_boosting,
}


def _of_the_mean(surrogate: Surrogate) -> Predict:
    """Prediction of a fitted surrogate with the errors of its mean."""
    return lambda X: surrogate.predict(X, return_std=True, noise=False)
