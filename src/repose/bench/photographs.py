"""Photographs of a turning drum and of a drawdown box, without the printed sheet.

The user points at the apparatus: three points of the drum's rim, or the two lower inner corners of the box. Its
measures in the configuration give the scale. The picture is drawn anew to scale and level, and its bed is measured by
the code that measures the simulation's. The lens and the perspective are not corrected: a slope between two plates
looks the same from any distance, other than a cone's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from repose.bench.drawdown import Box, DrawdownSettings
from repose.bench.drum import Drum
from repose.bench.settings import Rotating, SceneSettings
from repose.bench.turning import TurningSettings
from repose.common.errors import NoFlankError, require
from repose.measure import bed
from repose.measure.photographs import drawing
from repose.measure.photographs.photograph import load
from repose.measure.photographs.segmentation import pile_component, segment, threshold
from repose.measure.photographs.tables import Tables, mean_rows
from repose.measure.pile import measure_segmented, with_response
from repose.measure.settings import MeasureSettings

RESPONSES = {
    "turning": ("turning_deg",),
    "drawdown": ("drawdown_above_deg", "drawdown_below_deg"),
}
# Number of points, least distance in pixels, and what they are.
POINTS = {
    "turning": (
        3,
        50,
        "column and row of three points of the drum's inner rim, at least 50 pixels apart",
    ),
    "drawdown": (
        2,
        200,
        "column and row of the left and of the right lower inner corner of the box, 200 pixels apart",
    ),
}
ON_A_LINE = 1e-6  # twice the area of three points [px2]
INSIDE = 0.97  # share of the drum's radius within which a bed is looked for: the rim has colours of its own
EMPTY = 0.6  # share of the radius above which the drum is empty
MARGIN = 0.02  # share of a chamber's half width that is left out at a wall
LARGEST_PX = 1600  # longer side of a redrawn picture
LEAST_PX = 100  # of the drum's radius or of a chamber's half width


@dataclass
class Seen:
    """Result of one photograph."""

    path: Path
    views: list[np.ndarray]  # the measured pictures with what was found, BGR
    values: dict[str, float] = field(default_factory=dict)  # by response
    refused: str = ""
    mask: np.ndarray | None = None  # of a bed in a drum, (H, W)


def measure_drum(image: np.ndarray, rim_px: np.ndarray, section: Rotating) -> Seen:
    """Measure the bed surface in a drum located by three points (3, 2) of its inner rim.

    The side on which the bed is higher is taken for that to which the drum carries it.
    """
    centre, radius_px = _circle(rim_px)
    corner, scale = (
        centre - [radius_px, -radius_px],
        1e3 * Drum.of(section).radius_m / radius_px,
    )
    view, mm_per_pixel = _redrawn(
        image, corner, np.array([1.0, 0.0]), (2 * radius_px, 2 * radius_px), scale
    )
    mask, radius_m = _bed(view), 0.5e-3 * mm_per_pixel * len(view)
    surface = bed.surface_of(mask > 0, radius_m, mm_per_pixel, section.fit_share)
    if surface.angle_deg < 0:
        mask, view = mask[:, ::-1], view[:, ::-1]
        surface = bed.surface_of(mask > 0, radius_m, mm_per_pixel, section.fit_share)
    picture, thick = np.ascontiguousarray(view), max(1, len(view) // 400)
    per_pixel = np.array([1e3, -1e3]) / mm_per_pixel
    ends, edge = (
        (line - (-radius_m, radius_m)) * per_pixel
        for line in (surface.line_m, surface.profile_m)
    )
    cv2.polylines(picture, [edge.astype(np.int32)], False, drawing.YELLOW, thick)
    drawing.draw_line(picture, tuple(ends[0]), tuple(ends[1]), drawing.RED, thick)
    return Seen(Path(), [picture], {"turning_deg": surface.angle_deg}, mask=mask)


def measure_box(
    image: np.ndarray,
    corners_px: np.ndarray,
    section: DrawdownSettings,
    how: MeasureSettings,
) -> Seen:
    """Measure both slopes in a drawdown box located by its lower inner corners (2, 2), the left one first."""
    box = Box.of(section)
    left, right = corners_px
    length = np.hypot(*(right - left))
    along, scale = (right - left) / length, 2e3 * box.half_lower / length

    def chamber(
        x0_m: float, x1_m: float, z0_m: float, z1_m: float
    ) -> tuple[np.ndarray, float]:
        corner = left + (x0_m + box.half_lower) * 1e3 / scale * along
        corner = corner + z0_m * 1e3 / scale * np.array([along[1], -along[0]])
        size = (x1_m - x0_m) * 1e3 / scale, (z1_m - z0_m) * 1e3 / scale
        return _redrawn(image, corner, along, size, scale)

    trimmed = box.half_lower * (1 - MARGIN)
    below, pixel = chamber(-trimmed, trimmed, 0.0, box.gate)
    outer, upwards = (
        box.half_width * (1 - MARGIN),
        along[0] * length / (2 * box.half_lower),
    )
    top = min(
        box.top, 0.99 * min(left[1], right[1]) / upwards
    )  # the picture need not show all of the chamber
    wedges, scales = zip(
        *(chamber(*ends, box.floor, top) for ends in ((-outer, 0.0), (0.0, outer))),
        strict=True,
    )
    # back to back, as `drawdown.back_to_back` puts the grains: the shape of a pile
    above = np.ascontiguousarray(
        np.hstack([wedges[1], wedges[0][:, -wedges[1].shape[1] :]])
    )
    seen = Seen(Path(), [])
    parts = (
        (
            "drawdown_above_deg",
            above,
            replace(how, mm_per_pixel=scales[0], largest_pile_only=False),
        ),
        ("drawdown_below_deg", below, replace(how, mm_per_pixel=pixel)),
    )
    for name, view, settings in parts:
        try:
            pile = segment(view, settings.largest_pile_only, len(view) - 0.5)
            if pile.mask[0].any():
                raise NoFlankError("it runs out of the picture at the top")
            measurement = with_response(measure_segmented(pile, settings))
        except NoFlankError as error:
            raise NoFlankError(f"{name}: {error.reason}") from None
        seen.values[name] = measurement.aor_deg
        seen.views.append(drawing.overlay(view, measurement))
    return seen


def measure_all(
    paths: Sequence[Path],
    points_px: Sequence[float],
    settings: SceneSettings,
    bench: str,
    how: MeasureSettings,
) -> list[Seen]:
    """Measure photographs by one camera on a tripod: the points hold for each."""
    points = _checked_points(points_px, bench)
    results = []
    for path in paths:
        image, times = load(path)
        try:
            if bench == "turning":
                found = measure_drum(
                    image, points / times, settings.section(bench, TurningSettings)
                )
            else:
                found = measure_box(
                    image,
                    points / times,
                    settings.section(bench, DrawdownSettings),
                    how,
                )
        except ValueError as error:  # no flank, or a bed that is too narrow
            found = Seen(path, [image], refused=str(error))
        found.path = path
        results.append(found)
    return results


def _checked_points(points_px: Sequence[float], bench: str) -> np.ndarray:
    """Return the points of the apparatus, (3, 2) for a drum and (2, 2) for a box, or raise InputError."""
    count, least_px, allowed = POINTS[bench]
    points = np.array(points_px, float)
    good = points.size == 2 * count and bool(np.isfinite(points).all())
    if good:
        points = points.reshape(count, 2)
        good = (
            min(np.hypot(*(a - b)) for k, a in enumerate(points) for b in points[:k])
            >= least_px
        )
        good &= bench == "turning" or points[0, 0] <= points[1, 0]
    if (
        good
        and bench == "turning"
        and abs(np.linalg.det(points[1:] - points[0])) < ON_A_LINE
    ):
        good, allowed = False, "three points that are not on a line"
    require(good, "command line", "--points", list(points_px), allowed)
    return points


def tables(results: Sequence[Seen], bench: str) -> Tables:
    """Make the tables of photographs; at least one was measured."""
    names = RESPONSES[bench]
    rows = [
        {"photograph": seen.path.name}
        | {name: seen.values.get(name) for name in names}
        | {"refused": seen.refused}
        for seen in results
    ]
    photographs = pd.DataFrame(rows)
    return Tables(photographs, mean_rows(photographs, names))


def describe(results: Sequence[Seen], made: Tables, out: Path) -> str:
    """Write the text that the verb prints."""
    lines = []
    for seen in results:
        values = ", ".join(f"{name} {value:.2f}" for name, value in seen.values.items())
        lines.append(
            f"{seen.path.name}  {f'refused: {seen.refused}' if seen.refused else values}"
        )
    lines.append("mean, standard deviation, number of photographs:")
    for row in made.summary.itertuples():
        sd = "not known" if np.isnan(row.sd) else f"{row.sd:.2f}"
        lines.append(f"{row.response}: {row.value:.2f}, {sd}, {row.repetitions}")
    lines.append(
        f"look at the overlays in {out}; the targets of a study: {out / 'targets.yaml'}"
    )
    return "\n".join(lines)


def profile(results: Sequence[Seen], section: Rotating) -> pd.DataFrame:
    """Find the surface that half of the photographs of a drum cover, for a target that is a profile."""
    masks = [
        seen.mask for seen in results if seen.mask is not None and not seen.refused
    ]
    radius_m = Drum.of(section).radius_m
    mm_per_pixel = 2e3 * radius_m / len(masks[0])
    x_m = np.arange(-0.8, 0.81, 0.05) * radius_m
    size = masks[0].shape[::-1]
    share = np.mean(
        [cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST) > 0 for mask in masks],
        axis=0,
    )
    heights = bed.surface_heights(share, 0.5, x_m, radius_m, mm_per_pixel)
    return pd.DataFrame({"x_mm": 1e3 * x_m, "z_mm": 1e3 * heights}).round(3)


def stacked(views: Sequence[np.ndarray]) -> np.ndarray:
    """Put pictures below each other, on black."""
    width = max(view.shape[1] for view in views)
    return np.vstack(
        [
            cv2.copyMakeBorder(
                view, 0, 0, 0, width - view.shape[1], cv2.BORDER_CONSTANT
            )
            for view in views
        ]
    )


def _circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Draw the circle through three points (3, 2): its centre (2,) and radius."""
    a, b, c = points
    rows = 2 * np.array([b - a, c - a])
    centre = np.linalg.solve(rows, [b @ b - a @ a, c @ c - a @ a])
    return centre, float(np.hypot(*(a - centre)))


def _redrawn(
    image: np.ndarray,
    corner_px: np.ndarray,
    along: np.ndarray,
    size_px: tuple[float, float],
    mm_per_pixel: float,
) -> tuple[np.ndarray, float]:
    """Redraw a rectangle of the picture, from its lower left corner along its base, and return its scale."""
    if min(size_px) < LEAST_PX:
        raise NoFlankError(
            f"it is {min(size_px):.0f} pixels wide in the picture; {LEAST_PX} are needed"
        )
    times = min(1.0, LARGEST_PX / max(size_px))
    width, height = (round(times * length) for length in size_px)
    up = np.array([along[1], -along[0]])
    # the middle of pixel (column, row) of the new picture in the old one
    step = np.array(size_px) / (width, height)
    first = corner_px + 0.5 * step[0] * along + (size_px[1] - 0.5 * step[1]) * up
    where = np.column_stack([step[0] * along, -step[1] * up, first])
    rows, columns = image.shape[:2]
    ends = where @ np.array(
        [[0, width, 0, width], [0, 0, height, height], [1, 1, 1, 1]]
    )
    if ends.min() < -1 or ends[0].max() > columns + 1 or ends[1].max() > rows + 1:
        raise NoFlankError("the drum or the box runs out of the picture")
    if times < 1:
        image = cv2.GaussianBlur(image, (0, 0), 0.5 / times)
    view = cv2.warpAffine(
        image,
        where,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return view, mm_per_pixel * step[0]


def _bed(view: np.ndarray) -> np.ndarray:
    """Mark the bed (H, W) in a square view of the drum: what differs from the drum's upper part."""
    size = len(view)
    places = (np.arange(size) + 0.5) / (0.5 * size) - 1
    inside = np.hypot(*np.meshgrid(places, places)) < INSIDE
    smooth = (
        cv2.GaussianBlur(cv2.medianBlur(view, 3), (0, 0), 1.0)
        .astype(np.float32)
        .reshape(size, size, -1)
    )
    empty = inside & (places[:, None] < -EMPTY)
    contrast = np.linalg.norm(smooth - np.median(smooth[empty], axis=0), axis=-1)
    level, _ = threshold(contrast[inside][:, None])
    return pile_component(((contrast > level) & inside).astype(np.uint8), True)
