"""Targets, their profiles, and the space of parameters."""

import numpy as np
import pytest
import shared
from refusals import input_error

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.profiles import Profile
from repose.calibrate.responses import response
from repose.calibrate.targets import Targets
from repose.stages.published import find_published_responses, list_sets_to_simulate

SLIP = shared.target("drum_slip_deg", 40.0, 1.0, 38, 42, 4)
X = np.sort(np.random.default_rng(1).uniform(-24.0, 20.0, 23))  # at no regular distance
RANGES = dict.fromkeys(PARAMETERS, (0.1, 0.4)) | {"mur_gp": (0.2, 0.3)}


def test_targets_give_names_and_numbers():
    targets = Targets.of([SLIP | {"weight": 2.0}, *shared.TARGETS])
    assert targets.names == ("drum_slip_deg", "aor_deg", "height_mm")
    assert targets.predicted == (
        "drum_slip_predicted_deg",
        "aor_predicted_deg",
        "height_predicted_mm",
    )
    assert targets.errors == ("drum_slip_se_deg", "aor_se_deg", "height_se_mm")
    assert targets.apparatus == ("drum", "funnel")
    assert targets.weight.tolist() == [2.0, 1.0, 1.0]
    assert targets.standard_error[0] == 0.5
    assert targets.aim.tolist() == [40.0, 32.87, 65.57]


def test_columns_of_a_response_have_their_meaning_before_the_unit():
    aor = response("aor_deg")
    assert aor.predicted == "aor_predicted_deg"
    assert aor.optimism == "aor_optimism_deg"
    assert aor.optimism_error == "aor_optimism_se_deg"
    assert aor.simulated == "aor_simulated_deg"
    assert aor.standard_error == "aor_se_deg"
    assert aor.deviation_percent == "aor_error_percent"


def test_targets_are_told_in_words():
    targets = Targets.of([*shared.TARGETS, SLIP])
    assert Targets(targets[:1]).format_with_units(["32.9"]) == "32.9 deg"
    assert (
        Targets(targets[:2]).format_with_units(["32.9", "66"]) == "32.9 deg and 66 mm"
    )
    assert (
        targets.format_with_units(["32.9", "66", "40"])
        == "AoR 32.9 deg, Height 66 mm and slip 40 deg"
    )
    message = r"targets: response is 'colour'; expected one of aor_deg, "
    input_error(message, Targets.of, [SLIP | {"response": "colour", "range": [0, 1]}])


def test_published_solutions_are_simulated_where_their_responses_are_stored(tmp_path):
    path = tmp_path / "table4.csv"
    columns = [
        "solution",
        *PARAMETERS,
        "height_predicted_mm",
        "height_simulated_mm",
        "aor_simulated_deg",
    ]
    path.write_text(",".join(columns) + "\n" + ",".join(["22"] + 9 * ["0.5"]) + "\n")
    height = response("height_mm")
    angle = response("aor_deg")
    assert find_published_responses(columns, (angle, height)) == (height,)
    assert list_sets_to_simulate(path, (angle, height)) == ["22"]
    assert (
        list_sets_to_simulate(path, (angle,))
        == list_sets_to_simulate(None, (height,))
        == []
    )
    path.write_text("solution,e_gg\n")
    input_error(
        r"table4\.csv: column mus_gg is 'missing'",
        list_sets_to_simulate,
        path,
        (height,),
    )


def profile_of(heights, functions=5):
    return Profile("surface_mm", tuple(X), tuple(heights), functions)


def test_distances_of_profiles_are_those_of_scores_named_with_their_unit():
    profile = profile_of(X)
    random = np.random.default_rng(2)
    first, second = random.normal(size=(2, 5))
    difference = profile.heights(first) - profile.heights(second)
    expected = np.sum((first - second) ** 2)
    assert np.mean(difference**2) == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(
        profile.scores(profile.heights(first)), first, atol=1e-12
    )
    # Parseval with the residual: mean square of all heights, of the scores, of the rest.
    heights = 20 * np.cos(X / 8)
    profile = profile_of(heights)
    rest = np.std(heights - profile.heights(profile.scores(heights)))
    assert np.mean(heights**2) == pytest.approx(profile.height**2 + rest**2, rel=1e-12)
    assert rest > 0.1
    cubic = 3 + X - 0.01 * X**2 + 1e-3 * X**3
    np.testing.assert_allclose(
        profile_of(cubic, functions=4).heights(
            profile_of(cubic, functions=4).scores(cubic)
        ),
        cubic,
        atol=1e-11,
    )
    mean, slope, *others = profile_of(2.0 - 0.8 * X).scores(2.0 - 0.8 * X)
    assert mean == pytest.approx(np.mean(2.0 - 0.8 * X))
    assert slope == pytest.approx(-0.8 * np.std(X))
    np.testing.assert_allclose(others, 0.0, atol=1e-12)
    profile = profile_of(2.0 - 0.8 * X)
    difference = profile.heights(0.01 * profile.whole * np.array([1, -1, 1, 1, -1]))
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(0.01 * profile.height)
    assert tuple(profile_of(X, functions=3).columns(X)) == (
        "surface_1_mm",
        "surface_2_mm",
        "surface_3_mm",
    )


def test_fixed_parameters_are_in_all_values():
    space = contact_space(RANGES | {"mus_gg": {"fixed": 0.55}})
    assert space.dimensions == 5
    unit = np.random.default_rng(1).uniform(size=(4, 5))
    values = space.values(unit)
    assert values[:, PARAMETERS.index("mus_gg")].tolist() == 4 * [0.55]
    np.testing.assert_allclose(space.unit(values), unit, atol=1e-12)
    assert space.centre["mus_gg"] == 0.55
    assert space.centre["mur_gp"] == 0.25


def test_the_range_of_a_prior():
    space = contact_space(RANGES | {"mus_gg": {"prior": {"mean": 0.05, "sd": 0.1}}})
    k = space.free.index("mus_gg")
    assert space.low[k] == pytest.approx(0.0)
    assert space.high[k] == pytest.approx(0.35)
    space = contact_space(
        RANGES | {"mus_gg": {"prior": {"mean": 0.3, "sd": 0.1}, "range": [0.2, 0.5]}}
    )
    assert space.low[k] == 0.2
    assert space.high[k] == 0.5
    unit = np.full((2, 6), 0.5)
    unit[0, k] = 1 / 3  # the mean
    np.testing.assert_allclose(space.log_prior(unit), [0.0, -0.5 * 0.25])
