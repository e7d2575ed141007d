"""Draw the outline and the slope of a simulated pile with the measured values."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.targets import Target, Targets
from repose.common.numbers import format_significant
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.saved_pours import read_first_pour
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains

from . import style
from .registry import Inputs, StudyView

HEIGHT_RESPONSE = "height_mm"  # name of the response
GRID_STEP_MM = 0.5
# Ends of the line of a slope, as fractions of the height, if the settings give none.
DEFAULT_LEVELS = (0.3, 0.8)


class Outline(NamedTuple):
    """The upper edge of a pile in one view."""

    x_mm: np.ndarray  # (W,), from the middle between its flanks
    height_mm: np.ndarray  # (W,)


class Flank(NamedTuple):
    """The part of both sides of a pile between two heights."""

    heights_mm: np.ndarray  # (2,), the lower and the upper end
    left_mm: float  # position at half of this height on the left side
    right_mm: float  # the same on the right side

    def place_line(self, side: int, angle_deg: float) -> np.ndarray:
        """Compute where a line with a given angle has its ends on one side of the pile.

        The line passes through the middle of the flank.

        Parameters
        ----------
        side : int
            -1 for the left side, and 1 for the right side.
        angle_deg : float
            Angle of the line above the horizontal.

        Returns
        -------
        ndarray
            Positions (2,) of the lower and the upper end in mm.
        """
        middle_mm = self.left_mm if side < 0 else self.right_mm
        rise_mm = self.heights_mm - self.heights_mm.mean()
        return middle_mm - side * rise_mm / np.tan(np.radians(angle_deg))


def draw_outline_and_measurement(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the outline of a simulated pile with the measured height and slope.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `heap` contains simulated piles, of which the first is drawn.
        `particle` contains the shape of the grains, and `berry` the sizes of the mean
        grain.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    settings = study.settings.measure.for_grain(read_grain(inputs["berry"]))
    pour = read_first_pour(inputs["heap"])
    particle = Particle.load(inputs["particle"])
    grains = Grains.of(pour, particle)
    height_m, views = pile.prepare_views(grains, settings, pour["in_pile"])
    profiles = [pile.find_profile(view) for view in views]
    measured = pile.measure_profiles(profiles, height_m, settings)
    outlines = [_center_outline(profile, settings) for profile, _ in profiles]
    mean_outline = _average_outlines(outlines)

    # Draw the simulated pile, and the measured values on top of it.
    figure = style.new_figure(style.PAGE, 2.8)
    panel = figure.subplots()
    _draw_outlines(panel, outlines, mean_outline)
    _draw_simulated_height(panel, outlines, mean_outline)
    _draw_measured_height(panel, study.targets, mean_outline)
    angle_target = _find_angle_target(study.targets)
    if angle_target is not None:
        flank = _find_flank(mean_outline, settings)
        _draw_measured_slope(panel, angle_target, flank)
        # The angle of repose of the simulated pile, averaged over its views
        _draw_simulated_slope(panel, angle_target, flank, measured.aor_deg)
    panel.set(
        xlabel="distance from the middle of the pile (mm)",
        ylabel="height (mm)",
        ylim=(0, None),
        aspect="equal",
    )
    figure.legend(
        *panel.get_legend_handles_labels(), loc="outside lower center", ncols=2
    )
    return figure


def _find_angle_target(targets: Targets) -> Target | None:
    """Find the first target that is the angle of repose; None if there is none.

    The definition of a response lists the settings on which it depends. Only the angle
    of repose depends on `measure.response`, which chooses the line of the angle.
    """
    for target in targets:
        if "measure.response" in target.response.definition:
            return target
    return None


def _center_outline(profile: np.ndarray, settings: MeasureSettings) -> Outline:
    """Convert the profile of a view to an outline around the middle of the pile.

    `profile` contains the heights (W,) of the upper edge in pixels.
    """
    columns = np.arange(profile.size)
    # The middle is halfway between the outermost columns that are at least half as high
    # as the pile.
    high_columns = np.flatnonzero(profile >= 0.5 * profile.max())
    middle = 0.5 * (high_columns[0] + high_columns[-1])
    scale = settings.mm_per_pixel
    return Outline((columns - middle) * scale, profile * scale)


def _average_outlines(outlines: list[Outline]) -> Outline:
    """Average the outlines of all views.

    Beyond the ends of an outline, its height is 0.
    """
    # Interpolate all outlines at the same positions, over the width of all of them.
    low = min(outline.x_mm[0] for outline in outlines)
    high = max(outline.x_mm[-1] for outline in outlines)
    x_mm = np.arange(low, high + GRID_STEP_MM, GRID_STEP_MM)
    heights = [
        np.interp(x_mm, outline.x_mm, outline.height_mm, left=0.0, right=0.0)
        for outline in outlines
    ]
    return Outline(x_mm, np.mean(heights, axis=0))


def _draw_outlines(
    panel: Axes, outlines: Sequence[Outline], mean_outline: Outline
) -> None:
    """Draw the outline of the simulated pile in each view, and the mean of all views."""
    for k, outline in enumerate(outlines):
        # Only the first view gets an entry in the legend.
        label = f"simulated pile, views: {len(outlines)}" if k == 0 else None
        panel.plot(*outline, color=style.SKY, lw=0.5, alpha=0.6, label=label)
    panel.plot(
        *mean_outline,
        color=style.BLUE,
        lw=1.6,
        label="simulated pile, mean of the views",
    )


def _draw_simulated_height(
    panel: Axes, outlines: Sequence[Outline], mean_outline: Outline
) -> None:
    """Draw the height of the simulated pile, the mean of its highest points in the views.

    The mean outline is lower than this, because the highest points of the views lie at
    different positions. The line is as wide as the mean outline.
    """
    highest_mm = [float(outline.height_mm.max()) for outline in outlines]
    height_mm = float(np.mean(highest_mm))
    panel.plot(
        mean_outline.x_mm[[0, -1]],
        [height_mm, height_mm],
        color=style.BLUE,
        ls="--",
        lw=1.0,
        label=f"simulated height, highest points: {height_mm:.1f} mm",
    )


def _draw_measured_height(panel: Axes, targets: Targets, mean_outline: Outline) -> None:
    """Draw the measured height as a line with its standard deviation.

    The line is as wide as the mean outline. If the height is not a target, nothing is
    drawn.
    """
    for target in targets:
        if target.name != HEIGHT_RESPONSE:
            continue
        ends = mean_outline.x_mm[[0, -1]]
        panel.fill_between(
            ends,
            target.value - target.sd,
            target.value + target.sd,
            color=style.ORANGE,
            alpha=0.18,
            lw=0,
        )
        panel.plot(
            ends,
            [target.value, target.value],
            color=style.ORANGE,
            label=f"measured height {_format_mean_and_sd(target)}",
        )


def _find_flank(mean_outline: Outline, settings: MeasureSettings) -> Flank:
    """Find the part of the mean outline to which the line of the angle belongs.

    `settings` determine between which heights the line is fitted.
    """
    low, high = _find_heights_of_line(settings, mean_outline.height_mm.max())
    # The middle of a flank is the outermost position at which the outline is as high as
    # the mean of both heights.
    is_high = mean_outline.height_mm >= 0.5 * (low + high)
    high_x = mean_outline.x_mm[is_high]
    return Flank(
        heights_mm=np.array([low, high]),
        left_mm=high_x[high_x <= 0].min(),
        right_mm=high_x[high_x >= 0].max(),
    )


def _draw_measured_slope(panel: Axes, target: Target, flank: Flank) -> None:
    """Draw the measured angle as a line on each flank, in a band of its deviation.

    The measurement does not include the width of the pile, so the line is drawn through
    the middle of the simulated flank.
    """
    for side in (-1, 1):
        flattest = flank.place_line(side, target.value - target.sd)
        steepest = flank.place_line(side, target.value + target.sd)
        panel.fill_betweenx(
            flank.heights_mm, flattest, steepest, color=style.RED, alpha=0.4
        )
    _draw_slope(
        panel,
        flank,
        target.value,
        label=(
            f"measured slope, {target.response.symbol} {_format_mean_and_sd(target)}; "
            "its position is not measured"
        ),
        color=style.RED,
        ls=(0, (5, 2)),
    )


def _draw_simulated_slope(
    panel: Axes, target: Target, flank: Flank, angle_deg: float | None
) -> None:
    """Draw the angle of the simulated pile as a line on each flank.

    The lines fitted in single views lie at different positions, so their mean slope is
    drawn through the middle of the mean flank. If the angle could not be measured,
    nothing is drawn.
    """
    if angle_deg is None:
        return
    symbol = target.response.symbol
    unit = target.response.unit
    _draw_slope(
        panel,
        flank,
        angle_deg,
        label=f"simulated slope, mean of the views: {symbol} {angle_deg:.1f} {unit}",
        color=style.BLACK,
        ls="-",
    )


def _draw_slope(
    panel: Axes, flank: Flank, angle_deg: float, label: str, **line_style: Any
) -> None:
    """Draw a line with this angle on each flank, with one entry in the legend."""
    for side in (-1, 1):
        panel.plot(
            flank.place_line(side, angle_deg),
            flank.heights_mm,
            lw=1.2,
            # Only the line on the right flank gets an entry in the legend, because
            # labels that begin with an underscore get none.
            label=label if side == 1 else f"_{label}",
            **line_style,
        )


def _find_heights_of_line(
    settings: MeasureSettings, top_mm: float
) -> tuple[float, float]:
    """Find the heights in mm between which the line of the angle is fitted.

    `top_mm` is the height of the pile. If the settings do not give both heights as
    fractions of it, `DEFAULT_LEVELS` are used.
    """
    low = settings.fit_from
    high = settings.fit_to
    if isinstance(low, str) or isinstance(high, str):
        low, high = DEFAULT_LEVELS
    return low * top_mm, high * top_mm


def _format_mean_and_sd(target: Target) -> str:
    """Write a measured mean with the standard deviation of single repetitions."""
    mean = format_significant(target.value)
    return f"{mean} ± {format_significant(target.sd)} {target.response.unit} (SD)"
