"""Surrogates on equal terms: each takes points with their runs and gives a function of parameters.

Every fit takes (points, settings, seed), with settings the configuration's section `network`, and returns
predict(X) -> mean (n, 2) and the standard deviation of that mean (n, 2), None where the model has none.
All runs of the points are used: what a model wants to hold back, it holds back from these.

Sources
  (MM09)  Myers, Montgomery & Anderson-Cook 2009, Response Surface Methodology: second-order model, least squares
  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, Algorithm 2.1; one length an input
"""

import warnings

import numpy as np

from repose.chain.train import precisions
from repose.studies.comparison.early_stopping import EarlyStoppingBP
from repose.surrogate.bayesian_bp import PlainBayesianBP
from repose.surrogate.support import quadratic_terms

TREES = 300
ROUNDS = 300  # of boosting
PUBLISHED = {"prior": "one", "goal": 1e-4, "weights_from_errors": False, "correlated_noise": False}


def configured_network(points, settings, seed):
    """The network as the main chain trains it, with the noise that the points' own runs show."""
    covariance = points.covariance() if settings["correlated_noise"] else None
    errors, precision = points.errors(), None
    if settings["weights_from_errors"] and np.isfinite(errors).any() and points.counts().max() >= 4:
        precision = precisions(errors, covariance is not None)
    network = PlainBayesianBP(
        **{key: settings[key] for key in ("hidden", "epochs", "goal", "starts", "prior")}, seed=seed
    )
    network.fit(points.X, points.means(), precision=precision, noise_covariance=covariance)
    return lambda X: network.predict(X, return_std=True, noise=False)


def published_network(points, settings, seed):
    """The same network with the published prior and goal, its samples weighed alike, its outputs independent."""
    return configured_network(points, settings | PUBLISHED, seed)


def unregularised_network(points, settings, seed):
    """Plain least squares with early stopping, `early_stopping.EarlyStoppingBP`."""
    train, validation, _ = settings["split"]
    network = EarlyStoppingBP(
        hidden=settings["hidden"],
        epochs=settings["epochs"],
        starts=settings["starts"],
        held_back=(validation or 0.15) / (train + (validation or 0.15)),
        seed=seed,
    ).fit(points.X, points.means())
    return lambda X: (network.predict(X), None)


def quadratic_surface(points, settings, seed):
    """Second-order response surface by least squares (MM09); None with no more points than its 28 terms."""
    low, width = _box(points.X)
    A = quadratic_terms((points.X - low) / width)
    freedom = len(A) - A.shape[1]
    if freedom < 1:
        return None
    Y = points.means()
    coefficients, *_ = np.linalg.lstsq(A, Y, rcond=None)
    variance = ((Y - A @ coefficients) ** 2).sum(axis=0) / freedom
    root = np.linalg.pinv(A)

    def predict(X):
        a = quadratic_terms((X - low) / width)
        leverage = ((a @ root) ** 2).sum(axis=1)
        return a @ coefficients, np.sqrt(leverage[:, None] * variance)

    return predict


def gaussian_process(points, settings, seed):
    """One process a response (RW06): squared exponential with a length for each input, and noise."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    low, width = _box(points.X)
    processes = []
    for y in points.means().T:
        kernel = ConstantKernel(1.0, (1e-2, 1e3)) * RBF(np.ones(len(low)), (0.05, 100.0)) + WhiteKernel(0.1)
        process = GaussianProcessRegressor(kernel, normalize_y=True)
        with warnings.catch_warnings():  # a length at its bound is an input without effect
            warnings.simplefilter("ignore", ConvergenceWarning)
            processes.append(process.fit((points.X - low) / width, y))

    def predict(X):
        x = (X - low) / width
        means, stds = zip(*(process.predict(x, return_std=True) for process in processes), strict=True)
        # scikit-learn adds the noise to the variance; the mean's own is wanted
        noise = [p.kernel_.k2.noise_level * p._y_train_std**2 for p in processes]
        variance = np.column_stack(stds) ** 2 - np.array(noise)
        return np.column_stack(means), np.sqrt(np.maximum(variance, 0.0))

    return predict


def random_forest(points, settings, seed):
    """Random forest of TREES trees."""
    from sklearn.ensemble import RandomForestRegressor

    forest = RandomForestRegressor(TREES, min_samples_leaf=2, max_features=0.5, random_state=seed)
    forest.fit(points.X, points.means())
    return lambda X: (forest.predict(X), None)


def gradient_boosting(points, settings, seed):
    """Gradient boosting, ROUNDS trees of depth 3 a response."""
    from sklearn.ensemble import GradientBoostingRegressor

    boosts = [
        GradientBoostingRegressor(
            n_estimators=ROUNDS, learning_rate=0.05, max_depth=3, subsample=0.5, random_state=seed
        ).fit(points.X, y)
        for y in points.means().T
    ]
    return lambda X: (np.column_stack([boost.predict(X) for boost in boosts]), None)


MODELS = {
    "network": configured_network,
    "network, published prior": published_network,
    "network, unregularised": unregularised_network,
    "quadratic surface": quadratic_surface,
    "Gaussian process": gaussian_process,
    "random forest": random_forest,
    "gradient boosting": gradient_boosting,
}


def _box(X):
    """Lower end and width of each column."""
    low = X.min(axis=0)
    width = X.max(axis=0) - low
    return low, np.where(width > 0, width, 1.0)
