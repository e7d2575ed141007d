"""What people read has at most four digits in a number, whatever the study."""

import html
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_up_report import made_up_study
from shared import ROOT, target

import repose
from repose.calibrate import answer, bounds
from repose.calibrate.inversion import describe_result
from repose.calibrate.strategies.answer import judge_answer
from repose.calibrate.targets import Targets
from repose.common.numbers import LARGEST_PLAIN
from repose.report.page import page

# Names and numbers that name something: a digital identifier, a commit, a seed
NAMES = re.compile(r"doi:\S+|(commit|configuration|engine|seed) \w+")
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w]|\.\w)")
MAX_DIGITS = 4
# Ranges and means as they follow from photographs
ODD_TARGETS = [
    target("aor_deg", 29.891234, 1.234567, 29.110453, 30.672015),
    target("height_mm", 165.571234, 4.123456, 162.963327, 168.179141),
]
# A study that ends within seconds
SMALL = {
    "strategy": "published",
    "seeds": 1,
    "design": {"samples": 12},
    "posterior": {"walkers": 32, "steps": 100},
}
CARDS = sorted(
    [
        *(ROOT / "results/published").rglob("card.json"),
        *(ROOT / "crops/cards").glob("*.json"),
    ]
)


def find_long_numbers(text):
    """Numbers of a text with more than four digits, or with a needless exponent."""
    found = []
    for number in NUMBER.findall(NAMES.sub("", text)):
        mantissa, _, exponent = number.partition("e")
        digits = mantissa.replace(".", "").lstrip("0")
        if "." not in mantissa:
            digits = digits.rstrip("0")
        is_plain_size = 1e-3 <= float(number) < LARGEST_PLAIN
        if len(digits) > MAX_DIGITS or (exponent and is_plain_size):
            found.append(number)
    return found


def test_long_numbers_are_found():
    text = "29.2411 to 110.00 deg, 4.3e+04 Pa, 12253; 1e-05, 43000, 0.01234, 32.87"
    assert find_long_numbers(text) == ["29.2411", "110.00", "4.3e+04", "12253"]
    assert (
        find_long_numbers("commit 24817427935, seed 20261, doi:10.3390/26182012") == []
    )


@pytest.mark.parametrize("path", CARDS, ids=lambda path: path.parent.name + path.stem)
def test_a_kept_card_in_words(path, command):
    assert find_long_numbers(command("card", "show", path).out) == []
    assert find_long_numbers(command("card", "compare", path, CARDS[0]).out) == []


@pytest.mark.slow
def test_a_calibration_in_words():
    """Without a range, that of a target has two standard errors to each side: 29.2411 to 30.7589."""

    def simulate(row):
        return {"angle_deg": 18 + 18 * row["friction"] + 40 * row["rolling"]}

    parameters = {"friction": (0.2345678, 0.8), "rolling": (0.01, 0.2)}
    targets = {"angle_deg": (30.0, 1.2, 10)}
    study = repose.Study(parameters, targets, seed=1, **SMALL)
    calibration = study.calibrate(simulate)
    printed = str(calibration)
    assert "range 29.24 to 30.76" in printed
    assert find_long_numbers(printed) == []
    assert find_long_numbers(calibration.summary["message"]) == []


def test_the_sentences_of_a_search():
    targets = Targets.of(ODD_TARGETS)
    mean = np.array([30.123456, 165.123456])
    for n_feasible in (0, 3):
        sentence = describe_result(mean, targets, n_feasible, 0.05)
        assert "29.11-30.67 deg" in sentence
        assert find_long_numbers(sentence) == []
    predicted = SimpleNamespace(mean=mean)
    _, message = judge_answer(predicted, targets, "")
    assert find_long_numbers(message) == []
    near = {"parameter": "mus_gg", "value": 0.3512345, "standard_error": 0.0123456}
    clause = bounds.describe_near_bound(near | {"bound": 0.3456789})
    assert find_long_numbers(clause) == []
    check = answer.Check.from_target(
        next(iter(targets)), 30.123456, 0.123456, 16, status="ok"
    )
    assert find_long_numbers(str(check)) == []


def test_the_report_in_words(tmp_path):
    """One row lists the numbers of a network, another the rounding error of equal runs."""
    config, jobs, files = made_up_study(tmp_path, ODD_TARGETS)
    tables = {
        "starts.csv": {"alpha": ["2.26394 0.723613 24049.7 1e+12"], "source": ["7"]},
        "drum.csv": {
            "mean": [10.0, 20.0],
            "standard_error": [1.589e-15, 0.3],
            "aor_deg": [30.0, 30.0],
            "aor_se_deg": [1e-15, 0.1],
        },
    }
    for name, columns in tables.items():
        pd.DataFrame(columns).to_csv(tmp_path / name, index=False)
    out = tmp_path / "report.html"
    shown = {name: tmp_path / name for name in tables}
    page.write_report(config, jobs, files, shown, out)
    text = re.sub(r"<(script|style).*?</\1>", "", out.read_text(), flags=re.DOTALL)
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", text)
    assert "2.264 0.7236 24050 1e+12" in cells
    assert not any("e-15" in cell for cell in cells)
    words = html.unescape(re.sub(r"<[^>]*>", " ", text))
    assert find_long_numbers(words) == []
