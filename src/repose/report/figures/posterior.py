"""Draw the posterior: draws of the parameters in pairs, and credible intervals."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.files import read_json, read_table
from repose.report.study_view import compute_cell_edges

from . import panels, style
from .registry import Inputs, StudyView

if TYPE_CHECKING:
    from repose.calibrate.uncertainty.posterior import Posterior

N_BINS = 25  # of a histogram
# Number of cells along each range of a pair. It is small, so that each cell contains
# enough draws.
N_PAIR_CELLS = 8
RATIO_TICKS = (0.25, 0.5, 1, 2, 4)
LARGEST_RATIO = 4.0  # of posterior to prior, at the end of the colour scale
RATIO_COLOURS = "PuOr_r"  # white in the middle
RATIO_LABEL = "posterior over prior in each cell; white: as before the measurements"
SEARCH_SETS_LABEL = "solutions of the search"
# The figure warns if more than this fraction of the draws lies where samples are
# sparse.
EXTRAPOLATED_FRACTION = 0.5
# Columns with the ends of an interval: of the posterior, of the solutions that the
# search (MIGA, a multi-island genetic algorithm) found, and of the published solutions.
CREDIBLE_COLUMNS = ["credible_low", "credible_high"]
SEARCH_COLUMNS = ["miga_low", "miga_high"]
PUBLISHED_COLUMNS = ["published_low", "published_high"]
COLUMN_NOTE = (
    "width that the measurements leave open; information: one bit halves the range"
)
# Upper left corners of the text and of the legend in the figure of pairs, as fractions
# of the figure's width and height
CORNER_TEXT_POSITION = (0.47, 0.975)
CORNER_LEGEND_POSITION = (0.63, 0.8)
INTERVALS_HEIGHT = 3.3  # inches, of the figure of the credible intervals
# In the panel of the intervals, each parameter has a strip. Its range extends from x =
# 0 to x = 1, and its middle is at a whole number y. So all sizes in y are multiples of
# the distance between two strips.
LEFT_END = -0.03
RIGHT_END = 1.17  # leaves space for numbers beside the range
NUMBERS_X = 1.03  # position of these numbers
LEGEND_ROOM = 1.2  # below the middle of the lowest strip
TOP_ROOM = 0.65  # above the middle of the highest strip, for the note on the numbers
NOTE_OFFSET = 0.55  # of this note above the middle of the highest strip
STRIP_HEIGHT = 0.8
RANGE_TEXT_OFFSET = -0.47  # of the ends of the range, just below the strip
# Height of the bar of the credible interval above the middle of a strip
CREDIBLE_OFFSET = 0.22
# Bars of a parameter: columns of the table, height above the middle, colour, width and
# label. The spans of solutions are thin, because they are not uncertainties.
INTERVAL_BARS = (
    (
        CREDIBLE_COLUMNS,
        CREDIBLE_OFFSET,
        style.BLUE,
        3.0,
        "95 % interval, median white",
    ),
    (SEARCH_COLUMNS, 0.0, style.RED, 1.2, "span of the solutions found"),
    (PUBLISHED_COLUMNS, -0.22, style.ORANGE, 1.2, "span of the published solutions"),
)
# Markers of published sets, one for each source and wall
PUBLISHED_MARKERS = ("D", "^", "s", "v")
PUBLISHED_STYLE: dict[str, Any] = {
    "s": 22,
    "facecolor": "none",
    "edgecolor": style.ORANGE,
    "linewidth": 1.2,
}


class PublishedSets(NamedTuple):
    """Published parameter sets of one source and one wall."""

    marker: str
    source: str
    wall: str  # empty if it is the wall of the study
    table: pd.DataFrame


class CornerData(NamedTuple):
    """The data of a figure that shows the posterior in pairs of parameters."""

    posterior: "Posterior"
    sets: pd.DataFrame  # parameter sets that are marked, a row for each
    sets_label: str
    published_sets: Sequence[PublishedSets] = ()


# --- The draws in pairs ---------------------------------------------------------------


def draw_posterior(inputs: Inputs, study: StudyView) -> Figure:
    """Draw a corner plot of the posterior: each parameter alone, and each pair.

    The posterior is a table of random parameter sets, called draws. They are the more
    frequent, the better a parameter set agrees with the measurements. The solutions of
    the search are marked.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `draws` has a row for each draw, `posterior` for each parameter,
        and `feasible` for each solution. `summary` contains the predicted responses and
        the quality of the draws. `published` has a row for each published parameter
        set, and may be missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    from repose.calibrate.uncertainty.posterior import Posterior  # slow to import

    names = study.parameters.names
    posterior = Posterior(
        parameters=read_table(inputs["posterior"], ("parameter",)),
        draws=read_table(inputs["draws"], names),
        summary=read_json(inputs["summary"], ("predicted",)),
    )
    published_sets: list[PublishedSets] = []
    if "published" in inputs:
        published_sets = _split_published_sets(read_table(inputs["published"]), names)
    data = CornerData(
        posterior=posterior,
        sets=read_table(inputs["feasible"], names),
        sets_label=SEARCH_SETS_LABEL,
        published_sets=published_sets,
    )
    figure = style.new_figure(style.PAGE, style.PAGE)
    draw_corner(figure, study.parameters, targets=study.targets, data=data)
    return figure


def _split_published_sets(
    table: pd.DataFrame, names: Iterable[str]
) -> list[PublishedSets]:
    """Split published sets by source and wall.

    Parameters
    ----------
    table : DataFrame
        A row for each set, with its `source`, `wall` and parameters.
    names : iterable of str
        Names of the parameters.

    Returns
    -------
    list of PublishedSets
        At most as many as there are markers; empty if the table lacks a column.
    """
    if not {"source", "wall", *names} <= set(table):
        return []
    # The cell is empty if the set is for the wall of the study.
    walls = table["wall"].fillna("").astype(str)
    by_source = table.assign(wall=walls).groupby(["source", "wall"])
    # Sources beyond the last marker are left out.
    return [
        PublishedSets(marker, source, wall=wall, table=rows)
        for marker, ((source, wall), rows) in zip(
            PUBLISHED_MARKERS, by_source, strict=False
        )
    ]


def draw_corner(
    figure: FigureBase, parameters: ParameterSpace, targets: Targets, data: CornerData
) -> None:
    """Draw a corner plot of a posterior in an empty figure.

    The panels on the diagonal show each free parameter alone, and those below it each
    pair. The empty half above the diagonal holds the text and the legend.

    Parameters
    ----------
    figure : FigureBase
        The figure.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets, whose predicted responses are written into the figure.
    data : CornerData
        The posterior, and the parameter sets to mark.
    """
    draws = data.posterior.draws
    table = data.posterior.parameters.set_index("parameter")
    has_published_intervals = "published_low" in table
    # The cells of the last pair, for the colour bar, which is the same for all pairs.
    # If there is only one parameter, there is no pair.
    mesh = None
    pair_panels = panels.add_pair_panels(figure, parameters)
    for panel, x_name, y_name in pair_panels:
        if x_name == y_name:
            _draw_marginal(
                panel, draws[x_name], parameters=parameters, row=table.loc[x_name]
            )
            continue
        mesh = _draw_posterior_over_prior(
            panel, draws[x_name], draws[y_name], parameters
        )
        _draw_sets(panel, data, x_name=x_name, y_name=y_name)
        if has_published_intervals:
            _draw_published_box(panel, table.loc[x_name], table.loc[y_name])
    panels.finish_pair_panels(pair_panels, parameters, margin=0.02)

    text_x, text_y = CORNER_TEXT_POSITION
    figure.text(
        text_x,
        text_y,
        _describe_draws(data.posterior.summary, targets),
        fontsize=7.5,
        va="top",
        linespacing=1.5,
    )
    if mesh is not None:
        _draw_ratio_bar(figure, mesh, [panel.axes for panel in pair_panels])
    last_panel = pair_panels[-1].axes  # any panel would do
    handles = _make_legend_handles(
        last_panel,
        data,
        has_prior=bool(parameters.prior),
        has_published_intervals=has_published_intervals,
    )
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=CORNER_LEGEND_POSITION,
        fontsize=7.5,
    )


def _draw_sets(panel: Axes, data: CornerData, x_name: str, y_name: str) -> None:
    """Mark the parameter sets and the published ones in the panel of two parameters.

    Published sets for another wall are marked only if both parameters describe contacts
    between grains.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    data : CornerData
        The sets.
    x_name, y_name : str
        Names of the parameters along x and along y.
    """
    panel.scatter(
        data.sets[x_name], data.sets[y_name], s=5, color=style.RED, lw=0, zorder=4
    )
    is_pair_of_grains = x_name.endswith("_gg") and y_name.endswith("_gg")
    for published in data.published_sets:
        if not published.wall or is_pair_of_grains:
            panel.scatter(
                published.table[x_name],
                published.table[y_name],
                marker=published.marker,
                zorder=6,
                **PUBLISHED_STYLE,
            )


def _draw_marginal(
    panel: Axes, values: pd.Series, parameters: ParameterSpace, row: pd.Series
) -> None:
    """Draw a histogram of one parameter with its prior and the published interval.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    values : Series
        The draws of the parameter.
    parameters : ParameterSpace
        The parameters of the study.
    row : Series
        Row of the parameter in the table of the posterior.
    """
    name = row.name
    edges = compute_cell_edges(parameters, name, N_BINS)
    # All bins have the same width along the scale of the parameter. Weight the draws so
    # that the histogram shows their density along this scale, and so that its area is
    # 1.
    low, high = parameters.coordinates(name, edges[[0, -1]])
    bin_width = (high - low) / N_BINS
    weight = 1 / (len(values) * bin_width)
    panel.hist(
        values,
        bins=edges,
        weights=np.full(len(values), weight),
        color=style.BLUE,
        alpha=0.35,
    )
    prior_values, density = _compute_prior_density(parameters, name)
    panel.plot(prior_values, density, color=style.GREY, lw=0.9, ls="--")
    # The table has this column only if intervals were published.
    if pd.notna(row.get("published_low")):
        published_low, published_high = row[PUBLISHED_COLUMNS]
        panel.axvspan(published_low, published_high, fill=False, ec=style.BLACK, lw=0.9)
    # The information that the measurements give about the parameter.
    panel.set_title(
        f"{row['information_bits']:.2f} bits", fontsize=6.5, loc="center", pad=2
    )


def _compute_prior_density(
    parameters: ParameterSpace, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the prior density of a free parameter, along its scale.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.

    Returns
    -------
    values : ndarray
        Values (201,) over the range of the parameter.
    density : ndarray
        The density (201,) at each value.
    """
    index = parameters.free.index(name)
    fraction_of_range = np.linspace(0, 1, 201)
    values = parameters.values_at(name, fraction_of_range)
    # `prior_cdf` takes all free parameters; only one of its columns is needed.
    points = np.repeat(fraction_of_range[:, None], parameters.dimensions, axis=1)
    # The density is the derivative of the cumulative probability.
    cumulative = parameters.prior_cdf(points)[:, index]
    return values, np.gradient(cumulative, parameters.coordinates(name, values))


def _draw_posterior_over_prior(
    panel: Axes, x_draws: pd.Series, y_draws: pd.Series, parameters: ParameterSpace
) -> QuadMesh:
    """Draw the ratio of posterior to prior probability of two parameters, cell by cell.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    x_draws, y_draws : Series
        The draws of both parameters. The names of the series are those of the
        parameters.
    parameters : ParameterSpace
        The parameters of the study.

    Returns
    -------
    QuadMesh
        The cells, for a colour bar.
    """
    edges = [
        compute_cell_edges(parameters, str(values.name), N_PAIR_CELLS)
        for values in (x_draws, y_draws)
    ]
    counts, x_edges, y_edges = np.histogram2d(x_draws, y_draws, bins=edges)
    # In the prior, the parameters are independent of each other.
    prior = np.outer(
        _compute_prior_of_cells(parameters, str(x_draws.name)),
        _compute_prior_of_cells(parameters, str(y_draws.name)),
    )
    # Divide the probabilities of each cell. No prior probability is 0.
    posterior = counts / counts.sum()
    ratio = posterior / prior
    # On a logarithmic scale, equal factors above and below 1 are equally far from
    # white. The scale has no place for 0, so limit the ratio to its ends.
    smallest_ratio = 1 / LARGEST_RATIO
    colour_scale = LogNorm(smallest_ratio, LARGEST_RATIO)
    shown_ratio = np.clip(ratio, smallest_ratio, LARGEST_RATIO)
    return panel.pcolormesh(
        x_edges,
        y_edges,
        shown_ratio.T,  # `histogram2d` counts x along rows, `pcolormesh` along columns
        cmap=RATIO_COLOURS,
        norm=colour_scale,
        rasterized=True,
    )


def _draw_ratio_bar(figure: FigureBase, mesh: QuadMesh, axes: Sequence[Axes]) -> None:
    """Draw the colour bar of the ratio below all panels.

    Parameters
    ----------
    figure : FigureBase
        The figure.
    mesh : QuadMesh
        The cells of any pair, whose colours the bar explains.
    axes : sequence of Axes
        The panels, which are moved to make room for the bar.
    """
    bar = figure.colorbar(
        mesh, ax=axes, location="bottom", label=RATIO_LABEL, aspect=50, pad=0.02
    )
    bar.set_ticks(RATIO_TICKS, labels=[f"{tick:g}" for tick in RATIO_TICKS])
    bar.minorticks_off()


def _compute_prior_of_cells(parameters: ParameterSpace, name: str) -> np.ndarray:
    """Compute the prior probability of each cell of a free parameter's range.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.

    Returns
    -------
    ndarray
        Probabilities (N_PAIR_CELLS,). They are above 0, so that one can divide by them.
    """
    index = parameters.free.index(name)
    fraction_of_range = np.linspace(0, 1, N_PAIR_CELLS + 1)
    # `prior_cdf` takes all free parameters; only one of its columns is needed.
    points = np.repeat(fraction_of_range[:, None], parameters.dimensions, axis=1)
    probability = np.diff(parameters.prior_cdf(points)[:, index])
    return np.maximum(probability, np.finfo(float).tiny)


def _draw_published_box(panel: Axes, x_row: pd.Series, y_row: pd.Series) -> None:
    """Draw the published intervals of two parameters as a box, if both have one.

    `x_row` and `y_row` are the rows of the parameters in the table of the posterior.
    """
    if pd.isna(x_row["published_low"]) or pd.isna(y_row["published_low"]):
        return
    x_low, x_high = x_row[PUBLISHED_COLUMNS].astype(float)
    y_low, y_high = y_row[PUBLISHED_COLUMNS].astype(float)
    box = Rectangle(
        (x_low, y_low),
        x_high - x_low,
        y_high - y_low,
        fill=False,
        ec=style.BLACK,
        lw=1.1,
        zorder=5,
    )
    panel.add_patch(box)


def _describe_draws(summary: Mapping[str, Any], targets: Targets) -> str:
    """Describe the predictions of the posterior, and how reliable its draws are.

    The text also explains the numbers above the histograms.

    Parameters
    ----------
    summary : mapping
        Contents of posterior.json.
    targets : Targets
        The targets of the study.

    Returns
    -------
    str
        The description in several lines.
    """
    lines = []
    for response in targets.responses:
        predicted = summary["predicted"][response.name]
        lines.append(
            f"predicted {response.symbol} {predicted['mean']:.1f} {response.unit} "
            f"({predicted['low']:.1f}–{predicted['high']:.1f})"
        )

    # Describe how well the best draw fits, and whether the draws can be trusted. Where
    # there are few simulated samples, the surrogate extrapolates. R-hat compares
    # several chains of draws and is 1 if they agree. Draws of a chain resemble each
    # other, so they are worth only a smaller number of effective, independent draws.
    distance = summary["misfit"]["squared_distance"] ** 0.5
    sparse_percent = 100 * summary["thin_share"]
    r_hat = summary["largest_r_hat"]
    n_effective = summary["least_effective_draws"]
    lines += [
        f"best draw {distance:.2f} standard deviations from the targets",
        f"{sparse_percent:.0f} % of the draws lie where samples are sparse",
        f"R-hat ≤ {r_hat:.3f}, effective draws ≥ {n_effective:.0f}",
        "above each histogram: information (1 bit halves the range)",
    ]
    if summary["thin_share"] > EXTRAPOLATED_FRACTION:
        lines.append("EXTRAPOLATED")
    if not summary["converged"]:
        lines.append("NOT CONVERGED")
    return "\n".join(lines)


def _make_legend_handles(
    panel: Axes, data: CornerData, has_prior: bool, has_published_intervals: bool
) -> list[Artist]:
    """Make the entries of the legend: the posterior, its prior, and the parameter sets.

    Parameters
    ----------
    panel : Axes
        Any panel. For each source of published sets, an empty scatter plot is added to
        it, because a legend can only show markers that are in a panel.
    data : CornerData
        The parameter sets that are marked.
    has_prior : bool
        Whether the configuration gives a prior for any parameter. All others have a
        uniform prior.
    has_published_intervals : bool
        Whether published intervals are drawn.

    Returns
    -------
    list of Artist
        The entries, from top to bottom.
    """
    # The legend shows boxes at its own size, so any size will do here.
    unit_box = {"xy": (0, 0), "width": 1, "height": 1}
    prior_label = "prior" if has_prior else "uniform prior"
    handles: list[Artist] = [
        Rectangle(**unit_box, color=style.BLUE, alpha=0.35, lw=0, label="posterior"),
        Line2D([], [], color=style.GREY, ls="--", lw=0.9, label=prior_label),
        Line2D(
            [], [], marker="o", ls="", ms=3.5, color=style.RED, label=data.sets_label
        ),
    ]
    if has_published_intervals:
        box_style = {"fill": False, "ec": style.BLACK, "lw": 1.1}
        handles.append(Rectangle(**unit_box, **box_style, label="published intervals"))
    for published in data.published_sets:
        label = published.source.partition(",")[0]
        if published.wall:
            label += f" (wall: {published.wall})"
        handles.append(
            panel.scatter(
                [], [], marker=published.marker, label=label, **PUBLISHED_STYLE
            )
        )
    return handles


# --- Credible intervals ---------------------------------------------------------------


def draw_credible_intervals(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the credible interval of each parameter in its range, with the answer.

    The range over which the solutions of the search spread is drawn, too, and that of
    the published solutions if there are any.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `posterior` has a row for each parameter, with the ends of its
        intervals. `feasible` has a row for each solution of the search. If one of them
        is the answer, its column `representative` is true.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    table = read_table(
        inputs["posterior"], ("parameter", *CREDIBLE_COLUMNS, *SEARCH_COLUMNS)
    )
    names = table["parameter"].tolist()
    solutions = read_table(inputs["feasible"], ("representative", *names))
    # `draw_intervals` marks the values of a column `answer`.
    answers = solutions[solutions["representative"]]
    if len(answers):
        table = table.assign(answer=answers.iloc[0][names].to_numpy(float))
    figure = style.new_figure(style.PAGE, INTERVALS_HEIGHT)
    draw_intervals(figure.subplots(), table, study.parameters)
    return figure


def draw_intervals(
    panel: Axes, table: pd.DataFrame, parameters: ParameterSpace
) -> None:
    """Draw the intervals of all parameters, each in its own strip.

    Positions in a strip are measured along the scale of the parameter.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        The table of the posterior, a row for each parameter. If there is a column
        `answer`, its values are marked.
    parameters : ParameterSpace
        The parameters of the study.
    """
    n_parameters = len(table)
    for number, (_, row) in enumerate(table.iterrows()):
        # The first parameter is at the top.
        y = n_parameters - 1 - number
        # The method `fractions_of_range` converts values of a parameter to positions in its range.
        to_position = partial(parameters.fractions_of_range, row["parameter"])
        _draw_interval_strip(
            panel, row, to_position=to_position, y=y, is_first=number == 0
        )
    highest_y = n_parameters - 1
    panel.text(
        RIGHT_END,
        highest_y + NOTE_OFFSET,
        COLUMN_NOTE,
        fontsize=6.3,
        ha="right",
        va="bottom",
        color=style.BLACK,
    )
    panels.label_strips(panel, table["parameter"].tolist())
    panel.set(xlim=(LEFT_END, RIGHT_END), ylim=(-LEGEND_ROOM, highest_y + TOP_ROOM))
    panel.legend(loc="lower center", ncols=4, bbox_to_anchor=(0.5, -0.02))


def _draw_interval_strip(
    panel: Axes,
    row: pd.Series,
    to_position: Callable[[np.ndarray], np.ndarray],
    y: float,
    is_first: bool,
) -> None:
    """Draw the intervals of one parameter as bars in a strip that shows its range.

    The ends of the range are written below the strip, and two numbers beside it.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    row : Series
        Row of the parameter in the table of the posterior.
    to_position : callable
        Function that converts values of the parameter to positions in its range, from 0
        to 1.
    y : float
        Height of the strip's middle.
    is_first : bool
        Whether the strip adds its labels to the legend.
    """
    panel.barh(y, 1, height=STRIP_HEIGHT, color=style.STRIP_COLOUR, zorder=0)
    for columns, offset, colour, width, label in INTERVAL_BARS:
        # If the table does not contain the ends of this bar, nothing is drawn.
        ends = row.reindex(columns).dropna().astype(float).to_numpy()
        positions = to_position(ends)
        panel.plot(
            positions,
            [y + offset] * len(positions),
            "-|",
            color=colour,
            lw=width,
            ms=7,
            label=label if is_first and len(positions) else None,
        )
    panel.plot(
        [to_position(row["median"])],
        [y + CREDIBLE_OFFSET],
        "|",
        ms=6,
        mew=1.6,
        color="white",
        zorder=5,
    )
    if "answer" in row:
        panel.plot(
            [to_position(row["answer"])],
            [y],
            "D",
            # Matplotlib leaves labels with an underscore out of the legend.
            label="the answer" if is_first else "_the answer",
            **style.ANSWER_STYLE,
        )
    # Write which fraction of the interval the measurements leave open, and how much
    # information they give. The intervals are estimates, so the ratio of their widths
    # may slightly exceed 1.
    percent = 100 * min(row["width_ratio"], 1.0)
    text = f"{percent:.0f} %   {row['information_bits']:.2f} bits"
    panel.text(NUMBERS_X, y, text, fontsize=style.SMALL_TEXT_PT, va="center")
    # Write the ends of the range below the strip.
    for x, value in ((0, row["low"]), (1, row["high"])):
        panel.text(
            x,
            y + RANGE_TEXT_OFFSET,
            f"{value:g}",
            fontsize=6,
            ha="center",
            va="center",
            color=style.GREY,
        )
