"""More responses of a pile: on shapes with known numbers, and through the files of a job."""

import math

import numpy as np
import pytest

from repose.core.errors import NoFlankError
from repose.measure import further_responses
from repose.measure.angles import DEFINITIONS, MEAN_KEYS

MM_PER_PIXEL = 0.5


def cone(slope_deg, height_mm=60.0, foot_mm=10.0):
    """Silhouette of a cone: heights in pixels over columns."""
    half = height_mm / math.tan(math.radians(slope_deg)) / MM_PER_PIXEL
    columns = np.arange(math.ceil(2 * half) + 2 * round(foot_mm / MM_PER_PIXEL))
    middle = (len(columns) - 1) / 2
    return np.maximum(0, height_mm / MM_PER_PIXEL * (1 - np.abs(columns - middle) / half))


def test_cone_has_its_slope_everywhere_and_its_volume():
    angle, berry = 31.0, 12.0
    base = 60.0 / math.tan(math.radians(angle))
    volume = math.pi * base**2 * 60.0 / 3
    found = further_responses.of_profile([cone(angle)] * 3, MM_PER_PIXEL, 60.0, berry, 0.6 * volume)
    assert found["base_radius_mm"] == pytest.approx(base * (1 - berry / 60), abs=0.3)
    assert found["lower_deg"] == pytest.approx(angle, abs=0.3)
    assert found["upper_deg"] == pytest.approx(angle, abs=0.3)
    assert found["packing_percent"] == pytest.approx(60, abs=0.5)


def test_a_flank_that_bends_is_seen_by_the_two_slopes():
    profile = cone(31.0)
    hollow = profile**2 / profile.max()  # steep at the top, flat at the foot
    found = further_responses.of_profile([hollow], MM_PER_PIXEL, 60.0, 12.0, 1e5)
    # z = H (1 - r / R)^2
    base, half, upper = (60 / math.tan(math.radians(31)) * (1 - math.sqrt(z)) for z in (0.2, 0.5, 0.8))
    assert found["lower_deg"] == pytest.approx(math.degrees(math.atan(18 / (base - half))), abs=0.4)
    assert found["upper_deg"] == pytest.approx(math.degrees(math.atan(18 / (half - upper))), abs=0.8)
    assert found["upper_deg"] > found["lower_deg"] + 5


def test_width_is_the_mean_of_the_views_and_nothing_above_the_lower_one():
    wide, low = cone(31.0), cone(31.0, height_mm=20.0)
    level = np.array([10.0, 40.0])
    one = further_responses.mean_half_width([wide], MM_PER_PIXEL, level)
    both = further_responses.mean_half_width([wide, low], MM_PER_PIXEL, level)
    assert one == pytest.approx([50 / math.tan(math.radians(31)), 20 / math.tan(math.radians(31))], abs=0.3)
    assert both[1] == pytest.approx(one[1] / 2)
    with pytest.raises(NoFlankError, match=r"half of 20.0 mm is not above a berry, 12.0 mm"):
        further_responses.of_profile([low], MM_PER_PIXEL, 20.0, 12.0, 1.0)


def test_scatter_leaves_out_what_is_off_the_plate():
    """Berries at 1 to 100 mm, five of them loose; two that fell off do not count."""
    centres = np.zeros((102, 3))
    centres[:, 0] = 1e-3 * np.arange(1, 103)
    centres[:, 2] = 0.01
    centres[100] = (0.5, 0, 0.01)
    centres[101] = (0.05, 0, -0.2)
    pile = np.ones(102, bool)
    pile[95:] = False
    found = further_responses.of_scatter(centres, pile, 300.0)
    assert found["radius_90_mm"] == pytest.approx(np.quantile(np.arange(1, 101), 0.9))
    assert found["loose_percent"] == pytest.approx(5.0)
    with pytest.raises(NoFlankError, match="no berry"):
        further_responses.of_scatter(centres[101:], pile[101:], 300.0)


@pytest.mark.parametrize("definition", DEFINITIONS)
def test_offered_are_all_definitions_but_the_calibrated_one(definition):
    found = further_responses.offered(("aor_deg", "height_mm"), definition)
    others = [MEAN_KEYS[name] for name in DEFINITIONS if name != definition]
    assert list(found) == [*others, *further_responses.MEASURED, "discharge_s"]


def test_offered_is_what_is_no_target():
    alone = further_responses.offered(("height_mm",), "secant")
    assert "height_mm" not in alone
    assert set(MEAN_KEYS.values()) < set(alone)  # all definitions, and none of them twice under the name aor_deg
    assert "aor_deg" not in alone
    both = further_responses.offered(("aor_deg", "aor_whole_deg", "packing_percent", "drum_slip_deg"), "flank")
    assert both[:3] == ("height_mm", "aor_secant_deg", "aor_steepest_deg")
    assert "packing_percent" not in both
