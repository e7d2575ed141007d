"""Kernel of independent noise whose variance differs from sample to sample."""

import numpy as np
from sklearn.gaussian_process.kernels import WhiteKernel


class SampleNoise(WhiteKernel):
    """Noise of variance noise_level / precision_i for sample i of the training data, noise_level for a new sample."""

    def __init__(self, noise_level=1.0, noise_level_bounds=(1e-5, 1e5), precision=()):
        super().__init__(noise_level, noise_level_bounds)
        self.precision = precision

    def __call__(self, X, Y=None, eval_gradient=False):
        """Covariance of the noise: between the training samples X, or zeros between X and other points Y."""
        if Y is not None:
            return np.zeros((len(X), len(Y)))
        K = np.diag(self.noise_level / np.asarray(self.precision))
        return (K, K[:, :, np.newaxis]) if eval_gradient else K
