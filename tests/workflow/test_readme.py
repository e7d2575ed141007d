"""The crops that README shows: their folders are accepted as they are."""

import shutil

import cv2
import numpy as np
import pytest
from plans import ROOT, planned

from repose.cli import main
from repose.config import cost


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    assert "crops/index.md" in (ROOT / "README.md").read_text()
    shutil.copytree(ROOT / "crops/wheat", tmp_path / "wheat", ignore=shutil.ignore_patterns("results", ".*"))
    monkeypatch.chdir(tmp_path / "wheat")


@pytest.mark.slow
@pytest.mark.essential
def test_the_crop_that_readme_shows_is_planned():
    jobs = planned(".", "--cores", "1", "--snakefile", f"{ROOT}/Snakefile")
    assert "measure_runs" in jobs
    assert not {"published_solutions", "drum_run"} & set(jobs)
    assert "published_solutions" in planned(".", "published_sets", "--cores", "1", "--snakefile", f"{ROOT}/Snakefile")


@pytest.mark.parametrize("verb", ["check", "measure"])
def test_a_verb_takes_the_crop_that_readme_shows(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cost, "measured_berry_step_s", lambda *_: 1e-3)  # too slow for trial runs
    words = [verb, "--config", "config.yaml"]
    if verb == "measure":
        picture = np.full((200, 400), 255, np.uint8)
        for row in range(100):
            picture[50 + row, 199 - row : 200 + row] = 0
        picture[150:160] = 0
        cv2.imwrite(str(tmp_path / "pile.png"), picture)
        words += [str(tmp_path / "pile.png"), "--mm-per-pixel", "0.5", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert {"check": "wheat, good", "measure": "angle of repose"}[verb] in capsys.readouterr().out
