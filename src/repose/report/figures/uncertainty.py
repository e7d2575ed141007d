"""Uncertainty of the answer: noise floor, posterior, sensitivity."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from repose.bench.parameters import SYMBOLS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Target, Targets
from repose.common.files import read_json, read_table

from . import style
from .registry import OF_POSTERIOR, Inputs, Shown, figure

CREDIBLE_SHARES = (0.95, 0.5)  # of the posterior inside a contour
SEEDS = (1, 2, 4, 8, 16, 32, 64)
PERCENT = (0.5, 1, 2, 5)
PUBLISHED = ["published_low", "published_high"]

Tables = tuple[
    pd.DataFrame, pd.DataFrame, Mapping[str, Any]
]  # posterior.csv, draws.csv, posterior.json

UNCERTAINTY: dict[str, Any] = {
    "reads": ("parameters", "targets"),
    "category": "Uncertainty",
}


NOISE = {"runs": "runs.csv", "seeds": "noise/seeds.csv", "noise": "noise/noise.json"}


@figure("noise", "Noise floor", NOISE, folder="noise", **UNCERTAINTY)
def noise_floor(inputs: Inputs, study: Shown) -> Figure:
    """Draw runs about the mean of their sample; standard error and reachable R2 over the number of seeds.

    Runs of the same parameters and runs of others, and the standard error that a number of seeds buys.
    ``noise.json`` has the correlation of the responses within samples.
    """
    targets = study.targets
    runs, seeds = (
        read_table(inputs["runs"], ("sample", "status", *targets.names)),
        read_table(inputs["seeds"]),
    )
    rows = read_json(inputs["noise"], ("responses",))["responses"]
    # a panel for each response, two in a row, and two panels over the seeds below them
    places = [[k, min(k + 1, len(targets) - 1)] for k in range(0, len(targets), 2)]
    figure = style.new_figure(style.PAGE, 2.15 + 2.45 * len(places))
    *above, error, r2 = figure.subplot_mosaic(
        [*places, [-2, -1]], height_ratios=[1.15] * len(places) + [1]
    ).values()
    for k, (panel, target) in enumerate(zip(above, targets, strict=True)):
        ok = runs[(runs["status"] == "ok") & runs[target.name].notna()]
        _runs_by_mean(panel, ok, target.name, style.series(k)["color"])
        panel.set(
            xlabel="samples, in order of their mean (line)",
            ylabel=style.response_label(target.response),
        )
        _variances(panel, target.response.unit, rows[target.name])
        _over_seeds(error, r2, seeds, target, style.series(k))
    error.set(ylabel="standard error of a mean\n(% of the target)", yscale="log")
    error.set_yticks(PERCENT, [f"{value:g}" for value in PERCENT])
    r2.set(ylabel="R² of a perfect predictor\non means over the seeds", ylim=(None, 1))
    for panel in (error, r2):
        panel.set(xlabel="seeds per sample", xscale="log")
        panel.set_xticks(SEEDS, SEEDS)
        panel.minorticks_off()
        panel.grid(True)
    style.name_panels([*above, error, r2])
    error.legend()
    r2.legend(loc="lower right", title="band: 95 % interval", title_fontsize=6.8)
    return figure


def _variances(panel: Axes, unit: str, row: Mapping[str, float]) -> None:
    """Draw the standard deviations of a response, in words, above its runs."""
    lines = (
        f"standard deviation within samples {row['sd_within']:.2f} {unit}",
        f"between samples {row['sd_between']:.2f} {unit}",
        f"intraclass correlation {row['icc']:.2f} ({row['icc_low']:.2f}–{row['icc_high']:.2f})",
    )
    bottom, top = panel.get_ylim()
    panel.set_ylim(bottom, top + 0.2 * (top - bottom))
    style.note(panel, "\n".join(lines), y=0.99)


def _over_seeds(
    error: Axes, r2: Axes, seeds: pd.DataFrame, target: Target, look: Mapping[str, str]
) -> None:
    """Draw the standard error and reachable R2 of one response."""
    name, label = target.response.quantity, target.response.symbol
    error.plot(seeds["seeds"], seeds[f"{name}_se_percent"], label=label, **look)
    band = (seeds[f"{name}_reachable_r2_{end}"] for end in ("low", "high"))
    r2.fill_between(seeds["seeds"], *band, color=look["color"], alpha=0.2, lw=0)
    r2.plot(seeds["seeds"], seeds[f"{name}_reachable_r2"], label=label, **look)


def _runs_by_mean(panel: Axes, ok: pd.DataFrame, column: str, colour: str) -> None:
    """Draw the runs of each sample, the samples in order of their means."""
    means = ok.groupby("sample")[column].mean().sort_values()
    place = pd.Series(np.arange(len(means)), index=means.index)
    panel.scatter(
        ok["sample"].map(place), ok[column], s=2.5, color=colour, alpha=0.45, lw=0
    )
    panel.plot(place, means, color=style.BLACK, lw=1.2)


MARKS = ("D", "^", "s", "v")  # of published sets, a source each
PUBLISHED_SETS: dict[str, Any] = {
    "facecolor": "none",
    "edgecolor": style.ORANGE,
    "linewidth": 1.2,
}
DRAWS = {"draws": "posterior/draws.csv", "posterior": "posterior/posterior.csv"}
DRAWS |= {"summary": "posterior/posterior.json", "feasible": "miga/feasible.csv"}


@figure("corner", "Posterior", DRAWS, if_there={"stored": "{stored}"}, **OF_POSTERIOR)
def corner(inputs: Inputs, study: Shown) -> Figure:
    """Draw the posterior's draws, alone and in pairs, with solutions of the search and published intervals.

    The free parameters given the physical measurements: draws of the posterior, with the feasible solutions of the
    search. A parameter whose draws fill its range is not determined by the targets. Published parameter sets are
    marked; one of another wall stands in the panels of two grain-grain parameters alone.
    """
    names, figure = study.space.names, style.new_figure(style.PAGE, style.PAGE)
    draws, table = (
        read_table(inputs["draws"], names),
        read_table(inputs["posterior"], ("parameter",)),
    )
    cloud, summary = (
        read_table(inputs["feasible"], names),
        read_json(inputs["summary"], ("predicted",)),
    )
    sets = read_table(inputs["stored"]) if "stored" in inputs else pd.DataFrame()
    marks = []
    if {"source", "wall", *names} <= set(sets):
        sets["wall"] = sets["wall"].fillna("").astype(str)
        marks = [*zip(MARKS, sets.groupby(["source", "wall"]), strict=False)]
    draw_corner(
        figure, study, (table, draws, summary), cloud, "solutions of the search", marks
    )
    return figure


def draw_corner(
    figure: FigureBase,
    study: Shown,
    posterior: Tables,
    cloud: pd.DataFrame,
    words: str,
    marks: Sequence[Any] = (),
) -> None:
    """Draw a `repose.calibrate.uncertainty.posterior.Posterior` in an empty figure, with parameter sets, which `words` name.

    `marks` are published sets: marker, source and wall, table.
    """
    table, draws, summary = posterior
    space, table, published = (
        study.space,
        table.set_index("parameter"),
        "published_low" in table,
    )
    for panel, across, down in style.pairs_of_parameters(figure, study, 0.02):
        if across == down:
            _marginal(panel, draws[across], study, table.loc[across])
            continue
        _pair(panel, draws, across, down, study.ranges)
        panel.scatter(cloud[across], cloud[down], s=5, color=style.RED, lw=0, zorder=4)
        if published and table.loc[[across, down], "published_low"].notna().all():
            (x0, x1), (y0, y1) = (
                table.loc[name, PUBLISHED].astype(float) for name in (across, down)
            )
            panel.add_patch(
                Rectangle(
                    (x0, y0),
                    x1 - x0,
                    y1 - y0,
                    fill=False,
                    ec=style.BLACK,
                    lw=1.1,
                    zorder=5,
                )
            )
        for marker, ((_, wall), sets) in marks:
            if not wall or (across.endswith("_gg") and down.endswith("_gg")):
                panel.scatter(
                    sets[across],
                    sets[down],
                    s=22,
                    marker=marker,
                    zorder=6,
                    **PUBLISHED_SETS,
                )
    figure.text(
        0.47,
        0.975,
        _account(summary, study.targets),
        fontsize=7.5,
        va="top",
        linespacing=1.5,
    )
    prior, box = (
        "prior" if space.prior else "uniform prior",
        partial(Rectangle, (0, 0), 1, 1),
    )
    handles = [
        box(color=style.BLUE, alpha=0.35, lw=0, label="posterior: 50 and 95 % of it"),
        Line2D([], [], color=style.GREY, ls="--", lw=0.9, label=prior),
        Line2D([], [], marker="o", ls="", ms=3.5, color=style.RED, label=words),
        *(
            [box(fill=False, ec=style.BLACK, lw=1.1, label="published intervals")]
            if published
            else []
        ),
    ]
    for marker, ((source, wall), _) in marks:
        name = source.partition(",")[0] + (f" (wall: {wall})" if wall else "")
        handles.append(
            panel.scatter([], [], s=22, marker=marker, label=name, **PUBLISHED_SETS)
        )
    figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.63, 0.8), fontsize=7.5
    )


def _marginal(panel: Axes, values: pd.Series, study: Shown, row: pd.Series) -> None:
    """Draw the histogram of one parameter's draws with its prior and the published interval."""
    panel.hist(
        values,
        bins=25,
        range=study.ranges[row.name],
        density=True,
        color=style.BLUE,
        alpha=0.35,
    )
    panel.plot(
        *_prior_density(study.space, row.name), color=style.GREY, lw=0.9, ls="--"
    )
    if pd.notna(row.get("published_low")):
        panel.axvspan(*row[PUBLISHED], fill=False, ec=style.BLACK, lw=0.9)
    panel.set_title(
        f"{row['information_bits']:.2f} bits", fontsize=6.5, loc="center", pad=2
    )


def _prior_density(space: ParameterSpace, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Give the values of a free parameter over its range, and the density of its prior there."""
    k, unit = space.free.index(name), np.linspace(0, 1, 201)
    value = space.low[k] + unit * (space.high[k] - space.low[k])
    return value, np.gradient(
        space.prior_cdf(np.repeat(unit[:, None], space.dimensions, axis=1))[:, k], value
    )


def _pair(
    panel: Axes,
    draws: pd.DataFrame,
    across: str,
    down: str,
    ranges: Mapping[str, tuple[float, float]],
) -> None:
    """Draw the smoothed counts of two parameters' draws, filled down to each credible share."""
    from scipy import ndimage  # slow to import

    counts, x, y = np.histogram2d(
        draws[across], draws[down], bins=25, range=(ranges[across], ranges[down])
    )
    for axis in (0, 0, 1, 1):
        counts = ndimage.correlate1d(
            counts, (0.25, 0.5, 0.25), axis
        )  # the ends are reflected
    order = np.sort(counts.ravel())[::-1]
    inside = np.cumsum(order) / order.sum()
    levels = [
        order[min(int(np.searchsorted(inside, share)), order.size - 1)]
        for share in CREDIBLE_SHARES
    ]
    levels = [levels[0], max(levels[1], levels[0] * (1 + 1e-9)), order[0] * (1 + 1e-6)]
    # the outermost cells are drawn out to the bounds, where the prior ends
    x, y = ((edges[:-1] + edges[1:]) / 2 for edges in (x, y))
    x[0], x[-1], y[0], y[-1] = *ranges[across], *ranges[down]
    panel.contourf(x, y, counts.T, levels=levels, colors=["#BCD9EC", "#6FAED6"])


def _account(summary: Mapping[str, Any], targets: Targets) -> str:
    """Say the predictions of the posterior, in words."""
    parts = []
    for response in targets.responses:
        mean, low, high = (
            summary["predicted"][response.name][key] for key in ("mean", "low", "high")
        )
        parts.append(
            f"predicted {response.symbol} {mean:.1f} {response.unit} ({low:.1f}–{high:.1f})"
        )
    distance = summary["misfit"]["squared_distance"] ** 0.5
    parts += [
        f"best draw {distance:.2f} standard deviations from the targets",
        f"{100 * summary['thin_share']:.0f} % of the draws lie where samples are thin",
        f"R-hat ≤ {summary['largest_r_hat']:.3f}, effective draws ≥ {summary['least_effective_draws']:.0f}",
        "above each histogram: information of the measurements",
        *(["EXTRAPOLATED"] if summary["thin_share"] > 0.5 else []),
        *([] if summary["converged"] else ["NOT CONVERGED"]),
    ]
    return "\n".join(parts)


INTERVALS = (
    (["credible_low", "credible_high"], 0.22, style.BLUE, "posterior, 95 % and median"),
    (["miga_low", "miga_high"], 0.0, style.RED, "solutions of the search"),
    (PUBLISHED, -0.22, style.ORANGE, "published interval"),
)


@figure(
    "intervals",
    "Credible intervals",
    {"posterior": "posterior/posterior.csv"},
    **OF_POSTERIOR,
)
def intervals(inputs: Inputs, study: Shown) -> Figure:
    """Draw credible intervals in the parameters' ranges.

    Credible intervals of the free parameters with the published intervals and the intervals of the feasible
    solutions. All are shown as parts of the parameter's range.
    """
    table = read_table(inputs["posterior"], ("parameter", "credible_low", "miga_low"))
    figure = style.new_figure(style.PAGE, 3.3)
    draw_intervals(figure.subplots(), table)
    return figure


def draw_intervals(panel: Axes, table: pd.DataFrame) -> None:
    """Draw the intervals of posterior.csv, and the values in a column `answer` if there is one."""
    for k, row in table.iterrows():
        y, low, width = len(table) - 1 - k, row["low"], row["high"] - row["low"]
        panel.barh(y, 1, height=0.8, color="#EEF0F2", zorder=0)
        for ends, offset, colour, label in INTERVALS:
            x = (row.reindex(ends).dropna().astype(float).to_numpy() - low) / width
            named = label if k == 0 and len(x) else None
            panel.plot(
                x, [y + offset] * len(x), "-|", color=colour, lw=3, ms=7, label=named
            )
        panel.plot(
            [(row["median"] - low) / width],
            [y + 0.22],
            "o",
            ms=4.5,
            color="white",
            mec=style.BLUE,
            zorder=5,
        )
        if "answer" in row:
            label = "_" * bool(k) + "the answer"
            panel.plot(
                [(row["answer"] - low) / width], [y], "D", label=label, **style.ANSWER
            )
        text = f"{100 * row['width_ratio']:.0f} %   {row['information_bits']:.2f} bits"
        panel.text(1.03, y, text, fontsize=6.8, va="center")
        for end, value in ((0, row["low"]), (1, row["high"])):
            panel.text(
                end,
                y - 0.47,
                f"{value:g}",
                fontsize=6,
                ha="center",
                va="center",
                color=style.GREY,
            )
    panel.text(
        1.03,
        len(table) - 0.45,
        "width / prior's,\ninformation",
        fontsize=6.3,
        va="bottom",
        color=style.GREY,
    )
    style.strips(panel, table["parameter"].tolist())
    panel.set(xlim=(-0.03, 1.17), ylim=(-1.2, len(table) - 0.35))
    panel.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.43, -0.02))


SOBOL = {"sobol": "sensitivity/sobol.csv"}
EFFECTS = SOBOL | {"effects": "sensitivity/main_effects.csv", "dataset": "dataset.csv"}


@figure("sobol", "Sobol indices", SOBOL, folder="sensitivity", **UNCERTAINTY)
def sobol_indices(inputs: Inputs, study: Shown) -> Figure:
    """Draw a pair of bars for each parameter.

    First-order and total Sobol indices of each response of the surrogate, with 95 % bootstrap intervals.
    """
    table = read_table(inputs["sobol"], ("response", "parameter", "first", "total"))
    figure, panels = style.grid(len(study.targets), 2.4, sharey=True)
    for k, (panel, target) in enumerate(zip(panels, study.targets, strict=True)):
        _bars(panel, table[table["response"] == target.name].set_index("parameter"))
        panel.set_title(
            f"{style.letter(k)}   {target.response.symbol}", fontweight="bold"
        )
        if k % 2 == 0:
            panel.set_ylabel("share of the variance (–)")
    panels[0].legend(loc="upper left")
    return figure


def _bars(panel: Axes, rows: pd.DataFrame) -> None:
    """Draw the indices of one response, a pair of bars for each parameter."""
    place = np.arange(len(rows))
    look = {"ecolor": style.BLACK, "error_kw": {"lw": 0.8}, "capsize": 2}
    for name, offset, colour, text in (
        ("first", -0.2, style.BLUE, "first order"),
        ("total", 0.2, style.ORANGE, "total"),
    ):
        ends = np.abs(
            [rows[name] - rows[f"{name}_low"], rows[f"{name}_high"] - rows[name]]
        )
        panel.bar(
            place + offset,
            rows[name],
            0.38,
            yerr=ends,
            color=colour,
            label=text,
            **look,
        )
    panel.axhline(0, color=style.BLACK, lw=0.6)
    panel.set_xticks(place, [SYMBOLS[name] for name in rows.index], fontsize=9)
    panel.margins(y=0.15)
    style.note(
        panel,
        f"first orders sum to {rows['first'].sum():.2f}\nbars: 95 % intervals",
        x=0.97,
        ha="right",
    )


@figure("main_effects", "Main effects", EFFECTS, folder="sensitivity", **UNCERTAINTY)
def main_effects(inputs: Inputs, study: Shown) -> Figure:
    """Draw the mean response along each free parameter, on the simulated points.

    Each response over each free parameter: the mean of the surrogate over the other parameters. Points are the
    simulated samples. The goji berry's angle falls with the friction between berries: such piles pack more loosely,
    and the same berries need a wider foot (``repose docs uncertainty``, Sensitivity).
    """
    targets = study.targets
    effects = read_table(inputs["effects"], ("parameter", "value", *targets.names))
    table = read_table(
        inputs["dataset"], (*study.space.names, "status", *targets.names)
    )
    sobol = read_table(inputs["sobol"], ("response", "parameter", "first"))
    sobol, good = (
        sobol.set_index(["response", "parameter"]),
        table[table["status"] == "ok"],
    )
    figure, panels = style.over_parameters(study, 1.4)
    for panel, target, name in panels:
        line = effects[effects["parameter"] == name]
        panel.scatter(
            good[name], good[target.name], s=4, color=style.GREY, alpha=0.6, lw=0
        )
        panel.plot(line["value"], line[target.name], color=style.BLUE, lw=1.8)
        share = sobol.loc[(target.name, name), "first"]
        panel.set_title(
            f"{100 * max(share, 0.0):.0f} %", fontsize=6.8, loc="right", pad=2
        )
    words = "mean of the surrogate over the other parameters; %: first-order share of the variance"
    style.below(figure, f"points: samples; line: {words}")
    return figure
