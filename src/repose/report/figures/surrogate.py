"""Figures 10 and 13: the network, and the quality of its predictions."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.bench.parameters import SYMBOLS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Response, response
from repose.calibrate.surrogates import Surrogate, load, surrogate_class
from repose.calibrate.surrogates.accuracy import r2
from repose.calibrate.targets import Targets
from repose.calibrate.training import r2_noise_corrected
from repose.common.files import read_json, read_table

from . import panels, style
from .registry import Inputs, StudyView, figure

# Activations by the names that MATLAB has for them.
ACTIVATIONS = {"tansig": "tanh", "purelin": "linear"}
NETWORK = {"network": "network/network.json"}
# Parts of the samples: name in the table, colour and marker.
SPLITS = (
    ("train", style.BLUE, "o"),
    ("validation", style.ORANGE, "s"),
    ("test", style.RED, "^"),
    ("new points", style.PURPLE, "D"),
)
UNSEEN_SPLITS = ("test", "new points")  # by the model that predicts them
INFLUENCE_POINTS = 1024
INFLUENCE_WORDS = (
    "influence: share of the variance of the predicted response, over the ranges of "
    "all parameters, in which the input has a part (total Sobol index); arrow: the "
    "response rises or falls from the input's least to its largest value. These are "
    "total effects; they add up to more than 100 % where parameters interact. An "
    "input's lines are as thick as its mean influence."
)
ACCURACY_WORDS = (
    "bars: ± 1 standard error of the simulated mean over its pours. R²: share of the "
    "variance of the simulated means that the prediction explains; these means "
    "scatter, and no prediction can follow that. R² corrected for the scatter of the "
    "pours: the same without this scatter, as if each mean were of very many pours; ≈ "
    "1: the noise of the pours explains all of the error."
)


class Influence(NamedTuple):
    """Influence of the inputs of a surrogate on its outputs, (outputs, inputs).

    It is 0 for a fixed input, and for all inputs if an output is constant.
    """

    share: np.ndarray  # total Sobol index
    direction: np.ndarray  # sign of the output's rise


class Layers(NamedTuple):
    """Places (n, 2) of the nodes of a network."""

    inputs: np.ndarray
    hidden: np.ndarray
    outputs: np.ndarray


# --- The network ----------------------------------------------------------------------


@figure(
    "figure10",
    "Figure 10",
    NETWORK,
    reads=("parameters", "design.seed"),
    when=lambda study: surrogate_class(study.settings.surrogate).is_network,
)
def network_structure(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the network; the lines of an input are as thick as its influence.

    Weights mislead: large ones cancel where two hidden neurons pull the same response
    in opposite directions.

    Figure 10. The trained network: {inputs} parameters in, {network[hidden]} hidden
    neurons, {outputs} response(s) out. The lines of a parameter are as thick as its
    influence on what the network predicts (total Sobol index, as in
    ``sensitivity/sobol.csv``), not as its weights: large weights can cancel.
    """
    path = inputs["network"]
    network = read_json(
        path, ("inputs", "outputs", "W1", "W2"), "the file of a network"
    )
    n_hidden, n_inputs = np.shape(np.atleast_2d(network["W1"]))
    n_outputs = len(network["outputs"])
    layers = Layers(
        inputs=_node_places(0, n_inputs),
        hidden=_node_places(1, n_hidden),
        outputs=_node_places(2, n_outputs),
    )
    influence = influence_of_inputs(
        load(path), study.parameters, study.settings.design.seed
    )
    symbols = [response(name, path).symbol for name in network["outputs"]]
    longest_symbol = max(map(len, symbols))

    column_width = 0.36 + 0.05 * longest_symbol  # of the shares of one output
    figure, (panel,) = panels.grid(
        1, 3.7, width=style.COLUMN * (1.2 + 0.33 * column_width * n_outputs)
    )
    _draw_connections(panel, influence.share, layers)
    activations = network.get("activation", ACTIVATIONS)
    hidden, output = (ACTIVATIONS.get(name, name) for name in activations)
    titles = ("input", f"hidden ({hidden})", f"output ({output})")
    for x, (title, nodes) in enumerate(zip(titles, layers, strict=True)):
        panel.scatter(
            *nodes.T,
            s=95,
            color="white",
            edgecolor=style.BLACK,
            linewidth=1.2,
            zorder=2,
        )
        panel.text(
            x, 1.13, f"{title}\n{len(nodes)}", ha="center", va="bottom", fontsize=7.5
        )
    for (x, y), name in zip(layers.inputs, network["inputs"], strict=True):
        panel.text(x - 0.11, y, SYMBOLS[name], ha="right", va="center", fontsize=8.5)
    for (x, y), symbol in zip(layers.outputs, symbols, strict=True):
        panel.text(x + 0.11, y, symbol, ha="left", va="center", fontsize=8)
    heights = layers.inputs[:, 1]
    _write_influence(
        panel, influence, heights=heights, symbols=symbols, column_width=column_width
    )

    left = -0.5 - column_width * n_outputs
    right = 2.45 + 0.055 * max(0, longest_symbol - 6)
    panel.set(xlim=(left, right), ylim=(-1.1, 1.38))
    panel.axis("off")
    style.below(figure, INFLUENCE_WORDS)
    return figure


def influence_of_inputs(
    model: Surrogate, parameters: ParameterSpace, seed: int
) -> Influence:
    """Compute how much, and in which direction, each input changes each output."""
    from repose.calibrate.uncertainty.sensitivity import indices, main_effects

    shape = len(model.outputs), len(model.inputs)
    influence = Influence(share=np.zeros(shape), direction=np.zeros(shape))
    free_columns = [model.inputs.index(name) for name in parameters.free]

    def respond(values: np.ndarray) -> np.ndarray:
        return model.predict(parameters.complete(values))

    low = parameters.low
    high = parameters.high
    try:
        sobol = indices(
            respond, low, high=high, samples=INFLUENCE_POINTS, resamples=1, seed=seed
        )
    except ValueError:
        # An output is constant.
        return influence
    _, means = main_effects(respond, low, high=high, seed=seed, points=2)
    influence.share[:, free_columns] = sobol["total"]
    influence.direction[:, free_columns] = np.sign(means[:, 1] - means[:, 0]).T
    return influence


def _node_places(x: float, count: int) -> np.ndarray:
    """Give the places (count, 2) of a layer's nodes from the top.

    Few nodes stand closer together.
    """
    half_height = 0.0
    if count > 1:
        half_height = min(1.0, 0.11 * (count + 1))
    y = np.linspace(half_height, -half_height, count)
    return np.column_stack([np.full(count, float(x)), y])


def _draw_connections(panel: Axes, share: np.ndarray, layers: Layers) -> None:
    """Draw a line between each node of a layer and of the next one.

    The lines of an input are as thick as its mean share (outputs, inputs).
    """
    mean_share = share.mean(axis=0)
    thickness = mean_share / (mean_share.max() or 1.0)
    no_thickness = np.zeros(len(layers.hidden))
    _connect(panel, layers.inputs, next_nodes=layers.hidden, thickness=thickness)
    _connect(panel, layers.hidden, next_nodes=layers.outputs, thickness=no_thickness)


def _connect(
    panel: Axes, nodes: np.ndarray, next_nodes: np.ndarray, thickness: np.ndarray
) -> None:
    """Draw a line from each node to each of the next; `thickness` from 0 to 1 a node."""
    for (x0, y0), size in zip(nodes, thickness, strict=True):
        for x1, y1 in next_nodes:
            panel.plot(
                [x0, x1],
                [y0, y1],
                lw=0.3 + 2.2 * size,
                zorder=1,
                color=style.BLUE if size else style.GREY,
                alpha=0.25 + 0.5 * size,
            )


def _write_influence(
    panel: Axes,
    influence: Influence,
    heights: np.ndarray,
    symbols: Sequence[str],
    column_width: float,
) -> None:
    """Write the influence of each input to the left of it, a column for each output.

    `heights` are those of the input nodes, `symbols` those of the outputs.
    """
    for k, symbol in enumerate(symbols):
        x = -0.45 - column_width * (len(symbols) - k - 0.5)
        panel.text(
            x,
            1.13,
            f"influence on\n{symbol}",
            ha="center",
            va="bottom",
            fontsize=style.SMALL_TEXT_PT,
        )
        for y, share, direction in zip(
            heights, influence.share[k], influence.direction[k], strict=True
        ):
            words = "none"
            if direction:
                arrow = "↗" if direction > 0 else "↘"
                words = f"{100 * share:.0f} % {arrow}"
            panel.text(
                x,
                y,
                words,
                ha="center",
                va="center",
                fontsize=7.5,
                alpha=0.45 + 0.55 * min(share, 1.0),
            )


# --- Its predictions ------------------------------------------------------------------


@figure(
    "figure13",
    "Figure 13",
    {"predictions": "network/predictions.csv", "dataset": "dataset.csv"},
    optional=NETWORK,
    if_there={"fresh": "pool/fresh_dataset.csv"},
    reads=("targets",),
)
def predicted_against_simulated(inputs: Inputs, study: StudyView) -> Figure:
    """Draw predicted over simulated responses by split, with R2 (Eq. 13) and RMSE.

    `predictions` has the split, the simulated and the predicted responses of each
    sample, `dataset` their standard errors. R2 at unseen points is also given without
    the noise of the simulated means, `repose.calibrate.training.r2_noise_corrected`.

    Figure 13. Predicted against simulated responses, on equal axes. Samples without a
    result are left out. A mean of few pours scatters about its true value, so no model
    can be nearer to the line than that scatter. The corrected R2 is the estimate without
    it. The parts are predicted by the training part's fit, new points, where they were
    poured, by the final one.
    """
    targets = study.targets
    table = read_table(
        inputs["predictions"], ("sample", "split", *targets.names, *targets.predicted)
    )
    error_columns = ["sample", *targets.errors]
    errors = read_table(inputs["dataset"], error_columns)[error_columns]
    table = table.merge(errors, on="sample", how="left")
    if {"fresh", "network"} <= inputs.keys():
        table = pd.concat([table, _predict_new_points(inputs, targets)])

    width = 0.5 * style.PAGE * min(len(targets), 2)
    figure, axes = panels.grid(len(targets), 3.9, width=width)
    for panel, shown in zip(axes, targets.responses, strict=True):
        _draw_splits(panel, table, shown)
        panel.set(
            xlabel=style.response_label(shown, "simulated"),
            ylabel=style.response_label(shown, "predicted"),
        )
    style.name_panels(axes)
    axes[-1].legend(loc="lower right", handletextpad=0.2)
    style.below(figure, ACCURACY_WORDS)
    return figure


def _predict_new_points(inputs: Inputs, targets: Targets) -> pd.DataFrame:
    """Give the means of the points that were poured beside the design, with predictions.

    The final surrogate predicts them.
    """
    path = inputs["network"]
    model = load(path)
    points = read_table(
        inputs["fresh"], ("status", *model.inputs, *targets.names, *targets.errors)
    )
    points = points[points["status"] == "ok"].assign(split="new points")
    predicted_columns = [response(name, path).predicted for name in model.outputs]
    X = points[list(model.inputs)].to_numpy(float)
    points[predicted_columns] = model.predict(X)
    return points


def _draw_splits(panel: Axes, table: pd.DataFrame, shown: Response) -> None:
    """Draw the points of one response on equal axes, with its accuracy by split above."""
    values = table[[shown.name, shown.predicted]].to_numpy()
    margin = 0.06 * (values.max() - values.min())
    ends = np.array([values.min() - margin, values.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)

    lines = []
    for split, colour, marker in SPLITS:
        rows = table[table["split"] == split]
        if rows.empty:
            continue
        simulated = rows[shown.name].to_numpy(float)
        predicted = rows[shown.predicted].to_numpy(float)
        error = rows[shown.error].to_numpy(float)
        is_unseen = split in UNSEEN_SPLITS
        look: dict[str, Any] = {
            "fmt": marker,
            "color": colour,
            "ecolor": (*to_rgb(colour), 0.45),
            "ms": 3.2,
            "mec": "white",
            "mew": 0.3,
            "elinewidth": 0.5,
            "zorder": 3 if is_unseen else 2,
        }
        panel.errorbar(
            simulated, predicted, xerr=np.nan_to_num(error), label=split, **look
        )
        share = _r2_text(r2(simulated, predicted))
        rmse = np.sqrt(np.mean((simulated - predicted) ** 2))
        lines.append(
            f"{split}: R² {share}, RMSE {rmse:.2f} {shown.unit}, n {len(rows)}"
        )
        if is_unseen:
            corrected = _r2_text(r2_noise_corrected(simulated, predicted, error))
            lines.append(f"    R² {corrected} corrected for the scatter of the pours")
    panel.set(xlim=ends, ylim=ends, aspect="equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(6))
    style.note(panel, "\n".join(lines), x=0.06, y=1.02, va="bottom")


def _r2_text(share: float | None) -> str:
    """Write R2; an estimate without noise can pass 1."""
    if share is None:
        return "undefined"
    if share > 1:
        return "≈ 1"
    return f"{share:.3f}"
