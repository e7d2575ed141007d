"""Figures 10 and 13: the network, and the quality of its predictions."""

from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.bench.parameters import SYMBOLS
from repose.calibrate.responses import Response, response
from repose.calibrate.surrogates import Surrogate, kind_of, load
from repose.calibrate.surrogates.accuracy import r2
from repose.calibrate.targets import Targets
from repose.calibrate.training import r2_noise_corrected
from repose.common.files import read_json, read_table

from . import style
from .registry import Inputs, Shown, figure

ACTIVATIONS = {
    "tansig": "tanh",
    "purelin": "linear",
}  # by the names that MATLAB has for them
NETWORK = {"network": "network/network.json"}
SPLITS = (
    ("train", style.BLUE, "o"),
    ("validation", style.ORANGE, "s"),
    ("test", style.RED, "^"),
    ("new points", style.PURPLE, "D"),
)
UNSEEN = ("test", "new points")  # by what predicts them
INFLUENCE_POINTS = 1024
INFLUENCE = (
    "influence: share of the variance of the predicted response, over the ranges of all parameters, in which the input "
    "has a part (total Sobol index); arrow: the response rises or falls from the input's least to its largest value. "
    "These are total effects; they add up to more than 100 % where parameters interact. "
    "An input's lines are as thick as its mean influence."
)
BELOW = (
    "bars: ± 1 standard error of the simulated mean over its pours. R²: share of the variance of the simulated means "
    "that the prediction explains; these means scatter, and no prediction can follow that. R² corrected for the "
    "scatter of the pours: the same without this scatter, as if each mean were of very many pours; ≈ 1: the noise of "
    "the pours explains all of the error."
)


@figure(
    "figure10",
    "Figure 10",
    NETWORK,
    reads=("parameters", "design.seed"),
    when=lambda study: kind_of(study.settings.surrogate).is_network,
)
def network_structure(inputs: Inputs, study: Shown) -> Figure:
    """Draw the best network; an input's lines are as thick as its influence, not its weights.

    Weights mislead: large ones cancel where two hidden neurons pull the same response in opposite directions.

    Figure 10. The trained network: {inputs} parameters in, {network[hidden]} hidden neurons, {outputs} response(s) out.
    The lines of a parameter are as thick as its influence on what the network predicts (total Sobol index, as in
    ``sensitivity/sobol.csv``), not as its weights: large weights can cancel.
    """
    network = read_json(
        inputs["network"], ("inputs", "outputs", "W1", "W2"), "the file of a network"
    )
    counts = (*np.atleast_2d(network["W1"]).T.shape, len(network["outputs"]))
    places = [_column(x, n) for x, n in enumerate(counts)]
    shares, ways = influence(load(inputs["network"]), study)
    symbols = [response(name, inputs["network"]).symbol for name in network["outputs"]]
    width = 0.36 + 0.05 * max(map(len, symbols))  # of a column of shares
    figure, (panel,) = style.grid(
        1, 3.7, width=style.COLUMN * (1.2 + 0.33 * width * counts[2])
    )
    _connections(panel, shares, places)
    hidden, output = (
        ACTIVATIONS.get(name, name) for name in network.get("activation", ACTIVATIONS)
    )
    titles = ("input", f"hidden ({hidden})", f"output ({output})")
    for x, (title, nodes) in enumerate(zip(titles, places, strict=True)):
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
    for (x, y), name in zip(places[0], network["inputs"], strict=True):
        panel.text(x - 0.11, y, SYMBOLS[name], ha="right", va="center", fontsize=8.5)
    for (x, y), symbol in zip(places[2], symbols, strict=True):
        panel.text(x + 0.11, y, symbol, ha="left", va="center", fontsize=8)
    for k, symbol in enumerate(symbols):
        x = -0.45 - width * (counts[2] - k - 0.5)
        panel.text(
            x, 1.13, f"influence on\n{symbol}", ha="center", va="bottom", fontsize=6.8
        )
        for (_, y), share, way in zip(places[0], shares[k], ways[k], strict=True):
            words = f"{100 * share:.0f} % {'↗' if way > 0 else '↘'}" if way else "none"
            panel.text(
                x,
                y,
                words,
                ha="center",
                va="center",
                fontsize=7.5,
                alpha=0.45 + 0.55 * min(share, 1.0),
            )
    right = 2.45 + 0.055 * max(0, max(map(len, symbols)) - 6)
    panel.set(xlim=(-0.5 - width * counts[2], right), ylim=(-1.1, 1.38))
    panel.axis("off")
    style.below(figure, INFLUENCE)
    return figure


def influence(model: Surrogate, study: Shown) -> tuple[np.ndarray, np.ndarray]:
    """Give the total Sobol index of each input for each output of a surrogate, and the sign of the output's rise.

    Both have the shape (outputs, inputs), and are 0 for a fixed input, and for all if an output is constant.
    """
    from repose.calibrate.uncertainty.sensitivity import indices, main_effects

    space, seed = study.space, study.design.seed
    shares, ways = np.zeros((2, len(model.outputs), len(model.inputs)))
    free = [model.inputs.index(name) for name in space.free]

    def respond(values: np.ndarray) -> np.ndarray:
        return model.predict(space.complete(values))

    try:
        total = indices(respond, space.low, space.high, INFLUENCE_POINTS, 1, seed)[
            "total"
        ]
    except ValueError:  # a constant output
        return shares, ways
    _, means = main_effects(respond, space.low, space.high, seed, points=2)
    shares[:, free], ways[:, free] = total, np.sign(means[:, 1] - means[:, 0]).T
    return shares, ways


def _connections(panel: Axes, shares: np.ndarray, places: list[np.ndarray]) -> None:
    """Draw a line between each node of a layer and of the next; an input's by its mean share."""
    mean = shares.mean(axis=0)
    sizes = mean / (mean.max() or 1.0), np.zeros(len(places[1]))
    for (nodes, following), of_layer in zip(pairwise(places), sizes, strict=True):
        for (x0, y0), size in zip(nodes, of_layer, strict=True):
            look = {
                "color": style.BLUE if size else style.GREY,
                "alpha": 0.25 + 0.5 * size,
            }
            for x1, y1 in following:
                panel.plot([x0, x1], [y0, y1], lw=0.3 + 2.2 * size, zorder=1, **look)


def _column(x: float, count: int) -> np.ndarray:
    """Give the places (count, 2) of a layer's nodes, top to bottom; few nodes stand closer together."""
    reach = min(1.0, 0.11 * (count + 1)) if count > 1 else 0.0
    return np.column_stack(
        [np.full(count, float(x)), np.linspace(reach, -reach, count)]
    )


OF_FITS = {"predictions": "network/predictions.csv", "dataset": "dataset.csv"}
FRESH = {"fresh": "pool/fresh_dataset.csv"}


@figure(
    "figure13",
    "Figure 13",
    OF_FITS,
    optional=NETWORK,
    if_there=FRESH,
    reads=("targets",),
)
def predicted_against_simulated(inputs: Inputs, study: Shown) -> Figure:
    """Draw predicted over simulated responses by split, with y = x, R2 (Eq. 13) and RMSE.

    R2 at unseen points is also given without the noise of the simulated means, `repose.calibrate.training.r2_noise_corrected`.

    Figure 13. Predicted against simulated responses, on equal axes. Samples without a result are left out. A mean
    of few pours scatters about its true value, so no model can be nearer to the line than that scatter. The
    corrected R2 is the estimate without it. The parts are predicted by the training part's fit, new points,
    where they were poured, by the final one.
    """
    targets = study.targets
    table = read_table(
        inputs["predictions"], ("sample", "split", *targets.names, *targets.predicted)
    )
    errors = read_table(inputs["dataset"], ("sample", *targets.errors))[
        ["sample", *targets.errors]
    ]
    table = table.merge(errors, on="sample", how="left")
    if {"fresh", "network"} <= inputs.keys():
        table = pd.concat([table, _new_points(inputs, targets)])
    figure, panels = style.grid(
        len(targets), 3.9, width=0.5 * style.PAGE * min(len(targets), 2)
    )
    for panel, shown in zip(panels, targets.responses, strict=True):
        _scatter_by_split(panel, table, shown)
        panel.set(
            xlabel=style.response_label(shown, "simulated"),
            ylabel=style.response_label(shown, "predicted"),
        )
    style.name_panels(panels)
    panels[-1].legend(loc="lower right", handletextpad=0.2)
    style.below(figure, BELOW)
    return figure


def _new_points(inputs: Inputs, targets: Targets) -> pd.DataFrame:
    """Give the means of the points that were poured beside the design, with the predictions of the final surrogate."""
    model = load(inputs["network"])
    points = read_table(
        inputs["fresh"], ("status", *model.inputs, *targets.names, *targets.errors)
    )
    points = points[points["status"] == "ok"].assign(split="new points")
    predicted = [response(name, inputs["network"]).predicted for name in model.outputs]
    points[predicted] = model.predict(points[list(model.inputs)].to_numpy(float))
    return points


def _scatter_by_split(panel: Axes, table: pd.DataFrame, shown: Response) -> None:
    """Draw the points of one response on equal axes with y = x; R2, RMSE and number of each split above."""
    lines = []
    both = table[[shown.name, shown.predicted]].to_numpy()
    margin = 0.06 * (both.max() - both.min())
    ends = np.array([both.min() - margin, both.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)
    for split, colour, marker in SPLITS:
        rows = table[table["split"] == split]
        if rows.empty:
            continue
        simulated, predicted, error = (
            rows[[shown.name, shown.predicted, shown.error]].to_numpy(float).T
        )
        look: dict[str, Any] = {
            "fmt": marker,
            "color": colour,
            "ecolor": (*to_rgb(colour), 0.45),
            "label": split,
        }
        look |= {
            "ms": 3.2,
            "mec": "white",
            "mew": 0.3,
            "elinewidth": 0.5,
            "zorder": 2 + (split in UNSEEN),
        }
        panel.errorbar(simulated, predicted, xerr=np.nan_to_num(error), **look)
        share, rmse = (
            r2(simulated, predicted),
            np.sqrt(np.mean((simulated - predicted) ** 2)),
        )
        lines.append(
            f"{split}: R² {_share(share)}, RMSE {rmse:.2f} {shown.unit}, n {len(rows)}"
        )
        if split in UNSEEN:
            exact = r2_noise_corrected(simulated, predicted, error)
            lines.append(
                f"    R² {_share(exact)} corrected for the scatter of the pours"
            )
    panel.set(xlim=ends, ylim=ends, aspect="equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(6))
    style.note(panel, "\n".join(lines), x=0.06, y=1.02, va="bottom")


def _share(r2: float | None) -> str:
    """Say R2 in words; an estimate without noise can pass 1."""
    return "undefined" if r2 is None else "≈ 1" if r2 > 1 else f"{r2:.3f}"
