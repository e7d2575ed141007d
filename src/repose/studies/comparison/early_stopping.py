"""The same network without regularisation: least squares by Levenberg-Marquardt, stopped early.

Part of the samples is held back; training ends when the error on these has not fallen for some epochs, and the
weights of its minimum are kept. It is what a network of the same shape does where nothing is Bayesian.
"""

import numpy as np

from repose.surrogate.bayesian_bp import BayesianBP
from repose.surrogate.levenberg_marquardt import linearise, residuals
from repose.surrogate.two_layer import nguyen_widrow, scale, unpack


class EarlyStoppingBP:
    """Two-layer network of `hidden` neurons; of `starts` trainings the one of least held-back error is kept.

    held_back: share of the samples that stop the training (0.15 / 0.85 of what is not for testing, as published);
    patience: epochs without a lower error on them before training ends, six as in MATLAB's trainlm.
    """

    def __init__(self, hidden=12, epochs=1500, starts=5, held_back=0.15 / 0.85, patience=6, seed=2026):
        self.hidden, self.epochs, self.starts = hidden, epochs, starts
        self.held_back, self.patience, self.seed = held_back, patience, seed

    def fit(self, X, Y):
        """Train on X (samples, inputs) and Y (samples, outputs), four samples or more; return self."""
        if len(X) < 4:
            raise ValueError(f"{len(X)} samples; allowed: at least 4")
        shape = self.network = BayesianBP(hidden=self.hidden)
        shape.input_min_, shape.input_max_ = X.min(axis=0), X.max(axis=0)
        shape.output_min_, shape.output_max_ = Y.min(axis=0), Y.max(axis=0)
        x = scale(X, shape.input_min_, shape.input_max_, shape.scaled_range)
        t = scale(Y, shape.output_min_, shape.output_max_, shape.scaled_range)
        order = np.random.default_rng(self.seed).permutation(len(x))
        held, used = np.split(order, [max(1, round(self.held_back * len(x)))])
        ends = []
        for k in range(self.starts):
            w = nguyen_widrow(x.shape[1], self.hidden, t.shape[1], shape.scaled_range, (self.seed, k))
            ends.append(self._train(w, (x[used], t[used]), (x[held], t[held])))
        w, self.held_back_error_, self.epochs_ = min(ends, key=lambda end: end[1])
        shape.W1_, shape.b1_, shape.W2_, shape.b2_ = unpack(w, x.shape[1], self.hidden, t.shape[1])
        shape.one_output_ = False
        return self

    def predict(self, X):
        """Responses (samples, outputs)."""
        return self.network.predict(X)

    def _train(self, w, used, held, mu=0.005, mu_max=1e10):
        """One start: (weights of least held-back error, that error, epochs)."""
        one = np.ones((1, used[1].shape[1]))
        e, J = linearise(w, *used, one)
        square, best, best_error, waited, epoch = e @ e, w, _mean_square(w, held, one), 0, 0
        while epoch < self.epochs and waited < self.patience:
            JJ, gradient = J.T @ J, J.T @ e
            while mu <= mu_max:
                candidate = w - np.linalg.solve(JJ + mu * np.eye(w.size), gradient)
                e = residuals(candidate, *used, one)
                if e @ e < square:
                    break
                mu *= 10
            else:
                break
            mu = max(0.1 * mu, 1e-12)
            w, epoch = candidate, epoch + 1
            e, J = linearise(w, *used, one)
            square, error = e @ e, _mean_square(w, held, one)
            if error < best_error:
                best, best_error, waited = w, error, 0
            else:
                waited += 1
        return best, best_error, epoch


def _mean_square(w, held, one):
    """Mean squared residual of the held-back samples."""
    return float(np.mean(residuals(w, *held, one) ** 2))
