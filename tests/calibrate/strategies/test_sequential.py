"""The sequential strategy with a simulator of one line."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from refusals import input_error
from scipy.spatial.distance import cdist
from scipy.stats import norm
from shared import entries, says
from stage_runs import conclude, propose
from synthetic import (
    RANGES,
    SPACE,
    TARGETS,
    responses,
    runs_of,
    study,
    write_poured,
    write_tables,
)

from repose import Study
from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.strategies.sequential.advise import (
    MIN_GAIN,
    UNREACHABLE_PROBABILITY,
    advise,
    make_start,
)
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, ObservedSamples
from repose.calibrate.strategies.sequential.reach import Draws
from repose.calibrate.strategies.sequential.strategy import arrange_runs
from repose.calibrate.targets import Targets
from repose.report.figures import style
from repose.report.figures.sequential import draw_sequential_batches
from repose.report.study_view import StudyView
from repose.stages.batches import arrange_for_strategy

pytestmark = pytest.mark.usefixtures("short_designs")
SECTION = {
    "start_samples": 12,
    "seeds": 2,
    "batch": 4,
    "tolerance_percent": 1.0,
    "probability": 0.8,
    "most_pours": 64,
    "checks": 4,
}
BOTH = entries(TARGETS)
HEIGHT = Targets.of(BOTH[1:])


def campaign(folder, targets=TARGETS, space=SPACE, section=SECTION, noise=1.0, seed=1):
    known = study(targets, space, sequential=section, design={"seed": seed})
    folders = []
    found = {"answer": False}
    while not found["answer"]:
        batch_folder = folder / f"batch_{len(folders)}"
        found = propose("sequential", known, folders, batch_folder)
        table = pd.read_csv(batch_folder / "samples.csv")
        expected = {section["checks" if found["answer"] else "seeds"]}
        assert set(table["seeds"]) == expected
        stream = [seed, 999 if found["answer"] else len(folders)]
        write_tables(
            batch_folder,
            table,
            runs_of(table, table["seeds"], noise, stream, targets.names),
            targets,
        )
        folders.append(batch_folder)
    conclude("sequential", known, folders, folder)
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sequential")
    return folder, campaign(folder)


def observed(n=40, noise=0.5, targets=TARGETS, seed=1, space=SPACE):
    unit = np.random.default_rng(seed).random((n, space.dimensions))
    return observed_at(unit, noise, targets, seed, space)


def observed_at(unit, noise, targets, seed, space=SPACE):
    n = len(unit)
    table = pd.DataFrame(space.values(unit), columns=list(PARAMETERS)).assign(
        sample=range(n)
    )
    values = runs_of(table, 3, noise, seed, targets.names)[
        list(targets.names)
    ].to_numpy(float)
    return ObservedSamples(unit, values.reshape(n, 3, -1))


def advised(data, targets=TARGETS, failed=None, **changes):
    section = SequentialSettings.model_construct(**SECTION | changes)
    goal = Goal.from_targets(targets, section.tolerance_percent, SPACE)
    data = data if failed is None else data._replace(failed=failed)
    return advise(
        data, goal, section, 3 * len(data.unit_points), np.random.default_rng(1), None
    )


def test_the_answer_of_a_campaign_meets_the_targets_after_one_batch_and_another(done):
    folder, summary = done
    deviations = 100 * np.abs(
        responses(pd.DataFrame([summary["answer"]]))[0] / TARGETS.aim - 1
    )
    table = pd.read_csv(folder / "batches.csv")
    # within four of the errors of the last batch
    errors = [
        100 * table[f"{entry.name}_error"].iloc[-1] / entry.aim for entry in TARGETS
    ]
    assert (deviations < 4 * np.array(errors)).all()
    assert summary["stop"] == "probability"
    assert summary["probability"] >= 0.8
    assert summary["pours"] < SECTION["most_pours"]
    assert table["pours"].tolist() == [24 + 8 * k for k in range(len(table))]
    assert table["stop"].notna().tolist() == [False] * (len(table) - 1) + [True]
    numbers = pd.read_csv(folder / "dataset.csv")["sample"]
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
    checked = pd.read_csv(folder / f"batch_{len(table)}/samples.csv")
    expected = summary["answer"]
    assert checked[list(PARAMETERS)].iloc[0].to_dict() == pytest.approx(expected)
    assert checked["sample"].tolist() == [len(numbers) + 1], "seeds of its own"
    assert summary["check_pours"] == SECTION["checks"]


def test_the_same_pours_give_the_same_bits(done, tmp_path):
    folder, summary = done
    assert campaign(tmp_path) == summary
    made = sorted(tmp_path.glob("*/samples.csv"))
    assert len(made) == len(pd.read_csv(folder / "batches.csv")) + 1
    for path in made:
        assert path.read_bytes() == (folder / path.relative_to(tmp_path)).read_bytes()


def test_one_target_a_fixed_parameter_and_a_prior_that_spreads_the_start(tmp_path):
    known = {"mus_gp": {"prior": {"mean": 0.6, "sd": 0.02}, "range": [0.4, 0.8]}}
    unit = make_start(contact_space(RANGES | known), SequentialSettings(**SECTION), 1)
    strata = np.sort(
        np.floor(12 * contact_space(RANGES | known).prior_cdf(unit)), axis=0
    )
    assert (strata == np.arange(12)[:, None]).all()
    values = contact_space(RANGES | known).values(unit)[:, PARAMETERS.index("mus_gp")]
    assert values.std() == pytest.approx(0.02, rel=0.3)
    summary = campaign(
        tmp_path, HEIGHT, contact_space(RANGES | known | {"e_gg": {"fixed": 0.25}})
    )
    assert summary["answer"]["e_gg"] == 0.25
    # far from the prior's mean the density is small; five of its standard deviations are never worth it here
    assert abs(summary["answer"]["mus_gp"] - 0.6) < 0.1
    assert (
        pd.concat([pd.read_csv(path) for path in tmp_path.glob("batch_*/dataset.csv")])[
            "e_gg"
        ]
        == 0.25
    ).all()


def test_it_stops_where_the_budget_is_used_up_no_pour_helps_or_no_set_meets_the_targets():
    found = advised(observed(), probability=0.7, most_pours=999)
    assert found.stop == "probability"
    assert len(found.batch) == 0
    data = observed(noise=6.0)
    found = advised(data, probability=0.99, most_pours=121)
    assert found.stop == "budget", "one pour is left, and a sample takes two"
    more = advised(data, probability=0.99, most_pours=127)
    assert more.stop is None
    assert len(more.batch) == 3, (
        "the pours that are left, though a batch has four samples"
    )
    found = advised(observed(noise=40.0), probability=0.99, most_pours=122)
    assert found.stop == "noise"
    assert found.reachable < found.probability + MIN_GAIN
    unreachable = Targets.of([BOTH[0], BOTH[1] | {"value": 140.0, "range": [130, 150]}])
    data = observed(noise=0.2)
    found = advised(data, unreachable, most_pours=999)
    assert found.stop is None, "no run stands at the ends that come nearest"
    # the batch stands there, and so it ends after one or two
    for seed in (2, 3):
        if found.stop is None:
            more = observed_at(found.batch, 0.2, TARGETS, seed)
            data = ObservedSamples(
                np.vstack([data.unit_points, more.unit_points]),
                np.vstack([data.values, more.values]),
            )
            found = advised(data, unreachable, most_pours=999)
    assert found.stop == "out_of_reach"
    assert found.reach.probability < UNREACHABLE_PROBABILITY
    # no point of 20,000 comes nearer by more than the error that the draws tell, and a tenth of the range for the angle
    goal = Goal.from_targets(unreachable, 1.0, SPACE)
    table = pd.DataFrame(
        SPACE.values(np.random.default_rng(2).random((20000, 6))),
        columns=list(PARAMETERS),
    )
    least = goal.compute_deviations(responses(table))[1].min()
    answer_table = pd.DataFrame(
        SPACE.values(found.answer[None]), columns=list(PARAMETERS)
    )
    assert goal.compute_deviations(responses(answer_table))[1][0] < least + 0.1
    assert found.reach.deviation == pytest.approx(
        least, abs=max(0.1, 3 * found.reach.deviation_sd)
    )
    found = advised(
        observed(n=12, noise=0.2), unreachable, most_pours=999, start_samples=18
    )
    assert found.stop is None
    assert len(found.batch) == SECTION["batch"] / 2, (
        "half a batch, where the draws come nearest"
    )


@pytest.mark.parametrize("targets", [HEIGHT, TARGETS])
def test_draws_of_the_responses_have_the_moments_of_the_model(targets):
    model = Kriging(observed(n=20, noise=4.0, targets=targets))
    unit = np.random.default_rng(4).random((30, 6))
    draws = (
        Draws(model, k, np.random.default_rng([7, k, j]))
        for k in range(len(model.process_sets))
        for j in range(12)
    )
    drawn = np.concatenate([draw(unit) for draw in draws])
    mean, covariance = model.predict(unit)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    # 1536 draws: a mean to 3 % of the standard deviation, a standard deviation to 2 %; random features add to both
    assert np.abs(drawn.mean(axis=0) - mean).max() < 0.25 * sd.max()
    assert drawn.std(axis=0) == pytest.approx(sd, rel=0.2)


def test_the_expected_deviation_is_that_of_draws():
    goal = Goal.from_targets(TARGETS, 1.0, SPACE)
    mean = np.add(TARGETS.aim, [[0.7, -1.0]])
    covariance = np.array([[[2.0, 1.5], [1.5, 3.0]]])
    drawn = np.random.default_rng(1).multivariate_normal(
        mean[0], covariance[0], 200_000
    )
    assert goal.expected_deviation(mean, covariance)[0] == pytest.approx(
        goal.compute_deviations(drawn)[1].mean(), rel=0.01
    )


def test_pours_that_are_left_reach_no_more_than_their_bound():
    goal = Goal.from_targets(TARGETS, 1.0, SPACE)
    # the simulator's own answers after all pours of the budget at one point: the bound holds in each of 30 cases
    data = observed(n=20, noise=4.0)
    found = advised(data, most_pours=100, probability=0.99)
    model = Kriging(data)
    point = found.answer
    bound = goal.estimate_reachable(model, point[None], 40)
    mean, covariance = model.predict(point[None])
    random = np.random.default_rng(3)
    for _ in range(30):
        pours = random.multivariate_normal(
            random.multivariate_normal(mean[0], covariance[0]), model.noise / 40
        )
        rest = np.linalg.inv(
            np.linalg.inv(covariance[0]) + 40 * np.linalg.inv(model.noise)
        )
        new = rest @ (
            np.linalg.solve(covariance[0], mean[0])
            + 40 * np.linalg.solve(model.noise, pours)
        )
        assert goal.probability(new[None], rest[None])[0] <= bound + 1e-9


def test_further_pours_may_move_a_mean_by_three_standard_deviations_of_what_they_say():
    """Variance 4 and noise 4: one pour leaves 2 and says 2, so a mean 5 off may come to 5 - 3 root 2."""
    model = SimpleNamespace(
        noise=np.array([[4.0]]),
        predict=lambda _: (np.array([[65.0]]), np.array([[[4.0]]])),
    )
    aim = np.array([60.0])
    goal = Goal(aim, np.ones(1), SPACE, np.ones(1), low=aim - 1, high=aim + 1)
    shift = 5 - 3 * np.sqrt(2)
    expected = norm.cdf((1 - shift) / np.sqrt(2)) - norm.cdf((-1 - shift) / np.sqrt(2))
    assert goal.estimate_reachable(model, np.zeros((1, 6)), 1) == pytest.approx(
        expected, abs=1e-6
    )


def test_a_batch_lies_about_the_answer_and_away_from_failed_samples():
    goal = Goal.from_targets(HEIGHT, 1.0, SPACE)
    sd = 0.045 * 65.28
    assert (
        goal.count_needed_runs(np.array([[sd**2]]), 0.9)
        == int(np.ceil((norm.ppf(0.95) * sd / goal.half[0]) ** 2))
        == 55
    )
    data = observed(n=20, noise=4.0)
    found = advised(data, most_pours=999, probability=0.99, batch=100)
    inside = (found.answer > 0.3) & (found.answer < 0.7)
    assert inside.any()
    assert found.batch.shape == (100, 6)
    # 100 draws: the mean within three standard errors, the spread within three of its own
    expected = found.answer[inside]
    assert found.batch[:, inside].mean(axis=0) == pytest.approx(expected, abs=0.03)
    assert found.batch[:, inside].std(axis=0) == pytest.approx(0.1, rel=0.22)
    data = observed(n=30, noise=4.0)
    failed = advised(data, most_pours=999, probability=0.99).batch[:1]
    second = advised(data, failed=failed, most_pours=999, probability=0.99)
    for points in (second.batch, second.answer[None]):
        assert (
            cdist(points, failed)[:, 0] >= cdist(points, data.unit_points).min(axis=1)
        ).all()


def test_a_budget_counts_failed_runs(tmp_path):
    known = study(sequential=SECTION)
    propose("sequential", known, [], tmp_path)
    table = pd.read_csv(tmp_path / "samples.csv")
    runs = runs_of(table, 2, 0.5, 1)
    runs.loc[[0, 4, 5], "status"] = "jammed"
    runs.loc[[0, 4, 5], list(TARGETS.names)] = np.nan
    write_tables(tmp_path, table, runs)
    assert propose("sequential", known, [tmp_path], tmp_path / "batch_1")["pours"] == 24
    data = pd.read_csv(tmp_path / "dataset.csv")
    seen = arrange_runs(arrange_for_strategy(data, runs, TARGETS), SPACE, TARGETS)
    assert seen.counts.tolist() == [1] + [2] * 10
    expected = table.loc[2, list(PARAMETERS)].to_numpy(float)
    assert SPACE.values(seen.failed)[0] == pytest.approx(expected)
    write_poured(tmp_path, table, 0.5, seeds=1)
    few = "enough for an estimate of the noise"
    input_error(few, propose, "sequential", known, [tmp_path], tmp_path / "batch_1")


def test_bench_tests_are_independent():
    other = BOTH[1] | {
        "response": "drum_slip_deg",
        "apparatus": "drum",
        "value": 40,
        "range": [30, 50],
    }
    targets = Targets.of([BOTH[1], other])
    table = pd.DataFrame(SPACE.values(np.full((2, 6), 0.5)), columns=list(PARAMETERS))
    data = table.assign(sample=[1, 2], status="ok")
    runs = pd.DataFrame(
        {
            "sample": [1, 1, 2, 2, 1, 1, 2],
            "apparatus": ["funnel"] * 4 + ["drum"] * 3,
            "status": "ok",
        }
    ).assign(
        height_mm=[60, 61, 62, 63, *3 * [np.nan]],
        drum_slip_deg=[*4 * [np.nan], 40, 41, 42],
    )
    seen = arrange_runs(arrange_for_strategy(data, runs, targets), SPACE, targets)
    assert seen.values[0].tolist() == [[60, 40], [61, 41]]
    assert seen.counts.tolist() == [2, 1]


def test_no_run_is_asked_for_twice():
    section = {"start_samples": 8, "seeds": 1, "batch": 4, "most_runs": 20}
    target = {"value": 20.0, "sd": 0.1, "repetitions": 1, "noise_sd": 0.01}
    budget_study = Study(
        {"a": (0.0, 1.0), "b": (0.0, 1.0)}, {"sum_mm": target}, sequential=section
    )
    budget_study.tell(budget_study.ask().eval("sum_mm = 10 + a + b"))
    asked = budget_study.ask()
    assert not asked.duplicated(["a", "b"]).any()
    budget_study.tell(asked.eval("sum_mm = 10 + a + b"))
    assert not budget_study.runs.duplicated(["a", "b"]).any()


@pytest.mark.parametrize("targets", [TARGETS, HEIGHT])
def test_figure(done, targets):
    inputs = {name: str(done[0] / f"{name}.csv") for name in ("batches", "check")}
    config = {
        "targets": BOTH[2 - len(targets) :],
        "parameters": RANGES,
        "sequential": SECTION,
    }
    with style.applied():
        figure = draw_sequential_batches(inputs, StudyView(config))
        figure.draw_without_rendering()
    says(
        " ".join(text.get_text() for text in figure.findobj(Text)),
        "All targets within 1 %",
        "required: ",
    )
