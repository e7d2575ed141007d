"""Curve over the discrepancy and the region that is not implausible, on responses with closed forms."""

import math

import numpy as np
import pandas as pd
import pytest
from shared import targets_of

from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.studies import discrepancy, implausibility
from repose.studies.likelihood import observation

SPACE = ParameterSpace.of({name: [0.0, 1.0] for name in PARAMETERS})


class Linear:
    """Responses that each follow one parameter, known without error."""

    def __init__(self, *slopes):
        self.slopes = np.array(slopes)

    def predict(self, X):
        return 40 + X[:, : len(self.slopes)] * self.slopes

    def covariance(self, X):
        return np.zeros((len(X), len(self.slopes), len(self.slopes)))


def observed(targets):
    """From a stated discrepancy to the observation; responses that rise together over the design."""
    runs = pd.DataFrame({"sample": [1, 2, 3]} | {name: [1.0, 2.0, 3.0] for name in targets.names})

    def of(percent, between=0.0):
        unknown = discrepancy.of_targets(targets, runs, percent, between)
        return observation(targets, np.eye(len(targets)), unknown)

    return of


def curve_of(model, targets, study=None):
    points = implausibility.Points(model, SPACE)
    return points, implausibility.curve(points, targets, observed(targets), study)


def test_bits_and_interval_of_a_linear_response_are_those_of_the_normal_distribution():
    targets = targets_of(height_mm=60.0)
    _, table = curve_of(Linear(40.0), targets)
    assert table["discrepancy_percent"].tolist() == list(implausibility.PERCENT)
    assert (np.diff(table["information_bits"]) < 0).all()
    for row in table.iloc[:3].itertuples():
        sd = math.hypot(targets.standard_error[0], row.discrepancy_percent / 100 * 60) / 40
        bits = -math.log2(sd * math.sqrt(2 * math.pi * math.e))
        assert row.information_bits == pytest.approx(bits, abs=0.01)
        first = PARAMETERS[0]
        assert getattr(row, f"{first}_low") == pytest.approx(0.5 - 1.96 * sd, abs=0.005)
        assert getattr(row, f"{first}_high") == pytest.approx(0.5 + 1.96 * sd, abs=0.005)
        assert getattr(row, f"{first}_bits") == pytest.approx(bits, abs=0.1)
        assert getattr(row, f"{PARAMETERS[1]}_bits") < 0.02


def test_a_correlated_discrepancy_leaves_the_contrast_of_two_responses_sharp():
    targets = targets_of(aor_deg=30.0, height_mm=60.0)
    _, table = curve_of(Linear(20.0, 40.0), targets)
    bits = table.pivot(index="discrepancy_percent", columns="discrepancy_correlation", values="information_bits")
    assert bits.loc[0.0, 0.0] == pytest.approx(bits.loc[0.0, 0.9])
    assert bits.loc[10.0, 0.9] > bits.loc[10.0, 0.0] + 0.5


def test_the_row_of_a_shape_study_is_that_of_the_same_discrepancy_stated():
    targets = targets_of(aor_deg=30.0, height_mm=60.0)
    _, table = curve_of(Linear(20.0, 40.0), targets, observed(targets)(5.0, 0.9))
    stated = table[(table["discrepancy_percent"] == 5.0) & (table["discrepancy_correlation"] == 0.9)].iloc[0]
    study = table.iloc[-1]
    assert (study["evidence"], stated["evidence"]) == ("shape study", "stated")
    assert study.drop("evidence").astype(float).to_numpy() == pytest.approx(
        stated.drop("evidence").astype(float).to_numpy()
    )
    assert "with the discrepancy of the shape study, 5 %:" in implausibility.message(table, 0.5)


def test_the_region_is_where_the_response_is_within_three_standard_deviations():
    targets = targets_of(height_mm=60.0)
    points = implausibility.Points(Linear(40.0), SPACE)
    mean, covariance = observed(targets)(2.0)
    implausible = implausibility.implausibility(points, mean, covariance)
    share, table = implausibility.region(points, implausible)
    half = 3 * math.sqrt(covariance[0, 0]) / 40
    assert share == pytest.approx(2 * half, abs=0.002)
    assert len(table) == 15 * implausibility.CELLS**2
    own = table[(table["x"] == PARAMETERS[0]) & (table["y"] == PARAMETERS[1])]
    far = (own["x_quantile"] - 0.5).abs() > half + 1 / implausibility.CELLS
    assert (own.loc[far, "share"] == 0).all()
    assert (own.loc[far, "least_implausibility"] > 3).all()
    others = table[(table["x"] == PARAMETERS[2]) & (table["y"] == PARAMETERS[3])]
    assert others["share"].to_numpy() == pytest.approx(share, abs=0.15)
    assert "not implausible" in implausibility.message(curve_of(Linear(40.0), targets)[1], share)
