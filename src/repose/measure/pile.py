"""Angle of repose and Height of a pile, from a photograph or from a simulation seen from the side.

The steps are the paper's (section 2.3, Figure 6): grey, threshold, edge, boundary, a straight line through each flank.
The angle of repose is the mean of the two arctangents, the Height is the height of the highest point over the base. A
simulation is first projected to a silhouette.

The paper does not define the part of a lumpy boundary through which the line goes. Five definitions are measured on
every pile (`repose.measure.angles`), and the configuration names the response. Their biases and noise are in
docs/measurement.md.
"""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from repose.common.errors import InputError, NoFlankError, require, require_flank
from repose.measure.angles import DEFINITIONS, measure_sides
from repose.measure.photographs.segmentation import (
    SMALLEST,
    Segmentation,
    of_silhouette,
    require_upright,
    segment,
    upper_edge,
)
from repose.measure.results import Angle, Measurement, PileResult
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import (
    BACKGROUND_TONE,
    PILE_TONE,
    ConvexBody,
    Grains,
    frame,
    outlines,
    paint,
    top_of,
)

HEIC = tuple(
    b"ftyp" + brand
    for brand in (
        b"heic",
        b"heix",
        b"hevc",
        b"hevx",
        b"heim",
        b"heis",
        b"mif1",
        b"msf1",
    )
)
FEWEST_PIXELS, MOST_PIXELS = 20, 200_000_000  # on a side; in all

LOWEST_PILE_GRAINS = 1.5  # in equivalent diameters: 20 mm for the mean grain; below, a layer and not a pile


# --- one picture ----------------------------------------------------------------------------------


def measure_image(
    image: np.ndarray,
    mm_per_pixel: float,
    settings: MeasureSettings | None = None,
    *,
    base_row: float | None = None,
) -> Measurement:
    """Measure the pile in a side view (section 2.3): a photograph, BGR, or a silhouette."""
    settings = replace(settings or MeasureSettings(), mm_per_pixel=mm_per_pixel)
    pile = segment(image, settings.largest_pile_only, base_row)
    require_upright(pile.mask)
    return with_response(measure_segmented(pile, settings))


def with_response(measurement: Measurement) -> Measurement:
    """Give the measurement itself; NoFlankError if its response could not be measured."""
    if measurement.response not in measurement.angles:
        raise NoFlankError(measurement.reasons[measurement.response])
    return measurement


def profile_of(pile: Segmentation) -> tuple[np.ndarray, int]:
    """Heights of a pile's upper edge over its base (W,) in pixels, and the highest column, the middle of several."""
    edge = upper_edge(pile.mask, pile.contrast, pile.level)
    profile = np.where(np.isnan(edge), 0.0, np.maximum(pile.base_row - edge, 0.0))
    highest = np.flatnonzero(profile >= profile.max() - 1e-6)
    return profile, int(highest[highest.size // 2])


def measure_segmented(pile: Segmentation, settings: MeasureSettings) -> Measurement:
    """Measurement of a picture that is split into pile and background; its response may be missing."""
    profile, crest = profile_of(pile)
    measured, reasons = measure_sides(profile, crest, settings)
    angles = {}
    for name, (aor_deg, left, right) in measured.items():
        on_left = tuple((u, pile.base_row - z) for u, z in left.ends)
        on_right = tuple(
            (profile.size - 1 - u, pile.base_row - z) for u, z in right.ends
        )
        angles[name] = Angle(
            left.angle_deg, right.angle_deg, aor_deg, (on_left, on_right)
        )
    return Measurement(
        response=settings.response,
        angles=angles,
        reasons=reasons,
        height_mm=float(profile[crest]) * settings.mm_per_pixel,
        base_row=pile.base_row,
        top=(float(crest), pile.base_row - float(profile[crest])),
        contour=pile.contour,
        pile_is=pile.pile_is,
    )


def read_image(path: str | PathLike) -> np.ndarray:
    """Read a picture file as (H, W, 3), BGR, turned upright by its EXIF entry.

    Of deeper pictures the upper eight of the bits that they use are read: a camera's 10 or 12 bits lie in 16.
    """
    path = Path(path)
    found = "a folder" if path.is_dir() else "no such file"
    require(
        path.is_file(),
        path,
        "picture",
        found,
        "an existing picture file (PNG, JPEG, TIFF, BMP)",
    )
    _check_header(path)
    content, image = np.frombuffer(path.read_bytes(), dtype=np.uint8), None
    with contextlib.suppress(
        cv2.error
    ):  # an empty file, or a header with more pixels than OpenCV accepts
        image = cv2.imdecode(content, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if image is not None and image.dtype == np.uint16:
        most = int(np.quantile(image[::8, ::8], 0.999))  # not a single hot pixel
        image = np.minimum(
            np.right_shift(image, max(most.bit_length() - 8, 0)), 255
        ).astype(np.uint8)
    if image is not None and image.dtype != np.uint8:
        raise InputError(
            path,
            "picture",
            f"of {image.dtype} numbers",
            "a picture of 8 to 16 bits a colour: save it so",
        )
    if image is None:
        found = "not a picture" if content.size else "an empty file"
        raise InputError(
            path, "picture", found, "a picture file (PNG, JPEG, TIFF, BMP), whole"
        )
    return image


def _check_header(path: Path) -> None:
    """Refuse a picture by what its first bytes say, before it is decoded: a phone's HEIC, too few pixels, too many."""
    from PIL import Image, UnidentifiedImageError  # not by the processes that pour

    with path.open("rb") as file:
        if file.read(12)[4:] in HEIC:
            raise InputError(
                path,
                "picture",
                "HEIC",
                "PNG or JPEG; a phone exports it (`heif-convert a.heic a.jpg`)",
            )
    allowed = f"at least {FEWEST_PIXELS} pixels each way, at most {MOST_PIXELS / 1e6:g} million in all"
    before, Image.MAX_IMAGE_PIXELS = (
        Image.MAX_IMAGE_PIXELS,
        None,
    )  # Pillow's own limit is below a phone's picture
    try:
        with Image.open(path) as picture:
            (width, height), pages = picture.size, getattr(picture, "n_frames", 1)
            pages = (
                1 if picture.format == "MPO" else pages
            )  # a phone's JPEG with a second view
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return  # OpenCV says whether it is a picture
    finally:
        Image.MAX_IMAGE_PIXELS = before
    require(pages == 1, path, "pages", pages, "1: save each as a file of its own")
    good = min(width, height) >= FEWEST_PIXELS and width * height <= MOST_PIXELS
    require(good, path, "size", f"{width} x {height} pixels", allowed)


# --- a simulated pile -----------------------------------------------------------------------------


def measure_pile(
    grains: Grains,
    how: MeasureSettings | None = None,
    members: np.ndarray | None = None,
) -> PileResult:
    """Measure simulated bodies on the plate z = 0 from `how.views` sides.

    `members` marks the largest cluster in contact; None means the largest connected part of each silhouette, which may
    include a loose grain in front of the pile.
    """
    settings = with_berry_height(how or MeasureSettings(), grains.particle)
    height_m, views = pile_views(grains, settings, members)
    aor = {name: np.full(settings.views, np.nan) for name in DEFINITIONS}
    height = np.full(settings.views, np.nan)
    reasons: dict[str, str] = {}
    for view, pile in enumerate(views):
        profile, crest = profile_of(pile)
        height[view] = profile[crest] * settings.mm_per_pixel
        measured, missing = measure_sides(profile, crest, settings)
        for name, (aor_deg, _, _) in measured.items():
            aor[name][view] = aor_deg
        reasons = missing | reasons
    return PileResult(settings.response, 1e3 * height_m, height, aor, reasons)


def pile_views(
    grains: Grains, settings: MeasureSettings, members: np.ndarray | None = None
) -> tuple[float, Iterator[Segmentation]]:
    """Height of the highest point in m, and an iterator over the views; arguments as in `measure_pile`."""
    if members is not None and settings.largest_pile_only:
        grains = grains[np.asarray(members, bool)]
    require_flank(len(grains.centres_m), "no grain lies in the pile")
    height_m = top_of(grains)
    assert settings.berry_height_mm is not None
    lowest_m = LOWEST_PILE_GRAINS * 1e-3 * settings.berry_height_mm
    if height_m < lowest_m:
        raise NoFlankError(
            f"the pile is {1e3 * height_m:.1f} mm high; a flank needs {1e3 * lowest_m:.1f} mm"
        )
    azimuths = np.arange(settings.views) * 180.0 / settings.views
    scale = settings.mm_per_pixel
    polygons = outlines(grains, azimuths, inset_m=scale * 0.5e-3)

    def views() -> Iterator[Segmentation]:
        for shown in polygons:
            image = paint(shown, scale, frame(shown, scale))
            if min(image.shape) < SMALLEST:
                size = f"{image.shape[1]} by {image.shape[0]} pixels of {scale:g} mm (measure.mm_per_pixel)"
                raise NoFlankError(
                    f"the pile's picture has {size}; a flank needs {SMALLEST} by {SMALLEST}"
                )
            yield of_silhouette(
                image, PILE_TONE, BACKGROUND_TONE, settings.largest_pile_only
            )

    return height_m, views()


def with_berry_height(
    settings: MeasureSettings, particle: ConvexBody
) -> MeasureSettings:
    """Complete the settings with the particle's equivalent diameter in place of a missing height of a grain."""
    if settings.berry_height_mm is not None:
        return settings
    return replace(settings, berry_height_mm=1e3 * equivalent_diameter(particle))


def equivalent_diameter(particle: ConvexBody) -> float:
    """Equivalent diameter in m (Eq. 1): the cube root of the product of the body's extents along its three axes."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    reach = (particle.support_point(axes) * axes).sum(axis=1)
    return float(np.prod(reach[:3] + reach[3:]) ** (1 / 3))
