"""A card that was edited by hand is read only if its entries agree with each other."""

import json
from pathlib import Path

import pytest
from refusals import input_error
from shared import ROOT

from repose.stages import card
from repose.stages.card_contradictions import find_contradictions

GOJI = ROOT / "tests/known/card_goji_berry.json"
OLDER = ROOT / "tests/known/card_matched.json"
MAIZE = ROOT / "crops/cards/maize.json"
CARDS = sorted(
    [
        *(ROOT / "results/published").rglob("card.json"),
        *(ROOT / "crops/cards").glob("*.json"),
        *(ROOT / "tests/known").glob("card*.json"),
    ]
)


def changed(path, changes):
    """A card with other values at dotted keys."""
    content = json.loads(Path(path).read_text())
    for dotted_key, value in changes.items():
        *steps, last = [
            int(step) if step.isdigit() else step for step in dotted_key.split(".")
        ]
        entry = content
        for step in steps:
            entry = entry[step]
        entry[last] = value
    return content


def rounded(value, digits):
    """A value of JSON whose numbers have some significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, dict):
        return {key: rounded(item, digits) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item, digits) for item in value]
    return value


@pytest.mark.parametrize("path", CARDS, ids=lambda path: path.parent.name + path.stem)
@pytest.mark.parametrize("digits", [4, 6, 17])
def test_a_kept_card_agrees_with_itself_and_so_do_its_rounded_numbers(path, digits):
    content = rounded(json.loads(path.read_text()), digits)
    assert list(find_contradictions(content)) == []


# What somebody edits, and the message, which names both keys with their values.
EDITED = {
    "more samples inside than samples": (
        MAIZE,
        {"samples_inside": {"samples": 20, "inside": 21}},
        "samples_inside.inside is 21; expected at most the number of all samples, "
        "because samples_inside.samples is 20",
    ),
    "a verdict of the card": (
        GOJI,
        {"verdict": "NOT met"},
        'met is true; expected false, because verdict is "NOT met"',
    ),
    "a verdict and met of the card": (
        MAIZE,
        {"verdict": "met", "met": True},
        "verdict is 'met'; expected 'undecided', because probability_inside is 0.51388",
    ),
    "met of the card": (
        GOJI,
        {"met": None},
        'met is null; expected true, because verdict is "met"',
    ),
    "met and verdict against a test": (
        GOJI,
        {"tests.1.met": False, "tests.1.verdict": "NOT met"},
        "verdict is 'met'; expected 'NOT met', because tests.1.verdict is \"NOT met\"",
    ),
    "the verdict of a test": (
        MAIZE,
        {"tests.0.verdict": "met", "tests.0.met": True},
        "tests.0.verdict is 'met'; expected 'undecided', because "
        "tests.0.probability_inside is 0.51",
    ),
    "a mean": (
        GOJI,
        {"tests.0.simulated": 35.0, "tests.0.definitions.flank.simulated": 35.0},
        "tests.0.probability_inside is 0.9999994868405118; expected from 5.583e-05 to "
        "0.000634, because tests.0.simulated is 35.0, tests.0.standard_error is 0.2662",
    ),
    "a standard error": (
        MAIZE,
        {
            "tests.0.standard_error": 0.02,
            "tests.0.definitions.flank.standard_error": 0.02,
        },
        "tests.0.probability_inside is 0.5131",
    ),
    "a range": (
        GOJI,
        {"tests.1.high": 65.0},
        "tests.1.probability_inside is 0.9999999937861026; expected from 0.0005581 to",
    ),
    "ends of a range": (
        OLDER,
        {"tests.1.low": 69.0, "tests.1.high": 64.0},
        "tests.1.low is 69.0; expected at most the upper end, because tests.1.high is "
        "64.0",
    ),
    "a probability that is removed": (
        GOJI,
        {"tests.0.probability_inside": None},
        "tests.0.probability_inside is null; expected about 1",
    ),
    "a probability of the card": (
        MAIZE,
        {"probability_inside": 0.96, "verdict": "met", "met": True},
        "probability_inside is 0.96; expected about 0.5131, because "
        "tests.0.probability_inside is 0.51",
    ),
    "a probability of the card that is removed": (
        MAIZE,
        {"probability_inside": None},
        "probability_inside is null; expected about 0.5131",
    ),
    "a number of runs": (
        MAIZE,
        {"tests.0.runs": 1},
        "tests.0.standard_error is 0.4724114066790011; expected null for fewer than two "
        "runs, because tests.0.runs is 1",
    ),
    "no runs": (
        OLDER,
        {"tests.0.runs": 0},
        "tests.0.simulated is 32.87272821757584; expected null without runs",
    ),
    "a mean that is not that of its line": (
        OLDER,
        {"tests.0.simulated": 33.0},
        "tests.0.simulated is 33.0; expected the number of the same line, because "
        "tests.0.definitions.flank.simulated is 32.87272821757584",
    ),
    "a status": (
        MAIZE,
        {"tests.0.status": "not simulated again"},
        "tests.0.verdict is 'undecided'; expected 'not checked yet'",
    ),
    "out of reach": (
        MAIZE,
        {"out_of_reach": True},
        "verdict is 'undecided'; expected 'NOT met', because out_of_reach is true",
    ),
    "tests that are checked": (
        MAIZE,
        {"verdict": "not checked yet"},
        "verdict is 'not checked yet'; expected another one, because tests.0.verdict is "
        '"undecided"',
    ),
    "met of a test of an older card": (
        OLDER,
        {"tests.0.simulated": 35.0, "tests.0.definitions.flank.simulated": 35.0},
        "tests.0.met is true; expected false, because tests.0.simulated is 35.0, "
        "tests.0.low is 31.0, tests.0.high is 34.0",
    ),
    "met of an older card": (
        ROOT / "results/published/whole_side/card.json",
        {"met": True},
        "met is true; expected false or null, because tests.0.met is false",
    ),
    "out of reach in an older card": (
        OLDER,
        {"out_of_reach": True},
        "met is true; expected false, because out_of_reach is true",
    ),
    "probabilities of two tolerances": (
        GOJI,
        {"within.1 %": 0.99, "within.2 %": 0.5},
        "within.1 % is 0.99; expected at most that of the wider tolerance, because "
        "within.2 % is 0.5",
    ),
    "a value": (
        GOJI,
        {"parameters.e_gg.value": 0.6},
        "parameters.e_gg.value is 0.6; expected a number from low to high, because "
        "parameters.e_gg.low is 0.10",
    ),
    "an interval": (
        GOJI,
        {"parameters.e_gg.low": 0.39, "parameters.e_gg.high": 0.11},
        "parameters.e_gg.low is 0.39; expected at most the upper end, because "
        "parameters.e_gg.high is 0.11",
    ),
    "a fixed parameter with an interval": (
        MAIZE,
        {"parameters.e_gg.low": 0.1, "parameters.e_gg.high": 0.5},
        "parameters.e_gg.given is 'fixed'; expected fixed without an interval",
    ),
    "a calibrated parameter without one": (
        MAIZE,
        {"parameters.mus_gg.low": None, "parameters.mus_gg.high": None},
        "parameters.mus_gg.given is 'calibrated'; expected fixed without an interval",
    ),
    "an interval that was widened": (
        GOJI,
        {"parameters.e_gg.widened": True},
        "parameters.e_gg.widened is true; expected low or high to be the value itself",
    ),
    "a correlation": (
        MAIZE,
        {"correlations.mur_gg.mus_gg": 0.9},
        "correlations.mur_gg.mus_gg is 0.9; expected the same in both orders",
    ),
    "a mass": (
        GOJI,
        {"grain.mass_g": 1.35},
        "grain.mass_g is 1.35; expected about 1.251, because grain.density_kg_m3 is "
        "840.47, grain.volume_mm3 is 1488.53",
    ),
    "a density": (
        GOJI,
        {"grain.density_kg_m3": 900.0},
        "grain.mass_g is 1.25107; expected about 1.34",
    ),
    "a volume": (
        MAIZE,
        {"grain.volume_mm3": 190.0, "grain.mass_g": 0.27076},
        "grain.volume_mm3 is 190.0; expected from 182.6 to 183.6, because "
        "grain.ellipsoids_mm.0 is [5.27, 3.63, 2.285]",
    ),
    "a modulus": (
        GOJI,
        {"grain.shear_modulus_pa": 43904.81794},
        "grain.elastic_modulus_pa is 113519.5848; expected about 1.159e+05, because "
        "grain.shear_modulus_pa is 43904.81794, grain.poisson_ratio is 0.3198472899",
    ),
    "a moment of inertia": (
        MAIZE,
        {"grain.inertia_kg_m2.1": 1.9e-9},
        "grain.inertia_kg_m2.1 is 1.9e-09; expected from 1.719e-09 to 1.725e-09, because "
        "grain.mass_g is 0.260933",
    ),
    "a shape": (
        GOJI,
        {"grain.shape": "multisphere"},
        "grain.shape is 'multisphere'; expected multisphere for spheres",
    ),
}


@pytest.mark.parametrize("name", EDITED)
def test_an_entry_that_contradicts_another_is_named_with_both_values(name, tmp_path):
    path, changes, message = EDITED[name]
    file = tmp_path / "card.json"
    file.write_text(json.dumps(changed(path, changes)))
    found = str(input_error(".*", card.read_card, file))
    assert f"{file}: {message}" in found, found


def test_the_check_of_a_card_refuses_it(tmp_path, command):
    file = tmp_path / "card.json"
    file.write_text(json.dumps(changed(MAIZE, {"met": True, "verdict": "met"})))
    assert (
        "probability_inside is 0.51388" in command("card", "check", file, status=2).err
    )
    assert (
        "probability_inside is 0.51388" in command("card", "show", file, status=2).err
    )
