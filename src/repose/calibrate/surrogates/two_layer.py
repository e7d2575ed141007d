"""Compute a network of two layers and its derivatives: tansig, then purelin.

The network maps an input vector x to an output vector y, both scaled to an interval:

    z = W1 x + b1,    a = tanh(z),    y = W2 a + b2        (Eq. 6-8)

The N weights form one vector w, in this order: W1 (hidden, inputs) row by row,
b1 (hidden,), W2 (outputs, hidden) row by row, b2 (outputs,).

Sources, named where they are used
  (Eq. n)   the paper
  (NW90)    Nguyen & Widrow 1990, improving the learning speed of two-layer networks
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt
            algorithm
  (M92)     MacKay 1992, A practical Bayesian framework for backpropagation networks,
            Neural Computation 4
  (M94)     MacKay 1994, Bayesian non-linear modeling for the prediction competition: a
            prior for each input
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

PRIORS = ("one", "layers", "inputs")
# Length of the input weights of a neuron, in the first weights of (NW90).
NGUYEN_WIDROW_FACTOR = 0.7
ARRAY_NAMES = (
    "input_min",
    "input_max",
    "output_min",
    "output_max",
    "W1",
    "b1",
    "W2",
    "b2",
)
ArrayFunction = Callable[[np.ndarray], np.ndarray]


class Layers(NamedTuple):
    """The weights of a network by layer; leading axes are for several networks."""

    W1: np.ndarray  # (..., hidden, inputs)
    b1: np.ndarray  # (..., hidden)
    W2: np.ndarray  # (..., outputs, hidden)
    b2: np.ndarray  # (..., outputs)


def evaluate_network(network: Mapping[str, Any], X: np.ndarray) -> np.ndarray:
    """Compute the responses of a network (Eq. 6-8).

    Parameters
    ----------
    network : mapping
        The arrays named in `ARRAY_NAMES`, and the interval `scaled_range`.
    X : array (samples, inputs)
        Parameter sets, in their units.

    Returns
    -------
    array (samples, outputs)
        The responses, in their units.
    """
    arrays = _convert_arrays(network)
    low, high = arrays["scaled_range"]
    x = scale_columns(
        np.asarray(X, dtype=float),
        arrays["input_min"],
        arrays["input_max"],
        (low, high),
    )
    hidden = np.tanh(x @ arrays["W1"].T + arrays["b1"])
    y = hidden @ arrays["W2"].T + arrays["b2"]
    return unscale_columns(y, arrays["output_min"], arrays["output_max"], (low, high))


def make_response_function(
    network: Mapping[str, Any], low: np.ndarray, high: np.ndarray
) -> ArrayFunction:
    """Make a fast function that computes the responses of a network.

    All scalings are included in the weights, so a call needs only two matrix products.

    Parameters
    ----------
    network : mapping
        The arrays named in `ARRAY_NAMES`, and the interval `scaled_range`.
    low, high : array (inputs,)
        The parameter values that -1 and 1 stand for.

    Returns
    -------
    callable
        It maps points (n, inputs) in [-1, 1] to responses (n, outputs).
    """
    arrays = _convert_arrays(network)
    bottom, top = arrays["scaled_range"]

    # A point p stands for the parameter set
    #
    #     X = (low + high) / 2 + p (high - low) / 2
    #
    # which the network scales to x = bottom + (X - input_min) input_scale. So x is a
    # linear function of p: its value at p = 0 goes into b1, and its slope into W1.
    input_widths = compute_widths(arrays["input_min"], arrays["input_max"])
    input_scale = (top - bottom) / input_widths
    scaled_middle = bottom + ((low + high) / 2 - arrays["input_min"]) * input_scale
    W1 = np.ascontiguousarray((arrays["W1"] * input_scale * (high - low) / 2).T)
    b1 = arrays["b1"] + arrays["W1"] @ scaled_middle

    # The responses are linear functions of the scaled outputs, so change W2 and b2
    # accordingly.
    output_widths = compute_widths(arrays["output_min"], arrays["output_max"])
    output_scale = output_widths / (top - bottom)
    W2 = np.ascontiguousarray((arrays["W2"] * output_scale[:, None]).T)
    b2 = arrays["output_min"] + (arrays["b2"] - bottom) * output_scale

    def predict(points: np.ndarray) -> np.ndarray:
        return np.tanh(points @ W1 + b1) @ W2 + b2

    return predict


def _convert_arrays(network: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Convert the entries of a network to arrays of floats."""
    keys = (*ARRAY_NAMES, "scaled_range")
    return {key: np.asarray(network[key], dtype=float) for key in keys}


def draw_first_weights(
    inputs: int, hidden: int, outputs: int, scaled_range: tuple[float, float], seed: Any
) -> np.ndarray:
    """Draw random first weights by the method of Nguyen and Widrow (1990).

    The method spreads the neurons over the range of the inputs. For inputs in [-1, 1],
    the input weights of each neuron form a vector of length 0.7 hidden^(1 / inputs),
    and its bias is uniform between minus this length and this length. Then the weights
    are converted to inputs in `scaled_range`. The weights of the outputs are uniform
    between -0.5 and 0.5.

    Parameters
    ----------
    inputs, hidden, outputs : int
        Numbers of inputs, hidden neurons and outputs.
    scaled_range : pair of float
        Interval of the scaled inputs.
    seed : int or sequence of int
        Seed of the random numbers.

    Returns
    -------
    array (N,)
        The weights in the order W1, b1, W2, b2.
    """
    rng = np.random.RandomState(seed)
    length = NGUYEN_WIDROW_FACTOR * hidden ** (1 / inputs)
    W1 = rng.uniform(-1, 1, (hidden, inputs))
    W1 *= length / np.linalg.norm(W1, axis=1, keepdims=True)
    b1 = rng.uniform(-length, length, hidden)

    # An input x in `scaled_range` stands for (x - middle) / half_width in [-1, 1]. Put
    # this conversion into the weights: b1 needs the W1 that is already divided.
    middle = (scaled_range[0] + scaled_range[1]) / 2
    half_width = (scaled_range[1] - scaled_range[0]) / 2
    W1 /= half_width
    b1 -= W1.sum(axis=1) * middle

    # These are W2 and b2.
    output_weights = rng.uniform(-0.5, 0.5, outputs * (hidden + 1))
    return np.concatenate([W1.ravel(), b1, output_weights])


def unpack_weights(w: np.ndarray, inputs: int, hidden: int, outputs: int) -> Layers:
    """View a vector of weights (..., N) by layer, in the order W1, b1, W2, b2."""
    end_of_W1 = hidden * inputs
    end_of_b1 = hidden * (inputs + 1)
    networks = w.shape[:-1]
    return Layers(
        W1=w[..., :end_of_W1].reshape(*networks, hidden, inputs),
        b1=w[..., end_of_W1:end_of_b1],
        W2=w[..., end_of_b1:-outputs].reshape(*networks, outputs, hidden),
        b2=w[..., -outputs:],
    )


def mix_outputs(w: np.ndarray, mixing: np.ndarray, hidden: int) -> np.ndarray:
    """Transform weights so that the outputs y become the combinations y @ mixing.

    Parameters
    ----------
    w : array (N,) or (N, columns)
        All weights of a network, in the order W1, b1, W2, b2. With several columns, the
        same transformation is applied to each of them.
    mixing : array (outputs, outputs)
        Coefficients of the combinations, one combination in each column.
    hidden : int
        Number of hidden neurons.

    Returns
    -------
    array of the shape of `w`
    """
    outputs = len(mixing)
    start_of_W2 = len(w) - outputs * (hidden + 1)
    start_of_b2 = len(w) - outputs
    W2 = w[start_of_W2:start_of_b2]
    b2 = w[start_of_b2:]
    # The weights of the hidden layer stay the same. Each output has a row in W2 and in
    # b2, and these rows are combined like the outputs.
    parts = [w[:start_of_W2]]
    for weights in (W2, b2):
        rows = weights.reshape(outputs, -1)
        # Give the result the dimensions of w again, one or two.
        parts.append((mixing.T @ rows).reshape(-1, *w.shape[1:]))
    return np.concatenate(parts)


def list_weight_classes(
    prior: str, inputs: int, hidden: int, outputs: int
) -> list[Any]:
    """List the classes of weights that share a regularisation alpha.

    The prior "one" has a single class. The prior "layers" has three: input weights,
    hidden biases, and output weights with their biases (MacKay 1992). The prior
    "inputs" divides the input weights further, into one class for each input (MacKay
    1994). `name_weight_classes` must keep the same order.

    Parameters
    ----------
    prior : str
        One of `PRIORS`.
    inputs, hidden, outputs : int
        Numbers of inputs, hidden neurons and outputs.

    Returns
    -------
    list
        For each class, the indices of its weights in the vector w: an array or, for the
        single class, a slice.
    """
    if prior == "one":
        return [slice(None)]
    # The order of the weights is W1, b1, W2, b2.
    indices = np.arange(hidden * (inputs + 1) + outputs * (hidden + 1))
    end_of_W1 = hidden * inputs
    end_of_b1 = hidden * (inputs + 1)
    W1 = indices[:end_of_W1].reshape(hidden, inputs)
    input_classes = list(W1.T) if prior == "inputs" else [W1.ravel()]
    hidden_biases = indices[end_of_W1:end_of_b1]
    output_weights_and_biases = indices[end_of_b1:]
    return [*input_classes, hidden_biases, output_weights_and_biases]


def name_weight_classes(prior: str, inputs: Sequence[Any]) -> list[str]:
    """Name the classes of weights, in the order of `list_weight_classes`."""
    if prior == "one":
        return ["all weights"]
    if prior == "inputs":
        input_classes = [f"weights of {name}" for name in inputs]
    else:
        input_classes = ["weights of the inputs"]
    return [*input_classes, "hidden biases", "output weights"]


def compute_jacobian(
    w: np.ndarray, x: np.ndarray, outputs: int
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the outputs and their derivatives with respect to the weights.

    The chain rule is applied to each output separately, as the Levenberg-Marquardt
    method requires. With the values a of the hidden neurons:

        dy_k / dW2_kj = a_j,    dy_k / db2_k = 1,
        dy_k / db1_j = W2_kj (1 - a_j^2),    dy_k / dW1_ji = dy_k / db1_j x_i

    Parameters
    ----------
    w : array (..., N)
        Weights of one network, or of several along the leading axes.
    x : array (samples, inputs)
        Scaled inputs.
    outputs : int
        Number of outputs.

    Returns
    -------
    y : array (..., samples, outputs)
        Scaled outputs.
    J : array (..., samples, outputs, N)
        Their derivatives with respect to the weights, which have the order of
        `unpack_weights`.
    """
    inputs = x.shape[1]
    N = w.shape[-1]
    hidden = count_hidden_neurons(N, inputs, outputs)
    W1, b1, W2, b2 = unpack_weights(w, inputs, hidden, outputs)
    a = np.tanh(x @ W1.swapaxes(-1, -2) + b1[..., None, :])  # (Eq. 6-7)
    y = a @ W2.swapaxes(-1, -2) + b2[..., None, :]  # (Eq. 8)

    # Fill in the derivatives in the order of w: W1, b1, W2, b2. Weights of the hidden
    # layer act on every output, so these arrays have the axes (..., samples, outputs,
    # hidden), and for W1 also inputs.
    J = np.zeros((*y.shape, N))
    end_of_W1 = hidden * inputs
    end_of_b1 = end_of_W1 + hidden
    dy_db1 = W2[..., None, :, :] * (1 - a * a)[..., None, :]
    dy_dW1 = dy_db1[..., None] * x[:, None, None, :]
    J[..., :end_of_W1] = dy_dW1.reshape(*y.shape, end_of_W1)
    J[..., end_of_W1:end_of_b1] = dy_db1
    # Each output depends only on its own row of W2 and its own bias.
    for k in range(outputs):
        start = end_of_b1 + k * hidden
        J[..., k, start : start + hidden] = a
        J[..., k, N - outputs + k] = 1.0
    return y, J


def count_hidden_neurons(N: int, inputs: int, outputs: int) -> int:
    """Count the hidden neurons of a network with N weights.

    N = hidden (inputs + 1 + outputs) + outputs.
    """
    return (N - outputs) // (inputs + 1 + outputs)


def scale_columns(
    X: np.ndarray, minimum: np.ndarray, maximum: np.ndarray, interval: Sequence[float]
) -> np.ndarray:
    """Map each column's minimum and maximum to the ends of an interval."""
    low, high = interval
    return low + (X - minimum) / compute_widths(minimum, maximum) * (high - low)


def unscale_columns(
    y: np.ndarray, minimum: np.ndarray, maximum: np.ndarray, interval: Sequence[float]
) -> np.ndarray:
    """Map an interval back to each column's range; the inverse of `scale_columns`."""
    low, high = interval
    return minimum + (y - low) / (high - low) * compute_widths(minimum, maximum)


def compute_widths(minimum: np.ndarray, maximum: np.ndarray) -> np.ndarray:
    """Compute the width of each column's range; 1 for a column that does not vary."""
    return np.where(maximum > minimum, maximum - minimum, 1.0)
