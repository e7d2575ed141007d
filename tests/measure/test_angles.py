"""The definitions of the angle on profiles whose angles are known in closed form."""

import math

import numpy as np
import pytest
from refusals import raised

from repose.common.errors import NoFlankError
from repose.measure import angles, profile_points
from repose.measure.definitions import PROPERTIES
from repose.measure.settings import MeasureSettings, line_of

RULES = tuple(profile_points.FLANK_RULES)
MARGIN = 20


def degrees(slope):
    return math.degrees(math.atan(slope))


def cone(slope, height):
    """One side of a triangle, foot to crest, whose crest lies on a column."""
    return np.maximum(
        height - slope * np.arange(math.ceil(height / slope) + MARGIN)[::-1], 0.0
    )


def trapezoid(slope, height, half_top):
    """One side of a trapezoid with a flat top of `half_top` columns on this side."""
    return np.concatenate([cone(slope, height), np.full(half_top, float(height))])


def two_slopes(lower, upper, knee, height):
    """One side that rises with `lower` up to the height `knee` and with `upper` above it."""
    below = knee + lower * np.arange(-math.ceil(knee / lower) - MARGIN, 0)
    return np.maximum(
        np.concatenate(
            [below, knee + upper * np.arange(0, (height - knee) / upper + 1e-9)]
        ),
        0.0,
    )


def lumpy(slope, height, rng):
    """A cone's side with half-discs of 8 to 16 pixels on it."""
    profile = cone(slope, height)
    u = np.arange(profile.size)
    for centre in rng.uniform(MARGIN, profile.size - 20, 40):
        chord = rng.uniform(8, 16) ** 2 - (u - centre) ** 2
        top = (
            np.interp(centre, u, cone(slope, height))
            - 4
            + np.sqrt(np.maximum(chord, 0.0))
        )
        profile = np.where(chord > 0, np.maximum(profile, top), profile)
    profile[:MARGIN] = 0.0
    return np.minimum(profile, height)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("slope", [0.3, 0.6, 1.0])
def test_a_cone_has_its_slope_by_every_line(rule, slope):
    profile = cone(slope, 240.0)
    for line in (
        angles.fit_flank(profile, 24.0, 192.0, rule),
        angles.fit_steepest(profile, 24.0, 192.0, rule),
        angles.fit_whole_side(profile, rule),
        angles.fit_straightest(profile, 0.333, rule),
    ):
        assert line.angle_deg == pytest.approx(degrees(slope), abs=1e-9)
        for u, z in line.ends:
            assert z == pytest.approx(240.0 - slope * (profile.size - 1 - u))


@pytest.mark.parametrize("slope", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("berry", [20.0, 53.4])
def test_the_secant_of_a_cone_is_steeper_by_the_height_over_what_stands_above_the_berry(
    slope, berry
):
    height = 240.0
    line = angles.fit_secant(cone(slope, height), berry)
    assert line.angle_deg == pytest.approx(degrees(slope * height / (height - berry)))
    assert angles.compute_secant(line, line) == pytest.approx(line.angle_deg)


def test_the_secant_takes_the_whole_width():
    left = angles.fit_secant(cone(0.4, 240.0), 48.0)
    right = angles.fit_secant(cone(0.8, 240.0), 48.0)
    width = 192.0 / 0.4 + 192.0 / 0.8
    expected = degrees(2 * 240.0 / width)
    assert angles.compute_secant(left, right) == pytest.approx(expected)
    assert angles.compute_secant(left, right) < (left.angle_deg + right.angle_deg) / 2


def test_a_trapezoid_is_a_cone_up_to_its_top():
    slope = 0.5
    height = 200.0
    half_top = 120
    profile = trapezoid(slope, height, half_top)
    assert angles.fit_flank(profile, 20.0, 160.0).angle_deg == pytest.approx(
        degrees(slope)
    )
    assert angles.fit_steepest(profile, 20.0, 160.0).angle_deg == pytest.approx(
        degrees(slope)
    )
    assert angles.fit_secant(profile, 40.0).angle_deg == pytest.approx(
        degrees(height / (160.0 / slope + half_top))
    )
    # regression of z = min(s u, h) on u over [0, a + b], a = h / s: covariance over variance by integration
    a = height / slope
    b = half_top
    total = a + b
    mean_z = (0.5 * a * height + b * height) / total
    moment = slope * a**3 / 3 + height * (total**2 - a**2) / 2
    expected = (moment / total - mean_z * total / 2) / (total**2 / 12)
    assert angles.fit_whole_side(profile).angle_deg == pytest.approx(
        degrees(expected), abs=0.15
    )


@pytest.mark.parametrize("rule", RULES)
def test_the_steepest_stretch_is_the_steeper_part_of_a_bent_flank(rule):
    profile = two_slopes(0.4, 0.8, knee=120.0, height=240.0)
    steep = angles.fit_steepest(profile, 24.0, 216.0, rule)
    assert steep.angle_deg == pytest.approx(degrees(0.8), abs=1e-6)
    assert steep.ends[0][1] >= 119.0
    assert (
        degrees(0.4)
        < angles.fit_flank(profile, 24.0, 216.0, rule).angle_deg
        < steep.angle_deg
    )


def slow_steepest(profile, low, high, rule):
    """Every window by itself, with numpy's own regression."""
    u, z = profile_points.FLANK_RULES[rule](profile, low, high)
    least = (high - low) / 2
    best = -math.inf
    for below in range(math.floor(least) + 1):
        for above in range(math.floor(least - below) + 1):
            inside = (z >= low + below) & (z <= high - above)
            if (
                inside.sum() >= profile_points.MIN_LEVELS
                and u[inside].std() >= angles.SMALLEST_SD_PX
            ):
                best = max(best, np.polyfit(u[inside], z[inside], 1)[0])
    return degrees(best)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("band", [(0.1, 0.8), (0.3, 0.8)])
def test_no_flank_is_steeper_than_its_steepest_stretch(rule, band):
    """By columns every half of a flank can be flatter than the whole flank, which counts, too."""
    rng = np.random.default_rng(5)
    for _ in range(40):
        profile = lumpy(rng.uniform(0.3, 0.9), 120.0, rng)
        low, high = (share * profile[-1] for share in band)
        steep = angles.fit_steepest(profile, low, high, rule)
        line = angles.fit_flank(profile, low, high, rule)
        assert steep.angle_deg >= line.angle_deg - 1e-9


def slow_straightest(profile, smallest, rule):
    """Every window by itself, with numpy's own correlation and regression."""
    u, z = profile_points.FLANK_RULES[rule](profile, angles.FOOT_HEIGHT_PX, profile[-1])
    places = np.unique(
        np.linspace(0, u.size, min(u.size, angles.WINDOW_STEPS) + 1).round().astype(int)
    )
    best = -math.inf
    slope = math.nan
    for first in places:
        for last in places[
            places - first >= max(profile_points.MIN_LEVELS, smallest * u.size)
        ]:
            x = u[first:last]
            y = z[first:last]
            if x.std() < angles.SMALLEST_SD_PX or y.std() == 0:
                continue
            correlation = np.corrcoef(x, y)[0, 1]
            if correlation > best + 1e-12:
                best = correlation
                slope = np.polyfit(x, y, 1)[0]
    return degrees(slope)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("fast", "slow", "height", "window"),
    [
        (angles.fit_steepest, slow_steepest, 115.0, (11.5, 92.0)),
        (angles.fit_straightest, slow_straightest, 230.0, (0.25,)),
        (angles.fit_straightest, slow_straightest, 230.0, (0.5,)),
    ],
)
def test_windows_of_lumpy_flanks_equal_a_slow_search(fast, slow, height, window, rule):
    rng = np.random.default_rng(11)
    for slope in (0.35, 0.9):
        profile = lumpy(slope, height, rng)
        assert fast(profile, *window, rule).angle_deg == pytest.approx(
            slow(profile, *window, rule), abs=1e-6
        )


@pytest.mark.parametrize("rule", RULES)
def test_the_straightest_window_leaves_out_a_wavy_toe_and_a_flat_crest(rule):
    """A straight flank between a toe of two waves and a flat top: the line is the flank's, the whole side's is not."""
    slope = 0.6
    height = 200.0
    profile = trapezoid(slope, height, 60)
    toe = MARGIN + np.arange(60)
    profile[toe] = np.maximum(profile[toe] + 6 * np.sin(toe / 60 * 4 * math.pi), 1.5)
    assert angles.fit_straightest(profile, 0.25, rule).angle_deg == pytest.approx(
        degrees(slope), abs=0.1
    )
    assert abs(angles.fit_whole_side(profile, "columns").angle_deg - degrees(slope)) > 1


def both_sides(left, right):
    """A whole profile and its crest from two sides of the same height."""
    return np.concatenate([left, right[::-1][1:]]), left.size - 1


def test_sides_hold_every_definition_or_say_why_not():
    profile, crest = both_sides(cone(0.4, 200.0), cone(0.8, 200.0))
    settings = MeasureSettings.with_defaults(
        fit_from="berry",
        fit_to=0.9,
        flank="columns",
        berry_height_mm=50.0,
        mm_per_pixel=1.0,
    )
    measured, reasons = angles.measure_sides(profile, crest, settings)
    assert tuple(measured) == angles.DEFINITIONS
    assert not reasons
    mean, left, right = measured["flank"]
    assert left.angle_deg == pytest.approx(degrees(0.4))
    assert right.angle_deg == pytest.approx(degrees(0.8))
    assert mean == pytest.approx((degrees(0.4) + degrees(0.8)) / 2)
    assert left.ends[0][1] == 50.0
    assert left.ends[1][1] == 180.0
    unknown, reasons = angles.measure_sides(
        profile, crest, settings.model_copy(update={"berry_height_mm": None})
    )
    assert tuple(unknown) == ("whole", "straightest")
    assert set(reasons) == {"flank", "secant", "steepest"}
    low, reasons = angles.measure_sides(
        profile, crest, settings.model_copy(update={"fit_from": 0.1, "fit_to": 0.2})
    )
    assert "steepest" not in low
    assert "12 are needed" in reasons["steepest"]
    wall = np.concatenate([np.zeros(MARGIN), np.full(60, 200.0)])
    for definition in (angles.fit_flank, angles.fit_steepest):
        raised(NoFlankError, "a wall", definition, wall, 20.0, 160.0, "levels")
    raised(
        NoFlankError,
        "not higher than one grain",
        angles.fit_secant,
        cone(0.5, 40.0),
        40.0,
    )
    cut = cone(0.5, 200.0)[150:]
    for definition in (
        lambda: angles.fit_flank(cut, 20.0, 160.0),
        lambda: angles.fit_secant(cut, 20.0),
        lambda: angles.fit_whole_side(cut),
        lambda: angles.fit_straightest(cut, 0.333),
    ):
        raised(NoFlankError, "foot is not seen", definition)


@pytest.mark.parametrize("name", PROPERTIES)
def test_a_line_along_the_whole_side_reaches_from_the_plate_to_the_crest(name):
    """A straight side between a flat toe and a flat top, of which the other lines leave out a part."""
    side = trapezoid(0.6, 200.0, 60)
    toe = np.linspace(0.5, 10.0, 60)
    side = np.concatenate([np.zeros(MARGIN), toe, side[side > 10.0]])
    settings = MeasureSettings.with_defaults(
        flank="columns", berry_height_mm=20.0, mm_per_pixel=1.0
    )
    measured, _ = angles.measure_sides(*both_sides(side, side), settings)
    (_, low), (_, high) = measured[name].left.ends
    # a regression may end above the crest, because the flat top pulls it down
    reaches = low <= 1.0 and high >= 200.0
    assert reaches is PROPERTIES[name].follows_whole_side


def test_windows_levels_and_lines_are_what_their_words_say():
    height = np.arange(30.0)
    distance = 2.0 * height + np.random.default_rng(1).normal(scale=3.0, size=30)
    slope = angles.compute_window_slopes(
        distance, height, np.array([5.0]), np.array([20.0])
    )
    expected = np.polyfit(distance[5:21], height[5:21], 1)[0]
    assert slope[0] == pytest.approx(expected, rel=1e-9)
    # a window of the fewest levels has a slope, one of a level less has none
    few = profile_points.MIN_LEVELS
    slopes = angles.compute_window_slopes(
        distance, height, np.array([5.0, 5.0]), np.array([4.0 + few, 3.0 + few])
    )
    expected = np.polyfit(distance[5 : 5 + few], height[5 : 5 + few], 1)[0]
    assert slopes[0] == pytest.approx(expected, rel=1e-9)
    assert np.isnan(slopes[1])
    middle, heights = profile_points.select_by_levels(
        np.array([0.0, 10.0, 20.0, 10.0, 20.0, 30.0]), 14.5, 16.5
    )
    assert heights.tolist() == [15.0, 16.0]
    np.testing.assert_allclose(middle, [0.5 * (1.5 + 3.5), 0.5 * (1.6 + 3.6)])
    section = MeasureSettings.with_defaults(
        fit_from="berry", fit_to=0.8, flank="rows", smallest_window=0.25
    )
    assert {name: line_of(section, name) for name in angles.DEFINITIONS} == {
        "flank": "flank, one grain to 80 % of the height, rows",
        "secant": "secant, foot to crest",
        "steepest": "steepest half or more of the flank, one grain to 80 % of the height, rows",
        "whole": "whole side, columns",
        "straightest": "straightest window, at least 0.25 of the side, columns",
    }
