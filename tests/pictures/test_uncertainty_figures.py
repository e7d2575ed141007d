"""Figures of noise, posterior, sensitivity and refinement for one target and for four, with a fixed parameter."""

from types import SimpleNamespace

import made_up_studies
import numpy as np
import pandas as pd
import pytest
from made_up import inputs_of, made_up_tables, words
from matplotlib.colors import to_hex
from shared import target

from repose.core.files import write_json
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.pictures import figures
from repose.pictures.figures import discrepancy, region, style
from repose.studies import implausibility

NAMES = ("drum_slip_deg", "aor_deg", "height_mm", "base_radius_mm")
FREE = PARAMETERS[1:4]
PARAMETERS_OF_A_STUDY = {name: [0.2, 0.6] if name in FREE else {"fixed": 0.3} for name in PARAMETERS}
PARAMETERS_OF_A_STUDY |= {"mus_gg": {"prior": {"mean": 0.4, "sd": 0.05}, "range": [0.2, 0.6]}}


def config_of(count):
    targets = [target(name, 30.0, 2.0, 28.0, 32.0, 4) for name in NAMES[:count]]
    refine = {"tolerance_percent": 1.0, "standard_error_percent": 0.7}
    return {"targets": targets, "parameters": PARAMETERS_OF_A_STUDY, "refine": refine}


@pytest.fixture
def files(tmp_path):
    def made(config):
        made_up_tables(tmp_path, config["targets"])
        made_up_studies.write(tmp_path, config)
        return {path.stem: path for path in tmp_path.iterdir()}

    return made


def drawn(figure):
    figure.canvas.draw()
    return sum(panel.axison for panel in figure.axes), words(figure)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_the_panels_are_those_of_targets_and_free_parameters(count, files):
    config = config_of(count)
    made = files(config)
    wanted = {
        "noise": (count + 2, "slip (deg)", None),
        "corner": (len(FREE) * (len(FREE) + 1) / 2, "predicted", count),
        "sobol": (count, f"first orders sum to {0.15 * len(FREE):.2f}", count),
        "main_effects": (len(FREE) * count, "slip (deg)", None),
        "approach": (2 * count, "target 30 ", count),
    }
    for name, (panels, part, times) in wanted.items():
        if count == 3 and name != "approach":  # which alone has a row for three
            continue
        with style.applied():
            found, text = drawn(figures.FIGURES[name][0](inputs_of(name, made), config))
        assert found == panels, name
        assert text.count(part) == times if times else part in text, name
        assert style.parameter_label("e_gg") not in text, name
        assert "uniform prior" not in text, name


def test_the_curve_over_the_discrepancy(files):
    inputs = {"discrepancy": files(config_of(2))["discrepancy"]}
    whole = pd.read_csv(inputs["discrepancy"])
    independent = whole[(whole["discrepancy_correlation"] == 0) & (whole["effective_points"] > 400)]
    for table, all_of_it in ((independent, False), (whole, True)):
        table.to_csv(inputs["discrepancy"], index=False)
        with style.applied():
            panels, text = drawn(discrepancy.over_the_discrepancy(inputs, config_of(2)))
        assert panels == 1 + len(FREE)
        assert "assumed, independent between targets" in text
        for part in ("fewer than 400 effective points", "assumed, correlation 0.9"):
            assert (part in text) == all_of_it, part
        assert style.parameter_label("e_gg") not in text


def test_the_region_has_its_parameters_on_the_right_axes(tmp_path):
    config = config_of(1)
    space = ParameterSpace.of(config["parameters"])
    quantile = np.random.default_rng(1).random((20_000, space.dimensions))
    # what the first free parameter, with a prior, has below its median is excluded
    excluded = np.where(quantile[:, 0] < 0.5, 4.0, 1.0)
    share, table = implausibility.region(SimpleNamespace(quantile=quantile, space=space), excluded)
    inputs = {"region": tmp_path / "region.csv", "summary": tmp_path / "summary.json"}
    table.to_csv(inputs["region"], index=False)
    write_json(inputs["summary"], {"not_implausible_share": share})
    figure = region.not_excluded(inputs, config)
    d = len(FREE)
    panels = np.array(figure.axes[: d * d]).reshape(d, d)
    assert sum(panel.axison for panel in panels.flat) == d * (d - 1)
    depth, least = (panels[place].collections[0] for place in ((0, 1), (1, 0)))
    rows, columns = depth.get_array(), least.get_array()
    half = implausibility.CELLS // 2
    assert (rows[:half] == 0).all()
    assert (rows[half:] == 1).all()
    assert (columns[:, :half] == 4).all()
    assert (columns[:, half:] == 1).all()
    colours = [to_hex(colour).upper() for colour in least.to_rgba(np.array([0.5, 1.5, 2.5, 4.0]))]
    assert len(set(colours)) == 4, "one band is not another"
    assert colours[-1] == style.RED, "excluded"
    # cells of equal probability: narrow about the middle of the prior
    widths = np.diff(least.get_coordinates()[0, :, 0])
    assert widths[half] < 0.3 * widths[0]
    assert widths.sum() == pytest.approx(0.4)
    assert np.asarray(np.diff(depth.get_coordinates()[0, :, 0])) == pytest.approx(0.4 / implausibility.CELLS)
