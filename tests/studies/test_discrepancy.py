"""Discrepancy and implausibility."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from shared import targets_of

from repose.config.study import Study
from repose.core.errors import InputError
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.studies import discrepancy, implausibility
from repose.studies.likelihood import observation

TARGETS = targets_of(aor_deg=30.0, height_mm=60.0)
OWN = {"slope": 30.0, "time": 4.0}


def design(*slopes):
    """Runs of ten samples along one line; each response follows it with its slope."""
    along = np.repeat(np.arange(10.0), 2)
    table = pd.DataFrame({"sample": along, "aor_deg": slopes[0] * along, "height_mm": slopes[1] * along})
    return table.assign(drum_slip_deg=along)


def combinations(folder, differences, errors=(0.0, 0.0), eligible=True, distance=1.0):
    table = pd.DataFrame(differences, columns=["aor_difference_deg", "height_difference_mm"])
    table = table.assign(aor_se_deg=errors[0], height_se_mm=errors[1], eligible=eligible, distance=distance)
    table = table.assign(particle=range(len(table)), tension="keep", filling="open")
    table.to_csv(folder / "combinations.csv", index=False)
    return folder / "combinations.csv"


def test_a_stated_one_is_a_share_of_each_target_and_correlated_within_a_bench_test():
    targets = targets_of(aor_deg=30.0, height_mm=60.0, drum_slip_deg=40.0)
    found = discrepancy.of_targets(targets, design(1.0, 2.0), 10.0, 0.9)
    assert found == pytest.approx(np.array([[9, 16.2, 0], [16.2, 36, 0], [0, 0, 16]]))
    opposite = discrepancy.of_targets(targets, design(1.0, -2.0), 10.0, 0.9)
    assert opposite[0, 1] == pytest.approx(-16.2)


def test_that_of_a_shape_study_is_the_spread_of_its_plausible_models(tmp_path):
    """4000 models with a known covariance, measured with a known error; others are not plausible."""
    random = np.random.default_rng(1)
    known = np.array([[9.0, 12.0], [12.0, 25.0]])
    models = random.multivariate_normal([-3, 5], known, 4000) + random.normal(size=(4000, 2)) * [0.5, 2.0]
    far = random.normal(100, 50, (50, 2))
    path = combinations(tmp_path, np.vstack([models, far]), (0.5, 2.0), np.arange(4050) < 4000)
    result = discrepancy.of_shape_study(path, TARGETS)
    assert result.models == pytest.approx(4000)
    assert result.mean == pytest.approx([-3, 5], abs=0.2)
    found = result.covariance
    assert np.sqrt(np.diag(found)) == pytest.approx([3, 5], rel=0.05)
    raw = known + np.diag([0.25, 4.0])
    correlation = found[0, 1] / np.sqrt(found[0, 0] * found[1, 1])
    assert correlation == pytest.approx(12 / np.sqrt(raw[0, 0] * raw[1, 1]), abs=0.03)
    assert (discrepancy.of_targets(TARGETS, design(1, 1), 2.0, 0.0, found) == found).all()
    height = discrepancy.of_shape_study(path, targets_of(height_mm=60.0)).covariance
    assert height == pytest.approx(found[1:, 1:])


def test_a_model_counts_by_how_well_it_describes_the_piles(tmp_path):
    """Ten models at 0 and 2 near the piles, as many at 40 four standard deviations off; definitions count once."""
    values = np.repeat([0.0, 2.0, 40.0], [5, 5, 10])
    path = combinations(tmp_path, np.column_stack([values, values]), distance=np.repeat([0.0, 4.0], 10))
    result = discrepancy.of_shape_study(path, TARGETS)
    share = np.exp(-8.0)
    mean = (1 + 40 * share) / (1 + share)
    assert result.mean == pytest.approx([mean, mean])
    assert result.models == pytest.approx(10 * (1 + share) ** 2 / (1 + share**2))
    spread = (((0 - mean) ** 2 + (2 - mean) ** 2) / 2 + share * (40 - mean) ** 2) / (1 + share)
    assert result.covariance[0, 0] == pytest.approx(spread / (1 - 1 / result.models))
    table = pd.read_csv(path)
    twice = pd.concat([table, table])
    twice.to_csv(path, index=False)
    assert discrepancy.of_shape_study(path, TARGETS).models == pytest.approx(result.models)


def test_a_study_that_says_too_little_is_refused(tmp_path):
    few = combinations(tmp_path, np.ones((6, 2)), eligible=[True] * 4 + [False] * 2)
    with pytest.raises(InputError, match=r"combinations.csv: eligible is '4.0 models.*'; expected at least 5"):
        discrepancy.of_shape_study(few, TARGETS)
    input_error("drum_slip_difference_deg", discrepancy.of_shape_study, few, targets_of(drum_slip_deg=40.0))


@pytest.mark.parametrize(
    ("column", "value", "allowed"),
    [
        ("eligible", "yes", "True or False"),
        ("eligible", "", "True or False"),
        ("distance", "far", "a number from 0"),
        ("distance", -1.0, "a number from 0"),
        ("aor_se_deg", -1000.0, "a number from 0"),
        ("aor_difference_deg", "inf", "a finite number"),
        ("height_difference_mm", "much", "a finite number"),
    ],
)
def test_a_cell_that_cannot_be_is_refused_with_its_row(tmp_path, column, value, allowed):
    path = combinations(tmp_path, np.arange(40.0).reshape(20, 2))
    table = pd.read_csv(path, dtype=str)
    table.loc[2, column] = str(value)
    table.to_csv(path, index=False)
    input_error(rf"row 3: {column} is .*{allowed}", discrepancy.of_shape_study, path, TARGETS)


def test_the_study_of_the_configuration_is_the_published_one():
    root = Path(__file__).parents[2]
    published = root / "results" / "published" / "shape_study" / "combinations.csv"
    assert (root / "resources" / "shape_study.csv").read_bytes() == published.read_bytes()


def test_responses_of_a_simulator_that_only_its_user_knows_have_a_discrepancy():
    content = {"simulator": "mine", "label": "own", "seed": 1, "parameters": {"friction": [0.2, 0.8]}}
    content["targets"] = {name: {"value": value, "sd": 1.0, "repetitions": 5} for name, value in OWN.items()}
    own = Study.own(content).targets
    runs = pd.DataFrame({"sample": [1, 2, 3], "slope": [29.0, 30.0, 31.0], "time": [3.0, 4.0, 5.0]})
    found = discrepancy.of_targets(own, runs, 10.0, 0.5)
    assert found == pytest.approx(np.array([[9.0, 0.5 * 3.0 * 0.4], [0.5 * 3.0 * 0.4, 0.16]]))


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


def test_a_correlated_discrepancy_leaves_the_contrast_sharp_and_a_shape_study_is_that_stated():
    targets = targets_of(aor_deg=30.0, height_mm=60.0)
    _, table = curve_of(Linear(20.0, 40.0), targets)
    bits = table.pivot(index="discrepancy_percent", columns="discrepancy_correlation", values="information_bits")
    assert bits.loc[0.0, 0.0] == pytest.approx(bits.loc[0.0, 0.9])
    assert bits.loc[10.0, 0.9] > bits.loc[10.0, 0.0] + 0.5
    _, table = curve_of(Linear(20.0, 40.0), targets, observed(targets)(5.0, 0.9))
    stated = table[(table["discrepancy_percent"] == 5.0) & (table["discrepancy_correlation"] == 0.9)].iloc[0]
    study = table.iloc[-1]
    assert (study["evidence"], stated["evidence"]) == ("shape study", "stated")
    found, known = (row.drop("evidence").astype(float).to_numpy() for row in (study, stated))
    assert found == pytest.approx(known)
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
