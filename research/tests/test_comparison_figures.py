"""Figures of the comparisons: each is drawn from made-up tables, and says what it has to say."""

import matplotlib.text
import numpy as np
import pandas as pd
import pytest
from shared import TARGETS

from repose.core.responses import derived
from repose.core.targets import Targets
from repose.pictures import figures
from repose.pictures.figures import style
from research.comparison.search import REFERENCE
from research.figures import FIGURES, inversion

CONFIG = {"compare_search": {"tolerance": 0.01}, "small_run": False, "targets": TARGETS}
FILES = ("curves", "methods", "whole", "accuracy", "surrogates", "sampling")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    _pool_comparisons(folder)
    _comparisons(folder)
    return {name: folder / f"{name}.csv" for name in FILES}


def _pool_comparisons(folder):
    """Tables of the comparisons on the pool: shares that rise with the simulations."""
    both = [("aor_deg", 0.0), ("height_mm", -0.02)]
    rows = []
    for response, less in both:
        for source, sizes in (("main design", (600, 900)), ("pool", (240, 480, 1760))):
            for n in sizes:
                share = 1 - 20 / n + less
                row = {"training": source, "simulations": n, "seeds": 4, "response": response}
                row |= {"r2": share - 0.02, "r2_low": share - 0.05, "r2_high": share, "r2_bar": 0.94}
                row |= {
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
                row = {"model": model, "training": training, "simulations": n, "response": response}
                rows.append(row | {"explainable": 1 - 20 / n - 0.05 * k + less, "explainable_se": 0.01})
    pd.DataFrame(rows).to_csv(folder / "surrogates.csv", index=False)
    rows = []
    for response, less in both:
        for design, data in (("optimal", "emulated"), ("random", "emulated"), ("optimal", "real")):
            for n in (30, 150):
                row = {"comparison": "designs", "design": design, "data": data, "fit": "network", "points": n}
                row |= {"seeds": 6, "response": response, "explainable": 1 - 8 / n + less}
                rows.append(row | {"explainable_se": 0.01})
        for seeds in (1, 4, 16):
            row = {
                "comparison": "points against seeds",
                "design": "sobol",
                "data": "emulated",
                "fit": "network",
            }
            row |= {"points": 480 // seeds, "seeds": seeds, "response": response, "explainable": 0.9 + less}
            rows.append(row | {"explainable_se": 0.01})
    pd.DataFrame(rows).to_csv(folder / "sampling.csv", index=False)


def _comparisons(folder):
    """Tables of searches and of the whole method."""
    at = np.array([10, 100, 1000])
    curves, methods = [], []
    for k, name in enumerate(inversion.SEARCHES):
        many = at * 10 if name == "miga_whole" else at
        curves.append(pd.DataFrame({"method": name, "evaluations": many, "log10_mean": -k - np.log10(at)}))
        methods.append({"method": name, "reached": 10 - 5 * (name == "random"), "repetitions": 10})
        methods[-1] |= {"evaluations_to_tolerance": 100.0 * (k + 1), "evaluations_to_tolerance_se": 10.0}
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


def words(figure):
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))


@pytest.mark.parametrize("name", ["search", "whole", "accuracy", "surrogates", "sampling"])
def test_every_figure_is_drawn(name, inputs, tmp_path):
    given = {key: inputs[key] for key in FIGURES[name][1]}
    figures.draw(name, given, tmp_path / "it.png", CONFIG, FIGURES)
    assert (tmp_path / "it.png").stat().st_size > 10_000


@pytest.mark.parametrize("names", [["aor_deg"], ["aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg"]])
def test_the_whole_method_is_drawn_for_any_number_of_targets(names, tmp_path):
    targets = [TARGETS[0] | {"response": name} for name in names]
    whole = pd.DataFrame({"data": "real", "method": list(inversion.WHOLE), "simulations": 240.0})
    for one in Targets.of(targets).names:
        whole[derived(one, "off")], whole[f"{derived(one, 'off')}_se"] = 0.1, 0.02
    whole.to_csv(tmp_path / "whole.csv", index=False)
    with style.applied():
        figure = inversion.whole({"whole": tmp_path / "whole.csv"}, CONFIG | {"targets": targets})
    assert len(figure.axes) == len(names)


def test_a_search_that_misses_the_tolerance_is_counted(inputs):
    with style.applied():
        text = words(inversion.searches(inputs, CONFIG))
    assert "5 of 10 runs" in text
    assert "tolerance 0.01" in text


def test_searches_that_all_miss_the_tolerance_leave_readable_axes(inputs, tmp_path):
    methods = pd.read_csv(inputs["methods"]).assign(reached=0, evaluations_to_tolerance=np.nan)
    methods.to_csv(tmp_path / "methods.csv", index=False)
    with style.applied():
        figure = inversion.searches(inputs | {"methods": tmp_path / "methods.csv"}, CONFIG)
    assert figure.axes[1].get_xlim() == (10.0, 1e5)
    counted = [text for text in figure.axes[1].texts if text.get_text() == "0 of 10 runs"]
    assert len(counted) == len(inversion.SEARCHES) - 1
    low, high = figure.axes[1].get_ylim()
    assert all(low < text.get_position()[1] < high for text in counted)
