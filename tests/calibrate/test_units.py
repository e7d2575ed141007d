"""Results in another unit than their target are named, with the unit that they have."""

import math
import warnings

import numpy as np
import pandas as pd
import pytest

from repose import Study
from repose.calibrate import units
from repose.calibrate.units import describe_other_units

OWN = """simulator: EDEM 2024
label: rape_seed
seed: 2026
parameters:
  friction: [0.2, 0.8]
targets:
  slope_deg: {value: 32.0, sd: 1.2, repetitions: 10}
  time_s: {value: 4.0, sd: 0.2, repetitions: 10, unit: s}
"""


def described(name, value, results, **unit):
    target = {"value": value, "sd": 1.0, "repetitions": 10, "range": [-99, 99], **unit}
    targets = Study({"a": (0.0, 1.0)}, {name: target}, seed=1).targets
    return describe_other_units(targets, {name: results}).get(name, "")


def test_angles_in_radians_are_named_with_values_and_unit():
    assert described("slope_deg", 32.0, [0.45, math.nan, 0.62]) == (
        "column slope_deg has 0.45 to 0.62, although its target is 32 deg; these "
        "numbers are probably in radians, which would be 25.8 to 35.5 deg: multiply "
        "the column by 180/pi"
    )
    assert "has 0.55, although" in described("slope_deg", 32.0, [0.55])
    # the unit may be that of the target alone, and an angle may be negative
    assert "radians" in described("slope", 32.0, [0.45, 0.62], unit="deg")
    assert "radians" in described("slope_deg", -32.0, [-0.45, -0.62])


def test_lengths_in_metres_are_named():
    assert described("height_mm", 65.0, [0.06, 0.07]) == (
        "column height_mm has 0.06 to 0.07, although its target is 65 mm; these "
        "numbers are probably in metres, which would be 60 to 70 mm: multiply the "
        "column by 1000"
    )


@pytest.mark.parametrize(
    ("name", "value", "results"),
    [
        ("slope_deg", 32.0, [25.0, 36.0]),
        # one of them may be right: piles that nearly slid away
        ("slope_deg", 32.0, [0.45, 20.0]),
        # far from the target in either unit
        ("slope_deg", 32.0, [0.001, 0.002]),
        ("slope_deg", 32.0, [0.45, -0.45]),
        # a target that is small in degrees
        ("slope_deg", 1.5, [0.45, 0.62]),
        ("slope_deg", 32.0, [math.nan]),
        # no unit, or one that is not confused with another
        ("slope", 32.0, [0.45, 0.62]),
        ("mass_g", 32.0, [0.45, 0.62]),
    ],
)
def test_results_in_the_unit_of_the_target_are_not(name, value, results):
    assert described(name, value, results) == ""


def test_no_number_is_near_a_target_in_both_units():
    for other in units.OTHER_UNITS.values():
        assert other.factor > units.MAX_RATIO**2


@pytest.fixture
def table(tmp_path, monkeypatch):
    """The study and a table of runs with angles in radians, in the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").write_text(OWN)
    friction = np.linspace(0.21, 0.79, 12)
    slope = 0.45 + 0.2 * friction + 0.005 * np.sin(40 * friction)
    found = pd.DataFrame({"friction": friction, "slope_deg": slope})
    return found.assign(time_s=3 + friction**2)


@pytest.mark.usefixtures("short_searches")
@pytest.mark.parametrize("verb", ["tell", "calibrate"])
def test_the_verbs_name_file_column_values_and_unit(verb, table, command):
    is_calibration = verb == "calibrate"
    out = "own" if is_calibration else "own/runs.csv"
    table.to_csv("rad.csv", index=False)
    table.assign(slope_deg=np.degrees(table["slope_deg"])).to_csv("deg.csv")
    options = ("--configfile", "own.yaml", "--out", out)
    message = "repose: WARNING: rad.csv: column slope_deg has 0.49"
    assert "radians" not in command(verb, "deg.csv", *options).err
    # beside runs in degrees, too
    assert message in command(verb, "rad.csv", *options).err


def test_a_study_in_python_warns_once(table):
    study = Study({"friction": (0.2, 0.8)}, {"slope_deg": (32.0, 1.2)}, seed=1)
    rows = table[["friction", "slope_deg"]]
    with pytest.warns(UserWarning, match="probably in radians"):
        study.tell(rows[:1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        study.tell(rows[1:])
