"""A simulator of the user's own: what is asked for, what is refused, and whether the answer is right."""

import dataclasses
import json
import re

import numpy as np
import pandas as pd
import pytest
import yaml
from refusals import input_error
from shared import ROOT, at, put, says

from repose.calibrate import calibration
from repose.calibrate.answer import Verdict
from repose.calibrate.record import Record
from repose.calibrate.strategies.runs import checked_runs
from repose.calibrate.strategies.sequential import noise
from repose.calibrate.strategies.sequential.strategy import arrange_runs
from repose.calibrate.study import Study
from repose.calibrate.study_file import complete_configuration, list_unread_keys
from repose.report.page.own import write as write_report
from repose.stages import card

PAGE = (ROOT / "docs/own_simulator.md").read_text()
DOC = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
CONTENT = yaml.safe_load(DOC[1]) | {"posterior": {"walkers": 32, "steps": 100}}
SINGLE = CONTENT | {"sequential": {"start_samples": 32, "seeds": 1}}
FREE = ["friction", "rolling"]


def observed(study, runs):
    return arrange_runs(runs, study.parameters, study.targets)


def added(study, new, file):
    record = Record(study, file)
    record.add_file(new)
    return record.data


def simulate(table, noise=0.01, seed=1):
    factor = 1 + noise * np.random.default_rng(seed).normal(size=(len(table), 2))
    friction = table["friction"]
    rolling = table["rolling"]
    angle = (18 + 18 * friction + 40 * rolling - 6 * friction**2) * factor[:, 0]
    return table.assign(
        angle_deg=angle, time_s=(3 + 2 * friction - 2 * rolling) * factor[:, 1]
    )


@pytest.fixture(scope="module")
def study():
    return Study.own(CONTENT)


@pytest.fixture(scope="module")
def table(study):
    return simulate(study.ask())


@pytest.fixture(scope="module")
def found(study, table):
    return calibration.calibrate(study, checked_runs(study, table))


@pytest.mark.slow
def test_the_start_repeats_its_samples(study):
    table = study.ask()
    assert (table.groupby("sample").size() == 2).all()
    assert table["run"].tolist() == [1, 2] * 16
    assert (table["restitution"] == 0.4).all()
    once = table.drop_duplicates("sample")
    for name, low, high in (("friction", 0.2, 0.8), ("rolling", 0.01, 0.2)):
        expected = list(range(16))
        assert sorted(((once[name] - low) / (high - low) * 16).astype(int)) == expected


@pytest.mark.slow
def test_the_answer_is_in_the_products_of_a_run(study, found, tmp_path, command):
    found.save(tmp_path)
    made = found.card
    assert made["samples_inside"]["samples"] == len(found.samples)
    assert card.read_card(tmp_path / "card.json")["simulator"] == "EDEM 2024"
    assert made["met"] is None
    assert (
        made["reason"]
        == "The answer is predicted inside both ranges; the answer was not simulated again."
    )
    assert made["out_of_reach"] is False
    assert made["made_by"]["seed"] == study.settings.design.seed
    for text in (
        str(found),
        command("card", "check", tmp_path / "card.json", status=4).out,
    ):
        assert text.startswith(
            "rape_seed: targets predicted: met (more than 99 %). angle_deg predicted "
        )
    assert {test["bench"] for test in made["tests"]} == {None}
    assert set(made["parameters"]) == {"friction", "rolling", "restitution"}
    shown = command("card", "show", tmp_path / "card.json").out
    assert shown.startswith("Material card: rape_seed; targets predicted: met (more ")
    assert re.search(r"target \S+ to \S+, predicted \S+ deg \(expected optimism", shown)
    assert "no number" not in shown
    assert "unknown" not in shown
    assert (
        " predicted " in command("card", "compare", *2 * [tmp_path / "card.json"]).out
    )
    for name in ("samples", "solutions", "posterior", "draws"):
        assert len(pd.read_csv(tmp_path / f"{name}.csv")) > 1


@pytest.mark.slow
def test_a_prediction_comes_with_its_expected_optimism(found, tmp_path):
    names = found.study.targets.names
    assert set(found.optimism) == set(names)
    text = str(found)
    assert text.count("; expected optimism ") == len(names)
    assert "This does not include the expected optimism of the predictions." in text
    for test in found.card["tests"]:
        expected = found.optimism[test["response"]]
        assert test["optimism"] == expected["optimism"]
        assert test["optimism_error"] == expected["optimism_se"]
        # The bootstrap finds no large bias in a fit to 32 repeated samples.
        assert (
            abs(test["optimism"]) < 5 * found.prediction.loc[test["response"], "error"]
        )
    notes = {**found.answer.notes, "optimism": []}
    unknown = found._replace(answer=dataclasses.replace(found.answer, notes=notes))
    assert "The expected optimism of this prediction is unknown." in str(unknown)
    write_report(found, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "does not include the expected optimism of the prediction (angle_deg" in page


@pytest.mark.slow
def test_the_answer_meets_the_targets(found):
    exact = simulate(pd.DataFrame([found.summary["representative"]]), noise=0.0).iloc[0]
    for k, entry in enumerate(found.study.targets):
        assert abs(exact[entry.name] - entry.aim) < 4 * found.answer.error[k]
    assert found.summary["feasible"]
    assert found.summary["steps"][2].startswith(
        "Answer: the set that lies within 1 % of all targets most probably; "
    )
    chance = found.probability
    assert 0.5 < chance["within_1_percent"] <= chance["within_2_percent"] <= 1
    # the ranges are 2 % of the values to each side, as none were given
    assert chance["inside"] == pytest.approx(chance["within_2_percent"])


@pytest.mark.slow
def test_the_intervals_hold_the_true_parameters(found):
    rows = found.posterior.parameters.set_index("parameter")
    assert list(rows.index) == FREE
    # solved by hand from the two lines of the simulator: rolling = friction - 0.5, and 58 f - 6 f^2 = 32
    friction = (58 - np.sqrt(58**2 - 24 * 32)) / 12
    for name, value in zip(FREE, (friction, friction - 0.5), strict=True):
        assert rows.loc[name, "credible_low"] < value < rows.loc[name, "credible_high"]


@pytest.mark.slow
def test_all_solutions_are_inside_the_ranges(found):
    assert len(found.solutions) > 5
    for entry in found.study.targets:
        assert (
            found.solutions[entry.response.predicted]
            .between(entry.low, entry.high)
            .all()
        )


@pytest.mark.slow
def test_an_interval_is_widened_to_hold_the_answer(found):
    table = found.posterior.parameters.assign(credible_low=0.0, credible_high=0.001)
    moved = found._replace(posterior=found.posterior._replace(parameters=table))
    for name in FREE:
        assert moved.intervals[name]["high"] == found.parameters[name]
    assert str(moved).count("; interval widened to contain the answer") == 2
    assert str(found).count("widened") == 0
    assert "friction" in moved._repr_html_()


def files_of(folder, content, runs):
    """The configuration and a table of runs in a folder, as words of `repose calibrate`."""
    (folder / "own.yaml").write_text(yaml.safe_dump(content))
    runs.to_csv(folder / "runs.csv", index=False)
    return [folder / "runs.csv", "--config", folder / "own.yaml", "--out", folder]


@pytest.mark.slow
def test_a_calibration_ends_well_whatever_its_answer(
    found, monkeypatch, tmp_path, command
):
    improbable = found.answer.probability | {"inside": 0.001}
    missed = found._replace(
        summary=found.summary | {"feasible": False},
        answer=dataclasses.replace(found.answer, probability=improbable),
    )
    monkeypatch.setattr(calibration, "calibrate", lambda *_: missed)
    first = command(
        "calibrate", *files_of(tmp_path, CONTENT, found.runs)
    ).out.splitlines()[0]
    assert (
        "No parameter set is predicted inside both ranges; the answer was not simulated again."
        in first
    )
    assert card.read_card(tmp_path / "card.json")["out_of_reach"] is True
    text = (tmp_path / "report.html").read_text()
    says(
        text,
        "<b>Targets predicted: NOT met (less than 1 %).</b> angle_deg predicted ",
        "Other parameters",
    )


@pytest.mark.slow
def test_ask_and_tell_stop_with_an_answer_that_meets_the_targets(
    study, tmp_path, command
):
    record = tmp_path / "runs.csv"
    runs = None
    k = 0
    stop = None
    following = study.ask()
    while not stop:
        simulate(following, seed=k).to_csv(tmp_path / "new.csv", index=False)
        runs = added(study, tmp_path / "new.csv", record)
        now = Study.own(CONTENT, record)
        following = now.ask()
        stop = now.done
        k = k + 1
    assert now.proposal.notes["stop"] == "probability"
    assert len(runs) == 32 + 16 * (k - 1)
    assert (following["sample"] == runs["sample"].max() + 1).all()
    relative_error = (
        simulate(following, noise=0.0)[["angle_deg", "time_s"]].iloc[0] / [30.0, 4.0]
        - 1
    )
    assert abs(relative_error).max() < 0.02

    # Before the check, the answer is only predicted.
    proposed = now.proposal
    assert now.answer().as_answer().verdict is Verdict.UNCHECKED
    # Runs with its parameters check it, and do not change it. Their noise is small.
    simulate(following, 0.001, seed=k).to_csv(tmp_path / "new.csv", index=False)
    told = added(study, tmp_path / "new.csv", record)
    checked = Study.own(CONTENT, record).answer()
    np.testing.assert_array_equal(checked.answer.values, proposed.values)
    assert len(checked.check) == len(following)
    assert len(checked.runs) == len(told) - len(following)
    result = checked.as_answer()
    assert result.verdict is Verdict.MET
    last = told.tail(len(following))
    for check, name in zip(result.checks, ("angle_deg", "time_s"), strict=True):
        assert check.runs == len(following)
        assert check.simulated == pytest.approx(last[name].mean())
        assert check.standard_error == pytest.approx(last[name].sem())
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(CONTENT))
    out = command(
        "calibrate", record, "--config", tmp_path / "own.yaml", "--out", tmp_path
    ).out
    says(out, "rape_seed: targets met. angle_deg ", "Simulated again:\n  angle_deg: ")
    made = card.read_card(tmp_path / "card.json")
    assert (made["met"], made["tests"][0]["runs"]) == (True, len(following))
    assert made["probability_inside"] > 0.95
    text = (tmp_path / "report.html").read_text()
    says(text, "<b>Targets met.</b>", f"judged by {len(following)} new simulations")
    command("card", "check", tmp_path / "card.json", status=0)


@pytest.mark.usefixtures("short_search")
def test_runs_without_numbers_are_told_by_their_rows(study, table):
    runs = checked_runs(study, table.drop(columns=["sample", "run"]))
    assert runs["sample"].tolist() == np.arange(1, 17).repeat(2).tolist()
    assert (
        observed(
            study, checked_runs(study, table.sample(frac=1, random_state=1))
        ).counts.tolist()
        == [2] * 16
    )


def test_failed_runs_do_not_count(study, table):
    failed = table.astype({"angle_deg": object}).assign(status="ok")
    failed.loc[:2, ["status", "angle_deg"]] = ["jammed", ""]
    known = observed(study, checked_runs(study, failed))
    assert len(known.failed) == 1
    assert known.counts.tolist() == [1] + [2] * 14
    numbers = table.assign(status=np.where(table["run"] == 2, "unstable", "Success"))
    # what the simulator wrote for a run that failed
    numbers.loc[numbers["run"] == 2, "angle_deg"] = 0.0
    runs = checked_runs(study, numbers)
    assert runs.loc[runs["status"] != "ok", "angle_deg"].isna().all()
    assert observed(study, runs).counts.tolist() == [1] * 16
    for word in ("1", "0"):
        input_error(
            f"row 1: status is '{word}'; expected ok, or",
            checked_runs,
            study,
            numbers.assign(status=word),
        )


def test_a_fixed_parameter_may_be_left_out(study, table, tmp_path):
    runs = checked_runs(study, table.drop(columns="restitution"))
    assert (runs["restitution"] == 0.4).all()
    new = tmp_path / "new.csv"
    record = tmp_path / "runs.csv"
    for part in (table[:6], table[6:].drop(columns="restitution")):
        part.to_csv(new, index=False)
        runs = added(study, new, record)
    assert (runs["restitution"] == 0.4).all()
    assert len(runs) == len(table)


def test_runs_with_numbers_may_have_the_same_results(study, tmp_path):
    new = tmp_path / "new.csv"
    # runs with numbers may have the same results
    equal = simulate(study.ask(), noise=0.0)
    for run in (1, 2):
        equal[equal["run"] == run].to_csv(new, index=False)
        runs = added(study, new, tmp_path / "alike.csv")
    assert len(runs) == len(equal)


def noise_of(study, table):
    return noise.find_noise(
        observed(study, checked_runs(study, table)),
        study.targets.names,
        study.settings.noise_sd,
    )


def test_single_runs_give_a_rough_noise_and_correlations_need_more(study):
    single = Study.own(SINGLE).ask()
    exact = simulate(single, noise=0.0, seed=3)[["angle_deg", "time_s"]]
    noisy = simulate(single, noise=0.02, seed=3)[["angle_deg", "time_s"]]
    found = noise_of(study, single.join(noisy))
    true = 0.02 * np.sqrt((exact**2).mean().to_numpy())
    assert np.sqrt(np.diagonal(found.covariance)) == pytest.approx(true, rel=0.35)
    assert found.covariance[0, 1] == 0
    says(found.warning, "angle_deg 0.", "Simulate some parameter sets twice")
    needed = len(study.targets) + 2
    for freedom, correlation in ((needed - 1, 0.0), (needed, "simulated")):
        section = calibration.adapt_posterior_settings(
            study.settings.posterior, freedom, 2
        )
        assert section.measured_correlation == correlation


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "low", "high"), [(16, 0.3, 1.3), (32, 0.8, 1.2)])
def test_how_rough_the_estimate_is(samples, low, high):
    """The numbers of docs/own_simulator.md: estimated over true noise, eight seeds, both responses."""
    study = Study.own(CONTENT | {"sequential": {"start_samples": samples, "seeds": 1}})
    single = study.ask()
    true = 0.02 * np.sqrt(
        (simulate(single, noise=0.0)[["angle_deg", "time_s"]] ** 2).mean().to_numpy()
    )
    found = [
        noise_of(study, simulate(single, 0.02, seed)).covariance for seed in range(8)
    ]
    ratios = [np.sqrt(np.diagonal(covariance)) / true for covariance in found]
    assert low < np.min(ratios) <= np.max(ratios) < high


def test_stated_noise_stands_in_for_replicates_and_not_beside_them(study, table):
    known = Study.own(changed("targets.angle_deg.noise_sd", 0.7))
    single = noise_of(known, table[::2])
    assert single.covariance[0, 0] == pytest.approx(0.49)
    assert single.sources == {
        "angle_deg": "noise_sd",
        "time_s": "estimated from single runs",
    }
    both = noise_of(known, table)
    assert both.covariance == pytest.approx(noise_of(study, table).covariance)
    assert both.warning is None


def test_too_few_single_runs_are_refused_with_the_ways_out(study, table):
    input_error(
        r"is 0; expected at least 3: .*noise_sd .* at least 8 samples",
        noise_of,
        study,
        table[:14:2],
    )
    equal = table.assign(
        angle_deg=table.groupby("sample")["angle_deg"].transform("first")
    )
    equal["time_s"] += np.linspace(0, 1e-7, len(equal))  # no row twice
    # a simulator without random numbers repeats itself: each set counts once
    found = noise_of(study, equal)
    assert set(found.sources.values()) == {noise.ESTIMATED}


def test_replicates_that_do_not_differ_are_named(study, table):
    few = table[:12]
    alike = few.assign(
        angle_deg=few.groupby("sample")["angle_deg"].transform("first").round(1)
    )
    ways_out = r".*noise_sd .* at least 8 samples"
    input_error(
        f"between the runs of a sample is 0; expected results of angle_deg that differ{ways_out}",
        noise_of,
        study,
        alike,
    )
    proportional = few.assign(
        time_s=few.groupby("sample")["time_s"].transform("first")
        + 0.1
        * (few["angle_deg"] - few.groupby("sample")["angle_deg"].transform("first"))
    )
    input_error(
        f"is 'proportional in several responses'; expected results of each response{ways_out}",
        noise_of,
        study,
        proportional,
    )


@pytest.mark.slow
def test_single_runs_are_calibrated_with_a_warning(tmp_path, command):
    table = simulate(Study.own(SINGLE).ask(), noise=0.02).drop(
        columns=["restitution", "sample", "run"]
    )
    runs, *config = files_of(tmp_path, SINGLE, table)
    assert "WARNING: too few replicates" in command("calibrate", runs, *config).err
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["noise"]["time_s"]["from"] == "estimated from single runs"
    # 0.593, 0.093 without noise; the targets are 30 degrees and 4 s
    assert summary["representative"]["friction"] == pytest.approx(0.59, abs=0.05)
    assert "too few replicates" in (tmp_path / "report.html").read_text()
    assert (
        "WARNING: too few"
        in command(
            "ask", "--runs", runs, *config[:2], "--out", tmp_path / "next.csv"
        ).err
    )


def test_a_record_that_is_not_there_is_noted_where_it_was_asked_for(tmp_path, command):
    """A mistyped name would start the study again."""
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(SINGLE))
    arguments = ["ask", "--config", tmp_path / "own.yaml"]
    arguments += ["--out", tmp_path / "next.csv"]
    mistyped = tmp_path / "nope.csv"
    note = f"there is no record {mistyped}, so these are the first runs of the study"
    assert note in command(*arguments, "--runs", mistyped).err
    assert "no record" not in command(*arguments).err


def cell(row, name, value):
    def change(table):
        table = table.astype({name: object})
        table.loc[row, name] = value
        return table

    return change


BAD = {
    "no parameter": (
        lambda table: table.drop(columns="friction"),
        "column friction is 'missing'; expected .*; found: sample, run, rolling",
    ),
    "no response": (
        lambda table: table.drop(columns="time_s"),
        "column time_s is 'missing'",
    ),
    "no number": (
        cell(3, "angle_deg", "steep"),
        "row 4: angle_deg is 'steep'; expected a finite number",
    ),
    "empty": (cell(3, "rolling", ""), "row 4: rolling is ''; expected a number from"),
    "out of range": (
        cell(2, "friction", 0.9),
        "row 3: friction is 0.9; expected a number from 0.2 to 0.8, its range",
    ),
    "not as fixed": (
        cell(2, "restitution", 0.5),
        "row 3: restitution is 0.5; expected 0.4, as it is fixed",
    ),
    "few samples": (
        lambda table: table[:6],
        "samples with a good run is 3; expected at least 4",
    ),
    "no rows": (lambda table: table[:0], "rows is 0"),
    "an id twice": (
        cell(2, "sample", 1),
        "row 3: sample is '1'; expected one set of parameters for each sample",
    ),
    "two ids": (
        cell(1, "sample", 99),
        "row 2: sample is '99'; expected 1, the sample of row 1",
    ),
    "a run twice": (
        cell(1, "run", 1),
        r"row 2: sample and run is \[1, '1'\]; expected each pair once",
    ),
    "a row twice": (
        lambda table: pd.concat([table, table[:1]]).drop(columns="run"),
        "row 33: row is 'repeated'",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_runs_are_refused_by_name(case, study, table):
    change, message = BAD[case]
    input_error(message, checked_runs, study, change(table))


def changed(key, value):
    content = put(yaml.safe_load(yaml.safe_dump(CONTENT)), key, value)
    if value is None:
        section, _, last = key.rpartition(".")
        del (at(content, section) if section else content)[last]
    return content


@pytest.mark.parametrize(
    ("strategy", "n"), [("sequential", 5), ("published", 9)]
)  # 9: beyond most_runs of the other
def test_the_runs_of_a_sample_stand_at_the_top_or_in_the_section(strategy, n):
    few = {"design": {"samples": 16}} if strategy == "published" else {}
    for seeds in ({"seeds": n}, {"sequential": {"seeds": n}}):
        asked = Study.own(CONTENT | seeds | few | {"strategy": strategy}).ask()
        counts = asked.groupby("sample").size()
        assert counts.tolist() == 16 * [n]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    yaml.safe_load((ROOT / "tests/calibrate/uncertainty/refused.yaml").read_text()),
)
def test_a_bad_configuration_is_refused_by_name(key, value, message):
    input_error(message, Study.own, changed(key, value))


@pytest.mark.parametrize("name", ["sequential", "posterior"])
def test_the_page_tells_the_defaults(name):
    row = re.search(rf"^\| `{name}` \|.*$", PAGE, re.MULTILINE)[0]
    defaults = {
        key: float(value) for key, value in re.findall(r"`(\w+)` \(([\d.]+)\)", row)
    }
    content = {key: value for key, value in CONTENT.items() if key != name}
    completed = complete_configuration(content)[name]
    completed.pop("seed", None)
    assert defaults == completed


def test_all_faults_of_a_configuration_are_reported_at_once():
    content = changed("seed", None) | {"design": {"samples": 3}, "label": 3}
    content["parameters"]["mu.s"] = [0.8, 0.2]
    content["targets"]["time_s"] |= {"sd": -1, "repetitions": "many"}
    found = {fault.key for fault in input_error("expected", Study.own, content).faults}
    targets = {"targets.time_s.sd", "targets.time_s.repetitions"}
    assert found == {"seed", "design.samples", "label", "parameters.mu.s", *targets}


@pytest.mark.slow
def test_a_prior_moves_the_answer(table):
    study = Study.own(
        changed(
            "parameters.friction",
            {"prior": {"mean": 0.5, "sd": 0.01}, "range": [0.2, 0.8]},
        )
    )
    found = calibration.calibrate(study, checked_runs(study, table))
    assert found.summary["representative"]["friction"] < 0.58, "0.59 without it"


def test_the_verbs_want_an_own_configuration(table, tmp_path, command):
    runs, *config = files_of(tmp_path, {"label": "wheat"}, table)
    for verb in (["ask"], ["tell", runs], ["calibrate", runs]):
        assert (
            "simulator is None; expected the name of your simulator"
            in command(*verb, *config, status=2).err
        )
    runs, *config = files_of(
        tmp_path, changed("design", {"samples": 90, "seed": 3}), table
    )
    assert (
        "does not read design.samples, design.seed\n"
        in command("ask", *config[:3], tmp_path / "next.csv").err
    )
    cases = yaml.safe_load(
        (ROOT / "tests/calibrate/uncertainty/unread.yaml").read_text()
    )
    expected = [keys for _, keys in cases]
    assert [list_unread_keys(CONTENT | given) for given, _ in cases] == expected


@pytest.mark.parametrize("entry", [30.0, None, [30, 1, 9, 2], "30 +- 1"])
def test_a_target_of_another_form_is_answered_with_the_form(entry):
    input_error(
        r"targets.angle_deg is .*; expected \(mean, standard deviation, number of",
        Study,
        {"friction": (0.2, 0.8)},
        {"angle_deg": entry},
    )
