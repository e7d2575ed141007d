"""Targets, and the published solutions that a study can be set beside."""

import pytest
import shared

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.published import published_responses, to_simulate
from repose.core.responses import response
from repose.core.targets import Targets

SLIP = {"response": "drum_slip_deg", "apparatus": "drum", "value": 40.0, "sd": 1.0, "repetitions": 4}


def test_targets_give_names_and_numbers_in_their_order():
    targets = Targets.of([SLIP | {"range": [38, 42], "weight": 2.0}, *shared.TARGETS])
    assert targets.names == ("drum_slip_deg", "aor_deg", "height_mm")
    assert targets.predicted == ("drum_slip_predicted_deg", "aor_predicted_deg", "height_predicted_mm")
    assert targets.errors == ("drum_slip_se_deg", "aor_se_deg", "height_se_mm")
    assert targets.apparatus == ("drum", "funnel")
    assert targets.weight.tolist() == [2.0, 1.0, 1.0]
    assert targets.standard_error[0] == 0.5
    assert targets.aim.tolist() == [40.0, 32.87, 65.57]


def test_numbers_are_reported_with_units_and_with_names_where_units_are_alike():
    targets = Targets.of([*shared.TARGETS, SLIP | {"range": [38, 42]}])
    assert Targets(targets[:1]).in_words(["32.9"]) == "32.9 deg"
    assert Targets(targets[:2]).in_words(["32.9", "66"]) == "32.9 deg and 66 mm"
    assert targets.in_words(["32.9", "66", "40"]) == "AoR 32.9 deg, Height 66 mm and slip 40 deg"


def test_an_unknown_response_is_named_with_those_there_are():
    with pytest.raises(InputError, match=r"targets: response is 'colour'; expected one of aor_deg, "):
        Targets.of([SLIP | {"response": "colour", "range": [0, 1]}])


def test_published_solutions_count_where_they_have_a_target(tmp_path):
    path = tmp_path / "table4.csv"
    columns = ["solution", *PARAMETERS, "height_predicted_mm", "height_simulated_mm", "aor_simulated_deg"]
    path.write_text(",".join(columns) + "\n" + ",".join(["22"] + 9 * ["0.5"]) + "\n")
    height, angle = response("height_mm"), response("aor_deg")
    assert published_responses(columns, (angle, height)) == (height,)
    assert to_simulate(path, (angle, height)) == ["22"]
    assert to_simulate(path, (angle,)) == to_simulate(None, (height,)) == []
    path.write_text("solution,e_gg\n")
    with pytest.raises(InputError, match=r"table4\.csv: column mus_gg is 'missing'"):
        to_simulate(path, (height,))
