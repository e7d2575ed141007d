"""Find the pile in the upright view of a photograph, in front of an uneven background.

Each pixel has three features: two ratios of the colour channels, and the brightness,
which has a small weight. A shadow changes the brightness of a surface but hardly its
ratios. The first guess of the pile is whatever differs from the background of its row.
GrabCut corrects the guess: it models the colours of both sides as mixtures of Gaussians
and prefers short boundaries. If the colours do not show a pile, roughness takes the
place of brightness: small grains have gaps between them, a wall has none.

The pile is found in two steps. A coarse view shows everything near the sheet, and
`find_pile` finds the pile in it. A fine view shows only the pile, and `refine_pile`
finds its boundary in it. All arrays have rows that count downwards. "Sides" are the two
sides of the boundary, pile and background. Hidden pixels do not show the scene, because
they lie outside the photograph or on the printed sheet.

References
----------
Rother, C., Kolmogorov, V., Blake, A. (2004). ACM Trans. Graph. 23, 309-314.
Shi, J., Tomasi, C. (1994). Good features to track. Proc. IEEE Conf. Comput. Vis.
Pattern Recognit., 593-600.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.photographs.camera import SideView
from repose.measure.photographs.segmentation import (
    SD_OVER_MEDIAN_DEVIATION,
    Segmentation,
    has_second_pile,
    pile_component,
    require_upright,
)

# Features of a pixel: red ratio, blue ratio and brightness, in this order. Each is
# MEAN_FEATURE plus a gain times a natural logarithm.
MEAN_FEATURE = 128  # middle of the range of the features, so that they fit into 8 bits
COLOUR_GAIN = 110.0  # of the two ratios
BRIGHTNESS_GAIN = 45.0  # smaller, so that the brightness has a small weight
MEAN_TONE = 100.0  # tone of a grey pixel whose brightness is `MEAN_FEATURE`
# Added to the tone of each channel, so that noise does not give dark pixels a colour
# and no logarithm of 0 is taken
ADDED_TONES = 14.0
FEATURE_BLUR_PX = 0.8  # standard deviation of the blur that removes noise
# Weights of the features that give brightness the same gain as the ratios
EQUAL_GAIN_WEIGHTS = np.array([1, 1, COLOUR_GAIN / BRIGHTNESS_GAIN], np.float32)

# Background
# Fraction of the width, on either side, that shows mostly background
SIDE_FRACTION = 0.25
LARGEST_TEXTURE = 30.0  # largest difference of the features within the background
N_BACKGROUND_FITS = 3
# A new estimate needs at least this fraction of a row near the previous estimate.
MIN_NEAR_FRACTION = 0.1
# A larger value makes a line that is fitted to few pixels flatter.
SLOPE_DAMPING = 0.02
SMALLEST_LEVEL = 6.0  # smallest difference from the background that marks a pile
GUESS_MARGIN_PX = 4  # around the first guess of the pile; also not background
OBJECT_MARGIN_PX = 3  # around other objects, to include their blurred edges
# Width of the border that shows no pile, over the width of the picture
BORDER_FRACTION = 0.02
BRIGHTNESS_WEIGHT = 0.5  # of the brightness, relative to the colours

# Shapes of the parts that differ from the background. Each number is a lower limit.
# Lowest row of a part on the plate, over the row of the plate
MIN_BASE_FRACTION = 0.97
MIN_PILE_ASPECT = 1.2  # width of a pile over its height
MIN_OBJECT_ASPECT = 2.5  # height of another object, such as a ruler, over its width
MIN_OBJECT_FRACTION = 0.15  # height of another object over that of the picture

# Shadows
SMOOTH_FRACTION = 0.5  # largest local scatter of a shadow over that of the pile
# Largest and smallest darkening by a shadow: the decrease of the logarithm of
# brightness
MAX_DARKENING = 1.6
MIN_DARKENING = 0.08
# In the plane of the two colour ratios, a shadow lies closer to the background than
# this distance. A pixel farther away has another colour.
COLOUR_DIFFERENCE = 22.0
# Shadows can be told from grains only if more than this fraction of a pile's area
# differs in colour from the background.
MIN_COLOURED_FRACTION = 0.3
# If a larger fraction of the upper part of a pile looks like shadow, the grains have
# the colour of the background.
MAX_UPPER_SHADOW = 0.12
# A patch of shadow contains a square with at least this side, and at least the height
# of the picture divided by `PATCHES_IN_HEIGHT`.
MIN_PATCH_PX = 5
PATCHES_IN_HEIGHT = 30
COMPARED_PX = 1200  # approximate longer side of the picture searched for shadows
COLUMNS_OVER_END = 20  # width of this picture over the width of each end of a row

# The boundary in the fine view; lengths are in heights of a grain
N_ROUNDS = 4  # of GrabCut, and of moving the boundary
# Distance from the coarse boundary within which the pile is uncertain
REACH_GRAINS = 0.4
REACH_ROUGH_GRAINS = 1.0  # the same for roughness, which is blurred over a grain
SMALLEST_REACH_PX = 4
# Radius of the neighbourhood from which the colours of both sides are taken
NEIGHBOURHOOD_GRAINS = 0.25
# Thresholds of `_move_boundary`: a pixel changes sides if the other side makes up at
# least this fraction of its colour. The boundary is half-way between both sides.
CERTAIN_FRACTION = 0.75
HALF_FRACTION = 0.5
LIGHT_PX = 2  # distance over which light may move the boundary, in pixels
TONE_CURVE = 2.2  # exponent that converts tones to light
LARGEST_TONE = 255
# A penumbra is the shadow along the boundary. At least this fraction of the colour of
# its pixels is that of the background.
PENUMBRA_FRACTION = 0.6
# A penumbra contains a rectangle of this size. Smaller patches are gaps between grains.
PENUMBRA_HEIGHT_GRAINS = 0.2
PENUMBRA_WIDTH_GRAINS = 0.8
NECK_GRAINS = 0.3  # half the width of the neck between a loose grain and the pile
GAP_GRAINS = 0.4  # a part with more background below it does not stand on the plate
# A smaller difference of features may also come from texture and noise.
FAINT_DIFFERENCE = 10.0
# Smallest squared distances between the values of both sides, to avoid divisions by
# zero
MIN_SQUARED_SPAN = 1e-9  # of features or light
MIN_SQUARED_RATIO_SPAN = 1e-6  # of the two colour ratios

# Roughness
# Change of the feature if the roughness changes by one standard deviation of that of
# the background
ROUGHNESS_GAIN = 3.0
GAP_RADIUS_GRAINS = 0.25  # radius of the widest gap between grains
WINDOW_PX = 5  # window of the gradients
SMALL_GRAIN_PX = 4.0  # assumed height of a grain in a coarse view that uses roughness
SMALLEST_SCATTER = 0.02  # assumed for the roughness of a background without noise

NO_PILE = (
    "nothing that stands on the plate differs from its background, or the background "
    "is not plain"
)


class NotPlainError(NoFlankError):
    """Raised if the colours of pile and background do not differ enough."""


class RefinedPile(NamedTuple):
    """The pile in a fine view."""

    pile: Segmentation
    # Fraction of the upper boundary at which pile and background hardly differ
    faint_fraction: float


class _Guess(NamedTuple):
    """The first guess of a pile, as masks (H, W)."""

    pile: np.ndarray
    others: np.ndarray  # other objects, such as a ruler
    has_neighbour: bool  # whether another pile stands beside it


class _SideComparison(NamedTuple):
    """The difference of a reduced picture from the two ends of each row."""

    step: int  # the picture contains every `step`-th row and column of the original
    mask: np.ndarray  # (H, W), of the pile
    difference: np.ndarray  # (H, W, 3), of the features


def find_pile(view: SideView, by_roughness: bool = False) -> tuple[np.ndarray, bool]:
    """Find the pixels of the pile in a coarse view, in front of an uneven background.

    Parameters
    ----------
    view : SideView
        The view (H, W).
    by_roughness : bool
        Whether roughness takes the place of brightness as the third feature.

    Returns
    -------
    mask : ndarray
        Mask (H, W) of the pile, uint8.
    has_neighbour : bool
        Whether another pile stands beside it.

    Raises
    ------
    NotPlainError
        If nothing that may be a pile differs from the background, probably because the
        background is not plain.
    """
    # Only the rows above the plate can show the pile.
    n_rows = math.ceil(view.base_row)
    hidden = view.hidden[:n_rows]
    grain_px = SMALL_GRAIN_PX if by_roughness else None
    features = _compute_view_features(view, n_rows, grain_px)
    # The third feature is the brightness, or the roughness.
    scatter = _compute_local_scatter(features[..., 2])

    # Guess the pile twice. The second time, the background is fitted without the pile
    # of the first guess.
    background = _fit_background(features, hidden)
    first_guess = _guess_pile(features - background, scatter, hidden)
    around_pile = _dilate(first_guess.pile, GUESS_MARGIN_PX)
    background = _fit_background(features, hidden | around_pile)
    guess = _guess_pile(features - background, scatter, hidden)

    # Replace other objects, such as a ruler, by the background, and let GrabCut
    # separate the pile.
    painted = np.where(guess.others[..., None], background, features)
    mask = _apply_grab_cut(painted, _make_coarse_marks(guess, hidden))
    mask = _remove_shadow(mask, painted - background, scatter)
    mask = _keep_largest_part(mask)
    # Add the rows below the plate, so that the mask has the shape of the view.
    below_plate = np.zeros((len(view.image) - n_rows, mask.shape[1]), np.uint8)
    return np.vstack([mask, below_plate]), guess.has_neighbour


def _make_coarse_marks(guess: _Guess, hidden: np.ndarray) -> np.ndarray:
    """Make the initial marks of pile and background for GrabCut in a coarse view.

    GrabCut changes the marks of uncertain pixels only. Hidden pixels, other objects,
    and the picture's border outside the pile are certainly background. All other pixels
    are probably pile or probably background.

    Parameters
    ----------
    guess : _Guess
        The first guess of the pile.
    hidden : ndarray
        Mask (H, W) of pixels that do not show the scene.

    Returns
    -------
    ndarray
        Marks (H, W) of OpenCV: GC_BGD, GC_PR_BGD or GC_PR_FGD.
    """
    marks = np.where(guess.pile, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    # The border lies on both sides and at the top. It leaves out the bottom, where the
    # pile stands.
    width = max(2, round(BORDER_FRACTION * guess.pile.shape[1]))
    is_border = np.ones(guess.pile.shape, bool)
    is_border[width:, width:-width] = False
    marks[is_border & ~guess.pile] = cv2.GC_BGD
    marks[hidden | guess.others] = cv2.GC_BGD
    return marks


def refine_pile(
    view: SideView, coarse: np.ndarray, grain_px: float, by_roughness: bool
) -> RefinedPile:
    """Find the boundary of a pile in a fine view, starting from a coarse mask.

    GrabCut first decides which pixels near the coarse boundary belong to the pile. The
    boundary is then moved to a fraction of a pixel.

    Parameters
    ----------
    view : SideView
        The fine view (H, W).
    coarse : ndarray
        Mask (H, W) of the pile in the pixels of this view, accurate to half a grain.
    grain_px : float
        Height of a grain in pixels.
    by_roughness : bool
        Whether roughness takes the place of brightness as the third feature. The
        brightness is then not used at all: no penumbra is removed, and the last step
        uses the features in place of the light.

    Returns
    -------
    RefinedPile
        The pile, and the fraction of its upper boundary that is faint.

    Raises
    ------
    NotPlainError
        If nothing is left of the pile.
    NoFlankError
        If the pile is upside down or touches the upper border of the view.
    """
    # Only the rows above the plate can show the pile.
    n_rows = math.ceil(view.base_row)
    coarse_mask = coarse[:n_rows]
    hidden = view.hidden[:n_rows]
    features = _compute_view_features(
        view, n_rows, grain_px if by_roughness else None, coarse_mask
    )

    # Decide which pixels near the coarse boundary belong to the pile.
    reach_grains = REACH_ROUGH_GRAINS if by_roughness else REACH_GRAINS
    reach = max(SMALLEST_REACH_PX, round(reach_grains * grain_px))
    marks = _make_fine_marks(coarse_mask, hidden, reach)
    mask = _apply_grab_cut(features, marks)
    if not by_roughness:
        mask = _remove_penumbra(mask, features, grain_px)
    mask = _keep_largest_part(mask)

    # Move the boundary by the features of the pixels. Pixels that resemble neither
    # side, such as those of shaded grains, stay where they are.
    is_free = _mark_free_pixels(marks, hidden, reach)
    near_px = NEIGHBOURHOOD_GRAINS * grain_px
    _, mask = _move_boundary(
        features,
        mask,
        is_free,
        neighbourhood_px=near_px,
        reach_px=near_px,
        threshold=CERTAIN_FRACTION,
    )
    # Then move it by a few pixels more, to where light comes from both sides equally.
    light = features if by_roughness else _compute_light(view, n_rows)
    pile_fraction, mask = _move_boundary(
        light,
        mask,
        is_free,
        neighbourhood_px=near_px,
        reach_px=LIGHT_PX,
        threshold=HALF_FRACTION,
    )

    mask = _remove_loose_grains(mask, grain_px)
    require_upright(mask)

    # The roughness already has its own gain.
    weights = np.ones(3, np.float32) if by_roughness else EQUAL_GAIN_WEIGHTS
    return RefinedPile(
        pile=_make_segmentation(view, mask, pile_fraction),
        faint_fraction=_compute_faint_fraction(features, mask, near_px, weights),
    )


def _make_segmentation(
    view: SideView, mask: np.ndarray, pile_fraction: np.ndarray
) -> Segmentation:
    """Combine what was found in a fine view to a `Segmentation`, as for a silhouette.

    Parameters
    ----------
    view : SideView
        The view.
    mask : ndarray
        Mask (H, W) of the pile in the rows above the plate.
    pile_fraction : ndarray
        Fraction (H, W) of the pile in each pixel of these rows.

    Returns
    -------
    Segmentation
        The pile in these rows.
    """
    n_rows = len(mask)
    grey = cv2.cvtColor(view.image[:n_rows], cv2.COLOR_BGR2GRAY)
    is_background = (mask == 0) & ~view.hidden[:n_rows]
    # The code that measures the pile finds its edge where the contrast equals the
    # level. Here this is where a pixel shows equal fractions of pile and background.
    return Segmentation(
        grey=grey,
        contrast=pile_fraction,
        level=HALF_FRACTION,
        mask=mask,
        base_row=view.base_row,
        is_darker=bool(grey[mask > 0].mean() < grey[is_background].mean()),
    )


def _make_fine_marks(coarse: np.ndarray, hidden: np.ndarray, reach: int) -> np.ndarray:
    """Make the initial marks of pile and background for GrabCut in a fine view.

    GrabCut changes the marks of uncertain pixels only. These are the pixels near the
    boundary of a coarse mask.

    Parameters
    ----------
    coarse : ndarray
        Mask (H, W) of the pile, accurate to half a grain.
    hidden : ndarray
        Mask (H, W) of pixels that do not show the scene.
    reach : int
        Distance from the boundary of the coarse mask within which pixels are uncertain,
        in pixels.

    Returns
    -------
    ndarray
        Marks (H, W) of OpenCV: GC_FGD, GC_PR_FGD, GC_PR_BGD or GC_BGD.
    """
    # Repeat the last row below the plate. Otherwise the erosion would also remove the
    # lowest rows of the pile, as if its base were a boundary.
    n_rows = len(coarse)
    extended = cv2.copyMakeBorder(coarse, 0, reach, 0, 0, cv2.BORDER_REPLICATE)
    is_inside = cv2.erode(extended, _make_disc(reach))[:n_rows] > 0
    is_outside = cv2.dilate(extended, _make_disc(reach))[:n_rows] == 0
    marks = np.where(coarse > 0, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    marks[is_inside] = cv2.GC_FGD
    marks[is_outside | hidden] = cv2.GC_BGD
    return marks


def _mark_free_pixels(marks: np.ndarray, hidden: np.ndarray, reach: int) -> np.ndarray:
    """Mark the pixels (H, W) that may change when the boundary of the pile is moved.

    These are the uncertain pixels that are not near hidden ones.

    Parameters
    ----------
    marks : ndarray
        The marks (H, W) of `_make_fine_marks`.
    hidden : ndarray
        Mask (H, W) of pixels that do not show the scene.
    reach : int
        Distance in pixels within which a pixel is near a hidden one.

    Returns
    -------
    ndarray
        Mask (H, W) of these pixels.
    """
    is_uncertain = (marks == cv2.GC_PR_BGD) | (marks == cv2.GC_PR_FGD)
    is_near_hidden = cv2.dilate(hidden.astype(np.uint8), _make_disc(reach)) > 0
    return is_uncertain & ~is_near_hidden


def _compute_faint_fraction(
    features: np.ndarray, mask: np.ndarray, near_px: float, weights: np.ndarray
) -> float:
    """Compute the fraction of the upper boundary along which both sides hardly differ.

    Parameters
    ----------
    features : ndarray
        Features (H, W, 3).
    mask : ndarray
        Mask (H, W) of the pile.
    near_px : float
        Radius in pixels of the neighbourhood over which each side is averaged.
    weights : ndarray
        Factors (3,) by which the features are multiplied before they are compared.

    Returns
    -------
    float
        The fraction, from 0 to 1.
    """
    # Compare both sides at the highest pixel of each column.
    pile, background = _average_sides(features, mask, near_px)
    difference = pile - background
    columns = np.flatnonzero(mask.any(axis=0))
    rows = mask.argmax(axis=0)[columns]
    contrast = np.linalg.norm(difference[rows, columns] * weights, axis=1)
    return float((contrast < FAINT_DIFFERENCE).mean())


def _compute_light(view: SideView, n_rows: int) -> np.ndarray:
    """Compute how much light reached each pixel of the camera above the plate.

    In a pixel on the boundary, the camera adds the light from both sides, and only then
    converts the sum to a tone. So the fractions of both sides follow from the light,
    and not from the tone.

    Parameters
    ----------
    view : SideView
        The view.
    n_rows : int
        Number of rows above the plate.

    Returns
    -------
    ndarray
        Light (n_rows, W, 3) in the three colour channels, from 0 to 1.
    """
    light = (view.image.astype(np.float32) / LARGEST_TONE) ** TONE_CURVE
    smooth = cv2.GaussianBlur(light, (0, 0), FEATURE_BLUR_PX)
    return _fill_hidden(smooth, view.hidden)[:n_rows]


def _move_boundary(
    values: np.ndarray,
    mask: np.ndarray,
    is_free: np.ndarray,
    *,
    neighbourhood_px: float,
    reach_px: float,
    threshold: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Move the boundary of a mask by the fraction of the pile that pixels near it show.

    A pixel near the boundary shows some of the pile and some of the background, and its
    value is a mixture of both. The fraction of the pile in it is 0 if the pixel has the
    mean value of the background nearby, and 1 if it has that of the pile nearby. A
    pixel moves to the other side of the boundary if enough of it belongs to that side.

    Parameters
    ----------
    values : ndarray
        The values (H, W, 3) that are compared: features or light.
    mask : ndarray
        Mask (H, W) of the pile.
    is_free : ndarray
        Mask (H, W) of the pixels that may change.
    neighbourhood_px : float
        Radius in pixels over which the local means are taken.
    reach_px : float
        Distance from the original boundary in pixels within which a pixel may change.
        It is at least `LIGHT_PX`.
    threshold : float
        A pixel changes sides if at least this fraction of it belongs to the other side.
        With 0.5, the boundary moves to where both sides have equal fractions. With a
        larger value, a pixel that resembles neither side stays on its side.

    Returns
    -------
    pile_fraction : ndarray
        Fraction of the pile (H, W) in each pixel, computed before the last move.
    mask : ndarray
        Mask (H, W) of the pile with the new boundary.
    """
    reach = max(LIGHT_PX, round(reach_px))
    # The gradient of the mask is the strip within the reach on both sides of its
    # boundary.
    boundary = cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, _make_disc(reach))
    may_change = is_free & (boundary > 0)
    # Each move of the boundary changes the local means, so compute them again.
    for _ in range(N_ROUNDS):
        pile, background = _average_sides(values, mask, neighbourhood_px)
        position, _ = _project_onto_span(values, pile, background, MIN_SQUARED_SPAN)
        pile_fraction = np.clip(position, 0, 1)
        becomes_pile = may_change & (pile_fraction >= threshold)
        becomes_background = may_change & (pile_fraction < 1 - threshold)
        moved_mask = np.where(becomes_background, 0, mask)
        moved_mask = np.where(becomes_pile, 1, moved_mask)
        mask = _keep_largest_part(moved_mask.astype(np.uint8))
    return pile_fraction, mask


def _project_onto_span(
    values: np.ndarray,
    pile: np.ndarray,
    background: np.ndarray,
    min_squared_span: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute how close values are to the mean of the pile, relative to the background.

    The N values of a pixel are a point in space. This point is projected onto the line
    from the mean point of the background to that of the pile, both taken near the
    pixel.

    Parameters
    ----------
    values : ndarray
        Values (H, W, N) of the pixels.
    pile, background : ndarray
        Mean values (H, W, N) of the two sides near each pixel.
    min_squared_span : float
        Lower limit of the squared distance between the two means, which avoids a
        division by zero.

    Returns
    -------
    position : ndarray
        Positions (H, W) on the line: 0 at the background, 1 at the pile.
    squared_span : ndarray
        Squared distances (H, W) between the two means.
    """
    span = pile - background
    projection = ((values - background) * span).sum(-1)
    squared_span = (span * span).sum(-1)
    return projection / np.maximum(squared_span, min_squared_span), squared_span


def _remove_penumbra(
    mask: np.ndarray, features: np.ndarray, grain_px: float
) -> np.ndarray:
    """Remove a narrow shadow along the boundary of a pile, at most about a grain wide.

    In a shadow, the ratios of the colours are those of the background. Where pile and
    background have nearly the same ratios, nothing is removed, because the ratios then
    tell nothing.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile.
    features : ndarray
        Features (H, W, 3): two ratios of the colours, and the brightness.
    grain_px : float
        Height of a grain in pixels.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile without the shadow.
    """
    # Average the pile and the background near each pixel, away from the boundary. On
    # the side of the pile, leave out a strip that is a grain wide. On the other side,
    # leave out half of that: every second row and column of the disc make a disc of
    # half the radius.
    disc = _make_disc(max(3, round(grain_px)))
    core = cv2.erode(mask, disc, borderValue=1)
    surroundings = 1 - cv2.dilate(mask, disc[::2, ::2])
    pile = _average_locally(features, core, 2 * grain_px)
    background = _average_locally(features, surroundings, 2 * grain_px)

    # Estimate the fraction of the pile in each pixel from the ratios of the colours,
    # which are the first two features.
    pile_fraction, squared_span = _project_onto_span(
        features[..., :2], pile[..., :2], background[..., :2], MIN_SQUARED_RATIO_SPAN
    )

    # Find pixels of the boundary that have the background's ratios.
    is_boundary = (mask > 0) & (core == 0)
    has_contrast = squared_span > COLOUR_DIFFERENCE**2
    has_background_ratios = pile_fraction < 1 - PENUMBRA_FRACTION
    # The ratios do not reveal black grains, but these are darker than a shadow. The
    # third feature is the gain times the logarithm of the brightness.
    darkening = background[..., 2] - features[..., 2]
    is_light_enough = darkening < BRIGHTNESS_GAIN * MAX_DARKENING
    is_shadow = is_boundary & has_contrast & has_background_ratios & is_light_enough

    # Leave smaller patches in the pile, because they are gaps between grains.
    height = max(3, round(PENUMBRA_HEIGHT_GRAINS * grain_px))
    width = max(3, round(PENUMBRA_WIDTH_GRAINS * grain_px))
    smallest_patch = np.ones((height, width), np.uint8)
    shadow = cv2.morphologyEx(
        is_shadow.astype(np.uint8), cv2.MORPH_OPEN, smallest_patch
    )
    return np.where(shadow > 0, 0, mask).astype(np.uint8)


def count_shadow_rows(image: np.ndarray, mask: np.ndarray) -> int:
    """Count the rows at the bottom of a pile that show a shadow rather than grains.

    These are all rows below the lowest row that shows mostly grains. The count is 0 if
    the grains have the background's colour, as in a grey picture, because then they
    cannot be told from a shadow (`_mark_shadow`).

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    mask : ndarray
        Mask (H, W) of the pile in it.

    Returns
    -------
    int
        The number of rows.
    """
    # Compare the widths of shadow and pile in each row of a reduced picture.
    comparison = _compare_with_sides(image, mask)
    small_mask = comparison.mask
    shadow = _mark_shadow(small_mask, comparison.difference)
    rows = np.flatnonzero(small_mask.any(axis=1))
    shadow_widths = shadow[rows].sum(axis=1)
    pile_widths = small_mask[rows].sum(axis=1, dtype=int)
    # All rows below the lowest row that mostly shows grains are shadow.
    grain_rows = np.flatnonzero(2 * shadow_widths < pile_widths)
    if grain_rows.size == 0:
        return 0
    n_shadow_rows = int(rows.size - 1 - grain_rows[-1])
    # Convert the count to rows of the original picture.
    return comparison.step * n_shadow_rows


def compute_shadow_fraction(image: np.ndarray, mask: np.ndarray) -> float:
    """Compute the fraction of a pile's area that consists of patches of shadow.

    The fraction is 0 if the grains have the background's colour, because then they
    cannot be told from a shadow.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    mask : ndarray
        Mask (H, W) of the pile in it.

    Returns
    -------
    float
        The fraction, from 0 to 1.
    """
    comparison = _compare_with_sides(image, mask)
    pile = comparison.mask
    difference = comparison.difference
    # Count the pixels whose colour differs from that of the background. The first two
    # features are the ratios of the colours.
    area = pile.sum(dtype=int)
    has_colour = np.hypot(difference[..., 0], difference[..., 1]) >= COLOUR_DIFFERENCE
    coloured_area = ((pile > 0) & has_colour).sum()
    if coloured_area <= MIN_COLOURED_FRACTION * area:
        return 0.0
    # Dark spots that are smaller than a patch are gaps between grains.
    image_height = len(pile)
    patch_size = max(MIN_PATCH_PX, image_height // PATCHES_IN_HEIGHT)
    patch = np.ones((patch_size, patch_size), np.uint8)
    is_darker = _find_darker_background(pile, difference)
    shadow = cv2.morphologyEx(is_darker.astype(np.uint8), cv2.MORPH_OPEN, patch)
    return float(shadow.sum(dtype=int) / area)


def _compare_with_sides(image: np.ndarray, mask: np.ndarray) -> _SideComparison:
    """Compare each pixel of a picture with the median over both ends of its row.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W). A large one is reduced.
    mask : ndarray
        Mask (H, W) of the pile in it.

    Returns
    -------
    _SideComparison
        The reduced picture's differences from these medians.
    """
    step = max(1, max(mask.shape) // COMPARED_PX)
    features = compute_features(np.ascontiguousarray(image[::step, ::step]))
    # The ends are narrow, because a shadow may be wider than the pile.
    width = max(2, features.shape[1] // COLUMNS_OVER_END)
    ends = np.hstack([features[:, :width], features[:, -width:]])
    background = np.median(ends, axis=1, keepdims=True)
    return _SideComparison(step, mask[::step, ::step], features - background)


def compute_features(image: np.ndarray) -> np.ndarray:
    """Compute the features of a picture: two ratios of channels, and the brightness.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR.

    Returns
    -------
    ndarray
        Features (H, W, 3), float32: red over green, blue over green, and the sum of the
        three channels. They are logarithms, because a shadow then shifts the brightness
        by the same amount everywhere. They are scaled to lie around `MEAN_FEATURE`, so
        that OpenCV's GrabCut can use them as tones of 8 bits.
    """
    smooth = cv2.GaussianBlur(image, (0, 0), FEATURE_BLUR_PX)
    blue, green, red = cv2.split(smooth.astype(np.float32) + ADDED_TONES)
    red_ratio = COLOUR_GAIN * np.log(red / green)
    blue_ratio = COLOUR_GAIN * np.log(blue / green)
    relative_brightness = np.log(red + green + blue) - math.log(3 * MEAN_TONE)
    brightness = BRIGHTNESS_GAIN * relative_brightness
    return MEAN_FEATURE + np.stack([red_ratio, blue_ratio, brightness], axis=-1)


def _compute_view_features(
    view: SideView,
    n_rows: int,
    grain_px: float | None,
    pile: np.ndarray | None = None,
) -> np.ndarray:
    """Compute the features of a view above the plate.

    Parameters
    ----------
    view : SideView
        The view.
    n_rows : int
        Number of rows above the plate.
    grain_px : float or None
        Height of a grain in pixels if roughness takes the place of brightness,
        otherwise None.
    pile : ndarray, optional
        Mask (n_rows, W) of the pile, if it is known. It is used only for the roughness.

    Returns
    -------
    ndarray
        Features (n_rows, W, 3).
    """
    features = _fill_hidden(compute_features(view.image), view.hidden)[:n_rows]
    if grain_px is not None:
        hidden = view.hidden[:n_rows]
        features[..., 2] = _compute_roughness(features[..., 2], hidden, grain_px, pile)
    return features


def _compute_roughness(
    brightness: np.ndarray,
    hidden: np.ndarray,
    grain_px: float,
    pile: np.ndarray | None,
) -> np.ndarray:
    """Compute the roughness of each pixel, which is high on grains and low on a wall.

    Roughness measures how much the brightness changes in the direction in which it
    changes least (Shi and Tomasi 1994). It is zero at a straight edge, such as that of
    a table. The roughness of the background in the same row is subtracted, and the
    result is scaled by the scatter of the background.

    Parameters
    ----------
    brightness : ndarray
        Brightness (H, W).
    hidden : ndarray
        Mask (H, W) of pixels that do not show the scene.
    grain_px : float
        Height of a grain in pixels.
    pile : ndarray or None
        Mask (H, W) of the pile, if it is known. It does not count as background.

    Returns
    -------
    ndarray
        Roughness (H, W), at least `MEAN_FEATURE`.
    """
    smallest_gradient = cv2.cornerMinEigenVal(
        np.ascontiguousarray(brightness), WINDOW_PX
    )
    # OpenCV returns a squared gradient. Close the gaps between grains, and remove the
    # margin that the window has added around the pile.
    radius = max(1, round(GAP_RADIUS_GRAINS * grain_px))
    gradient_root = np.sqrt(np.maximum(smallest_gradient, 0))
    closed = cv2.dilate(gradient_root, _make_disc(radius))
    raw_roughness = cv2.erode(closed, _make_disc(radius + WINDOW_PX // 2))

    # Subtract the roughness of the background in each row. Use a quantile below the
    # median, because the pile may fill half of a row.
    not_background = hidden
    if pile is not None:
        not_background = hidden | (cv2.dilate(pile, _make_disc(radius)) > 0)
    background = np.nanquantile(
        _hide_excluded(raw_roughness, not_background),
        SIDE_FRACTION,
        axis=1,
        keepdims=True,
    )
    roughness = raw_roughness - background

    # Scale by the standard deviation of the background, estimated from the median.
    median_deviation = np.median(np.abs(roughness[~not_background]))
    scatter = max(SD_OVER_MEDIAN_DEVIATION * median_deviation, SMALLEST_SCATTER)
    # GrabCut needs features from 0 to 255, see `compute_features`.
    largest = 255 - MEAN_FEATURE
    return MEAN_FEATURE + np.clip(ROUGHNESS_GAIN * roughness / scatter, 0, largest)


def _hide_excluded(values: np.ndarray, excluded: np.ndarray) -> np.ndarray:
    """Replace excluded values by NaN, so that statistics of a row ignore them.

    A row in which all values are excluded is left as it is, because otherwise its
    statistics would be NaN.

    Parameters
    ----------
    values : ndarray
        Values (H, W).
    excluded : ndarray
        Mask (H, W) of the values to replace.

    Returns
    -------
    ndarray
        The values (H, W), with NaN in place of excluded ones.
    """
    return np.where(excluded & ~excluded.all(axis=1, keepdims=True), np.nan, values)


def _fill_hidden(values: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Give each hidden pixel the values of the nearest visible pixel in its row.

    A row without visible pixels is left as it is.

    Parameters
    ----------
    values : ndarray
        Features or light (H, W, N).
    hidden : ndarray
        Mask (H, W) of the hidden pixels.

    Returns
    -------
    ndarray
        The completed values (H, W, N).
    """
    columns = np.arange(hidden.shape[1])
    # Find the nearest visible column to the left and to the right of each pixel. A
    # visible pixel is its own neighbour on both sides. If there is no visible column on
    # one side, stand-ins that are farther away than any picture is wide take its place.
    far_left, far_right = -(10**6), 10**6
    left = np.maximum.accumulate(np.where(hidden, far_left, columns), axis=1)
    from_right = np.where(hidden, far_right, columns)[:, ::-1]
    right = np.minimum.accumulate(from_right, axis=1)[:, ::-1]

    # Take the values of the nearer of the two; of the left one if both are as near.
    nearest = np.where(columns - left <= right - columns, left, right)
    has_visible = ~hidden.all(axis=1, keepdims=True)
    source = np.where(has_visible, nearest, columns)
    return np.take_along_axis(values, source[..., None], axis=1)


def _fit_background(features: np.ndarray, excluded: np.ndarray) -> np.ndarray:
    """Estimate the features of the background by a line along each row of a picture.

    The first estimate is the median over the outer parts of the row. A line is then
    fitted `N_BACKGROUND_FITS` times, each time to the pixels whose features are close
    to the previous estimate.

    Parameters
    ----------
    features : ndarray
        Features (H, W, 3) of the picture.
    excluded : ndarray
        Mask (H, W) of pixels that do not show the background.

    Returns
    -------
    ndarray
        Features (H, W, 3) of the background, including the part behind the pile.
    """
    width = excluded.shape[1]
    is_allowed = ~excluded[..., None]
    # x goes from -1 to 1, so this fraction of the width is 2 * SIDE_FRACTION of x.
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :, None]
    is_outer = (np.abs(x) > 1 - 2 * SIDE_FRACTION) & is_allowed
    # If all outer pixels of a row are excluded, use the median of all its pixels.
    has_no_outer = ~is_outer.any(axis=1, keepdims=True)
    outer = np.where(is_outer | has_no_outer, features, np.nan)
    background = np.repeat(np.nanmedian(outer, axis=1, keepdims=True), width, axis=1)
    for _ in range(N_BACKGROUND_FITS):
        distance = np.linalg.norm(features - background, axis=-1, keepdims=True)
        is_kept = (distance < LARGEST_TEXTURE) & is_allowed
        # The function returns a line for each row, and the number of pixels (H, 1, 1)
        # to which it was fitted.
        line, n_kept = _fit_lines(x, features, is_kept.astype(np.float32))
        # Keep the previous estimate of a row if too few of its pixels are close to it.
        has_few = n_kept < MIN_NEAR_FRACTION * width
        background = np.where(has_few, background, line).astype(np.float32)
    return background


def _fit_lines(
    x: np.ndarray, values: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit each feature in each row of a picture by a straight line over x.

    Parameters
    ----------
    x : ndarray
        Positions (1, W, 1) of the columns.
    values : ndarray
        Features (H, W, 3).
    weight : ndarray
        Weights (H, W, 1) of the pixels, 0 or 1.

    Returns
    -------
    lines : ndarray
        Values (H, W, 3) of the lines at all pixels.
    n_pixels : ndarray
        Number of pixels (H, 1, 1) with weight 1 in each row. It is too large by 0.001,
        which avoids a division by zero here.
    """
    # All sums go along a row (axis 1) and keep this axis, so that they can be combined
    # with arrays of all pixels.
    width = x.shape[1]
    n_pixels = weight.sum(1, keepdims=True) + 1e-3
    mean_x = (weight * x).sum(1, keepdims=True) / n_pixels
    mean_value = (weight * values).sum(1, keepdims=True) / n_pixels
    # The slope is the sum of products over the sum of squares. The added term reduces
    # the slope of a line that is fitted to few pixels.
    squares = (weight * (x - mean_x) ** 2).sum(1, keepdims=True) + SLOPE_DAMPING * width
    products = (weight * (x - mean_x) * (values - mean_value)).sum(1, keepdims=True)
    return mean_value + products / squares * (x - mean_x), n_pixels


def _compute_local_scatter(brightness: np.ndarray) -> np.ndarray:
    """Compute the standard deviation of the brightness around each pixel.

    It is large for grains with gaps between them, and small in a shadow.

    Parameters
    ----------
    brightness : ndarray
        Brightness (H, W).

    Returns
    -------
    ndarray
        Scatter (H, W).
    """
    size = (5, 5)
    mean_square = cv2.blur(brightness * brightness, size)
    variance = mean_square - cv2.blur(brightness, size) ** 2
    return np.sqrt(np.maximum(variance, 0))


def _guess_pile(
    difference: np.ndarray, scatter: np.ndarray, hidden: np.ndarray
) -> _Guess:
    """Guess where the pile is, from the difference between picture and background.

    The pile is the largest part that differs from the background, stands on the plate,
    and is clearly wider than high.

    Parameters
    ----------
    difference : ndarray
        Difference (H, W, 3) of the features from the background.
    scatter : ndarray
        Local scatter (H, W) of the brightness.
    hidden : ndarray
        Mask (H, W) of pixels that do not show the scene.

    Returns
    -------
    _Guess
        The pile and other objects.

    Raises
    ------
    NotPlainError
        If there is no such part, so the colours do not show a pile.
    """
    total_difference = _combine_differences(difference, scatter, hidden)
    otsu_level, _ = cv2.threshold(
        np.clip(total_difference, 0, 255).astype(np.uint8),
        0,
        1,
        cv2.THRESH_BINARY | cv2.THRESH_OTSU,
    )
    # If no pile is found, try lower levels. If the plate resembles the grains more than
    # the wall does, the foot of the pile is found only at a lower level.
    for level in (otsu_level, otsu_level / 2, otsu_level / 4):
        if level < SMALLEST_LEVEL:
            break
        is_different = (total_difference > level).astype(np.uint8)
        pile, others = _find_pile_and_objects(is_different)
        if pile is not None:
            return _Guess(
                pile,
                others=_dilate(others, OBJECT_MARGIN_PX),
                has_neighbour=has_second_pile(is_different),
            )
    raise NotPlainError(NO_PILE)


def _combine_differences(
    difference: np.ndarray, scatter: np.ndarray, hidden: np.ndarray
) -> np.ndarray:
    """Combine the differences in colour, brightness and scatter from the background.

    The parameters are those of `_guess_pile`.

    Returns
    -------
    ndarray
        The combined difference (H, W); 0 for a hidden pixel.
    """
    # Subtract the median scatter of each row, because the level edge of a table also
    # causes scatter.
    row_scatter = np.nanmedian(_hide_excluded(scatter, hidden), axis=1, keepdims=True)
    squares = (
        (difference[..., :2] ** 2).sum(-1)
        + (BRIGHTNESS_WEIGHT * difference[..., 2]) ** 2
        + np.maximum(scatter - row_scatter, 0) ** 2
    )
    smooth = cv2.GaussianBlur(np.sqrt(squares), (0, 0), 1.5)
    return np.where(hidden, 0, smooth)


def _dilate(mask: np.ndarray, margin_px: int) -> np.ndarray:
    """Extend a mask (H, W) by a number of pixels in all directions."""
    side = 2 * margin_px + 1
    square = np.ones((side, side), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), square) > 0


def _find_pile_and_objects(mask: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """Find the pile and other objects, such as a ruler, among the parts of a mask.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W), uint8, of everything that differs from the background. The plate
        lies below its last row.

    Returns
    -------
    pile : ndarray or None
        Mask (H, W) of the largest part that stands on the plate and is clearly wider
        than high; None if there is none.
    others : ndarray
        Mask (H, W) of all parts that are much higher than wide, and high enough to be
        an object. They need not stand on the plate.
    """
    # Remove specks first.
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    # OpenCV returns the bounding box and the area of each part.
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(opened)
    _, tops, widths, heights, areas = statistics.T

    n_rows = len(mask)
    is_on_plate = tops + heights >= MIN_BASE_FRACTION * n_rows
    may_be_pile = is_on_plate & (widths > MIN_PILE_ASPECT * heights)
    is_narrow = heights > MIN_OBJECT_ASPECT * widths
    is_object = is_narrow & (heights > MIN_OBJECT_FRACTION * n_rows)
    # Part 0 is the background.
    may_be_pile[0] = False
    is_object[0] = False

    pile = None
    if may_be_pile.any():
        largest = int(np.argmax(np.where(may_be_pile, areas, 0)))
        pile = labels == largest
    # `labels` has the number of the part of each pixel.
    return pile, is_object[labels]


def _apply_grab_cut(features: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Find the pile with GrabCut, starting from marks of pile and background.

    The result is the same in each call, because the seed of OpenCV's random numbers is
    set.

    Parameters
    ----------
    features : ndarray
        Features (H, W, 3).
    marks : ndarray
        OpenCV's marks (H, W): each pixel is pile or background, certainly or probably.
        They are not changed.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile, without specks.
    """
    picture = np.clip(features, 0, 255).astype(np.uint8)
    result = marks.copy()  # is overwritten
    no_rectangle = (0, 0, 0, 0)  # is not used if GrabCut begins with marks
    # Working memory for the models of both sides, of the size that OpenCV prescribes
    background_model = np.zeros((1, 65))
    pile_model = np.zeros((1, 65))
    cv2.setRNGSeed(1)
    cv2.grabCut(
        picture,
        result,
        no_rectangle,
        background_model,
        pile_model,
        N_ROUNDS,
        cv2.GC_INIT_WITH_MASK,
    )
    is_pile = (result == cv2.GC_FGD) | (result == cv2.GC_PR_FGD)
    return cv2.morphologyEx(
        is_pile.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
    )


def _remove_shadow(
    mask: np.ndarray, difference: np.ndarray, scatter: np.ndarray
) -> np.ndarray:
    """Remove a smooth shadow on the background from the mask of a pile.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile.
    difference : ndarray
        Difference (H, W, 3) of the features from the background.
    scatter : ndarray
        Local scatter (H, W) of the brightness.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile without the shadow.
    """
    is_smooth = scatter < SMOOTH_FRACTION * np.median(scatter[mask > 0])
    is_shadow = _mark_shadow(mask, difference) & is_smooth
    without_specks = cv2.morphologyEx(
        is_shadow.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
    )
    return np.where(without_specks > 0, 0, mask).astype(np.uint8)


def _mark_shadow(mask: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Mark the pixels of a pile that look like a shadow on the background.

    A pixel in shadow has the background's colour but is darker. A shadow lies at the
    foot of a pile. If many pixels in the upper part of the pile look like shadow, too,
    the grains have the background's colour, and no pixel is marked.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile. It has no empty rows between others.
    difference : ndarray
        Difference (H, W, 3) of the features from the background: both ratios of the
        colours, and the brightness.

    Returns
    -------
    ndarray
        Mask (H, W) of these pixels.
    """
    shadow = _find_darker_background(mask, difference)
    rows = np.flatnonzero(mask.any(axis=1))
    if rows.size == 0:
        return shadow
    # The upper part is two thirds of the height, which is the number of rows.
    upper_part = slice(rows[0], rows[0] + (2 * rows.size) // 3)
    upper_area = mask[upper_part].sum()
    if shadow[upper_part].sum() > MAX_UPPER_SHADOW * upper_area:
        return np.zeros(mask.shape, bool)
    return shadow


def _find_darker_background(mask: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Find the pixels of a pile that have the background's colour but are darker.

    The returned mask does not include black grains, because they are darker than a
    shadow, or slightly darker pixels, because they may be noise. The parameters are
    those of `_mark_shadow`.
    """
    colour_distance = np.sqrt((difference[..., :2] ** 2).sum(-1))
    darkening = -difference[..., 2] / BRIGHTNESS_GAIN
    return (
        (mask > 0)
        & (colour_distance < COLOUR_DIFFERENCE)
        & (darkening > MIN_DARKENING)
        & (darkening < MAX_DARKENING)
    )


def _remove_loose_grains(mask: np.ndarray, grain_px: float) -> np.ndarray:
    """Remove loose grains behind a pile, and loose grains that touch its foot.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile.
    grain_px : float
        Height of a grain in pixels.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile without loose grains.
    """
    standing = _remove_floating_parts(_keep_largest_part(mask), GAP_GRAINS * grain_px)
    without_loose = _remove_grains_at_foot(standing, round(NECK_GRAINS * grain_px))
    return _keep_largest_part(without_loose)


def _remove_floating_parts(mask: np.ndarray, gap_px: float) -> np.ndarray:
    """Remove parts with background below them, such as a loose grain behind the pile.

    The foot of the pile is the lowest row that is at least half as wide as the widest
    row. It is not the row of the plate, because the outlines of round grains end a
    little above the plate. The rows below the foot are not changed.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile, 0 or 1.
    gap_px : float
        Largest number of background pixels that may lie between a pixel of the pile and
        the foot, in the same column. A pixel with more of them below it is removed.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile without these parts.
    """
    widths = mask.sum(axis=1, dtype=int)
    is_wide = 2 * widths >= max(widths.max(), 1)
    # The first wide row from below is the foot.
    n_rows_to_foot = len(mask) - int(is_wide[::-1].argmax())
    # Order the rows from the foot upwards.
    is_pile = mask[:n_rows_to_foot][::-1] > 0
    n_background_below = np.cumsum(~is_pile, axis=0)
    is_standing = is_pile & (n_background_below <= gap_px)
    rows_to_foot = is_standing[::-1].astype(np.uint8)
    return np.concatenate([rows_to_foot, mask[n_rows_to_foot:]])


def _remove_grains_at_foot(mask: np.ndarray, radius: int) -> np.ndarray:
    """Remove loose grains that touch the foot of a pile.

    Such grains are low parts of the mask, connected with the rest only by a narrow
    neck.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile.
    radius : int
        Radius of the erosion in pixels, which breaks a neck of at most twice this
        width.

    Returns
    -------
    ndarray
        Mask (H, W) of the pile without these grains.
    """
    if radius < 1:
        return mask

    # Erode the mask by the radius, so that it breaks apart at its necks. First extend
    # it below the plate, because its lower edge is not a boundary of the pile.
    extended = cv2.copyMakeBorder(mask, 0, 2 * radius, 0, 0, cv2.BORDER_REPLICATE)
    core = cv2.erode(extended, _make_disc(radius))[: len(mask)]
    # OpenCV returns the bounding box and the area of each part.
    n_labels, labels, statistics, _ = cv2.connectedComponentsWithStats(core)
    n_parts = n_labels - 1  # without the background, which has label 0
    if n_parts < 2:
        return mask

    # Assign each pixel to the nearest part. For this, OpenCV numbers the pixels of all
    # parts (the zeros of its argument), and returns for each pixel of the picture the
    # number of the nearest of them. The table `part_of_pixel` converts such a number to
    # the part.
    _, nearest_pixel = cv2.distanceTransformWithLabels(
        1 - core, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    part_of_pixel = np.zeros(nearest_pixel.max() + 1, int)
    part_of_pixel[nearest_pixel[core > 0]] = labels[core > 0]
    nearest_part = part_of_pixel[nearest_pixel]

    # Parts whose top is below the mean row of the pile are loose. The background and
    # the largest part are never loose.
    mean_row = np.flatnonzero(mask.any(axis=1)).mean()
    is_loose = statistics[:, cv2.CC_STAT_TOP] > mean_row
    largest = 1 + int(statistics[1:, cv2.CC_STAT_AREA].argmax())
    is_loose[[0, largest]] = False
    return np.where(is_loose[nearest_part], 0, mask).astype(np.uint8)


def _make_disc(radius: int) -> np.ndarray:
    """Make a disc with a radius in pixels, for morphological operations."""
    size = 2 * radius + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))


def _average_sides(
    values: np.ndarray, mask: np.ndarray, radius_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """Average the values of pile and background, each in the neighbourhood of a pixel.

    Parameters
    ----------
    values : ndarray
        Values (H, W, N).
    mask : ndarray
        Mask (H, W) of the pile, 0 or 1.
    radius_px : float
        Radius of the neighbourhood in pixels.

    Returns
    -------
    pile, background : ndarray
        Means (H, W, N) of each side.
    """
    pile = _average_locally(values, mask, radius_px)
    background = _average_locally(values, 1 - mask, radius_px)
    return pile, background


def _average_locally(
    values: np.ndarray, part: np.ndarray, radius_px: float
) -> np.ndarray:
    """Average the values of a part of the picture in the neighbourhood of each pixel.

    Parameters
    ----------
    values : ndarray
        Values (H, W, N).
    part : ndarray
        Mask (H, W) of the part, 0 or 1.
    radius_px : float
        Radius of the neighbourhood in pixels. A radius below 3 is raised to 3.

    Returns
    -------
    ndarray
        Means (H, W, N); 0 where the part has no pixel nearby.
    """
    size = 2 * max(3, round(radius_px)) + 1
    count = cv2.boxFilter(
        part.astype(np.float32),
        -1,
        (size, size),
        normalize=False,
        borderType=cv2.BORDER_REPLICATE,
    )
    total = cv2.boxFilter(
        values * part[..., None].astype(np.float32),
        -1,
        (size, size),
        normalize=False,
        borderType=cv2.BORDER_REPLICATE,
    )
    return total / np.maximum(count, 1)[..., None]


def _keep_largest_part(mask: np.ndarray) -> np.ndarray:
    """Keep the largest part of a mask (H, W), and fill its holes.

    Raises NotPlainError if the mask is empty.
    """
    if not mask.any():
        raise NotPlainError(NO_PILE)
    return pile_component(mask, largest_only=True)
