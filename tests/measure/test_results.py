"""What the record of a measured pile has under each name."""

import numpy as np
import pytest

from repose.measure.definitions import DEFINITIONS
from repose.measure.results import PileResult

VIEWS_DEG = np.array([30.0, 32.0, np.nan, 34.0])
# The sides of the second view differ by exactly the limit, those of the last by more.
SIDES_DEG = np.array([[29.0, 31.0], [37.0, 27.0], [np.nan, np.nan], [28.9, 39.1]])


def test_a_record_has_means_over_the_views_and_the_first_view():
    """Each definition has its own angles here, so that no two can be exchanged."""
    result = PileResult(
        response="whole",
        height_mm=60.0,
        view_height_mm=np.array([59.0, 61.0, 58.0, 62.0]),
        aor={name: VIEWS_DEG + k for k, name in enumerate(DEFINITIONS)},
        sides_deg=SIDES_DEG,
        reasons={},
    )
    record = result.record()
    assert record["height_mm"] == 60.0
    assert record["height_view_mm"] == 59.0
    for k, name in enumerate(DEFINITIONS):
        assert record[f"aor_{name}_deg"] == pytest.approx(32.0 + k)
        assert record[f"aor_{name}_view_deg"] == pytest.approx(30.0 + k)
    assert record["aor_deg"] == record["aor_whole_deg"]
    assert record["measured_views"] == 3
    assert record["doubtful_views"] == 1


def test_an_angle_without_half_of_its_views_is_none():
    few = np.array([30.0, np.nan, np.nan, np.nan])
    result = PileResult(
        response="flank",
        height_mm=60.0,
        view_height_mm=np.full(4, 59.0),
        aor=dict.fromkeys(DEFINITIONS, VIEWS_DEG) | {"flank": few},
        sides_deg=np.full((4, 2), np.nan),
        reasons={},
    )
    record = result.record()
    assert record["aor_deg"] is None
    assert record["aor_flank_view_deg"] == 30.0
    assert record["aor_secant_deg"] == pytest.approx(32.0)
