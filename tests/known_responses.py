"""Two responses of known form that the tests of the network learn."""

import numpy as np


def known_function(U):
    """Two smooth responses of six inputs in [-1, 1], as strong and as curved as a pile's."""
    aor = (
        23
        + 2.2 * U[:, 4]
        + 2.2 * U[:, 2]
        - 1.2 * U[:, 0]
        + 0.6 * U[:, 2] * U[:, 4]
        - 0.8 * U[:, 4] ** 2
    )
    height = (
        61
        + 4.7 * U[:, 4]
        + 4.7 * U[:, 2]
        - 3.5 * U[:, 0]
        + 1.5 * U[:, 2] * U[:, 4]
        + np.sin(2 * U[:, 0])
    )
    return np.column_stack([aor, height])


def noisy_data(samples, seed, noise=(0.5, 1.0)):
    """Random inputs, and the two responses with normal noise of these standard deviations."""
    random = np.random.RandomState(seed)
    U = random.uniform(-1, 1, (samples, 6))
    return U, known_function(U) + random.normal(size=(samples, 2)) * noise
