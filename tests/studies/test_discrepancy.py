"""The covariance of the discrepancies: as stated, and as a shape study shows it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from shared import targets_of

from repose.config.study import Study
from repose.core.errors import InputError
from repose.studies import discrepancy

TARGETS = targets_of(aor_deg=30.0, height_mm=60.0)
OWN = {"slope": 30.0, "time": 4.0}


def design(*slopes):
    """Runs of ten samples along one line; each response follows it with its slope."""
    along = np.repeat(np.arange(10.0), 2)
    table = pd.DataFrame({"sample": along, "aor_deg": slopes[0] * along, "height_mm": slopes[1] * along})
    return table.assign(drum_slip_deg=along)


def combinations(folder, differences, errors=(0.0, 0.0), eligible=True, distance=1.0):
    """A table of a shape study with these differences (n, 2), each of a model of its own."""
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
    assert found[0, 1] / np.sqrt(found[0, 0] * found[1, 1]) == pytest.approx(
        12 / np.sqrt(raw[0, 0] * raw[1, 1]), abs=0.03
    )
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
    with pytest.raises(InputError, match="drum_slip_difference_deg"):
        discrepancy.of_shape_study(few, targets_of(drum_slip_deg=40.0))


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
    with pytest.raises(InputError, match=rf"row 3: {column} is .*{allowed}"):
        discrepancy.of_shape_study(path, TARGETS)


def test_the_study_of_the_configuration_is_the_published_one():
    root = Path(__file__).parents[2]
    published = root / "results" / "published" / "shape_study" / "combinations.csv"
    assert (root / "resources" / "shape_study.csv").read_bytes() == published.read_bytes()


def test_responses_of_a_simulator_that_only_its_user_knows_have_a_discrepancy():
    own = Study.own(
        {
            "simulator": "mine",
            "label": "own",
            "seed": 1,
            "parameters": {"friction": [0.2, 0.8]},
            "targets": {name: {"value": value, "sd": 1.0, "repetitions": 5} for name, value in OWN.items()},
        }
    ).targets
    runs = pd.DataFrame({"sample": [1, 2, 3], "slope": [29.0, 30.0, 31.0], "time": [3.0, 4.0, 5.0]})
    found = discrepancy.of_targets(own, runs, 10.0, 0.5)
    assert found == pytest.approx(np.array([[9.0, 0.5 * 3.0 * 0.4], [0.5 * 3.0 * 0.4, 0.16]]))
