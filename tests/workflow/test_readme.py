"""README's own crop: what it tells a user to write is accepted."""

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import cv2
import numpy as np
import pytest

from repose.cli import main

ROOT = Path(__file__).parents[2]


@pytest.fixture
def mine(tmp_path):
    """The configuration that README shows, with sizes of a made-up crop."""
    shown = re.search(r"    label: wheat\n(?:    .*\n)+", (ROOT / "README.md").read_text()).group(0)
    sizes = np.random.default_rng(1).normal([6.2, 3.1, 2.5], [0.3, 0.1, 0.1], (50, 3))
    rows = [f"{k},{a:.2f},{b:.2f},{c:.2f}" for k, (a, b, c) in enumerate(sizes, 1)]
    (tmp_path / "wheat_sizes.csv").write_text("berry,long_mm,major_mm,minor_mm\n" + "\n".join(rows) + "\n")
    path = tmp_path / "mine.yaml"
    path.write_text(textwrap.dedent(shown).replace("wheat_sizes.csv", str(tmp_path / "wheat_sizes.csv")))
    return path


def dry_run(mine, *targets):
    command = [sys.executable, "-m", "snakemake", *targets, "-n", "--cores", "1", "--quiet", "all"]
    done = subprocess.run([*command, "--configfile", str(mine)], cwd=ROOT, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_the_crop_that_readme_shows_is_planned(mine):
    status, told = dry_run(mine)
    assert status == 0, told
    assert "measure_runs" in told


def test_a_study_is_checked_when_it_is_asked_for(mine):
    status, told = dry_run(mine, "shape_study")
    assert status == 1
    assert "shape_study.fillings.open_cone: funnel.factory_diameter_mm is 150.0" in told


@pytest.mark.parametrize("verb", ["check", "measure"])
def test_a_verb_takes_the_crop_that_readme_shows(verb, mine, tmp_path, capsys):
    words = [verb, "--config", str(mine)]
    if verb == "measure":
        picture = np.full((200, 400), 255, np.uint8)
        for row in range(100):
            picture[50 + row, 199 - row : 200 + row] = 0
        picture[150:160] = 0
        cv2.imwrite(str(tmp_path / "pile.png"), picture)
        words += [str(tmp_path / "pile.png"), "--mm-per-pixel", "0.5", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert {"check": "wheat, good", "measure": "angle of repose"}[verb] in capsys.readouterr().out
