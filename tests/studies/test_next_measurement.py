"""The next measurement: information of made-up responses with known variances."""

import numpy as np
import pandas as pd
import pytest

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.variance import variance_components
from repose.studies import next_measurement


def made_up(between, within, sets=16, runs=2, seed=0, response="turning_deg", mean=40.0):
    """Runs of a response whose sets differ by `between` and whose runs scatter by `within` (standard deviations)."""
    random = np.random.default_rng(seed)
    value = mean + np.repeat(between * random.normal(size=sets), runs) + within * random.normal(size=sets * runs)
    sample = np.repeat(np.arange(1, sets + 1), runs)
    return pd.DataFrame({"apparatus": "turning", "sample": sample, "response": response, "value": value})


@pytest.mark.parametrize(("between", "within", "percent"), [(1.0, 0.5, 0.0), (0.3, 1.0, 0.0), (1.0, 0.5, 2.0)])
def test_bits_of_known_variances(between, within, percent):
    known = 0.5 * np.log2(1 + between**2 / (within**2 / 10 + (percent / 100 * 40) ** 2))
    rows = [
        next_measurement.information(made_up(between, within, sets=64, seed=k), 10, percent).iloc[0] for k in range(100)
    ]
    bits = np.array([row.bits for row in rows])
    assert bits.mean() == pytest.approx(known, abs=3 * bits.std() / 10 + 0.02 * known)
    if not percent:  # the interval is exact without a discrepancy
        covered = np.mean([row.bits_low <= known <= row.bits_high for row in rows])
        assert covered == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 100))


def test_bits_with_a_discrepancy_by_hand():
    runs = made_up(1.0, 0.5)
    parts = variance_components(runs["value"], runs["sample"])
    ratio = parts.within * parts.icc / (1 - parts.icc) / (parts.within / 10 + (0.2 * parts.mean) ** 2)
    bits = next_measurement.information(runs, 10, 20.0)["bits"].iloc[0]
    assert bits == pytest.approx(0.5 * np.log2(1 + ratio), rel=1e-9)


def test_most_informative_first_and_what_says_nothing():
    table = next_measurement.information(
        pd.concat([made_up(0.0, 1.0, response="flow_g_s"), made_up(2.0, 0.5), made_up(0, 0, response="emptying_s")]),
        10,
        0.0,
    )
    assert list(table["response"]) == ["turning_deg", "flow_g_s"]  # a constant response is left out
    assert table["bits_low"].iloc[1] == 0.0


def test_too_few_runs():
    with pytest.raises(InputError, match="4 sets or more with two runs"):
        next_measurement.information(made_up(1.0, 1.0, sets=3), 10, 2.0)


def test_plausible_sets_are_draws(tmp_path):
    draws = pd.DataFrame(np.random.default_rng(1).random((50, 6)), columns=list(PARAMETERS))
    draws.to_csv(tmp_path / "draws.csv", index=False)
    samples = next_measurement.plausible_sets(tmp_path / "draws.csv", 3, tmp_path / "samples.csv")
    assert list(samples.columns) == ["sample", *PARAMETERS]
    assert len(samples) == next_measurement.SETS
    written = pd.read_csv(tmp_path / "samples.csv")
    for values in written[list(PARAMETERS)].to_numpy():
        assert np.isclose(draws.to_numpy(), values, rtol=1e-9).all(axis=1).sum() == 1
    draws[:3].to_csv(tmp_path / "draws.csv", index=False)
    with pytest.raises(InputError, match="rows is 3; expected 16 or more"):
        next_measurement.plausible_sets(tmp_path / "draws.csv", 3, tmp_path / "samples.csv")
