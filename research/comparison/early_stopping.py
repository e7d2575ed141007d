"""The same network without regularisation: least squares by Levenberg-Marquardt, stopped early.

Part of the samples is held back. Training ends when the error on these samples has not fallen for some epochs, and the
weights of its minimum are kept.
"""

from typing import Self

import numpy as np

from repose.calibrate.surrogates.levenberg_marquardt import (
    compute_residuals,
    linearise_residuals,
)
from repose.calibrate.surrogates.two_layer import (
    draw_first_weights,
    evaluate_network,
    scale_columns,
    unpack_weights,
)

SCALED_RANGE = (0.1, 0.9)  # as the paper scales inputs and outputs


class EarlyStoppingBP:
    """Two-layer network; of several trainings the one with the least held-back error is kept.

    `held_back` is the share of the samples that stop the training: as published, 0.15 of the 0.85 that are not for
    testing. `patience` counts epochs without a lower error on them, six as in MATLAB's trainlm. After `fit`, `network_`
    holds scalings and weights for `repose.calibrate.surrogates.two_layer.evaluate_network`, and `held_back_error_` the mean squared error
    of the scaled outputs.
    """

    def __init__(
        self,
        hidden: int = 12,
        epochs: int = 1500,
        starts: int = 5,
        held_back: float = 0.15 / 0.85,
        patience: int = 6,
        seed: int = 2026,
    ):
        self.hidden = hidden
        self.epochs = epochs
        self.starts = starts
        self.held_back = held_back
        self.patience = patience
        self.seed = seed

    def fit(self, X: np.ndarray, Y: np.ndarray) -> Self:
        """Train on X (samples, inputs) and Y (samples, outputs); fewer than four samples raise ValueError."""
        if len(X) < 4:
            raise ValueError(f"{len(X)} samples; expected at least 4")
        ends = {
            "input_min": X.min(axis=0),
            "input_max": X.max(axis=0),
            "output_min": Y.min(axis=0),
            "output_max": Y.max(axis=0),
        }
        x = scale_columns(X, ends["input_min"], ends["input_max"], SCALED_RANGE)
        t = scale_columns(Y, ends["output_min"], ends["output_max"], SCALED_RANGE)
        order = np.random.default_rng(self.seed).permutation(len(x))
        held, used = np.split(order, [max(1, round(self.held_back * len(x)))])
        found = []
        for k in range(self.starts):
            w = draw_first_weights(
                x.shape[1], self.hidden, t.shape[1], SCALED_RANGE, (self.seed, k)
            )
            found.append(self._train(w, (x[used], t[used]), (x[held], t[held])))
        w, self.held_back_error_, self.epochs_ = min(found, key=lambda end: end[1])
        weights = zip(
            ("W1", "b1", "W2", "b2"),
            unpack_weights(w, x.shape[1], self.hidden, t.shape[1]),
            strict=True,
        )
        self.network_ = ends | dict(weights) | {"scaled_range": SCALED_RANGE}
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Responses (samples, outputs) at parameter sets (samples, inputs)."""
        return evaluate_network(self.network_, X)

    def _train(self, w, used, held, mu=0.005, mu_max=1e10):
        """One start: (weights of least held-back error, that error, epochs)."""
        unit_weight = np.ones((1, used[1].shape[1]))
        e, J = linearise_residuals(w, *used, unit_weight)
        square = e @ e
        best = w
        best_error = _mean_square(w, held, unit_weight)
        waited = 0
        epoch = 0
        while epoch < self.epochs and waited < self.patience:
            JJ = J.T @ J
            gradient = J.T @ e
            while mu <= mu_max:
                candidate = w - np.linalg.solve(JJ + mu * np.eye(w.size), gradient)
                e = compute_residuals(candidate, *used, unit_weight)
                if e @ e < square:
                    break
                mu *= 10
            else:
                break
            mu = max(0.1 * mu, 1e-12)
            w = candidate
            epoch = epoch + 1
            e, J = linearise_residuals(w, *used, unit_weight)
            square = e @ e
            error = _mean_square(w, held, unit_weight)
            if error < best_error:
                best = w
                best_error = error
                waited = 0
            else:
                waited += 1
        return best, best_error, epoch


def _mean_square(w, held, unit_weight):
    """Mean squared residual of the held-back samples."""
    return float(np.mean(compute_residuals(w, *held, unit_weight) ** 2))
