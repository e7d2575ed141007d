"""The command line: each verb explains itself, a fault of the input ends in one line."""

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from refusals import value_error
from shared import check_all

from repose.__main__ import main
from repose.apparatus import job, kept_runs
from repose.cli import GROUPS, STAGES, TYPED, VERBS, parser, registry
from repose.config import check
from repose.config.study import Study
from repose.core import provenance
from repose.core.parameters import PARAMETERS
from repose.dem.kernels.engine import advance
from repose.measure.angles import MEAN_KEYS

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.fixture
def short_config(tmp_path):
    config = Study.load(ROOT / "config/quick.yaml").config
    config["funnel"] |= {"berries": 12, "duration_s": 1.5, "rest_motion_mm": 100}
    config["simulation"]["rest_energy_j"] = 1.0e-3
    path = tmp_path / "short.json"
    path.write_text(json.dumps(config))
    return str(path)


def error_of(capsys, *words):
    assert main(list(words)) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("repose: error: ")
    return lines[0]


def test_every_verb_explains_itself_with_an_example_that_parses(capsys, monkeypatch):
    silent, one_parser = [], parser()
    monkeypatch.setattr("repose.cli.parser", lambda: one_parser)
    for verb in VERBS:
        call = ["stage", verb] if verb in STAGES else [verb]
        with pytest.raises(SystemExit) as end:
            main([*call, "--help"])
        text = " ".join(capsys.readouterr().out.split())
        words = text.split(f"example: repose {' '.join(call)}")[1].replace("'", "").split()
        args, rest = one_parser.parse_known_args([*call, *words])
        if end.value.code != 0 or args.verb != verb or (rest and not VERBS[verb].passes_on):
            silent.append(verb)
    assert not silent


def test_help_fits_a_screen_and_guesses_what_was_mistyped(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    out = capsys.readouterr().out
    listed = [line.split()[0] for line in out.splitlines() if re.match(" {2}[a-z]", line)]
    assert listed == list(TYPED)
    assert len(TYPED) <= 25
    assert len(out.splitlines()) <= 45
    assert "example:" in out
    with pytest.raises(SystemExit):
        main(["stage", "--help"])
    assert re.findall("^ {2}([a-z_]+) {2,}", capsys.readouterr().out, re.MULTILINE)[-len(STAGES) :] == list(STAGES)
    assert not [name for names in GROUPS.values() for name in names if name not in VERBS]
    assert "did you mean measure?" in error_of(capsys, "mesure")
    assert "did you mean dataset?" in error_of(capsys, "stage", "datset")
    assert "did you mean stage dataset?" in error_of(capsys, "datset")
    assert "did you mean" not in error_of(capsys, "xyzzy")
    assert error_of(capsys, "hepa").endswith("; did you mean heap?")

    def check():
        """Another function of the name of a verb."""

    value_error("'check' is registered already", registry.verb("one more"), check)


@pytest.mark.parametrize("commit", ["0123456789ab", None])
def test_the_version_and_the_commit_are_printed(monkeypatch, capsys, commit):
    monkeypatch.setattr(provenance, "machine", lambda: {"commit": commit})
    with pytest.raises(SystemExit):
        main(["--version"])
    after = f", commit {commit}" if commit else ""
    assert re.fullmatch(rf"repose \d+\.\d+\.\d+{after}\n", capsys.readouterr().out)


def test_help_loads_no_slow_library_and_the_module_ends_with_2_on_bad_input():
    code = "import sys; from repose.__main__ import main\ntry: main(['heap', '--help'])\nexcept SystemExit: "
    code += "print('loaded:', *({'numba', 'scipy', 'pandas', 'cv2', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:"
    command = [sys.executable, "-m", "repose", "check", "--config", "nowhere.yaml"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == (
        "repose: error: nowhere.yaml: file is 'No such file or directory'; "
        "expected an existing YAML or JSON file that may be read\n"
    )
    command = [sys.executable, "-m", "repose", "docs"]
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.essential
def test_check_prints_the_number_of_pours(capsys):
    assert main(["check"]) == 0
    out = capsys.readouterr().out
    assert "150 parameter sets x 6 seeds = 900 pours" in out
    assert "min on 2 cores" in out
    assert "funnel.berries would" not in out
    lines = (
        "time step: simulation.time_step_s is", "stiffness: the pile sinks by", "volume: 500 grains hold", "reach: ",
    )  # fmt: skip
    lines += ("funnel: centre of the ranges: angle of repose ",)
    lines += ("aor_deg: WARNING: the target 32.87 is outside the single runs, ",)
    assert [line for line in lines if line not in out] == []


BAD_OPTIONS_OF_HEAP = (
    (["--set", "mus=0.5"], ["--set mus", "e_gg (restitution, grain-grain)"]),
    (["--set", "e_gg=2"], ["e_gg is 2.0", "0.01 to 1"]), (["--set", "e_gg=nan"], ["e_gg is nan"]),
    (["--set", "mus_gg=-0.1"], ["mus_gg is -0.1", "at least 0"]), (["--set", "mus_gg=inf"], ["mus_gg is inf"]),
    (["--set", "mus_gg=rough"], ["mus_gg is 'rough'", "a number"]),
    (["--set", "mus_gg"], ["--set is 'mus_gg'", "NAME=VALUE"]),
    (["--set", "e_gg=0.2", "--set", "e_gg=0.3"], ["each name once"]), (["--seed", "-1"], ["--seed is [-1]"]),
    (["--seed", "1", "--seed", "1"], ["distinct"]), (["--seeds", "0"], ["--seeds is 0"]),
    (["--sample", "3"], ["--sample is 3", "together with --samples"]),
    (["--samples", "nowhere.csv", "--sample", "1"], ["nowhere.csv"]),
    (["--samples", "resources/berries.csv", "--sample", "1"], ["berries.csv: column sample is 'missing'"]),
    (["--trajectory", "0"], ["--trajectory is 0.0"]), (["--particle", "nowhere.json"], ["nowhere.json"]),
    (["--berry", "nowhere.json"], ["nowhere.json"]),
)  # fmt: skip


def test_heap_refuses_bad_options_before_it_pours(capsys, tmp_path):
    def refused(words, parts):
        line = error_of(capsys, "heap", "--out", str(tmp_path / "heap"), *words)
        assert all(part in line for part in parts), line
        assert not (tmp_path / "heap").exists()

    check_all(refused, [(" ".join(words), words, parts) for words, parts in BAD_OPTIONS_OF_HEAP])


def test_heap_pours_and_prints_its_record(short_config, tmp_path, capsys):
    words = ["heap", "--config", short_config, "--set", "e_gg=0.203", "--seed", "7", "--json"]
    assert main([*words, "--trajectory", "0.1", "--out", str(tmp_path / "heap")]) == 0
    record = json.loads(capsys.readouterr().out)
    assert set(record["parameters"]) == set(PARAMETERS)
    assert record["parameters"]["e_gg"] == 0.203
    assert record["parameters"]["mus_gg"] == pytest.approx(0.55)  # centre of its range
    assert (record["seed"], record["time_step_s"]) == (7, 4.9e-4)
    assert {"status", "aor_deg", "height_mm", "kinetic_energy_J"} <= set(record)
    assert record["berries_on_plate"] <= 12
    written = json.loads((tmp_path / "heap" / "heap.json").read_text())
    assert written["runs"][0]["seed"] == 7
    with np.load(tmp_path / "heap" / "heap.npz") as arrays:
        assert arrays["position_7"].shape == (12, 3)
    with np.load(tmp_path / "heap" / "heap_trajectory_7.npz") as frames:
        assert frames["position"].shape[1:] == (12, 3)
        assert 5 < len(frames["position"]) <= 15  # 1.5 s at most; a pour ends when its pile rests


def test_warm_up_compiles_what_a_pour_needs(short_config, tmp_path, capsys):
    words = ["--config", short_config]
    assert main(["stage", "warm_up", *words]) == 0
    output = capsys.readouterr().out
    assert re.match(r"the engine was ready after [0-9.]+ s; its compiled code is in \S+/dem-\w{16}$", output.strip())
    compiled = list(advance.signatures)
    assert main(["stage", "pour", *words, "--seed", "7", "--out", str(tmp_path)]) == 0
    assert advance.signatures == compiled


def test_pour_and_measure_runs_are_heap_in_two_steps(short_config, tmp_path, capsys):
    words = ["--config", short_config, "--seed", "7"]
    assert main(["heap", *words, "--out", str(tmp_path / "whole")]) == 0
    assert main(["stage", "pour", *words, "--out", str(tmp_path / "steps")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "steps" / "heap.pours.json")
    assert not (tmp_path / "steps" / "heap.json").exists()
    out = tmp_path / "measured"
    pours = str(tmp_path / "steps" / "heap.pours.json")
    assert main(["stage", "measure_runs", pours, "--config", short_config, "--out", str(out)]) == 0
    whole, steps = (json.loads((folder / "heap.json").read_text()) for folder in (tmp_path / "whole", out))
    settings = [job.pop("provenance")["settings"] for job in (whole, steps)]
    assert len(set(settings)) == 2, "the one pours and measures, the other measures"
    assert steps == whole


def test_a_pour_that_measures_leaves_its_measurement_to_measure_runs(short_config, tmp_path, monkeypatch):
    samples = tmp_path / "samples.csv"
    samples.write_text("sample," + ",".join(PARAMETERS) + "\n1,0.2,0.5,0.03,0.3,0.6,0.2\n")
    inputs, folder = ["--samples", str(samples)], str(tmp_path / "heaps")
    pour = ["stage", "pour", *inputs, "--sample", "1", "--seed", "7", "--config", short_config, "--out", folder]
    assert main([*pour, "--keep-runs", "--measure"]) == 0
    result, kept = tmp_path / "heaps/001.json", tmp_path / "heaps/runs/001.json"
    assert not result.exists()

    anew, measured = [], job.measured
    monkeypatch.setattr(job, "measured", lambda *given: anew.append(given) or measured(*given))

    def measure(*words, config=short_config):
        anew.clear()
        assert main(["stage", "measure_runs", folder, *inputs, "--config", config, *words]) == 0
        return len(anew), result.read_bytes()

    _, right = measure()
    assert measure("--keep-runs") == (0, right), "as measured by the process that poured"
    other = json.loads(Path(short_config).read_text())
    other["measure"]["views"] = 4
    (tmp_path / "other.json").write_text(json.dumps(other))
    assert measure("--keep-runs", config=str(tmp_path / "other.json"))[0] == 1
    assert measure("--keep-runs") == (1, right)
    assert measure("--keep-runs") == (0, right)
    monkeypatch.setattr(kept_runs, "MEASURING", ("measure",))  # other code
    assert measure("--keep-runs") == (1, right)
    kept.write_text(kept.read_text().replace("7", "8", 1))
    assert measure("--keep-runs") == (1, right), "somebody changed it"


def test_heap_takes_a_row_of_a_table_and_the_studys_seeds(short_config, tmp_path, capsys):
    samples = tmp_path / "samples.csv"
    samples.write_text("sample," + ",".join(PARAMETERS) + "\n4,0.2,0.5,0.03,0.3,0.6,0.2\n")
    out = tmp_path / "heaps"
    words = ["heap", "--config", short_config, "--samples", str(samples), "--seeds", "2", "--out", str(out)]
    assert main([*words, "--sample", "4", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["sample"] == 4
    assert record["parameters"]["mus_gg"] == 0.5
    assert len({run["seed"] for run in record["runs"]}) == 2
    assert (out / "004.json").is_file()
    assert "sample is 5" in error_of(capsys, *words, "--sample", "5")


def test_measure_prints_the_angles_of_a_drawn_pile_and_writes_the_overlay(tmp_path, capsys):
    picture = np.full((420, 900), 230, np.uint8)
    height = 200
    half = round(height / np.tan(np.radians(30)))
    triangle = np.array([[450 - half, 399], [450 + half, 399], [450, 399 - height]])
    cv2.fillPoly(picture, [triangle], 40)
    path = tmp_path / "pile.png"
    cv2.imwrite(str(path), picture)
    words = ["measure", str(path), "--mm-per-pixel", "0.1", "--out", str(tmp_path / "out"), "--json"]
    assert main(words) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"photographs", "summary", "provenance"} == set(record)
    (values,) = record["photographs"]
    assert {"left_deg", "right_deg", "aor_deg", "height_mm", *MEAN_KEYS.values()} < set(values)
    # outside a study the line runs from foot to crest
    assert values["aor_deg"] == values["aor_whole_deg"] == pytest.approx(30, abs=0.5)
    assert values["aor_secant_deg"] is None, "the height of a grain is not known"
    assert values["height_mm"] == pytest.approx(20, abs=0.3)
    assert (tmp_path / "out/pile.png").is_file()
    assert main([*words, "--config", "config/config.yaml"]) == 0
    (values,) = json.loads(capsys.readouterr().out)["photographs"]
    # a study has its own definition and grain, 13.34 mm: tan(secant) = tan(30 deg) 20 / (20 - 13.34)
    assert values["aor_secant_deg"] == pytest.approx(60.0, abs=0.6)
    assert values["aor_deg"] == values["aor_flank_deg"] == pytest.approx(30.0, abs=0.5)


def test_measure_refuses_no_pile_and_a_locale_without_a_letter_does_no_harm(tmp_path, capsys, monkeypatch):
    path, out = tmp_path / "empty.png", str(tmp_path / "out")
    cv2.imwrite(str(path), np.full((200, 300), 200, np.uint8))
    words = ("measure", str(path), "--mm-per-pixel", "0.1", "--out", out)
    assert "a pile with two flanks" in error_of(capsys, *words)
    assert "nowhere.png" in error_of(capsys, "measure", "nowhere.png", "--mm-per-pixel", "0.1")

    def provenance(_args):
        print("1 ± 0.1 µm")

    printed = io.BytesIO()
    monkeypatch.setitem(VERBS, "provenance", VERBS["provenance"]._replace(run=provenance))
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, encoding="ascii"))
    assert main(["provenance", "a_file"]) == 0
    assert printed.getvalue() == rb"1 \xb1 0.1 \xb5m" + b"\n"


@pytest.mark.parametrize(("sd", "piles", "warned"), [(0, 10, "sd is 0"), (1.0, 2, "repetitions is 2"), (1.0, 3, None)])
def test_check_warns_of_piles_that_tell_no_scatter(sd, piles, warned):
    target = {"response": "aor_deg", "apparatus": "funnel", "sd": sd, "repetitions": piles}
    lines = list(check.of_targets(SimpleNamespace(settings=SimpleNamespace(targets=[SimpleNamespace(**target)]))))
    assert len(lines) == (warned is not None)
    if warned:
        assert f"aor_deg: WARNING: {warned}" in lines[0]


@pytest.mark.parametrize(("words", "own", "warned"), [
    (["design"], None, True), (["design", "--config=small.yaml"], None, True),
    (["design", "--config=config/paper.yaml"], None, False), (["design"], "config.yaml", False),
    (["design", "--config=own.yaml"], None, False),
])  # fmt: skip
def test_the_built_in_crop_is_reported_in_a_folder_without_a_configuration(
    words, own, warned, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text("design: {samples: 20, method: lhsdesign}")
    Path("own.yaml").write_text((ROOT / "tests/bad_input/own.yaml").read_text())
    if own:
        Path(own).write_text((ROOT / "crops/wheat/config.yaml").read_text())
        Path("sizes.csv").write_text((ROOT / "crops/wheat/sizes.csv").read_text())
        Path("published").symlink_to(ROOT / "crops/wheat/published")
        words = [*words, f"--config={own}"]
    monkeypatch.setattr("repose.chain.design.run", lambda *_: None)
    assert main(words) == 0
    assert ("built-in goji example" in capsys.readouterr().err) is warned


def test_codes_of_a_terminal_in_texts_of_users_are_not_obeyed(tmp_path, capsys):
    shown = json.loads((ROOT / "crops/cards/wheat.json").read_text()) | {"reason": "\x1b[31mred\x07\u009b"}
    (tmp_path / "card.json").write_text(json.dumps(shown))
    main(["card", "check", str(tmp_path / "card.json")])
    out = capsys.readouterr().out
    assert not {"\x1b", "\x07", "\u009b"} & set(out)
    assert "\\x1b[31mred\\x07\\x9b" in out


@pytest.mark.parametrize("out", ["", "/", "/tmp/.."])
def test_a_verb_does_not_write_to_the_root(out, capsys):
    assert main(["marker", "--out", out]) == 2
    assert f"command line: --out is {out!r}; expected the path of a file or folder" in capsys.readouterr().err
