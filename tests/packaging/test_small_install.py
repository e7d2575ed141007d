"""What works without the extras: a study with a simulator of one's own."""

import subprocess
import sys

import pandas as pd
import pytest

from repose.cli import OPTIONAL_LIBRARIES

STUDY = """
label: mine
seed: 1
simulator: a formula
parameters: {friction: [0.2, 0.8]}
targets: {angle_deg: {value: 30, sd: 1, repetitions: 5}}
sequential: {start_samples: 6, seeds: 2}
posterior: {walkers: 32, steps: 100}
"""
WITHOUT = f"import sys; sys.modules |= dict.fromkeys({(*OPTIONAL_LIBRARIES, 'snakemake', 'psutil')}); "


def without_extras(code, *arguments):
    return subprocess.run(
        [sys.executable, "-c", WITHOUT + code, *arguments],
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
@pytest.mark.essential
def test_ones_own_simulator_needs_no_extra(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").write_text(STUDY)
    code = """
import repose
study = repose.Study(
    parameters={"friction": (0.2, 0.8)},
    targets={"angle_deg": (30, 1, 5)},
    sequential={"start_samples": 6, "seeds": 2},
    posterior={"walkers": 32, "steps": 100},
)
while not study.done:
    runs = study.ask()
    study.tell(runs.assign(angle_deg=20 + 20 * runs["friction"] + 0.1 * runs["run"]))
print(study.answer().parameters)
"""
    found = without_extras(code)
    assert found.returncode == 0, found.stderr
    assert float(found.stdout.split(":")[1].strip("} \n")) == pytest.approx(
        0.4925, abs=0.01
    )
    verb = "from repose.__main__ import main; sys.exit(main())"
    assert (
        without_extras(
            verb, "design", "--config", "own.yaml", "--out", "own"
        ).returncode
        == 0
    )
    table = pd.read_csv("own/samples.csv")
    table.assign(angle_deg=20 + 20 * table["friction"] + 0.1 * table["run"]).to_csv(
        "runs.csv", index=False
    )
    done = without_extras(
        verb, "calibrate", "runs.csv", "--config", "own.yaml", "--out", "own"
    )
    assert (tmp_path / "own/card.json").is_file(), done.stderr
    assert done.returncode == 2, "the report needs libraries of an extra"
    assert done.stderr.splitlines()[-1].endswith(
        "expected `pip install 'repose-dem[workflow]'`, which has all"
    )
