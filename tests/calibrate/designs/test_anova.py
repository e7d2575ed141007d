"""Models and their optimum, against printed examples."""

import csv
import math
from decimal import ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from refusals import value_error

from repose.calibrate.designs.anova import (
    compute_pareto_limits,
    compute_pure_error,
    compute_statistics,
    list_effects,
    make_anova_table,
)
from repose.calibrate.designs.box_behnken import box_behnken
from repose.calibrate.designs.model import fit_model, list_terms
from repose.calibrate.designs.optimum import compute_desirability, find_optimum

PRINTED = Path(__file__).parent / "printed"
# Printed cells that contradict the rest of their row, and what the row gives.
MISPRINTS = {("viscosity", "B*C", "f"): "1.20"}
RUNS = box_behnken(3, 3)


def model_of(name, order="quadratic"):
    first = name.removesuffix("_first_block")
    runs = pd.read_csv(PRINTED / f"{first}_runs.csv")
    if first != name:
        runs = runs[runs["block"] == 1].drop(columns="block")
    factors = [column for column in runs if column not in ("block", "response")]
    if "block" not in runs:
        return fit_model(runs[factors], runs["response"], factors, order)
    # two blocks are one factor more, at 1 and -1, without squares and products
    terms = [
        (0,),
        *(tuple(k + 1 for k in term) for term in list_terms(len(factors), order)),
    ]
    coded = runs[["block", *factors]].assign(block=3 - 2 * runs["block"])
    return fit_model(coded, runs["response"], ["block", *factors], terms)


def agrees(value, printed):
    """Whether a number, rounded to the printed digits, is what is printed. A half may go up or to the even digit."""
    if printed.startswith("<"):
        return value < float(printed[1:])
    places = Decimal(1).scaleb(-len(printed.partition(".")[2]))
    # a number that was computed as 45.12499999999999 is 45.125
    exact = Decimal(repr(float(f"{value:.12g}")))
    return Decimal(printed) in {
        exact.quantize(places, rounding)
        for rounding in (ROUND_HALF_UP, ROUND_HALF_EVEN)
    }


@pytest.mark.parametrize(
    "name",
    [
        "chemical_process",
        "viscosity",
        "chemical_reaction",
        "chemical_reaction_first_block",
    ],
)
def test_every_printed_digit_of_the_table(name):
    order = "linear" if "first_block" in name else "quadratic"
    model = model_of(name, order)
    table = make_anova_table(model).set_index("source")
    if "block" in table.index:  # printed by itself, before any term
        alone = fit_model(model.coded, model.response, model.factors, [(0,)])
        table.loc["block"] = make_anova_table(alone).set_index("source").loc["block"]
    wrong = []
    cells = 0
    with open(PRINTED / f"{name}_anova.csv", newline="") as file:
        for row in csv.DictReader(file):
            source = row.pop("source")
            for column, printed in row.items():
                cells += bool(printed)
                if printed and not agrees(table.loc[source, column], printed):
                    wrong.append((name, source, column))
    assert cells > 15
    assert set(wrong) == {cell for cell in MISPRINTS if cell[0] == name}
    for _, source, column in wrong:
        assert agrees(table.loc[source, column], MISPRINTS[name, source, column])


def test_the_misprint_is_none_of_the_other_numbers():
    with open(PRINTED / "viscosity_anova.csv", newline="") as file:
        rows = {row["source"]: row for row in csv.DictReader(file)}
    f = float(rows["B*C"]["mean_square"]) / float(rows["residual"]["mean_square"])
    assert agrees(f, "1.20")
    assert not agrees(f, rows["B*C"]["f"])


def test_statistics_are_as_printed():
    # Montgomery, Table 11-6: the Design-Expert output of Example 11-1
    printed = {
        "std_dev": "0.27",
        "mean": "78.48",
        "cv_percent": "0.34",
        "press": "2.35",
        "r2": "0.9828",
        "adjusted_r2": "0.9705",
        "predicted_r2": "0.9184",
        "adequate_precision": "23.018",
    }
    found = compute_statistics(model_of("chemical_process"))
    assert set(found) == set(printed)
    assert [
        name for name, value in printed.items() if not agrees(found[name], value)
    ] == []


def test_coefficients_are_as_printed():
    # the vignette's table: estimate, standard error, t, p; R rounds t to four digits before it prints three of them
    printed = {
        "A": ("0.932541", "0.057699", "16.162", "0.0000008444"),
        "B": ("0.577712", "0.057699", "10.012", "0.00002122"),
        "A*B": ("0.125000", "0.081592", "1.532", "0.1694"),
        "A^2": ("-1.308555", "0.060064", "21.786", "0.0000001083"),
        "B^2": ("-0.933442", "0.060064", "15.541", "0.000001104"),
    }
    table = list_effects(model_of("chemical_reaction")).set_index("term")
    columns = ["coefficient", "standard_error", "t", "p"]
    for term, row in printed.items():
        for column, text in zip(columns, row, strict=True):
            value = float(table.loc[term, column])
            assert agrees(round(value, 4) if column == "t" else value, text), (
                term,
                column,
            )


def test_the_constant_and_pure_error_of_a_blocked_design():
    # the vignette has 84.095427 for the first block and -4.457530 for the second
    model = model_of("chemical_reaction")
    assert model.constant == pytest.approx(84.095427 - 4.457530 / 2, abs=1e-6)
    assert model.predict(np.zeros((1, 3)))[0] == pytest.approx(model.constant)
    assert compute_pure_error(model_of("chemical_reaction"))[1] == 4, (
        "two and two centre runs"
    )
    runs = pd.read_csv(PRINTED / "chemical_reaction_runs.csv")
    assert (
        compute_pure_error(
            fit_model(runs[["A", "B"]], runs["response"], "AB", "quadratic")
        )[1]
        == 5
    )


def test_the_squares_of_a_term_are_what_leaving_it_out_adds():
    model = model_of("viscosity")
    table = make_anova_table(model).set_index("source")
    for term, name in zip(model.terms, model.labels, strict=True):
        without = fit_model(
            model.coded,
            model.response,
            model.factors,
            [other_term for other_term in model.terms if other_term != term],
        )
        expected = without.residual_squares - model.residual_squares
        assert table.loc[name, "sum_of_squares"] == pytest.approx(expected, rel=1e-9)


def test_press_is_the_sum_over_predictions_that_leave_out_a_run():
    model = model_of("chemical_process")
    total = 0.0
    for k in range(len(model.response)):
        kept = np.arange(len(model.response)) != k
        without = fit_model(
            model.coded[kept], model.response[kept], model.factors, model.terms
        )
        total += float(
            (model.response[k] - without.predict(model.coded[k : k + 1])[0]) ** 2
        )
    assert compute_statistics(model)["press"] == pytest.approx(total, rel=1e-9)


def four_runs(order):
    return fit_model(
        np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]),
        [1.0, 2.0, 3.0, 4.5],
        "AB",
        order,
    )


def test_four_runs_have_no_lack_of_fit_test_nothing_when_saturated_and_share_r2():
    table = make_anova_table(four_runs("linear"))
    assert list(table["source"]) == ["model", "A", "B", "residual", "total"]
    model = four_runs("interaction")
    assert make_anova_table(model)["p"].isna().all()
    assert math.isnan(compute_pareto_limits(model)["t"])
    assert math.isnan(compute_statistics(model)["predicted_r2"])
    model = four_runs("linear")
    table = list_effects(model)
    assert list(table["term"]) == ["B", "A"]
    expected = 100 * compute_statistics(model)["r2"]
    assert table["contribution_percent"].sum() == pytest.approx(expected)


def test_pareto_limits_the_error_of_a_mean_and_runs_that_determine_no_model():
    # t distribution with 7 degrees of freedom: 2.365 at 5 % in any table
    found = compute_pareto_limits(model_of("chemical_process"))
    assert found["t"] == pytest.approx(2.3646, abs=1e-4)
    # 5 terms: 1 % for each, 3.499 in any table
    assert found["bonferroni"] == pytest.approx(3.4995, abs=1e-4)
    # the mean of n runs has the standard error s / sqrt(n)
    model = fit_model(
        np.array([[-1.0], [1.0], [-1.0], [1.0]]), [1.0, 2.0, 1.4, 2.2], ["A"], "linear"
    )
    found = model.standard_error(np.zeros((1, 1)))[0]
    assert found == pytest.approx(compute_statistics(model)["std_dev"] / 2)
    value_error(
        "expected all 3", fit_model, [[0.0], [1.0]], [1.0, 2.0], ["A"], "quadratic"
    )


def surface(function):
    return fit_model(RUNS, function(*RUNS.T), "ABC", "quadratic")


def test_a_target_is_met_at_the_foot_of_the_perpendicular():
    """Of all points with 10 + 3 A + 4 B = 12 the nearest to the centre is (3, 4) * 2 / 25."""
    found = find_optimum(
        [surface(lambda a, b, c: 10 + 3 * a + 4 * b)], [12], [12], [9], [15]
    )
    assert found.met
    assert found.coded == pytest.approx([6 / 25, 8 / 25, 0], abs=1e-6)
    assert found.desirability == pytest.approx(1, abs=1e-5)


def test_two_targets_are_met_together_as_near_to_the_centre_as_can_be():
    models = [
        surface(lambda a, b, c: 32 + 2 * a - b + 0.6 * a * b - 0.5 * c**2),
        surface(lambda a, b, c: 65 + a + 3 * c + 0.8 * b**2),
    ]
    found = find_optimum(models, [33.0, 66.0], [33.0, 66.0], [31, 64], [35, 68])
    assert found.met
    assert found.predicted == pytest.approx([33, 66], abs=1e-4)
    # nothing nearer to the centre meets both: a fine grid of the ball inside
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 81)] * 3), axis=-1).reshape(-1, 3)
    inside = grid[np.linalg.norm(grid, axis=1) < np.linalg.norm(found.coded) - 0.05]
    missed = np.abs(models[0].predict(inside) - 33) / 2
    missed += np.abs(models[1].predict(inside) - 66) / 3
    assert missed.min() > 0.03


def test_an_optimum_out_of_reach_is_the_edge_and_weights_share_a_miss_and_desirability_is_a_tent():
    found = find_optimum(
        [surface(lambda a, b, c: 10 + 3 * a + 4 * b)], [30], [30], [20], [40]
    )
    assert not found.met
    assert found.coded[:2] == pytest.approx([1, 1])
    assert found.predicted[0] == pytest.approx(17)
    assert found.desirability == 0
    # 10 + 3 A cannot be 11 and 12 at once: with scales 1 and 1 it ends in the middle, with 1 and 2 nearer to the first
    plane = surface(lambda a, b, c: 10 + 3 * a)
    assert find_optimum([plane, plane], [11, 12], [1, 1], [0, 0], [20, 20]).predicted[
        0
    ] == pytest.approx(11.5, abs=1e-4)
    assert find_optimum([plane, plane], [11, 12], [1, 2], [0, 0], [20, 20]).predicted[
        0
    ] == pytest.approx(11.2, abs=1e-4)
    found = compute_desirability(
        [[10], [11], [12], [13.5], [15], [16]], [12], [10], [15]
    )
    assert found == pytest.approx([0, 0.5, 1, 0.5, 0, 0])
    expected = [0.5**0.5]
    assert compute_desirability([[11, 5]], [12, 5], [10, 4], [15, 6]) == pytest.approx(
        expected
    )
