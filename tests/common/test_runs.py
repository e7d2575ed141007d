"""Runs: their seeds, their use, their variance."""

import math

import numpy as np
import pytest
from refusals import value_error
from scipy import stats
from shared import one_run, run_python, says

from repose.calibrate import variance
from repose.calibrate.runs import Recorded, name_error_column, summarise_runs

RECORDED = Recorded(
    ("aor_deg", "height_mm", "discharge_s"), ("discharge_s",), ("aor_deg", "berries")
)


def test_the_mean_has_its_error():
    summary = summarise_runs(
        [one_run(1, aor=20.0), one_run(2, aor=22.0), one_run(3, aor=27.0)], RECORDED
    )
    assert summary["status"] == "ok"
    assert summary["reason"] == ""
    assert summary["n_seeds"] == 3
    assert summary["aor_deg"] == pytest.approx(23.0)
    assert summary["aor_se_deg"] == pytest.approx(math.sqrt((9 + 1 + 16) / 2 / 3))
    assert summary["height_se_mm"] == 0.0
    assert summary["discharge_s"] == pytest.approx(17.0)


def test_the_reason_names_failed_runs_and_overlaps():
    deep = [one_run(1) | {"overlap_share": 0.12}, one_run(2, "jammed")]
    says(
        summarise_runs(deep, RECORDED)["reason"],
        "1 of 2 runs jammed",
        "bodies overlap by up to 12 %",
    )


def test_one_run_has_no_error():
    single = summarise_runs([one_run(1)], RECORDED)
    assert single["status"] == "ok"
    assert single["aor_deg"] == 22.0
    assert single["aor_se_deg"] is None
    value_error("at least one run", summarise_runs, [], RECORDED)


def test_the_targets_are_in_front():
    ours = RECORDED.put_targets_first(("discharge_s", "base_radius_mm"))
    further_columns = (
        "discharge_s",
        "discharge_se_s",
        "base_radius_mm",
        "base_radius_se_mm",
    )
    expected = (
        "status",
        "reason",
        "n_seeds",
        *further_columns,
        "aor_deg",
        "aor_se_deg",
        "height_mm",
        "height_se_mm",
    )
    assert ours.summary == expected
    assert ours.single == ("discharge_s", "base_radius_mm", "aor_deg", "berries")
    same = Recorded(
        RECORDED.means, RECORDED.without_error, ("aor_deg", "height_mm", "berries")
    )
    assert RECORDED.put_targets_first(("aor_deg", "height_mm")) == same
    assert name_error_column("packing_percent") == "packing_se_percent"


def test_a_summary_needs_no_pandas():
    run_python(
        "-c",
        "import sys; from repose.calibrate.runs import summarise_runs; sys.exit('pandas' in sys.modules)",
    )


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        (["ok", "jammed"], "ok"),
        (["ok", "jammed", "no_flank", "no_flank"], "no_flank"),
        (["jammed", "no_flank"], "jammed"),
        (["unstable"], "unstable"),
        (["ok", "ok", "jammed", "jammed"], "ok"),
    ],
)
def test_status_is_ok_from_half_on_and_else_the_commonest(statuses, expected):
    summary = summarise_runs(
        [one_run(k, status) for k, status in enumerate(statuses)], RECORDED
    )
    assert summary["status"] == expected
    assert (summary["aor_deg"] is None) is (expected != "ok")


def normal_model(random, sizes, tau, sigma, mean=30.0):
    """Values and groups of y_ij = mean + a_i + e_ij."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    return mean + (tau * random.normal(size=len(sizes)))[
        groups
    ] + sigma * random.normal(size=len(groups)), groups


def test_components_are_those_by_hand():
    """Three groups of 2, 2 and 3 values with the means 2, 6 and 5; the mean of all is 31 / 7."""
    values = [1, 3, 5, 7, 3, 5, 7]
    result = variance.variance_components(values, list("aabbccc"))
    squares = 2 * (2 - 31 / 7) ** 2 + 2 * (6 - 31 / 7) ** 2 + 3 * (5 - 31 / 7) ** 2
    between_square = squares / 2
    n0 = (7 - (4 + 4 + 9) / 7) / 2
    assert result.within == pytest.approx(3)
    assert result.between == pytest.approx((between_square - 3) / n0)
    assert result.harmonic_seeds == pytest.approx(3 / (1 / 2 + 1 / 2 + 1 / 3))
    assert result.n_groups == 3
    assert result.n_values == 7
    # the means' variance is 13 / 3; F quantiles with 2 and 4 degrees of freedom (TH78)
    h = result.harmonic_seeds
    least = (h * (13 / 3) / (3 * stats.f.ppf(0.975, 2, 4)) - 1) / h
    most = (h * (13 / 3) / (3 * stats.f.ppf(0.025, 2, 4)) - 1) / h
    # a share is not below 0
    assert least < 0
    assert result.icc_low == 0
    assert result.icc_high == pytest.approx(most / (1 + most))
    assert result.within_low == pytest.approx(12 / stats.chi2.ppf(0.975, 4))
    assert result.within_high == pytest.approx(12 / stats.chi2.ppf(0.025, 4))


def test_components_are_unbiased_and_covered_by_their_intervals():
    """400 draws of 40 groups with a variance of 4 between them and 2.25 within: the share between is 0.64."""
    random = np.random.default_rng(5)
    sizes = np.where(np.arange(40) % 3 == 0, 3, 8)
    found = [
        variance.variance_components(*normal_model(random, sizes, 2.0, 1.5))
        for _ in range(400)
    ]
    for name, true in (("within", 2.25), ("between", 4.0)):
        values = np.array([getattr(components, name) for components in found])
        assert values.mean() == pytest.approx(true, abs=4 * values.std() / 20)
    for name, true in (("icc", 0.64), ("within", 2.25)):
        inside = [
            getattr(result, f"{name}_low") <= true <= getattr(result, f"{name}_high")
            for result in found
        ]
        assert 0.91 < np.mean(inside) < 0.985  # 0.95 +- 3.3 standard errors of 400


def test_noise_alone_has_no_variance_between_samples():
    random = np.random.default_rng(2)
    values, groups = normal_model(random, [6] * 30, 0.0, 1.0)
    components = variance.variance_components(values, groups)
    assert components.icc_low == 0
    assert components.icc < 0.15


def test_seeds_reach_an_r2_and_an_error():
    # The true means of 4000 samples as predictions of means of k noisy seeds.
    random = np.random.default_rng(3)
    true = 2.0 * random.normal(size=4000)
    components = variance.Components(
        1, 1, 0.0, 2.25, 2.25, 2.25, 4.0, 0.64, 0.6, 0.7, 8.0
    )
    for seeds in (1, 4, 16):
        seen = true + 1.5 / np.sqrt(seeds) * random.normal(size=4000)
        reached = 1 - np.sum((seen - true) ** 2) / np.sum((seen - seen.mean()) ** 2)
        assert components.reachable_r2(seeds) == pytest.approx(reached, abs=0.02)
    assert components.seeds_for(0.5) == 9  # 1.5 / sqrt(9) exactly
    assert components.seeds_for(0.499) == 10
    assert components.seeds_for(5.0) == 1
    value_error("standard_error is 0", components.seeds_for, 0)


def test_residual_correlation():
    random = np.random.default_rng(4)
    groups = np.repeat(np.arange(200), 6)
    shift = 10 * random.normal(size=200)
    pair = random.multivariate_normal([0, 0], [[1, 0.5], [0.5, 1]], size=1200)
    shifted = pair[:, 0] + shift[groups], pair[:, 1] - shift[groups]
    value, low, high, freedom = variance.estimate_residual_correlation(*shifted, groups)
    assert freedom == 1000
    assert low < 0.5 < high
    expected = 2 * 1.96 * (1 - value**2) / np.sqrt(998)
    assert high - low == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("values", "groups", "message"),
    [
        ([1.0, 2.0], ["a", "b"], "2 values in 2 groups"),
        ([1.0, 2.0], ["a", "a"], "2 values in 1 groups"),
        ([1.0, np.nan], ["a", "a"], "finite"),
        ([1.0], ["a", "a"], r"shape \(1,\)"),
    ],
)
def test_bad_values_are_reported(values, groups, message):
    value_error(message, variance.variance_components, values, groups)
