"""Figures of these studies: each is drawn from made-up tables, and says what it has to say."""

import itertools
import math

import matplotlib.text
import numpy as np
import pandas as pd
import pytest
from shared import TARGETS

from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import name_derived_column
from repose.calibrate.responses import response as of_name
from repose.calibrate.targets import Targets
from repose.report import figures
from repose.report.figures import style
from research.comparison.search import REFERENCE
from research.figures import FIGURES, inversion, representations, second_look
from research.shape.shape_piles import COLUMNS

CONFIG = {
    "shape_study": {
        "particles": dict.fromkeys(("ellipsoid", "rough_spheres")),
        "tensions": ["keep", "cut"],
        "fillings": dict.fromkeys(("open_cone", "lying")),
    },
    "compare_search": {"tolerance": 0.01},
    "small_run": False,
    "targets": TARGETS,
}
FILES = (
    "curves",
    "methods",
    "whole",
    "accuracy",
    "surrogates",
    "sampling",
    "combinations",
    "sets",
)
FILES += ("information", "narrowing", "responses", "ways")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    _pool_comparisons(folder)
    _comparisons(folder)
    _representations(folder)
    _responses(folder)
    return {name: folder / f"{name}.csv" for name in FILES}


def _pool_comparisons(folder):
    """Tables of the comparisons on the pool: shares that rise with the simulations."""
    both = [("aor_deg", 0.0), ("height_mm", -0.02)]
    rows = []
    for response, less in both:
        for source, sizes in (("main design", (600, 900)), ("pool", (240, 480, 1760))):
            for n in sizes:
                share = 1 - 20 / n + less
                row = {
                    "training": source,
                    "simulations": n,
                    "seeds": 4,
                    "response": response,
                    "r2": share - 0.02,
                    "r2_low": share - 0.05,
                    "r2_high": share,
                    "r2_bar": 0.94,
                    "explainable": share,
                    "explainable_low": share - 0.03,
                    "explainable_high": share + 0.02,
                }
                rows.append(row | {"explainable_bar": 0.95, "reachable_r2": 0.99})
    pd.DataFrame(rows).to_csv(folder / "accuracy.csv", index=False)
    rows = []
    for k, model in enumerate(("network", "quadratic surface", "random forest")):
        for response, less in both:
            for training, n in (("pool", 120), ("pool", 440), ("main design", 900)):
                row = {
                    "model": model,
                    "training": training,
                    "simulations": n,
                    "response": response,
                }
                rows.append(
                    row
                    | {
                        "explainable": 1 - 20 / n - 0.05 * k + less,
                        "explainable_se": 0.01,
                    }
                )
    pd.DataFrame(rows).to_csv(folder / "surrogates.csv", index=False)
    rows = []
    for response, less in both:
        for design, data in (
            ("optimal", "emulated"),
            ("random", "emulated"),
            ("optimal", "real"),
        ):
            for n in (30, 150):
                row = {
                    "comparison": "designs",
                    "design": design,
                    "data": data,
                    "fit": "network",
                    "points": n,
                    "seeds": 6,
                    "response": response,
                    "explainable": 1 - 8 / n + less,
                }
                rows.append(row | {"explainable_se": 0.01})
        for seeds in (1, 4, 16):
            row = {
                "comparison": "points against seeds",
                "design": "sobol",
                "data": "emulated",
                "fit": "network",
                "points": 480 // seeds,
                "seeds": seeds,
                "response": response,
                "explainable": 0.9 + less,
            }
            rows.append(row | {"explainable_se": 0.01})
    pd.DataFrame(rows).to_csv(folder / "sampling.csv", index=False)


def _comparisons(folder):
    """Tables of searches and of the whole method."""
    at = np.array([10, 100, 1000])
    curves = []
    methods = []
    for k, name in enumerate(inversion.SEARCHES):
        many = at * 10 if name == "miga_whole" else at
        curves.append(
            pd.DataFrame(
                {"method": name, "evaluations": many, "log10_mean": -k - np.log10(at)}
            )
        )
        methods.append(
            {"method": name, "reached": 10 - 5 * (name == "random"), "repetitions": 10}
        )
        methods[-1] |= {
            "evaluations_to_tolerance": 100.0 * (k + 1),
            "evaluations_to_tolerance_se": 10.0,
        }
        methods[-1] |= {"listed_coverage": 0.05 * k, "met_coverage": 0.06 * k}
    methods.append({"method": REFERENCE, "listed_coverage": 0.5, "met_coverage": 0.5})
    pd.concat(curves).assign(log10_se=0.1).to_csv(folder / "curves.csv", index=False)
    errors = {"listed_coverage_se": 0.01, "met_coverage_se": 0.01}
    pd.DataFrame(methods).assign(**errors).to_csv(folder / "methods.csv", index=False)
    whole = [
        {
            "data": kind,
            "samples": n,
            "method": name,
            "simulations": 6 * n,
            "aor_off_deg": 5 / n,
            "aor_off_deg_se": 1 / n,
        }
        | {"height_off_mm": 9 / n, "height_off_mm_se": 1 / n}
        for kind in inversion.KINDS
        for n in (30, 60)
        for name in inversion.WHOLE
    ]
    pd.DataFrame(whole).to_csv(folder / "whole.csv", index=False)


def _representations(folder):
    """Two tables of a shape study in which every combination is off by its own distance."""
    study = CONFIG["shape_study"]
    rows = []
    ways = itertools.product(
        study["particles"], study["tensions"], study["fillings"], COLUMNS
    )
    for k, (particle, tension, filling, definition) in enumerate(ways):
        row = {
            "particle": particle,
            "tension": tension,
            "filling": filling,
            "definition": definition,
            "distance": 1.0 + k % 2,
            "aor_difference_deg": k % 7 - 2.0,
            "height_difference_mm": k % 5 - 6.0,
        }
        rows.append(row | {"aor_se_deg": 0.2, "height_se_mm": 0.5})
    pd.DataFrame(rows).to_csv(folder / "combinations.csv", index=False)
    sets = pd.DataFrame(
        {"kind": "published", "definition": "secant", "set": ["2", "15"]}
    )
    sets["aor_deg"] = [33.0, 32.0]
    sets["aor_difference_deg"] = [-0.7, -0.2]
    sets["height_mm"] = [65.0, 66.0]
    sets["height_difference_mm"] = [0.2, 1.8]
    sets.to_csv(folder / "sets.csv", index=False)


def _responses(folder):
    """Tables of further responses."""
    sets = [
        "AoR and Height",
        "loose_percent",
        "drum_slip_deg",
        "whole pile",
        "pile and other bench tests",
    ]
    information = [
        {
            "discrepancy_percent": p,
            "set": name,
            "bits": 5.0 + k,
            "bits_se": 0.2,
            "gain_bits": k,
            "gain_se_bits": 0.1,
        }
        for p in (0.0, 2.0)
        for k, name in enumerate(sets)
    ]
    pd.DataFrame(information).to_csv(folder / "information.csv", index=False)
    narrowing = [
        {
            "discrepancy_percent": percent,
            "set": name,
            "parameter": p,
            "width_ratio": 0.7,
            "over_base": 1 - 0.15 * k,
        }
        for percent in (0.0, 2.0)
        for k, name in enumerate(sets)
        for p in PARAMETERS
    ]
    pd.DataFrame(narrowing).to_csv(folder / "narrowing.csv", index=False)
    known = pd.DataFrame(
        {"response": ["aor_deg", "height_mm", "loose_percent", "drum_slip_deg"]}
    )
    known.assign(signal_to_noise=1.5, r2=0.9).to_csv(
        folder / "responses.csv", index=False
    )
    ways = [
        {
            "discrepancy_percent": p,
            "way": way,
            "minutes": 20.0,
            "bits_a_minute": 0.01 * k,
        }
        for p in (0.0, 2.0)
        for k, way in enumerate(("loose", "drum"))
    ]
    pd.DataFrame(ways).to_csv(folder / "ways.csv", index=False)


def texts_of(figure):
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_every_figure_is_drawn(name, inputs, tmp_path):
    files = {key: inputs[key] for key in FIGURES[name].inputs}
    figures.draw(name, files, tmp_path / "it.png", CONFIG, FIGURES)
    assert (tmp_path / "it.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "names", [["aor_deg"], ["aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg"]]
)
def test_the_whole_method_is_drawn_for_any_number_of_targets(names, tmp_path):
    targets = [TARGETS[0] | {"response": name} for name in names]
    whole = pd.DataFrame(
        {"data": "real", "method": list(inversion.WHOLE), "simulations": 240.0}
    )
    for column in Targets.of(targets).names:
        whole[name_derived_column(column, "off")] = 0.1
        whole[f"{name_derived_column(column, 'off')}_se"] = 0.02
    whole.to_csv(tmp_path / "whole.csv", index=False)
    with style.applied():
        figure = inversion.whole(
            {"whole": tmp_path / "whole.csv"}, CONFIG | {"targets": targets}
        )
    assert len(figure.axes) == len(names)


def test_a_search_that_misses_the_tolerance_is_counted(inputs):
    with style.applied():
        text = texts_of(inversion.searches(inputs, CONFIG))
    assert "5 of 10 runs" in text
    assert "tolerance 0.01" in text


def test_searches_that_all_miss_the_tolerance_leave_readable_axes(inputs, tmp_path):
    methods = pd.read_csv(inputs["methods"]).assign(
        reached=0, evaluations_to_tolerance=np.nan
    )
    methods.to_csv(tmp_path / "methods.csv", index=False)
    with style.applied():
        figure = inversion.searches(
            inputs | {"methods": tmp_path / "methods.csv"}, CONFIG
        )
    assert figure.axes[1].get_xlim() == (10.0, 1e5)
    counted = [
        text for text in figure.axes[1].texts if text.get_text() == "0 of 10 runs"
    ]
    assert len(counted) == len(inversion.SEARCHES) - 1
    low, high = figure.axes[1].get_ylim()
    assert all(low < text.get_position()[1] < high for text in counted)


def test_further_responses_are_in_order_of_what_they_add(inputs):
    with style.applied():
        figure = second_look.what_to_measure_next(inputs, CONFIG)
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert [label.split("\n")[0] for label in labels] == [
        "pile and other bench tests",
        "all of the pile",
        "loose grains",
        "drum, slip",
    ]
    assert "S/N 1.5, R² 0.90" in labels[2]
    assert "AoR and Height alone:\n5.00 ± 0.20 bits" in texts_of(figure)
    ways = [text.get_text() for text in figure.axes[1].get_yticklabels()]
    assert ways == ["loose grains, counted\n20 min", "drum, its first slip\n20 min"]
    # both cases in every panel
    cases = [text.get_text() for text in figure.axes[2].get_xticklabels(minor=True)]
    assert cases == ["exact", "2 %"] * len(figure.axes[2].get_xticks())
    assert len(figure.axes[0].patches) == 2 * len(labels)
    assert len(figure.axes[1].patches) == 2 * len(ways)


@pytest.mark.parametrize(
    "names",
    [["height_mm"], ["aor_deg", "height_mm", "packing_percent", "drum_slip_deg"]],
)
def test_the_shape_study_is_drawn_for_its_targets(names, tmp_path):
    study = {
        "particles": {"egg": {}, "clump": {}},
        "tensions": ["keep"],
        "fillings": {"here": {}, "there": {}},
    }
    targets = [
        TARGETS[0] | {"response": name, "value": 50.0, "range": [48.0, 52.0]}
        for name in names
    ]
    config = {"targets": targets, "shape_study": study}
    rows = []
    sets = []
    for particle in ("egg", "clump"):
        for filling in ("here", "there"):
            for definition in COLUMNS:
                row = {
                    "particle": particle,
                    "tension": "keep",
                    "filling": filling,
                    "definition": definition,
                }
                numbers = {
                    name_derived_column(name, "difference"): 1.0 for name in names
                }
                errors = {of_name(name).standard_error: 0.2 for name in names}
                distance = {"distance": math.sqrt(len(names))}
                rows.append(row | numbers | errors | distance)
                labels = row | {"kind": "published", "set": "a"}
                sets.append(labels | numbers | dict.fromkeys(names, 51.0))
    pd.DataFrame(rows).to_csv(tmp_path / "c.csv", index=False)
    pd.DataFrame(sets).to_csv(tmp_path / "s.csv", index=False)
    with style.applied():
        figure = representations.study(
            {"combinations": tmp_path / "c.csv", "sets": tmp_path / "s.csv"}, config
        )
        style.save(figure, tmp_path / "a.png", small_run=False)
    first = of_name(names[0])
    assert figure.axes[4].get_xlabel() == f"{first.label} ({first.unit})"
    # with one target the distance is on the vertical axis
    vertical = "distance (–)" if len(names) == 1 else "Height (mm)"
    assert figure.axes[0].get_ylabel() == vertical
    titles = [
        panel.get_title(loc="left").replace(", by ", "_") for panel in figure.axes
    ]
    assert titles == list(COLUMNS)
