"""Verbs: check, measure, stages and their texts."""

import ast
import re
import sys
import time
from argparse import Namespace
from types import SimpleNamespace

import pytest
from refusals import input_error
from shared import every_bench_test

from repose.cli import SUBCOMMANDS, checking, docs, make_parser, stages
from repose.cli.measuring import _make_measure_settings
from repose.common import places
from repose.config import check, computed, cost
from repose.dem.time_steps import Limit

NOTHING_GIVEN = Namespace(grain_mm=None, config=None)


def test_a_time_step_far_below_the_longest_is_reported_with_the_saved_time():
    limit = Limit(4.09e-5, "as a pile has it")
    for step_s, hint in (
        (4.0e-6, ": as a pile has it; with 3.2e-05 s a run takes 12 % of the time"),
        (3.0e-5, ""),
    ):
        assert check.describe_time_step(step_s, limit).endswith(
            f"; maximum 4.09e-05 s{hint}"
        )


def test_the_limit_of_the_time_step_names_walls_and_the_smallest_grain():
    engine = "the stable step of a body between two of pvc (restitution 0.2)"
    assert computed.rephrase_limit(f"{engine}, at the smallest scale, 0.8") == (
        "the largest stable time step of a grain between two walls of pvc, at a "
        "restitution of 0.2, at the smallest scale, 0.8"
    )
    assert (
        computed.rephrase_limit("1/8 of the contact time") == "1/8 of the contact time"
    )


@pytest.mark.parametrize("longest_s", [1.0e-3, 3.3e-5, 9.99e-7, 2.0e-6 / 0.8])
def test_the_advised_step_has_two_digits_and_is_allowed(longest_s):
    step = computed.advise_time_step_s(longest_s)
    assert step == float(f"{step:.2g}")
    assert 0.7 * longest_s < step <= computed.STEP_FRACTION * longest_s * (1 + 1e-12)


def test_the_cost_is_that_of_the_least_disturbed_pour(monkeypatch):
    """Three pours; another program slowed two of them. None ends before its pile is timed."""
    took = iter([90.0, 50.0, 70.0])

    def pour(self, small, until_rest):
        assert not until_rest
        time.sleep(0.02)
        return SimpleNamespace(us_per_step=next(took))

    monkeypatch.setattr("repose.bench.funnel.FunnelTest.pour", pour)
    # all of the time is its own
    monkeypatch.setattr(time, "process_time", time.perf_counter)
    grains = cost.MIN_TIMED_GRAINS
    ranges: dict = dict.fromkeys(("e_gg", "e_gp"), (0.1, 0.5))
    ranges |= dict.fromkeys(("mus_gg", "mur_gg", "mus_gp", "mur_gp"), (0.1, 0.3))
    simulation = {
        "time_step_s": 1e-5,
        "gravity_m_s2": 9.81,
        "tension": "release",
        "contact_law": "hertz_mindlin",
        "rolling_law": "budget",
        "rest_energy_j": 1e-9,
    }
    whole = every_bench_test()
    config = whole | {
        "simulation": simulation,
        "funnel": whole["funnel"] | {"berries": grains},
        "parameters": ranges,
    }
    assert cost.measure_grain_step_s(config, {}, None) == pytest.approx(
        50e-6 / grains, rel=0.05
    )


def test_a_terminal_shows_the_seconds_of_the_compilation_and_a_log_gets_one_line(
    capsys, monkeypatch
):
    with checking.show_elapsed_seconds("compiling"):
        pass
    assert capsys.readouterr().err == "compiling\n"
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(checking, "UPDATE_INTERVAL_S", 0.01)
    with checking.show_elapsed_seconds("compiling"):
        time.sleep(0.1)
    assert "\rcompiling; 0 s" in capsys.readouterr().err


def test_in_a_crops_folder_it_is_that_of_the_sizes_which_need_a_grain(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert _make_measure_settings(NOTHING_GIVEN).berry_height_mm is None
    (tmp_path / "sizes.csv").write_text("long_mm,major_mm,minor_mm\n9,4,3\n7,4,1\n")
    # The mean of the products 108 and 28
    mean_diameter = 68 ** (1 / 3)
    assert _make_measure_settings(NOTHING_GIVEN).berry_height_mm == pytest.approx(
        mean_diameter
    )
    assert _make_measure_settings(NOTHING_GIVEN).response == "whole"
    assert (
        _make_measure_settings(Namespace(grain_mm=5.0, config=None)).berry_height_mm
        == 5.0
    )
    (tmp_path / "sizes.csv").write_text("long_mm,major_mm,minor_mm\n")
    input_error(
        r"sizes\.csv: rows is 0; expected at least 2 grains",
        _make_measure_settings,
        NOTHING_GIVEN,
    )
    assert (
        _make_measure_settings(Namespace(grain_mm=5.0, config=None)).berry_height_mm
        == 5.0
    )


def test_files_are_those_of_inputs_by_name_and_none_that_a_step_writes(tmp_path):
    for name in ("a.csv", "b=1.json", "dataset.csv"):
        (tmp_path / name).write_text("")
    arguments = [
        [
            "figure",
            "figure05",
            f"--input=heap={tmp_path / 'a.csv'}",
            f"--out={tmp_path / 'b=1.json'}",
        ],
        ["sensitivity", f"--network={tmp_path / 'b=1.json'}"],
        ["stage", "propose", "refined", str(tmp_path)],
    ]
    named = [
        [path.name for path in stages.find_input_files(make_parser().parse_args(given))]
        for given in arguments
    ]
    assert named == [["a.csv"], ["b=1.json"], ["dataset.csv"]]
    # the samples of the next step, from an earlier run, were once an input of the step that writes them
    (tmp_path / "samples.csv").write_text("")
    arguments = ["stage", "propose", "sequential", f"--out={tmp_path}"]
    assert not list(stages.find_input_files(make_parser().parse_args(arguments)))


@pytest.mark.parametrize("name", ["config", "out"])
def test_no_verb_takes_its_folder_or_its_configuration_for_an_input(name):
    found = [
        option
        for verb in SUBCOMMANDS.values()
        for option in verb.options
        if option.attribute == name
    ]
    assert len(found) > 5
    assert not any(option.recorded for option in found)


@pytest.mark.parametrize(("side", "status"), [(5, 0), (25, 0), (4.9, 2), (25.5, 2)])
def test_a_sheet_has_squares_of_5_to_25_mm(tmp_path, side, status, command):
    command(
        "marker", "--square-mm", side, "--out", tmp_path / "sheet.pdf", status=status
    )


def messages():
    """Every text of the program that is no docstring and may name a page, with its file."""
    for path in places.PACKAGE.rglob("*.py"):
        code = path.read_text()
        if "docs" not in code and ".md" not in code:
            continue
        tree = ast.parse(code)
        alone = {
            id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)
        }
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Constant)
                and isinstance(node.value, str)
                and id(node) not in alone
            ):
                yield path.relative_to(places.PACKAGE), node.value


def test_the_pages_are_listed_printed_and_guessed(command):
    listed = dict(line.split(maxsplit=1) for line in command("docs").out.splitlines())
    assert listed["photographs"] == "Photographs of piles"
    assert {"configuration", "library", "own_crop", "crops", "start"} <= set(listed)
    for name, title in listed.items():
        assert f"# {title}\n" in command("docs", name).out
    message = "docs is 'fotographs'; expected a page that `repose docs` lists; did you mean photographs?"
    assert message in command("docs", "fotographs", status=2).err


def test_messages_name_pages_that_a_wheel_has():
    files = [*(places.PACKAGE / "config" / "new_crop").rglob("*.*")]
    files += [
        path
        for folder in ("config", "profiles")
        for path in (places.find_program_folder() / folder).rglob("*.yaml")
    ]
    texts = [*messages(), *((path.name, path.read_text()) for path in files)]
    named = {
        name for _, text in texts for name in re.findall(r"`repose docs (\w+)`", text)
    }
    assert named >= {"photographs", "sequential", "own_simulator", "configuration"}
    assert named <= set(docs.find_pages())
    # no text leads to a file that only the checkout has
    elsewhere = re.compile(
        r"(?<!research/)(?<!\.\./)\b(docs|config|tests)/[\w/]+\.md\b"
    )
    assert [path for path, text in texts if elsewhere.search(text)] == []
