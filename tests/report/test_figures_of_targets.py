"""Figures of targets and of their uncertainty."""

import json
from types import SimpleNamespace

import made_up_studies
import numpy as np
import pandas as pd
import pytest
from made_up import inputs_of, made_up_tables, texts_of
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex
from refusals import raised
from shared import RANGES, TARGETS, target

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.profiles import Profile
from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty import implausibility
from repose.common.files import write_json
from repose.report import figures
from repose.report.figures import posterior, style
from repose.stages.published import STALE_WARNING

FURTHER = [
    target("base_radius_mm", 110.0, 6.0, 100.0, 120.0),
    target("drum_slip_deg", 44.0, 2.0, 40.0, 48.0, 5),
]
CHOICES = {1: TARGETS[:1], 2: TARGETS, 4: [*TARGETS, *FURTHER]}


def config_of(count, **changes):
    base = {"targets": CHOICES[count], "parameters": RANGES, "small_run": False}
    return base | {"design": {"method": "optimal", "seed": 1}} | changes


def draw(name, inputs, config):
    """A figure by its name, with its ticks, and its texts; test_figures.py lays out and saves every figure."""
    with style.applied():
        figure = figures.FIGURES[name].draw(inputs, config)
        figure.set_layout_engine("none")
        figure.draw_without_rendering()
    return figure, texts_of(figure).split(" | ")


def made_up(folder, count, feasible=True):
    files = made_up_tables(folder, CHOICES[count])
    pd.read_csv(files["feasible"]).assign(feasible=feasible).to_csv(
        files["feasible"], index=False
    )
    return files


@pytest.mark.parametrize(
    ("count", "panels", "feasible"), [(2, 2, True), (2, 2, False), (4, 12, True)]
)
def test_the_planes_of_the_targets_show_samples_ranges_and_answer(
    count, panels, feasible, tmp_path
):
    files = made_up(tmp_path, count, feasible)
    inputs = {key: files[key] for key in ("dataset", "table4", "feasible")}
    figure, result = draw(
        "plane", inputs | {"pool": files["dataset"]}, config_of(count)
    )
    assert len(figure.axes) == panels
    assert "147 parameter sets of the design, simulated" in result  # three failed
    assert "147 further sets, simulated" in result
    assert any("± 1 standard error" in text for text in result)
    first = TARGETS[0]
    label = f"measured ± standard error of {first['repetitions']} repetitions"
    (measured,) = [
        bars for bars in figure.axes[0].containers if bars.get_label() == label
    ]
    across = measured.lines[2][0].get_segments()[0][:, 0]
    error = first["sd"] / np.sqrt(first["repetitions"])
    np.testing.assert_allclose(across, [first["value"] - error, first["value"] + error])
    infeasible_label = "90 nearest solutions, none feasible, predicted"
    assert (infeasible_label in result) is not feasible
    assert ("90 feasible solutions, predicted" in result) is feasible
    # All solutions are drawn, above every mark that could hide them.
    for panel in figure.axes:
        (solutions,) = [line for line in panel.lines if "solutions" in line.get_label()]
        assert len(solutions.get_xdata()) == len(pd.read_csv(files["feasible"]))
        others = [line for line in panel.lines if line is not solutions]
        assert solutions.zorder > max(line.zorder for line in others)
    (box,) = figure.axes[0].patches
    assert box.get_x() == first["range"][0]
    assert box.get_width() == np.diff(first["range"])[0]


X = list(range(-20, 21, 5))
HEIGHTS = [0.9 * x + 0.01 * x * x for x in X]


def of_profile(targets):
    """The targets, and those of a profile's scores as the configuration has them."""
    name = "turning_profile_mm"
    kept = {"name": name, "x": X, "z": HEIGHTS, "functions": 3, "covered": 0.5}
    numbers = {"apparatus": "turning", "sd": 0.3, "repetitions": 3, "profile": kept}
    values = zip(
        Profile.of(kept).names, Profile.of(kept).scores(HEIGHTS).tolist(), strict=True
    )
    scores = [
        {"response": name, "value": value, "range": [value - 1, value + 1]}
        for name, value in values
    ]
    return [*targets, *(score | numbers for score in scores)]


OF_FOUR = ("aor_deg", "height_mm", "packing_percent", "drum_slip_deg")
SETS = (("height_mm",), OF_FOUR, (*OF_FOUR, "upper_deg"))


@pytest.mark.parametrize("names", SETS)
def test_solutions_have_a_strip_for_each_target(names, tmp_path, monkeypatch):
    """For one, for four, and for more than stand in a row."""
    known = {"value": 50.0, "sd": 2.0, "repetitions": 4, "range": [48.0, 52.0]}
    monkeypatch.setitem(
        CHOICES, len(names), [{"response": name} | known for name in names]
    )
    config = config_of(len(names), parameters=RANGES | {"mus_gp": {"fixed": 0.5}})
    inputs = {
        "feasible": made_up(tmp_path, len(names))["feasible"],
        "summary": tmp_path / "s.json",
    }
    inputs["summary"].write_text(json.dumps({"feasible": True}))
    figure, result = draw("figure14", inputs, config)
    assert len(figure.axes) == 1
    # the fixed parameter has no strip
    assert len(figure.axes[0].get_yticklabels()) == 5
    assert "90 feasible solutions" in result


def test_figure_14_counts_the_published_intervals_that_are_reached(
    tmp_path, monkeypatch
):
    files = made_up(tmp_path, 2)
    solutions = pd.read_csv(files["feasible"])
    config = config_of(2)
    rows = []
    for k, name in enumerate(RANGES):
        low = solutions[name].min()
        high = solutions[name].max()
        # two intervals lie beside the solutions
        ends = (low, high) if k > 1 else (high + 0.01, high + 0.02)
        rows.append((name, *ends))
    pd.DataFrame(rows, columns=["parameter", "low", "high"]).to_csv(
        tmp_path / "table3.csv", index=False
    )
    (tmp_path / "s.json").write_text(json.dumps({"feasible": True}))
    inputs = {
        "feasible": files["feasible"],
        "summary": tmp_path / "s.json",
        "published": tmp_path / "table3.csv",
    }
    _, result = draw("figure14", inputs, config)
    text = " ".join(result).replace("\n", " ")
    assert (
        "90 feasible solutions; they overlap the published intervals of 4 of 6" in text
    )


DRAWN = {
    "figure10": ("network",),
    "figure13": ("predictions", "dataset"),
    "dataset": ("dataset",),
    "validation": ("table4",),
    "published": ("published",),
}


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_names_each_target_by_its_symbol_and_unit(name, count, tmp_path):
    files = made_up(tmp_path, count)
    config = config_of(count)
    # this figure has a panel for each free parameter and target; two parameters are enough
    if name == "dataset":
        fixed = {parameter: {"fixed": 0.3} for parameter in PARAMETERS[2:]}
        config["parameters"] = RANGES | fixed
    _, result = draw(name, {key: files[key] for key in DRAWN[name]}, config)
    for drawn in Targets.of(CHOICES[count]).responses:
        label = drawn.symbol if name == "figure10" else f"({drawn.unit})"
        has_label = [drawn.symbol in text and label in text for text in result]
        assert any(has_label), drawn.name
    assert any("slip" in text for text in result) == (count == 4)


def test_published_solutions_are_named_where_numbers_are_missing(tmp_path):
    files = made_up(tmp_path, 2)
    config = config_of(2)
    column = name_derived_column("aor_deg", "published_simulated")
    table = pd.read_csv(files["published"])

    def result_of(table):
        table.to_csv(files["published"], index=False)
        return draw("published", {"published": files["published"]}, config)[1]

    result = result_of(table.assign(**{column: [table[column][0], *5 * [np.nan]]}))
    assert result.count("not\npublished") == 5
    # both panels name the sets
    names = dict.fromkeys(text for text in result if text.startswith("P"))
    assert list(names) == ["P\n(answer)", "P2", "P15", "P22", "P56", "P84"]
    assert {
        "target range",
        "measured mean ± standard error",
        "published simulation",
    } <= set(result)


def test_stale_numbers_are_called_so(tmp_path):
    files = made_up(tmp_path, 2)
    config = config_of(2)
    table = pd.read_csv(files["published"])

    def result_of(table):
        table.to_csv(files["published"], index=False)
        return draw("published", {"published": files["published"]}, config)[1]

    simulated = name_derived_column("aor_deg", "published_simulated")
    measured = name_derived_column("aor_deg", "published_measured")
    table[simulated] = [*5 * [32.0], np.nan]
    table[measured] = [*5 * [np.nan], 31.27]
    for stale in (False, True):
        result = result_of(table.assign(stale=[*5 * [False], stale]))
        assert "published measurement" in result
        assert "not\npublished" not in result
        assert (STALE_WARNING in result) == stale
    # the stored table may lack a response
    result = result_of(table.drop(columns="height_simulated_mm"))
    assert any("AoR" in text for text in result)
    assert not any("Height" in text for text in result)


def test_a_target_that_was_not_published_is_drawn(tmp_path):
    files = made_up(tmp_path, 4)
    inputs = {"table4": files["table4"], "published": files["theirs"]}
    _, result = draw("validation", inputs, config_of(4))
    assert result.count("not published") == 2
    assert "published" in result
    alone = config_of(4, targets=FURTHER)
    figure, result = draw("validation", inputs, alone)
    assert "not published" not in result
    assert len(figure.axes) == 2
    for config, has_published in ((config_of(4), True), (alone, False)):
        assert (
            "published simulation"
            in draw("published", {"published": files["published"]}, config)[1]
        ) is has_published


def test_a_profile_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setitem(CHOICES, 5, of_profile(TARGETS))
    files = made_up(tmp_path, 5)
    figure, result = draw("profiles", {"table4": files["table4"]}, config_of(5))
    (panel,) = figure.axes
    assert {"measured ± SD", "predicted", "simulated ± SE"} <= set(result)
    predicted = next(line for line in panel.lines if line.get_label() == "predicted")
    # the made-up prediction is the target, a parabola that three scores describe
    np.testing.assert_allclose(predicted.get_ydata(), HEIGHTS, atol=1e-9)
    inputs = {key: files[key] for key in ("dataset", "table4", "feasible")}
    # scores have no planes
    assert len(draw("plane", inputs, config_of(5))[0].axes) == 2


def test_fixed_parameters_have_no_panel_priors_are_the_axis_and_unknown_outputs_are_named(
    tmp_path,
):
    files = made_up(tmp_path, 2)
    config = config_of(
        2, parameters=RANGES | {name: {"fixed": 0.3} for name in PARAMETERS[2:]}
    )
    fewer = config | {"parameters": config["parameters"] | {"mus_gg": {"fixed": 0.5}}}
    for name, some, panels in (
        ("dataset", config, 4),
        ("design", config, 4),
        ("design", fewer, 1),
    ):
        assert (
            len(
                draw(name, {key: files[key] for key in ("samples", "dataset")}, some)[
                    0
                ].axes
            )
            == panels
        )
    files = made_up(tmp_path, 1)
    prior = {"e_gg": {"prior": {"mean": 0.25, "sd": 0.02}}}
    figure, _ = draw("dataset", files, config_of(1, parameters=RANGES | prior))
    assert figure.axes[0].get_xlim() == pytest.approx((0.19, 0.31))
    files["network"].write_text(
        json.dumps(
            json.loads(files["network"].read_text()) | {"outputs": ["colour_deg"]}
        )
    )
    raised(Exception, "colour_deg", draw, "figure10", files, config_of(1))


NAMES = ("drum_slip_deg", "aor_deg", "height_mm", "base_radius_mm")
FREE = PARAMETERS[1:4]
PARAMETERS_OF_A_STUDY = {
    name: [0.2, 0.6] if name in FREE else {"fixed": 0.3} for name in PARAMETERS
}
PARAMETERS_OF_A_STUDY |= {
    "mus_gg": {"prior": {"mean": 0.4, "sd": 0.05}, "range": [0.2, 0.6]}
}


def uncertain_config(count):
    targets = [target(name, 30.0, 2.0, 28.0, 32.0, 4) for name in NAMES[:count]]
    return {"targets": targets, "parameters": PARAMETERS_OF_A_STUDY}


def uncertain(folder, count):
    config = uncertain_config(count)
    made_up_tables(folder, config["targets"])
    made_up_studies.write(folder, config)
    return config, {path.stem: path for path in folder.iterdir()}


@pytest.mark.parametrize("count", [1, 4])
def test_the_panels_are_those_of_targets_and_free_parameters(count, tmp_path):
    config, made = uncertain(tmp_path, count)
    # panels, a text, and how often it is there (None: at least once); the corner also has a scale of colours
    expected = {
        "noise": (count + 2, "slip (deg)", None),
        "corner": (len(FREE) * (len(FREE) + 1) / 2 + 1, "predicted", count),
        "sobol": (count, f"first-order indices sum to {0.15 * len(FREE):.2f}", count),
        "main_effects": (len(FREE) * count, "slip (deg)", None),
    }
    for name, (panels, part, times) in expected.items():
        figure, result = draw(name, inputs_of(name, made), config)
        text = " | ".join(result)
        assert sum(panel.axison for panel in figure.axes) == panels, name
        if times is None:
            assert part in text, name
        else:
            assert text.count(part) == times, name
        assert style.parameter_label("e_gg") not in text, name
        assert "uniform prior" not in text, name


def test_published_sets_are_marked_in_the_posterior_and_those_of_another_wall_by_their_own_grains(
    tmp_path,
):
    config, made = uncertain(tmp_path, 2)
    sets = pd.DataFrame(
        {"source": ["A, 2026", "A, 2026", "B, 2022"], "wall": ["", "", "steel"]}
    )
    for k, name in enumerate(PARAMETERS_OF_A_STUDY):
        sets[name] = [0.1 + 0.01 * k, 0.12 + 0.01 * k, 0.3]
    sets.to_csv(made["published"], index=False)
    figure, _ = draw("corner", inputs_of("corner", made), config)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][-2:] == [
        "A",
        "B (wall: steel)",
    ]
    # marks of published sets have the size 22; by the number of sets in a panel
    marks = {1: [], 2: []}
    for panel in figure.axes:
        for points in panel.findobj(PathCollection):
            if points.get_sizes().tolist() == [22]:
                places = np.asarray(points.get_offsets())
                # A legend's handle has no place.
                if len(places):
                    marks[len(places)].append(places)
    # A has both sets in each pair of parameters
    assert len(marks[2]) == len(FREE) * (len(FREE) - 1) / 2
    values = [sets[name][:2].tolist() for name in FREE]
    for places in marks[2]:
        assert any(np.allclose(places[:, 0], value) for value in values)
    # B shares only the parameters between grains
    grains = [name for name in FREE if name.endswith("_gg")]
    assert len(marks[1]) == len(grains) * (len(grains) - 1) / 2
    for places in marks[1]:
        assert np.allclose(places, 0.3)


def test_the_curve_over_the_discrepancy(tmp_path):
    config, inputs = uncertain(tmp_path, 2)
    whole = pd.read_csv(inputs["discrepancy"])
    independent = whole[
        (whole["discrepancy_correlation"] == 0) & (whole["effective_points"] > 400)
    ]
    for table, all_of_it in ((independent, False), (whole, True)):
        table.to_csv(inputs["discrepancy"], index=False)
        figure, result = draw("discrepancy", inputs, config)
        text = " | ".join(result)
        assert sum(panel.axison for panel in figure.axes) == 1 + len(FREE)
        assert "assumed, independent between targets" in text
        (spread,) = (
            line
            for line in figure.axes[0].lines
            if line.get_label().startswith("spread of the shape")
        )
        assert spread.get_xydata().tolist() == [[13.0, 3.0 / 14.0]] * all_of_it
        for part in ("fewer than 400 effective points", "assumed, correlation 0.9"):
            assert (part in text) == all_of_it, part
        assert style.parameter_label("e_gg") not in text


def test_the_region_has_its_parameters_on_the_right_axes(tmp_path):
    config = uncertain_config(1)
    space = contact_space(config["parameters"])
    quantile = np.random.default_rng(1).random((20_000, space.dimensions))
    # what the first free parameter, with a prior, has below its median is excluded
    excluded = np.where(quantile[:, 0] < 0.5, 4.0, 1.0)
    share, table = implausibility.find_region(
        SimpleNamespace(quantiles=quantile, space=space), excluded
    )
    middles = (np.arange(implausibility.N_CELLS) + 0.5) / implausibility.N_CELLS
    np.testing.assert_allclose(
        [sorted(set(table[f"{axis}_quantile"])) for axis in "xy"], [middles, middles]
    )
    inputs = {"region": tmp_path / "region.csv", "summary": tmp_path / "summary.json"}
    table.to_csv(inputs["region"], index=False)
    write_json(inputs["summary"], {"not_implausible_share": share})
    figure = figures.FIGURES["region"].draw(inputs, config)
    d = len(FREE)
    panels = np.array(figure.axes[: d * d]).reshape(d, d)
    assert sum(panel.axison for panel in panels.flat) == d * (d - 1)
    # the first parameter is on the vertical axis above the diagonal, on the horizontal one below it
    depth = panels[0, 1].collections[0]
    least = panels[1, 0].collections[0]
    cells = (implausibility.N_CELLS, implausibility.N_CELLS)
    half = implausibility.N_CELLS // 2
    below = np.arange(implausibility.N_CELLS) < half
    expected = np.broadcast_to(np.where(below, 0, 1)[:, None], cells)
    np.testing.assert_array_equal(depth.get_array(), expected)
    expected = np.broadcast_to(np.where(below, 4, 1), cells)
    np.testing.assert_array_equal(least.get_array(), expected)
    colours = [
        to_hex(colour).upper()
        for colour in least.to_rgba(np.array([0.5, 1.5, 2.5, 4.0]))
    ]
    assert len(set(colours)) == 4, "one band is not another"
    assert colours[-1] == style.RED, "excluded"
    # cells of equal probability: narrow about the middle of the prior
    widths = np.diff(least.get_coordinates()[0, :, 0])
    assert widths[half] < 0.3 * widths[0]
    assert widths.sum() == pytest.approx(0.4)
    assert np.asarray(np.diff(depth.get_coordinates()[0, :, 0])) == pytest.approx(
        0.4 / implausibility.N_CELLS
    )


def test_without_an_excluded_cell_the_region_shows_shares_alone(tmp_path):
    config = uncertain_config(1)
    space = contact_space(config["parameters"])
    made_up_studies._region(tmp_path, space)
    inputs = {"region": tmp_path / "region.csv", "summary": tmp_path / "summary.json"}
    write_json(inputs["summary"], {"not_implausible_share": 0.9})
    figure = figures.FIGURES["region"].draw(inputs, config)
    d = len(FREE)
    panels = np.array(figure.axes[: d * d]).reshape(d, d)
    shown = [
        (row, column) for row, column in np.ndindex(d, d) if panels[row, column].axison
    ]
    assert shown == [(row, column) for row, column in np.ndindex(d, d) if row < column]
    text = texts_of(figure)
    assert "no pair of values is excluded by itself" in text
    assert "excluded" not in text.replace("is excluded by itself", "")


def test_cells_of_a_pair_show_the_posterior_over_the_prior():
    fixed = {name: {"fixed": 0.3} for name in PARAMETERS}
    space = contact_space(fixed | {"e_gg": [0.0, 1.0], "mus_gg": [0.0, 2.0]})
    places = (np.arange(64) + 0.5) / 64
    x, y = (grid.ravel() for grid in np.meshgrid(places, 2 * places))
    draws = pd.DataFrame({"e_gg": x, "mus_gg": y})
    with style.applied():
        panel = style.new_figure(3, 3).subplots()
        # Draws of the prior itself say nothing; draws of its lower half say a factor 2.
        for part, low, high in (
            (draws, 1.0, 1.0),
            (draws[draws["e_gg"] < 0.5], 2.0, 1 / posterior.LARGEST_RATIO),
        ):
            mesh = posterior._draw_posterior_over_prior(
                panel, part["e_gg"], part["mus_gg"], space
            )
            values = np.reshape(mesh.get_array(), (posterior.N_PAIR_CELLS, -1))
            half = posterior.N_PAIR_CELLS // 2
            np.testing.assert_allclose(values[:, :half], low)
            np.testing.assert_allclose(values[:, half:], high)
