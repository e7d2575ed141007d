"""The inversion of a surrogate with known answers."""

import json

import numpy as np
import pandas as pd
import pytest
import shared
from refusals import input_error
from stage_runs import searched

from repose.bench.parameters import PARAMETERS
from repose.calibrate import inversion as invert
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets

SETTINGS = MigaSettings(**shared.MIGA)
SPACE = ParameterSpace(PARAMETERS, np.zeros(6), np.full(6, 2.0))


def targets(aor=30.5, aor_range=(29.0, 32.0), height_range=(63.0, 68.0)):
    first, second = shared.TARGETS
    angle = {"aim": aor, "range": list(aor_range)}
    height = {"aim": 65.0, "range": list(height_range)}
    return Targets.of([first | angle, second | height])


TARGETS = targets()


def study(expected=TARGETS, settings=SETTINGS, **more):
    return shared.study_of(expected, SPACE, miga=settings, **more)


def write_inputs(folder, reach):
    """A network that is nearly linear: AoR 28 + reach x mean(x), Height 64 + mean(x), x in 0 to 2."""
    small = 1e-3
    W1 = np.zeros((2, 6))
    W1[0] = small
    W1[1, 4] = small
    network = {
        "surrogate": "network",
        "inputs": list(PARAMETERS),
        "outputs": ["aor_deg", "height_mm"],
        "scaled_range": [0.0, 1.0],
        "input_min": [0.0] * 6,
        "input_max": [1.0] * 6,
        "output_min": [0.0, 0.0],
        "output_max": [1.0, 1.0],
        "W1": W1.tolist(),
        "b1": [0.0, 0.0],
        "W2": [[reach / 6 / small, 0.0], [0.0, 1.0 / small]],
        "b2": [28.0, 64.0],
    }
    (folder / "network.json").write_text(json.dumps(network))
    rows = [(name, 0.1, 0.2, 5.0) for name in PARAMETERS]
    columns = ["parameter", "low", "high", "dispersion_percent"]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "table3.csv", index=False)
    return folder / "network.json", folder / "table3.csv"


@pytest.fixture(scope="module", params=[2.0, 0.2], ids=["reachable", "out of reach"])
def outcome(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("miga")
    network_json, table3 = write_inputs(folder, request.param)
    return (
        request.param == 2.0,
        searched(network_json, study(), table3, folder / "out"),
        folder / "out",
    )


def test_run_says_whether_the_box_was_reached_with_solutions_and_tables_beside_the_published(
    outcome, tmp_path
):
    reachable, summary, out = outcome
    network_json, table3 = write_inputs(tmp_path, 2.0 if reachable else 0.2)
    searched(network_json, study(), table3, tmp_path)
    expected = (out / "feasible.csv").read_bytes()
    assert (tmp_path / "feasible.csv").read_bytes() == expected
    assert json.loads((out / "summary.json").read_text()) == summary
    solutions = pd.read_csv(out / "feasible.csv")
    assert summary["feasible"] is reachable
    assert (solutions["feasible"] == reachable).all()
    assert len(solutions) == 30
    assert solutions["representative"].tolist() == [True] + [False] * 29
    assert (summary["n_feasible_met"] > 0) is reachable
    if reachable:
        assert summary["box_distance"] == {"aor_deg": 0.0, "height_mm": 0.0}
        assert solutions["aor_predicted_deg"].between(29, 32).all()
        assert "distinct feasible solutions" in summary["message"]
    else:  # five inputs at 2, and mus_gp at 1, where the last 0.03 deg would cost a mm of Height
        expected = 0.6 + 0.2 / 6
        assert summary["box_distance"]["aor_deg"] == pytest.approx(expected, abs=1e-3)
        assert summary["target_distance"]["aor_deg"] == pytest.approx(
            2.1 + 0.2 / 6, abs=1e-3
        )
        assert summary["message"].startswith(
            "All later stages use the nearest solutions: the prediction for the answer is "
        )
        assert "0.63 deg and 0.00 mm outside the ranges" in summary["message"]
    X = solutions[list(PARAMETERS)].to_numpy()
    assert ((X >= 0) & (X <= 2)).all()
    assert (np.diff(solutions["objective"]) >= 0).all()
    if reachable:
        F = (solutions["aor_predicted_deg"] - 30.5).abs() / 3 + (
            solutions["height_predicted_mm"] - 65
        ).abs() / 5
        np.testing.assert_allclose(solutions["objective"], F, atol=1e-12)
    # ranges of width 2: already normalised
    gaps = np.linalg.norm(X[:, None] - X, axis=2) + 9 * np.eye(len(X))
    assert gaps.min() >= 0.05 - 1e-12
    intervals = pd.read_csv(out / "intervals.csv")
    assert intervals["variable"].tolist() == list(PARAMETERS)
    width = solutions["mus_gp"].max() - solutions["mus_gp"].min()
    row = intervals.set_index("variable").loc["mus_gp"]
    assert row["dispersion_percent"] == pytest.approx(100 * width / 2)
    assert row["published_dispersion_percent"] == 5.0
    history = pd.read_csv(out / "history.csv")
    assert history["evaluations"].tolist() == [2000 * k for k in range(1, 41)]
    assert (np.diff(history["best_objective"]) <= 0).all()


def test_without_a_feasible_solution_the_least_objective_counts_and_not_the_edge_of_the_box(
    tmp_path,
):
    """Angle and Height fall and rise together: where the angle's box begins, the Height is far off its target."""
    network_json, table3 = write_inputs(tmp_path, 2.0)
    content = json.loads(network_json.read_text())
    content["W1"][0] = [0.0, 0.0, 0.0, 0.0, content["W1"][1][4], 0.0]
    content["W2"][0][0] = 0.5 * content["W2"][1][1]  # 28 + 0.5 x deg at 64 + x mm
    network_json.write_text(json.dumps(content))
    summary = searched(
        network_json,
        study(targets(30.5, (29.5, 32.0), (64.0, 66.0))),
        table3,
        tmp_path / "out",
    )
    assert not summary["feasible"]
    assert summary["evaluations"] == 2 * 80_000
    best = summary["representative"]
    # F = (2.5 - x / 2) / 2.5 + |1 - x| / 2 falls to x = 1 and rises behind it; the nearest to the box is x = 2
    assert best["height_predicted_mm"] == pytest.approx(65.0, abs=1e-3)
    assert best["objective"] == pytest.approx(0.8, abs=1e-3)


class Sure:
    """AoR 28 + x4, Height 64 + x4; its error is least at x0 = 0.5."""

    inputs = ()
    can_predict_errors = True

    def predict(self, X):
        return np.column_stack([28 + X[:, 4], 64 + X[:, 4]])

    def covariance(self, X):
        return (0.1 + 9 * (X[:, 0] - 0.5) ** 2)[:, None, None] * np.eye(2)

    def response_function(self, low, high):
        return lambda points: self.predict(low + (points + 1) / 2 * (high - low))


@pytest.mark.parametrize("answer", ["least_expected_loss", "least_objective"])
def test_the_answer_is_the_set_of_least_expected_loss_or_of_least_objective(answer):
    settings = SETTINGS.model_copy(update={"answer": answer, "rounds": 10})
    table = invert.invert(
        Sure(), SPACE, targets(29.0, (28.5, 29.5)), settings
    ).solutions
    assert table["representative"].tolist() == [True] + [False] * 29
    assert (abs(table["e_gg"][0] - 0.5) < 0.01) == (answer == "least_expected_loss")
    assert (table["objective"].idxmin() == 0) == (answer == "least_objective")
    assert table["objective"][1:].is_monotonic_increasing
    assert table["feasible"].all()


def test_few_feasible_solutions_are_followed_by_the_nearest(tmp_path):
    network_json, table3 = write_inputs(tmp_path, 2.0)
    summary = searched(
        network_json,
        study(targets(32.0, (31.999, 34.0), (65.0, 68.0))),
        table3,
        tmp_path,
    )
    solutions = pd.read_csv(tmp_path / "feasible.csv")
    assert len(solutions) == 10
    assert 0 < summary["n_solutions"] == solutions["feasible"].sum() < 10
    assert solutions["feasible"].is_monotonic_decreasing


def middle_support(low, high):
    """Samples in the middle of the ranges alone."""
    points = np.random.RandomState(1).uniform(low, high, (60, 6))
    return Support(points, np.zeros(6), np.full(6, 2.0), PARAMETERS)


def test_solutions_beyond_the_samples_carry_a_warning(tmp_path):
    """Sets that meet the targets lie all over the ranges."""
    network_json, table3 = write_inputs(tmp_path, 2.0)
    support = middle_support(0.3, 1.7)
    brief = SETTINGS.model_copy(update={"rounds": 5})
    summary = searched(network_json, study(settings=brief), table3, tmp_path, support)
    table = pd.read_csv(tmp_path / "feasible.csv", keep_default_na=False)
    assert table.columns[-1] == "warning"
    X = table[list(PARAMETERS)].to_numpy()
    is_beyond = support.is_sparse(X) | support.at_bounds(X).any(axis=1)
    assert is_beyond.any()
    assert ((table["warning"] != "") == is_beyond).all()
    warning = table["warning"].iloc[0]
    assert (
        summary["message"].endswith(f"Beyond the samples: {warning}.") == is_beyond[0]
    )


@pytest.mark.parametrize(
    ("reach", "aor", "aor_range", "is_at_ends"),
    [
        # No set is predicted inside the ranges.
        (0.2, 30.5, (29.0, 32.0), True),
        # Sets are, but beyond the samples alone.
        (2.0, 31.6, (31.5, 31.8), False),
    ],
)
def test_targets_that_no_samples_bear_out_have_the_nearest_among_the_samples(
    tmp_path, reach, aor, aor_range, is_at_ends
):
    network_json, table3 = write_inputs(tmp_path, reach)
    support = middle_support(0.5, 1.5)
    brief = SETTINGS.model_copy(update={"rounds": 5})
    settings = study(targets(aor, aor_range), brief)
    summary = searched(network_json, settings, table3, tmp_path, support)
    table = pd.read_csv(tmp_path / "feasible.csv", keep_default_na=False)
    assert not summary["feasible"]
    assert summary["n_feasible_met"] == 0
    assert (table["warning"] == "").all()
    # The angle grows with every parameter: the answer is at the edge of the samples.
    assert table[list(PARAMETERS)].iloc[0].mean() > 1.2
    # Where the search came nearer at an end without samples, this is no verdict.
    assert (summary.get("stop") == "ends_not_simulated") == is_at_ends


def test_bad_tables_are_refused(tmp_path):
    network_json, table3 = write_inputs(tmp_path, 2.0)
    input_error(
        r"aor_deg is 40.*\[29.0, 32.0\]",
        searched,
        network_json,
        study(targets(40)),
        table3,
        tmp_path,
    )
    table3.write_text("variable,low\n")
    input_error(
        r"table3.csv: column parameter",
        searched,
        network_json,
        study(),
        table3,
        tmp_path,
    )


def test_a_network_of_other_definitions_or_outputs_is_refused(tmp_path):
    network_json, table3 = write_inputs(tmp_path, 2.0)
    content = json.loads(network_json.read_text())
    network_json.write_text(
        json.dumps(
            content | {"definitions": {"aor_deg": {"measure.response": "flank"}}}
        )
    )
    secant = study(definitions={"aor_deg": {"measure.response": "secant"}})
    single_target = (
        study(Targets(TARGETS[:1])),
        "outputs is .*; expected the targets aor_deg",
    )
    for other, message in (
        (secant, "definition of aor_deg is .*flank.*secant.*my.yaml"),
        single_target,
    ):
        input_error(
            f"network.json: {message}",
            searched,
            network_json,
            other,
            table3,
            tmp_path,
            source="my.yaml",
        )


def test_a_study_without_published_intervals_has_its_own():
    cloud = pd.DataFrame({name: [0.1, 0.3] for name in PARAMETERS})
    space = ParameterSpace(
        PARAMETERS[1:],
        np.full(5, -1.0),
        np.full(5, 1.0),
        {"e_gg": 0.2},
        names=PARAMETERS,
    )
    table = invert.make_interval_table(cloud.assign(e_gg=0.2), space)
    assert table.columns.tolist() == ["variable", "low", "high", "dispersion_percent"]
    assert table["dispersion_percent"].tolist() == pytest.approx([0.0] + 5 * [10.0])
