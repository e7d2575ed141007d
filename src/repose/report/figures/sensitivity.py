"""Draw the sensitivity: Sobol indices and main effects of the parameters.

If there are constraints, two other fractions of the variance replace the indices.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.parameters import SYMBOLS
from repose.common.files import read_table

from . import panels, style
from .registry import Inputs, StudyView


class Share(NamedTuple):
    """A fraction of the variance: a column of the table."""

    column: str
    label: str


INDICES = (Share("first", "first order"), Share("total", "total"))
# Shares for parameters that depend on each other because of constraints.
CONSTRAINED_FRACTIONS = (
    Share("explained", "explained by it alone, Var(E[y|x]) / Var(y)"),
    Share("remaining", "remaining if all others are known, E[Var(y|others)] / Var(y)"),
)


EFFECTS_NOTE = (
    "points: samples; line: mean of the surrogate over the other parameters; %: "
    "first-order share of the variance"
)
EFFECTS_NOTE_WITH_CONSTRAINTS = (
    "points: samples; line: mean of the surrogate over what the constraints allow at "
    "each value; %: share of the variance {share}"
)
# Two bars side by side for the fractions of a parameter: offsets from its tick, and
# colours.
BAR_OFFSETS = (-0.2, 0.2)
BAR_COLOURS = (style.BLUE, style.ORANGE)


def _choose_fractions(study: StudyView) -> tuple[Share, Share]:
    """Choose the two fractions of the variance that the table of a study contains."""
    return CONSTRAINED_FRACTIONS if study.parameters.constraints else INDICES


def draw_sobol_indices(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the first-order and total index of each parameter, one panel per response.

    Parameters
    ----------
    inputs : mapping
        Path of the table `sobol`, which has a row for each parameter and response, with
        both indices and their intervals.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    shares = _choose_fractions(study)
    columns = [share.column for share in shares]
    table = read_table(inputs["sobol"], ("response", "parameter", *columns))
    figure, axes = panels.grid(len(targets), 2.4, sharey=True)
    for k, (panel, target) in enumerate(zip(axes, targets, strict=True)):
        indices_of_target = table[table["response"] == target.name].set_index(
            "parameter"
        )
        _draw_indices(panel, indices_of_target, shares)
        title = f"{style.panel_letter(k)}   {target.response.symbol}"
        panel.set_title(title, fontweight="bold")
        if k % 2 == 0:
            panel.set_ylabel("share of the variance (–)")
    if study.parameters.constraints:
        # The labels are too long for a legend, so write them below the panels.
        colours = f"blue: {shares[0].label}; orange: {shares[1].label}"
        style.write_below(figure, f"{colours}; over what the constraints allow")
    else:
        axes[0].legend(loc="upper left")
    return figure


def _draw_indices(
    panel: Axes, table: pd.DataFrame, shares: tuple[Share, Share]
) -> None:
    """Draw the two fractions of one response with their intervals.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each parameter, with both shares and the ends of their intervals.
    shares : tuple of Share
        The two fractions.
    """
    positions = np.arange(len(table))
    for (column, label), offset, colour in zip(
        shares, BAR_OFFSETS, BAR_COLOURS, strict=True
    ):
        # Compute the lengths of the error bars below and above the fraction.
        share = table[column]
        below = share - table[f"{column}_low"]
        above = table[f"{column}_high"] - share
        panel.bar(
            positions + offset,
            share,
            0.38,
            yerr=np.abs([below, above]),
            color=colour,
            label=label,
            ecolor=style.BLACK,
            error_kw={"lw": 0.8},
            capsize=2,
        )
    panel.axhline(0, color=style.BLACK, lw=0.6)
    panel.set_xticks(
        positions, [SYMBOLS.get(name, name) for name in table.index], fontsize=9
    )
    panel.margins(y=0.15)
    text = "bars: 95 % intervals"
    if shares == INDICES:
        total = table["first"].sum()
        text = f"first orders sum to {total:.2f}\n{text}"
    style.write_note(panel, text, x=0.97, ha="right")


def draw_main_effects(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the mean response along each free parameter, over the simulated points.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `effects` contains the mean prediction of the surrogate at values
        of each parameter, `dataset` the samples, and `sobol` the indices.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    parameters = study.parameters
    effects = read_table(inputs["effects"], ("parameter", "value", *targets.names))
    samples = read_table(
        inputs["dataset"], (*parameters.names, "status", *targets.names)
    )
    samples = samples[samples["status"] == "ok"]
    column, label = _choose_fractions(study)[0]
    sobol = read_table(inputs["sobol"], ("response", "parameter", column))
    variance_fractions = sobol.set_index(["response", "parameter"])[column]

    # In each panel draw the samples and the mean of the surrogate, and write the
    # fraction of the variance.
    figure, parameter_panels = panels.make_parameter_panels(targets, parameters, 1.4)
    for panel, target, name in parameter_panels:
        panel.scatter(
            samples[name], samples[target.name], s=4, color=style.GREY, alpha=0.6, lw=0
        )
        curve = effects[effects["parameter"] == name]
        panel.plot(curve["value"], curve[target.name], color=style.BLUE, lw=1.8)
        # The fractions are estimates, so they may be slightly below 0.
        percent = 100 * max(variance_fractions.loc[(target.name, name)], 0.0)
        panel.set_title(
            f"{percent:.0f} %", fontsize=style.SMALL_TEXT_PT, loc="right", pad=2
        )
    explanation = EFFECTS_NOTE
    if study.parameters.constraints:
        explanation = EFFECTS_NOTE_WITH_CONSTRAINTS.format(share=label)
    style.write_below(figure, explanation)
    return figure
