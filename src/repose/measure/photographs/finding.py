"""Find the pile in the upright view of a photograph whose background is not plain.

Colours are compared as ratios of the channels, and brightness has a small weight: a shadow changes the brightness of a
surface and hardly its colour. A first guess is the difference from the background, row by row. GrabCut, which models
the colours of both sides by mixtures and prefers short boundaries, corrects it. Where colours show no pile, roughness
takes the place of brightness: small grains have gaps between them, a wall has none.

References
----------
Rother, C., Kolmogorov, V., Blake, A. (2004). ACM Trans. Graph. 23, 309-314.
Shi, J., Tomasi, C. (1994). Good features to track. Proc. IEEE Conf. Comput. Vis. Pattern Recognit., 593-600.
"""

import math
from typing import Any

import cv2
import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.photographs.camera import SideView
from repose.measure.photographs.segmentation import (
    Segmentation,
    another_heap,
    pile_component,
    require_upright,
)

COLOUR_GAIN, BRIGHTNESS_GAIN = 110.0, 45.0
EQUAL = np.array(
    [1, 1, COLOUR_GAIN / BRIGHTNESS_GAIN], np.float32
)  # brightness counts as colour does
DARK = 14.0  # tones: noise of darker pixels has no colour
SIDES = 0.25  # share of the width, on either side, that shows mostly background
STANDS_OUT = 30.0  # difference of colours that texture does not reach
SMOOTH = 0.5  # of the pile's roughness: a shadow is smoother
LEAST_LEVEL = 6.0  # of a difference from the background
ROUNDS = 4  # of GrabCut
FINE_PX = 1200  # longer side of a view in which colours are compared, at least
SHADOW_DARKEST = 1.6  # logarithm of the share of light that a shadow takes at most
ITS_OWN_COLOUR = 22.0  # a shadow's colour lies nearer to the background's colour

NEAR = 0.25  # of a grain's height: colours of a boundary are those within this distance
SURE = 0.75  # of a pixel's colour that is nearer to the other side
PENUMBRA = (
    0.6,
    0.2,
    0.8,
)  # least share of the background's ratios; height and width, of a grain's height
EDGE_PX = 2  # within which the boundary lies already when light is compared
TONE_CURVE = 2.2  # exponent from tones to light
NECK = 0.3  # of a grain's height: half the width of the neck between a loose grain and the pile
GAP = 0.4  # of a grain's height: a part with more background below it does not stand on the plate
ROUGH = 3.0  # difference of colours that counts as much as the scatter of the background's roughness
WINDOW_PX = 5  # in which gradients are compared
SMALL_PX = 4.0  # height of a grain in the coarse view, where roughness is needed
LEAST_SCATTER = 0.02  # of a background without noise
FAINT = 10.0  # difference of colours that texture and noise have too

NOTHING = "nothing that stands on the plate differs from its background, or the background is not plain"


class NotPlainError(NoFlankError):
    """The colours of pile and background do not differ enough."""


def find(view: SideView, by_roughness: bool = False) -> tuple[np.ndarray, bool]:
    """Find the pile's mask (H, W), 1 in the pile, in a coarse view, and whether another heap stands beside it."""
    above = math.ceil(view.base_row)
    colours, hidden = (
        _seen(view, above, SMALL_PX if by_roughness else None),
        view.hidden[:above],
    )
    not_behind, rough = hidden, _roughness(colours)
    for _ in range(2):  # the second background is fitted without the first guess
        behind = _background(colours, not_behind)
        first, others, beside = _first_guess(colours - behind, rough, hidden)
        not_behind = hidden | (
            cv2.dilate(first.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        )
    colours = np.where(others[..., None], behind, colours)
    start = np.where(first, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    strip = max(2, round(0.02 * first.shape[1]))
    edge = np.ones(first.shape, bool)
    edge[strip:, strip:-strip] = False
    start[edge & ~first] = cv2.GC_BGD
    start[hidden | others] = cv2.GC_BGD
    mask = _largest(_without_shadow(_grab(colours, start), colours - behind, rough))
    return np.vstack(
        [mask, np.zeros((len(view.image) - above, mask.shape[1]), np.uint8)]
    ), beside


def refine(
    view: SideView, coarse: np.ndarray, berry_px: float, by_roughness: bool
) -> tuple[Segmentation, float]:
    """Find the boundary of a pile in a finer view; `coarse` is its mask (H, W), accurate to half a grain.

    And the share, 0 to 1, of its upper boundary at which both sides hardly differ.
    """
    above = math.ceil(view.base_row)
    coarse, hidden = coarse[:above], view.hidden[:above]
    colours = _seen(view, above, berry_px if by_roughness else None, coarse)
    reach = max(4, round((1.0 if by_roughness else 0.4) * berry_px))
    disc = _disc(reach)
    below = cv2.copyMakeBorder(coarse, 0, reach, 0, 0, cv2.BORDER_REPLICATE)
    start = np.where(coarse > 0, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    start[cv2.erode(below, disc)[:above] > 0] = cv2.GC_FGD
    start[(cv2.dilate(below, disc)[:above] == 0) | hidden] = cv2.GC_BGD
    mask = _grab(colours, start)
    if not by_roughness:
        mask = _without_penumbra(mask, colours, berry_px)
    free = (start >= cv2.GC_PR_BGD) & (cv2.dilate(hidden.astype(np.uint8), disc) == 0)
    share, mask = _halfway(
        colours, _largest(mask), free, NEAR * berry_px, NEAR * berry_px, SURE
    )
    light = colours if by_roughness else _light(view, above)
    share, mask = _halfway(light, mask, free, NEAR * berry_px, EDGE_PX)
    mask = _without_floating(_largest(mask), GAP * berry_px)
    mask = _largest(_without_touching(mask, round(NECK * berry_px)))
    require_upright(mask)
    grey = cv2.cvtColor(view.image[:above], cv2.COLOR_BGR2GRAY)
    pile_is = (
        "darker"
        if grey[mask > 0].mean() < grey[(mask == 0) & ~hidden].mean()
        else "brighter"
    )
    pile, other = _means(colours, mask, NEAR * berry_px)
    way = pile - other
    columns = np.flatnonzero(mask.any(axis=0))
    difference = np.linalg.norm(
        way[mask.argmax(axis=0)[columns], columns] * (1 if by_roughness else EQUAL),
        axis=1,
    )
    return Segmentation(grey, share, 0.5, mask, view.base_row, pile_is), float(
        (difference < FAINT).mean()
    )


def _light(view: SideView, above: int) -> np.ndarray:
    """Light (H, W, 3) above the plate: a camera mixes light at a boundary, and then bends it to tones (sRGB, 2.2)."""
    light = cv2.GaussianBlur(
        (view.image.astype(np.float32) / 255) ** TONE_CURVE, (0, 0), 0.8
    )
    return _fill(light, view.hidden)[:above]


def _halfway(
    seen: np.ndarray,
    mask: np.ndarray,
    free: np.ndarray,
    about_px: float,
    reach_px: float,
    sure: float = 0.5,
) -> tuple[np.ndarray, np.ndarray]:
    """Move the boundary of a mask to where pile and background, each as it is about there, have equal shares.

    Only pixels that are `free` change, and only if the share of the other side is larger than `sure`: a grain in the
    shade is like neither side. Also return the share of the pile (H, W) in each pixel.
    """
    reach = max(EDGE_PX, round(reach_px))
    near = free & (cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, _disc(reach)) > 0)
    for _ in range(ROUNDS):
        pile, other = _means(seen, mask, about_px)
        way = pile - other
        share = np.clip(
            ((seen - other) * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-9), 0, 1
        )
        mask = np.where(
            near & (share >= sure), 1, np.where(near & (share < 1 - sure), 0, mask)
        )
        mask = _largest(mask.astype(np.uint8))
    return share, mask


def _without_penumbra(
    mask: np.ndarray, colours: np.ndarray, berry_px: float
) -> np.ndarray:
    """Remove the shadow at a boundary: as wide as a grain, with ratios of the channels as the background has.

    Nothing is removed where pile and background have much the same ratios.
    """
    disc = _disc(max(3, round(berry_px)))
    core, around = (
        cv2.erode(mask, disc, borderValue=1),
        1 - cv2.dilate(mask, disc[::2, ::2]),
    )
    pile, other = (_about(colours, part, 2 * berry_px) for part in (core, around))
    way, beyond = (pile - other)[..., :2], colours - other
    far = (way * way).sum(-1)
    share = (beyond[..., :2] * way).sum(-1) / np.maximum(far, 1e-6)
    shadow = (
        (mask > 0) & (core == 0) & (far > ITS_OWN_COLOUR**2) & (share < 1 - PENUMBRA[0])
    )
    shadow &= (
        -beyond[..., 2] < BRIGHTNESS_GAIN * SHADOW_DARKEST
    )  # black grains have no colour
    flat = np.ones(
        [max(3, round(share * berry_px)) for share in PENUMBRA[1:]], np.uint8
    )
    return np.where(
        cv2.morphologyEx(shadow.astype(np.uint8), cv2.MORPH_OPEN, flat) > 0, 0, mask
    ).astype(np.uint8)


def shadow_below(image: np.ndarray, mask: np.ndarray) -> int:
    """Count the lowest rows of a pile with mostly the background's colour, but darker.

    It is 0 for grains of the background's colour, as in a grey picture: shadow and grain look the same.
    """
    every, mask, difference = _against_sides(image, mask)
    shadow = _of_a_shadow(mask, difference)
    rows = np.flatnonzero(mask.any(axis=1))
    grains = np.flatnonzero(
        2 * shadow[rows].sum(axis=1) < mask[rows].sum(axis=1, dtype=int)
    )
    return every * int(rows.size - 1 - grains[-1]) if grains.size else 0


def shadow_share(image: np.ndarray, mask: np.ndarray) -> float:
    """Give the share of a pile of another colour that is one patch of the background's colour, but darker."""
    _, mask, difference = _against_sides(image, mask)
    patch = np.ones((max(5, len(mask) // 30),) * 2, np.uint8)
    shadow = cv2.morphologyEx(
        _as_a_shadow(mask, difference).astype(np.uint8), cv2.MORPH_OPEN, patch
    )
    coloured = (mask > 0) & (
        np.hypot(difference[..., 0], difference[..., 1]) >= ITS_OWN_COLOUR
    )
    return (
        float(shadow.sum(dtype=int) / mask.sum(dtype=int))
        if coloured.sum() > 0.3 * mask.sum(dtype=int)
        else 0.0
    )


def _against_sides(
    image: np.ndarray, mask: np.ndarray
) -> tuple[int, np.ndarray, np.ndarray]:
    """Compare each row with its two ends in colour: every how manieth pixel, the mask and the difference there."""
    every = max(1, max(mask.shape) // FINE_PX)
    colours = features(np.ascontiguousarray(image[::every, ::every]))
    edge = max(2, colours.shape[1] // 20)  # a shadow may be wider than the pile
    behind = np.median(
        np.hstack([colours[:, :edge], colours[:, -edge:]]), axis=1, keepdims=True
    )
    return every, mask[::every, ::every], colours - behind


def features(image: np.ndarray) -> np.ndarray:
    """Two ratios of the channels and the brightness, as logarithms scaled to lie around 128: float32 (H, W, 3)."""
    blue, green, red = cv2.split(
        cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32) + DARK
    )
    colours = (COLOUR_GAIN * np.log(channel / green) for channel in (red, blue))
    brightness = BRIGHTNESS_GAIN * (np.log(red + green + blue) - math.log(3 * 100.0))
    return 128 + np.stack([*colours, brightness], axis=-1)


def _seen(
    view: SideView, above: int, grain_px: float | None, pile: np.ndarray | None = None
) -> np.ndarray:
    """Compute the features above the plate; with the height of a grain, roughness in place of brightness.

    Roughness is the least gradient of any direction about a pixel (Shi and Tomasi 1994): a straight edge, as of a
    table, has none. It is counted from that of the row without the pile, in units of the background's scatter.
    """
    colours = _fill(features(view.image), view.hidden)[:above]
    if grain_px is None:
        return colours
    least = cv2.cornerMinEigenVal(np.ascontiguousarray(colours[..., 2]), WINDOW_PX)
    half = max(1, round(0.25 * grain_px))
    gaps, and_window = (_disc(reach) for reach in (half, half + WINDOW_PX // 2))
    # Close the gaps between grains, and take back what the window of the gradients adds outside of them.
    rough = cv2.erode(cv2.dilate(np.sqrt(np.maximum(least, 0)), gaps), and_window)
    left_out = view.hidden[:above] | (
        False if pile is None else cv2.dilate(pile, gaps) > 0
    )
    shown = np.where(left_out & ~left_out.all(axis=1, keepdims=True), np.nan, rough)
    rough = rough - np.nanquantile(
        shown, SIDES, axis=1, keepdims=True
    )  # a pile may fill half of a row
    scatter = 1.4826 * np.median(np.abs(rough[~left_out]))
    colours[..., 2] = 128 + np.clip(ROUGH * rough / max(scatter, LEAST_SCATTER), 0, 127)
    return colours


def _fill(colours: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Replace the colours of hidden pixels by the colours of the nearest visible pixel in the row."""
    columns = np.arange(hidden.shape[1])
    left = np.maximum.accumulate(np.where(hidden, -1, columns), axis=1)
    right = np.minimum.accumulate(np.where(hidden, 10**6, columns)[:, ::-1], axis=1)[
        :, ::-1
    ]
    nearest = np.where(
        np.where(left >= 0, columns - left, 10**6) <= right - columns, left, right
    )
    nearest = np.where((nearest >= 0) & (nearest < 10**6), nearest, columns)
    return np.take_along_axis(colours, nearest[..., None], axis=1)


def _background(colours: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Estimate the background: a line through each row, fitted without outliers, at first to the outer parts."""
    width = hidden.shape[1]
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :, None]
    outer = (np.abs(x) > 1 - 2 * SIDES) & ~hidden[..., None]
    centre = np.nanmedian(
        np.where(outer | ~outer.any(axis=1, keepdims=True), colours, np.nan),
        axis=1,
        keepdims=True,
    )
    centre = np.repeat(centre, width, axis=1)
    for _ in range(3):
        miss = np.linalg.norm(colours - centre, axis=-1, keepdims=True)
        kept = ((miss < STANDS_OUT) & ~hidden[..., None]).astype(np.float32)
        n = kept.sum(1, keepdims=True) + 1e-3
        mean_x, mean = (
            (kept * x).sum(1, keepdims=True) / n,
            (kept * colours).sum(1, keepdims=True) / n,
        )
        spread = (kept * (x - mean_x) ** 2).sum(1, keepdims=True) + 0.02 * width
        slope = (kept * (x - mean_x) * (colours - mean)).sum(1, keepdims=True) / spread
        few = n < 0.1 * width
        centre = np.where(few, centre, mean + slope * (x - mean_x)).astype(np.float32)
    return centre


def _roughness(colours: np.ndarray) -> np.ndarray:
    """Compute the scatter (H, W) of the brightness about each pixel: grains with gaps are rough, a shadow is not."""
    tone, size = colours[..., 2], (5, 5)
    return np.sqrt(
        np.maximum(cv2.blur(tone * tone, size) - cv2.blur(tone, size) ** 2, 0)
    )


def _first_guess(
    difference: np.ndarray, rough: np.ndarray, hidden: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Mark the largest part that stands on the plate, wider than high, and other objects, such as a ruler.

    Also tell whether another heap stands beside it.
    """
    shown = np.where(hidden & ~hidden.all(axis=1, keepdims=True), np.nan, rough)
    usual = np.nanmedian(
        shown, axis=1, keepdims=True
    )  # of the row: an edge of the table is rough, too
    square = (
        (difference[..., :2] ** 2).sum(-1)
        + (0.5 * difference[..., 2]) ** 2
        + np.maximum(rough - usual, 0) ** 2
    )
    size = np.where(hidden, 0, cv2.GaussianBlur(np.sqrt(square), (0, 0), 1.5))
    level, _ = cv2.threshold(
        np.clip(size, 0, 255).astype(np.uint8),
        0,
        1,
        cv2.THRESH_BINARY | cv2.THRESH_OTSU,
    )
    # The plate may have more of the grains' colour than the wall has: then the foot needs a lower level.
    for lower in (level, level / 2, level / 4):
        if lower < LEAST_LEVEL:
            break
        guess = (size > lower).astype(np.uint8)
        best, others = _standing(guess)
        if best is not None:
            return (
                best,
                cv2.dilate(others.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0,
                another_heap(guess),
            )
    raise NotPlainError(NOTHING)


def _standing(mask: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """Mark the largest part that stands on the plate, wider than high (None without one), and high objects."""
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask)
    _, top, wide, high, area = boxes.T
    stands = (top + high >= 0.97 * len(mask)) & (wide > 1.2 * high)
    others = (high > 2.5 * wide) & (high > 0.15 * len(mask))
    stands[0] = others[0] = False  # the background
    best = int(np.argmax(stands * area))
    return labels == best if best else None, others[labels]


def _grab(colours: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Find the pile's mask by GrabCut, from its start marks."""
    picture = np.clip(colours, 0, 255).astype(np.uint8)
    marks = start.copy()
    cv2.setRNGSeed(1)
    cv2.grabCut(
        picture,
        marks,
        (0, 0, 0, 0),
        np.zeros((1, 65)),
        np.zeros((1, 65)),
        ROUNDS,
        cv2.GC_INIT_WITH_MASK,
    )
    mask = ((marks == cv2.GC_FGD) | (marks == cv2.GC_PR_FGD)).astype(np.uint8)
    return cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))


def _without_shadow(
    mask: np.ndarray, difference: np.ndarray, rough: np.ndarray
) -> np.ndarray:
    """Remove parts that have the background's colour and are darker, unless the whole pile is like that."""
    shadow = _of_a_shadow(mask, difference) & (
        rough < SMOOTH * np.median(rough[mask > 0])
    )
    shadow = cv2.morphologyEx(
        shadow.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
    )
    return np.where(shadow > 0, 0, mask).astype(np.uint8)


def _of_a_shadow(mask: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Mark pixels with the background's colour, but darker; none if the upper part of the pile is the same."""
    shadow = _as_a_shadow(mask, difference)
    rows = np.flatnonzero(mask.any(axis=1))
    upper = slice(rows[0], rows[0] + (2 * rows.size) // 3) if rows.size else slice(0)
    return (
        np.zeros(mask.shape, bool)
        if shadow[upper].sum() > 0.12 * mask[upper].sum()
        else shadow
    )


def _as_a_shadow(mask: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Mark pixels with the background's colour, but darker."""
    distance = np.sqrt((difference[..., :2] ** 2).sum(-1))
    darker = -difference[..., 2] / BRIGHTNESS_GAIN
    return (
        (mask > 0)
        & (distance < ITS_OWN_COLOUR)
        & (darker > 0.08)
        & (darker < SHADOW_DARKEST)
    )


def _without_floating(mask: np.ndarray, gap_px: float) -> np.ndarray:
    """Remove parts above background: a loose grain on the plate behind the pile.

    Background is counted from the pile's foot, the lowest row that is half as wide as the widest: seen from the side,
    round grains end a little above the plate's row.
    """
    width = mask.sum(axis=1, dtype=int)
    foot = len(mask) - int((2 * width[::-1] >= max(width.max(), 1)).argmax())
    upwards = mask[:foot][::-1] > 0
    stands = upwards & (np.cumsum(~upwards, axis=0) <= gap_px)
    return np.concatenate([stands[::-1].astype(np.uint8), mask[foot:]])


def _without_touching(mask: np.ndarray, radius: int) -> np.ndarray:
    """Remove loose grains at the foot: low parts joined only by a neck narrower than two radii."""
    if radius < 1:
        return mask
    core = cv2.erode(
        cv2.copyMakeBorder(mask, 0, 2 * radius, 0, 0, cv2.BORDER_REPLICATE),
        _disc(radius),
    )[: len(mask)]
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(core)
    rows = np.flatnonzero(mask.any(axis=1))
    if count < 3:
        return mask
    _, nearest = cv2.distanceTransformWithLabels(
        1 - core, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner = np.zeros(nearest.max() + 1, int)
    owner[nearest[core > 0]] = labels[core > 0]
    loose = boxes[:, cv2.CC_STAT_TOP] > rows.mean()
    loose[[0, 1 + int(boxes[1:, cv2.CC_STAT_AREA].argmax())]] = False
    return np.where(loose[owner[nearest]], 0, mask).astype(np.uint8)


def _disc(radius: int) -> np.ndarray:
    """Make a disc of a radius in pixels, for the operations of morphology."""
    return cv2.getStructuringElement(
        cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1)
    )


def _means(colours: np.ndarray, mask: np.ndarray, reach_px: float) -> list[np.ndarray]:
    """Average the colours (H, W, 3) of the pile and of the rest about each pixel."""
    return [_about(colours, part, reach_px) for part in (mask, 1 - mask)]


def _about(colours: np.ndarray, part: np.ndarray, reach_px: float) -> np.ndarray:
    """Average the colours (H, W, N) of a part (H, W) about each pixel."""
    box = (2 * max(3, round(reach_px)) + 1,) * 2
    seen = part.astype(np.float32), colours * part[..., None].astype(np.float32)
    how: Any = {"normalize": False, "borderType": cv2.BORDER_REPLICATE}
    weight, total = (cv2.boxFilter(values, -1, box, **how) for values in seen)
    return total / np.maximum(weight, 1)[..., None]


def _largest(mask: np.ndarray) -> np.ndarray:
    """Keep the largest part alone and fill its holes."""
    if not mask.any():
        raise NotPlainError(NOTHING)
    return pile_component(mask, largest_only=True)
