"""The seeds of a sample: the rule, its bounds on errors of known size, and its steps with a cheap simulator."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shared

from repose.calibrate.seeds import PURPOSE_STREAMS
from repose.calibrate.targets import Targets
from research.answers import seeds_per_sample, seeds_rule
from research.answers.seeds_rule import LIMITS, SEEDS
from research.streams import STREAMS

TARGETS = Targets.of(shared.TARGETS)
FIXED = {"e_gg": 0.25, "e_gp": 0.35, "mus_gp": 0.6, "mur_gp": 0.2}


@pytest.mark.parametrize(
    ("two", "three", "chosen"),
    [(0.0, 0.0, 2), (1e-9, -1.0, 3), (1e-9, 1e-9, 6), (np.nan, np.nan, 6)],
)
def test_the_fewest_seeds_whose_bounds_are_all_within_their_limits(two, three, chosen):
    """A bound may be as large as its limit; any one above it, or unknown, is one too many."""
    for broken in LIMITS:
        bounds = {
            seeds: {
                name: limit + beyond * (name == broken)
                for name, limit in LIMITS.items()
            }
            for seeds, beyond in ((3, three), (2, two))
        }
        assert seeds_rule.choose(bounds) == chosen


def test_data_sets_of_one_order_share_no_pour_and_each_is_as_it_was():
    first = seeds_rule.drawn(0, 50, 16, 1)
    second = seeds_rule.drawn(1, 50, 16, 1)
    third = seeds_rule.drawn(2, 50, 16, 1)
    for left, right in zip(first, second, strict=True):
        assert len({*left, *right}) == 12
    shared_pours = [
        len({*left} & {*right}) for left, right in zip(first, third, strict=True)
    ]
    assert 1 < np.mean(shared_pours) < 3.5  # 6 * 6 / 16
    assert np.array_equal(seeds_rule.drawn(1, 50, 16, 1), second)
    assert np.unique(np.vstack([first, second])).tolist() == list(range(16))


def test_the_streams_are_of_no_other_purpose():
    streams = {
        value
        for name, value in vars(seeds_per_sample).items()
        if name.startswith("OF_")
    }
    assert len(streams) == 4
    assert not streams & {*PURPOSE_STREAMS.values(), *STREAMS.values()}


def answers_of(error, random, data_sets):
    """Relative errors (data sets, 3, 2) in percent of answers from noise in common, larger with fewer seeds."""
    pours = random.standard_normal((data_sets, 6, 2))
    means = np.stack([pours[:, :seeds].mean(axis=1) for seeds in SEEDS], axis=1)
    return error * np.sqrt(6) * means


def judged(error, random, r2=None, pool_seeds=16, draws=100):
    means = TARGETS.aim * (1 + error / 100)
    r2 = np.full(error.shape, 0.95) if r2 is None else r2
    return seeds_rule.verdict(
        r2, np.broadcast_to(means, (draws, *means.shape)), TARGETS, pool_seeds, random
    )


def test_a_worsening_of_known_size_is_found():
    random = np.random.default_rng(1)
    chosen, table = judged(answers_of(0.25, random, 3000), random)
    rms = table[table["quantity"] == "rms_percent"].groupby("seeds")["worse"].mean()
    assert rms[3] == pytest.approx(0.25 * (np.sqrt(2) - 1), abs=0.015)
    assert rms[2] == pytest.approx(0.25 * (np.sqrt(3) - 1), abs=0.015)
    widths = (TARGETS.high - TARGETS.low) / TARGETS.aim
    folded = 0.0025 * np.sqrt(2 / np.pi) * (1 / widths).sum()
    objective = table[table["quantity"] == "eq11"].set_index("seeds")
    assert objective.loc[6, "value"] == pytest.approx(folded, rel=0.05)
    expected = folded * (np.sqrt(2) - 1)
    assert objective.loc[3, "worse"] == pytest.approx(expected, rel=0.1)
    assert chosen == 3
    r2 = np.full((3000, 3, 2), 0.95) - np.array([0, 0.03, 0.01])[:, None]
    assert judged(answers_of(0.1, random, 3000), random, r2)[0] == 2
    assert judged(answers_of(0.1, random, 3000), random, r2[:, [0, 2, 1]])[0] == 3
    assert judged(answers_of(1.2, random, 3000), random)[0] == 6
    r2[:, :, 1] = np.nan  # of the second response nothing is known
    assert judged(answers_of(0.1, random, 3000), random, r2)[0] == 6


@pytest.mark.slow
@pytest.mark.parametrize("common", [0.0, 0.7])
def test_a_bound_is_below_what_is_true_in_one_study_of_twenty_at_most(common):
    """Each study has a pool of its own, of which all its data sets are drawn; all answers have the error `common`."""
    random = np.random.default_rng(2)
    samples = 40
    pool_seeds = 16
    studies = 150
    sets = 64
    weight = random.standard_normal(samples)
    weight *= 0.8 * np.sqrt(6) / np.linalg.norm(weight)
    true = np.sqrt(common**2 + 0.8**2 * 6 / np.array(SEEDS))
    missed = np.zeros(2)
    for study in range(studies):
        noise = random.standard_normal((samples, pool_seeds, 2))
        error = np.empty((sets, 3, 2))
        for number in range(sets):
            order = seeds_rule.drawn(number, samples, pool_seeds, study)
            sample_noise = np.take_along_axis(noise, order[:, :, None], axis=1)
            error[number] = [
                common + weight @ sample_noise[:, :seeds].mean(axis=1)
                for seeds in SEEDS
            ]
        _, table = judged(error, random, draws=200)
        upper = (
            table[table["quantity"] == "rms_percent"].groupby("seeds")["upper"].first()
        )
        missed += [upper[seeds] < true[i] - true[0] for i, seeds in ((1, 3), (2, 2))]
    assert (missed / studies < 0.08).all(), missed
    assert missed.sum() > 0, "a bound so wide that it says nothing"


def test_the_judge_draws_the_true_means_with_its_own_error():
    squares = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        X = random.random((60, 2))
        true = np.column_stack([30 + 4 * X[:, 0] + X[:, 1] ** 2, 60 - 5 * X[:, 1]])
        group = np.repeat(np.arange(60), 4)
        values = true[group] + random.multivariate_normal(
            [0, 0], [[4, 1.5], [1.5, 6]], 240
        )
        real = seeds_rule.Judge(X, values, group)
        means = real.draw(X, 200, random)
        squares.append(
            (((means.mean(axis=0) - true) / means.std(axis=0)) ** 2).mean(axis=0)
        )
    assert np.sqrt(np.mean(squares, axis=0)) == pytest.approx([1, 1], abs=0.4)
    assert real.noise == pytest.approx(np.array([[4, 1.5], [1.5, 6]]), abs=1.5)
    # neighbours have their errors in common
    near = real.draw(np.vstack([X[:1], X[:1] + 1e-4]), 200, random)
    assert (np.abs(near[:, 0] - near[:, 1]) < 0.05).all()


def cheap(study, keys, X):
    """In place of a pour: planes with the noise of a seed, and now and then a failure."""
    unit = study.parameters.unit(X)

    def pour(task):
        random = np.random.default_rng(task["seed"])
        noise = random.multivariate_normal([0, 0], [[5, 3], [3, 9]])
        u, v = unit[task["row"]]
        responses = {
            "aor_deg": 29 + 6 * u + 2 * v + noise[0],
            "height_mm": 60 + 4 * u + 8 * v + noise[1],
        }
        kept = {key: task[key] for key in (*keys, "seed")}
        if random.random() < 0.02:
            return (
                kept
                | {"status": "not_at_rest", "reason": "trembles"}
                | dict.fromkeys(responses, np.nan)
            )
        return kept | {"status": "ok", "reason": ""} | responses

    return pour


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A small study in a folder; a function that runs a step, and gives its table."""
    monkeypatch.setattr(seeds_per_sample, "pouring", cheap)
    config = tmp_path / "config.yaml"
    design = tmp_path / "samples.csv"
    section = {
        "surrogate": "quadratic",
        "parameters": {name: {"fixed": value} for name, value in FIXED.items()},
        "miga": {"rounds": 1},
    }
    config.write_text(json.dumps(section))
    random = np.random.default_rng(5)
    table = pd.DataFrame(FIXED, index=range(1, 31))
    table["mus_gg"] = random.uniform(0.35, 0.75, 30)
    table["mur_gg"] = random.uniform(0.02, 0.07, 30)
    table.to_csv(design, index_label="sample")
    files = {
        name: str(tmp_path / f"{name}.csv")
        for name in ("pool", "fresh", "answers", "answer_pours")
    }

    def run(part, out, *arguments):
        seeds_per_sample.script.run(
            [part, "--config", str(config), "--out", str(tmp_path / out), *arguments]
        )
        path = tmp_path / out
        return (
            pd.read_csv(path)
            if path.is_file()
            else json.loads((path / "verdict.json").read_text())
        )

    return SimpleNamespace(
        run=run, design=["--design", str(design)], files=files, config=config
    )


@pytest.mark.slow
def test_the_steps_lead_to_a_verdict_and_go_on_where_they_were_stopped(study, capsys):
    pool = [*study.design, "--pool-seeds", "13"]
    part = study.run("pour_pool", "pool.csv", *pool, "--minutes", "0")
    assert 0 < len(part) < 30 * 13
    whole = study.run("pour_pool", "pool.csv", *pool)
    assert len(whole) == 30 * 13
    assert not whole["seed"].duplicated().any()
    kept = whole.merge(part, on=["sample", "pour"])
    assert len(kept) == len(part)
    assert (kept["seed_x"] == kept["seed_y"]).all()
    fresh = study.run("pour_fresh", "fresh.csv", "--fresh-seeds", "4")
    assert len(fresh) == 40 * 4

    fits = [*pool, "--pool", study.files["pool"]]
    assert len(study.run("answers", "answers.csv", *fits, "--data-sets", "2")) == 6
    found = study.run("answers", "answers.csv", *fits, "--data-sets", "8")
    expected = {seeds: list(range(8)) for seeds in SEEDS}
    assert found.groupby("seeds")["data_set"].apply(list).to_dict() == expected
    assert found["mus_gg"].nunique() == 24
    files = ["--answers", study.files["answers"]]
    assert (
        len(
            study.run("pour_answers", "answer_pours.csv", *files, "--answer-seeds", "3")
        )
        == 72
    )

    files += [
        "--fresh",
        study.files["fresh"],
        "--answer-pours",
        study.files["answer_pours"],
    ]
    summary = study.run("judge", ".", *files)
    table = pd.read_csv(study.config.parent / "verdict.csv")
    assert summary["chosen"] in SEEDS
    assert summary["data_sets"] == 8
    assert len(table) == 3 * 5
    assert np.isfinite(table[["value", "worse", "upper"]]).all(axis=None)
    assert (table.loc[table["quantity"] == "r2", "value"] > 0.6).all()
    assert table.loc[table["quantity"] == "rms_percent", "plain_se"].gt(0).all()
    assert "seeds of each sample" in capsys.readouterr().out

    study.config.write_text(study.config.read_text().replace("0.25", "0.26"))
    with pytest.raises(SystemExit):
        study.run("pour_pool", "pool.csv", *pool)
    assert "provenance.origin" in capsys.readouterr().err


@pytest.mark.slow
def test_data_sets_of_pours_that_are_not_there_are_refused(study, capsys):
    pool = [*study.design, "--pool-seeds", "6"]
    study.run("pour_pool", "pool.csv", *pool)
    for seeds in ("6", "7"):
        fits = [*study.design, "--pool-seeds", seeds, "--pool", study.files["pool"]]
        with pytest.raises(SystemExit):
            study.run("answers", "answers.csv", *fits)
        assert "pours is 180" in capsys.readouterr().err
