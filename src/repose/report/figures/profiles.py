"""Draw the measured, predicted and simulated profiles of targets that are profiles.

A profile, such as the outline of a pile, is a sum of functions with coefficients. The
coefficients are called scores, and each score is a target.
"""

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

PANEL_HEIGHT = 2.6  # inches


def draw_profiles(inputs: Inputs, study: StudyView) -> Figure:
    """Draw each measured profile, with the predicted and simulated ones of the answer.

    Parameters
    ----------
    inputs : mapping
        Path of `table4`, the table of the parameter sets that were simulated again. One
        of them is the answer, the set that the study reports. Each has the scores
        (coefficients) of each profile: predicted and simulated, with standard errors.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    # Attributes such as `predicted` are names of columns.
    scores = [target.response for target in targets if target.profile]
    columns = []
    for score in scores:
        columns += [score.predicted, score.simulated, score.standard_error]
    table = read_table(inputs["table4"], ("role", *columns))
    answer = find_answer(table, source=inputs["table4"])

    figure, axes = panels.grid(len(targets.profiles), PANEL_HEIGHT)
    for panel, profile in zip(axes, targets.profiles.values(), strict=True):
        score_targets = [target for target in targets if target.profile == profile]
        responses = [target.response for target in score_targets]
        lines = _compute_answer_lines(profile, responses, answer)
        # The functions are orthonormal. So the variance of the heights, averaged over
        # the profile, is the sum of the variances of the scores. All scores have the
        # same variance, and there are `profile.n_functions` of them.
        height_sd = score_targets[0].sd * np.sqrt(profile.n_functions)
        draw(panel, profile, sd=height_sd, lines=lines)
    style.label_panels(axes)
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
    """Draw a measured profile, and other profiles as lines with a band of their error.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    profile : Profile
        The measured profile.
    sd : float
        Standard deviation of the measured heights.
    lines : mapping
        A pair for each line, by its label: the heights (M,) at the positions of the
        measured profile, and half the width of the band around them, which may be 0.
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
    # The name of a profile, such as `surface_mm`, ends with the unit of its lengths.
    unit = profile.name.rpartition("_")[2]
    panel.set(xlabel=f"x ({unit})", ylabel=f"height ({unit})")
    panel.legend(loc="best")
