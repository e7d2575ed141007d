"""A surrogate whose answers are known in closed form."""

import copy

import numpy as np

from repose.bench.parameters import PARAMETERS


class Linear:
    """Responses constant + X slopes, with the same error of prediction everywhere.

    slopes: for each response a mapping from parameter to slope. Each response is 30 in the middle of the unit cube.
    """

    name = "linear"

    def __init__(self, outputs, slopes, error=0.0):
        self.outputs = tuple(outputs)
        self.error = error
        self.slopes = np.array(
            [[slope.get(name, 0.0) for slope in slopes] for name in PARAMETERS]
        )
        self.constant = 30.0 - self.slopes.sum(axis=0) / 2

    def predict(self, X, return_std=False, noise=True):
        Y = self.constant + X @ self.slopes
        return (Y, np.full(Y.shape, self.error)) if return_std else Y

    def covariance(self, X):
        return np.broadcast_to(
            self.error**2 * np.eye(len(self.outputs)),
            (len(X), *2 * (len(self.outputs),)),
        )

    def moments(self, X):
        return self.predict(X), self.covariance(X)

    def shifted(self, offset):
        moved = copy.copy(self)
        moved.constant = self.constant + offset
        return moved
