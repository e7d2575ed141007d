"""Draw the figures of a calibration whose simulator is the user's own program."""

import math
import os
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from repose.calibrate.calibration import Calibration
from repose.calibrate.targets import Target
from repose.common.files import TURN_COLUMN, convert_to_path

from . import panels, plane, posterior, style, surrogate

BARS_NOTE = "a point is the mean of one parameter set's runs; bars: ± 1 standard error of a mean"
MAX_BATCH_TICKS = 8
BATCH_WIDTH = 0.6  # width of the points of a batch, in distances between two batches
# Heights of the figures in inches: without any row, and for each row
PLANE_BASE_HEIGHT = 1.0
HISTORY_BASE_HEIGHT = 0.4
HISTORY_ROW_HEIGHT = 2.2
INTERVALS_BASE_HEIGHT = 0.9
INTERVALS_ROW_HEIGHT = 0.4
# Key of the answer's note that contains the predictions at the training, validation and
# test samples
ACCURACY_KEY = "accuracy"
SET_LABEL = "sets predicted inside all ranges"


class CalibrationFigure(NamedTuple):
    """A figure of a calibration."""

    height: float  # inches on a page
    draw: Callable[[FigureBase], None]  # function that fills an empty figure


def plot(
    calibration: Calibration, path: str | os.PathLike[str] | None = None
) -> Figure:
    """Draw all figures of a calibration below each other.

    Parameters
    ----------
    calibration : Calibration
        The answer of a study.
    path : path, optional
        File to which the figure is also written. It ends in .png, .pdf or .svg.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, which contains all others.
    """
    if path is not None:
        path = convert_to_path("path", path)
        style.check_ending(path)
    # Each figure gets a part of the page, which is as high as it requires.
    parts = list(list_figures(calibration).values())
    heights = [part.height for part in parts]
    with style.applied():
        figure = style.new_figure(style.PAGE, sum(heights))
        subfigures = figure.subfigures(
            len(heights), squeeze=False, height_ratios=heights
        )
        for subfigure, part in zip(subfigures.flat, parts, strict=True):
            part.draw(subfigure)
        if path is not None:
            style.save(figure, path, small_run=False)
    return figure


def list_figures(calibration: Calibration) -> dict[str, CalibrationFigure]:
    """List the figures that a calibration has, by name.

    The planes require at least two targets that are numbers, the history two batches,
    and the corner plot two parameters. The accuracy requires a surrogate that was
    tested on separate samples.

    Parameters
    ----------
    calibration : Calibration
        The answer of a study.

    Returns
    -------
    dict
        The figures from top to bottom.
    """
    n_free = calibration.study.parameters.dimensions
    targets = calibration.study.targets
    n_plane_targets = len(plane.leave_out_profiles(targets))
    # The number of the batch of each run, if the study had batches, is an attribute of
    # the table of runs.
    n_batches = len(set(calibration.runs.attrs.get(TURN_COLUMN, ())))

    # The height of a figure grows with the number of its rows.
    n_target_rows = math.ceil(len(targets) / 2)  # two panels in a row
    figures = {}
    if n_plane_targets > 1:
        n_planes = math.comb(n_plane_targets, 2)
        figures["plane"] = CalibrationFigure(
            PLANE_BASE_HEIGHT + plane.ROW_HEIGHT * n_planes,
            partial(_draw_planes, calibration),
        )
    if n_batches > 1:
        figures["history"] = CalibrationFigure(
            HISTORY_BASE_HEIGHT + HISTORY_ROW_HEIGHT * n_target_rows,
            partial(_draw_history, calibration),
        )
    # Only a strategy that tested its surrogate writes this note.
    if ACCURACY_KEY in calibration.answer.notes:
        figures["accuracy"] = CalibrationFigure(
            surrogate.ACCURACY_ROW_HEIGHT * n_target_rows,
            partial(_draw_accuracy, calibration),
        )
    figures["intervals"] = CalibrationFigure(
        INTERVALS_BASE_HEIGHT + INTERVALS_ROW_HEIGHT * n_free,
        partial(_draw_intervals, calibration),
    )
    if n_free > 1:
        figures["corner"] = CalibrationFigure(
            style.PAGE, partial(_draw_corner, calibration)
        )
    return figures


def _draw_planes(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the samples and the answer in the plane of each pair of targets.

    The figure must be empty.
    """
    targets = plane.leave_out_profiles(calibration.study.targets)
    samples = calibration.samples
    data = plane.PlaneData(
        samples={"own": samples[samples["runs"] > 0]},
        solutions=calibration.solutions,
        answer=calibration.solutions.iloc[0],
    )
    axes = panels.add_panels(figure, 2 * math.comb(len(targets), 2))
    plane.draw_pairs_of_targets(axes, targets, data=data, legend_title=BARS_NOTE)


def _draw_history(calibration: Calibration, figure: FigureBase) -> None:
    """Draw how far the samples of each batch are from each target, and then the answer.

    A band shows the tolerance in the section `sequential`, also for other strategies.

    Parameters
    ----------
    calibration : Calibration
        The answer of a study, which is drawn after the last batch.
    figure : FigureBase
        An empty figure.
    """
    study = calibration.study
    batch_of_sample = _find_batches(calibration)
    answer_x = batch_of_sample.max() + 1
    batches = list(range(batch_of_sample.min(), answer_x))
    # If there are many batches, only some of them get a tick on the axis.
    ticks = batches[:: math.ceil(len(batches) / MAX_BATCH_TICKS)]
    tolerance = study.settings.sequential.tolerance_percent

    axes = panels.add_panels(figure, len(study.targets))
    for k, (panel, target) in enumerate(zip(axes, study.targets, strict=True)):
        style.prepare_deviations(panel, target, percent=tolerance, xlabel="batch")
        _draw_samples(panel, calibration.samples, target, batch_of_sample)
        _draw_answer(
            panel,
            target,
            mean=calibration.answer.mean[k],
            error=calibration.answer.error[k],
            x=answer_x,
        )
        panel.set_xticks([*ticks, answer_x], [*map(str, ticks), "answer"])
    # All panels have the same labels.
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3
    )


def _find_batches(calibration: Calibration) -> pd.Series:
    """Find the batch of each sample, which is the batch of its first run.

    Parameters
    ----------
    calibration : Calibration
        The answer of a study.

    Returns
    -------
    Series
        The number of the batch, with the index of the table of samples.
    """
    # A sample may have runs from several batches.
    runs = calibration.runs
    batch_of_run = pd.Series(runs.attrs[TURN_COLUMN], runs["sample"])
    batch_of_sample = batch_of_run.groupby(level=0).first()
    return calibration.samples["sample"].map(batch_of_sample)


def _draw_samples(
    panel: Axes, samples: pd.DataFrame, target: Target, batch_of_sample: pd.Series
) -> None:
    """Draw how far the samples are off a target, with those of a batch side by side.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    samples : DataFrame
        A row for each sample, with its responses and standard errors.
    target : Target
        The target.
    batch_of_sample : Series
        Number of the batch of each sample, with the index of `samples`.
    """
    # Spread the samples of a batch evenly over a part of the distance to the next
    # batch. The fraction is the position of a sample within this part, from 0 to 1.
    samples_of_batch = samples.groupby(batch_of_sample)["sample"]
    fraction = (samples_of_batch.cumcount() + 0.5) / samples_of_batch.transform("size")
    x = batch_of_sample + BATCH_WIDTH * (fraction - 0.5)
    percent_of_target = 100 / target.whole
    panel.errorbar(
        x,
        target.off_percent(samples[target.name]),
        percent_of_target * samples[target.response.standard_error].fillna(0.0),
        fmt="o",
        ms=3,
        mew=0,
        elinewidth=0.6,
        color=style.BLUE,
        label="parameter sets, simulated ± standard error",
    )


def _draw_answer(
    panel: Axes, target: Target, mean: float, error: float, x: int
) -> None:
    """Draw how far the predicted response of the answer is off a target.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    target : Target
        The target.
    mean, error : float
        The predicted response and its standard error.
    x : int
        Position of the answer on the x axis.
    """
    percent_of_target = 100 / target.whole
    panel.errorbar(
        [x],
        [target.off_percent(mean)],
        [percent_of_target * error],
        fmt="D",
        ms=5,
        mfc="white",
        color=style.RED,
        label="the answer, predicted ± standard error",
    )


def _draw_accuracy(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the predictions of the surrogate against the simulated means."""
    targets = calibration.study.targets
    predictions = calibration.answer.notes[ACCURACY_KEY]
    errors = calibration.samples[["sample", *targets.errors]]
    table = predictions.merge(errors, on="sample", how="left")
    axes = panels.add_panels(figure, len(targets))
    surrogate.draw_accuracy(axes, table, targets.responses)


def _draw_intervals(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the credible intervals with the answer."""
    table = calibration.posterior.parameters
    values = [calibration.parameters[name] for name in table["parameter"]]
    posterior.draw_intervals(
        figure.subplots(), table.assign(answer=values), calibration.study.parameters
    )


def _draw_corner(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the posterior with the sets that are predicted inside all ranges."""
    study = calibration.study
    solutions = calibration.solutions
    data = posterior.CornerData(
        posterior=calibration.posterior,
        sets=solutions[solutions["feasible"]],
        sets_label=SET_LABEL,
    )
    posterior.draw_corner(figure, study.parameters, targets=study.targets, data=data)
