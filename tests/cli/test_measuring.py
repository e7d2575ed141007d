"""The height of a grain that `repose measure` takes."""

from argparse import Namespace

import pytest

from repose.cli.measuring import _settings
from repose.core.errors import InputError

NOTHING_GIVEN = Namespace(grain_mm=None, config=None)


def test_in_a_crops_folder_it_is_that_of_the_sizes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert _settings(NOTHING_GIVEN).berry_height_mm is None
    (tmp_path / "sizes.csv").write_text("long_mm,major_mm,minor_mm\n9,4,3\n7,4,1\n")  # means 8, 4, 2
    assert _settings(NOTHING_GIVEN).berry_height_mm == pytest.approx(4.0)
    assert _settings(NOTHING_GIVEN).response == "whole"
    assert _settings(Namespace(grain_mm=5.0, config=None)).berry_height_mm == 5.0


def test_sizes_without_a_grain_are_reported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sizes.csv").write_text("long_mm,major_mm,minor_mm\n")
    with pytest.raises(InputError, match=r"sizes\.csv: rows is 0; expected at least 2 berries"):
        _settings(NOTHING_GIVEN)
    assert _settings(Namespace(grain_mm=5.0, config=None)).berry_height_mm == 5.0
