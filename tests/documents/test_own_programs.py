"""The steps of the pages on the user's own programs, taken with programs that stand for them."""

import csv

import numpy as np
import pytest
import yaml
from commands import ROOT, steps
from test_particles import RADIUS, cone

from repose.cli import main
from repose.stages import simulate, simulated
from repose.stages.settings import SimulatorSettings


def files_of(page):
    """The files that a page asks to save, by name."""
    found = steps((ROOT / page).read_text())
    return {name: text for name, text in found if "." in name}


def commands_of(page, word):
    """The commands of a page that hold a word, without the program."""
    found = steps((ROOT / page).read_text())
    return [
        text.split()[1:] for what, text in found if what == "command" and word in text
    ]


@pytest.fixture
def shell(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = files_of("docs/simulators.md")
    (tmp_path / "run.sh").write_text(files["run.sh"])
    return SimulatorSettings.model_validate(
        yaml.safe_load(files["shell.yaml"])["simulator"]
    )


def run_of_shell(shell, tmp_path, friction):
    parameters = {"friction": friction, "rolling": 0.1}
    simulate.run_once(
        shell, parameters, sample=1, run=1, seed=5, out_dir=tmp_path / "001"
    )
    job = simulated.measure_sample(
        [tmp_path / "001" / "1.json"],
        tmp_path / "001.json",
        settings=shell,
        responses=("angle_deg", "time_s"),
        measure=None,
    )
    return job["runs"][0]


def test_a_script_of_the_shell_calls_a_program_that_reads_arguments(shell, tmp_path):
    run = run_of_shell(shell, tmp_path, friction=0.5)
    assert run["status"] == "ok", run
    # The formula of the page with at most 1 % of noise.
    assert run["angle_deg"] == pytest.approx(31.0, rel=0.0101)
    assert run["time_s"] == pytest.approx(3.8, rel=0.0101)


@pytest.mark.parametrize(
    ("program", "status"), [("false", "exit_status"), ("true", "bad_output")]
)
def test_a_failing_program_in_the_script_is_a_failed_run(
    shell, tmp_path, program, status
):
    script = (tmp_path / "run.sh").read_text()
    begin = script.index("awk -v")
    end = script.index("| tee")
    (tmp_path / "run.sh").write_text(f"{script[:begin]}{program} {script[end:]}")
    assert run_of_shell(shell, tmp_path, friction=0.5)["status"] == status


def exported_pile(row, folder):
    """Write the particles of a pile whose slope follows the parameters."""
    slope_deg = 20 + 15 * float(row["static_friction"])
    slope_deg += 30 * float(row["rolling_friction"])
    name = f"{row['sample']}_{row['run']}.csv"
    # The foot of the cone has a radius of 160 mm.
    height_m = 0.16 * np.tan(np.radians(slope_deg))
    centres = cone(slope_deg, height_m)
    with open(folder / name, "w", newline="") as file:
        csv.writer(file).writerows(centres.tolist())


@pytest.mark.slow
def test_a_program_with_a_graphical_interface(tmp_path, monkeypatch):
    page = "docs/edem.md"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "edem.yaml").write_text(files_of(page)["edem.yaml"])
    design, tell, calibrate = commands_of(page, "edem.yaml")
    (measure,) = commands_of(page, "repose measure exported")
    assert float(measure[measure.index("--radius") + 1]) == RADIUS
    assert main(design) == 0
    with open("own/samples.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    (tmp_path / "exported").mkdir()
    # The last row stands for a run that failed.
    for row in rows[:-1]:
        exported_pile(row, tmp_path / "exported")
    files = sorted(map(str, (tmp_path / "exported").iterdir()))
    place = measure.index("exported/*.csv")
    measure[place : place + 1] = files
    assert main(measure) == 0
    assert main(tell) == 0
    assert main(calibrate) == 0
    with open("own/runs.csv", newline="") as file:
        told = list(csv.DictReader(file))
    assert [row["aor_deg"] == "" for row in told].count(True) == 1
    assert (tmp_path / "own" / "card.json").is_file()
