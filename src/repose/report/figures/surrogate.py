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
INFLUENCE_NOTE = (
    "influence: share of the variance of the predicted response, over the ranges of all "
    "parameters, in which the input has a part (total Sobol index); shares add up to more "
    "than 100 % where parameters interact. Arrow: the response rises or falls from the "
    "input's least to its largest value."
)
INFLUENCE_NOTE_WITH_CONSTRAINTS = (
    "influence: share of the variance of the predicted response, over what the "
    "constraints allow, that remains if all other inputs are known, E[Var(y|others)] / "
    "Var(y). Arrow: the mean response rises or falls from the input's least to its "
    "largest allowed value."
)
ACCURACY_NOTE = (
    "bars: ± 1 standard error of the simulated mean over its pours. A perfect model "
    "predicts the true means. Its R² and RMSE are what the scatter of the simulated means "
    "leaves, for the test samples the mean scatter of the whole design; by chance a model "
    "can seem better."
)


class Influence(NamedTuple):
    """Influence of each input of a surrogate on each output, (outputs, inputs).

    It is 0 for a fixed input, and for all inputs if an output is constant.
    """

    share: np.ndarray  # total Sobol index; `remaining` if there are constraints
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
        Path of the network's file, as `network`.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    path = inputs["network"]
    network = read_json(
        path, ("inputs", "outputs", "W1", "W2"), "the file of a network"
    )
    # The weights of the first layer have a row for each hidden node.
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
        load(path), study.parameters, study.settings.design.seed
    )

    # The height of the panels depends on the number of bars.
    n_bars = n_outputs * n_inputs
    figure = style.new_figure(style.PAGE, max(3.1, 1.0 + 0.17 * n_bars))
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.15))
    _draw_network(
        left, layers, titles=titles, inputs=network["inputs"], symbols=symbols
    )
    _draw_influence(right, influence, inputs=network["inputs"], symbols=symbols)
    style.name_panels((left, right))
    note = INFLUENCE_NOTE
    if study.parameters.constraints:
        note = INFLUENCE_NOTE_WITH_CONSTRAINTS
    style.write_below(figure, note)
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
    """Draw the nodes of the network, and a thin line for each weight.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    layers : Layers
        Positions of the nodes.
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
        panel.text(x, 1.13, title, ha="center", va="bottom", fontsize=7.5)
    # Name the inputs on the left, and the outputs on the right.
    for (x, y), name in zip(layers.inputs, inputs, strict=True):
        symbol = SYMBOLS.get(name, name)
        panel.text(x - 0.12, y, symbol, ha="right", va="center", fontsize=8.5)
    for (x, y), symbol in zip(layers.outputs, symbols, strict=True):
        panel.text(x + 0.12, y, symbol, ha="left", va="center", fontsize=8)
    longest_symbol = max(map(len, symbols))
    panel.set(xlim=(-0.6, 2.45 + 0.055 * longest_symbol), ylim=(-1.1, 1.38))
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
        Names of the parameters.
    symbols : sequence of str
        Symbols of the responses.
    """
    # The bars of an input lie side by side around its position. Together they fill most
    # of the distance between two inputs.
    positions = np.arange(len(inputs))
    height = 0.8 / len(symbols)
    for k, symbol in enumerate(symbols):
        y = positions + height * (k - 0.5 * (len(symbols) - 1))
        percent = 100 * influence.share[k]
        colour = style.SERIES[k % len(style.SERIES)]
        panel.barh(y, percent, height=height, color=colour, label=symbol)
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
    panel.margins(x=0.18)
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
        Shares of the variance and directions.
    """
    from repose.calibrate.uncertainty.sensitivity import compute_variance_fractions

    def respond(coordinates: np.ndarray) -> np.ndarray:
        """Predict the responses at coordinates of the free parameters."""
        values = parameters.from_coordinates(coordinates)
        return model.predict(parameters.complete(values))

    shape = len(model.outputs), len(model.inputs)
    share = np.zeros(shape)
    direction = np.zeros(shape)
    settings = SensitivitySettings.model_construct(
        samples=INFLUENCE_POINTS, resamples=1, seed=seed
    )
    try:
        shares = compute_variance_fractions(respond, parameters, settings)
    except ValueError:
        # Shares are undefined if an output is constant, so leave all of them at zero.
        return Influence(share, direction)

    # Fixed inputs keep a fraction of zero.
    free_columns = [model.inputs.index(name) for name in parameters.free]
    share[:, free_columns] = shares["remaining" if parameters.constraints else "total"]
    rise = _compute_rise(respond, parameters, seed)
    direction[:, free_columns] = np.sign(rise).T
    return Influence(share, direction)


def _compute_rise(
    respond: Callable[[np.ndarray], np.ndarray], parameters: ParameterSpace, seed: int
) -> np.ndarray:
    """Compute how much the mean responses rise along each free parameter.

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
        The rise (free, outputs) from the smallest to the largest value of the parameter
        that the constraints allow.
    """
    from repose.calibrate.uncertainty.sensitivity import compute_main_effects

    low, high = parameters.coordinate_ends
    if not parameters.constraints:
        _, means = compute_main_effects(respond, low, high=high, seed=seed, points=2)
        return means[:, 1] - means[:, 0]

    # Means are NaN at values that the constraints do not allow.
    _, means = compute_main_effects(
        respond, low, high, seed=seed, is_allowed=parameters.is_allowed
    )
    rises = []
    for curve in means:
        allowed = curve[~np.isnan(curve).any(axis=1)]
        rises.append(allowed[-1] - allowed[0])
    return np.array(rises)


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
    """Draw predicted against simulated responses by split, with R2 (Eq. 13) and RMSE.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `predictions` contains the split and the simulated and predicted
        responses of each sample, and `dataset` the standard errors. If `fresh` and
        `network` are given, points outside the design are predicted, too.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
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
    figure, axes = panels.grid(len(targets), 3.9, width=width, extra_height=0.4)
    draw_accuracy(axes, table, targets.responses)
    style.write_below(figure, ACCURACY_NOTE)
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
    style.name_panels(axes)


def _predict_new_points(inputs: Inputs, targets: Targets) -> pd.DataFrame:
    """Predict the responses at points outside the design.

    Parameters
    ----------
    inputs : mapping
        Paths of the final surrogate, as `network`, and of the simulated points, as
        `fresh`.
    targets : Targets
        The targets of the study.

    Returns
    -------
    DataFrame
        The points with their simulated means and predictions. Their split is "new
        points".
    """
    path = inputs["network"]
    model = load(path)
    points = read_table(
        inputs["fresh"], ("status", *model.inputs, *targets.names, *targets.errors)
    )
    points = points[points["status"] == "ok"].assign(split="new points")
    predicted_columns = [
        name_derived_column(name, "predicted") for name in model.outputs
    ]
    X = points[list(model.inputs)].to_numpy(float)
    points[predicted_columns] = model.predict(X)
    return points


def _draw_splits(panel: Axes, table: pd.DataFrame, plotted_response: Response) -> None:
    """Draw predicted against simulated values of one response, and write the accuracy.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        The samples, as for `draw_accuracy`.
    plotted_response : Response
        The response.
    """
    values = table[[plotted_response.name, plotted_response.predicted]].to_numpy()
    margin = 0.06 * (values.max() - values.min())
    ends = np.array([values.min() - margin, values.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)

    # The accuracy is written only for samples that the model has not seen.
    lines = []
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
            lines += _describe_accuracy(table, split, plotted_response)
    panel.set(xlim=ends, ylim=ends, aspect="equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(6))
    # Write the accuracy above the panel, where no point lies.
    panel.set_title("\n".join(lines), loc="right", fontsize=style.SMALL_TEXT_PT)


def _describe_accuracy(
    table: pd.DataFrame, split: str, plotted_response: Response
) -> list[str]:
    """Describe the accuracy of the surrogate, and of a perfect model, on a split.

    The errors of a perfect model would be the noise of the simulated means.

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

    # There are too few test samples to estimate the noise, so use the whole design, to
    # which new points do not belong.
    rows_for_noise = rows
    if split == "test":
        rows_for_noise = table[table["split"] != "new points"]
    errors = rows_for_noise[plotted_response.standard_error].to_numpy(float)
    noise = np.full(len(rows), np.sqrt(np.mean(errors**2)))
    perfect_accuracy = _format_accuracy(simulated, noise, unit)
    return [
        f"{split}, {len(rows)} sets: {surrogate_accuracy}",
        f"a perfect model on them: {perfect_accuracy}",
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
