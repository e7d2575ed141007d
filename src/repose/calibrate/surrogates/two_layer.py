"""A network of two layers as a function of its weights: tansig, then purelin (Eq. 6-8 of the paper).

Sources of the lines, named where they are used
  (Eq. n)   the paper
  (NW90)    Nguyen & Widrow 1990, improving the learning speed of two-layer networks
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt algorithm
  (M92)     MacKay 1992, A practical Bayesian framework for backpropagation networks, Neural Computation 4
  (M94)     MacKay 1994, Bayesian non-linear modeling for the prediction competition: a prior for each input

The N weights stand in one vector w: W1 (hidden, inputs) row by row, b1 (hidden,), W2 (outputs, hidden) row by row,
b2 (outputs,).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

PRIORS = ("one", "layers", "inputs")
ARRAYS = ("input_min", "input_max", "output_min", "output_max", "W1", "b1", "W2", "b2")
Function = Callable[[np.ndarray], np.ndarray]


def evaluate(network: Mapping[str, Any], X: np.ndarray) -> np.ndarray:
    """Compute responses (samples, outputs) of a network (Eq. 6-8), which holds `ARRAYS` and `scaled_range`."""
    a = {
        key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")
    }
    low, high = a["scaled_range"]
    x = scale(np.asarray(X, dtype=float), a["input_min"], a["input_max"], (low, high))
    y = np.tanh(x @ a["W1"].T + a["b1"]) @ a["W2"].T + a["b2"]
    return a["output_min"] + (y - low) / (high - low) * width(
        a["output_min"], a["output_max"]
    )


def response_function(
    network: Mapping[str, Any], low: np.ndarray, high: np.ndarray
) -> Function:
    """Make the same network a function of points in [-1, 1], which stand for `low` and `high`."""
    a = {
        key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")
    }
    bottom, top = a["scaled_range"]
    per_unit = (top - bottom) / width(a["input_min"], a["input_max"])
    W1 = np.ascontiguousarray((a["W1"] * per_unit * (high - low) / 2).T)
    b1 = a["b1"] + a["W1"] @ (bottom + ((low + high) / 2 - a["input_min"]) * per_unit)
    stretch = width(a["output_min"], a["output_max"]) / (top - bottom)
    W2 = np.ascontiguousarray((a["W2"] * stretch[:, None]).T)
    b2 = a["output_min"] + (a["b2"] - bottom) * stretch
    return lambda points: np.tanh(points @ W1 + b1) @ W2 + b2


def nguyen_widrow(
    inputs: int, hidden: int, outputs: int, scaled_range: tuple[float, float], seed: Any
) -> np.ndarray:
    """Draw random weights (N,) with the slopes of the neurons spread over the interval of the inputs (NW90)."""
    random = np.random.RandomState(seed)
    length = 0.7 * hidden ** (1 / inputs)  # (NW90)
    W1 = random.uniform(-1, 1, (hidden, inputs))
    W1 *= length / np.linalg.norm(W1, axis=1, keepdims=True)
    b1 = random.uniform(-length, length, hidden)
    # (NW90) has inputs in [-1, 1]; the same neurons for inputs in scaled_range
    middle, half = (
        (scaled_range[0] + scaled_range[1]) / 2,
        (scaled_range[1] - scaled_range[0]) / 2,
    )
    W1 /= half
    b1 -= W1.sum(axis=1) * middle
    return np.concatenate(
        [W1.ravel(), b1, random.uniform(-0.5, 0.5, outputs * (hidden + 1))]
    )


def unpack(
    w: np.ndarray, inputs: int, hidden: int, outputs: int
) -> tuple[np.ndarray, ...]:
    """View W1, b1, W2, b2 of the weights by layer; of several networks, w (..., N), W1 is (..., hidden, inputs)."""
    first, second = hidden * inputs, hidden * (inputs + 1)
    W1, b1, W2, b2 = (
        w[..., :first],
        w[..., first:second],
        w[..., second:-outputs],
        w[..., -outputs:],
    )
    several = w.shape[:-1]
    return (
        W1.reshape(*several, hidden, inputs),
        b1,
        W2.reshape(*several, outputs, hidden),
        b2,
    )


def mix_outputs(w: np.ndarray, mixing: np.ndarray, hidden: int) -> np.ndarray:
    """Mix the outputs of a network of weights w, (N,) or (N, columns), by `mixing` (outputs, outputs)."""
    outputs = len(mixing)
    first = len(w) - outputs * (hidden + 1)
    W2 = w[first : len(w) - outputs].reshape(outputs, -1)
    b2 = w[len(w) - outputs :].reshape(outputs, -1)
    return np.concatenate(
        [w[:first], *((mixing.T @ part).reshape(-1, *w.shape[1:]) for part in (W2, b2))]
    )


def weight_classes(prior: str, inputs: int, hidden: int, outputs: int) -> list[Any]:
    """List the classes of weights that share an alpha, each an index into w (M92, M94); `prior` is one of `PRIORS`."""
    if prior == "one":
        return [slice(None)]
    w = np.arange(hidden * (inputs + 1) + outputs * (hidden + 1))
    first, second = hidden * inputs, hidden * (inputs + 1)
    W1 = w[:first].reshape(hidden, inputs)
    return [*(W1.T if prior == "inputs" else [W1.ravel()]), w[first:second], w[second:]]


def class_names(prior: str, inputs: Sequence[Any]) -> list[str]:
    """Name the classes of weights, in the order of `weight_classes`."""
    if prior == "one":
        return ["all weights"]
    first = (
        [f"weights of {name}" for name in inputs]
        if prior == "inputs"
        else ["weights of the inputs"]
    )
    return [*first, "hidden biases", "output weights"]


def jacobian(
    w: np.ndarray, x: np.ndarray, outputs: int
) -> tuple[np.ndarray, np.ndarray]:
    """Compute scaled outputs (samples, outputs) and their derivatives by the weights (samples, outputs, N).

    The chain rule of the paper's step (3), for each output by itself as Levenberg-Marquardt needs it (HM94). Of several
    networks, w (..., N), both have the leading axes of w.
    """
    inputs, N = x.shape[1], w.shape[-1]
    hidden = (N - outputs) // (inputs + 1 + outputs)
    W1, b1, W2, b2 = unpack(w, inputs, hidden, outputs)
    a = np.tanh(x @ W1.swapaxes(-1, -2) + b1[..., None, :])  # (Eq. 6-7)
    y = a @ W2.swapaxes(-1, -2) + b2[..., None, :]  # (Eq. 8)
    J = np.zeros((*y.shape, N))
    through = W2[..., None, :, :] * (1 - a * a)[..., None, :]  # dy_k / dz_j
    first = hidden * inputs
    J[..., :first] = (through[..., None] * x[:, None, None, :]).reshape(*y.shape, first)
    J[..., first : first + hidden] = through
    for k in range(outputs):
        start = first + hidden + k * hidden
        J[..., k, start : start + hidden] = a
        J[..., k, N - outputs + k] = 1.0
    return y, J


def scale(
    X: np.ndarray, minimum: np.ndarray, maximum: np.ndarray, interval: Sequence[float]
) -> np.ndarray:
    """Map the minimum of each column to the lower end of an interval, the maximum to the upper end."""
    return interval[0] + (X - minimum) / width(minimum, maximum) * (
        interval[1] - interval[0]
    )


def width(minimum: np.ndarray, maximum: np.ndarray) -> np.ndarray:
    """Compute the width of each column's range; 1 for a column that does not vary."""
    return np.where(maximum > minimum, maximum - minimum, 1.0)
