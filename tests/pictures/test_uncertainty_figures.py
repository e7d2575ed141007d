"""Figures of noise, posterior, sensitivity and refinement for one target and for four, with a fixed parameter."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.text import Text

from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.responses import derived
from repose.core.targets import Targets
from repose.pictures.figures import discrepancy, refinement, region, style, uncertainty
from repose.studies import implausibility, noise

NAMES = ("drum_slip_deg", "aor_deg", "height_mm", "base_radius_mm")
FREE = PARAMETERS[1:]


def config_of(count):
    """A configuration with a given number of targets; its first parameter is fixed, its second one has a prior."""
    target = {"value": 30.0, "sd": 2.0, "repetitions": 4, "range": [28.0, 32.0]}
    return {
        "targets": [{"response": name} | target for name in NAMES[:count]],
        "parameters": {name: [0.2, 0.6] for name in PARAMETERS}
        | {"e_gg": {"fixed": 0.3}, "mus_gg": {"prior": {"mean": 0.4, "sd": 0.05}, "range": [0.2, 0.6]}},
        "refine": {"tolerance_percent": 1.0, "standard_error_percent": 0.7},
    }


def write(folder, name, table):
    table.to_csv(folder / f"{name}.csv", index=False)
    return str(folder / f"{name}.csv")


def write_json(folder, name, content):
    (folder / f"{name}.json").write_text(json.dumps(content))
    return str(folder / f"{name}.json")


def drawn(function, inputs, config):
    """Number of panels that are shown, and all texts."""
    with style.applied():
        figure = function(inputs, config)
        figure.canvas.draw()
    texts = [text.get_text() for text in figure.findobj(Text)]
    return sum(panel.axison for panel in figure.axes), " | ".join(texts)


@pytest.mark.parametrize("count", [1, 4])
def test_noise(count, tmp_path):
    config, random = config_of(count), np.random.default_rng(1)
    runs = pd.DataFrame({"sample": np.repeat(np.arange(20), 4), "status": "ok"})
    runs = runs.assign(**{name: random.normal(30, 1, 80) for name in NAMES})
    found = noise.noise_floor(runs, Targets.of(config["targets"]))
    inputs = {"runs": write(tmp_path, "runs", runs), "seeds": write(tmp_path, "seeds", found.seeds)}
    inputs["noise"] = write_json(tmp_path, "noise", found.summary)
    panels, texts = drawn(uncertainty.noise_floor, inputs, config)
    assert panels == count + 2
    assert "slip (deg)" in texts


@pytest.mark.parametrize(("correlations", "study"), [((0.0,), False), ((0.0, 0.9), True)])
def test_the_curve_over_the_discrepancy(correlations, study, tmp_path):
    rows = [
        {
            "discrepancy_percent": p,
            "discrepancy_correlation": c,
            "evidence": "stated",
            "information_bits": 1 / (1 + p),
        }
        for c in correlations
        for p in (0.0, 5.0, 10.0)
    ]
    rows += [rows[-1] | {"discrepancy_percent": 13.0, "evidence": "shape study"}] * study
    points = [300.0] * study + [5000.0] * (len(rows) - study)
    ends = {f"{name}_{end}": value for name in FREE for end, value in (("low", 0.25), ("high", 0.55))}
    inputs = {
        "discrepancy": write(
            tmp_path, "discrepancy", pd.DataFrame(rows).assign(effective_points=points, **ends)
        )
    }
    panels, texts = drawn(discrepancy.over_the_discrepancy, inputs, config_of(2))
    assert panels == 1 + len(FREE)
    assert "assumed, independent between targets" in texts
    assert ("fewer than 400 effective points" in texts) == study
    assert ("assumed, correlation 0.9" in texts) == (len(correlations) > 1)
    assert style.parameter_label("e_gg") not in texts


def test_the_region_has_its_parameters_on_the_right_axes(tmp_path):
    config = config_of(1)
    space = ParameterSpace.of(config["parameters"])
    quantile = np.random.default_rng(1).random((20_000, space.dimensions))
    # what the first free parameter, with a prior, has below its median is excluded
    share, table = implausibility.region(
        SimpleNamespace(quantile=quantile), space, np.where(quantile[:, 0] < 0.5, 4.0, 1.0)
    )
    inputs = {"region": write(tmp_path, "region", table)}
    inputs["summary"] = write_json(tmp_path, "summary", {"not_implausible_share": share})
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


@pytest.mark.parametrize("count", [1, 4])
def test_corner_shows_free_parameters_alone(count, tmp_path):
    random = np.random.default_rng(1)
    draws = pd.DataFrame(random.uniform(0.2, 0.6, (200, 6)), columns=list(PARAMETERS)).assign(e_gg=0.3)
    table = pd.DataFrame({"parameter": FREE, "published_low": 0.3, "published_high": 0.4})
    summary = {"misfit": {"squared_distance": 1.0}, "thin_share": 0.1, "converged": True}
    summary |= {"largest_r_hat": 1.0, "least_effective_draws": 900.0}
    summary["predicted"] = {name: {"mean": 30.0, "low": 29.0, "high": 31.0} for name in NAMES[:count]}
    inputs = {"draws": write(tmp_path, "draws", draws), "feasible": write(tmp_path, "feasible", draws)}
    inputs["posterior"] = write(tmp_path, "posterior", table.assign(information_bits=0.5))
    inputs["summary"] = write_json(tmp_path, "summary", summary)
    panels, texts = drawn(uncertainty.corner, inputs, config_of(count))
    assert panels == 5 * 6 / 2
    assert texts.count("predicted") == count
    assert "uniform prior" not in texts
    assert style.parameter_label("e_gg") not in texts


@pytest.mark.parametrize("count", [1, 4])
def test_indices_and_main_effects(count, tmp_path):
    config, names = config_of(count), NAMES[:count]
    rows = [{"response": response, "parameter": name} for response in names for name in FREE]
    ends = {"first_low": 0.1, "first_high": 0.2, "total_low": 0.1, "total_high": 0.3}
    sobol = pd.DataFrame(rows).assign(first=0.15, total=0.2, **ends)
    effects = pd.concat(pd.DataFrame({"parameter": name, "value": [0.2, 0.4, 0.6]}) for name in FREE)
    effects = effects.assign(**dict.fromkeys(names, 30.0))
    dataset = pd.DataFrame(0.4, index=range(3), columns=[*PARAMETERS, *names]).assign(status="ok")
    inputs = {"sobol": write(tmp_path, "sobol", sobol)}
    panels, texts = drawn(uncertainty.sobol_indices, inputs, config)
    assert panels == count
    assert "first orders sum to 0.75" in texts
    inputs |= {"effects": write(tmp_path, "effects", effects), "dataset": write(tmp_path, "dataset", dataset)}
    labels = [panel.get_ylabel() for panel in uncertainty.main_effects(inputs, config).axes]
    assert [bool(label) for label in labels] == count * [True, False, False, False, False]
    panels, texts = drawn(uncertainty.main_effects, inputs, config)
    assert panels == 5 * count
    assert "slip (deg)" in texts


@pytest.mark.parametrize("count", [1, 3, 4])
def test_approach(count, tmp_path):
    rounds = pd.DataFrame({"round": [0, 1], "n_seeds": [8, 8], "outcome": "within"})
    values = {"target": 30.0, "predicted": 30.1, "simulated": [29.0, 30.2], "se": 0.2}
    columns = {derived(name, what): value for name in NAMES for what, value in values.items()}
    inputs = {"batches": write(tmp_path, "batches", rounds.assign(**columns))}
    panels, texts = drawn(refinement.approach, inputs, config_of(count))
    assert panels == 2 * count
    assert texts.count("target 30 ") == count
