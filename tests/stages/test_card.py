"""The material card: what it says, its schema, and two of them side by side."""

import copy
import json
import math
from pathlib import Path
from types import MappingProxyType

import jsonschema
import numpy as np
import pandas as pd
import pytest
from documents import card_files
from known import is_known
from refusals import input_error, not_refused
from shared import ROOT, TARGETS, settings_of, studied
from stage_runs import answer_of

from repose.bench.parameters import (
    LABELS,
    LAW_PARAMETERS,
    PARAMETERS,
    parameters_of_law,
)
from repose.bench.space import contact_space
from repose.calibrate import answer
from repose.calibrate.card import (
    POSTERIOR_INTERVAL,
    SOLUTION_RANGE,
    add_remark,
    make_interval_entry,
)
from repose.calibrate.chance import REPORTED_PERCENTS
from repose.calibrate.responses import response
from repose.calibrate.runs import name_error_column
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure.angles import MEAN_KEYS
from repose.stages import card, card_study, card_text
from repose.stages.card import make_schema
from repose.stages.card_contradictions import find_contradictions
from repose.stages.card_study import describe_response

STUDY = ROOT / "results/published/goji_berry"
HEIGHT = TARGETS[1]
FIXED = {"e_gp": {"fixed": 0.3}}
HELD = {"low", "high", "at_bound", "widened"}
SPACE = contact_space(
    {name: [0.2, 0.7] if name == "mus_gg" else [0.1, 0.5] for name in PARAMETERS}
)
CARDS = sorted(
    [
        *(ROOT / "results/published").rglob("card.json"),
        *(ROOT / "crops/cards").glob("*.json"),
    ]
)
ABOVE = "The simulated Height lies 11 mm above its range."
MISSED = f"targets NOT met. Height 80.00 +- 0.40 mm (measured 65.57, +22.0 %). {ABOVE}"
WIDENED = "interval widened to contain the answer"
SMALL = "wheat: a small run, its numbers are no calibration: "


@pytest.fixture
def config():
    found = copy.deepcopy(PipelineConfig.load("config/config.yaml").config)
    found["parameters"] |= FIXED
    found["targets"] = [
        target for target in found["targets"] if target["response"] == "height_mm"
    ]
    return found


@pytest.fixture
def solutions():
    """Sets in which mus_gg falls as mur_gg rises, and nothing else goes together."""
    rng = np.random.default_rng(1)
    table = pd.DataFrame({name: rng.uniform(0.2, 0.4, 4000) for name in PARAMETERS})
    table["mus_gg"] = 0.8 - table["mur_gg"]
    return table


def made(
    config,
    solutions,
    posterior=None,
    simulated=66.0,
    runs=32,
    within=0.5,
    values=MappingProxyType({}),
    **known,
):
    checks = tuple(
        answer.Check(
            target["response"],
            "funnel",
            response(target["response"]).unit,
            target["value"],
            target["sd"],
            target["repetitions"],
            *target["range"],
            simulated,
            0.4 if runs > 1 else None,
            runs,
            "ok",
            predicted=67.98,
        )
        for target in config["targets"]
    )
    values = {
        name: 0.3 if name in FIXED else solutions[name].mean()
        for name in config["parameters"]
    } | values
    found = answer.Result(
        "wheat",
        values,
        True,
        "",
        checks,
        Path("results"),
        {1.0: 0.25, 2.0: within},
        **known,
    )
    berry = read_grain(STUDY / "berry/berry.json")
    particle = Particle.from_record(record_of_an_ellipsoid())
    return card_study.make_card(
        studied(config), found, berry, particle, solutions, posterior
    )


def record_of_an_ellipsoid():
    half = 5e-4 * np.array([21.14, 11.37, 9.88])
    volume = 4 / 3 * np.pi * half.prod()
    mass = 840.47 * volume
    inertia = mass / 5 * (np.sum(half**2) - half**2)
    return Particle(
        "ellipsoid", half[None], 840.47, volume, mass, inertia, half.max(), 0.0, 0.0
    ).record()


def test_a_card_has_the_intervals_of_the_sets_or_of_the_posterior(config, solutions):
    made_card = made(config, solutions)
    card.check_card(made_card, "card")
    parameters = made_card["parameters"]
    assert parameters["mus_gg"]["low"] == solutions["mus_gg"].min()
    assert parameters["mus_gg"]["high"] == solutions["mus_gg"].max()
    assert made_card["correlations"]["mus_gg"]["mur_gg"] == -1.0
    assert abs(made_card["correlations"]["e_gg"]["mus_gp"]) < 0.1
    assert made_card["interval"] == SOLUTION_RANGE
    fixed = {"meaning": "", "value": 0.3, "low": None, "high": None, "given": "fixed"}
    assert parameters["e_gp"] | {"meaning": ""} == fixed
    assert "e_gp" not in made_card["correlations"]
    grain = made_card["grain"]
    assert grain["ellipsoids_mm"] == [[10.57, 5.685, 4.94]]
    expected = np.pi / 6 * 21.14 * 11.37 * 9.88
    assert grain["volume_mm3"] == pytest.approx(expected, rel=1e-5)
    assert grain["spheres_mm"] == []
    free = [name for name in PARAMETERS if name not in FIXED]
    intervals = pd.DataFrame(
        {"parameter": free, "credible_low": 0.21, "credible_high": 0.39}
    )
    made_card = made(
        config, solutions, (intervals, solutions.assign(mus_gg=solutions["mur_gg"]))
    )
    assert made_card["interval"] == POSTERIOR_INTERVAL
    assert "determination" not in made_card["parameters"]["e_gg"]
    assert made_card["parameters"]["e_gg"]["low"] == 0.21
    assert made_card["parameters"]["e_gg"]["high"] == 0.39
    assert made_card["correlations"]["mus_gg"]["mur_gg"] == 1.0


@pytest.mark.parametrize(
    ("value", "expected", "remark"),
    [
        (0.5, {"low": 0.4, "high": 0.6}, "friction"),
        (0.4, {"low": 0.4, "high": 0.6}, "friction"),
        (
            0.3,
            {"low": 0.3, "high": 0.6, "widened": True},
            f"friction; {WIDENED}",
        ),
        (
            0.65,
            {"low": 0.4, "high": 0.65, "widened": True},
            f"friction; {WIDENED}",
        ),
        (
            0.2,
            {"low": 0.2, "high": 0.6, "at_bound": "lower", "widened": True},
            f"friction; at the lower bound of the range; {WIDENED}",
        ),
        (
            0.2004,
            {"low": 0.2, "high": 0.6, "at_bound": "lower", "widened": True},
            f"friction; at the lower bound of the range; {WIDENED}",
        ),
        (
            0.2006,
            {"low": 0.2006, "high": 0.6, "widened": True},
            f"friction; {WIDENED}",
        ),
        (
            0.7,
            {"low": 0.4, "high": 0.7, "at_bound": "upper", "widened": True},
            f"friction; at the upper bound of the range; {WIDENED}",
        ),
        (
            0.6994,
            {"low": 0.4, "high": 0.6994, "widened": True},
            f"friction; {WIDENED}",
        ),
    ],
)
def test_an_interval_holds_the_answer_and_tells_the_bound(value, expected, remark):
    """The range 0.2 to 0.7 has the width 0.5, so 0.0005 from a bound is at it; the interval is 0.4 to 0.6."""
    found = make_interval_entry(SPACE, "mus_gg", value, 0.4, 0.6)
    assert found == expected
    assert add_remark("friction", found) == remark


def test_an_interval_that_begins_at_a_bound_says_so():
    assert make_interval_entry(SPACE, "mus_gg", 0.2, 0.2, 0.6) == {
        "low": 0.2,
        "high": 0.6,
        "at_bound": "lower",
    }


def test_a_fixed_parameter_has_no_interval():
    ranges = {name: [0.1, 0.5] for name in PARAMETERS} | {"e_gp": {"fixed": 0.3}}
    space = contact_space(ranges)
    assert make_interval_entry(space, "e_gp", 0.3, None, None) == {
        "low": None,
        "high": None,
    }


def test_bounds_and_widened_intervals_are_on_the_card_and_in_its_text(
    config, solutions
):
    free = [name for name in PARAMETERS if name not in FIXED]
    intervals = pd.DataFrame(
        {"parameter": free, "credible_low": 0.45, "credible_high": 0.5}
    )
    found = made(
        config,
        solutions,
        (intervals, solutions),
        values={"e_gg": 0.1, "mus_gg": 0.47, "mus_gp": 0.44},
    )
    card.check_card(found, "card")
    rows = {
        name: {key: row[key] for key in row if key in HELD}
        for name, row in found["parameters"].items()
    }
    assert rows["e_gg"] == {
        "low": 0.1,
        "high": 0.5,
        "at_bound": "lower",
        "widened": True,
    }
    # The entries of the test card are invented, but its intervals agree.
    excluded = json.loads(json.dumps(found))
    assert not [
        one for one in find_contradictions(excluded) if one.key.startswith("param")
    ]
    excluded["parameters"]["e_gg"]["low"] = 0.45
    keys = [one.key for one in find_contradictions(excluded)]
    assert "parameters.e_gg.value" in keys
    assert rows["mus_gg"] == {"low": 0.45, "high": 0.5}
    assert rows["mus_gp"] == {"low": 0.44, "high": 0.5, "widened": True}
    line_of = {
        line.split()[0]: line
        for line in card_text.describe_card(found).splitlines()
        if line.startswith("  m") or "e_gg" in line
    }
    assert line_of["e_gg"].endswith(
        f"restitution, grain-grain; at the lower bound of the range; {WIDENED}"
    )
    assert line_of["mus_gp"].endswith(f"; {WIDENED}")
    assert line_of["mus_gg"].endswith("static friction, grain-grain")


@pytest.fixture
def comparisons():
    """Those of the kept study: its samples, and the published sets that it shows."""
    study = studied(copy.deepcopy(PipelineConfig.load("config/config.yaml").config))
    files = {
        "dataset": STUDY / "dataset.csv",
        "published": ROOT / "resources/published/table4.csv",
        "published_simulated": STUDY / "validation/published.csv",
    }
    return card_study._make_comparisons(study, files)


def test_a_card_has_the_published_answer_and_the_samples_inside(
    comparisons, config, solutions
):
    published = comparisons["published"]
    assert published["parameters"]["mus_gg"] == 0.642
    assert published["source"].startswith("Ji et al. 2026")
    stored = pd.read_csv(STUDY / "validation/published.csv")
    row = stored[stored["solution"] == "representative"].iloc[0]
    mean = published["responses"]["aor_deg"]
    assert mean["simulated"] == row["aor_simulated_deg"]
    assert mean["standard_error"] == row["aor_se_deg"]
    assert published["runs"] == row["n_seeds"]
    assert ("stale" in published) is bool(row["stale"])
    inside = comparisons["samples_inside"]
    samples = pd.read_csv(STUDY / "dataset.csv")
    is_met = samples["aor_deg"].between(31, 34) & samples["height_mm"].between(64, 69)
    assert (inside["samples"], inside["inside"]) == (len(samples), is_met.sum())
    span = np.ptp(samples.loc[is_met, "mus_gg"]) / (0.75 - 0.35)
    assert inside["spans"]["mus_gg"] == pytest.approx(span)
    assert set(inside["spans"]) == set(PARAMETERS)
    found = made(config, solutions) | comparisons
    card.check_card(found, "card")
    lines = card_text.describe_card(found).splitlines()
    (sentence,) = [line for line in lines if "simulated samples already lie" in line]
    assert "of the searched ranges" in sentence
    (answer_line,) = [line for line in lines if line.startswith("published answer")]
    assert "mus_gg 0.642, mur_gg 0.037" in answer_line
    assert f"{row['height_simulated_mm']:.2f} +- {row['height_se_mm']:.2f} mm" in (
        answer_line
    )
    del published["responses"], published["runs"]
    card.check_card(found, "card")
    assert "simulated here" not in card_text.describe_card(found)


def test_a_card_without_published_sets_has_none(tmp_path):
    study = studied(copy.deepcopy(PipelineConfig.load("config/config.yaml").config))
    none = {"dataset": None, "published": None, "published_simulated": None}
    assert card_study._make_comparisons(study, none) == {}
    # A table without a recommended set, and one that was simulated by another engine
    sets = pd.read_csv(ROOT / "resources/published/table4.csv")
    path = tmp_path / "sets.csv"
    sets[sets["solution"] != "representative"].to_csv(path, index=False)
    assert card_study._make_comparisons(study, none | {"published": path}) == {}
    stored = pd.read_csv(STUDY / "validation/published.csv").assign(stale=True)
    stored.to_csv(path, index=False)
    files = none | {"published": path, "published_simulated": path}
    assert card_study._make_comparisons(study, files)["published"]["stale"] is True


@pytest.mark.parametrize(
    ("ratios", "bits", "words", "sentence"),
    [
        ([0.9, 0.93, 1.0, 0.95, 0.9], 0.23, "not determined", "none of the 5 param"),
        (
            [0.89, 0.93, 1.0, 0.95, 0.9],
            0.1,
            "weakly determined",
            "4 not determined, 1 weakly determined.",
        ),
        ([0.5] * 5, 1.2, "determined", "5 determined."),
    ],
)
def test_a_card_says_how_well_each_parameter_is_determined(
    ratios, bits, words, sentence, config, solutions
):
    free = [name for name in PARAMETERS if name not in FIXED]
    intervals = pd.DataFrame(
        {"parameter": free, "credible_low": 0.2, "credible_high": 0.4}
    ).assign(width_ratio=ratios, information_bits=bits)
    found = made(config, solutions, (intervals, solutions))
    card.check_card(found, "card")
    assert found["parameters"][free[0]]["determination"] == words
    assert "determination" not in found["parameters"]["e_gp"]
    text = card_text.describe_card(found)
    assert f"restitution, grain-grain; {words}\n" in text
    assert sentence in text


@pytest.mark.parametrize(
    ("changes", "fields", "status", "first"),
    [
        (
            {},
            {
                "met": True,
                "out_of_reach": False,
                "reason": "The simulated mean lies inside the range.",
            },
            0,
            "wheat: targets met. Height 66.00 +- 0.40 mm (measured 65.57, +0.7 %).",
        ),
        ({"simulated": 80.0}, {"met": False, "reason": ABOVE}, 3, f"wheat: {MISSED}"),
        (
            {"simulated": 80.0, "out_of_reach": True, "small_run": True},
            {"met": False, "out_of_reach": True, "small_run": True},
            3,
            f"{SMALL}{MISSED}",
        ),
    ],
)
def test_a_script_asks_the_card_whether_the_targets_are_met(
    changes, fields, status, first, config, solutions, tmp_path, command
):
    found = made(config, solutions, **changes)
    path = tmp_path / "card.json"
    card.check_card(found, "card")
    assert {name: found[name] for name in fields} == fields
    assert ("small_run" in found) is ("small_run" in changes)
    path.write_text(json.dumps(found))
    lines = command("card", "check", path, status=status).out.splitlines()
    assert lines == [first, *([found["reason"]] if status == 0 else [])]
    assert command("card", "show", path).out.splitlines()[1] == found["reason"]


def test_a_card_of_before_the_verdict_is_judged_by_its_tests(tmp_path, command):
    """`matched` and `paper` said met by their means alone; only one is met by its errors."""
    known = ROOT / "tests/known"
    whole_side = ROOT / "results/published/whole_side/card.json"
    verdicts = {
        known / "card_matched.json": (0, "matched: targets met."),
        known / "card_paper.json": (4, "paper: targets undecided."),
        whole_side: (3, "recommended: targets NOT met."),
    }
    for path, (status, beginning) in verdicts.items():
        assert "verdict" not in card.read_card(path)
        out = command("card", "check", path, status=status).out
        assert out.startswith(beginning)
        shown = command("card", "show", path).out
        assert out.rstrip().endswith(shown.splitlines()[1])
    paper = command("card", "check", known / "card_paper.json", status=4).out
    assert "inside with a probability of 68 %; about 29 further runs" in paper


@pytest.mark.parametrize(
    ("changes", "fields", "expected"),
    [
        ({}, {}, answer.Verdict.MET),
        ({}, {"met": False}, answer.Verdict.NOT_MET),
        ({}, {"met": False, "out_of_reach": True}, answer.Verdict.NOT_MET),
        ({"simulated": 68.9}, {"met": True}, answer.Verdict.UNDECIDED),
        ({"simulated": 69.1}, {"met": False}, answer.Verdict.UNDECIDED),
        ({"simulated": 80.0}, {}, answer.Verdict.NOT_MET),
        ({"runs": 1}, {"met": True}, answer.Verdict.UNDECIDED),
    ],
)
def test_the_verdict_of_an_older_card_is_that_of_today(
    changes, fields, expected, config, solutions
):
    found = made(config, solutions, **changes) | fields
    for entry in (found, *found["tests"]):
        del entry["verdict"], entry["probability_inside"]
    card.check_card(found, "card")
    assert card_text.get_verdict(found) is expected
    assert f"targets {expected}" in card_text.describe_card(found)


def test_every_card_is_checked_and_a_wrong_file_is_refused(tmp_path, command):
    status = {True: 0, False: 3, None: 4}
    for path in CARDS:
        verdict = card_text.get_verdict(card.read_card(path))
        command("card", "check", path, status=status[verdict.met])
    (tmp_path / "bad.json").write_text("{}")
    for path in (tmp_path / "bad.json", tmp_path / "none.json"):
        assert str(path) in command("card", "check", path, status=2).err
    command("card", "check", CARDS[0], CARDS[0], status=2)


def test_equal_rows_of_sizes_are_one_mean(config, solutions):
    """Two equal rows are no two grains; 50 that scatter are 50."""
    particle = Particle.from_record(record_of_an_ellipsoid())
    grain = read_grain(STUDY / "berry/berry.json")
    measured = card_study._describe_grain(True, grain, particle)
    assert measured["measured"] == 50
    equal = grain | {"n": 2, "scale_sd": 1e-16}
    made_card = made(config, solutions)
    made_card["grain"] = card_study._describe_grain(True, equal, particle)
    assert made_card["grain"]["measured"] == 1
    card.check_card(made_card, "card")
    assert "9.88 mm (mean axes only), ellipsoid" in card_text.describe_card(made_card)


def test_a_card_describes_the_laws_of_the_study(config):
    result = card_study.describe_laws(settings_of(config).simulation)
    assert result["normal"].startswith("Hertz")
    assert "mu_s times the size of the damped normal force" in result["tangential"]
    config["simulation"] |= {"contact_law": "linear_spring", "tension": "keep"}
    other = card_study.describe_laws(settings_of(config).simulation)
    assert other["normal"].startswith("linear spring")
    assert "mu_r times the elastic part of the normal force" in other["rolling"]
    assert (
        set(result)
        == set(other)
        == {"normal", "tangential", "rolling", "end of an impact"}
    )


def test_a_test_tells_how_the_bench_test_is_done(config, solutions):
    height = made(config, solutions)["tests"][0]
    assert height["definition"]["name"] == "Height"
    assert height["bench"]["berries"] == 500
    assert height["bench"]["outlet_diameter_mm"] == 32.0
    assert "seeds" not in height["bench"]


def test_an_angle_has_the_settings_of_its_line(config):
    config["targets"] = [
        config["targets"][0]
        | {"response": "aor_deg", "value": 30.0, "range": [29.0, 31.0]}
    ]
    config["measure"] |= {"response": "flank", "fit_from": 0.2}
    angle = describe_response(
        studied(config), response("aor_deg"), read_grain(STUDY / "berry/berry.json")
    )["definition"]
    assert angle["name"] == "angle, flank"
    assert angle["settings"]["fit_from"] == 0.2
    assert angle["settings"]["fit_to"] == 0.8
    # Eq. 1 of the mean axes, where the configuration has no height of a grain
    expected = (21.14 * 11.37 * 9.88) ** (1 / 3)
    assert angle["settings"]["berry_height_mm"] == pytest.approx(expected, rel=1e-3)
    config["measure"]["response"] = "secant"
    secant = describe_response(studied(config), response("aor_deg"), {})["definition"]
    assert secant["name"] == "angle, secant"
    assert "fit_from" not in secant["settings"]


def test_a_card_says_whether_piles_can_have_its_angle_at_its_height(config, solutions):
    assert all("reach" not in test for test in made(config, solutions)["tests"])
    angle = config["targets"][0] | {
        "response": "aor_deg",
        "value": 60.0,
        "range": [59.0, 61.0],
    }
    height = config["targets"][0]
    config["targets"] = [angle]
    assert "reach" not in made(config, solutions)["tests"][0]
    config["targets"] = [angle, height]
    found = made(config, solutions)
    of_angle, of_height = found["tests"]
    assert "reach" not in of_height
    assert of_angle["reach"]["possible"] is False
    assert of_angle["reach"]["sentence"] in card_text.describe_card(found)
    card.check_card(found, "card")


def test_an_angle_of_a_pile_has_its_line_and_the_same_piles_by_every_other(
    config, solutions, command, tmp_path
):
    config["targets"] = [
        config["targets"][0]
        | {"response": "aor_deg", "value": 30.0, "range": [29.0, 31.0]}
    ]
    config["measure"] |= {
        "response": "secant",
        "fit_from": 0.3,
        "fit_to": 0.8,
        "flank": "levels",
    }
    check = answer.Check(
        "aor_deg", "funnel", "deg", 30.0, 1.0, 10, 29.0, 31.0, 31.0, 0.4, 32, "ok"
    )
    found = answer.Result(
        "wheat",
        dict.fromkeys(config["parameters"], 0.3),
        True,
        "",
        (check,),
        Path(),
        {},
    )
    row = {name: 30.0 + k for k, name in enumerate(MEAN_KEYS.values())}
    row |= {name_error_column(name): 0.4 for name in MEAN_KEYS.values()} | {
        "aor_whole_deg": math.nan
    }
    berry = read_grain(STUDY / "berry/berry.json")
    particle = Particle.from_record(record_of_an_ellipsoid())
    for means in (None, row):
        made_card = card_study.make_card(
            studied(config), found, berry, particle, solutions, answer_row=means
        )
        card.check_card(made_card, "card")
        assert made_card["tests"][0]["line"] == "secant, foot to crest"
        assert ("definitions" in made_card["tests"][0]) == (means is not None)
    (tmp_path / "card.json").write_text(json.dumps(made_card))
    text = command("card", "show", tmp_path / "card.json").out
    # without the versions
    is_known("card.txt", text.rpartition("\n")[0].rpartition("\n")[0])
    assert (
        "definitions" not in made(config | {"targets": [HEIGHT]}, solutions)["tests"][0]
    )


def over(whole, change):
    return whole | {
        key: over(whole[key], value) if isinstance(value, dict) else value
        for key, value in change.items()
    }


def test_an_invalid_card_is_refused_with_every_fault(config, solutions):
    bad = made(config, solutions)
    bad["grain"]["density_kg_m3"] = -1
    del bad["laws"]
    message = "laws is None; expected a material card: the key is missing"
    fault = input_error(message, card.check_card, bad, "mine.json")
    assert "grain.density_kg_m3 is -1" in str(fault)


def test_each_wrong_value_of_a_card_is_refused(config, solutions):
    good = made(config, solutions)

    def check(change):
        card.check_card(over(good, change), "mine.json")

    def parameter(name, **keys):
        return {"parameters": {name: keys}}

    bad = [
        (parameter("e_gg", value=value), r"e_gg\.value is .*; expected .* 0\.01 to 1")
        for value in (0.0, -0.5, 5)
    ]
    bad += [
        (parameter("mus_gg", value=value), r"mus_gg\.value is .* a finite number")
        for value in (math.nan, math.inf)
    ]
    bad += [
        (parameter("mus_gg", high=10.5), r"mus_gg\.high is 10\.5; .* 0 to 10"),
        (parameter("mus_gg", given="guessed"), r"mus_gg\.given is 'guessed'"),
        (parameter("mus_gg", unit="1"), r"mus_gg\.unit is '1'; .* a known key"),
        (
            {"correlations": {"mus_gg": {"mur_gg": -1.1}}},
            r"correlations\.mus_gg\.mur_gg is -1\.1",
        ),
        ({"within": {"1 %": 1.5}}, r"within\.1 % is 1\.5"),
        ({"tests": []}, "tests is"),
        ({"verdict": "maybe"}, "verdict is 'maybe'; .* 'undecided'"),
        ({"met": "yes"}, "met is 'yes'"),
        ({"grain": {"shear_modulus_pa": 43.0}}, "greater than or equal to 1000"),
        ({"grain": {"density_kg_m3": 0.84047}}, "greater than or equal to 10"),
        ({"grain": {"shape": "cube"}}, "grain.shape is 'cube'"),
        ({"grain": {"mean_axes_mm": [21.1, -11.4, 9.9]}}, r"mean_axes_mm\.1 is -11\.4"),
        ({"grain": {"mean_axes_mm": [21.1]}}, "mean_axes_mm is"),
        ({"wall": {"shear_modulus_pa": 1.0}}, "greater than or equal to 1000"),
    ]
    assert not_refused(check, bad, InputError) == []


def test_a_card_without_a_parameter_is_refused(config, solutions):
    bad = made(config, solutions)
    del bad["parameters"]["mur_gp"]
    input_error(r"parameters\.mur_gp is None; .* missing", card.check_card, bad, "mine")


@pytest.mark.parametrize(
    "path", CARDS, ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_a_published_card_is_whole(path):
    """Every published test of ours was run more than once, so each card tells how near its piles are to the targets."""
    found = card.read_card(path)
    jsonschema.validate(found, make_schema())
    if (
        "simulator" in found
    ):  # its drums were simulated again by an example, which the card does not know
        return
    assert all(test["runs"] >= 2 for test in found["tests"])
    assert None not in found["within"].values()
    assert found["within"].keys() == {f"{percent:g} %" for percent in REPORTED_PERCENTS}


def test_schema_and_page_are_made_from_the_models():
    for path, text in card_files.texts().items():
        assert path.read_text() == text, "python tests/documents/card_files.py"


def test_a_check_of_before_is_refused(tmp_path):
    table = pd.read_csv(STUDY / "validation/representative.csv")
    table.drop(columns=["within_1_percent", "within_2_percent"]).to_csv(
        tmp_path / "old.csv", index=False
    )
    config = PipelineConfig.load("config/config.yaml").config
    files = STUDY / "miga/summary.json", tmp_path / "old.csv", "feasible.csv"
    input_error(
        r"old\.csv: column within_1_percent is 'missing'",
        answer_of,
        studied(config),
        *files,
    )


def test_two_cards_side_by_side_tell_what_differs(config, solutions, tmp_path, command):
    first = made(config, solutions)
    config["simulation"]["tension"] = "keep"
    config["funnel"]["outlet_diameter_mm"] = 40.0
    config["measure"]["views"] = 6
    second = made(
        config, solutions.assign(e_gg=solutions["e_gg"] + 0.5), simulated=None
    )
    for name, content in (("one", first), ("other", second)):
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    lines = command(
        "card", "compare", tmp_path / "one.json", tmp_path / "other.json"
    ).out.splitlines()
    is_known("cards.txt", "\n".join(lines))
    assert "Different simulators" not in card_text.compare_cards(first, second)
    assert "Different simulators: repose | theirs." in card_text.compare_cards(
        first, second | {"simulator": "theirs"}
    )
    second["tests"][0]["definition"]["name"] = "angle, secant"
    assert any(
        "Different definitions of height_mm" in line
        for line in card_text.compare_cards(first, second).splitlines()
    )


def test_a_card_in_words_gives_answer_and_tests(config, solutions, tmp_path, command):
    (tmp_path / "card.json").write_text(
        json.dumps(made(config, solutions, simulated=80.0, runs=1, within=None))
    )
    text = command("card", "show", tmp_path / "card.json").out
    phrases = (
        "wheat; targets undecided",
        "mus_gg, mur_gg -1.00",
        "Simulated minus measured: height_mm ",
        "fixed",
        "predicted 67.98 (expected optimism unknown), 15.0 % off the simulated",
        "all within 1 %: probability 0.25",
        "funnel: berries 500, rate_per_s 30",
        "all within 2 %: probability unknown; it requires two good runs of each bench test",
        "definition: Height; views 18, mm_per_pixel 0.25, largest_pile_only yes",
    )
    assert [phrase for phrase in phrases if phrase not in text] == []


def test_the_verb_writes_a_card_that_can_be_read(tmp_path, command):
    particle = tmp_path / "particle.json"
    out = tmp_path / "card.json"
    particle.write_text(json.dumps(record_of_an_ellipsoid()))
    files = {
        "config": "config.json",
        "berry": "berry/berry.json",
        "feasible": "miga/feasible.csv",
        "summary": "miga/summary.json",
        "representative": "validation/representative.csv",
        "dataset": "dataset.csv",
        "published-simulated": "validation/published.csv",
    }
    arguments = [f"--{name}={STUDY / path}" for name, path in files.items()]
    arguments.append(f"--published={ROOT / 'resources/published/table4.csv'}")
    command(
        "stage", "material_card", *arguments, f"--particle={particle}", f"--out={out}"
    )
    found = card.read_card(out)
    summary = json.loads((STUDY / "miga/summary.json").read_text())
    assert all(
        found["parameters"][name]["value"] == summary["representative"][name]
        for name in PARAMETERS
    )
    assert found["made_by"]["configuration"] is not None
    assert found["tests"]
    assert found["published"]["runs"] > 0
    assert found["samples_inside"]["samples"] == 150


def test_a_card_holds_the_parameters_of_every_contact_law(config, solutions):
    """The schema's pattern and `bench.parameters.LAW_PARAMETERS` name the same parameters."""
    for law in {
        law
        for further in LAW_PARAMETERS.values()
        if further.needed
        for law in further.laws
    }:
        names = parameters_of_law(law)
        config["simulation"]["contact_law"] = law
        law_config = config | {
            "parameters": config["parameters"] | {name: [0.0, 0.5] for name in names}
        }
        result = made(
            law_config, solutions.assign(**{name: solutions["e_gg"] for name in names})
        )
        card.check_card(result, "card")
        assert tuple(result["parameters"]) == (*PARAMETERS, *names)
        assert all(LABELS[name] in card_text.describe_card(result) for name in names)
    result["parameters"]["surface_gg"] = result["parameters"]["e_gg"]
    input_error("surface_gg", card.check_card, result, "card")
