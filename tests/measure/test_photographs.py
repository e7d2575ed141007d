"""Photographs that show no whole pile are refused, and none is ever written over."""

import json
import shutil
import zlib

import cv2
import numpy as np
import pytest
import yaml
from PIL import Image
from refusals import input_error
from shared import ROOT, says

from repose.common import files
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.measure import pile
from repose.measure.photographs import finding
from repose.measure.photographs import photograph as photographs

PILE = [(60, 299), (300, 140), (540, 299)]
WARNINGS = {
    "plate": "upright over 40",
    "horizon": "not that of a plate",
    "shadow": "darker background",
    "frame": "falls by",
}


def photograph(path, corners=PILE, background=220):
    picture = (
        np.full((320, 600), background, np.uint8)
        if np.isscalar(background)
        else background.copy()
    )
    cv2.fillPoly(picture, [np.array(corners)], 40)
    path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    return path.read_bytes()


@pytest.fixture
def measure(command):
    """Runs `repose measure`, which prints a record; overlays and tables go to the folder out beside the picture."""

    def run(*arguments, status=0):
        out_option = (
            () if "--out" in arguments else ("--out", arguments[0].parent / "out")
        )
        return command("measure", *arguments, *out_option, "--json", status=status)

    return run


def first_of(printed):
    return json.loads(printed.out)["photographs"][0]


def test_a_photograph_is_measured_stays_and_is_not_replaced_by_its_overlay(
    tmp_path, measure
):
    before = photograph(tmp_path / "pile.png")
    assert measure(tmp_path / "pile.png", "--mm-per-pixel", 0.3).err == ""
    assert (tmp_path / "pile.png").read_bytes() == before
    names = {"pile.png", "photographs.csv", "summary.csv", "targets.yaml"}
    assert names < {path.name for path in (tmp_path / "out").iterdir()}
    assert measure(tmp_path / "pile.png", "--mm-per-pixel", 0.3).err == "", (
        "its own files are replaced"
    )
    files.write_image(
        tmp_path / "low.png", cv2.imread(str(tmp_path / "pile.png"))[:200]
    )
    both = (tmp_path / "low.png", tmp_path / "pile.png", "--mm-per-pixel", 0.3)
    low = json.loads(measure(*both, "--base-row", 210, "--json").out)["photographs"][0]
    assert "base_row is 210.0; expected above 0, at most 200" in low["refused"]
    photograph(tmp_path / "raw.png")
    files.write_image(tmp_path / "own.png", cv2.imread(str(tmp_path / "raw.png")))
    arguments = (tmp_path / "own.png", "--mm-per-pixel", 0.3, "--out", tmp_path)
    assert (
        "another folder than that of the photographs"
        in measure(*arguments, status=2).err
    )
    assert (
        "raw.png'; expected each picture once"
        in measure(tmp_path / "raw.png", *both[1:], status=2).err
    )


@pytest.mark.parametrize("seen", WARNINGS)
def test_what_stands_beside_or_below_a_pile_is_doubted_without_a_sheet(
    seen, tmp_path, measure
):
    picture = np.full((420, 700, 3), (200, 190, 170), np.uint8)
    if seen == "horizon":
        picture[270:] = (120, 150, 120)
    if seen == "shadow":
        cv2.fillPoly(
            picture, [np.array([(350, 140), (660, 339), (350, 339)])], (120, 114, 102)
        )
    if seen == "plate":
        picture[340:380, 40:660] = (40, 50, 140)
    cv2.fillPoly(
        picture, [np.array([(100, 339), (350, 140), (600, 339)])], (40, 50, 140)
    )
    if seen == "frame":
        picture[:, :30] = picture[:, -30:] = picture[:30] = picture[-30:] = 0
    files.write_image(tmp_path / "a.png", picture)
    assert WARNINGS[seen] in measure(tmp_path / "a.png", "--mm-per-pixel", 0.3).out
    Image.new("L", (60, 60)).save(
        tmp_path / "a.tif", save_all=True, append_images=[Image.new("L", (60, 60))]
    )
    input_error("pages is 2; expected 1", pile.read_image, tmp_path / "a.tif")


@pytest.mark.parametrize("existing", ["picture", "link", "folder", "other"])
def test_an_overlay_never_replaces_what_was_there(tmp_path, measure, existing):
    before = photograph(tmp_path / "pile.png")
    out = tmp_path if existing == "picture" else tmp_path / "out"
    out.mkdir(exist_ok=True)
    place = out / "pile.png"
    if existing == "link":
        place.symlink_to("../pile.png")
    elif existing == "folder":
        place.mkdir()
    elif existing == "other":
        photograph(place)
    assert (
        "expected a"
        in measure(
            tmp_path / "pile.png", "--mm-per-pixel", 0.3, "--out", out, status=2
        ).err
    )
    assert (tmp_path / "pile.png").read_bytes() == before
    assert existing != "link" or place.is_symlink()
    assert existing != "other" or place.read_bytes() == before


STRIPES = np.where(np.arange(600) // 60 % 2, 220, 90).astype(np.uint8) * np.ones(
    (320, 1), np.uint8
)


@pytest.mark.parametrize(
    ("corners", "background", "reason"),
    [
        ([(60, 20), (300, 180), (540, 20)], 220, "upside down"),
        ([(60, 0), (300, 160), (540, 0)], 220, "at the top: its crest is not seen"),
        (
            [(60, 299), (250, 0), (350, 0), (540, 299)],
            220,
            "at the top: its crest is not seen",
        ),
        (
            [(60, 400), (300, 140), (540, 400)],
            220,
            "at the bottom: its foot is not seen",
        ),
        (
            [(-200, 299), (300, 140), (800, 299)],
            220,
            "sideways, or the background is not plain",
        ),
        ([(300, 150), (300, 150)], 220, ""),
        (PILE, STRIPES, ""),
    ],
)
def test_what_is_no_whole_pile_is_refused_and_shown(
    tmp_path, measure, corners, background, reason
):
    photograph(tmp_path / "pile.png", corners, background)
    message = measure(tmp_path / "pile.png", "--mm-per-pixel", 0.3, status=2).err
    assert reason in message
    assert "out/pile.png shows what was found" in message
    assert (tmp_path / "out/pile.png").is_file()


def test_a_missing_scale_and_the_fault_of_the_pile_have_a_line_each(
    tmp_path, measure, command
):
    """The camera looks down on the pile."""
    corners = [(60, 200), (300, 100), (540, 200), (300, 290)]
    photograph(tmp_path / "pile.png", corners)
    scale, pile_fault = measure(tmp_path / "pile.png", status=2).err.splitlines()
    assert scale.endswith(
        "pile.png: scale is 'unknown'; expected the printed sheet in the picture, "
        "--mm-per-pixel or --length"
    )
    says(pile_fault, "pile is ", "below its widest row", "looks down")
    assert "sheet" not in pile_fault
    assert pile_fault.count(";") == 1
    # Beside a photograph that is measured, each reason has a line, too.
    photograph(tmp_path / "good.png")
    both = (tmp_path / "pile.png", tmp_path / "good.png", "--out", tmp_path / "out")
    first, second, *_ = command("measure", *both).out.splitlines()
    assert first.startswith("pile.png  refused: the printed sheet is not seen")
    assert second.startswith("pile.png  refused: the pile's lowest row lies")


@pytest.mark.parametrize("scale", ["1e9", "0", "-1", "nan", "inf", "1e-9"])
def test_a_scale_that_no_camera_has_is_refused(tmp_path, measure, scale):
    photograph(tmp_path / "pile.png")
    message = measure(tmp_path / "pile.png", f"--mm-per-pixel={scale}", status=2).err
    assert "expected a number from 0.001 to 100" in message
    assert [path.name for path in tmp_path.iterdir()] == ["pile.png"]


COLOURED = "below its grains, with the colour of the background: there is a shadow"
# the first of a grey pile, narrower than it
SHADOWS = [(40, 20, 60, 25, "a shadow at the foot")]
SHADOWS += [
    ((40, 40, 110), -beyond, tone, 18, COLOURED)
    for tone in (60, 130)
    for beyond in (-40, 0, 30)
]


@pytest.mark.parametrize(("colour", "inset", "tone", "deep", "message"), SHADOWS)
def test_a_shadow_below_the_pile_is_refused_unless_the_plate_is_known(
    tmp_path, measure, colour, inset, tone, deep, message
):
    picture = np.full((340, 600, 3), 220, np.uint8)
    cv2.rectangle(
        picture, (60 + inset, 300), (540 - inset, 300 + deep), (tone, tone, tone), -1
    )
    cv2.fillPoly(picture, [np.array(PILE)], np.broadcast_to(colour, 3).tolist())
    (tmp_path / "pile.png").write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    arguments = (tmp_path / "pile.png", "--mm-per-pixel", "0.5")
    assert message in measure(*arguments, status=2).err
    assert first_of(measure(*arguments, "--base-row", "299.5"))[
        "height_mm"
    ] == pytest.approx(80, abs=0.5)


def test_a_picture_without_a_length_has_angles_and_targets_without_height(
    tmp_path, command
):
    """Its angles are those that any scale gives; what needs a length is left out."""
    photograph(tmp_path / "a.png")
    arguments = [
        "measure",
        tmp_path / "a.png",
        "--grain-mm",
        6,
        "--out",
        tmp_path / "out",
    ]
    with_length = first_of(command(*arguments, "--mm-per-pixel", 0.3, "--json"))
    needs_length = {"height_mm", "aor_secant_deg"}
    assert not needs_length & {k for k, v in with_length.items() if v is None}

    printed = command(*arguments)
    assert (
        "no length is known, so there are angles alone, without Height" in printed.out
    )
    assert " mm" not in printed.out.splitlines()[0]
    row = first_of(command(*arguments, "--json"))
    assert {key for key in row if row[key] is None} == needs_length
    angles = [key for key in row if key.endswith("_deg") and key not in needs_length]
    assert len(angles) == 7
    for key in angles:
        assert row[key] == with_length[key]

    targets = yaml.safe_load((tmp_path / "out/targets.yaml").read_text())["targets"]
    assert [target["response"] for target in targets] == ["aor_deg"]
    low = command(*arguments, "--base-row", 200, "--json")
    assert first_of(low)["aor_deg"] != row["aor_deg"]


def test_what_a_doubtful_pile_says_needs_no_length(tmp_path, measure):
    picture = np.full((340, 600, 3), 220, np.uint8)
    cv2.fillPoly(picture, [np.array(PILE)], (40, 40, 40))
    cv2.rectangle(picture, (400, 160), (470, 300), (40, 40, 40), -1)
    cv2.imwrite(str(tmp_path / "pile.png"), picture)
    notes = [
        first_of(measure(tmp_path / "pile.png", *scale))["note"]
        for scale in ((), ("--mm-per-pixel", 0.5), ("--mm-per-pixel", 2))
    ]
    doubts = [note.partition("doubtful")[2] for note in notes]
    assert doubts[0]
    assert doubts[0] == doubts[1] == doubts[2]
    assert " mm" not in doubts[0]


def test_a_level_length_gives_the_scale_and_turns_the_photograph(tmp_path, measure):
    upright = np.full((400, 700), 220, np.uint8)
    cv2.fillPoly(upright, [np.array([(100, 300), (350, 140), (600, 300)])], 40)
    turn = cv2.getRotationMatrix2D((349.5, 199.5), 7.0, 1.0)  # rises to the right
    cv2.imwrite(
        str(tmp_path / "pile.png"),
        cv2.warpAffine(upright, turn, (700, 400), borderValue=220),
    )
    ends = (turn @ [[100, 600], [300, 300], [1, 1]]).T.ravel()
    values = first_of(measure(tmp_path / "pile.png", "--length", "250", *ends))
    assert values["aor_deg"] == pytest.approx(np.degrees(np.arctan2(160, 250)), abs=0.3)
    assert values["left_deg"] == pytest.approx(values["right_deg"], abs=0.3)
    assert values["height_mm"] == pytest.approx(80, abs=0.7)
    assert values["mm_per_pixel"] == pytest.approx(0.5, abs=1e-3)
    assert photographs.measure_level_length(10.0, 1.0, 1.0, 41.0, 1.0) == (0.25, 0.0)


@pytest.mark.parametrize(
    "ends", [(-1, 300, 540, 300), (60, 300, 601, 300), (60, 321, 540, 321)]
)
def test_a_level_length_ends_inside_the_picture(tmp_path, measure, ends):
    photograph(tmp_path / "pile.png")
    message = measure(tmp_path / "pile.png", "--length", "250", *ends, status=2).err
    assert "--length is" in message
    assert "ends inside the picture, of 600 x 320 pixels" in message


def test_the_mean_of_several_is_a_target_that_a_study_reads(tmp_path, measure):
    heights = (140, 130, 150)
    for k, crest in enumerate(heights):
        photograph(tmp_path / f"p{k}.png", [(60, 299), (300, crest), (540, 299)])
    photograph(tmp_path / "p9.png", [(60, 20), (300, 180), (540, 20)])
    arguments = [tmp_path / f"p{k}.png" for k in (0, 1, 2, 9)]
    options = ("--mm-per-pixel", "0.4", "--grain-mm", "8")
    record = json.loads(measure(*arguments, *options).out)
    summary = {row["response"]: row for row in record["summary"]}
    truth = [0.4 * (299.5 - crest) for crest in heights]
    assert summary["height_mm"]["value"] == pytest.approx(np.mean(truth), abs=0.3)
    assert summary["height_mm"]["sd"] == pytest.approx(np.std(truth, ddof=1), abs=0.05)
    assert summary["height_mm"]["repetitions"] == 3
    assert "upside down" in record["photographs"][3]["refused"]
    targets_file = tmp_path / "out/targets.yaml"
    config = PipelineConfig.load(ROOT / "config/quick.yaml", targets_file).config
    responses = [target["response"] for target in config["targets"]]
    assert responses == ["aor_deg", "height_mm"]
    assert config["targets"][1]["value"] == summary["height_mm"]["value"]
    assert config["measure"]["response"] == "whole"
    assert config["measure"]["berry_height_mm"] == 8
    assert "# the line of the angle: whole side, columns\n" in targets_file.read_text()


def test_one_photograph_gives_no_scatter(tmp_path, measure, command):
    photograph(tmp_path / "p.png", PILE)
    record = json.loads(
        measure(tmp_path / "p.png", "--mm-per-pixel", "0.4", "--grain-mm", "8").out
    )
    assert {row["sd"] for row in record["summary"]} == {None}
    with pytest.raises(InputError) as refused:
        PipelineConfig.load(ROOT / "config/quick.yaml", tmp_path / "out/targets.yaml")
    for key in (
        "targets.0.sd is null",
        "targets.0.range is [null, null]",
        "targets.1.sd is null",
    ):
        assert key in str(refused.value)
    output = command(
        "measure",
        tmp_path / "p.png",
        "--mm-per-pixel",
        "0.4",
        "--out",
        tmp_path / "again",
    ).out
    says(output, "one pile gives no scatter", "mm, not known, 1")


def test_a_photograph_of_many_pixels_is_reduced(tmp_path, measure):
    picture = np.full((3000, 6000), 220, np.uint8)
    cv2.fillPoly(picture, [10 * np.array(PILE)], 40)
    cv2.imwrite(str(tmp_path / "pile.png"), picture)
    values = first_of(measure(tmp_path / "pile.png", "--mm-per-pixel", "0.05"))
    assert values["height_mm"] == pytest.approx(79.5, abs=0.2)
    assert values["mm_per_pixel"] == pytest.approx(0.075)


def test_one_bad_picture_is_named_and_does_not_stop_the_others(tmp_path, measure):
    photograph(tmp_path / "raw.png")
    tiny = tmp_path / "tiny.png"
    heic = tmp_path / "phone.heic"
    text = tmp_path / "notes.jpg"
    files.write_image(tiny, np.zeros((3, 3, 3), np.uint8))
    heic.write_bytes(b"\0\0\0\x18ftypheic" + bytes(40))
    text.write_text("no picture")
    arguments = ("--mm-per-pixel", 0.3, "--out", tmp_path / "out")
    message = measure(tmp_path / "raw.png", tiny, heic, text, *arguments).err
    for name, words_of in (
        ("tiny.png", "3 x 3 pixels"),
        ("phone.heic", "PNG or JPEG"),
        ("notes.jpg", "not a picture"),
    ):
        assert any(
            name in line and words_of in line for line in message.splitlines()
        ), name
    message = measure(tiny, heic, *arguments, status=2).err
    says(message, "tiny.png", "phone.heic")


def test_a_picture_of_too_many_pixels_or_one_that_cannot_be_written_is_an_error(
    tmp_path, monkeypatch
):
    header = bytearray(
        cv2.imencode(".png", np.zeros((8, 30_000), np.uint8))[1].tobytes()
    )
    header[20:24] = (30_000).to_bytes(4, "big")  # as if it had as many rows
    header[29:33] = zlib.crc32(bytes(header[12:29])).to_bytes(4, "big")
    (tmp_path / "huge.png").write_bytes(bytes(header))
    input_error(
        r"huge.png: size is .*at most 200 million",
        pile.read_image,
        tmp_path / "huge.png",
    )
    monkeypatch.setattr(cv2, "imencode", lambda *_: (False, None))
    input_error(
        "suffix", files.write_image, tmp_path / "a.png", np.zeros((4, 4), np.uint8)
    )


def test_a_doubtful_picture_counts_only_if_it_is_asked_for(tmp_path, measure, command):
    """The third has a level top."""
    for k, crest in enumerate((140, 130)):
        photograph(tmp_path / f"p{k}.png", [(60, 299), (300, crest), (540, 299)])
    photograph(tmp_path / "p2.png", [(60, 299), (170, 200), (430, 200), (540, 299)])
    photographs = [tmp_path / f"p{k}.png" for k in range(3)]
    options = ("--mm-per-pixel", "0.5", "--grain-mm", "6")
    for more, number in (((), 2), (("--doubtful",), 3)):
        record = json.loads(measure(*photographs, *options, *more).out)
        assert "doubtful" in record["photographs"][2]["note"]
        assert {row["repetitions"] for row in record["summary"]} == {number}
        assert f"repetitions: {number}\n" in (tmp_path / "out/targets.yaml").read_text()
    printed = command(
        "measure", photographs[2], *options, "--out", tmp_path / "out"
    ).out
    assert (
        "doubtful photographs left out: 1 of 1 (p2.png); --doubtful counts them"
        in printed
    )
    assert not (tmp_path / "out/targets.yaml").exists()


def test_a_lopsided_pile_is_doubtful_and_counts_as_a_simulated_view_does(
    tmp_path, measure, command
):
    """The sides of the second differ by 23 degrees; the third has a level top, too."""
    photograph(tmp_path / "p0.png")
    photograph(tmp_path / "p1.png", [(60, 299), (200, 140), (540, 299)])
    level_top = [(60, 299), (140, 200), (300, 200), (540, 299)]
    photograph(tmp_path / "p2.png", level_top)
    options = [tmp_path / f"p{k}.png" for k in range(3)]
    options += ["--mm-per-pixel", "0.5", "--grain-mm", "6"]
    for more, number in (((), 2), (("--doubtful",), 3)):
        record = json.loads(measure(*options, *more).out)
        first, lopsided, level = record["photographs"]
        assert first["note"] == ""
        assert not lopsided["refused"]
        assert lopsided["left_deg"] - lopsided["right_deg"] > 20
        assert lopsided["note"].startswith("doubtful: the angles of the pile's two sid")
        assert "its top is level; doubtful: the angles of the" in level["note"]
        assert {row["repetitions"] for row in record["summary"]} == {number}
    shutil.rmtree(tmp_path / "out")
    printed = command("measure", *options, "--out", tmp_path / "out").out
    assert (
        "doubtful photographs in the mean: 1 of 3 (p1.png); only the two sides differ, "
        "by more than 10 degrees\n"
        "doubtful photographs left out: 1 of 3 (p2.png); --doubtful counts them\n"
    ) in printed
    assert printed.count("two sides differ by") == 2


def test_hidden_pixels_get_the_colour_of_the_nearest_and_of_two_the_left_one():
    nothing = -1.0
    rows = [
        ([1.0, 2.0, nothing, 4.0, 5.0], [1.0, 2.0, 2.0, 4.0, 5.0]),
        ([nothing, nothing, 3.0, nothing, nothing], [3.0] * 5),
        ([1.0, nothing, nothing, 4.0, 5.0], [1.0, 1.0, 4.0, 4.0, 5.0]),
        ([nothing] * 5, [nothing] * 5),
    ]
    colours, expected = np.array(rows).transpose(1, 0, 2)[..., None]
    filled = finding._fill_hidden(colours, hidden=colours[..., 0] == nothing)
    np.testing.assert_array_equal(filled, expected)
