"""Figures of a calibration with a simulator of the user's own: runs, their history, intervals, posterior."""

import math
import os
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure, FigureBase

from repose.calibrate.calibration import Calibration
from repose.calibrate.strategies.runs import TURN
from repose.common.files import path_of
from repose.report.shown import Shown

from . import plane, style, uncertainty

BARS = "a point is the mean of one parameter set's runs; bars: ± 1 standard error of a mean"
MOST_TICKS = 8  # of batches
SETS = "sets predicted inside all ranges"


class Part(NamedTuple):
    """A figure of a calibration: its height in inches on a page, and what draws it."""

    height: float
    draw: Callable[[FigureBase], None]


def plot(
    calibration: Calibration, path: str | os.PathLike[str] | None = None
) -> Figure:
    """Draw all figures of a calibration below each other; with a path they are written, too, as .png, .pdf or .svg."""
    if path is not None:
        path = path_of("path", path)
        style.check_ending(path)
    heights, drawings = zip(*parts(calibration).values(), strict=True)
    with style.applied():
        figure = style.new_figure(style.PAGE, sum(heights))
        places = figure.subfigures(len(heights), squeeze=False, height_ratios=heights)
        for place, draw in zip(places.flat, drawings, strict=True):
            draw(place)
        if path is not None:
            style.save(figure, path, small_run=False)
    return figure


def parts(calibration: Calibration) -> dict[str, Part]:
    """Give the figures that a calibration has by name: a plane needs two targets, a history two batches."""
    free, targets = calibration.study.parameters.dimensions, calibration.study.targets
    pairs, found = len(plane.plain(targets)), dict[str, Part]()
    if pairs > 1:
        found["plane"] = Part(
            4.7 * math.ceil(math.comb(pairs, 2) / 2),
            partial(_plane, calibration),
        )
    if len(set(calibration.runs.attrs.get(TURN, ()))) > 1:
        found["history"] = Part(
            0.4 + 2.2 * math.ceil(len(targets) / 2),
            partial(_history, calibration),
        )
    found["intervals"] = Part(0.9 + 0.4 * free, partial(_intervals, calibration))
    if free > 1:
        found["corner"] = Part(style.PAGE, partial(_corner, calibration))
    return found


def shown(calibration: Calibration) -> Shown:
    """Give the study of a calibration as figures and report take it."""
    study = calibration.study
    return Shown(
        {"label": study.settings.label, "small_run": False},
        targets=study.targets,
        space=study.parameters,
    )


def _plane(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the means of the samples and the answer in the plane of each pair of targets."""
    targets, solutions = plane.plain(calibration.study.targets), calibration.solutions
    panels = style.panels_in(figure, math.comb(len(targets), 2))
    samples = calibration.samples[calibration.samples["runs"] > 0]
    plane.draw(panels, targets, {"own": samples}, solutions, solutions.iloc[0], BARS)


def _history(calibration: Calibration, figure: FigureBase) -> None:
    """Draw how far the sets of each batch are off each target, and the prediction of the answer behind them."""
    study, samples, runs = calibration.study, calibration.samples, calibration.runs
    turn_of = (
        pd.Series(runs.attrs[TURN], runs["sample"]).groupby(level=0).first()
    )  # of a sample's first run
    batch = samples["sample"].map(turn_of)
    within = samples.groupby(batch)["sample"]
    place = batch + 0.6 * ((within.cumcount() + 0.5) / within.transform("size") - 0.5)
    batches, last = list(range(batch.min(), batch.max() + 1)), batch.max() + 1
    ticks = batches[:: math.ceil(len(batches) / MOST_TICKS)]
    panels = style.panels_in(figure, len(study.targets))
    for k, (panel, target) in enumerate(zip(panels, study.targets, strict=True)):
        percent = 100 / target.whole
        style.off_target(
            panel, target, study.settings.sequential.tolerance_percent, "batch"
        )
        error, off = (
            percent * samples[target.response.error].fillna(0.0),
            target.off_percent(samples[target.name]),
        )
        look = {"fmt": "o", "ms": 3, "mew": 0, "elinewidth": 0.6, "color": style.BLUE}
        panel.errorbar(
            place,
            off,
            error,
            label="parameter sets, simulated ± standard error",
            **look,
        )
        mean, error = (
            target.off_percent(calibration.answer.mean[k]),
            percent * calibration.answer.error[k],
        )
        look = {"fmt": "D", "ms": 5, "mfc": "white", "color": style.RED}
        panel.errorbar(
            [last],
            [mean],
            [error],
            label="the answer, predicted ± standard error",
            **look,
        )
        panel.set_xticks([*ticks, last], [*map(str, ticks), "answer"])
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3
    )


def _intervals(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the credible intervals with the answer."""
    table = calibration.posterior.parameters
    values = [calibration.parameters[name] for name in table["parameter"]]
    uncertainty.draw_intervals(figure.subplots(), table.assign(answer=values))


def _corner(calibration: Calibration, figure: FigureBase) -> None:
    """Draw the posterior with the sets that are predicted inside all ranges."""
    cloud = calibration.solutions[calibration.solutions["feasible"]]
    uncertainty.draw_corner(
        figure, shown(calibration), calibration.posterior, cloud, SETS
    )
