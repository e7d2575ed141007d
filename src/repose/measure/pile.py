"""Angle of repose and Height of a pile, from a photograph or from a simulation seen from the side.

The steps are the paper's (section 2.3, Figure 6): grey, threshold, edge, boundary, a straight line through
the left and one through the right flank; the angle of repose is the mean of the two arctangents, the Height
that of the highest point over the base. A simulation is projected to a silhouette first and then goes the
same way.

What the paper leaves open is which part of a lumpy boundary the line goes through. Four definitions are
measured on every pile (`repose.measure.angles`), and the configuration names one of them as the response. Their
biases and their noise stand in docs/measurement.md.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from repose.core.errors import InputError, NoFlankError
from repose.measure.angles import DEFINITIONS, FLANK_RULES, MEAN_KEYS, VIEW_KEYS, measure_sides
from repose.measure.silhouette import frame, outlines, paint, segment, silhouette, top_of, upper_edge

__all__ = [
    "DEFINITIONS",
    "FLANK_RULES",
    "Angle",
    "MeasureSettings",
    "Measurement",
    "NoFlankError",
    "PileResult",
    "measure_image",
    "measure_pile",
    "read_image",
    "silhouette",
]

LOWEST_PILE_BERRIES = 1.5  # in equivalent diameters: 20 mm for the mean berry; below, a layer and not a pile


@dataclass(frozen=True)
class MeasureSettings:
    """How a pile is measured. `views` side views evenly over half a turn (the other half mirrors them);
    `response` is the definition that is the angle of repose; `fit_from` and `fit_to` bound the flank, each a
    fraction of the pile's height or "berry", one berry's height; `flank` names the rule of the lines;
    `berry_height_mm` None is that of the particle. Raises InputError."""

    views: int = 18
    mm_per_pixel: float = 0.25
    response: str = "flank"
    fit_from: float | str = 0.1
    fit_to: float | str = 0.8
    berry_height_mm: float | None = None
    largest_pile_only: bool = True
    flank: str = "columns"

    def __post_init__(self):
        if isinstance(self.views, bool) or not isinstance(self.views, int) or not 1 <= self.views <= 360:
            raise InputError("measure", "views", self.views, "a whole number from 1 to 360")
        if not isinstance(self.largest_pile_only, bool):
            raise InputError("measure", "largest_pile_only", self.largest_pile_only, "true or false")
        if not _positive(self.mm_per_pixel):
            raise InputError("measure", "mm_per_pixel", self.mm_per_pixel, "a positive number")
        if self.berry_height_mm is not None and not _positive(self.berry_height_mm):
            raise InputError("measure", "berry_height_mm", self.berry_height_mm, "a positive number or null")
        for key, names in (("response", DEFINITIONS), ("flank", FLANK_RULES)):
            if getattr(self, key) not in names:
                raise InputError("measure", key, getattr(self, key), "one of " + ", ".join(names))
        self._check_band()

    def _check_band(self):
        """InputError unless the two ends of the flank can be used together."""
        start, end = self.fit_from, self.fit_to
        if start != "berry" and not (isinstance(start, int | float) and 0 <= start <= 0.9):
            raise InputError("measure", "fit_from", start, "berry, or from 0 to 0.9")
        if "berry" in (start, end):
            good = start != end and (end == "berry" or (isinstance(end, int | float) and 0.1 <= end <= 1))
            if not good:
                raise InputError("measure", "fit_to", end, "from 0.1 to 1, or berry where fit_from is not")
        elif not (isinstance(end, int | float) and start + 0.1 <= end <= 1):
            raise InputError("measure", "fit_to", end, "berry, or at least fit_from + 0.1, at most 1")

    @classmethod
    def of(cls, section, berry):
        """From a configuration's section and what `repose berry` wrote: a berry's height that is not given
        is the mean berry's equivalent diameter (Eq. 1), where berry has the keys long_mm, major_mm, minor_mm."""
        settings = cls(**section)
        axes = [berry.get(key) for key in ("long_mm", "major_mm", "minor_mm")]
        if settings.berry_height_mm is None and None not in axes:
            return replace(settings, berry_height_mm=math.prod(axes) ** (1 / 3))
        return settings


def _positive(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


@dataclass(frozen=True)
class Angle:
    """One definition on one picture, degrees. `lines` is (left, right), each ((column, row) below, (column,
    row) above) in pixels."""

    left_deg: float
    right_deg: float
    aor_deg: float
    lines: tuple


@dataclass(frozen=True)
class Measurement:
    """One picture's result. `angles` holds an Angle for each definition that could be measured, `reasons` why
    the others could not; left_deg, right_deg, aor_deg and lines are those of `response`. `contour` (M, 2) are
    the boundary's pixels (column, row); `base_row` the plate's row and `top` the highest point's (column,
    row); `pile_is` "darker" or "brighter" than the background."""

    response: str
    angles: dict
    reasons: dict
    height_mm: float
    base_row: float
    top: tuple
    contour: np.ndarray
    pile_is: str

    @property
    def left_deg(self):
        return self.angles[self.response].left_deg

    @property
    def right_deg(self):
        return self.angles[self.response].right_deg

    @property
    def aor_deg(self):
        return self.angles[self.response].aor_deg

    @property
    def lines(self):
        return self.angles[self.response].lines

    def record(self):
        """The response's two sides and every definition by name, to 0.001; what could not be measured is None."""
        sides = {key: round(getattr(self, key), 3) for key in ("left_deg", "right_deg", "aor_deg")}
        found = {
            MEAN_KEYS[name]: round(self.angles[name].aor_deg, 3) if name in self.angles else None
            for name in DEFINITIONS
        }
        return sides | {"height_mm": round(self.height_mm, 3)} | found


@dataclass(frozen=True)
class PileResult:
    """A simulated pile. `height_mm` is exact, from the bodies themselves; `view_height_mm` (V,) the
    silhouettes'. left, right and aor hold (V,) degrees for each definition, NaN in a view where it could not be
    measured; `reasons` says why, of the first such view. `aor_deg` is None where the response could not be
    measured."""

    response: str
    height_mm: float
    view_height_mm: np.ndarray
    left: dict
    right: dict
    aor: dict
    reasons: dict

    def mean_deg(self, name):
        """Mean of a definition over the views; None where more than half of them have none."""
        seen = np.isfinite(self.aor[name])
        return float(self.aor[name][seen].mean()) if 2 * seen.sum() >= seen.size else None

    @property
    def aor_deg(self):
        return self.mean_deg(self.response)

    @property
    def left_deg(self):
        return self.left[self.response]

    @property
    def right_deg(self):
        return self.right[self.response]

    def record(self):
        """All responses by name; what could not be measured is None."""
        views = {VIEW_KEYS[name]: _or_none(self.aor[name][0]) for name in DEFINITIONS}
        means = {MEAN_KEYS[name]: self.mean_deg(name) for name in DEFINITIONS}
        heights = {"height_mm": self.height_mm, "height_view_mm": _or_none(self.view_height_mm[0])}
        return {"aor_deg": self.aor_deg, **heights, **means, **views}


def _or_none(value):
    return float(value) if np.isfinite(value) else None


# --- one picture ----------------------------------------------------------------------------------


def measure_image(image, mm_per_pixel, settings=None, *, base_row=None):
    """Measure the pile in a picture (section 2.3).

    image : (H, W) or (H, W, 3; BGR) uint8, a photograph from the side or a silhouette; the pile may be darker
    or brighter than the background (see `repose.measure.silhouette.segment`). mm_per_pixel : of this picture, instead
    of the settings'. base_row : the plate's row where the pile's lowest row is not it. Returns a Measurement.
    Raises InputError (arguments) and NoFlankError (the response cannot be measured).
    """
    settings = replace(settings or MeasureSettings(), mm_per_pixel=mm_per_pixel)
    return with_response(measure_segmented(segment(image, settings.largest_pile_only, base_row), settings))


def with_response(measurement):
    """The measurement, or NoFlankError where it lacks its response."""
    if measurement.response not in measurement.angles:
        raise NoFlankError(measurement.reasons[measurement.response])
    return measurement


def profile_of(pile):
    """Heights (W,) of a Segmentation's upper edge over the base in pixels, and the highest column: the middle
    one of several."""
    edge = upper_edge(pile.mask, pile.contrast, pile.level)
    profile = np.where(np.isnan(edge), 0.0, np.maximum(pile.base_row - edge, 0.0))
    highest = np.flatnonzero(profile >= profile.max() - 1e-6)
    return profile, int(highest[highest.size // 2])


def measure_segmented(pile, settings):
    """Measurement of a Segmentation, which may lack the response."""
    profile, crest = profile_of(pile)
    scale = settings.mm_per_pixel
    berry = None if settings.berry_height_mm is None else settings.berry_height_mm / scale
    measured, reasons = measure_sides(
        profile, crest, settings.fit_from, settings.fit_to, berry, settings.flank
    )
    angles = {}
    for name, (aor_deg, left, right) in measured.items():
        lines = (
            tuple((u, pile.base_row - z) for u, z in left.ends),
            tuple((profile.size - 1 - u, pile.base_row - z) for u, z in right.ends),
        )
        angles[name] = Angle(left.angle_deg, right.angle_deg, aor_deg, lines)
    contours = cv2.findContours(pile.mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    return Measurement(
        response=settings.response,
        angles=angles,
        reasons=reasons,
        height_mm=float(profile[crest]) * scale,
        base_row=pile.base_row,
        top=(float(crest), pile.base_row - float(profile[crest])),
        contour=np.concatenate(contours)[:, 0, :],
        pile_is=pile.pile_is,
    )


def read_image(path):
    """Picture file as (H, W, 3) BGR uint8, turned upright as its EXIF says. Raises InputError."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "picture", "no such file", "an existing picture file (PNG, JPEG, TIFF, BMP)")
    content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    if content.size == 0:
        raise InputError(path, "picture", "an empty file", "a picture file (PNG, JPEG, TIFF, BMP)")
    image = cv2.imdecode(content, cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(path, "picture", "not a picture", "a picture file (PNG, JPEG, TIFF, BMP)")
    return image


# --- a simulated pile -----------------------------------------------------------------------------


def measure_pile(centres_m, quaternions, particle, settings=None, members=None, scales=None):
    """Measure simulated bodies on the plate z = 0 from `settings.views` sides.

    centres_m : (N, 3). quaternions : (N, 4) w, x, y, z, body -> world. members : (N,) bool, the bodies of the
    largest cluster in contact; used when `settings.largest_pile_only`. Without it the largest connected part
    of each silhouette is taken, which cannot tell a loose berry in front of the pile from the pile. scales :
    (N,) sizes of the bodies relative to the particle, where they differ. Returns a PileResult. Raises
    NoFlankError if there is no pile; a definition that cannot be measured in more than half of the views is
    None in it.
    """
    settings = with_berry_height(settings or MeasureSettings(), particle)
    height_m, views = pile_views(centres_m, quaternions, particle, settings, members, scales)
    left, right, aor = ({name: np.full(settings.views, np.nan) for name in DEFINITIONS} for _ in range(3))
    height, reasons = np.full(settings.views, np.nan), {}
    for view, pile in enumerate(views):
        seen = measure_segmented(pile, settings)
        height[view] = seen.height_mm
        for name, angle in seen.angles.items():
            left[name][view], right[name][view] = angle.left_deg, angle.right_deg
            aor[name][view] = angle.aor_deg
        reasons = seen.reasons | reasons
    return PileResult(settings.response, 1e3 * height_m, height, left, right, aor, reasons)


def pile_views(centres_m, quaternions, particle, settings, members=None, scales=None):
    """The highest point in metres, and an iterator over the views' Segmentations; arguments and errors as in
    `measure_pile`."""
    kept = np.ones(len(centres_m), bool)
    if members is not None and settings.largest_pile_only:
        kept = np.asarray(members, bool)
    if not kept.any():
        raise NoFlankError("no berry lies in the pile")
    bodies = np.asarray(centres_m, dtype=float)[kept], np.asarray(quaternions, dtype=float)[kept], particle
    sizes = None if scales is None else np.asarray(scales, dtype=float)[kept]
    height_m = top_of(*bodies, sizes)
    lowest_m = LOWEST_PILE_BERRIES * 1e-3 * settings.berry_height_mm
    if height_m < lowest_m:
        raise NoFlankError(f"the pile is {1e3 * height_m:.1f} mm high; a flank needs {1e3 * lowest_m:.1f} mm")
    azimuths = np.arange(settings.views) * 180.0 / settings.views
    scale = settings.mm_per_pixel
    polygons = outlines(*bodies, azimuths, inset_m=scale * 0.5e-3, scales=sizes)

    def views():
        for shown in polygons:
            image = paint(shown, scale, frame(shown, scale))
            yield segment(image, settings.largest_pile_only, base_row=image.shape[0] - 0.5)

    return height_m, views()


def with_berry_height(settings, particle):
    """The settings with the particle's equivalent diameter where they have no berry's height."""
    if settings.berry_height_mm is not None:
        return settings
    return replace(settings, berry_height_mm=1e3 * equivalent_diameter(particle))


def equivalent_diameter(particle):
    """Eq. 1 on the body's own extents: the cube root of the product of its three axes, m."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    reach = (particle.support_point(axes) * axes).sum(axis=1)
    return float(np.prod(reach[:3] + reach[3:]) ** (1 / 3))
