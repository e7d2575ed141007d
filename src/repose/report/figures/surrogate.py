"""Draw Figures 10 and 13: the network, and the quality of its predictions."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.bench.parameters import SYMBOLS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Response, name_derived_column, response
from repose.calibrate.surrogates import Surrogate, load
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common.files import read_json, read_table

from . import panels, style
from .registry import Inputs, StudyView

# Common names of activations, by their names in MATLAB.
ACTIVATIONS = {"tansig": "tanh", "purelin": "linear"}
# Splits of the samples: name in the table, colour and marker.
SPLITS = (
    ("train", style.BLUE, "o"),
    ("validation", style.ORANGE, "s"),
    ("test", style.RED, "^"),
    ("new points", style.PURPLE, "D"),
)
UNSEEN_SPLITS = ("test", "new points")  # not used to train the model
INFLUENCE_POINTS = 1024
# Drawing of the network. The layers are at x = 0, 1 and 2, and the nodes of a layer
# extend from y = -1 to y = 1 at most.
TITLE_Y = 1.13  # of the titles of the layers
NETWORK_Y_LIMITS = (-1.1, 1.38)  # leaves space for these titles
SYMBOL_GAP = 0.12  # between the centre of a node and the symbol beside it
NETWORK_LEFT = -0.6  # leaves space for the symbols of the inputs
NETWORK_RIGHT = 2.45  # without the symbols of the outputs
LETTER_WIDTH = 0.055  # of these symbols
# Height of the figure of the network in inches: at least, without bars, and for each
# bar
MIN_NETWORK_HEIGHT = 3.1
HEIGHT_WITHOUT_BARS = 1.0
HEIGHT_PER_BAR = 0.17
BARS_FRACTION = 0.8  # of the distance between two inputs, filled by bars
ACCURACY_ROW_HEIGHT = 3.9  # inches, of the panels of predicted over simulated values


class Influence(NamedTuple):
    """Influence of each input of a surrogate on each output, (outputs, inputs).

    It is 0 for a fixed input, and for all inputs if an output is constant.
    """

    # Fraction of the variance: the total Sobol index, or the fraction `remaining` if
    # there are constraints between the inputs
    fraction: np.ndarray
    direction: np.ndarray  # 1 if the output rises with the input, -1 if it falls


class Layers(NamedTuple):
    """Positions (n, 2) of the nodes in each layer of a network."""

    inputs: np.ndarray
    hidden: np.ndarray
    outputs: np.ndarray


# --- The network ----------------------------------------------------------------------


def draw_network_structure(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the layers of the network, and bars for the influence of each input.

    The sizes of the weights are not shown, because they would be misleading: two large
    weights cancel if they change the same response in opposite directions.

    Parameters
    ----------
    inputs : mapping
        Path of the network's file, as `network`. The network has one hidden layer.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    # Read the structure of the network, and below the network itself for predictions.
    path = inputs["network"]
    network = read_json(
        path, ("inputs", "outputs", "W1", "W2"), "the file of a network"
    )
    # The weights `W1` from the inputs to the hidden layer have a row for each hidden
    # node.
    n_hidden, n_inputs = np.shape(np.atleast_2d(network["W1"]))
    n_outputs = len(network["outputs"])
    layers = Layers(
        inputs=_place_nodes(0, n_inputs),
        hidden=_place_nodes(1, n_hidden),
        outputs=_place_nodes(2, n_outputs),
    )
    titles = _format_layer_titles(network, layers)
    symbols = _find_symbols(network["outputs"], study.targets, path)
    influence = compute_influence(
        load(path), study.parameters, seed=study.settings.design.seed
    )

    # There is a bar for each pair of an input and an output.
    n_bars = n_outputs * n_inputs
    height = HEIGHT_WITHOUT_BARS + HEIGHT_PER_BAR * n_bars
    figure = style.new_figure(style.PAGE, max(MIN_NETWORK_HEIGHT, height))
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.15))
    _draw_network(
        left, layers, titles=titles, inputs=network["inputs"], symbols=symbols
    )
    _draw_influence(right, influence, inputs=network["inputs"], symbols=symbols)
    style.label_panels((left, right))
    return figure


def _find_symbols(outputs: Sequence[str], targets: Targets, source: str) -> list[str]:
    """Find the symbols of the outputs of a network.

    Parameters
    ----------
    outputs : sequence of str
        Names of responses: those of targets, which another program may define, or other
        responses of a bench test.
    targets : Targets
        The targets of the study.
    source : path
        File of the network, for messages.

    Returns
    -------
    list of str
        The symbols, in the order of the outputs.
    """
    responses_of_targets = {target.name: target.response for target in targets}
    symbols = []
    for name in outputs:
        output = responses_of_targets.get(name) or response(name, source)
        symbols.append(output.symbol)
    return symbols


def _format_layer_titles(network: Mapping[str, Any], layers: Layers) -> list[str]:
    """Write a title for each layer, with its number of nodes and its activation.

    Parameters
    ----------
    network : mapping
        Contents of the network's file.
    layers : Layers
        Positions of the nodes.

    Returns
    -------
    list of str
        The titles of the input layer, the hidden layer and the output layer.
    """
    activations = network.get("activation", ACTIVATIONS)
    hidden, output = (ACTIVATIONS.get(name, name) for name in activations)
    names = ("input", f"hidden ({hidden})", f"output ({output})")
    return [f"{name}\n{len(nodes)}" for name, nodes in zip(names, layers, strict=True)]


def _draw_network(
    panel: Axes,
    layers: Layers,
    titles: Sequence[str],
    inputs: Sequence[str],
    symbols: Sequence[str],
) -> None:
    """Draw a network with one hidden layer: its nodes, and a thin line for each weight.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    layers : Layers
        Positions of the nodes, from `_place_nodes`.
    titles : sequence of str
        Titles of the layers.
    inputs : sequence of str
        Names of the parameters.
    symbols : sequence of str
        Symbols of the responses.
    """
    _connect(panel, layers.inputs, layers.hidden)
    _connect(panel, layers.hidden, layers.outputs)
    for x, (title, nodes) in enumerate(zip(titles, layers, strict=True)):
        panel.scatter(
            *nodes.T,
            s=70,
            color="white",
            edgecolor=style.BLACK,
            linewidth=1.1,
            zorder=2,
        )
        panel.text(x, TITLE_Y, title, ha="center", va="bottom", fontsize=7.5)
    # Name the inputs on the left, and the outputs on the right.
    for (x, y), name in zip(layers.inputs, inputs, strict=True):
        symbol = SYMBOLS.get(name, name)
        panel.text(x - SYMBOL_GAP, y, symbol, ha="right", va="center", fontsize=8.5)
    for (x, y), symbol in zip(layers.outputs, symbols, strict=True):
        panel.text(x + SYMBOL_GAP, y, symbol, ha="left", va="center", fontsize=8)
    longest_symbol = max(map(len, symbols))
    right = NETWORK_RIGHT + LETTER_WIDTH * longest_symbol
    panel.set(xlim=(NETWORK_LEFT, right), ylim=NETWORK_Y_LIMITS)
    panel.axis("off")


def _connect(panel: Axes, nodes: np.ndarray, next_nodes: np.ndarray) -> None:
    """Draw a thin line from each node of a layer to each node of the next layer."""
    for x0, y0 in nodes:
        for x1, y1 in next_nodes:
            panel.plot(
                [x0, x1], [y0, y1], lw=0.4, color=style.GREY, alpha=0.5, zorder=1
            )


def _draw_influence(
    panel: Axes, influence: Influence, inputs: Sequence[str], symbols: Sequence[str]
) -> None:
    """Draw a bar for the influence of each input on each output, in percent.

    An arrow beside each bar shows whether the output rises or falls with the input.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    influence : Influence
        Influence of the inputs on the outputs.
    inputs : sequence of str
        Names of the parameters, in the order of the columns of `influence`.
    symbols : sequence of str
        Symbols of the responses, in the order of its rows.
    """
    # The bars are horizontal. Those of an input lie below each other around its
    # position.
    positions = np.arange(len(inputs))
    bar_height = BARS_FRACTION / len(symbols)
    for k, symbol in enumerate(symbols):
        y = positions + bar_height * (k - 0.5 * (len(symbols) - 1))
        percent = 100 * influence.fraction[k]
        colour = style.SERIES[k % len(style.SERIES)]
        panel.barh(y, percent, height=bar_height, color=colour, label=symbol)
        for bar_y, bar_percent, direction in zip(
            y, percent, influence.direction[k], strict=True
        ):
            panel.annotate(
                _format_influence(bar_percent, direction),
                (bar_percent, bar_y),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=6.5,
            )
    labels = [SYMBOLS.get(name, name) for name in inputs]
    panel.set_yticks(positions, labels, fontsize=8.5)
    panel.invert_yaxis()
    panel.set(xlabel="influence on the prediction (%)")
    panel.margins(x=0.18)  # leaves space for the numbers beside the bars
    panel.legend(loc="lower right")


def _format_influence(percent: float, direction: float) -> str:
    """Write an influence with an arrow up or down; "none" if the direction is 0."""
    if not direction:
        return "none"
    arrow = "↗" if direction > 0 else "↘"
    return f"{percent:.0f} % {arrow}"


def compute_influence(
    model: Surrogate, parameters: ParameterSpace, seed: int
) -> Influence:
    """Compute how much, and in which direction, each input changes each output.

    How much is a fraction of an output's variance over the ranges of the inputs.

    Parameters
    ----------
    model : Surrogate
        The surrogate.
    parameters : ParameterSpace
        The parameters, over whose ranges the inputs vary.
    seed : int
        Seed of the random points.

    Returns
    -------
    Influence
        The fractions and the directions.
    """
    from repose.calibrate.uncertainty.sensitivity import compute_variance_fractions

    def respond(coordinates: np.ndarray) -> np.ndarray:
        """Predict the responses at coordinates of the free parameters."""
        values = parameters.from_coordinates(coordinates)
        return model.predict(parameters.add_fixed_values(values))

    shape = len(model.outputs), len(model.inputs)
    fraction = np.zeros(shape)
    direction = np.zeros(shape)
    settings = SensitivitySettings.model_construct(
        samples=INFLUENCE_POINTS, resamples=1, seed=seed
    )
    try:
        variance_fractions = compute_variance_fractions(respond, parameters, settings)
    except ValueError:
        # The function raises this if an output is constant. Then the fractions are
        # undefined, so leave all of them at zero.
        return Influence(fraction, direction)

    # Constraints make the inputs depend on each other. Sobol indices are defined only
    # for independent inputs, so another fraction takes their place.
    kind = "remaining" if parameters.constraints else "total"
    # Fixed inputs keep a fraction of zero.
    free_columns = [model.inputs.index(name) for name in parameters.free]
    fraction[:, free_columns] = variance_fractions[kind]
    # The changes have a row for each input, but the directions a row for each output.
    changes = _compute_changes_along_parameters(respond, parameters, seed)
    direction[:, free_columns] = np.sign(changes).T
    return Influence(fraction, direction)


def _compute_changes_along_parameters(
    respond: Callable[[np.ndarray], np.ndarray], parameters: ParameterSpace, seed: int
) -> np.ndarray:
    """Compute by how much the mean responses change along each free parameter.

    The change is that from the smallest to the largest value of the parameter that the
    constraints allow. The mean is over the values of the other parameters.

    Parameters
    ----------
    respond : callable
        Function that maps coordinates (n, free) of the free parameters to responses
        (n, outputs).
    parameters : ParameterSpace
        The parameters of the study.
    seed : int
        Seed of the random points over which the other parameters are averaged.

    Returns
    -------
    ndarray
        The changes (free, outputs), which are positive if a response rises.
    """
    from repose.calibrate.uncertainty.sensitivity import compute_main_effects

    low, high = parameters.coordinate_bounds
    if not parameters.constraints:
        # The two ends of each range are enough.
        _, means = compute_main_effects(respond, low, high=high, seed=seed, points=2)
        return means[:, 1] - means[:, 0]

    # An end of a range may not be allowed, so use many values along it. At values that
    # the constraints do not allow, the means are NaN.
    _, means = compute_main_effects(
        respond, low, high, seed=seed, is_allowed=parameters.is_allowed
    )
    changes = []
    for curve in means:
        allowed = curve[~np.isnan(curve).any(axis=1)]
        changes.append(allowed[-1] - allowed[0])
    return np.array(changes)


def _place_nodes(x: float, count: int) -> np.ndarray:
    """Place the nodes of a layer below each other, centred at y = 0.

    A layer with few nodes is not as high as the others.

    Parameters
    ----------
    x : float
        Position of the layer on the x axis.
    count : int
        Number of nodes.

    Returns
    -------
    ndarray
        Positions (count, 2), the highest first.
    """
    half_height = 0.0
    if count > 1:
        half_height = min(1.0, 0.11 * (count + 1))
    y = np.linspace(half_height, -half_height, count)
    return np.column_stack([np.full(count, float(x)), y])


# --- Predictions of the surrogate -----------------------------------------------------


def draw_predicted_against_simulated(inputs: Inputs, study: StudyView) -> Figure:
    """Draw predicted against simulated responses, with R2 (Eq. 13) and RMSE.

    Colours show the split of each sample: training, validation or test.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `predictions` contains the split and the simulated and predicted
        responses of each sample, and `dataset` the standard errors. If `fresh`, a table
        of new points that are not in the design, and `network`, the surrogate, are
        given, the responses at these points are predicted, too.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    # `targets.predicted` and `targets.errors` are names of columns.
    targets = study.targets
    table = read_table(
        inputs["predictions"], ("sample", "split", *targets.names, *targets.predicted)
    )
    # Add the standard errors from the other table. A sample may have none.
    error_columns = ["sample", *targets.errors]
    errors = read_table(inputs["dataset"], error_columns)[error_columns]
    table = table.merge(errors, on="sample", how="left")
    if {"fresh", "network"} <= inputs.keys():
        table = pd.concat([table, _predict_new_points(inputs, targets)])

    width = 0.5 * style.PAGE * min(len(targets), 2)
    figure, axes = panels.grid(
        len(targets), ACCURACY_ROW_HEIGHT, width=width, extra_height=0.4
    )
    draw_accuracy(axes, table, targets.responses)
    return figure


def draw_accuracy(
    axes: Sequence[Axes], table: pd.DataFrame, responses: Sequence[Response]
) -> None:
    """Draw predicted against simulated responses, each response in its own panel.

    Parameters
    ----------
    axes : sequence of Axes
        A panel for each response.
    table : DataFrame
        A row for each sample: `split` and, for each response, its simulated and
        predicted values and its standard errors.
    responses : sequence of Response
        The responses.
    """
    for panel, plotted_response in zip(axes, responses, strict=True):
        _draw_splits(panel, table, plotted_response)
        panel.set(
            xlabel=style.response_label(plotted_response, "simulated"),
            ylabel=style.response_label(plotted_response, "predicted"),
        )
        panel.legend(loc="lower right", handletextpad=0.2)
    style.label_panels(axes)


def _predict_new_points(inputs: Inputs, targets: Targets) -> pd.DataFrame:
    """Predict the responses at new points, which are not in the design.

    Parameters
    ----------
    inputs : mapping
        Paths of the final surrogate, as `network`, and of the table of new points, as
        `fresh`. A point is a parameter set with the means of its runs.
    targets : Targets
        The targets of the study.

    Returns
    -------
    DataFrame
        The points with their simulated means and predictions. Their split is "new
        points".
    """
    model = load(inputs["network"])
    points = read_table(
        inputs["fresh"], ("status", *model.inputs, *targets.names, *targets.errors)
    )
    # `assign` makes a copy, to which columns can be added safely.
    points = points[points["status"] == "ok"].assign(split="new points")
    # Inputs and predictions must be in the order of the model's inputs and outputs.
    predicted_columns = [
        name_derived_column(name, "predicted") for name in model.outputs
    ]
    X = points[list(model.inputs)].to_numpy(float)
    points[predicted_columns] = model.predict(X)
    return points


def _draw_splits(panel: Axes, table: pd.DataFrame, plotted_response: Response) -> None:
    """Draw predicted against simulated values of one response, and write the accuracy.

    The samples of each split have their own colour and marker.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each sample: `split`, and the simulated value of the response, its
        prediction and its standard error.
    plotted_response : Response
        The response. Its attributes `name`, `predicted` and `standard_error` are names
        of columns.
    """
    # Draw the diagonal, on which perfect predictions lie, from corner to corner.
    values = table[[plotted_response.name, plotted_response.predicted]].to_numpy()
    margin = 0.06 * (values.max() - values.min())
    ends = np.array([values.min() - margin, values.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)

    # The accuracy is written only for samples that the model has not seen.
    accuracy_lines = []
    for split, colour, marker in SPLITS:
        rows = table[table["split"] == split]
        if rows.empty:
            continue
        is_unseen = split in UNSEEN_SPLITS
        panel.errorbar(
            rows[plotted_response.name],
            rows[plotted_response.predicted],
            xerr=rows[plotted_response.standard_error].fillna(0.0),
            fmt=marker,
            color=colour,
            ecolor=(*to_rgb(colour), 0.45),
            ms=3.2,
            mec="white",
            mew=0.3,
            elinewidth=0.5,
            zorder=3 if is_unseen else 2,
            label=f"{split} ({len(rows)})",
        )
        if is_unseen:
            accuracy_lines += _describe_accuracy(table, split, plotted_response)
    panel.set(xlim=ends, ylim=ends, aspect="equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(6))
    # Write the accuracy above the panel, where no point lies.
    panel.set_title(
        "\n".join(accuracy_lines), loc="right", fontsize=style.SMALL_TEXT_PT
    )


def _describe_accuracy(
    table: pd.DataFrame, split: str, plotted_response: Response
) -> list[str]:
    """Describe the accuracy of the surrogate, and that of a perfect model, on a split.

    A perfect model would predict the true means. Its predictions would still deviate
    from the simulated means, by the standard errors of these means.

    Parameters
    ----------
    table : DataFrame
        The samples, as for `draw_accuracy`.
    split : str
        Name of the split.
    plotted_response : Response
        The response.

    Returns
    -------
    list of str
        A line for the surrogate, and a line for a perfect model.
    """
    is_split = table["split"] == split
    rows = table[is_split]
    simulated = rows[plotted_response.name].to_numpy(float)
    predicted = rows[plotted_response.predicted].to_numpy(float)
    unit = plotted_response.unit
    surrogate_accuracy = _format_accuracy(simulated, predicted - simulated, unit)

    # Estimate the standard error by its root mean square over the split. A design has
    # few test samples, so for them take all samples of the design. New points are not
    # part of the design.
    rows_with_errors = rows
    if split == "test":
        rows_with_errors = table[table["split"] != "new points"]
    errors = rows_with_errors[plotted_response.standard_error].to_numpy(float)
    perfect_deviation = np.full(len(rows), np.sqrt(np.mean(errors**2)))
    perfect_accuracy = _format_accuracy(simulated, perfect_deviation, unit)
    return [
        f"{split}, {len(rows)} sets: {surrogate_accuracy}",
        f"a perfect model on these sets: {perfect_accuracy}",
    ]


def _format_accuracy(simulated: np.ndarray, deviation: np.ndarray, unit: str) -> str:
    """Write R2 and RMSE of predictions, or "unknown" if a deviation is unknown.

    For example, the standard error of a single run is unknown.

    Parameters
    ----------
    simulated : ndarray
        Simulated means (n,).
    deviation : ndarray
        Deviation (n,) of each prediction from the mean.
    unit : str
        Unit of the response.

    Returns
    -------
    str
        The accuracy, such as "R² 0.95, RMSE 0.40 deg".
    """
    if not np.isfinite(deviation).all():
        return "unknown"
    r2 = compute_r2(simulated, simulated + deviation)
    rmse = np.sqrt(np.mean(deviation**2))
    r2_text = "undefined" if r2 is None else f"{r2:.2f}"
    return f"R² {r2_text}, RMSE {rmse:.2f} {unit}".rstrip()
