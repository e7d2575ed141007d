"""The responses that a study of further responses tries."""

import pytest

from repose.measure import further_responses
from repose.measure.definitions import DEFINITIONS, MEAN_KEYS
from research.responses.offered import offered


@pytest.mark.parametrize("definition", DEFINITIONS)
def test_offered_are_all_definitions_but_the_calibrated_one(definition):
    found = offered(("aor_deg", "height_mm"), definition)
    others = [MEAN_KEYS[name] for name in DEFINITIONS if name != definition]
    assert list(found) == [*others, *further_responses.RESPONSE_NAMES, "discharge_s"]


@pytest.mark.parametrize(
    ("targets", "definition", "tried", "not_tried"),
    [
        # all definitions, and none of them twice under the name aor_deg
        (("height_mm",), "secant", {*MEAN_KEYS.values()}, {"height_mm", "aor_deg"}),
        (
            ("aor_deg", "aor_whole_deg", "packing_percent", "drum_slip_deg"),
            "flank",
            {"height_mm", "aor_secant_deg", "aor_steepest_deg"},
            {"aor_deg", "aor_whole_deg", "packing_percent"},
        ),
    ],
)
def test_offered_is_what_is_no_target(targets, definition, tried, not_tried):
    found = {*offered(targets, definition)}
    assert tried < found
    assert not not_tried & found
