"""The answer: what it says first, and its chance."""

import json
import re
import textwrap
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shared
from refusals import input_error
from scipy import stats
from shared import ROOT, says, studied, targets_of
from stage_runs import answer_of

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate import answer, expected_loss, strategies
from repose.calibrate.chance import compute_target_probabilities
from repose.calibrate.targets import Targets
from repose.stages import answer as stages_answer

TARGET = shared.target("aor_deg", 32.0, 2.0, 31.0, 34.0)
HANDLER = re.search(
    r"^onsuccess:\n((?: {4}.*\n|\n(?= ))+)",
    (ROOT / "workflow/Snakefile").read_text(),
    re.MULTILINE,
)
SPACE = contact_space({name: [0.0, 1.0] for name in PARAMETERS})
TARGETS = targets_of(height_mm=66.0)


def study(folder, simulated, feasible=True):
    """Configuration of a study whose search and check are written to folder."""
    summary = {
        "feasible": feasible,
        "message": "The search: nothing met.",
        "representative": dict.fromkeys(PARAMETERS, 0.25),
    }
    for name in ("miga", "validation"):
        (folder / name).mkdir()
    (folder / "miga/summary.json").write_text(json.dumps(summary))
    header = "response,simulated,simulated_se,n_seeds,status,within_1_percent,within_2_percent"
    row = f"aor_deg,{simulated},0.25,16,ok,{'0.25,0.75' if simulated else ','}"
    (folder / "validation/representative.csv").write_text(f"{header}\n{row}\n")
    return {"label": "wheat", "results_dir": str(folder), "targets": [TARGET]}


def read(config, **options):
    names = ("miga/summary.json", "validation/representative.csv", "miga/feasible.csv")
    return answer_of(
        studied(config),
        *(f"{config['results_dir']}/{name}" for name in names),
        **options,
    )


@pytest.mark.parametrize(
    ("simulated", "met", "margin"),
    [
        (33.5, True, 0.5),
        (31.5, True, 0.5),
        (30.0, False, -1.0),
        (36.0, False, -2.0),
    ],
)
def test_the_margin_is_the_way_to_the_nearer_end_of_the_range(
    simulated, met, margin, tmp_path
):
    found = read(study(tmp_path, simulated))
    assert found.verdict.met is met
    assert found.checks[0].margin == margin
    assert found.within == {1.0: 0.25, 2.0: 0.75}


def test_targets_that_are_met_are_said_to_be_met_first(tmp_path):
    found = read(study(tmp_path, 33.5))
    lines = str(found).splitlines()
    assert lines[0] == (
        "wheat: targets met. Angle of repose 33.50 +- 0.25 deg (measured 32, +4.7 %)."
    )
    assert lines[1] == "The calibrated parameters:"
    assert lines[-1].startswith("Tables: ")
    assert found.reason == "The simulated mean lies inside the range."
    assert str(found).count("targets met") == 1
    assert "NOT met" not in str(found)


def test_an_answer_with_a_card_of_its_own_names_it_and_the_first_one(tmp_path):
    config = study(tmp_path, 33.5)
    folder = tmp_path / "refined"
    found = read(config, card_dir=folder)
    lines = str(found).splitlines()
    assert f"report: {folder}/report.html, and the material card: " in lines[-2]
    assert lines[-2].endswith(f"{folder}/card.json")
    assert lines[-1] == (
        f"The study's first answer stays in {tmp_path}/report.html and {tmp_path}/card.json."
    )


@pytest.mark.parametrize(
    ("simulated", "numbers", "reason"),
    [
        (
            30.0,
            "Angle of repose 30.00 +- 0.25 deg (measured 32, -6.2 %).",
            "The simulated angle of repose lies 1 deg below its range",
        ),
        (
            36.0,
            "Angle of repose 36.00 +- 0.25 deg (measured 32, +12.5 %).",
            "The simulated angle of repose lies 2 deg above its range",
        ),
    ],
)
def test_targets_that_are_missed_are_said_to_be_missed_first(
    simulated, numbers, reason, tmp_path
):
    found = read(study(tmp_path, simulated))
    lines = str(found).splitlines()
    assert lines[0] == f"wheat: targets NOT met. {numbers} {reason}."
    assert lines[1] == "The calibrated parameters:"
    assert lines[-1].startswith("What helps: `repose run refined`")
    assert found.reason == f"{reason}."
    assert str(found).count("targets NOT met") == 1


def test_the_answer_compares_simulation_and_measurement_and_has_all_parameters(
    tmp_path,
):
    text = str(read(study(tmp_path, 33.5)))
    for name in PARAMETERS:
        assert name in text
    # 33.5 is 1.5 deg above 32, and a repetition has a standard deviation of 2 deg.
    assert (
        "Simulated minus measured: "
        "aor_deg +4.7 +- 0.8 % (0.75 of the standard deviation of single measurements)."
        in text
    )
    assert "by these runs alone: within 1 %: 0.25, within 2 %: 0.75" in text


def test_a_prediction_outside_the_targets_is_no_answer_even_where_the_simulation_is_inside(
    tmp_path,
):
    found = read(study(tmp_path, 32.5, feasible=False))
    assert found.verdict is answer.Verdict.NOT_MET
    lines = str(found).splitlines()
    assert lines[0].startswith(
        "wheat: targets NOT met. Angle of repose 32.50 +- 0.25 deg"
    )
    reason = " No parameter set is predicted inside the range; the simulated mean lies inside the range."
    assert lines[0].endswith(reason)
    assert lines[1:3] == ["The search: nothing met.", "The nearest parameters:"]
    assert lines[-1].startswith("What helps: wider ranges of parameters or targets; ")
    assert found.out_of_reach


def test_failed_runs_have_no_number_and_a_study_that_has_not_run_is_reported(tmp_path):
    found = read(study(tmp_path, ""))
    assert found.verdict is answer.Verdict.NOT_MET
    assert np.isnan(found.checks[0].margin)
    assert "no number" in str(found)
    reason = "The angle of repose has no number."
    assert found.headline.endswith(
        f"Angle of repose without a number (measured 32). {reason}"
    )
    assert found.within == {1.0: None, 2.0: None}
    assert "the distance of the means from their targets is unknown" in str(found)
    input_error(
        r"summary\.json",
        read,
        {"label": "wheat", "results_dir": str(tmp_path / "no"), "targets": [TARGET]},
    )


def test_a_small_run_says_so_first(tmp_path):
    first = str(read(study(tmp_path, 32.0) | {"small_run": True})).splitlines()[0]
    sentence = "Angle of repose 32.00 +- 0.25 deg (measured 32, +0.0 %)."
    expected = (
        f"wheat: a small run, its numbers are no calibration: targets met. {sentence}"
    )
    assert first == expected


def test_a_force_of_thousands_of_newtons_is_written_without_an_exponent():
    check = answer.Check(
        response="force",
        apparatus="own",
        unit="N",
        measured=12_340.0,
        sd=300.0,
        repetitions=5,
        low=12_000.0,
        high=12_700.0,
        simulated=12_250.0,
        standard_error=150.0,
        runs=9,
        status="ok",
    )
    expected = (
        "force: simulated 12250 +- 150 N (runs: 9), measured 12340; target 12000 to "
        "12700 N: "
    )
    assert str(check).startswith(expected)
    assert str(check).endswith(", 250 N inside")


def of_two(feasible=True, out_of_reach=False, angle=32.0, height=66.0, status="ok"):
    """The answer of a study with an angle in 31-34 deg and a length in 64-68 mm."""
    common = {"repetitions": 5, "runs": 9, "status": status}
    checks = (
        answer.Check(
            response="aor_deg",
            apparatus="funnel",
            unit="deg",
            measured=32.0,
            sd=2.0,
            low=31.0,
            high=34.0,
            simulated=angle,
            standard_error=None if angle is None else 0.4,
            predicted=32.5,
            **common,
        ),
        answer.Check(
            response="my_mm",
            apparatus="own",
            unit="mm",
            measured=66.0,
            sd=2.0,
            low=64.0,
            high=68.0,
            simulated=height,
            standard_error=0.5,
            **common,
        ),
    )
    return answer.Result(
        "two", {}, feasible, "", checks, Path(), {}, out_of_reach=out_of_reach
    )


@pytest.mark.parametrize(
    ("changes", "met", "reason"),
    [
        (
            {},
            True,
            "The simulated means lie inside both ranges.",
        ),
        (
            {"height": 70.0},
            False,
            "The simulated my_mm lies 2 mm above its range.",
        ),
        (
            {"angle": 30.0, "height": 63.0},
            False,
            "The simulated angle of repose lies 1 deg below its range and the simulated "
            "my_mm lies 1 mm below its range.",
        ),
        (
            {"angle": 30.0, "feasible": False, "out_of_reach": True},
            False,
            "No parameter set is predicted inside both ranges; the simulated angle of "
            "repose lies 1 deg below its range.",
        ),
        (
            {"feasible": False},
            False,
            "The answer is not predicted inside both ranges; the simulated means lie "
            "inside both ranges.",
        ),
        (
            {"angle": None, "height": None, "status": answer.NOT_SIMULATED_AGAIN},
            None,
            "The answer is predicted inside both ranges; the answer was not simulated "
            "again.",
        ),
    ],
)
def test_the_reason_says_which_response_misses_by_how_much(changes, met, reason):
    found = of_two(**changes)
    assert found.verdict.met is met
    assert found.reason == reason
    # A verdict that is good needs no reason.
    assert found.headline.endswith(reason) is not bool(met)


@pytest.mark.parametrize(("angle", "side"), [(31.1, "inside"), (30.9, "outside")])
def test_a_mean_within_its_own_error_of_an_end_of_the_range_is_undecided(angle, side):
    """The standard error is 0.4 deg after nine runs, the range begins at 31 deg."""
    found = of_two(angle=angle)
    of_angle = stats.t(df=8, loc=angle, scale=0.4)
    of_height = stats.t(df=8, loc=66.0, scale=0.5)
    chance_of_angle = of_angle.cdf(34.0) - of_angle.cdf(31.0)
    chance_of_height = of_height.cdf(68.0) - of_height.cdf(64.0)
    assert found.probability == pytest.approx(chance_of_angle * chance_of_height)
    assert found.verdict is answer.Verdict.UNDECIDED
    assert found.verdict.met is None
    assert found.headline.startswith("two: targets undecided. Angle of repose ")
    percent = f"{100 * found.probability:.0f} %"
    says(
        found.reason, f"inside with a probability of {percent}; about ", "would decide"
    )
    says(str(found), "a larger validation.representative_seeds", f" deg {side}\n")


def test_the_further_runs_that_would_decide_are_the_fewest():
    found = of_two(angle=31.1)
    further = answer.count_further_runs(found.checks)

    def probability(runs):
        """That both means lie inside, with the errors that so many runs would have."""
        product = 1.0
        for check in found.checks:
            error = check.standard_error * np.sqrt(9 / runs)
            mean = stats.t(df=runs - 1, loc=check.simulated, scale=error)
            product *= mean.cdf(check.high) - mean.cdf(check.low)
        return product

    assert probability(9 + further) >= 0.95 > probability(9 + further - 1)
    on_the_end = of_two(angle=31.0)
    assert answer.count_further_runs(on_the_end.checks) is None
    says(on_the_end.reason, "more than 1000 further runs would decide")


def test_runs_together_decide_by_their_joint_probability():
    """Each mean is inside with 96 %; both together, if independent, with 92 %."""
    checks = []
    for name in ("first", "second"):
        error = 1 / stats.t.ppf(0.96, df=15)
        checks.append(
            answer.Check(name, "own", "", 5.0, 1.0, 5, 4.0, 99.0, 5.0, error, 16, "ok")
        )
    apart = answer.Result("two", {}, True, "", tuple(checks), "", {})
    assert apart.probability == pytest.approx(0.96**2)
    assert apart.verdict is answer.Verdict.UNDECIDED
    together = answer.Result("two", {}, True, "", tuple(checks), "", {}, inside=0.955)
    assert together.verdict is answer.Verdict.MET


def test_two_runs_do_not_show_how_two_responses_are_correlated():
    """Through two runs there is always a line: their joint probability is 0 or large."""
    check = answer.Check("a", "own", "", 5.0, 1.0, 5, 4.0, 6.0, 5.0, 0.5, 2, "ok")
    found = answer.Result("two", {}, True, "", (check, check), "", {}, inside=0.0)
    distribution = stats.t(df=1, loc=5.0, scale=0.5)
    expected = (distribution.cdf(6.0) - distribution.cdf(4.0)) ** 2
    assert found.probability == pytest.approx(expected)
    assert found.verdict is answer.Verdict.UNDECIDED


def test_one_run_decides_nothing_and_runs_without_scatter_decide_at_once():
    check = answer.Check("a", "own", "", 5.0, 1.0, 5, 4.0, 6.0, 5.0, None, 1, "ok")
    found = answer.Result("one", {}, True, "", (check,), "", {})
    assert found.verdict is answer.Verdict.UNDECIDED
    says(found.reason, "Fewer than two runs gave a number")
    exact = answer.Check("a", "own", "", 5.0, 1.0, 5, 4.0, 6.0, 6.0, 0.0, 2, "ok")
    assert exact.verdict is answer.Verdict.MET
    missed = answer.Check("a", "own", "", 5.0, 1.0, 5, 4.0, 6.0, 6.1, 0.0, 2, "ok")
    assert missed.verdict is answer.Verdict.NOT_MET


def test_an_answer_that_was_not_simulated_has_its_prediction_in_the_first_line():
    found = of_two(angle=None, height=None, status=answer.NOT_SIMULATED_AGAIN)
    sentence = "Angle of repose predicted 32.5 deg (measured 32, +1.6 %), my_mm without a number (measured 66). "
    assert found.headline.startswith(
        f"two: targets predicted: undecided (probability unknown). {sentence}"
    )


@pytest.mark.parametrize(
    ("summary", "out_of_reach"),
    [
        ({"feasible": True}, False),
        ({"feasible": False}, True),
        ({"feasible": False, "stop": "budget"}, False),
        ({"feasible": False, "stop": "out_of_reach"}, True),
        ({"feasible": True, "stop": "out_of_reach"}, False),
    ],
)
def test_out_of_reach_is_a_miss_that_was_predicted(summary, out_of_reach):
    assert answer.is_out_of_reach(summary) is out_of_reach


@pytest.mark.parametrize("strategy", strategies.names())
@pytest.mark.parametrize("simulated", [32.0, 30.0])
@pytest.mark.parametrize("feasible", [True, False])
def test_a_finished_run_of_each_strategy_prints_the_verdict_first_and_ends_well(
    strategy, simulated, feasible, tmp_path, capsys
):
    """The handler of the workflow; a SystemExit in it would be the status of the run."""
    names = {
        "summary": "miga/summary.json",
        "representative": "validation/representative.csv",
    }
    files = {name: tmp_path / path for name, path in names.items()}
    made = SimpleNamespace(
        rule="conclude", feasible="solutions.csv", table4="t4.csv", **files
    )
    known = {
        "answers": stages_answer,
        "ANSWERS": {strategy: made},
        "RESULTS": str(tmp_path),
        "find_card_folder": lambda strategy: str(tmp_path),
        "STUDY": studied(study(tmp_path, simulated, feasible)),
    }
    known["RUN"] = SimpleNamespace(has_written=lambda path: path == "t4.csv")
    exec(textwrap.dedent(HANDLER[1]), known)
    met = "met" if feasible and simulated == 32.0 else "NOT met"
    assert capsys.readouterr().out.startswith(f"wheat: targets {met}. Angle of repose ")


def runs_of(values, names):
    return [
        dict(zip(names, row, strict=True)) | {"status": "ok"}
        for row in np.asarray(values, float).tolist()
    ]


def test_the_chance_of_a_mean_given_few_runs():
    values = [58.0, 60.0, 63.0]
    jammed = {"status": "jammed", "height_mm": None}
    runs = {"funnel": [*runs_of(np.array(values)[:, None], ["height_mm"]), jammed]}
    targets = targets_of(height_mm=60.0)  # met within 5 %
    mean = stats.t(2, loc=np.mean(values), scale=np.std(values, ddof=1) / np.sqrt(3))
    chances = compute_target_probabilities(runs, targets)
    expected = mean.cdf(63.0) - mean.cdf(57.0)
    expected = {
        "height_mm": pytest.approx(expected, abs=5e-3),
        "all": chances["height_mm"],
    }
    assert chances == expected
    assert compute_target_probabilities(runs, targets, 1.0)["all"] == pytest.approx(
        mean.cdf(60.6) - mean.cdf(59.4), abs=5e-3
    )
    assert compute_target_probabilities(
        {"funnel": [runs["funnel"][0], jammed]}, targets
    ) == {
        "height_mm": None,
        "all": None,
    }


def test_the_chances_of_one_bench_test_depend_on_each_other():
    targets = Targets.of(shared.TARGETS)
    a = np.array([31.2, 33.0, 32.1, 34.3])
    chance = compute_target_probabilities(
        {"funnel": runs_of(np.column_stack([a, 2 * a]), targets.names)}, targets
    )
    expected = min(chance["aor_deg"], chance["height_mm"])
    assert chance["all"] == pytest.approx(expected, abs=0.06)
    assert chance["all"] <= min(chance["aor_deg"], chance["height_mm"])


def test_the_chances_of_two_bench_tests_multiply():
    targets = targets_of(aor_deg=33.0, drum_slip_deg=44.0)
    rng = np.random.default_rng(0)
    runs = {
        "funnel": runs_of(33.5 + 2 * rng.normal(size=(8, 1)), ["aor_deg"]),
        "drum": runs_of(47 + 3 * rng.normal(size=(8, 1)), ["drum_slip_deg"]),
    }
    chance = compute_target_probabilities(runs, targets)
    product = chance["aor_deg"] * chance["drum_slip_deg"]
    assert 0.2 < product < 0.9
    assert chance["all"] == pytest.approx(product, abs=0.005)


class Sure:
    """Height 40 + 40 x0 with an error of 1 mm where x1 is 0.7, larger elsewhere."""

    inputs = ()

    def predict(self, X):
        return 40 + 40 * X[:, :1]

    def covariance(self, X):
        return (1 + 20 * (X[:, 1] - 0.7) ** 2)[:, None, None] ** 2


def test_the_set_of_least_loss_is_the_surest():
    found = expected_loss.minimise_expected_loss(Sure(), SPACE, TARGETS)
    assert found[PARAMETERS[0]] == pytest.approx(0.65, abs=1e-3)
    assert found[PARAMETERS[1]] == pytest.approx(0.7, abs=0.01)
    assert found["height_predicted_mm"] == pytest.approx(66.0, abs=0.02)
    assert found["predicted_se"]["height_mm"] == pytest.approx(1.0, abs=1e-3)
    assert found["expected_error_percent"] == pytest.approx(100 / 66, rel=1e-3)
    expected = 2 * stats.norm.cdf(0.66) - 1
    assert found["within"]["1 %"] == pytest.approx(expected, abs=1e-3)
    expected = 2 * stats.norm.cdf(1.32) - 1
    assert found["within"]["2 %"] == pytest.approx(expected, abs=1e-3)


def test_a_fixed_parameter_stays_in_the_set_of_least_loss():
    space = contact_space(
        {name: [0.0, 0.5] for name in PARAMETERS} | {PARAMETERS[1]: {"fixed": 0.2}}
    )
    found = expected_loss.minimise_expected_loss(Sure(), space, TARGETS)
    assert found[PARAMETERS[1]] == 0.2
    assert found[PARAMETERS[0]] == pytest.approx(0.5, abs=1e-3)


def test_a_prior_decides_what_the_responses_leave_open():
    prior = {"prior": {"mean": 0.2, "sd": 0.1}, "range": [0.0, 1.0]}
    space = contact_space(
        {name: [0.0, 1.0] for name in PARAMETERS} | {PARAMETERS[2]: prior}
    )
    found = expected_loss.minimise_expected_loss(Sure(), space, TARGETS)
    assert found[PARAMETERS[2]] == pytest.approx(0.2, abs=0.01)
    assert found["height_predicted_mm"] == pytest.approx(66.0, abs=0.02)


def test_the_expected_loss_is_the_mean_of_eq_11():
    X = np.full((1, 6), 0.6)
    draws = np.random.default_rng(0).normal(64.0, 1.2, 400_000)
    loss = expected_loss.compute_expected_loss(Sure(), X, TARGETS)[0]
    width = TARGETS[0].high - TARGETS[0].low
    assert loss == pytest.approx(np.mean(np.abs(draws - 66.0)) / width, rel=0.01)


def test_a_prediction_stands_beside_its_expected_optimism(tmp_path):
    config = study(tmp_path, 32.5)
    table = tmp_path / "validation/representative.csv"
    header, row = table.read_text().splitlines()
    added = "predicted,optimism,optimism_se"
    table.write_text(f"{header},{added}\n{row},32.76,0.3761,0.0704\n")
    found = read(config)
    says(
        str(found),
        "Predicted: aor_deg 32.76 deg (expected optimism +0.376 +- 0.070).",
    )
    row = found.checks[0].make_card_entry()
    assert row["optimism"] == 0.3761
    assert row["optimism_error"] == 0.0704
    # without a replicate the optimism is unknown
    table.write_text(f"{header},{added}\n{row_without(table)}\n")
    says(str(read(config)), "Predicted: aor_deg 32.76 deg (expected optimism unknown).")


def row_without(table):
    """The row of a table without its optimism."""
    return table.read_text().splitlines()[1].rsplit(",", 2)[0] + ",,"


def test_a_parameter_near_a_bound_is_named(tmp_path):
    config = study(tmp_path, 32.5)
    assert "At a bound" not in str(read(config))
    summary = tmp_path / "miga/summary.json"
    near = {"parameter": "mus_gg", "value": 0.3588, "bound": 0.35}
    near["standard_error"] = 0.032
    content = json.loads(summary.read_text()) | {"near_bounds": [near]}
    summary.write_text(json.dumps(content))
    says(
        str(read(config)),
        "At a bound of the ranges, as far as the fit can tell: mus_gg 0.3588 is within "
        "one standard error of the fit (0.032) of its bound 0.35.",
    )


@pytest.mark.parametrize(
    ("predicted", "state"),
    [
        (0.999, "predicted: met (more than 99 %)"),
        (0.72, "predicted: undecided (72 %)"),
        (0.02, "predicted: NOT met (2 %)"),
        (None, "predicted: undecided (probability unknown)"),
    ],
)
def test_an_answer_that_was_only_predicted_has_three_states(predicted, state):
    check = answer.Check.from_target(
        TARGETS[0], None, None, 0, answer.NOT_SIMULATED_AGAIN, predicted=66.2
    )
    found = answer.Assessment((check,), feasible=True, inside=predicted)
    assert found.state == state
    assert found.verdict.met is None
    assert str(check).startswith(
        "height_mm 66.2 mm (expected optimism unknown), not simulated again; target "
    )
