"""What a published error is worth: the formulas beside drawn pours."""

import runpy
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from shared import ROOT

SCRIPT = ROOT / "examples" / "published_errors" / "published_errors.py"
OF = SimpleNamespace(**runpy.run_path(str(SCRIPT)))
RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("error", "scatter", "bias"), [(0.5, 2.1, 0.0), (1.0, 4.7, 0.0), (1.0, 2.0, 1.5)]
)
def test_the_probability_is_the_share_of_drawn_pours(error, scatter, bias):
    deviation = np.abs(RNG.normal(bias, scatter, 400_000))
    expected = (deviation <= error).mean()
    assert OF.within(error, scatter, bias) == pytest.approx(expected, abs=0.003)


def test_half_of_the_best_of_so_many_pours_are_within_the_error():
    for pours in (3, 10):
        best = np.abs(RNG.normal(0.0, 5.0, (100_000, pours))).min(axis=1)
        assert OF.tries(np.median(best), 5.0) == pytest.approx(pours, rel=0.03)


@pytest.mark.parametrize("scatter", [1.0, 2.1, 4.8])
def test_the_mean_of_the_needed_pours_is_within_the_claim_as_often_as_is_said(scatter):
    pours = OF.pours_needed(1.0, scatter)
    assert (
        np.abs(RNG.normal(0.0, scatter, (40_000, pours)).mean(axis=1)) <= 1.0
    ).mean() >= 0.895
    assert (
        np.abs(RNG.normal(0.0, scatter, (40_000, pours - 1)).mean(axis=1)) <= 1.0
    ).mean() < 0.905
    assert OF.pours_needed(1.0, 4.8) == 63


def test_the_scatter_of_errors_has_an_interval_that_holds_it_as_often_as_is_said():
    intervals = np.array(
        [OF.scatter_of(row)[1:] for row in RNG.normal(0.0, 2.0, (4_000, 8))]
    )
    held = (intervals[:, 0] <= 2.0) & (intervals[:, 1] >= 2.0)
    assert held.mean() == pytest.approx(0.95, abs=0.012)


def test_the_page_has_the_numbers_of_the_command():
    errors = pd.read_csv(OF.HERE / "errors.csv")
    scatters = OF.scatters()
    page = (OF.HERE / "README.md").read_text()
    assert len(errors) == 8
    for value in OF.by_error(errors, scatters).iloc[0]:
        assert f"{value:.2f}" in page
    for rig, value in scatters.items():
        assert f"{value:.1f}" in page, rig
        assert str(OF.pours_needed(1.0, value)) in page, rig
        assert f"{OF.tries(1.0, value):.1f}" in page, rig
    assert (
        "{:.2f} %, {:.2f} to {:.2f}".format(*OF.scatter_of(errors["error_percent"]))
        in page
    )
