"""Draw the probability and the predictions of the sequential strategy over its runs."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.targets import Target
from repose.common.files import read_table

from . import panels, style
from .registry import Inputs, StudyView

# Position of the check on the axis of the runs, as a multiple of the last batch's
# position
CHECK_X_FACTOR = 1.06


def draw_sequential_batches(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the probability and the predicted responses after each batch of runs.

    The last point of each response is the check: the answer, simulated again.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `batches` has a row for each batch, with the number of all runs
        so far as `pours`, three probabilities, and the predicted responses. `check` has
        a row for each response, with its mean in the new simulations of the answer.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    settings = study.settings.sequential
    # Each response has two columns, which `_draw_predictions` reads, too.
    columns = [
        f"{name}_{number}" for name in targets.names for number in ("mean", "error")
    ]
    batches = read_table(
        inputs["batches"], ("pours", "probability", "reachable", "in_reach", *columns)
    )
    check = read_table(inputs["check"], ("response", "simulated", "simulated_error"))
    check = check.set_index("response")

    # Make one panel for the probability, and one for each response.
    figure, axes = panels.grid(1 + len(targets), 2.2, columns=3, extra_height=0.4)
    _draw_probability(axes[0], batches, settings)
    for panel, target in zip(axes[1:], targets, strict=True):
        style.prepare_deviations(
            panel, target, percent=settings.tolerance_percent, xlabel="runs"
        )
        _draw_predictions(panel, batches, target)
        # Draw the check after the last batch.
        last_runs = float(batches["pours"].iloc[-1])
        _draw_check(panel, check, target, x=CHECK_X_FACTOR * last_runs)
    style.draw_legend(axes, loc="outside lower center", ncols=3)

    last_probability = batches["probability"].iloc[-1]
    outcome = "reached" if last_probability >= settings.probability else "NOT reached"
    title = (
        f"{outcome}: all targets met with probability {last_probability:.2f}; required: "
        f"{settings.probability:g}"
    )
    figure.suptitle(title, fontsize=7.5)
    return figure


def _draw_probability(
    panel: Axes, batches: pd.DataFrame, settings: SequentialSettings
) -> None:
    """Draw the probability of meeting the targets after each batch.

    The panel shows three columns of the table. `probability` is that with which the
    best parameter set meets the targets. `reachable` is the largest value to which the
    remaining runs can raise it. `in_reach` is the probability that there is any
    parameter set that meets the targets.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    batches : DataFrame
        A row for each batch of runs.
    settings : SequentialSettings
        The section `sequential`.
    """
    n_runs = batches["pours"]
    panel.plot(
        n_runs,
        batches["probability"],
        "o-",
        ms=4,
        color=style.BLUE,
        label="probability of the best set",
    )
    panel.plot(
        n_runs,
        batches["reachable"],
        ":",
        ms=4,
        color=style.GREY,
        label="largest value that the remaining runs can reach",
    )
    panel.plot(
        n_runs,
        batches["in_reach"],
        "s-",
        ms=3,
        color=style.ORANGE,
        label="probability that any set meets the targets",
    )
    panel.axhline(
        settings.probability,
        color=style.RED,
        ls="--",
        lw=0.9,
        label="required probability",
    )
    panel.set(xlabel="runs", ylabel="probability", ylim=(-0.03, 1.02))
    panel.set_title(f"All targets within {settings.tolerance_percent:g} %")


def _draw_predictions(panel: Axes, batches: pd.DataFrame, target: Target) -> None:
    """Draw how far the predicted response is off its target after each batch."""
    mean = batches[f"{target.name}_mean"]
    error = batches[f"{target.name}_error"]
    panel.errorbar(
        batches["pours"],
        100 / target.whole * (mean - target.aim),
        100 / target.whole * error,
        fmt="D",
        ms=4,
        mfc="white",
        color=style.BLACK,
        label="predicted ± standard error",
    )


def _draw_check(panel: Axes, check: pd.DataFrame, target: Target, x: float) -> None:
    """Draw how far the answer's response is off its target in the new simulations.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    check : DataFrame
        A row for each response, by name, with its simulated mean and standard error.
    target : Target
        The target of the response.
    x : float
        Position of the answer on the axis of the runs.
    """
    simulated, error = check.loc[target.name, ["simulated", "simulated_error"]].astype(
        float
    )
    panel.errorbar(
        [x],
        [target.off_percent(simulated)],
        [100 * error / target.whole],
        fmt="o",
        ms=5,
        color=style.RED,
        label="the answer, simulated again ± standard error",
    )
