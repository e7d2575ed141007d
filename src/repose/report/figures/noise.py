"""Draw how much runs with the same parameters scatter."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.targets import Target
from repose.common.files import read_json, read_table

from . import style
from .registry import Inputs, StudyView

SEED_TICKS = (1, 2, 4, 8, 16, 32, 64)
PERCENT_TICKS = (0.5, 1, 2, 5)


class NoisePanels(NamedTuple):
    """The panels of the figure."""

    figure: Figure
    responses: list[Axes]  # runs of each response
    error: Axes  # standard error of a mean against the number of seeds
    r2: Axes  # reachable R2 against the number of seeds


def draw_noise_floor(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the noise of the runs, and what it means for averages over several seeds.

    One panel for each response shows the runs around the mean of their sample. Two
    further panels show the standard error of a mean, and the reachable R2. The latter
    is the R2 of a surrogate that predicts the true means perfectly. Noise keeps it
    below 1, and more seeds for each sample raise it.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `runs` has a row for each run, and `seeds` a row for each number
        of seeds, with both quantities. `noise` contains the standard deviations of each
        response.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    runs = read_table(inputs["runs"], ("sample", "status", *targets.names))
    seeds = read_table(inputs["seeds"])
    deviations = read_json(inputs["noise"], ("responses",))["responses"]

    panels = _arrange_panels(len(targets))
    response_panels = panels.responses
    error_panel = panels.error
    r2_panel = panels.r2
    for k, (panel, target) in enumerate(zip(response_panels, targets, strict=True)):
        name = target.name
        # A run may be ok but have no value of this response.
        measured_runs = runs[(runs["status"] == "ok") & runs[name].notna()]
        line_style = style.series_style(k)
        _draw_runs(panel, measured_runs, column=name, colour=line_style["color"])
        panel.set(
            xlabel="samples, in order of their mean (line)",
            ylabel=style.response_label(target.response),
        )
        # This enlarges the panel, so it must follow the drawing of the runs.
        _write_standard_deviations(panel, target.response.unit, deviations[name])
        _draw_standard_error(error_panel, seeds, target=target, line_style=line_style)
        _draw_reachable_r2(r2_panel, seeds, target=target, line_style=line_style)
    _set_scales_and_labels(error_panel, r2_panel)
    style.label_panels([*response_panels, error_panel, r2_panel])
    error_panel.legend()
    r2_panel.legend(
        loc="lower right",
        title="band: 95 % interval",
        title_fontsize=style.SMALL_TEXT_PT,
    )
    return panels.figure


def _arrange_panels(n_targets: int) -> NoisePanels:
    """Arrange a panel for each response, and two panels that depend on the seeds."""
    # Two responses share a row. If the last response is alone in its row, its number
    # appears twice in the row, so that its panel is twice as wide.
    rows = [[k, min(k + 1, n_targets - 1)] for k in range(0, n_targets, 2)]
    figure = style.new_figure(style.PAGE, 2.15 + 2.45 * len(rows))
    panels = figure.subplot_mosaic(
        [*rows, ["error", "r2"]], height_ratios=[1.15] * len(rows) + [1]
    )
    return NoisePanels(
        figure,
        responses=[panels[k] for k in range(n_targets)],
        error=panels["error"],
        r2=panels["r2"],
    )


def _draw_runs(panel: Axes, runs: pd.DataFrame, column: str, colour: str) -> None:
    """Draw the runs of each sample, with the samples in the order of their means.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    runs : DataFrame
        A row for each run, with the number of its sample.
    column : str
        Column of the response.
    colour : str
        Colour of the runs.
    """
    means = runs.groupby("sample")[column].mean().sort_values()
    positions = pd.Series(np.arange(len(means)), index=means.index)
    panel.scatter(
        runs["sample"].map(positions),
        runs[column],
        s=2.5,
        color=colour,
        alpha=0.45,
        lw=0,
    )
    panel.plot(positions, means, color=style.BLACK, lw=1.2)


def _write_standard_deviations(
    panel: Axes, unit: str, deviations: Mapping[str, float]
) -> None:
    """Write the standard deviations of a response above its runs.

    Parameters
    ----------
    panel : Axes
        The panel of the runs, which is enlarged at its upper edge.
    unit : str
        Unit of the response.
    deviations : mapping
        Standard deviations within and between samples, and their correlation, by name.
    """
    lines = (
        f"standard deviation within samples {deviations['sd_within']:.2f} {unit}",
        f"between samples {deviations['sd_between']:.2f} {unit}",
        f"intraclass correlation {deviations['icc']:.2f} "
        f"({deviations['icc_low']:.2f}–{deviations['icc_high']:.2f})",
    )
    bottom, top = panel.get_ylim()
    panel.set_ylim(bottom, top + 0.2 * (top - bottom))
    style.write_note(panel, "\n".join(lines), y=0.99)


def _draw_standard_error(
    panel: Axes, seeds: pd.DataFrame, target: Target, line_style: Mapping[str, str]
) -> None:
    """Draw the standard error of a response's mean against the number of seeds."""
    response = target.response
    percent = seeds[f"{response.quantity}_se_percent"]
    panel.plot(seeds["seeds"], percent, label=response.symbol, **line_style)


def _draw_reachable_r2(
    panel: Axes, seeds: pd.DataFrame, target: Target, line_style: Mapping[str, str]
) -> None:
    """Draw the reachable R2 of one response against the number of seeds, with a band.

    It is the R2 of a surrogate that predicts the true means perfectly.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    seeds : DataFrame
        A row for each number of seeds, which is in the column `seeds`. Three columns
        contain the R2 and the ends of its 95 % interval.
    target : Target
        The target of the response.
    line_style : mapping
        Colour and style of the line.
    """
    response = target.response
    column = f"{response.quantity}_reachable_r2"
    low = seeds[f"{column}_low"]
    high = seeds[f"{column}_high"]
    colour = line_style["color"]
    panel.fill_between(seeds["seeds"], low, high, color=colour, alpha=0.2, lw=0)
    panel.plot(seeds["seeds"], seeds[column], label=response.symbol, **line_style)


def _set_scales_and_labels(error_panel: Axes, r2_panel: Axes) -> None:
    """Set the scales, ticks and labels of the panels whose x axis counts seeds.

    Parameters
    ----------
    error_panel : Axes
        The panel of the standard errors.
    r2_panel : Axes
        The panel of the reachable R2.
    """
    error_panel.set(ylabel="standard error of a mean\n(% of the target)", yscale="log")
    error_panel.set_yticks(PERCENT_TICKS, [f"{value:g}" for value in PERCENT_TICKS])
    r2_panel.set(
        ylabel="R² of a perfect predictor\non means over the seeds", ylim=(None, 1)
    )
    for panel in (error_panel, r2_panel):
        panel.set(xlabel="seeds per sample", xscale="log")
        panel.set_xticks(SEED_TICKS, SEED_TICKS)
        panel.minorticks_off()
        panel.grid(True)
