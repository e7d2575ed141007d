"""Photographs that show no whole pile are refused, and none is ever written over."""

import json

import cv2
import numpy as np
import pytest

from repose.cli import main
from repose.core import files
from repose.core.errors import InputError

PILE = [(60, 299), (300, 140), (540, 299)]


def photograph(path, corners=PILE, background=220):
    """A dark polygon on a light background."""
    picture = np.full((300, 600), background, np.uint8) if np.isscalar(background) else background.copy()
    cv2.fillPoly(picture, [np.array(corners)], 40)
    path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    return path.read_bytes()


def measure(capsys, *words):
    """Exit status and what stands on stderr."""
    try:
        status = main(["measure", *map(str, words)])
    except SystemExit as end:
        status = end.code
    return status, capsys.readouterr().err


def test_a_photograph_is_measured_and_stays(tmp_path, capsys):
    before = photograph(tmp_path / "pile.png")
    assert measure(capsys, tmp_path / "pile.png", "--mm-per-pixel", 0.3) == (0, "")
    assert (tmp_path / "pile.png").read_bytes() == before
    assert (tmp_path / "pile_overlay.png").is_file()
    assert measure(capsys, tmp_path / "pile.png", "--mm-per-pixel", 0.3) == (0, ""), (
        "its own overlay is replaced"
    )


@pytest.mark.parametrize("other", ["pile.png", "sub/../pile.png", "link.png", "other.png", "folder"])
def test_an_overlay_never_replaces_a_picture_that_was_there(tmp_path, capsys, other):
    before = photograph(tmp_path / "pile.png")
    (tmp_path / "sub").mkdir()
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.png").symlink_to("pile.png")
    photograph(tmp_path / "other.png")
    status, told = measure(
        capsys, tmp_path / "pile.png", "--mm-per-pixel", 0.3, "--overlay", tmp_path / other
    )
    assert status == 2
    assert "allowed: a" in told
    assert (tmp_path / "pile.png").read_bytes() == (tmp_path / "other.png").read_bytes() == before
    assert (tmp_path / "link.png").is_symlink()


def test_our_own_picture_is_not_replaced_by_its_overlay(tmp_path, capsys):
    photograph(tmp_path / "raw.png")
    files.write_image(tmp_path / "pile.png", cv2.imread(str(tmp_path / "raw.png")))
    words = (tmp_path / "pile.png", "--mm-per-pixel", 0.3, "--overlay", tmp_path / "pile.png")
    assert "another file than the picture" in measure(capsys, *words)[1]


STRIPES = np.where(np.arange(600) // 60 % 2, 220, 90).astype(np.uint8) * np.ones((300, 1), np.uint8)


@pytest.mark.parametrize(
    ("corners", "background", "reason"),
    [
        ([(60, 20), (300, 180), (540, 20)], 220, "upside down"),
        ([(60, 0), (300, 160), (540, 0)], 220, "at the top: its crest is not seen"),
        ([(60, 299), (250, 0), (350, 0), (540, 299)], 220, "at the top: its crest is not seen"),
        ([(-200, 299), (300, 140), (800, 299)], 220, "sideways, or the background is not plain"),
        ([(300, 150), (300, 150)], 220, ""),
        (PILE, STRIPES, ""),
    ],
)
def test_what_is_no_whole_pile_is_refused_and_shown(tmp_path, capsys, corners, background, reason):
    photograph(tmp_path / "pile.png", corners, background)
    status, told = measure(capsys, tmp_path / "pile.png", "--mm-per-pixel", 0.3)
    assert status == 2
    assert reason in told
    assert "pile_overlay.png shows what was taken for the pile" in told
    assert (tmp_path / "pile_overlay.png").is_file()


@pytest.mark.parametrize("scale", ["1e9", "0", "-1", "nan", "inf", "1e-9"])
def test_a_scale_that_no_camera_has_is_refused(tmp_path, capsys, scale):
    photograph(tmp_path / "pile.png")
    status, told = measure(capsys, tmp_path / "pile.png", f"--mm-per-pixel={scale}")
    assert status == 2
    assert "allowed: a number from 0.001 to 100" in told
    assert [path.name for path in tmp_path.iterdir()] == ["pile.png"]


def test_a_shadow_is_left_out_by_the_row_of_the_plate(tmp_path, capsys):
    picture = np.full((320, 600), 220, np.uint8)
    cv2.fillPoly(picture, [np.array(PILE)], 40)
    cv2.rectangle(picture, (80, 300), (520, 310), 60, -1)
    (tmp_path / "pile.png").write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    heights = []
    for more in ((), ("--base-row", "299.5")):
        assert main(["measure", str(tmp_path / "pile.png"), "--mm-per-pixel", "0.5", "--json", *more]) == 0
        heights.append(json.loads(capsys.readouterr().out)["height_mm"])
    assert heights[0] == pytest.approx(85, abs=0.5)
    assert heights[1] == pytest.approx(80, abs=0.5)


def test_a_picture_that_cannot_be_written_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(cv2, "imencode", lambda *_: (False, None))
    with pytest.raises(InputError, match="suffix"):
        files.write_image(tmp_path / "a.png", np.zeros((4, 4), np.uint8))
