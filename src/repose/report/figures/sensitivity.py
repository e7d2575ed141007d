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


class VarianceFraction(NamedTuple):
    """A fraction of the variance of a response: its column in the table, and its label.

    The table also has columns with the ends of its interval, such as ``first_low``.
    """

    column: str
    label: str


INDICES = (
    VarianceFraction("first", "first order"),
    VarianceFraction("total", "total"),
)
# Fractions for parameters that depend on each other because of constraints.
CONSTRAINED_FRACTIONS = (
    VarianceFraction("explained", "explained by it alone, Var(E[y|x]) / Var(y)"),
    VarianceFraction(
        "remaining", "remaining if all others are known, E[Var(y|others)] / Var(y)"
    ),
)

EFFECTS_NOTE = (
    "points: samples; line: mean of the surrogate over the other parameters; %: "
    "first-order fraction of the variance"
)
EFFECTS_NOTE_WITH_CONSTRAINTS = (
    "points: samples; line: mean of the surrogate over what the constraints allow at "
    "each value; %: fraction of the variance {fraction}"
)
# Two bars side by side for the fractions of a parameter: offsets from its tick, and
# colours.
BAR_OFFSETS = (-0.2, 0.2)
BAR_WIDTH = 0.38  # a little less than the distance between both bars
BAR_COLOURS = (style.BLUE, style.ORANGE)


def _choose_fractions(study: StudyView) -> tuple[VarianceFraction, VarianceFraction]:
    """Choose the two fractions of the variance that the table of a study contains.

    The first one describes the parameter alone, and the second one also its
    interactions with the other parameters.
    """
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
    fractions = _choose_fractions(study)
    columns = [fraction.column for fraction in fractions]
    table = read_table(inputs["sobol"], ("response", "parameter", *columns))
    figure, axes = panels.grid(len(targets), 2.4, sharey=True)
    for k, (panel, target) in enumerate(zip(axes, targets, strict=True)):
        indices_of_target = table[table["response"] == target.name].set_index(
            "parameter"
        )
        _draw_fractions(panel, indices_of_target, fractions)
        title = f"{style.panel_letter(k)}   {target.response.symbol}"
        panel.set_title(title, fontweight="bold")
        if k % 2 == 0:
            panel.set_ylabel("fraction of the variance (–)")
    if study.parameters.constraints:
        # The labels are too long for a legend, so write them below the panels.
        colours = f"blue: {fractions[0].label}; orange: {fractions[1].label}"
        style.write_below(figure, f"{colours}; over what the constraints allow")
    else:
        axes[0].legend(loc="upper left")
    return figure


def _draw_fractions(
    panel: Axes,
    table: pd.DataFrame,
    fractions: tuple[VarianceFraction, VarianceFraction],
) -> None:
    """Draw two fractions of one response's variance for each parameter, as bars.

    Error bars show the 95 % intervals of the fractions.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each parameter, with both fractions and the ends of their intervals.
    fractions : tuple of VarianceFraction
        The two fractions, as `INDICES` or as `CONSTRAINED_FRACTIONS`.
    """
    positions = np.arange(len(table))
    for (column, label), offset, colour in zip(
        fractions, BAR_OFFSETS, BAR_COLOURS, strict=True
    ):
        # Compute the lengths of the error bars below and above the value. Rounding may
        # make a length slightly negative, which matplotlib does not accept.
        values = table[column]
        below = values - table[f"{column}_low"]
        above = table[f"{column}_high"] - values
        panel.bar(
            positions + offset,
            values,
            BAR_WIDTH,
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
    # First-order indices sum to 1 if the parameters do not interact. The other
    # fractions have no such sum.
    if fractions == INDICES:
        first_order, _ = fractions
        total = table[first_order.column].sum()
        text = f"first-order indices sum to {total:.2f}\n{text}"
    style.write_note(panel, text, x=0.97, ha="right")


def draw_main_effects(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the mean response along each free parameter, on top of the samples.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `effects` contains the mean prediction of the surrogate at values
        of each parameter, averaged over the other parameters. `dataset` contains the
        samples, and `sobol` the fractions of the variance.
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
    # Of the two fractions, write the one that describes the parameter alone.
    fraction, _ = _choose_fractions(study)
    fractions_table = read_table(
        inputs["sobol"], ("response", "parameter", fraction.column)
    )
    variance_fractions = fractions_table.set_index(["response", "parameter"])[
        fraction.column
    ]

    # In each panel draw the samples and the mean of the surrogate, and write the
    # fraction of the variance.
    figure, parameter_panels = panels.make_parameter_panels(
        targets, parameters, row_height=1.4
    )
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
    if parameters.constraints:
        explanation = EFFECTS_NOTE_WITH_CONSTRAINTS.format(fraction=fraction.label)
    style.write_below(figure, explanation)
    return figure
