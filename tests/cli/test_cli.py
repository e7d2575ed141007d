"""The command line: each verb explains itself, a fault of the input ends in one line."""

import io
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml
from refusals import value_error
from shared import ROOT, check_all, run_python, written

from repose.__main__ import main
from repose.bench.parameters import PARAMETERS
from repose.cli import (
    STAGES,
    SUBCOMMAND_GROUPS,
    SUBCOMMANDS,
    USER_SUBCOMMANDS,
    make_parser,
    registry,
)
from repose.cli.registry import was_given
from repose.common import provenance
from repose.config import check
from repose.config.pipeline import PipelineConfig
from repose.dem.kernels.engine import advance
from repose.measure.angles import MEAN_KEYS
from repose.stages import job, kept_runs


@pytest.fixture
def short_config(tmp_path):
    config = PipelineConfig.load(ROOT / "config/quick.yaml").config
    config["funnel"] |= {"berries": 12, "duration_s": 1.5, "rest_motion_mm": 100}
    config["simulation"]["rest_energy_j"] = 1.0e-3
    return str(written(tmp_path / "short.json", json.dumps(config)))


def error_of(command, *arguments):
    (line,) = command(*arguments, status=2).err.splitlines()
    assert line.startswith("repose: error: ")
    return line


def test_every_verb_explains_itself_with_an_example_that_parses(command):
    silent = []
    for verb in SUBCOMMANDS:
        call = ["stage", verb] if verb in STAGES else [verb]
        text = " ".join(command(*call, "--help").out.split())
        example = text.split(f"example: repose {' '.join(call)}")[1]
        arguments = example.replace("'", "").split()
        args, rest = make_parser().parse_known_args([*call, *arguments])
        if args.subcommand != verb or (rest and not SUBCOMMANDS[verb].forwards_words):
            silent.append(verb)
    assert not silent


def test_help_names_only_configfile_for_the_study_and_every_verb_with_a_study_has_it(
    command,
):
    """`run` also has Snakemake's own --config KEY=VALUE."""
    with_study, others = [], []
    for verb, subcommand in SUBCOMMANDS.items():
        call = ["stage", verb] if verb in STAGES else [verb]
        out = command(*call, "--help").out
        if subcommand.study is not None and "--configfile FILE" not in out:
            with_study.append(verb)
        if verb != "run" and re.search(r"--config\b", out):
            others.append(verb)
    assert (with_study, others) == ([], [])
    # the short name of earlier versions still works
    for option in ("--configfile", "--config"):
        args = make_parser().parse_args(["plan", option, "mine.yaml"])
        assert args.config == ["mine.yaml"]
        assert was_given(args, "config")


def test_help_fits_a_screen(command):
    first = ["new", "check", "measure", "run", "card", "export", "marker"]
    for arguments, names in {
        ("--help",): first,
        ("help",): first,
        ("help", "all"): list(USER_SUBCOMMANDS),
    }.items():
        lines = command(*arguments).out.splitlines()
        listed = [line.split()[0] for line in lines if re.match(" {2}[a-z]", line)]
        assert listed == names
        assert max(map(len, lines)) <= 80
        assert not [
            line for line in lines if line.endswith("...") and "SUBCOMMAND" not in line
        ]
    assert command("help", "card").out == command("card", "--help").out
    assert command("DOCS").out == command("docs").out
    out = command("--help").out
    assert len(USER_SUBCOMMANDS) <= 25
    assert len(out.splitlines()) <= 45
    assert "example:" in out
    stages = re.findall(
        "^ {2}([a-z_]+) {2,}", command("stage", "--help").out, re.MULTILINE
    )
    assert stages[-len(STAGES) :] == list(STAGES)
    assert not [
        name
        for names in SUBCOMMAND_GROUPS.values()
        for name in names
        if name not in SUBCOMMANDS
    ]


def test_what_was_mistyped_is_guessed(command):
    assert "did you mean measure?" in error_of(command, "mesure")
    assert "did you mean run uncertainty?" in error_of(command, "uncertainy")
    file = "did you mean repose run --configfile mine.yaml?"
    assert file in error_of(command, "mine.yaml")
    assert "did you mean dataset?" in error_of(command, "stage", "datset")
    assert "did you mean stage dataset?" in error_of(command, "datset")
    assert "did you mean" not in error_of(command, "xyzzy")
    assert error_of(command, "hepa").endswith("; did you mean heap?")
    # The nearest of several names that are near is proposed, and no other one.
    one_guess = error_of(command, "stage", "published_solution")
    assert one_guess.endswith("; did you mean published_solutions?")
    assert one_guess.count("did you mean") == 1


def test_a_verb_is_registered_once():
    def check():
        """Another function of the name of a verb."""

    value_error("'check' is registered already", registry.subcommand(), check)


@pytest.mark.parametrize("commit", ["0123456789ab", None])
def test_the_version_and_the_commit_are_printed(monkeypatch, command, commit):
    monkeypatch.setattr(provenance, "describe_machine", lambda: {"commit": commit})
    after = f", commit {commit}" if commit else ""
    assert re.fullmatch(rf"repose \d+\.\d+\.\d+{after}\n", command("--version").out)


def test_help_loads_no_slow_library_and_the_module_ends_with_2_on_bad_input():
    code = "import sys; from repose.__main__ import main\ntry: main(['heap', '--help'])\nexcept SystemExit: "
    code += "print('loaded:', *({'numba', 'scipy', 'pandas', 'cv2', 'matplotlib'} & set(sys.modules)))"
    assert run_python("-c", code).splitlines()[-1] == "loaded:"
    program = [sys.executable, "-m", "repose"]
    done = subprocess.run(
        [*program, "check", "--config", "nowhere.yaml"], capture_output=True, text=True
    )
    assert done.returncode == 2
    message = "file is 'No such file or directory'; expected an existing YAML or JSON file that may be read"
    assert done.stderr == f"repose: error: nowhere.yaml: {message}\n"
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [*program, "docs"], stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert done.returncode == 0
    assert done.stderr == ""


def test_a_closed_stderr_does_not_change_the_end_of_a_call():
    program = shlex.join([sys.executable, "-m", "repose"])
    for arguments, status in {"docs": 0, "docs nowhere": 2}.items():
        done = subprocess.run(["sh", "-c", f"{program} {arguments} 2>&-"])
        assert done.returncode == status, arguments


@pytest.mark.slow
@pytest.mark.essential
def test_check_prints_the_number_of_pours(command, tmp_path):
    """The target is one that no pour of any processor has."""
    text = (ROOT / "config/config.yaml").read_text()
    steep = text.replace("value: 32.87", "value: 60").replace(
        "range: [31.0, 34.0]", "range: [58.0, 62.0]"
    )
    (tmp_path / "steep.yaml").write_text(steep)
    out = command("check", "--config", tmp_path / "steep.yaml").out
    assert "funnel.berries would" not in out
    lines = (
        f"{'design':>15} {150:>15} {6:>10} {900:>6}",
        "min on 2 cores",
        "time step: ok, ",
        "stiffness: ok, the pile sinks by",
        "volume: WARNING: 500 poured grains fill",
        "reach: ",
        "funnel: centre of the ranges: angle of repose ",
        "aor_deg: WARNING: the target 60 is far outside the single runs, ",
    )
    assert [line for line in lines if line not in out] == []


def test_heap_refuses_bad_options_before_it_pours(command, tmp_path):
    def refused(arguments, parts):
        line = error_of(command, "heap", "--out", tmp_path / "heap", *arguments)
        assert all(part in line for part in parts), line
        assert not (tmp_path / "heap").exists()

    cases = yaml.safe_load(Path(__file__).with_name("heap.yaml").read_text())
    check_all(
        refused, [(" ".join(arguments), arguments, parts) for arguments, parts in cases]
    )


def test_heap_pours_and_prints_its_record(short_config, tmp_path, command):
    arguments = [
        "heap",
        "--config",
        short_config,
        "--set",
        "e_gg=0.203",
        "--seed",
        "7",
        "--json",
    ]
    record = json.loads(
        command(*arguments, "--trajectory", "0.1", "--out", tmp_path / "heap").out
    )
    assert set(record["parameters"]) == set(PARAMETERS)
    assert record["parameters"]["e_gg"] == 0.203
    assert record["parameters"]["mus_gg"] == pytest.approx(0.55)  # centre of its range
    assert record["seed"] == 7
    assert record["time_step_s"] == 4.9e-4
    assert {"status", "aor_deg", "height_mm", "kinetic_energy_J"} <= set(record)
    assert record["berries_on_plate"] <= 12
    assert (
        json.loads((tmp_path / "heap" / "heap.json").read_text())["runs"][0]["seed"]
        == 7
    )
    with np.load(tmp_path / "heap" / "heap.npz") as arrays:
        assert arrays["position_7"].shape == (12, 3)
    with np.load(tmp_path / "heap" / "heap_trajectory_7.npz") as frames:
        assert frames["position"].shape[1:] == (12, 3)
        # 1.5 s at most; a pour ends when its pile rests
        assert 5 < len(frames["position"]) <= 15


def test_warm_up_compiles_what_a_pour_needs(short_config, tmp_path, command):
    arguments = ["--config", short_config]
    output = command("stage", "warm_up", *arguments).out
    assert re.match(
        r"the engine was ready after [0-9.]+ s; its compiled code is in \S+/dem-\w{16}$",
        output.strip(),
    )
    compiled = list(advance.signatures)
    command("stage", "pour", *arguments, "--seed", "7", "--out", tmp_path)
    assert advance.signatures == compiled


def test_pour_and_measure_runs_are_heap_in_two_steps(short_config, tmp_path, command):
    arguments = ["--config", short_config, "--seed", "7"]
    out = tmp_path / "measured"
    pours = tmp_path / "steps" / "heap.pours.json"
    command("heap", *arguments, "--out", tmp_path / "whole")
    assert command("stage", "pour", *arguments, "--out", pours.parent).out.splitlines()[
        -1
    ] == str(pours)
    assert not (tmp_path / "steps" / "heap.json").exists()
    command("stage", "measure_runs", pours, "--config", short_config, "--out", out)
    whole = json.loads((tmp_path / "whole" / "heap.json").read_text())
    steps = json.loads((out / "heap.json").read_text())
    settings = [job.pop("provenance")["settings"] for job in (whole, steps)]
    assert settings[0] == settings[1], "of the pours, too"
    assert steps == whole


@pytest.fixture
def samples(tmp_path):
    table = f"sample,{','.join(PARAMETERS)}\n4,0.2,0.5,0.03,0.3,0.6,0.2\n"
    return ["--samples", written(tmp_path / "samples.csv", table)]


def test_a_pour_that_measures_leaves_its_measurement_to_measure_runs(
    short_config, samples, tmp_path, monkeypatch, command
):
    arguments = [
        "--config",
        short_config,
        "--out",
        tmp_path / "heaps",
        "--keep-runs",
        "--measure",
    ]
    command("stage", "pour", *samples, "--sample", "4", "--seed", "7", *arguments)
    result = tmp_path / "heaps/004.json"
    kept = tmp_path / "heaps/runs/004.json"
    assert not result.exists()
    anew = []
    measured = job.measure_runs
    monkeypatch.setattr(
        job, "measure_runs", lambda *given: anew.append(given) or measured(*given)
    )

    def measure(*arguments, config=short_config):
        anew.clear()
        command(
            "stage",
            "measure_runs",
            tmp_path / "heaps",
            *samples,
            "--config",
            config,
            *arguments,
        )
        return len(anew), result.read_bytes()

    _, right = measure()
    assert measure("--keep-runs") == (0, right), (
        "as measured by the process that poured"
    )
    other = json.loads(Path(short_config).read_text())
    other["measure"]["views"] = 4
    (tmp_path / "other.json").write_text(json.dumps(other))
    assert measure("--keep-runs", config=tmp_path / "other.json")[0] == 1
    assert measure("--keep-runs") == (1, right)
    assert measure("--keep-runs") == (0, right)
    monkeypatch.setattr(kept_runs, "code_hash", lambda _: "of other code")
    assert measure("--keep-runs") == (1, right)
    kept.write_text(kept.read_text().replace("7", "8", 1))
    assert measure("--keep-runs") == (1, right), "somebody changed it"


def test_heap_takes_a_row_of_a_table_and_the_studys_seeds(
    short_config, samples, tmp_path, command
):
    out = tmp_path / "heaps"
    arguments = [
        "heap",
        "--config",
        short_config,
        *samples,
        "--seeds",
        "2",
        "--out",
        out,
    ]
    record = json.loads(command(*arguments, "--sample", "4", "--json").out)
    assert record["sample"] == 4
    assert record["parameters"]["mus_gg"] == 0.5
    assert len({run["seed"] for run in record["runs"]}) == 2
    assert (out / "004.json").is_file()
    assert "sample is 5" in error_of(command, *arguments, "--sample", "5")
    header, row = samples[1].read_text().splitlines()
    samples[1].write_text(f"{header},gamma_gg\n{row},0.2\n")
    assert "gamma_gg is 0.2; expected no such column" in error_of(
        command, *arguments, "--sample", "4"
    )


def test_measure_prints_the_angles_of_a_drawn_pile_and_writes_the_overlay(
    tmp_path, command
):
    picture = np.full((420, 900), 230, np.uint8)
    height = 200
    half = round(height / np.tan(np.radians(30)))
    cv2.fillPoly(
        picture,
        [np.array([[450 - half, 399], [450 + half, 399], [450, 399 - height]])],
        40,
    )
    path = tmp_path / "pile.png"
    cv2.imwrite(str(path), picture)
    arguments = [
        "measure",
        path,
        "--mm-per-pixel",
        "0.1",
        "--out",
        tmp_path / "out",
        "--json",
    ]
    record = json.loads(command(*arguments).out)
    assert {"photographs", "summary", "provenance"} == set(record)
    (values,) = record["photographs"]
    assert {"left_deg", "right_deg", "aor_deg", "height_mm", *MEAN_KEYS.values()} < set(
        values
    )
    # outside a study the line is fitted over the whole side
    assert values["aor_deg"] == values["aor_whole_deg"] == pytest.approx(30, abs=0.5)
    assert values["aor_secant_deg"] is None, "the height of a grain is not known"
    assert values["height_mm"] == pytest.approx(20, abs=0.3)
    assert (tmp_path / "out/pile.png").is_file()
    (values,) = json.loads(command(*arguments, "--config", "config/config.yaml").out)[
        "photographs"
    ]
    # a study has its own definition and grain, 13.34 mm: tan(secant) = tan(30 deg) 20 / (20 - 13.34)
    assert values["aor_secant_deg"] == pytest.approx(60.0, abs=0.6)
    assert values["aor_deg"] == values["aor_flank_deg"] == pytest.approx(30.0, abs=0.5)


def test_measure_refuses_no_pile_and_a_locale_without_a_letter_does_no_harm(
    tmp_path, command, monkeypatch
):
    path = tmp_path / "empty.png"
    cv2.imwrite(str(path), np.full((200, 300), 200, np.uint8))
    arguments = ("--mm-per-pixel", "0.1", "--out", tmp_path / "out")
    assert "a pile with two flanks" in error_of(command, "measure", path, *arguments)
    assert "nowhere.png" in error_of(command, "measure", "nowhere.png", *arguments)

    def provenance(_args):
        print("1 ± 0.1 µm")

    printed = io.BytesIO()
    monkeypatch.setitem(
        SUBCOMMANDS, "provenance", SUBCOMMANDS["provenance"]._replace(run=provenance)
    )
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, encoding="ascii"))
    assert main(["provenance", "a_file"]) == 0
    assert printed.getvalue() == rb"1 \xb1 0.1 \xb5m" + b"\n"


@pytest.mark.parametrize(
    ("sd", "piles", "warned"),
    [(0, 10, "sd is 0"), (1.0, 2, "repetitions is 2"), (1.0, 3, None)],
)
def test_check_warns_of_piles_that_tell_no_scatter(sd, piles, warned):
    target = {
        "response": "aor_deg",
        "apparatus": "funnel",
        "sd": sd,
        "repetitions": piles,
    }
    lines = list(
        check.warn_about_few_measurements(
            SimpleNamespace(
                settings=SimpleNamespace(targets=[SimpleNamespace(**target)])
            )
        )
    )
    assert len(lines) == (warned is not None)
    if warned:
        assert f"aor_deg: WARNING: {warned}" in lines[0]


@pytest.mark.parametrize(
    ("arguments", "config_file", "warned"),
    [
        (["design"], None, True),
        (["design", "--config=small.yaml"], None, True),
        (["design", "--config=config/paper.yaml"], None, False),
        (["design"], "config.yaml", False),
        (["design", "--config=own.yaml"], None, False),
    ],
)
def test_the_built_in_crop_is_reported_in_a_folder_without_a_configuration(
    arguments, config_file, warned, tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text("design: {samples: 20, method: lhsdesign}")
    Path("own.yaml").write_text((ROOT / "tests/bad_input/own.yaml").read_text())
    if config_file:
        Path(config_file).write_text((ROOT / "crops/wheat/config.yaml").read_text())
        Path("sizes.csv").write_text((ROOT / "crops/wheat/sizes.csv").read_text())
        Path("published").symlink_to(ROOT / "crops/wheat/published")
        arguments = [*arguments, f"--config={config_file}"]
    monkeypatch.setattr("repose.stages.design.write_design", lambda *_: None)
    assert ("built-in goji example" in command(*arguments).err) is warned


def test_codes_of_a_terminal_in_texts_of_users_are_not_obeyed(tmp_path, command):
    (tmp_path / "runs.csv").write_text("mus\x1b[2J,angle_deg\n1,2\n")
    fault = command(
        "tell",
        tmp_path / "runs.csv",
        "--config",
        ROOT / "tests/bad_input/own.yaml",
        status=2,
    ).err
    assert "\x1b" not in fault
    shown = json.loads((ROOT / "crops/cards/wheat.json").read_text()) | {
        "reason": "\x1b[31mred\x07\u009b"
    }
    path = written(tmp_path / "card.json", json.dumps(shown))
    status = {"met": 0, "NOT met": 3, "undecided": 4}[shown["verdict"]]
    out = command("card", "check", path, status=status).out
    assert not {"\x1b", "\x07", "\u009b"} & set(out)
    assert "\\x1b[31mred\\x07\\x9b" in out


@pytest.mark.parametrize("out", ["", "/", "/tmp/.."])
def test_a_verb_does_not_write_to_the_root(out, command):
    message = command("marker", "--out", out, status=2).err
    assert (
        f"command line: --out is {out!r}; expected the path of a file or folder"
        in message
    )


def test_out_may_begin_with_a_tilde_and_has_no_line_break(
    tmp_path, command, monkeypatch
):
    """Bash does not expand the tilde behind the sign of equality."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    command("marker", "--out=~/sheet.pdf")
    assert (tmp_path / "home" / "sheet.pdf").is_file()
    message = command("marker", "--out", "a\nb.pdf", status=2).err
    assert r"--out is 'a\nb.pdf'; expected the path of a file" in message
    assert os.listdir(tmp_path) == ["home"]


def test_capitals_of_a_verb_and_of_a_program_do_not_matter(command):
    assert command("DOCS").out == command("docs").out
    words = ["export", "--to", "LAMMPS", "--card", "card.json"]
    assert make_parser().parse_args(words).to == "lammps"
