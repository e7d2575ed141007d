"""The lines of `repose check`: no warning of a shipped configuration, and numbers for people."""

import re
from types import SimpleNamespace

import pytest
from shared import ROOT

from repose.bench import bench
from repose.common.numbers import format_significant
from repose.config import check
from repose.config.pipeline import PipelineConfig

# All studies of our simulator that the project ships; method.yaml is a part of each.
SHIPPED = sorted(
    path
    for pattern in ("config/*.yaml", "crops/*/config.yaml")
    for path in ROOT.glob(pattern)
    if path.name != "method.yaml" and "\nsimulator:" not in path.read_text()
)
LONGEST_LINE = 150  # without a warning or a hint
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?")
MAX_SIGNIFICANT_DIGITS = 4
PLAIN = (0.001, 100_000)


def bad_numbers(line):
    """Numbers with more digits, or with an exponent that people do not need."""
    bad = []
    for text in NUMBER.findall(line):
        mantissa, _, exponent = text.partition("e")
        digits = mantissa.replace(".", "").strip("0")
        is_plain = PLAIN[0] <= float(text) < PLAIN[1]
        if len(digits) > MAX_SIGNIFICANT_DIGITS or (exponent and is_plain):
            bad.append(text)
    return bad


def test_bad_numbers_are_found():
    line = "43000 of 4.3e+04 in 0.00049 or 4.9e-05 s; 1.2345 at 30 %, e_gg2"
    assert bad_numbers(line) == ["4.3e+04", "1.2345"]


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (270.4, 2, "270"),
        (43_004.8, 3, "43000"),
        (99_999.0, 4, "100000"),
        (123_456.0, 4, "1.235e+05"),
        (-12_345.6, 4, "-12350"),
        (0.00049, 4, "0.00049"),
        (0.001234567, 4, "0.001235"),
        (0.0, 4, "0"),
        (32.87, 4, "32.87"),
        (744.123, 4, "744.1"),
    ],
)
def test_a_number_for_people_has_few_digits_and_no_exponent(value, digits, text):
    assert format_significant(value, digits) == text
    signed = text if value < 0 else f"+{text}"
    assert format_significant(value, digits, sign="+") == signed


@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: "/".join(path.parts[-2:]))
def test_a_shipped_configuration_gets_no_warning_in_short_lines(path, monkeypatch):
    # The paths of a crop are relative to its folder, those of config/ to the project.
    is_crop = path.parent.parent.name == "crops"
    monkeypatch.chdir(path.parent if is_crop else ROOT)
    study = PipelineConfig.load(str(path), check_inputs=True)
    lines = [*check.describe_study(study), *check.warn_about_few_measurements(study)]
    assert [line for line in lines if "WARNING" in line] == []
    # Keys to paste into a configuration have more digits.
    for_people = [line for line in lines if ": {" not in line]
    assert [(line, bad_numbers(line)) for line in for_people if bad_numbers(line)] == []
    topics = [line.partition(":")[0] for line in lines]
    assert {"time step", "stiffness", "volume", "grains"} <= set(topics)
    ok = [line for line in lines if ": ok, " in line and " a run takes " not in line]
    assert len(ok) >= 2
    assert [line for line in ok if len(line) > LONGEST_LINE] == []


def test_the_shipped_configurations_are_all_of_config_and_crops():
    names = {"/".join(path.parts[-2:]) for path in SHIPPED}
    assert {"config/config.yaml", "config/paper.yaml", "wheat/config.yaml"} <= names
    assert len(names) == 9


@pytest.mark.parametrize(
    ("target", "is_warned"),
    [(32.87, False), (36.4, False), (36.5, True), (12.9, False), (12.7, True)],
)
def test_a_target_is_warned_of_beyond_half_the_spread_of_the_trials(target, is_warned):
    """The runs are the trials of config/paper.yaml, from 18.72 to 30.53 degrees."""
    angles = (18.72, 27.0, 30.53)
    runs = [{"status": "ok", "aor_deg": angle} for angle in angles]
    study = SimpleNamespace(
        config={},
        targets=[SimpleNamespace(name="aor_deg", value=target, response="angle")],
    )
    test = SimpleNamespace(name="funnel", target_responses=lambda config: {"angle"})
    lines = list(check._warn_about_trials(study, test, runs))
    assert bool(lines) == is_warned
    for line in lines:
        assert line.startswith(f"aor_deg: WARNING: the target {target} is far outside")
    failed = [{"status": "not_at_rest"}]
    (line,) = check._warn_about_trials(study, test, failed)
    assert line.startswith("funnel: WARNING: no trial run can be measured")


@pytest.mark.parametrize(("spheres", "is_warned"), [(16, False), ("fewest", True)])
def test_a_chosen_number_of_spheres_is_described_without_a_warning(spheres, is_warned):
    section = SimpleNamespace(particle="multisphere", spheres=spheres)
    line = check._describe_volume_change(section, -29.2)
    assert "its volume differs by -29 % from that of the mesh" in line
    assert ("WARNING" in line) == is_warned


def test_a_bench_test_without_spread_warns_of_any_other_target():
    runs = [{"status": "ok", "aor_deg": 30.0}] * 3
    target = SimpleNamespace(name="aor_deg", value=30.1, response="angle")
    study = SimpleNamespace(config={}, targets=[target])
    test = SimpleNamespace(name="funnel", target_responses=lambda config: {"angle"})
    assert len(list(check._warn_about_trials(study, test, runs))) == 1
    assert bench("funnel").name == test.name
