"""Measure the angle of repose and the height of a pile, in a picture or a simulation.

The steps are those of the paper (section 2.3, Figure 6): grey, threshold, edge,
boundary, and a straight line through each flank. The angle of repose is the mean of the
two arctangents. The height of the pile is that of its highest point over the base; the
paper and the tables call it Height. A simulated pile is first projected to silhouettes.

The paper does not define the part of a lumpy boundary through which the line goes. Five
definitions are measured on every pile (`repose.measure.angles`), and the configuration
names the one that is the response. Their biases and noise are in
research/docs/angle_line_tests.md.

OpenCV is imported where a picture is measured.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.angles import measure_sides
from repose.measure.definitions import DEFINITIONS
from repose.measure.image_files import read_image as read_image
from repose.measure.results import Angle, Measurement, PileResult
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import (
    BACKGROUND_TONE,
    PILE_TONE,
    ConvexBody,
    Grains,
    compute_outlines,
    find_extent,
    find_top,
    paint_outlines,
)

if TYPE_CHECKING:
    from repose.measure.photographs.segmentation import Segmentation

# Smallest height of a pile, in heights of a grain (20 mm in all for the mean grain).
# Lower grains form a layer, which has no measurable slope.
LOWEST_PILE_GRAINS = 1.5
CREST_TOLERANCE = 1e-6  # pixels by which columns of the crest may differ in height


# --- one picture ---------------------------------------------------------------------


def measure_image(
    image: np.ndarray,
    mm_per_pixel: float,
    settings: MeasureSettings | None = None,
    *,
    base_row: float | None = None,
) -> Measurement:
    """Measure the pile in a side view (section 2.3 of the paper).

    Parameters
    ----------
    image : ndarray
        A photograph (H, W, 3), BGR, or a silhouette (H, W).
    mm_per_pixel : float
        Its scale.
    settings : MeasureSettings, optional
        Settings of the lines; the default ones if left out.
    base_row : float, optional
        Row of the plate; the default is the pile's lowest row.

    Returns
    -------
    Measurement
        The angles and the height of the pile.

    Raises
    ------
    NoFlankError
        If the picture shows no pile, or if its response cannot be measured.
    """
    from repose.measure.photographs.segmentation import require_upright, segment

    settings = settings or MeasureSettings.with_defaults()
    settings = settings.with_scale(mm_per_pixel)
    pile = segment(image, settings.largest_pile_only, base_row)
    require_upright(pile.mask)
    return with_response(measure_segmented(pile, settings))


def with_response(measurement: Measurement) -> Measurement:
    """Return a measurement unchanged if it has its response; raise NoFlankError if not.

    The response is the angle by the definition that the settings name. The error states
    the reason why this angle could not be measured.
    """
    if measurement.response not in measurement.angles:
        raise NoFlankError(measurement.reasons[measurement.response])
    return measurement


def find_profile(pile: "Segmentation") -> tuple[np.ndarray, int]:
    """Compute the profile of a pile and find its crest.

    Parameters
    ----------
    pile : Segmentation
        The pile in a picture of W columns.

    Returns
    -------
    profile : ndarray
        Heights (W,) of the pile's upper edge over its base in pixels; 0 beside the
        pile.
    crest : int
        Index of the highest column; the middle one if several are equally high.
    """
    from repose.measure.photographs.segmentation import find_upper_edge

    # A column without a pile has no edge (NaN).
    edge = find_upper_edge(pile.mask, pile.contrast, pile.level)
    height = np.maximum(pile.base_row - edge, 0.0)
    profile = np.where(np.isnan(edge), 0.0, height)
    highest = np.flatnonzero(profile >= profile.max() - CREST_TOLERANCE)
    return profile, int(highest[highest.size // 2])


def measure_segmented(pile: "Segmentation", settings: MeasureSettings) -> Measurement:
    """Measure the angles and the height of a pile that was found in a picture.

    If an angle cannot be measured, the result contains the reason in its place. This is
    an error only if the angle is the response, see `with_response`.

    Parameters
    ----------
    pile : Segmentation
        The pile in the picture.
    settings : MeasureSettings
        Settings of the lines, with the scale of the picture.

    Returns
    -------
    Measurement
        The angles and the height of the pile.
    """
    profile, crest_column = find_profile(pile)
    measured, reasons = measure_sides(profile, crest_column, settings)
    last_column = profile.size - 1
    angles = {}
    for name, (pile_angle_deg, left, right) in measured.items():
        # Convert the ends of both lines, which are distances and heights, to columns
        # and rows of the picture. Distances on the right side are counted from the last
        # column backwards.
        left_line = tuple(
            (distance, pile.base_row - height) for distance, height in left.ends
        )
        right_line = tuple(
            (last_column - distance, pile.base_row - height)
            for distance, height in right.ends
        )
        angles[name] = Angle(
            left_deg=left.angle_deg,
            right_deg=right.angle_deg,
            aor_deg=pile_angle_deg,
            lines=(left_line, right_line),
        )
    crest_height = float(profile[crest_column])
    return Measurement(
        response=settings.response,
        angles=angles,
        reasons=reasons,
        height_mm=crest_height * settings.mm_per_pixel,
        base_row=pile.base_row,
        top=(float(crest_column), pile.base_row - crest_height),
        contour=pile.contour,
        is_darker=pile.is_darker,
    )


# --- a simulated pile ----------------------------------------------------------------


def measure_pile(
    grains: Grains,
    settings: MeasureSettings | None = None,
    in_pile: np.ndarray | None = None,
) -> PileResult:
    """Measure a simulated pile on the plate z = 0 from `settings.views` sides.

    Parameters
    ----------
    grains : Grains
        The N grains.
    settings : MeasureSettings, optional
        Settings of the measurement; the default ones if left out.
    in_pile : ndarray, optional
        Mask (N,) of the grains in the pile, which are the largest cluster of touching
        grains. Without it, the pile is the largest connected part of each silhouette,
        which may include a loose grain in front.

    Returns
    -------
    PileResult
        The angles by each definition in each view, and the height of the pile.

    Raises
    ------
    NoFlankError
        If there is no pile.
    """
    settings = settings or MeasureSettings.with_defaults()
    settings = with_grain_height(settings, grains.particle)
    height_m, views = prepare_views(grains, settings, in_pile)
    profiles = (find_profile(view) for view in views)
    return measure_profiles(profiles, height_m, settings)


def measure_profiles(
    profiles: Iterable[tuple[np.ndarray, int]],
    height_m: float,
    settings: MeasureSettings,
) -> PileResult:
    """Measure a simulated pile by its profiles in all views.

    Parameters
    ----------
    profiles : iterable of tuple
        For each of `settings.views` views the profile (W,) and the column of its crest,
        see `find_profile`.
    height_m : float
        Height of the highest point of the pile, computed from the grains themselves.
        The heights that are measured in the views are less accurate, and are returned
        beside it.
    settings : MeasureSettings
        Settings of the measurement.

    Returns
    -------
    PileResult
        The angles by each definition in each view, and the height of the pile.
    """
    # An angle is NaN in a view in which it cannot be measured.
    angles = {name: np.full(settings.views, np.nan) for name in DEFINITIONS}
    sides_deg = np.full((settings.views, 2), np.nan)
    heights_mm = np.full(settings.views, np.nan)
    first_reasons: dict[str, str] = {}
    for view, (profile, crest) in enumerate(profiles):
        heights_mm[view] = profile[crest] * settings.mm_per_pixel
        measured, reasons = measure_sides(profile, crest, settings)
        for name, angle in measured.items():
            angles[name][view] = angle.angle_deg
        if settings.response in measured:
            _, left, right = measured[settings.response]
            sides_deg[view] = left.angle_deg, right.angle_deg
        # Add the reasons of this view. The right operand of | takes precedence, so the
        # reason of an earlier view is kept.
        first_reasons = reasons | first_reasons
    return PileResult(
        response=settings.response,
        height_mm=1e3 * height_m,
        view_height_mm=heights_mm,
        aor=angles,
        sides_deg=sides_deg,
        reasons=first_reasons,
    )


def prepare_views(
    grains: Grains, settings: MeasureSettings, in_pile: np.ndarray | None = None
) -> tuple[float, Iterator["Segmentation"]]:
    """Prepare the side views of a simulated pile, and compute its height.

    Parameters
    ----------
    grains : Grains
        The N grains.
    settings : MeasureSettings
        Settings of the measurement. They must have the height of a grain, see
        `with_grain_height`.
    in_pile : ndarray, optional
        Mask (N,) of the grains in the pile, see `measure_pile`.

    Returns
    -------
    height_m : float
        Height of the highest point.
    views : iterator of Segmentation
        The views. Each view is drawn only when the iterator reaches it, so errors in
        drawing a view occur there, and the iterator can be used only once.

    Raises
    ------
    NoFlankError
        If there is no grain, or if the pile is so low that it is only a layer.
    """
    # Leave out loose grains, if the settings demand it and the pile is known.
    pile_grains = grains
    if in_pile is not None and settings.largest_pile_only:
        pile_grains = grains[np.asarray(in_pile, bool)]
    if len(pile_grains.centres_m) == 0:
        raise NoFlankError("no grain lies in the pile")

    height_m = find_top(pile_grains)
    assert settings.berry_height_mm is not None
    min_height_m = LOWEST_PILE_GRAINS * 1e-3 * settings.berry_height_mm
    if height_m < min_height_m:
        raise NoFlankError(
            f"the pile is {1e3 * height_m:.1f} mm high; a flank needs "
            f"{1e3 * min_height_m:.1f} mm"
        )
    return height_m, _draw_silhouettes(pile_grains, settings)


def _draw_silhouettes(
    grains: Grains, settings: MeasureSettings
) -> Iterator["Segmentation"]:
    """Draw the silhouettes of grains, one view after the other.

    The views are spread evenly over half a turn about the z axis.

    Parameters
    ----------
    grains : Grains
        The grains.
    settings : MeasureSettings
        Number and scale of the views.

    Yields
    ------
    Segmentation
        A view, split into pile and background.

    Raises
    ------
    NoFlankError
        If the picture of the pile has too few pixels to measure a flank.
    """
    from repose.measure.photographs.segmentation import MIN_SIDE_PX, segment_silhouette

    mm_per_pixel = settings.mm_per_pixel
    azimuths_deg = np.arange(settings.views) * 180.0 / settings.views
    # OpenCV fills half a pixel too much on all sides, so move the outlines inwards.
    half_pixel_m = mm_per_pixel * 0.5e-3
    for polygons in compute_outlines(grains, azimuths_deg, inset_m=half_pixel_m):
        extent = find_extent(polygons, mm_per_pixel)
        image = paint_outlines(polygons, mm_per_pixel, extent)
        if min(image.shape) < MIN_SIDE_PX:
            rows, columns = image.shape
            raise NoFlankError(
                f"the pile's picture has {columns} by {rows} pixels of "
                f"{mm_per_pixel:g} mm (measure.mm_per_pixel); a flank needs "
                f"{MIN_SIDE_PX} by {MIN_SIDE_PX}"
            )
        yield segment_silhouette(
            image, PILE_TONE, BACKGROUND_TONE, settings.largest_pile_only
        )


def with_grain_height(
    settings: MeasureSettings, particle: ConvexBody
) -> MeasureSettings:
    """Return the settings with the height of a grain, added if they lack it.

    `particle` is the shape of the grains; its equivalent diameter is the height.
    """
    return settings.with_grain_height(1e3 * equivalent_diameter(particle))


def equivalent_diameter(particle: ConvexBody) -> float:
    """Compute the equivalent diameter in m (Eq. 1).

    It is the cube root of the product of the body's extents along its three axes.
    """
    # Add up how far the body reaches in the direction of each axis and against it.
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    support = (particle.support_point(directions) * directions).sum(axis=1)
    extents = support[:3] + support[3:]
    return float(np.prod(extents) ** (1 / 3))
