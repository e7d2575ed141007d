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

import numpy as np

PRIORS = ("one", "layers", "inputs")
ARRAYS = ("input_min", "input_max", "output_min", "output_max", "W1", "b1", "W2", "b2")


def evaluate(network, X):
    """Responses (samples, outputs) of a network read from JSON for X (samples, inputs); Eq. 6-8."""
    a = {key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")}
    low, high = a["scaled_range"]
    x = scale(np.asarray(X, dtype=float), a["input_min"], a["input_max"], (low, high))
    y = np.tanh(x @ a["W1"].T + a["b1"]) @ a["W2"].T + a["b2"]
    return a["output_min"] + (y - low) / (high - low) * width(a["output_min"], a["output_max"])


def response_function(network, low, high):
    """The same network as a function of populations in [-1, 1]: (points, inputs) to (points, outputs).

    low, high: what -1 and 1 stand for in each input. Every scaling is folded into the weights, which leaves
    two small matrix products and a tanh for a search that calls it millions of times.
    """
    a = {key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")}
    bottom, top = a["scaled_range"]
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    per_unit = (top - bottom) / width(a["input_min"], a["input_max"])
    W1 = np.ascontiguousarray((a["W1"] * per_unit * (high - low) / 2).T)
    b1 = a["b1"] + a["W1"] @ (bottom + ((low + high) / 2 - a["input_min"]) * per_unit)
    stretch = width(a["output_min"], a["output_max"]) / (top - bottom)
    W2 = np.ascontiguousarray((a["W2"] * stretch[:, None]).T)
    b2 = a["output_min"] + (a["b2"] - bottom) * stretch
    return lambda points: np.tanh(points @ W1 + b1) @ W2 + b2


def nguyen_widrow(inputs, hidden, outputs, scaled_range, seed):
    """Random weights (N,) whose neurons' slopes are spread over the inputs' interval (NW90)."""
    random = np.random.RandomState(seed)
    length = 0.7 * hidden ** (1 / inputs)  # (NW90)
    W1 = random.uniform(-1, 1, (hidden, inputs))
    W1 *= length / np.linalg.norm(W1, axis=1, keepdims=True)
    b1 = random.uniform(-length, length, hidden)
    # (NW90) has inputs in [-1, 1]; the same neurons for inputs in scaled_range
    middle, half = (scaled_range[0] + scaled_range[1]) / 2, (scaled_range[1] - scaled_range[0]) / 2
    W1 /= half
    b1 -= W1.sum(axis=1) * middle
    return np.concatenate([W1.ravel(), b1, random.uniform(-0.5, 0.5, outputs * (hidden + 1))])


def unpack(w, inputs, hidden, outputs):
    """Views W1 (hidden, inputs), b1 (hidden,), W2 (outputs, hidden), b2 (outputs,) of the weights w (N,)."""
    ends = np.cumsum([hidden * inputs, hidden, outputs * hidden])
    W1, b1, W2, b2 = np.split(w, ends)
    return W1.reshape(hidden, inputs), b1, W2.reshape(outputs, hidden), b2


def mix_outputs(w, mixing, hidden):
    """Weights (N,), or (N, columns), of the network whose outputs are the given one's times mixing."""
    outputs = len(mixing)
    first = len(w) - outputs * (hidden + 1)
    W2 = w[first : len(w) - outputs].reshape(outputs, -1)
    b2 = w[len(w) - outputs :].reshape(outputs, -1)
    tail = [(mixing.T @ part).reshape(-1, *w.shape[1:]) for part in (W2, b2)]
    return np.concatenate([w[:first], *tail])


def weight_classes(prior, inputs, hidden, outputs):
    """Which of the N weights share an alpha: a list of index arrays into w, or of the slice of all of it."""
    if prior == "one":
        return [slice(None)]
    w = np.arange(hidden * (inputs + 1) + outputs * (hidden + 1))
    first, second = hidden * inputs, hidden * (inputs + 1)
    W1 = w[:first].reshape(hidden, inputs)
    input_weights = list(W1.T) if prior == "inputs" else [W1.ravel()]
    return [*input_weights, w[first:second], w[second:]]


def jacobian(w, x, outputs):
    """Scaled outputs y (samples, outputs) and dy/dw (samples, outputs, N) at inputs x (samples, inputs).

    The chain rule of the paper's step (3), for each output by itself as Levenberg-Marquardt needs it (HM94).
    """
    samples, inputs = x.shape
    hidden = (w.size - outputs) // (inputs + 1 + outputs)
    W1, b1, W2, b2 = unpack(w, inputs, hidden, outputs)
    a = np.tanh(x @ W1.T + b1)  # (Eq. 6-7)
    y = a @ W2.T + b2  # (Eq. 8)
    J = np.zeros((samples, outputs, w.size))
    through = W2 * (1 - a * a)[:, None, :]  # dy_k / dz_j
    first = hidden * inputs
    J[:, :, :first] = (through[:, :, :, None] * x[:, None, None, :]).reshape(samples, outputs, first)
    J[:, :, first : first + hidden] = through
    for k in range(outputs):
        start = first + hidden + k * hidden
        J[:, k, start : start + hidden] = a
        J[:, k, w.size - outputs + k] = 1.0
    return y, J


def scale(X, minimum, maximum, interval):
    """mapminmax: minimum to the interval's lower end, maximum to its upper."""
    return interval[0] + (X - minimum) / width(minimum, maximum) * (interval[1] - interval[0])


def width(minimum, maximum):
    """maximum - minimum, 1 for a column that does not vary and has nothing to be scaled by."""
    return np.where(maximum > minimum, maximum - minimum, 1.0)
