"""Photographs of many repetitions: each is measured or refused; their mean becomes a target.

The sheet (`repose.measure.photographs.sheet`) gives scale, tilt, lens and the plate. With a scale alone the photograph must be
level, without distortion, before a plain background.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from repose.common.errors import InputError, NoFlankError, require, require_flank
from repose.measure.photographs import camera, finding, sheet
from repose.measure.photographs.segmentation import (
    Segmentation,
    require_upright,
    segment,
)
from repose.measure.pile import measure_segmented, profile_of, read_image, with_response
from repose.measure.results import Measurement
from repose.measure.settings import MeasureSettings

LEAST_LENGTH_PX, MOST_LEVEL_DEG = 10, 25.0  # of a length that is the scale
LARGEST_PX = 4000  # a photograph's longer side; a larger one is reduced
COARSE_PX, FINE_PX = (
    700,
    1200,
)  # longer sides of the views in which a pile is found, and its boundary
ROUGH_PX = 8  # height of a grain at most, where roughness is seen: a larger one is smooth within
FAINT_SHARE = 0.2
LARGEST_DIFFERENCE_DEG = 10.0  # of the two sides
USUAL_GRAINS = 8  # in the height of a pile, if the height of a grain is not known
DOUBT = "doubtful"  # begins a doubt
NO_SHEET = "the printed sheet is not seen; without one the scale is given by --mm-per-pixel or --length"
FAINT = "the pile hardly differs from its background along its boundary: the background is not plain"
LEAST_PX = 80  # pixels in the height of a pile: with fewer its angle changes by up to 1.5 degrees
LOWEST_PILE = 1.5  # of a grain's height: below it is a layer
LARGEST_RISE = (
    1.5,
    0.12,
)  # of a grain's and of the pile's height: of the outline, away from the crest
LARGEST_DROP = 2.0, 0.2  # likewise: of the outline within half a grain
MEETING = 0.7, 1.3  # of the pile's height: where the lines of a cone's two flanks meet
LOWEST_FOOT = 0.6  # of a grain's height: of the widest row over the lowest
UPRIGHT_PX = 12  # rows of an upright end of the foot: round grains have less than 0.75 of their height
GOES_ON = 30  # tones between what lies below the pile's middle and beside it: no plate
SHADOW_SHARE = 0.03  # of a pile of another colour than the background's
BASE_ROW = "give --base-row, the row of the plate, or show the printed sheet"
LARGEST_SHADOW = (
    0.3  # of a grain's height: rows below the grains with the background's colour
)

Paths = Sequence[Path]
Size = tuple[int, int]  # width and height of a photograph in pixels


@dataclass(frozen=True)
class Scale:
    """Scale of photographs: with the printed sheet only `square_mm` counts, without it the others."""

    square_mm: float = sheet.SQUARE_MM  # side of a square of the printed sheet
    mm_per_pixel: float | None = None  # None means: the printed sheet gives the scale
    base_row: float | None = None  # row of the plate; None means the pile's lowest row
    level_deg: float = 0.0  # rise of a level line to the right in the photograph


@dataclass
class Photograph:
    """Result of one photograph."""

    path: Path
    view: np.ndarray  # the measured picture, (H, W) or (H, W, 3), BGR
    pile: Segmentation | None = (
        None  # the part taken for the pile; None if nothing was found
    )
    measurement: Measurement | None = None  # None if refused
    refused: str = ""  # the reason
    # mm_per_pixel; with a sheet also tilt_deg and look_down_deg
    facts: dict[str, float] = field(default_factory=dict)
    note: str = ""  # warning for the reader of the numbers
    doubts: Sequence[str] = ()  # evidence against a single heap

    @property
    def remarks(self) -> str:
        """Note and doubts in one line."""
        return "; ".join(filter(None, (self.note, *self.doubts)))


def level_length(
    length_mm: float, x1: float, y1: float, x2: float, y2: float
) -> tuple[float, float] | None:
    """Scale [mm per pixel] and rise to the right [deg] of a level length; None where its ends do not determine it."""
    pixels = math.hypot(x2 - x1, y2 - y1)
    level = math.degrees(math.atan2(y1 - y2, x2 - x1))
    return (
        (length_mm / pixels, level)
        if pixels >= LEAST_LENGTH_PX and abs(level) <= MOST_LEVEL_DEG
        else None
    )


def load(path: Path) -> tuple[np.ndarray, float]:
    """Read a photograph (H, W, 3), BGR, reduced if it is larger than 4000 pixels, and the factor of the reduction."""
    image = read_image(path)
    times = max(1.0, max(image.shape[:2]) / LARGEST_PX)
    if times > 1:
        size = round(image.shape[1] / times), round(image.shape[0] / times)
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return image, times


def readable(paths: Paths) -> tuple[list[Path], list[InputError]]:
    """Split photographs into those that can be read, and the faults of the others."""
    good, faults = [], []
    for path in paths:
        try:
            read_image(path)
            good.append(path)
        except InputError as fault:
            faults.append(fault)
    return good, faults


def cameras(
    paths: Paths, square_mm: float
) -> tuple[dict[Path, sheet.Seen | None], dict[Size, camera.Camera]]:
    """Find the sheet in each photograph, None if not seen, and the camera of each size."""
    seen: dict[Path, sheet.Seen | None] = {}
    of_size: dict[Size, list[sheet.Seen]] = {}
    focal: dict[Size, float | None] = {}
    for path in paths:
        image, _ = load(path)
        size = image.shape[1], image.shape[0]
        seen[path] = where = sheet.find(image, square_mm)
        if where is not None:
            of_size.setdefault(size, []).append(where)
            focal.setdefault(size, _stated_focal(path, max(size)))
    return seen, {
        size: camera.calibrate(views, size, focal[size])
        for size, views in of_size.items()
    }


def measure_all(
    paths: Paths, how: MeasureSettings, scale: Scale, lens: Paths = ()
) -> list[Photograph]:
    """Measure photographs; `lens` are photographs of the sheet alone, by the same camera."""
    if scale.mm_per_pixel is not None:
        return [measure_plain(path, how, scale) for path in paths]
    seen, by_size = cameras([*paths, *lens], scale.square_mm)
    for path in lens:
        require(
            seen[path] is not None,
            path,
            "sheet",
            "not seen",
            "a photograph that shows the printed sheet",
        )
    results = []
    for path in paths:
        image, _ = load(path)
        photograph, where = Photograph(path, image), seen[path]
        results.append(photograph)
        if where is None:
            photograph.refused = NO_SHEET
            continue
        try:
            _measure_with_sheet(
                photograph, where, by_size[image.shape[1], image.shape[0]], how
            )
        except NoFlankError as error:
            photograph.refused = error.reason
    return results


def _measure_with_sheet(
    photograph: Photograph, where: sheet.Seen, lens: camera.Camera, how: MeasureSettings
) -> None:
    """Measure a photograph that shows the sheet, by colour, or else by roughness, without a doubt.

    NoFlankError has the reason for a refusal.
    """
    pose = camera.Pose(lens, where, photograph.view.shape[1::-1])
    image, photograph.note = photograph.view, lens.note
    try:
        _measure_seen(photograph, image, pose, how)
    except finding.NotPlainError as by_colour:
        kept = replace(photograph)
        try:
            _measure_seen(photograph, image, pose, how, by_roughness=True)
            require_flank(not photograph.doubts, "; ".join(photograph.doubts))
        except NoFlankError:
            vars(photograph).update(vars(kept))
            raise by_colour from None


def _measure_seen(
    photograph: Photograph,
    image: np.ndarray,
    pose: camera.Pose,
    how: MeasureSettings,
    by_roughness: bool = False,
) -> None:
    """Find the pile as it is seen from a pose, and measure it."""
    coarse = camera.side_view(image, pose, None, COARSE_PX)
    photograph.view = coarse.image
    photograph.facts = {"mm_per_pixel": coarse.mm_per_pixel, "tilt_deg": pose.tilt_deg}
    mask, beside = finding.find(coarse, by_roughness)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top = float(np.median(np.flatnonzero(mask[rows[0]])))
    crest = coarse.left_mm + coarse.mm_per_pixel * top
    high = (coarse.base_row - rows[0]) * coarse.mm_per_pixel
    photograph.facts["look_down_deg"] = look_down = pose.look_down_deg(crest, high)
    reach = 1.3 * coarse.mm_per_pixel * max(top - columns[0], columns[-1] - top)
    grain = how.berry_height_mm or high / USUAL_GRAINS
    longest = (
        min(FINE_PX, round(ROUGH_PX * max(2 * reach, 1.6 * high) / grain))
        if by_roughness
        else FINE_PX
    )
    fine = camera.side_view(image, pose, crest, longest, (-reach, reach, 1.6 * high))
    photograph.view, photograph.facts["mm_per_pixel"] = fine.image, fine.mm_per_pixel
    guess, grain_px = _onto(mask, coarse, fine, crest), grain / fine.mm_per_pixel
    photograph.pile, faint = finding.refine(fine, guess, grain_px, by_roughness)
    if abs(look_down) > camera.LARGEST_LOOK_DOWN_DEG:
        above = f"the camera looks at the crest from {look_down:.0f} degrees above: the flanks look flatter"
        remedy = f"hold the lens as high as the crest, {camera.LARGEST_LOOK_DOWN_DEG:g} degrees are allowed"
        raise NoFlankError(f"{above}; {remedy}")
    _require_whole(photograph.pile.mask, fine.hidden)
    flat = _measured(photograph, how).angle
    away, eye = math.hypot(pose.eye[0] - crest, pose.eye[1]), pose.eye[2]
    axis_px, away_px, eye_px = (
        length / fine.mm_per_pixel for length in (-fine.left_mm, away, eye)
    )
    seen_level(
        photograph,
        axis_px,
        away_px,
        eye_px,
        (flat.left_deg, flat.right_deg),
        high / fine.mm_per_pixel,
    )
    measurement = _measured(photograph, how)
    photograph.pile = replace(photograph.pile, beside=beside)
    doubts = _doubts(photograph.pile, measurement, grain, fine.mm_per_pixel)
    if faint > FAINT_SHARE:
        raise finding.NotPlainError(FAINT)
    if faint > FAINT_SHARE / 2:
        share = f"{100 * faint:.0f} % of its boundary"
        doubts.append(
            f"{DOUBT}: the pile hardly differs from its background along {share}"
        )
    photograph.measurement, photograph.doubts = measurement, doubts


def measure_plain(path: Path, how: MeasureSettings, scale: Scale) -> Photograph:
    """Measure a photograph without a sheet, or a silhouette; `scale` has `mm_per_pixel`."""
    image, times = load(path)
    image, base = _levelled(
        image, scale.level_deg, scale.base_row and scale.base_row / times
    )
    assert scale.mm_per_pixel is not None
    how = replace(how, mm_per_pixel=scale.mm_per_pixel * times)
    photograph = Photograph(path, image, facts={"mm_per_pixel": how.mm_per_pixel})
    try:
        photograph.pile = segment(image, how.largest_pile_only, base)
        require_upright(photograph.pile.mask)
        if base is None:
            _require_foot(image, photograph.pile, how)
        photograph.measurement = _measured(photograph, how)
        grain = how.berry_height_mm or photograph.measurement.height_mm / USUAL_GRAINS
        photograph.doubts = _doubts(
            photograph.pile, photograph.measurement, grain, how.mm_per_pixel
        )
        if base is None:
            photograph.doubts += _doubts_of_the_base(
                image, photograph.pile, grain / how.mm_per_pixel
            )
    except (NoFlankError, InputError) as error:  # such as a base below the picture
        photograph.measurement, photograph.refused = None, str(error)
    return photograph


def _measured(photograph: Photograph, how: MeasureSettings) -> Measurement:
    """Measure the part taken for the pile; NoFlankError if its sides differ too much."""
    assert photograph.pile is not None
    how = replace(how, mm_per_pixel=photograph.facts["mm_per_pixel"])
    measurement = with_response(measure_segmented(photograph.pile, how))
    difference = abs(measurement.angle.left_deg - measurement.angle.right_deg)
    if difference > LARGEST_DIFFERENCE_DEG:
        unlike = f"its two sides differ by {difference:.1f} degrees: no such pile, or the background is not plain"
        raise NoFlankError(f"{unlike}; {LARGEST_DIFFERENCE_DEG:g} are allowed")
    return measurement


def _doubts(
    pile: Segmentation, measurement: Measurement, grain_mm: float, mm_per_pixel: float
) -> list[str]:
    """Write a sentence for each sign that this is no single heap, or too few pixels of it; NoFlankError for a layer."""
    high = measurement.height_mm
    if high < LOWEST_PILE * grain_mm:
        raise NoFlankError(
            f"it is {high:.1f} mm high, less than {LOWEST_PILE:g} grains: a layer, no pile"
        )
    profile, crest = profile_of(pile)
    sides = profile[: crest + 1][::-1], profile[crest:]
    rise = mm_per_pixel * max(
        float((side - np.minimum.accumulate(side)).max()) for side in sides
    )
    doubts = []
    if rise > max(LARGEST_RISE[0] * grain_mm, LARGEST_RISE[1] * high):
        doubts.append(
            f"{DOUBT}: away from its crest the outline rises by {rise:.0f} mm, as of two heaps"
        )
    width = max(1, round(0.5 * grain_mm / mm_per_pixel))
    drop = mm_per_pixel * max(
        float((side[:-width] - side[width:]).max(initial=0.0)) for side in sides
    )
    if drop > max(LARGEST_DROP[0] * grain_mm, LARGEST_DROP[1] * high):
        doubts.append(
            f"{DOUBT}: the outline falls by {drop:.0f} mm at once, as of a box behind the heap"
        )
    flank = measurement.angles.get("flank")
    meeting = _meeting(flank.lines, pile.base_row) * mm_per_pixel if flank else high
    if not MEETING[0] * high < meeting < MEETING[1] * high:
        why = (
            "its top is level" if meeting > high else "something else stands behind it"
        )
        where = f"{meeting:.0f} mm over the plate, its top lies at {high:.0f} mm"
        doubts.append(f"{DOUBT}: the lines of its flanks meet {where}: {why}")
    if pile.beside:
        doubts.append(f"{DOUBT}: another heap stands beside it")
    if (pixels := math.floor(high / mm_per_pixel)) < LEAST_PX:
        # an error of a pixel at either end of the flank
        (_, low), (_, top) = measurement.angle.lines[0]
        angle = math.degrees(
            math.sin(2 * math.radians(measurement.aor_deg)) / abs(low - top)
        )
        coarse = f"the photograph is too coarse: the pile is {pixels} pixels high, {LEAST_PX} are needed"
        off = f"the angle may be off by {angle:.1f} degrees, the Height by {2 * mm_per_pixel:.1f} mm"
        doubts.append(f"{DOUBT}: {coarse}; {off}")
    return doubts


def _meeting(lines: tuple, base_row: float) -> float:
    """Return the height over the plate in pixels at which two lines meet; each has two ends (column, row)."""
    ((u, v), (a, b)), ((x, y), (c, d)) = lines
    first, second = (b - v) / (a - u), (d - y) / (c - x)
    return base_row - (v + first * (y - v + second * (u - x)) / (first - second))


def seen_level(
    photograph: Photograph,
    axis_px: float,
    away_px: float,
    eye_px: float,
    seen_deg: Sequence[float],
    high_px: float,
) -> None:
    """Redraw view and pile as a camera without perspective, as high as the plate, sees them.

    The outline of a cone that is seen from above, or below, is a line from its apex to its foot, but not in the plane
    through the axis that faces the camera: it lies in a half-plane that is turned about the axis by t, with sin(t) =
    tan(look down) / tan(angle), away from the camera for one that is above. This is exact at any distance. Below the
    widest place of the foot the outline is the underside of its grains, which that camera does not see.

    `seen_deg` are the angles of the two sides in the plane, `away_px` and `eye_px` the camera's distance from the axis
    and its height over the plate.
    """
    pile = photograph.pile
    assert pile is not None
    rows, columns = photograph.view.shape[:2]
    out = np.arange(columns) - axis_px
    at = np.flatnonzero(pile.mask.any(axis=0)) - axis_px
    down = (eye_px - high_px) / away_px
    widest = np.array([-at.min(), at.max()]) if down > 0 else np.full(2, math.inf)
    sines = down / np.hypot(np.tan(np.radians(seen_deg)), down)
    right = (out > 0).astype(int)
    sine, reach = sines[right], np.abs(out)
    nearer = away_px / (away_px + reach * sine)
    x = np.tile(axis_px + out * np.sqrt(1 - sine**2) * nearer, (rows, 1)).astype(
        np.float32
    )
    z = eye_px + (pile.base_row - np.arange(rows)[:, None] - eye_px) * nearer
    y = (pile.base_row - z).astype(np.float32)

    def redrawn(picture: np.ndarray) -> np.ndarray:
        shown = slice(len(picture))
        return cv2.remap(
            picture,
            x[shown],
            y[shown],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )

    contrast = redrawn(pile.contrast)
    mask = (redrawn(pile.mask.astype(np.float32)) >= 0.5) & (reach <= widest[right])
    photograph.view = redrawn(photograph.view)
    photograph.pile = replace(
        pile, grey=redrawn(pile.grey), contrast=contrast, mask=mask.astype(np.uint8)
    )


def _onto(
    mask: np.ndarray, coarse: camera.SideView, fine: camera.SideView, axis_mm: float
) -> np.ndarray:
    """Draw a mask of a view of the sheet's plane in the pixels of a view about an axis."""
    rows, columns = fine.image.shape[:2]
    x = (
        axis_mm + fine.left_mm + fine.mm_per_pixel * np.arange(columns) - coarse.left_mm
    ) / coarse.mm_per_pixel
    y = (
        coarse.base_row
        - (fine.base_row - np.arange(rows)) * fine.mm_per_pixel / coarse.mm_per_pixel
    )
    return cv2.remap(
        mask,
        *np.meshgrid(x.astype(np.float32), y.astype(np.float32)),
        cv2.INTER_NEAREST,
    )


def _require_whole(mask: np.ndarray, hidden: np.ndarray) -> None:
    """Raise NoFlankError if the pile touches a border of the picture or hidden pixels."""
    grown = cv2.dilate(mask, np.ones((5, 5), np.uint8)) > 0
    touching = (grown & hidden[: len(mask)]).sum()
    if touching > 0.03 * mask.shape[0] or mask[:, :2].any() or mask[:, -2:].any():
        raise NoFlankError(
            "the pile runs out of the picture, or the sheet hides a part of it"
        )


def _require_foot(image: np.ndarray, pile: Segmentation, how: MeasureSettings) -> None:
    """Raise NoFlankError if the base is not seen, or is a shadow or the near rim of a pile seen from above."""
    cut = "the pile runs out of the picture at the bottom: its foot is not seen"
    require_flank(
        not pile.mask[-1].any(), f"{cut}; give --base-row, the row of the plate"
    )
    widths = pile.mask.sum(axis=1, dtype=int)
    rows = np.flatnonzero(widths)
    widest = rows[np.flatnonzero(widths[rows] >= 0.99 * widths.max())[-1]]
    grain = (
        how.berry_height_mm or rows.size * how.mm_per_pixel / USUAL_GRAINS
    ) / how.mm_per_pixel
    for below, most, place in (
        (
            finding.shadow_below(image, pile.mask),
            LARGEST_SHADOW,
            "grains, with the colour of the background",
        ),
        (rows[-1] - widest, LOWEST_FOOT, "widest row"),
    ):
        if below > most * grain:
            raise NoFlankError(
                f"its lowest row lies {below * how.mm_per_pixel:.1f} mm below its {place}: a shadow at the foot, or "
                f"the camera looks down on it or is rolled (--length makes a line level); {BASE_ROW}"
            )


def _doubts_of_the_base(
    image: np.ndarray, pile: Segmentation, grain_px: float
) -> list[str]:
    """Write a sentence for each sign that the base or a flank, found without a sheet, is none of the pile's."""
    rows = np.flatnonzero(pile.mask.any(axis=1))
    left, right = pile.mask[rows].argmax(axis=1), pile.mask[rows, ::-1].argmax(axis=1)
    doubts = []
    if (
        tall := max(int((side <= side.min() + 2).sum()) for side in (left, right))
    ) > max(0.75 * grain_px, UPRIGHT_PX):
        doubts.append(
            f"{DOUBT}: an end of its foot is upright over {tall} pixels, as of a plate or a ruler: {BASE_ROW}"
        )
    first, seen = math.ceil(pile.base_row) + 2, image.reshape(*image.shape[:2], -1)
    below = seen[first : first + max(4, round(grain_px))]
    ends = np.concatenate(
        [below[:, : left.min()], below[:, below.shape[1] - right.min() :]], axis=1
    )
    if ends.size:
        foot = np.flatnonzero(pile.mask[rows[0] + 2 * len(rows) // 3])
        middle = slice(foot[len(foot) // 3], foot[2 * len(foot) // 3] + 1)
        grains = seen[rows[len(rows) // 2] : rows[-1], middle]
        grain, under, beside = (
            np.median(part, axis=(0, 1)) for part in (grains, below[:, middle], ends)
        )
        if (
            np.abs(under - grain).max() < (off := np.abs(under - beside).max())
            and off > GOES_ON
        ):
            doubts.append(
                f"{DOUBT}: below its base the picture has the pile's colour and no plate's: {BASE_ROW}"
            )
    if (share := finding.shadow_share(image, pile.mask)) > SHADOW_SHARE:
        doubts.append(
            f"{DOUBT}: {100 * share:.0f} % of it is darker background, as of a shadow on what stands behind"
        )
    return doubts


def _levelled(
    image: np.ndarray, level_deg: float, base_row: float | None
) -> tuple[np.ndarray, float | None]:
    """Turn a photograph by `level_deg`; also return the plate's row in its middle column."""
    if level_deg == 0:
        return image, base_row
    rows, columns = image.shape[:2]
    middle = (rows - 1) / 2
    turn = cv2.getRotationMatrix2D(((columns - 1) / 2, middle), -level_deg, 1.0)
    image = cv2.warpAffine(
        image,
        turn,
        (columns, rows),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if base_row is not None:
        base_row = middle + (base_row - middle) * math.cos(math.radians(level_deg))
    return image, base_row


def _stated_focal(path: Path, long_side: float) -> float | None:
    """Read the focal length in pixels from the EXIF entry of the equivalent on 36 mm film; None without an entry."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            equivalent = float(picture.getexif().get_ifd(0x8769).get(0xA405, 0))
    except (OSError, ValueError, TypeError, SyntaxError):
        return None
    return equivalent / 36 * long_side if 5 < equivalent < 1000 else None
