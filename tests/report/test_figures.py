"""Figures: each can be drawn, the same way twice, and says what it has to say."""

import functools
import json
import re
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from made_up import CONFIG, inputs_of, made_up_inputs, texts_of, write_network
from matplotlib.colors import to_rgb
from PIL import Image
from refusals import input_error, not_refused
from shared import ROOT, says

from repose.common.errors import InputError
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure import pile, saved_pours
from repose.measure.angles import DEFINITIONS
from repose.measure.saved_piles import draw_side_view
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains
from repose.report import figures
from repose.report.figures import (
    berries,
    checks,
    outline,
    plane,
    posterior,
    rotation,
    samples,
    search,
    style,
    surrogate,
    testbench,
)
from repose.report.figures.registry import Drawn
from repose.report.renderer.scenery import look_at
from repose.report.study_view import StudyView
from repose.stages.drum_tables import choose_median_run

LINE = "line fitted to the side from 30 to 80 % of the height"


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return made_up_inputs(tmp_path_factory.mktemp("inputs"))


def size_of(path):
    return Image.open(path).size


# Drawn in tests/calibrate/strategies and, the last, in test_figures_of_targets.py.
ELSEWHERE = {
    "pareto_screening",
    "pareto_surface",
    "perturbation",
    "contours",
    "sequential",
    "profiles",
}


def read_by(name):
    """What the figure reads of the configuration, as its entry says, and what is read for every figure."""
    kept = {key: CONFIG[key] for key in ("small_run", "targets", "measure")}
    for section, _, key in (
        dotted.partition(".") for dotted in figures.FIGURES[name].reads
    ):
        kept[section] = (
            kept.get(section, {}) | {key: CONFIG[section][key]}
            if key
            else CONFIG[section]
        )
    return kept


def draw_small(name, inputs, path):
    """Draw a figure with small pictures in it from what it says that it reads, and return it as it was saved."""
    saved = []
    save = style.save
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(testbench, "PILE_PIXELS", 300)
        patch.setattr(rotation, "PICTURE_PIXELS", 120)
        patch.setattr(berries, "PICTURE_PIXELS", 100)
        patch.setattr(
            style,
            "save",
            lambda figure, *path, **options: (
                saved.append(figure) or save(figure, *path, **options)
            ),
        )
        figures.draw(name, inputs_of(name, inputs), path, read_by(name))
    return saved[0]


@pytest.fixture(scope="module")
def drawn(inputs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("drawn")
    return functools.cache(
        lambda name: (draw_small(name, inputs, path := folder / f"{name}.png"), path)
    )


DRAWN = sorted(set(figures.FIGURES) - ELSEWHERE)
SLOW = [
    pytest.param(name, marks=pytest.mark.slow) if name == "region" else name
    for name in DRAWN
]


def check_size(path):
    width, height = size_of(path)
    assert 400 < width < 1400, path.stem
    assert 250 < height < 1400, path.stem


@pytest.mark.parametrize("name", SLOW)
def test_every_figure_is_drawn(name, drawn):
    check_size(drawn(name)[1])


def test_every_sketch_of_a_bench_test_is_drawn(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "examples/bench_tests")
    import sketches

    for name in sketches.SKETCHES:
        sketches.draw(name, tmp_path / f"{name}.png", CONFIG)
        check_size(tmp_path / f"{name}.png")
    assert {
        path.stem for path in (ROOT / "examples/bench_tests").glob("*.yaml")
    } == set(sketches.SKETCHES)


@pytest.mark.slow
def test_every_figure_is_drawn_the_same_twice(inputs, drawn, tmp_path):
    for name in DRAWN:
        draw_small(name, inputs, tmp_path / "again.png")
        assert (tmp_path / "again.png").read_bytes() == drawn(name)[1].read_bytes(), (
            name
        )


def test_figures_have_titles_and_captions_with_numbers():
    for name, figure in figures.FIGURES.items():
        caption = figure.caption_of(CONFIG)
        assert figure.title, name
        assert len(caption.split()) > 5, name
        assert not {"{", "}"} & set(caption), name
    network = figures.FIGURES["figure10"].caption_of(CONFIG)
    says(
        network,
        f"{len(CONFIG['parameters'])} parameters in",
        f"{CONFIG['network']['hidden']} hidden neurons",
    )


def draw_a_line(inputs, config):
    """A figure with what figures are made of: a line in an axes, a legend, a text with a symbol."""
    figure = style.new_figure(style.PAGE, 1.5)
    panel = figure.subplots()
    panel.plot([0, 1, 3], [1, 0, 2], label="a line")
    panel.set(xlabel="θ (°)", ylabel="$x^2$", xlim=(0, 2))
    panel.legend()
    return figure


def test_figures_have_their_formats_bytes_and_fonts(tmp_path):
    line = {"line": Drawn(draw_a_line, inputs={})}
    config = CONFIG | {"figures": {"format": ["png", "pdf", "svg"], "dpi": 90}}

    def draw(path):
        figures.draw("line", {}, path, config, known=line)

    found = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        draw(folder / "it.png")
        found.append(
            {
                path.suffix: path.read_bytes()
                for path in folder.iterdir()
                if path.stem == "it"
            }
        )
    files, again = found
    assert set(files) == {".png", ".pdf", ".svg"}
    assert again == files, "the same bytes in every run"
    expected = style.PAGE * 90
    assert size_of(tmp_path / "first/it.png")[0] == pytest.approx(expected, abs=1)
    assert b"/FontFile2" in files[".pdf"]
    assert b"/Type3" not in files[".pdf"], "a journal wants text of TrueType"
    assert b"<text" not in files[".svg"], "its letters are outlines"
    draw(tmp_path / "alone" / "it.pdf")
    assert [path.name for path in (tmp_path / "alone").glob("it*")] == ["it.pdf"]
    ending = r"it\.eps: ending is '\.eps'; expected \.png or \.pdf or \.svg"
    input_error(ending, draw, tmp_path / "it.eps")


@pytest.mark.parametrize("name", ["figure02", "figure13", "dataset"])
def test_a_small_run_has_a_band_across_the_top(name, inputs, drawn, tmp_path):
    paths = [drawn(name)[1], tmp_path / "small.png"]
    figures.draw(name, inputs_of(name, inputs), paths[1], CONFIG | {"small_run": True})
    width, height = size_of(paths[0])
    assert size_of(paths[1]) == (width, pytest.approx(height + 0.24 * style.DPI, abs=1))
    tops = [
        np.asarray(Image.open(path).convert("RGB")).astype(int)[:40] for path in paths
    ]
    plain, banded = (
        (abs(top - 255 * np.array(to_rgb(style.RED))).max(axis=-1) < 3).sum()
        for top in tops
    )
    assert banded > 5000 > plain


def drawn_texts(draw, files):
    """The texts of a figure that is drawn from `files`."""
    with style.applied():
        return texts_of(draw(files, StudyView(CONFIG)))


@pytest.mark.parametrize("name", ["figure10", "figure13", "figure14"])
def test_a_figure_leaves_its_explanation_to_the_caption(name, inputs, drawn):
    """Below the panels stand only the line of the angle and the meaning of subscripts."""
    figure, _ = drawn(name)
    below = figure.get_supxlabel().splitlines()
    assert not [
        line for line in below if not line.startswith(("AoR: angle of", "gg: grain"))
    ]


def test_a_figure_of_sizes_says_where_they_are_a_reconstruction(inputs, tmp_path):
    text = drawn_texts(berries.draw_sizes_and_sphericity, {"sizes": inputs["sizes"]})
    assert berries.RECONSTRUCTION_NOTE in text
    measured = tmp_path / "sizes.csv"
    measured.write_text(inputs["sizes"].read_text().replace("# reconstruction\n", ""))
    text = drawn_texts(berries.draw_sizes_and_sphericity, {"sizes": measured})
    assert berries.RECONSTRUCTION_NOTE not in text


def test_a_search_without_a_feasible_set_says_how_near_it_came(inputs, tmp_path):
    summary = tmp_path / "summary.json"
    summary.write_text(
        json.dumps({"feasible": False, "message": "nearest: 3.1 deg short"})
    )
    files = {"feasible": inputs["feasible"], "summary": summary}
    says(
        drawn_texts(search.draw_feasible_solutions, files),
        "no set is predicted inside all ranges: the ",
        "nearest: 3.1 deg short",
    )


def test_failed_samples_are_counted(inputs):
    files = {"dataset": inputs["dataset"]}
    texts = drawn_texts(samples.draw_responses_over_parameters, files)
    says(
        " ".join(texts.split()),
        "3 of 150 samples gave no result",
        "3 failed because grains got stuck",
    )


def test_a_drum_that_never_slips_is_shown_at_the_reported_time(
    inputs, tmp_path, monkeypatch
):
    monkeypatch.setattr(rotation, "PICTURE_PIXELS", 120)
    states = tmp_path / "states.npz"
    with np.load(inputs["states"]) as file:
        arrays = {
            key: file[key] for key in file if key.split("_")[1] in ("start", "report")
        }
    np.savez(states, **arrays)
    files = {"states": states, "particle": inputs["particle"]}
    says(drawn_texts(rotation.draw_states, files), "NO SLIP", "at the reported time")


def test_the_drum_names_the_run_that_it_shows(inputs, monkeypatch, tmp_path):
    """Of four slips, the second smallest is the lower of the middle two."""
    monkeypatch.setattr(rotation, "PICTURE_PIXELS", 120)
    turned_deg = [52.5, np.nan, 46.5, 51.0, 48.0]
    runs = pd.DataFrame(
        {
            "seed": [11, 12, 13, 14, 15],
            "status": ["ok", "no_slip", "ok", "ok", "ok"],
            "before_turned_deg": turned_deg,
            "before_time_s": np.divide(turned_deg, 5.0),
        }
    )
    assert choose_median_run(runs) == 15
    runs.to_csv(tmp_path / "runs.csv", index=False)
    files = {key: inputs[key] for key in ("states", "particle")}
    text = drawn_texts(rotation.draw_states, files | {"runs": tmp_path / "runs.csv"})
    says(text, "Run 5 of 5, whose slip angle is the median")


def test_a_drum_that_slips_says_when(drawn):
    assert "slipped first when the drum had turned by 51.0°, after 10.2 s" in texts_of(
        drawn("figure15")[0]
    )


def test_the_accuracy_of_a_surrogate_stands_beside_that_of_a_perfect_model(tmp_path):
    """R2 is 1 minus the sum of squared errors over that of the values about their mean, which is 20 here."""
    value = np.array([-3.0, -1.0, 1.0, 3.0])
    predicted = value + np.array([1, -1, 1, -1])
    predictions = pd.DataFrame(
        {
            "sample": range(4),
            "split": "test",
            "aor_deg": value,
            "height_mm": value,
            "aor_predicted_deg": predicted,
            "height_predicted_mm": predicted,
        }
    )
    dataset = pd.DataFrame({"sample": range(4), "aor_se_deg": 0.5, "height_se_mm": 1.5})
    files = {name: tmp_path / f"{name}.csv" for name in ("predictions", "dataset")}
    predictions.to_csv(files["predictions"], index=False)
    dataset.to_csv(files["dataset"])
    # errors of the network: R2 = 1 - 4 * 1 / 20. A perfect model is off by the standard
    # errors: R2 = 1 - 4 * 0.25 / 20, and for the height 1 - 4 * 2.25 / 20
    says(
        drawn_texts(surrogate.draw_predicted_against_simulated, files),
        "test, 4 sets: R² 0.80, RMSE 1.00 deg\n"
        "a perfect model on these sets: R² 0.95, RMSE 0.50 deg",
        "test, 4 sets: R² 0.80, RMSE 1.00 mm\n"
        "a perfect model on these sets: R² 0.55, RMSE 1.50 mm",
    )
    # Two training samples with other values change the noise, but not the test samples:
    # the mean square of the errors is (4 * 0.25 + 2 * 1) / 6 = 0.5.
    more = predictions.iloc[:2].assign(sample=[4, 5], split="train", aor_deg=20.0)
    pd.concat([predictions, more]).to_csv(files["predictions"], index=False)
    noisier = pd.DataFrame({"sample": [4, 5], "aor_se_deg": 1.0, "height_se_mm": 1.5})
    pd.concat([dataset, noisier]).to_csv(files["dataset"])
    says(
        drawn_texts(surrogate.draw_predicted_against_simulated, files),
        "a perfect model on these sets: R² 0.90, RMSE 0.71 deg",
    )


def test_errors_of_the_validation_are_percent_of_the_simulated_value(tmp_path):
    row = {
        "solution": 5,
        "aor_predicted_deg": 33.0,
        "height_predicted_mm": 63.0,
        "aor_simulated_deg": 30.0,
        "height_simulated_mm": 70.0,
    }
    table4 = tmp_path / "table4.csv"
    pd.DataFrame([row]).to_csv(table4, index=False)
    text = drawn_texts(checks.draw_validation, {"table4": table4})
    assert "| 10.0 % |" in text
    assert "published" not in text


def test_percentages_of_the_validation_stand_below_the_error_bars(tmp_path):
    row = {
        "solution": 5,
        "aor_predicted_deg": 33.0,
        "height_predicted_mm": 63.0,
        "aor_simulated_deg": 32.0,
        "aor_se_deg": 1.5,
        "height_simulated_mm": 70.0,
        "height_se_mm": 2.0,
    }
    table4 = tmp_path / "table4.csv"
    pd.DataFrame([row]).to_csv(table4, index=False)
    with style.applied():
        figure = checks.draw_validation({"table4": table4}, StudyView(CONFIG))
    places = [
        text.xy[1]
        for panel in figure.axes
        for text in panel.texts
        if text.get_text().endswith(" %")
    ]
    # the angle's bar ends below its prediction, the height's bar above it
    assert places == [30.5, 63.0]


def test_credible_intervals_show_the_answer(inputs):
    files = {key: inputs[key] for key in ("posterior", "feasible")}
    solutions = pd.read_csv(files["feasible"])
    (answer,) = solutions[solutions["representative"]].to_dict("records")
    with style.applied():
        figure = posterior.draw_credible_intervals(files, study := StudyView(CONFIG))
    diamonds = [line for line in figure.axes[0].lines if line.get_marker() == "D"]
    names = pd.read_csv(files["posterior"])["parameter"]
    for name, diamond in zip(names, diamonds, strict=True):
        expected = study.parameters.fractions_of_range(name, answer[name])
        assert diamond.get_xdata()[0] == pytest.approx(expected)


def test_a_posterior_says_what_is_wrong_with_it(drawn):
    says(
        texts_of(drawn("corner")[0]),
        "NOT CONVERGED",
        "EXTRAPOLATED",
        "best draw 2.00 standard deviations",
    )


def test_bad_names_of_figures_and_inputs_are_named(inputs, tmp_path):
    cases = [
        (("figure99", {}), "figure99"),
        (("figure02", {}), "sizes"),
        (("figure02", {"sizes": inputs["sizes"], "sises": ""}), "sises"),
        (("figure02", {"sizes": tmp_path / "nowhere.csv"}), "nowhere"),
    ]
    assert not not_refused(
        lambda case: figures.draw(*case, tmp_path / "x.png", CONFIG), cases, InputError
    )
    np.savez(tmp_path / "x.npz", other=np.zeros(3))
    input_error("position_SEED", saved_pours.read_first_pour, tmp_path / "x.npz")


def test_sizes_have_an_axis_of_whole_numbers(drawn):
    ticks = [tick.get_text() for tick in drawn("figure02")[0].axes[0].get_yticklabels()]
    assert all(tick.isdigit() for tick in ticks)
    assert len(ticks) > 2


def test_the_legend_of_the_plane_says_what_bars_and_line_are(drawn):
    title = drawn("plane")[0].legends[0].get_title().get_text()
    assert title.startswith(plane.BARS_NOTE)
    assert LINE in title.replace("\n", " ")


def test_the_pile_shows_the_definitions_of_its_angle(drawn):
    settings = MeasureSettings.with_defaults(**CONFIG["measure"])
    figure, _ = drawn("definitions")
    # texts have their places only after drawing
    figure.draw_without_rendering()
    text = texts_of(figure)
    assert "80 % of the height" in text
    assert "fit_" not in text
    (legend,) = figure.legends
    assert legend.get_window_extent().y1 < figure.axes[1].get_window_extent().y0
    labels = [text.get_text().split(")  ")[1] for text in legend.get_texts()]
    assert labels[0] == f"flank: {LINE}, used"
    expected = [
        f"{name}: {style.describe_line(settings, name)}" for name in DEFINITIONS[1:]
    ]
    assert labels[1:] == expected
    for panel in figure.axes:
        boxes = [label.get_window_extent() for label in panel.texts]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


@pytest.mark.parametrize(
    "name",
    [
        "figure10",
        "figure13",
        "plane",
        "dataset",
        "validation",
        "noise",
        "outline",
    ],
)
def test_a_figure_with_the_calibrated_angle_names_its_line(
    name, inputs, drawn, tmp_path, monkeypatch
):
    assert LINE in texts_of(drawn(name)[0]).replace("\n", " ")
    if name in (
        "figure10",
        "plane",
    ):  # of all outputs of a network; of pairs of targets
        return
    without = []
    monkeypatch.setattr(
        style,
        "save",
        lambda figure, *_, **options: without.append(
            texts_of(figure).replace("\n", " ")
        ),
    )
    figures.draw(
        name,
        inputs_of(name, inputs),
        tmp_path / "it.png",
        CONFIG | {"targets": CONFIG["targets"][1:]},
    )
    assert LINE not in without.pop()


def test_the_angle_has_its_lines_in_figure_6(inputs, drawn):
    files = inputs_of("figure06", inputs)
    settings = MeasureSettings.with_defaults(**CONFIG["measure"]).for_grain(
        read_grain(files["berry"])
    )
    image = draw_side_view(
        saved_pours.read_first_pour(files["heap"]),
        Particle.load(files["particle"]),
        settings,
    )
    measured = pile.measure_image(
        image, settings.mm_per_pixel, settings, base_row=len(image) - 0.5
    )
    panel = drawn("figure06")[0].axes[-1]
    title = panel.get_title(loc="right")
    assert f"{measured.aor_deg:.1f}°" in title
    assert LINE in title
    for text, line, name in zip(
        panel.texts, measured.angle.lines, ("left", "right"), strict=True
    ):
        expected = f"{name} {getattr(measured.angle, f'{name}_deg'):.1f}°"
        assert text.get_text() == expected
        along = np.sort(np.array(line)[:, 0] * settings.mm_per_pixel)
        assert along[0] < text.xy[0] < along[1]


@pytest.mark.parametrize("fresh", [False, True])
def test_predicted_and_simulated_responses_have_equal_axes(fresh, inputs, drawn):
    figure, _ = drawn("figure13")
    if not fresh:
        files = {
            key: inputs_of("figure13", inputs)[key]
            for key in ("predictions", "dataset")
        }
        with style.applied():
            figure = surrogate.draw_predicted_against_simulated(
                files, StudyView(CONFIG)
            )
            figure.draw_without_rendering()
    for panel in figure.axes:
        assert panel.get_xlim() == panel.get_ylim()
        assert panel.get_aspect() == 1
        assert panel.get_xticks().tolist() == panel.get_yticks().tolist()
    text = texts_of(figure)
    assert bool(re.search(r"new points, \d+ sets: R²", text)) is fresh
    assert text.count("a perfect model on these sets: ") == (1 + fresh) * len(
        figure.axes
    )


def test_weights_that_cancel_draw_no_long_bars(tmp_path):
    """Two hidden neurons take mus_gg (1) with opposite weights; e_gg (0) and mur_gg (2) act by weak ones, which remain."""
    W1 = np.zeros((3, 6))
    W1[0, 1] = 2.0
    W1[1, 1] = -2.0
    W1[2, 2] = 0.3
    W1[2, 0] = -0.1
    W2 = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.5]]
    path = tmp_path / "network.json"
    write_network(path, ["aor_deg", "height_mm"], W1, W2)
    with style.applied():
        figure = surrogate.draw_network_structure({"network": path}, StudyView(CONFIG))
    network, bars = figure.axes
    assert len({line.get_linewidth() for line in network.lines}) == 1
    lengths = np.array([bar.get_width() for bar in bars.containers[0]])
    assert np.argsort(lengths)[::-1][:2].tolist() == [2, 0]
    # mus_gg is as an input without any weight
    assert lengths[1] == pytest.approx(lengths[4], abs=0.5)
    assert {"90 % ↗", "10 % ↘"} <= set(texts_of(figure).split(" | "))


def test_a_scale_bar_has_its_length():
    corners = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.05]])
    camera = look_at(corners, 600, 300, 0.0, -90.0)
    with style.applied():
        panel = style.new_figure(4, 2).subplots()
        style.draw_scale_bar(panel, camera, np.array([0.02, 0.0, 0.0]), 0.2)
    (bar,) = panel.lines
    # the bar has a round length of at most 0.3 of 200 mm
    assert [text.get_text() for text in panel.texts] == ["50 mm"]
    x, _, _ = camera.project(np.array([[0.02, 0.0, 0.0], [0.07, 0.0, 0.0]]))
    assert np.ptp(bar.get_xdata()) == pytest.approx(x[1] - x[0])
    assert max(bar.get_xdata()) < 600


def test_the_outline_has_the_measured_height_and_slope_at_one_scale(drawn, inputs):
    figure, _ = drawn("outline")
    (panel,) = figure.axes
    assert panel.get_aspect() == 1
    measured = {entry["response"]: entry["value"] for entry in CONFIG["targets"]}
    lines = {line.get_label(): line for line in panel.lines}
    (height,) = [
        line for label, line in lines.items() if label.startswith("measured height")
    ]
    np.testing.assert_allclose(height.get_ydata(), measured["height_mm"])
    slopes = [line for line in panel.lines if "measured slope" in line.get_label()]
    # one line for each flank
    assert len(slopes) == 2
    for line in slopes:
        (x0, x1), (z0, z1) = line.get_data()
        slope = (z1 - z0) / abs(x1 - x0)
        assert np.degrees(np.arctan(slope)) == pytest.approx(measured["aor_deg"])
    # The simulated slope is that of the pile, by the line of the study.
    simulated = [line for line in panel.lines if "simulated slope" in line.get_label()]
    assert len(simulated) == 2
    files = inputs_of("outline", inputs)
    settings = StudyView(CONFIG).settings.measure.for_grain(read_grain(files["berry"]))
    pour = saved_pours.read_first_pour(files["heap"])
    grains = Grains.of(pour, Particle.load(files["particle"]))
    pile_result = pile.measure_pile(grains, settings, pour["in_pile"])
    for line in simulated:
        (x0, x1), (z0, z1) = line.get_data()
        slope = (z1 - z0) / abs(x1 - x0)
        assert np.degrees(np.arctan(slope)) == pytest.approx(pile_result.aor_deg)
    # The simulated height is the mean of the highest points in the views.
    views = [line for line in panel.lines if line.get_color() == style.SKY]
    (simulated,) = [
        line for label, line in lines.items() if label.startswith("simulated height")
    ]
    highest_points = [view.get_ydata().max() for view in views]
    np.testing.assert_allclose(simulated.get_ydata(), np.mean(highest_points))
    # The cone of made-up grains is as high as its outlines.
    mean = lines["simulated pile, mean of the views"]
    views = [line for line in panel.lines if line.get_color() == style.SKY]
    assert len(views) == CONFIG["measure"]["views"]
    highest = max(view.get_ydata().max() for view in views)
    assert 0 < mean.get_ydata().max() <= highest


def test_the_mean_outline_of_equal_triangles_is_the_triangle():
    x = np.arange(-40.0, 40.5, 0.5)
    triangle = outline.Outline(x, np.maximum(0.0, 20.0 - abs(x)))
    mean = outline._average_outlines([triangle, triangle])
    expected = np.maximum(0.0, 20.0 - abs(mean.x_mm))
    np.testing.assert_allclose(mean.height_mm, expected, atol=1e-9)


def test_the_legend_names_the_angles_of_several_runs_once():
    panel = style.new_figure(style.PAGE, 2.0).subplots()
    times = [0.0, 0.1, 0.0, 0.1]
    record = pd.DataFrame(
        {"seed": [1, 1, 2, 2], "time_s": times, "surface_deg": times, "bed_deg": times}
    )
    runs = pd.DataFrame(
        {"seed": [1, 2], "status": ["ok"] * 2, "after_time_s": [0.1, 1]}
    )
    rotation._draw_angles_of_runs(panel, record, runs)
    _, labels = panel.get_legend_handles_labels()
    assert labels == ["surface", "centre of mass"]
