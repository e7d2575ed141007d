"""Accuracy of predictions."""

import numpy as np


def compute_r2(y: np.ndarray, predicted: np.ndarray) -> float | None:
    """Compute the coefficient of determination R2 (Eq. 13 of the paper).

    None where y does not vary, or is empty.
    """
    if not len(y):
        return None
    total = np.sum((y - np.mean(y)) ** 2)
    if not total > 0:
        return None
    return float(1 - np.sum((y - predicted) ** 2) / total)
