"""The budget advisor: its noise, what it says of pours, and that its table is the benchmark's."""

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from scipy.stats import beta, chi2, norm
from shared import ROOT, entries, settings_of, written
from synthetic import TARGETS, study

from repose.bench.parameters import PARAMETERS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies import plan
from repose.calibrate.targets import Targets
from repose.config import cost
from research.answers import hidden_truths

SLOW = [
    pytest.param(name, marks=pytest.mark.slow) for name in ("published", "sequential")
]


def study_of(responses):
    return study(Targets(TARGETS[-responses:]))


def planned(responses, runs=None):
    known = study_of(responses)
    return plan.make_plan(known.parameters, known.targets, "sequential", runs)


def runs_of(sd, samples=400, seed=1):
    """Two runs of each sample that scatter by `sd`, in units of the responses, correlated 0.5."""
    random = np.random.default_rng(seed)
    covariance = np.outer(sd, sd) * [[1, 0.5], [0.5, 1]]
    values = random.normal(50, 10, (samples, 1, 2)) + random.multivariate_normal(
        [0, 0], covariance, (samples, 2)
    )
    table = pd.DataFrame(values.reshape(-1, 2), columns=list(TARGETS.names))
    return table.assign(sample=np.arange(samples).repeat(2), status="ok")


def test_the_noise_of_the_runs_and_errors_of_shares_by_hand():
    sd = np.array([0.5, 2.0])
    found = plan.estimate_noise(runs_of(sd), TARGETS)
    # 400 degrees of freedom: a variance is known to 7 %
    assert found == pytest.approx(np.outer(sd, sd) * [[1, 0.5], [0.5, 1]], rel=0.25)
    assert planned(2, runs_of(sd)).measured
    found = planned(1)
    for percent in (1.0, 2.0):
        by_hand = (
            norm.ppf((1 + plan.CERTAINTY) / 2) * plan.DEFAULT_NOISE_PERCENT / percent
        ) ** 2
        assert found.needed[percent] == int(np.ceil(by_hand))
    assert not found.measured
    runs = runs_of(np.array([0.5, 2.0])).drop_duplicates("sample")
    few = r"a\.csv: runs that determine the noise is 0; expected at least 3"
    input_error(few, plan.estimate_noise, runs, TARGETS, "a.csv")
    shares, trials = pd.Series([0.0, 0.6, 1.0]), pd.Series([40, 40, 80])
    by_hand = [beta(1, 41).std(), beta(25, 17).std(), beta(81, 1).std()]
    assert plan.compute_fraction_error(shares, trials).to_numpy() == pytest.approx(
        by_hand, rel=1e-12
    )
    # 150 jobs of 6 pours of 500 grains took 27.6 MB
    settings = settings_of({"targets": entries(TARGETS), "funnel": {"berries": 500}})
    assert cost.estimate_disk_mb(settings, 900) == pytest.approx(27.6, rel=0.05)
    expected = hidden_truths.success(
        pd.read_csv(ROOT / "research/answers/hidden_truths.csv")
    )
    pd.testing.assert_frame_equal(
        pd.read_csv(plan.SUCCESS_FILE), expected, atol=5e-4, check_dtype=False
    )


CASES = [
    (responses, name)
    for responses in (1, 2)
    for name in ("within_1_percent", "within_2_percent")
]


def campaigns(responses):
    return pd.read_csv(plan.SUCCESS_FILE).query("responses == @responses")


@pytest.mark.parametrize(("responses", "name"), CASES)
def test_a_probability_rises_with_the_pours_and_falls_with_the_scatter(responses, name):
    by_noise = [
        plan.estimate_success(responses, percent)[name].to_numpy()
        for percent in (1.0, 1.1, 1.9, 5.0, 10.0)
    ]
    assert (np.diff(by_noise, axis=1) > 0).all()
    assert (np.diff(by_noise, axis=0) < 0).all()
    assert (np.array(by_noise) > 0).all()
    assert (np.array(by_noise) < 1).all()


@pytest.mark.parametrize(("responses", "name"), CASES)
def test_a_curve_is_the_most_likely_one_and_agrees_with_its_campaigns(responses, name):
    table = campaigns(responses)
    curve = plan.SuccessCurve.fit(table, name)
    probability = np.array(
        [
            float(curve.probability(row.pours, row.noise_percent))
            for row in table.itertuples()
        ]
    )
    trials = table["truths"].to_numpy()
    expected = trials * probability
    successes = trials * table[name].to_numpy()
    # The likelihood is largest where its derivatives by the three coefficients vanish.
    residual = successes - expected
    for term in (1.0, np.log(table["pours"]), np.log(table["noise_percent"])):
        assert np.sum(term * residual) == pytest.approx(0, abs=0.05)
    # Pearson's statistic, although the budgets of a hidden set are not independent.
    statistic = np.sum(residual**2 / (expected * (1 - probability)))
    assert statistic < chi2.ppf(0.99, len(table) - 3)


def test_a_curve_is_found_again_from_its_own_shares():
    made = plan.SuccessCurve(level=-4.0, by_pours=1.5, by_noise=-2.0)
    table = campaigns(1)[["pours", "noise_percent", "truths"]].reset_index(drop=True)
    logit = -4.0 + 1.5 * np.log(table["pours"]) - 2.0 * np.log(table["noise_percent"])
    found = plan.SuccessCurve.fit(table.assign(share=1 / (1 + np.exp(-logit))), "share")
    assert found == pytest.approx(made, abs=0.02)
    falling = table.assign(share=np.where(table["pours"] < 70, 0.9, 0.1))
    assert plan.SuccessCurve.fit(falling, "share").by_pours == pytest.approx(
        0, abs=1e-9
    )


def test_the_budgets_begin_with_the_pours_of_the_start(config):
    section = config["sequential"]
    assert min(planned(1).budgets) == section["start_samples"] * section["seeds"]


def test_no_probability_is_stated_for_another_case_than_that_of_the_campaigns():
    assert planned(2).success is not None
    assert planned(2).differences == ()
    percent = np.array([0.5, 0.5]) / 100 * TARGETS.aim
    names = list(TARGETS.names)
    quiet = planned(2, runs_of(percent)[["sample", "status", *names]])
    assert quiet.success is None
    (difference,) = quiet.differences
    assert difference.startswith("a scatter of 0.5")
    known = study_of(1)
    other = plan.make_plan(known.parameters, known.targets, "published")
    assert (other.success, other.differences) == (None, ("strategy published",))
    fixed = ParameterSpace.of(
        {name: {"fixed": 0.3} for name in PARAMETERS[2:]}
        | {name: [0.1, 0.4] for name in PARAMETERS[:2]}
    )
    few = plan.make_plan(fixed, known.targets, "sequential")
    assert (few.success, few.differences) == (None, ("free parameters: 2",))


@pytest.mark.parametrize("strategy", ["response_surface", *SLOW])
def test_the_configured_strategy_is_in_the_table_and_no_pour_is_timed_before_the_probabilities(
    strategy, tmp_path, monkeypatch, capsys, command, config
):
    before = []

    def timed(*_):
        before.extend(capsys.readouterr().out.splitlines())
        return 1e-7

    monkeypatch.setattr(cost, "measure_grain_step_s", timed)
    path = written(
        tmp_path / "mine.yaml",
        f"strategy: {strategy}\nresults_dir: {tmp_path}/results\n",
    )
    lines = command("plan", "--config", path).out.splitlines()
    marked = [line.split() for line in lines if line.split()[0] == f"*{strategy}"]
    section, budgets = (
        config["response_surface"],
        sorted(set(campaigns(1)["pours"])),
    )
    sets = (
        section["screening_runs"] + section["steps"] + 1 + 24 + 2 * section["centres"]
    )
    design, *checks = (
        sets * seeds for _, sets, seeds in cost.estimate_work(config).runs
    )
    sequential = config["sequential"]["checks"]
    # Pours to learn from and pours to check the answer, for each row of the strategy
    pours = {
        "response_surface": [
            (sets * section["seeds"], section["checks"] * section["seeds"])
        ],
        "sequential": [(budget, sequential) for budget in budgets],
        "published": [(design, sum(checks))],
    }
    assert [(int(row[1]), int(row[2])) for row in marked] == pours[strategy]
    # Where nothing is known of its success, the strategy has one row, its own budget.
    rows = [
        line.split() for line in lines if line.split()[0].strip("*") == "sequential"
    ]
    shown = [int(row[1]) for row in rows]
    most = config["sequential"]["most_pours"]
    assert shown == (budgets if strategy == "sequential" else [most])
    assert lines[-1].startswith("*: the configured strategy")
    # The table of probabilities is only for the strategy that the campaigns followed.
    case = (
        "strategy sequential, 6 free parameters, 1 or 2 targets, a scatter of 1 to 10 %"
    )
    (success,) = [line for line in before if line.startswith("success: ")]
    assert case in success
    assert ("this study is different" in success) == (strategy != "sequential")
    assert any("±" in line for line in before) == (strategy == "sequential")


@pytest.mark.parametrize(("free", "fitting"), [(1, False), (2, False), (3, True)])
def test_a_strategy_that_does_not_fit_is_left_out(
    free, fitting, tmp_path, monkeypatch, command
):
    monkeypatch.setattr(cost, "measure_grain_step_s", lambda *_: 1e-7)
    fixed = "".join(f"  {name}: {{fixed: 0.3}}\n" for name in PARAMETERS[free:])
    text = f"parameters:\n{fixed}results_dir: {tmp_path}/results\nmeasure: {{response: whole}}\n"
    out = command("plan", "--config", written(tmp_path / "mine.yaml", text)).out
    lines = [line.split() for line in out.splitlines()]
    assert lines[0][:5] == ["reach:", "WARNING:", "Target", "out", "of"]
    assert (["response_surface"] in [line[:1] for line in lines]) == fitting
    assert (
        ["response_surface:", "not", "with"] in [line[:3] for line in lines]
    ) != fitting
    assert ["sequential"] in [line[:1] for line in lines]
