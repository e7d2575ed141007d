"""Simulated piles: angle, Height and further responses of known shapes."""

import math

import cv2
import numpy as np
import pytest
from oracles import rotation
from refusals import raised
from rendered import Ellipsoids

from repose.measure import further_responses
from repose.measure.photographs.segmentation import segment, segment_silhouette
from repose.measure.pile import MeasureSettings, NoFlankError, measure_pile
from repose.measure.silhouette import (
    BACKGROUND_TONE,
    PILE_TONE,
    Grains,
    draw_silhouette,
)

MM = 0.25


BERRY = Ellipsoids([10.57, 5.685, 4.94])
BARREL = Ellipsoids([7.399, 0.94, 0.94], [3.171, 4.745, 4.0])


def cone_of_berries(angle, rng, berries=500, height_m=0.062):
    """Random berries (centres, quaternions) in a cone whose flank lies one mean radius outside the centres."""
    a = math.radians(angle)
    reach = 0.0066
    centres = np.empty((0, 3))
    while len(centres) < berries:
        p = (
            rng.uniform([-1, -1, 0.11], [1, 1, 1], (4000, 3))
            * height_m
            / [math.tan(a), math.tan(a), 1]
        )
        over = np.hypot(p[:, 0], p[:, 1]) * math.sin(a) + p[:, 2] * math.cos(a)
        centres = np.concatenate([centres, p[over < height_m * math.cos(a) - reach]])
    return centres[:berries], rng.normal(size=(berries, 4))


@pytest.mark.parametrize("particle", [BERRY, BARREL])
def test_silhouette_equals_the_projection_of_a_cloud_of_surface_points(particle):
    rng = np.random.default_rng(5)
    centres = rng.uniform([-0.03, -0.03, 0.012], [0.03, 0.03, 0.04], (12, 3))
    q = rng.normal(size=(12, 4))
    azimuth = 37.0
    mm = 0.5
    extent = (-0.05, 0.05, 0.06)
    image = draw_silhouette(Grains(centres, q, particle), azimuth, mm, extent)
    assert image.shape == (120, 200)
    normals = rng.normal(size=(60_000, 3))
    surface = particle.support_point(
        normals / np.linalg.norm(normals, axis=1, keepdims=True)
    )
    cloud = np.zeros(image.shape, bool)
    for c, turn in zip(
        centres, q / np.linalg.norm(q, axis=1, keepdims=True), strict=True
    ):
        points = c + surface @ rotation(turn).T
        u = points[:, 0] * math.cos(math.radians(azimuth)) + points[:, 1] * math.sin(
            math.radians(azimuth)
        )
        row = np.floor(120 - points[:, 2] * 1e3 / mm).astype(int)
        column = np.floor((u - extent[0]) * 1e3 / mm).astype(int)
        cloud[row[row < 120], column[row < 120]] = True
    pile = image < 128
    ones = np.ones((3, 3), np.uint8)
    # a point touches a pixel before the outline covers its centre: the two differ by the rim, and only outwards
    assert not (pile & ~cloud).any()
    assert not (cloud & (cv2.dilate(pile.astype(np.uint8), ones) == 0)).any()


def test_a_silhouette_has_the_area_of_the_ball():
    ball = Ellipsoids([10.0, 10.0, 10.0])
    areas = []
    for shift in np.linspace(0, 0.25e-3, 7):
        image = draw_silhouette(
            Grains([[shift, 0, 0.01]], [[1.0, 0, 0, 0]], ball), 0.0, MM
        )
        areas.append((image < 128).sum() * MM**2)
        assert (image[-2] < 128).any()
    assert np.mean(areas) == pytest.approx(math.pi * 100, rel=4e-3)


def test_a_silhouette_from_behind_is_mirrored():
    centres = np.array([[0.03, 0.0, 0.01], [0.0, 0.0, 0.02]])
    q = np.array([[0.5, 0.5, 0.1, 0.7], [1.0, 0, 0, 0]])
    extent = (-0.06, 0.06, 0.04)
    front = draw_silhouette(Grains(centres, q, BERRY), 0.0, MM, extent)
    back = draw_silhouette(Grains(centres, q, BERRY), 180.0, MM, extent)
    assert (front < 128).any(axis=0).nonzero()[0].max() > 300
    assert np.mean(front[:, ::-1] != back) < 2e-3


def test_the_members_alone_are_measured():
    rng = np.random.default_rng(2)
    centres, q = cone_of_berries(25, rng)
    stray = np.array([[0.2, 0.0, 0.01], [-0.2, 0.1, 0.01]])
    with_stray = Grains(
        np.vstack([centres, stray]), np.vstack([q, rng.normal(size=(2, 4))]), BERRY
    )
    members = np.arange(502) < 500
    alone = measure_pile(Grains(centres, q, BERRY))
    masked = measure_pile(with_stray, in_pile=members)
    assert masked.aor_deg == alone.aor_deg
    assert masked.height_mm == alone.height_mm
    assert alone.aor[alone.response].shape == alone.view_height_mm.shape == (18,)
    assert alone.aor_deg == pytest.approx(alone.aor[alone.response].mean())
    assert np.abs(alone.view_height_mm - alone.height_mm).max() < MM
    assert (
        measure_pile(
            with_stray, MeasureSettings.with_defaults(largest_pile_only=False), members
        ).aor_deg
        < alone.aor_deg - 1
    )


def test_what_is_no_pile_is_refused():
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(-0.1, 0.1, (80, 2)), np.full(80, 0.005)])
    lying = Grains(flat, np.tile([1.0, 0, 0, 0], (80, 1)), BERRY)
    raised(NoFlankError, "mm high", measure_pile, lying)
    raised(NoFlankError, "no grain", measure_pile, lying, in_pile=np.zeros(80, bool))


def test_too_coarse_a_pixel_is_refused():
    pile = cone_of_berries(25, np.random.default_rng(2))
    with pytest.raises(
        NoFlankError,
        match=r"by 1\d pixels of 5 mm \(measure.mm_per_pixel\); a flank needs 20 by 20",
    ):
        measure_pile(
            Grains(*pile, BERRY), MeasureSettings.with_defaults(mm_per_pixel=5.0)
        )


@pytest.mark.parametrize("largest_only", [True, False])
def test_a_silhouette_is_split_as_any_picture_of_its_tones_to_the_last_bit(
    largest_only,
):
    centres, q = cone_of_berries(30, np.random.default_rng(3), 250)
    centres[::10, 0] += 0.12  # berries beside the pile, and gaps in it
    image = draw_silhouette(Grains(centres, q, BERRY), mm_per_pixel=MM)
    known = segment_silhouette(image, PILE_TONE, BACKGROUND_TONE, largest_only)
    found = segment(image, largest_only, base_row=image.shape[0] - 0.5)
    assert known.level == found.level
    assert known.base_row == found.base_row
    assert known.is_darker == found.is_darker
    for name in ("grey", "contrast", "mask"):
        assert getattr(known, name).dtype == getattr(found, name).dtype
        np.testing.assert_array_equal(getattr(known, name), getattr(found, name))


@pytest.mark.slow
def test_cones_of_berries_have_their_angle_within_a_degree():
    """From 10 % of the height on; measured bias over 15 to 45 degrees: levels +0.6, rows +0.9, columns -1.6."""
    errors = {"levels": [], "columns": []}
    for angle in (20, 30, 40):
        rng = np.random.default_rng(angle)
        for _ in range(4):
            pile = Grains(*cone_of_berries(angle, rng), BERRY)
            for rule in errors:
                settings = MeasureSettings.with_defaults(
                    response="flank", fit_from=0.1, flank=rule
                )
                errors[rule].append(measure_pile(pile, settings).aor_deg - angle)
    assert abs(np.mean(errors["levels"])) < 1.0
    assert abs(np.mean(errors["levels"])) < abs(np.mean(errors["columns"]))


MM_PER_PIXEL = 0.5


def cone(slope_deg, height_mm=60.0, foot_mm=10.0):
    """Silhouette of a cone: heights in pixels over columns."""
    half = height_mm / math.tan(math.radians(slope_deg)) / MM_PER_PIXEL
    columns = np.arange(math.ceil(2 * half) + 2 * round(foot_mm / MM_PER_PIXEL))
    middle = (len(columns) - 1) / 2
    return np.maximum(
        0, height_mm / MM_PER_PIXEL * (1 - np.abs(columns - middle) / half)
    )


def test_slopes_and_packing_are_those_of_a_cone():
    angle = 31.0
    berry = 12.0
    base = 60.0 / math.tan(math.radians(angle))
    volume = math.pi * base**2 * 60.0 / 3
    found = further_responses.measure_silhouettes(
        [cone(angle)] * 3, MM_PER_PIXEL, 60.0, berry, 0.6 * volume
    )
    assert found["base_radius_mm"] == pytest.approx(base * (1 - berry / 60), abs=0.3)
    assert found["lower_deg"] == pytest.approx(angle, abs=0.3)
    assert found["upper_deg"] == pytest.approx(angle, abs=0.3)
    assert found["packing_percent"] == pytest.approx(60, abs=0.5)


def test_slopes_are_those_of_a_hollow_pile():
    profile = cone(31.0)
    hollow = profile**2 / profile.max()  # steep at the top, flat at the foot
    found = further_responses.measure_silhouettes(
        [hollow], MM_PER_PIXEL, 60.0, 12.0, 1e5
    )
    # z = H (1 - r / R)^2
    base = 60 / math.tan(math.radians(31)) * (1 - math.sqrt(0.2))
    half = 60 / math.tan(math.radians(31)) * (1 - math.sqrt(0.5))
    upper = 60 / math.tan(math.radians(31)) * (1 - math.sqrt(0.8))
    expected = math.degrees(math.atan(18 / (base - half)))
    assert found["lower_deg"] == pytest.approx(expected, abs=0.4)
    expected = math.degrees(math.atan(18 / (half - upper)))
    assert found["upper_deg"] == pytest.approx(expected, abs=0.8)
    assert found["upper_deg"] > found["lower_deg"] + 5


def test_half_widths_are_those_of_cones():
    wide = cone(31.0)
    low = cone(31.0, height_mm=20.0)
    level = np.array([10.0, 40.0])
    half_width = further_responses.measure_half_widths([wide], MM_PER_PIXEL, level)
    both = further_responses.measure_half_widths([wide, low], MM_PER_PIXEL, level)
    expected = [50 / math.tan(math.radians(31)), 20 / math.tan(math.radians(31))]
    assert half_width == pytest.approx(expected, abs=0.3)
    assert both[1] == pytest.approx(half_width[1] / 2)
    with pytest.raises(
        NoFlankError, match=r"half of 20.0 mm is not above a grain, 12.0 mm"
    ):
        further_responses.measure_silhouettes([low], MM_PER_PIXEL, 20.0, 12.0, 1.0)


def test_scatter_counts_what_lies_on_the_plate():
    centres = np.zeros((102, 3))
    centres[:, 0] = 1e-3 * np.arange(1, 103)
    centres[:, 2] = 0.01
    centres[100] = (0.5, 0, 0.01)
    centres[101] = (0.05, 0, -0.2)
    pile = np.ones(102, bool)
    pile[95:] = False
    found = further_responses.measure_scatter(centres, pile, 300.0)
    assert found["radius_90_mm"] == pytest.approx(np.quantile(np.arange(1, 101), 0.9))
    assert found["loose_percent"] == pytest.approx(5.0)
    raised(
        NoFlankError,
        "no grain",
        further_responses.measure_scatter,
        centres[101:],
        pile[101:],
        300.0,
    )
