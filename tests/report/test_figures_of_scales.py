"""Figures and the page of a study with a parameter on a logarithmic scale."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates import make, wrap_for_scale
from repose.config.pipeline import PipelineConfig
from repose.report.figures import panels, posterior, region
from repose.report.page import prediction
from repose.report.study_view import StudyView, compute_cell_edges

SPACE = ParameterSpace.of(
    {"gamma": {"range": [1e-4, 1.0], "scale": "log"}, "mu": [0.1, 0.9]}
)


def test_cells_are_equal_parts_of_the_logarithm():
    edges = compute_cell_edges(SPACE, "gamma", 4)
    assert edges == pytest.approx([1e-4, 1e-3, 1e-2, 1e-1, 1.0])
    assert (
        compute_cell_edges(SPACE, "mu", 4).tolist() == np.linspace(0.1, 0.9, 5).tolist()
    )
    assert region._compute_cell_edges(SPACE, 4)[0] == pytest.approx(edges)


def test_a_figure_has_the_parameters_of_its_tables_in_their_order():
    """The configuration may list the contact parameters in another order, and leave out the range of a prior."""
    entries = PipelineConfig.load("config/config.yaml").config["parameters"]
    entries["mus_gg"] = {"prior": {"mean": 0.1, "sd": 0.2}}
    content = {"parameters": dict(reversed(entries.items()))}
    study = PipelineConfig.load(overrides=content)
    view = StudyView(study.config | content)
    assert view.parameters.names == study.parameters.names
    assert view.parameters.low.tolist() == study.parameters.low.tolist()
    # another simulator may have parameters of these names, in the order of its user
    other = StudyView(content | {"simulator": {"name": "theirs"}})
    assert other.parameters.names == tuple(content["parameters"])


def test_axes_of_the_parameter_are_logarithmic_with_room_at_both_ends():
    figure = Figure()
    pairs = panels.add_pair_panels(figure, SPACE)
    panels.finish_pair_panels(pairs, SPACE, margin=0.25)
    for axes, across, _ in pairs:
        assert axes.get_xscale() == ("log" if across == "gamma" else "linear")
    assert pairs[0].axes.get_xlim() == pytest.approx((1e-5, 10.0))
    assert pairs[-1].axes.get_xlim() == pytest.approx((-0.1, 1.1))


def test_the_density_of_a_histogram_is_that_along_the_scale():
    # Draws even in the logarithm: each bar is as high as the uniform prior.
    gamma = np.exp(np.linspace(np.log(1e-4), 0, 2502)[1:-1])
    row = pd.Series({"information_bits": 0.0}, name="gamma")
    panel = Figure().subplots()
    posterior._draw_marginal(panel, pd.Series(gamma, name="gamma"), SPACE, row)
    heights = [bar.get_height() for bar in panel.patches]
    density = 1 / np.log(1e4)
    assert heights == pytest.approx([density] * posterior.N_BINS, rel=0.02)
    prior_values, prior = posterior._compute_prior_density(SPACE, "gamma")
    assert prior == pytest.approx(np.full(201, density))
    assert prior_values[100] == pytest.approx(1e-2)


def test_intervals_stand_at_their_place_along_the_scale():
    rows = []
    for name, low, high, ends in (
        ("gamma", 1e-4, 1.0, [1e-3, 1e-1]),
        ("mu", 0.1, 0.9, [0.3, 0.5]),
    ):
        rows.append({
            "parameter": name, "low": low, "high": high, "credible_low": ends[0], "credible_high": ends[1],
            "median": ends[0], "answer": ends[1], "width_ratio": 0.5, "information_bits": 1.0,
        })  # fmt: skip
    panel = Figure().subplots()
    posterior.draw_intervals(panel, pd.DataFrame(rows), SPACE)
    found = [line.get_xdata() for line in panel.lines if len(line.get_xdata()) == 2]
    assert found[0] == pytest.approx([0.25, 0.75])
    assert found[1] == pytest.approx([0.25, 0.5])


def test_the_page_has_curves_even_along_the_scale():
    random = np.random.default_rng(1)
    sets = SPACE.values(random.random((30, 2)))
    Y = np.column_stack([np.log10(sets[:, 0]) + sets[:, 1]])
    model = wrap_for_scale(make("quadratic"), SPACE.scale).describe(SPACE.names, ("y",))
    content = prediction.describe_surrogate(
        model.fit(sets, Y), SPACE, np.array([1e-2, 0.5])
    )
    curve = np.array(content["curves"]["gamma"]["mean"])[:, 0]
    assert curve == pytest.approx(np.linspace(-3.5, 0.5, prediction.CURVE_POINTS))
