"""Parameters on a logarithmic scale: each part against the same part of the logarithms.

The twin of every test takes the logarithm of the parameter by hand, on a linear scale.
"""

import warnings

import numpy as np
import pandas as pd
import pytest

import repose
from repose.calibrate import card
from repose.calibrate.bounds import describe_near_bound, find_near_bounds
from repose.calibrate.designs.latin_hypercube import (
    optimal_lhs,
    tabulate_parameter_sets,
)
from repose.calibrate.inversion import make_interval_table, restrict_to_free_parameters
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.parameter_types import describe_wide_ranges
from repose.calibrate.record import _compute_reference_sizes
from repose.calibrate.search.objective import Preference
from repose.calibrate.study_file import make_targets
from repose.calibrate.surrogates import load, make, wrap_for_scale
from repose.calibrate.surrogates.support import Support
from repose.calibrate.uncertainty.sensitivity import analyse_surrogate
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common.errors import InputError

LOW, HIGH = 1e-4, 1.0
SPACE = ParameterSpace.of(
    {
        "gamma": {"range": [LOW, HIGH], "scale": "log"},
        "mu": [0.1, 0.9],
        "e": {"fixed": 0.4},
    }
)
# The twin: the same parameter as its logarithm.
TWIN = ParameterSpace.of(
    {"gamma": [np.log(LOW), np.log(HIGH)], "mu": [0.1, 0.9], "e": {"fixed": 0.4}}
)
UNIT = np.random.default_rng(1).random((40, 2))
TARGETS = {"angle": (30.0, 0.6, 10)}
MEASURED = {"value": 1.0, "sd": 0.1, "repetitions": 3}


def logarithms(sets):
    """The parameter sets of TWIN: the first column as its logarithm."""
    return np.column_stack([np.log(sets[:, 0]), sets[:, 1:]])


def samples():
    sets = SPACE.values(UNIT)
    logarithm, mu = np.log10(sets[:, 0]), sets[:, 1]
    return sets, np.column_stack([3 * logarithm + mu, mu * mu - logarithm])


def test_the_unit_cube_is_even_in_the_logarithm_and_ends_at_the_ends():
    sets = SPACE.values(UNIT)
    assert np.log(sets[:, 0]) == pytest.approx(TWIN.values(UNIT)[:, 0])
    assert SPACE.unit(sets) == pytest.approx(UNIT)
    assert SPACE.fractions_of_range("gamma", sets[:, 0]) == pytest.approx(UNIT[:, 0])
    ends = SPACE.values(np.array([[0.0, 0.0], [1.0, 1.0]]))
    assert ends[:, 0].tolist() == pytest.approx([LOW, HIGH], rel=1e-12)
    assert np.clip(ends[:, 0], LOW, HIGH).tolist() == ends[:, 0].tolist()
    assert SPACE.centre == {"gamma": pytest.approx(1e-2), "mu": 0.5, "e": 0.4}


def test_without_a_scale_no_bit_changes():
    space = ParameterSpace.of(
        {"a": [0.1, 0.7], "mu": {"range": [0.1, 0.9], "scale": "linear"}}
    )
    assert space.scale == {}
    width = space.high - space.low
    assert (space.values(UNIT) == space.low + UNIT * width).all()
    sets = space.values(UNIT)
    assert (space.unit(sets) == (sets - space.low) / width).all()
    assert space.centre == {"a": 0.4, "mu": 0.5}


@pytest.mark.usefixtures("short_search")
def test_a_design_has_as_many_samples_in_each_decade():
    table = tabulate_parameter_sets(optimal_lhs(40, 2, 3), SPACE)
    decades = np.floor(np.log10(table["gamma"]))
    assert decades.value_counts().tolist() == [10] * 4


def test_a_normal_prior_is_one_of_the_value_whatever_the_scale():
    prior = {"prior": {"mean": 0.2, "sd": 0.1}, "range": [1e-2, 1.0]}
    linear = ParameterSpace.of({"gamma": prior})
    scaled = ParameterSpace.of({"gamma": {**prior, "scale": "log"}})
    values = np.linspace(0.01, 1.0, 200)[:, None]
    assert scaled.prior_cdf(scaled.unit(values)) == pytest.approx(
        linear.prior_cdf(linear.unit(values))
    )
    shares = np.linspace(0.001, 0.999, 50)[:, None]
    assert scaled.values(scaled.transform_to_prior(shares)) == pytest.approx(
        linear.values(linear.transform_to_prior(shares))
    )
    # The density in the unit cube is the slope of the distribution function.
    unit = np.linspace(0, 1, 20001)[:, None]
    slope = np.gradient(scaled.prior_cdf(unit)[:, 0], unit[:, 0])
    density = np.exp(scaled.log_prior(unit))
    assert density / density.max() == pytest.approx(slope / slope.max(), abs=1e-3)
    # The search prefers the same values.
    cost = Preference.from_priors(scaled)(2 * scaled.unit(values) - 1)
    assert cost == pytest.approx(
        Preference.from_priors(linear)(2 * linear.unit(values) - 1)
    )
    assert Preference.from_priors(scaled).largest == pytest.approx(cost.max())


@pytest.mark.parametrize(("entry", "allowed"), [
    ({"range": [1e-4, 1.0], "scale": "ln"}, "linear or log"),
    ({"range": [1e-4, 1.0], "scale": 10}, "linear or log"),
    ({"range": [0.0, 1.0], "scale": "log"}, "low above 0, where scale is log"),
    ({"prior": {"mean": 0.2, "sd": 0.1}, "scale": "log"}, "low above 0, where scale is log"),
    ({"scale": "log"}, "range with scale"),
    ({"range": [1.0, 1e-4], "scale": "log"}, "low < high"),
    ({"fixed": 0.2, "scale": "log"}, "fixed alone"),
    ({"range": [1e-4, 1.0], "skale": "log"}, "did you mean scale"),
])  # fmt: skip
def test_an_entry_that_is_wrong_is_named_with_what_is_allowed(entry, allowed):
    with pytest.raises(InputError, match="gamma") as raised:
        repose.Study({"gamma": entry, "mu": (0.1, 0.9)}, TARGETS)
    assert allowed in str(raised.value)


def test_a_range_of_more_than_two_decades_without_a_scale_gets_one_sentence():
    wide = {
        "gamma": [1e-4, 1.0], "modulus": [1e7, 1.1e9], "named": {"range": [1, 1e6], "scale": "log"},
        "kept": {"range": [1, 1e6], "scale": "linear"}, "mus": [0.01, 1.0], "mur": [0.0, 0.5],
        "e": {"fixed": 3.0}, "known": {"prior": {"mean": 3.0, "sd": 0.1}},
    }  # fmt: skip
    sentences = list(describe_wide_ranges(wide))
    assert [sentence.partition(":")[0] for sentence in sentences] == [
        "gamma",
        "modulus",
    ]
    assert "spans 4.0 decades" in sentences[0]
    assert "{range: [0.0001, 1], scale: log}" in sentences[0]
    assert not any("\n" in sentence for sentence in sentences)
    with pytest.warns(UserWarning, match="gamma: its range 0.0001 to 1 spans"):
        repose.Study({"gamma": (1e-4, 1.0)}, TARGETS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        repose.Study({"gamma": {"range": (1e-4, 1.0), "scale": "log"}}, TARGETS)


@pytest.mark.parametrize("kind", ["quadratic", "gaussian_process"])
def test_a_surrogate_learns_the_logarithm(kind, tmp_path):
    sets, Y = samples()
    model = wrap_for_scale(make(kind), SPACE.scale).describe(SPACE.names, ("a", "b"))
    model.fit(sets, Y)
    twin = make(kind).describe(SPACE.names, ("a", "b")).fit(logarithms(sets), Y)
    places = SPACE.values(np.random.default_rng(2).random((20, 2)))
    for result, other in zip(
        model.predict(places, return_std=True),
        twin.predict(logarithms(places), return_std=True),
        strict=True,
    ):
        assert (result == other).all()
    assert (model.covariance(places) == twin.covariance(logarithms(places))).all()
    shifted = model.shifted(np.array([1.0, 2.0])).predict(places)
    assert shifted - model.predict(places) == pytest.approx(
        np.tile([1.0, 2.0], (20, 1))
    )

    model.save(tmp_path / "model.json")
    again = load(tmp_path / "model.json")
    assert (again.scale, again.name) == ({"gamma": "log"}, kind)
    assert again.predict(places) == pytest.approx(model.predict(places))
    # The search works in the unit cube, whether or not the surrogate has a fast function.
    points = 2 * SPACE.unit(places) - 1
    assert restrict_to_free_parameters(model, SPACE)(points) == pytest.approx(
        model.predict(places)
    )
    assert restrict_to_free_parameters(twin, TWIN)(points) == pytest.approx(
        model.predict(places)
    )


def test_a_file_with_an_unknown_scale_is_refused(tmp_path):
    sets, Y = samples()
    model = wrap_for_scale(make("quadratic"), {"gamma": "log"})
    model.describe(SPACE.names, ("a", "b")).fit(sets, Y).save(tmp_path / "model.json")
    text = (tmp_path / "model.json").read_text().replace('"log"', '"cubic"')
    (tmp_path / "model.json").write_text(text)
    with pytest.raises(InputError, match="cubic"):
        load(tmp_path / "model.json")


def test_samples_cover_shares_of_the_range_along_the_scale():
    sets = SPACE.values(UNIT)
    support = Support.from_space(sets, SPACE)
    twin = Support.from_space(logarithms(sets), TWIN)
    places = SPACE.values(np.random.default_rng(2).random((50, 2)))
    assert support.distance(places) == pytest.approx(twin.distance(logarithms(places)))
    assert support.leverage(places) == pytest.approx(twin.leverage(logarithms(places)))
    assert support.make_warnings(np.array([[1.01e-4, 0.5, 0.4]]))[0].startswith(
        "at a bound: gamma low"
    )


def test_sensitivity_and_table_3_are_those_of_the_logarithm():
    sets, Y = samples()
    targets = make_targets({name: MEASURED for name in ("a", "b")})
    settings = SensitivitySettings(samples=1024, resamples=20, seed=1)
    model = wrap_for_scale(make("quadratic"), SPACE.scale).describe(
        SPACE.names, ("a", "b")
    )
    scaled = analyse_surrogate(model.fit(sets, Y), SPACE, targets, settings)
    twin_model = make("quadratic").describe(SPACE.names, ("a", "b"))
    twin = analyse_surrogate(
        twin_model.fit(logarithms(sets), Y), TWIN, targets, settings
    )
    pd.testing.assert_frame_equal(scaled.indices, twin.indices)
    is_gamma = scaled.effects["parameter"] == "gamma"
    values = np.log(scaled.effects.loc[is_gamma, "value"])
    assert values.to_numpy() == pytest.approx(twin.effects.loc[is_gamma, "value"])

    table = make_interval_table(pd.DataFrame(sets[:3], columns=SPACE.names), SPACE)
    twin_table = make_interval_table(
        pd.DataFrame(logarithms(sets[:3]), columns=TWIN.names), TWIN
    )
    assert table["dispersion_percent"].tolist() == pytest.approx(
        twin_table["dispersion_percent"].tolist()
    )
    assert table.loc[0, "high"] == sets[:3, 0].max()


class Plane:
    """A response with a known slope along the logarithm of gamma."""

    name = "plane"

    def predict(self, X, return_std=False, noise=True):
        return 2.0 * np.log(np.asarray(X)[:, :1])

    def covariance(self, X):
        return np.full((len(X), 1, 1), 0.25)


def test_a_bound_is_near_within_a_standard_error_of_the_logarithm():
    # The standard error of the logarithm is 0.5 / 2, a factor of 1.284.
    (near,) = find_near_bounds(Plane(), {"gamma": 1.2e-4, "mu": 0.5, "e": 0.4}, SPACE)
    assert near["bound"] == LOW
    assert near["factor"] == pytest.approx(np.exp(0.25))
    assert near["standard_error"] == pytest.approx(0.25 * 1.2e-4)
    assert "(a factor of 1.3) of its bound 0.0001" in describe_near_bound(near)
    assert not find_near_bounds(Plane(), {"gamma": 1.3e-4, "mu": 0.5, "e": 0.4}, SPACE)


def test_the_card_calls_a_value_at_the_bound_by_its_place_along_the_scale():
    # 1.5 times the lower end is far from it; on a linear scale it would lie at it.
    inside = card.make_interval_entry(
        SPACE, "gamma", value=1.5e-4, low=1.2e-4, high=2e-4
    )
    assert inside == {"low": 1.2e-4, "high": 2e-4}
    at_end = card.make_interval_entry(SPACE, "gamma", value=LOW, low=1.2e-4, high=2e-4)
    assert at_end == {"low": LOW, "high": 2e-4, "at_bound": "lower", "widened": True}


def test_the_accepted_rounding_is_that_of_the_logarithm():
    values = np.array([1e-4, 1e-2])
    width = np.log(HIGH / LOW)
    assert _compute_reference_sizes(SPACE, "gamma", values).tolist() == pytest.approx(
        (width * values).tolist()
    )
    assert _compute_reference_sizes(SPACE, "mu", values).tolist() == pytest.approx(
        [0.8, 0.8]
    )
    assert _compute_reference_sizes(SPACE, "e", values).tolist() == [0.4, 0.4]
