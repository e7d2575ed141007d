"""Parts of the method compared with their alternatives."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from repose.common.files import read_table
from repose.report.figures import style

COLOURS = (
    style.BLUE,
    style.SKY,
    style.RED,
    style.GREEN,
    style.ORANGE,
    style.PURPLE,
    style.GREY,
    style.BLACK,
)
MARKERS = "osD^vP*X"
LEAST_MISSED = 0.003  # of the explainable variance; an unbiased share may exceed one


def accuracy(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """R2 at the fresh points and its explainable share over the number of training simulations, a column per response.

    Input: ``accuracy`` of the script comparison.
    """
    keys = (
        "r2",
        "r2_low",
        "r2_high",
        "r2_bar",
        "explainable",
        "explainable_low",
        "explainable_high",
    )
    columns = (
        "training",
        "simulations",
        "seeds",
        "response",
        "reachable_r2",
        *keys,
        "explainable_bar",
    )
    table = read_table(inputs["accuracy"], columns)
    responses = style.read_targets(config).responses
    figure = style.new_figure(style.PAGE, 4.4)
    panels = figure.subplots(
        2, len(responses), sharex=True, sharey="row", squeeze=False
    )
    for column, response in zip(panels.T, responses, strict=True):
        rows = table[table["response"] == response.name]
        for panel, key in zip(column, ("r2", "explainable"), strict=True):
            _with_intervals(panel, rows, key)
            panel.set(ylim=_limits(table[key]))
            _plain_ticks(panel, table["simulations"])
        column[0].set_title(response.symbol)
        column[0].plot(
            rows["simulations"],
            rows["reachable_r2"],
            "_",
            color=style.GREY,
            label="most that the noise lets any model reach",
        )
        column[1].set_xlabel("simulations trained on")
    for panel, label in zip(
        panels[:, 0], ("R²", "share of the explainable\nvariance"), strict=True
    ):
        panel.set_ylabel(label)
    _legend_below(figure, panels[0, 0])
    return figure


def _with_intervals(panel, rows, key):
    """Draw a mark for each training set with its interval, and the bar that a surrogate should reach."""
    sources = list(dict.fromkeys(rows["training"]))
    for k, source in enumerate(sources):
        source_rows = rows[rows["training"] == source]
        bars = np.abs(
            source_rows[[f"{key}_low", f"{key}_high"]].to_numpy().T
            - source_rows[key].to_numpy()
        )
        # so that no bar hides another
        place = source_rows["simulations"] * 1.04 ** (k - len(sources) / 2)
        look = {
            "color": COLOURS[k],
            "marker": MARKERS[k],
            "ms": 4,
            "ls": "none",
            "lw": 0.8,
        }
        panel.errorbar(place, source_rows[key], yerr=bars, label=source, **look)
    panel.axhline(
        rows[f"{key}_bar"].iloc[0],
        color=style.BLACK,
        ls="--",
        lw=0.8,
        label="asked for",
    )
    panel.set_xscale("log")


def surrogates(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """Missed explainable variance over the simulations, a line per model; open marks for the main design.

    Input: ``surrogates`` of the script comparison.
    """
    table = read_table(
        inputs["surrogates"],
        (
            "model",
            "training",
            "simulations",
            "response",
            "explainable",
            "explainable_se",
        ),
    )
    responses = style.read_targets(config).responses
    figure = style.new_figure(style.PAGE, 3.5)
    panels = figure.subplots(1, len(responses), sharey=True, squeeze=False)[0]
    for panel, response in zip(panels, responses, strict=True):
        for k, model in enumerate(dict.fromkeys(table["model"])):
            rows = table[
                (table["model"] == model) & (table["response"] == response.name)
            ]
            drawn = rows[rows["training"] == "pool"].sort_values("simulations")
            look = {"color": COLOURS[k], "marker": MARKERS[k], "ms": 4}
            _missed(panel, drawn["simulations"], drawn, label=model, **look)
            main = rows[rows["training"] != "pool"]
            _missed(
                panel,
                main["simulations"] * 1.1,
                main,
                mfc="none",
                **look | {"ls": "none"},
            )
        panel.set(
            title=response.symbol,
            xscale="log",
            xlabel="simulations (open marks: main design)",
        )
        _plain_ticks(panel, table.loc[table["training"] == "pool", "simulations"])
    _missed_axes(panels)
    _legend_below(figure, panels[0])
    return figure


def sampling(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """Explainable variance that the network misses, by design (above) and by points against seeds (below).

    All fits by seeds per point; real simulations have open marks. Input: ``sampling`` of the script comparison.
    """
    keys = ("comparison", "design", "data", "fit", "points", "seeds", "response")
    table = read_table(inputs["sampling"], (*keys, "explainable", "explainable_se"))
    designs = table[(table["comparison"] == "designs") & (table["fit"] == "network")]
    trades = table[table["comparison"] == "points against seeds"]
    responses = style.read_targets(config).responses
    figure = style.new_figure(style.PAGE, 5.8)
    halves = figure.subfigures(2, 1)
    panels = np.array(
        [
            half.subplots(1, len(responses), sharey=True, squeeze=False)[0]
            for half in halves
        ]
    )
    for column, response in zip(panels.T, responses, strict=True):
        _lines(
            column[0], designs[designs["response"] == response.name], "design", "points"
        )
        _lines(column[1], trades[trades["response"] == response.name], "fit", "seeds")
        column[0].set(title=response.symbol)
        column[1].set(xlabel="seeds per point, at the same number of simulations")
    for half, row in zip(halves, panels, strict=True):
        _missed_axes(row)
        _legend_below(half, row[0])
    return figure


def _lines(panel, rows, kind, size):
    """Draw a line for each kind, emulated or real, over a size; a kind keeps its colour."""
    looks = {name: k for k, name in enumerate(dict.fromkeys(rows[kind]))}
    for place, (name, data) in enumerate(
        dict.fromkeys(zip(rows[kind], rows["data"], strict=True))
    ):
        k = looks[name]
        line_rows = rows[(rows[kind] == name) & (rows["data"] == data)].sort_values(
            size
        )
        _missed(
            panel,
            line_rows[size] * 1.015**place,
            line_rows,
            color=COLOURS[k % len(COLOURS)],
            marker=MARKERS[k % len(MARKERS)],
            ms=4,
            mfc="none" if data == "real" else None,
            ls=":" if data == "real" else "-",
            label=f"{name}, {data}",
        )
    panel.set(xscale="log", xlabel=size)
    _plain_ticks(panel, rows[size])


def _missed(panel, place, rows, **look):
    """Missed share of the explainable variance, with its standard error if known."""
    missed = np.maximum(1 - rows["explainable"].to_numpy(), LEAST_MISSED)
    error = np.nan_to_num(rows["explainable_se"].to_numpy(dtype=float))
    panel.errorbar(place, missed, yerr=[np.minimum(error, 0.9 * missed), error], **look)


def _missed_axes(panels):
    """Logarithmic axes of the missed share, the best on top; shares above 1 are cut off."""
    panels[0].set_ylabel("explainable variance\nmissed (%, best on top)")
    shares = np.array([1, 2, 5, 10, 20, 50, 100])
    for panel in panels:
        panel.set_yscale("log")
        panel.set_yticks(shares / 100, [f"{share}" for share in shares])
    least = min(panel.dataLim.y0 for panel in panels)
    most = max(panel.dataLim.y1 for panel in panels)
    panels[0].set_ylim(min(1.0, 1.25 * most), max(LEAST_MISSED, 0.8 * least))
    for panel in panels:
        panel.minorticks_off()


def _legend_below(figure, panel):
    """Put the panel's legend below all panels, where it hides nothing."""
    figure.legend(
        *panel.get_legend_handles_labels(), loc="outside lower center", ncols=3
    )


def _plain_ticks(panel, values):
    """Plain numbers on a logarithmic axis, at most six of them."""
    ticks = np.unique(values)
    # their numbers would overlap
    ticks = ticks[np.append(True, ticks[1:] > 1.15 * ticks[:-1])]
    ticks = ticks[
        np.linspace(0, len(ticks) - 1, min(6, len(ticks))).round().astype(int)
    ]
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.minorticks_off()
    panel.grid(True)


def _limits(shares):
    """Return the ends of the axis of shares: from the smallest, but not below 0, to 1."""
    return max(0.0, float(shares.min()) - 0.05), max(1.02, float(shares.max()) + 0.02)
