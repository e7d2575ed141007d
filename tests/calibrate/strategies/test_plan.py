"""The budget advisor: its noise, what it says of pours, and that its table is the benchmark's."""

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from scipy.stats import beta, norm
from shared import ROOT, entries, settings_of, written
from synthetic import TARGETS, study

from repose.bench.parameters import PARAMETERS
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
    return plan.plan(known.parameters, known.targets, runs)


def runs_of(sd, samples=400, seed=1):
    """Two runs of each sample that scatter by `sd`, in units of the responses, correlated 0.5."""
    random = np.random.default_rng(seed)
    covariance = np.outer(sd, sd) * [[1, 0.5], [0.5, 1]]
    values = random.normal(50, 10, (samples, 1, 2)) + random.multivariate_normal(
        [0, 0], covariance, (samples, 2)
    )
    table = pd.DataFrame(values.reshape(-1, 2), columns=list(TARGETS.names))
    return table.assign(sample=np.arange(samples).repeat(2), status="ok")


def test_the_noise_of_the_runs_and_chances_between_scatters_by_hand():
    sd = np.array([0.5, 2.0])
    found = plan.measured_noise(runs_of(sd), TARGETS)
    # 400 degrees of freedom: a variance is known to 7 %
    assert found == pytest.approx(np.outer(sd, sd) * [[1, 0.5], [0.5, 1]], rel=0.25)
    assert planned(2, runs_of(sd)).measured
    found = planned(1)
    for percent in (1.0, 2.0):
        by_hand = (
            norm.ppf((1 + plan.CERTAINTY) / 2) * plan.NOISE_PERCENT / percent
        ) ** 2
        assert found.needed[percent] == int(np.ceil(by_hand))
    assert not found.measured
    runs = runs_of(np.array([0.5, 2.0])).drop_duplicates("sample")
    few = r"a\.csv: runs that determine the noise is 0; expected at least 3"
    input_error(few, plan.measured_noise, runs, TARGETS, "a.csv")
    table = pd.read_csv(plan.SUCCESS).query("responses == 1")
    low, high = sorted(table["noise_percent"].unique())[:2]
    own = [
        table[table["noise_percent"] == one]["within_1_percent"].to_numpy()
        for one in (low, high)
    ]
    assert plan.success_by_budget(1, low)[
        "within_1_percent"
    ].to_numpy() == pytest.approx(own[0])
    middle = plan.success_by_budget(1, float(np.sqrt(low * high)))[
        "within_1_percent"
    ].to_numpy()
    assert middle == pytest.approx((own[0] + own[1]) / 2)
    shares, trials = pd.Series([0.0, 0.6, 1.0]), pd.Series([40, 40, 80])
    by_hand = [beta(1, 41).std(), beta(25, 17).std(), beta(81, 1).std()]
    assert plan.share_error(shares, trials).to_numpy() == pytest.approx(
        by_hand, rel=1e-12
    )
    # 150 jobs of 6 pours of 500 grains took 27.6 MB
    settings = settings_of({"targets": entries(TARGETS), "funnel": {"berries": 500}})
    assert cost.disk_mb(settings, 900) == pytest.approx(27.6, rel=0.05)
    expected = hidden_truths.success(
        pd.read_csv(ROOT / "research/answers/hidden_truths.csv")
    )
    pd.testing.assert_frame_equal(
        pd.read_csv(plan.SUCCESS), expected, atol=5e-4, check_dtype=False
    )


@pytest.mark.parametrize("percent", [0.1, 1.1, 1.9, 5.0, 30.0])
@pytest.mark.parametrize("responses", [1, 2])
def test_no_chance_is_stated_below_the_pours_of_the_start_nor_above_that_of_campaigns(
    percent, responses, config
):
    sd = np.array([percent, percent]) / 100 * TARGETS.aim
    names = list(TARGETS.names)[-responses:]
    found = planned(responses, runs_of(sd)[["sample", "status", *names]]).budgets
    section = config["sequential"]
    assert found["pours"].min() == section["start_samples"] * section["seeds"]
    campaigns = pd.read_csv(plan.SUCCESS).query("responses == @responses")
    for name in ("within_1_percent", "within_2_percent"):
        by_pours = campaigns.groupby("pours")[name]
        assert (found[name].to_numpy() <= by_pours.max().to_numpy() + 1e-12).all()
        assert (found[name].to_numpy() >= by_pours.min().to_numpy() - 1e-12).all()


@pytest.mark.parametrize("strategy", ["response_surface", *SLOW])
def test_the_configured_strategy_is_in_the_table_and_no_pour_is_timed_before_the_probabilities(
    strategy, tmp_path, monkeypatch, capsys, command, config
):
    def timed(*_):
        assert "probability that the answer" in capsys.readouterr().out
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
        plan.success_by_budget(1, 5.0)["pours"],
    )
    sets = (
        section["screening_runs"]
        + section["steps"]
        + 1
        + 24
        + 2 * section["centres"]
        + section["checks"]
    )
    pours = {
        "response_surface": [sets * section["seeds"]],
        "sequential": budgets.to_list(),
    }
    pours |= {
        "published": [
            sum(sets * seeds for _, sets, seeds in cost.estimate_work(config)["pours"])
        ]
    }
    assert [int(row[1]) for row in marked] == pours[strategy]
    assert lines[-1].startswith("* as configured")


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
