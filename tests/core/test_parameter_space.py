"""The parameters that a study leaves open."""

import numpy as np
import pytest

from repose.core.errors import InputError
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS

RANGES = dict.fromkeys(PARAMETERS, (0.1, 0.4)) | {"mur_gp": (0.2, 0.3)}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"e_gg": (0.4, 0.1)}, "e_gg"),
        ({"e_gg": (0.2, 0.2)}, "e_gg"),
        ({"e_gp": (0.2, 1.5)}, "e_gp"),
        ({"mus_gg": (-0.1, 0.5)}, "mus_gg"),
        ({"mur_gg": (0.1, float("inf"))}, "mur_gg"),
        ({"mur_gp": (float("nan"), 0.5)}, "mur_gp"),
        ({"mur_gp": 0.5}, "mur_gp"),
        ({"mur_gp": ("a", "b")}, "mur_gp"),
        ({"mu_gp": (0.1, 0.5)}, r"mu_gp is \(0.1, 0.5\); expected one of e_gg, .*, mur_gp$"),
        ({"gamma_gg": (0.0, 0.1), "mu_gp": (0.1, 0.5)}, "expected one of e_gg, .*, mur_gp, gamma_gg$"),
        ({"e_gp": {"fixed": 1.5}}, r"my.yaml: e_gp.fixed is 1.5; expected 0.01 to 1"),
        ({"e_gp": {"prior": {"mean": 0.5}}}, "e_gp is"),
        ({name: {"fixed": 0.5} for name in PARAMETERS}, "at least one free parameter"),
    ],
)
def test_bad_ranges_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        ParameterSpace.of(RANGES | changes, "my.yaml").check_searchable("my.yaml")


def test_a_missing_range_is_refused():
    with pytest.raises(InputError, match="mur_gp"):
        ParameterSpace.of({name: RANGES[name] for name in PARAMETERS[:-1]})


def test_fixed_parameters_are_left_out_of_the_cube_and_put_back():
    space = ParameterSpace.of(RANGES | {"mus_gg": {"fixed": 0.55}})
    assert space.dimensions == 5
    unit = np.random.default_rng(1).uniform(size=(4, 5))
    values = space.values(unit)
    assert values[:, PARAMETERS.index("mus_gg")].tolist() == 4 * [0.55]
    np.testing.assert_allclose(space.unit(values), unit, atol=1e-12)
    assert space.centre["mus_gg"] == 0.55
    assert space.centre["mur_gp"] == 0.25


def test_a_prior_has_a_range_within_what_the_contact_law_takes():
    space = ParameterSpace.of(RANGES | {"mus_gg": {"prior": {"mean": 0.05, "sd": 0.1}}})
    k = space.free.index("mus_gg")
    assert (space.low[k], space.high[k]) == pytest.approx((0.0, 0.35))
    given = {"prior": {"mean": 0.3, "sd": 0.1}, "range": [0.2, 0.5]}
    space = ParameterSpace.of(RANGES | {"mus_gg": given})
    assert (space.low[k], space.high[k]) == (0.2, 0.5)
    unit = np.full((2, 6), 0.5)
    unit[0, k] = 1 / 3  # the mean
    np.testing.assert_allclose(space.log_prior(unit), [0.0, -0.5 * 0.25])
