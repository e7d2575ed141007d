"""Draw the measured, predicted and simulated profiles of targets that are profiles."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.profiles import Profile
from repose.calibrate.responses import Response
from repose.common.files import read_table
from repose.stages.tables import find_answer

from . import panels, style
from .registry import Inputs, StudyView


def draw_profiles(inputs: Inputs, study: StudyView) -> Figure:
    """Draw each measured profile with the corresponding profile of the answer.

    Parameters
    ----------
    inputs : mapping
        Path of `table4`, which contains the answer with the scores of each profile:
        predicted and simulated ones, and their standard errors.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    scores = [target.response for target in targets if target.profile]
    columns = []
    for score in scores:
        columns += [score.predicted, score.simulated, score.standard_error]
    table = read_table(inputs["table4"], ("role", *columns))
    answer = find_answer(table, source=inputs["table4"])

    # A profile is a sum of functions, and the coefficients, its scores, are targets.
    figure, axes = panels.grid(len(targets.profiles), 2.6)
    for panel, profile in zip(axes, targets.profiles.values(), strict=True):
        score_targets = [target for target in targets if target.profile == profile]
        responses = [target.response for target in score_targets]
        lines = _compute_answer_lines(profile, responses, answer)
        # All scores have the same standard deviation. Because the functions are
        # orthonormal, the mean variance of the heights is the sum of the variances of
        # the scores.
        height_sd = score_targets[0].sd * np.sqrt(profile.functions)
        draw(panel, profile, sd=height_sd, lines=lines)
    style.name_panels(axes)
    return figure


def _compute_answer_lines(
    profile: Profile, scores: Sequence[Response], answer: pd.Series
) -> dict[str, tuple[np.ndarray, Any]]:
    """Compute the predicted and the simulated heights of the answer.

    Parameters
    ----------
    profile : Profile
        The measured profile.
    scores : sequence of Response
        The responses that are scores of this profile.
    answer : Series
        The answer, a row of Table 4.

    Returns
    -------
    dict
        The heights (M,), and half the width of the band around them, by label of the
        line.
    """
    predicted = answer[[score.predicted for score in scores]].to_numpy(float)
    simulated = answer[[score.simulated for score in scores]].to_numpy(float)
    error = answer[[score.standard_error for score in scores]].to_numpy(float)
    # The errors of the scores are independent, so their squares add up.
    squared_error = np.square(np.nan_to_num(error))
    height_error = np.sqrt(profile.basis**2 @ squared_error)
    return {
        "predicted": (profile.heights(predicted), 0.0),
        "simulated ± SE": (profile.heights(simulated), height_error),
    }


def draw(
    panel: Axes,
    profile: Profile,
    sd: float,
    lines: Mapping[str, tuple[np.ndarray, Any]],
) -> None:
    """Draw a measured profile, and lines of heights at the same positions.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    profile : Profile
        The measured profile.
    sd : float
        Standard deviation of the measured heights.
    lines : mapping
        Heights (M,) of each line, and half the width of the band around them, by label.
    """
    panel.errorbar(
        profile.x,
        profile.z,
        yerr=sd,
        fmt="o",
        ms=3,
        color=style.BLACK,
        elinewidth=0.8,
        zorder=3,
        label="measured ± SD",
    )
    for k, (label, line) in enumerate(lines.items()):
        heights, half_width = line
        line_style = style.series_style(k)
        panel.plot(profile.x, heights, label=label, **line_style)
        panel.fill_between(
            profile.x,
            heights - half_width,
            heights + half_width,
            color=line_style["color"],
            alpha=0.2,
            lw=0,
        )
    # The name of a profile ends with the unit of its lengths, after an underscore.
    unit = profile.name.rpartition("_")[2]
    panel.set(xlabel=f"x ({unit})", ylabel=f"height ({unit})")
    panel.legend(loc="best")
