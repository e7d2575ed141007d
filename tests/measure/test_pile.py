"""The measurement against piles of known angle and height, drawn here without OpenCV."""

import math

import cv2
import numpy as np
import pytest
from refusals import input_error, raised

from repose.measure import pile as piles
from repose.measure.photographs.drawing import draw_steps, overlay
from repose.measure.photographs.segmentation import find_plate_row, segment
from repose.measure.pile import MeasureSettings, NoFlankError, read_image
from repose.measure.profile_points import FLANK_RULES

# The line of these tests: between a tenth and eight tenths of the height the drawn piles are straight.
FLANK = MeasureSettings.with_defaults(
    response="flank", fit_from=0.1, fit_to=0.8, flank="columns"
)


def measure_image(picture, mm_per_pixel, settings=FLANK, **more):
    return piles.measure_image(picture, mm_per_pixel, settings, **more)


MM = 0.25
ANGLES = (15, 20, 25, 30, 35, 40, 45)
HEIGHT_MM = 60.0


def triangle(angle, u, height=HEIGHT_MM):
    """Profile of a pile with straight flanks; height (mm) over distance from the axis (mm)."""
    return np.maximum(height - np.abs(u) * math.tan(math.radians(angle)), 0.0)


def rounded(angle, u, height=HEIGHT_MM, radius=15.0):
    """Straight flanks that pass tangentially into a round top of the given radius."""
    a = math.radians(angle)
    cap = height - radius + np.sqrt(np.maximum(radius**2 - u**2, 0.0))
    apex = height - radius + radius / math.cos(a)
    return np.where(
        np.abs(u) < radius * math.sin(a),
        cap,
        np.maximum(apex - np.abs(u) * math.tan(a), 0.0),
    )


def lumpy(angle, u, rng, height=HEIGHT_MM, radii=(5.0, 10.0)):
    """Discs of 10 to 20 mm strewn along both flanks of a triangle, their tops scattering 4 mm about the flanks."""
    a = math.radians(angle)
    z = triangle(angle, u, height - 8 / math.cos(a))
    for side in (-1, 1):
        along = rng.uniform(0, 8)
        while along < height / math.sin(a):
            r = rng.uniform(*radii)
            depth = r + rng.uniform(-4, 4)
            centre_u = side * (
                height / math.tan(a) - along * math.cos(a) - depth * math.sin(a)
            )
            centre_z = along * math.sin(a) - depth * math.cos(a)
            chord = r**2 - (u - centre_u) ** 2
            z = np.maximum(
                z, np.where(chord > 0, centre_z + np.sqrt(np.maximum(chord, 0)), 0.0)
            )
            along += r * rng.uniform(1.2, 2.2)
    return z


def drawn(
    profile,
    half_mm,
    top_mm=HEIGHT_MM + 15,
    below_mm=4.0,
    mm=MM,
    loose=(),
    binary=False,
    sub=8,
):
    """Coverage (0 to 1) of each pixel by what lies under `profile(u)` and by loose discs (u, radius) on the plate."""
    columns = round(2 * half_mm / mm)
    rows = round((top_mm + below_mm) / mm)
    u = ((np.arange(columns * sub) + 0.5) / sub - columns / 2) * mm
    z = profile(u)
    bottom = np.zeros_like(u)
    layers = [(bottom, z)]
    for centre, r in loose:
        half_chord = np.sqrt(np.maximum(r**2 - (u - centre) ** 2, 0.0))
        layers.append((r - half_chord, r + half_chord))
    low = top_mm - (np.arange(rows)[:, None] + 1) * mm
    cover = np.zeros((rows, columns))
    for bottom, top in layers:
        piece = (
            np.clip(np.minimum(top, low + mm) - np.maximum(bottom, low), 0.0, None) / mm
        )
        cover = np.maximum(cover, piece.reshape(rows, columns, sub).mean(axis=2))
    return (cover >= 0.5).astype(float) if binary else cover


def toned(cover, pile, background):
    cover = cover[..., None] if np.ndim(pile) else cover
    return np.rint(np.add(background, cover * np.subtract(pile, background))).astype(
        np.uint8
    )


def half_width(angle):
    return HEIGHT_MM / math.tan(math.radians(angle)) + 25


def tilted_noisy(picture, rng, tilt=60, noise=8):
    """Light that falls off from the upper left to the lower right by `tilt` grey levels, and sensor noise."""
    rows, columns = picture.shape[:2]
    slope = np.add.outer(np.linspace(0, 0.4, rows), np.linspace(0, 0.6, columns)) * tilt
    slope = slope[..., None] if picture.ndim == 3 else slope
    return np.clip(
        picture - slope + rng.normal(0, noise, picture.shape), 0, 255
    ).astype(np.uint8)


def lumpy_piles(angle, count, mm=MM):
    """Coverage pictures of `count` different lumpy piles with a loose berry on either side."""
    rng = np.random.default_rng(angle)
    half = half_width(angle)
    for _ in range(count):
        yield drawn(
            lambda u: lumpy(angle, u, rng),
            half,
            mm=mm,
            loose=[(8 - half, 5), (half - 8, 6)],
            sub=2,
        )


# Measured by the tests below: largest error of any clean pile 0.012 degrees and 0.22 mm (the tip of a sharp
# 45 degree pile, cut by the smoothing), with light, noise and loose berries 0.03 degrees and 0.3 mm.
CLEAN_DEG = 0.05
CLEAN_MM = 0.3
DISTURBED_DEG = 0.1
DISTURBED_MM = 0.5
# Lumpy piles, mean over all angles: -0.4 degrees, root mean square 1.3 from pile to pile, which is the
# lumps' own scatter: light and noise on top of them move a pile by 0.07 degrees at most.
LUMPY_DEG = 1.0
LUMPY_MOVED_DEG = 0.2


@pytest.mark.parametrize("shape", [triangle, rounded])
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("angle", ANGLES)
def test_clean_pile_is_measured_to_a_fraction_of_a_degree_and_a_pixel(
    shape, binary, angle
):
    for height in (52.3, 60.1):
        cover = drawn(
            lambda u, h=height: shape(angle, u, h), half_width(angle), binary=binary
        )
        m = measure_image(toned(cover, 40, 220), MM)
        assert m.angle.left_deg == pytest.approx(angle, abs=CLEAN_DEG)
        assert m.angle.right_deg == pytest.approx(angle, abs=CLEAN_DEG)
        assert m.aor_deg == pytest.approx((m.angle.left_deg + m.angle.right_deg) / 2)
        assert m.height_mm == pytest.approx(height, abs=CLEAN_MM)


def test_each_side_is_measured_by_itself():
    cover = drawn(
        lambda u: np.where(u < 0, triangle(20, u), triangle(38, u)), half_width(20)
    )
    m = measure_image(toned(cover, 40, 220), MM)
    assert m.angle.left_deg == pytest.approx(20, abs=CLEAN_DEG)
    assert m.angle.right_deg == pytest.approx(38, abs=CLEAN_DEG)
    left, right = m.angle.lines
    axis = cover.shape[1] / 2 - 0.5
    for (below, above), slope in ((left, 20), (right, 38)):
        expected = HEIGHT_MM * 0.9 / math.tan(math.radians(slope)) / MM
        assert abs(below[0] - axis) == pytest.approx(expected, abs=1.5)
        assert m.base_row - below[1] == pytest.approx(0.1 * m.height_mm / MM)
        assert m.base_row - above[1] == pytest.approx(0.8 * m.height_mm / MM)


# Grey: dark on light, light on dark. Red fruit (BGR) on white, on black, and on a board of the very same luminance.
TONES = [
    (40, 220),
    (210, 30),
    ((30, 30, 190), (225,) * 3),
    ((30, 30, 190), (15,) * 3),
    ((30, 30, 190), (77,) * 3),
]


@pytest.mark.parametrize(("pile", "background"), TONES)
@pytest.mark.parametrize(
    "shape", [pytest.param(triangle, marks=pytest.mark.slow), rounded]
)
def test_tilted_light_noise_and_loose_berries_in_either_polarity(
    pile, background, shape
):
    for angle in ANGLES[::2]:
        half = half_width(angle)
        cover = drawn(
            lambda u, a=angle: shape(a, u), half, loose=[(half - 7, 5), (9 - half, 6)]
        )
        m = measure_image(
            tilted_noisy(toned(cover, pile, background), np.random.default_rng(angle)),
            MM,
        )
        assert m.aor_deg == pytest.approx(angle, abs=DISTURBED_DEG)
        assert m.height_mm == pytest.approx(HEIGHT_MM, abs=DISTURBED_MM)
        if background != (77, 77, 77):
            assert m.is_darker == (np.mean(pile) < np.mean(background))


def test_a_light_or_lumpy_pile_is_measured_as_it_is():
    picture = toned(next(lumpy_piles(30, 1)), 60, 200)
    plain = measure_image(picture, MM)
    inverse = measure_image(255 - picture, MM)
    assert inverse.aor_deg == pytest.approx(plain.aor_deg, abs=0.02)
    assert inverse.height_mm == pytest.approx(plain.height_mm, abs=0.02)
    assert plain.is_darker
    assert not inverse.is_darker
    picture = toned(drawn(lambda u: rounded(30, u), half_width(30)), 40, 220)
    fine = measure_image(picture, 0.1)
    coarse = measure_image(picture, 0.4)
    assert coarse.aor_deg == fine.aor_deg
    assert coarse.height_mm == pytest.approx(4 * fine.height_mm)
    errors = {rule: [] for rule in FLANK_RULES}
    coarse = 2 * MM  # a lump has 20 to 40 pixels
    for angle in ANGLES:
        for cover in lumpy_piles(angle, 12, coarse):
            # the pile is found once and measured by each rule
            pile = segment(toned(cover >= 0.5, 60, 200), FLANK.largest_pile_only)
            for rule, values in errors.items():
                by_rule = FLANK.model_copy(update={"flank": rule}).with_scale(coarse)
                values.append(piles.measure_segmented(pile, by_rule).aor_deg - angle)
    bias = {rule: abs(np.mean(values)) for rule, values in errors.items()}
    assert bias["levels"] < LUMPY_DEG
    assert bias["levels"] < bias["rows"] < bias["columns"]
    moved = []
    for angle in ANGLES:
        for cover in lumpy_piles(angle, 2):
            picture = toned(cover, 60, 200)
            disturbed = tilted_noisy(picture, np.random.default_rng(angle))
            moved.append(
                measure_image(disturbed, MM).aor_deg
                - measure_image(picture, MM).aor_deg
            )
    assert np.abs(moved).max() < LUMPY_MOVED_DEG


def test_loose_berries_count_when_asked_for():
    half = half_width(30)
    picture = toned(
        drawn(lambda u: triangle(30, u), half, loose=[(half - 11, 8)]), 40, 220
    )
    alone = measure_image(picture, MM)
    together = measure_image(
        picture, MM, FLANK.model_copy(update={"largest_pile_only": False})
    )
    assert alone.angle.right_deg == pytest.approx(30, abs=CLEAN_DEG)
    assert together.angle.right_deg < 29
    assert together.angle.left_deg == pytest.approx(30, abs=CLEAN_DEG)


def test_spots_of_the_background_on_the_pile_do_not_disturb():
    picture = toned(
        drawn(lambda u: triangle(30, u), half_width(30)), (30, 30, 190), (245, 245, 245)
    )
    rng = np.random.default_rng(3)
    rows, columns = picture.shape[:2]
    for _ in range(60):
        u = rng.uniform(-60, 60)
        v = rng.uniform(5, 50)
        if v < triangle(30, abs(u) + 8):
            centre = round(columns / 2 + u / MM), rows - 16 - round(v / MM)
            cv2.circle(picture, centre, 6, (245, 245, 245), -1)
    assert measure_image(picture, MM).aor_deg == pytest.approx(30, abs=DISTURBED_DEG)


def test_a_narrow_mask_has_its_plate():
    mask = np.zeros((30, 100), bool)
    mask[:20, 40:60] = mask[20:] = True
    mask[15, 3:97] = True
    assert find_plate_row(mask) == 19.5
    assert find_plate_row(mask[16:]) == 3.5
    assert find_plate_row(mask[17:]) is None


def test_the_base_is_the_given_one_or_a_plate_as_dark_as_the_pile_and_jpeg_round_trip(
    tmp_path,
):
    picture = toned(
        drawn(lambda u: triangle(30, u), half_width(30), below_mm=0), 40, 220
    )
    m = measure_image(
        np.vstack([picture, np.full((50, picture.shape[1]), 40, np.uint8)]), MM
    )
    assert m.base_row == picture.shape[0] - 0.5
    assert m.aor_deg == pytest.approx(30, abs=CLEAN_MM)
    assert m.height_mm == pytest.approx(HEIGHT_MM, abs=CLEAN_MM)
    picture = toned(
        drawn(lambda u: triangle(30, u), half_width(30), below_mm=4.0), 40, 220
    )
    found = measure_image(picture, MM)
    assert measure_image(
        picture, MM, base_row=found.base_row - 40
    ).height_mm == pytest.approx(found.height_mm - 10)
    input_error("base_row", measure_image, picture, MM, base_row=10_000)
    picture = toned(
        drawn(lambda u: rounded(33, u), half_width(33)), (30, 30, 190), (200, 205, 210)
    )
    path = tmp_path / "pile.jpg"
    cv2.imwrite(
        str(path),
        tilted_noisy(picture, np.random.default_rng(1)),
        [cv2.IMWRITE_JPEG_QUALITY, 85],
    )
    m = measure_image(read_image(path), MM)
    assert m.aor_deg == pytest.approx(33, abs=DISTURBED_DEG)
    assert m.height_mm == pytest.approx(HEIGHT_MM, abs=DISTURBED_MM)


def test_the_panels_of_a_picture_are_those_of_the_workflow():
    picture = toned(drawn(lambda u: triangle(30, u), half_width(30)), 40, 220)
    panels = draw_steps(picture, MM, FLANK)
    assert list(panels) == ["grey", "binary", "edge", "boundary"]
    assert np.array_equal(panels["grey"], picture)
    assert (
        set(np.unique(panels["binary"])) == set(np.unique(panels["edge"])) == {0, 255}
    )
    m = measure_image(picture, MM)
    final = panels["boundary"]
    assert np.array_equal(final, overlay(picture, m))
    left, right = (np.mean(line, axis=0).round().astype(int) for line in m.angle.lines)
    assert final[left[1], left[0]].argmax() == 2  # red left line, BGR
    assert final[right[1], right[0]].argmax() == 1  # green right line
    assert np.array_equal(
        picture, toned(drawn(lambda u: triangle(30, u), half_width(30)), 40, 220)
    )


def test_unreadable_pictures_are_refused(tmp_path):
    for name, content in (("empty.png", b""), ("text.png", b"not a picture")):
        (tmp_path / name).write_bytes(content)
        input_error(name, read_image, tmp_path / name)
    _, jpeg = cv2.imencode(".jpg", np.zeros((400, 400, 3), np.uint8))
    cut = tmp_path / "cut.jpg"
    cut.write_bytes(jpeg.tobytes()[: len(jpeg) // 2])
    input_error("cut.jpg: picture is 'cut off or damaged'", read_image, cut)


def test_a_picture_of_more_than_8_bits_is_read(tmp_path):
    for bits in range(9, 17):  # a camera's, in the lower bits of 16
        deep = np.random.default_rng(bits).integers(
            0, 256, (20, 30, 3), dtype=np.uint16
        )
        deep[0, 0] = 255
        cv2.imwrite(str(tmp_path / "deep.png"), deep << (bits - 8))
        assert (read_image(tmp_path / "deep.png") == deep).all()


def test_pictures_and_arrays_of_other_kinds_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "deep.hdr"), np.ones((20, 30, 3), np.float32))
    input_error("of float32 numbers", read_image, tmp_path / "deep.hdr")
    input_error("no such file", read_image, tmp_path / "missing.png")
    for bad, message in (
        (np.zeros((50, 50)), "pixel type is 'float64'"),
        (np.zeros((50, 50, 4), np.uint8), r"shape is \(50, 50, 4\)"),
        (np.zeros((5, 50), np.uint8), r"shape is \(5, 50\)"),
    ):
        input_error(message, measure_image, bad, MM)


@pytest.mark.parametrize(
    ("picture", "reason"),
    [
        (np.full((200, 300), 128, np.uint8), "nothing in the picture"),
        (
            toned(drawn(lambda u: np.where(np.abs(u) < 60, 3.0, 0.0), 80), 40, 220),
            "pixels high",
        ),
        (
            toned(drawn(lambda u: triangle(30, u), 50), 40, 220),
            "runs out of the picture",
        ),
        (
            toned(drawn(lambda u: np.where(np.abs(u) < 40, 60.0, 0.0), 80), 40, 220),
            "a wall",
        ),
    ],
)
def test_pictures_without_a_flank_say_why(picture, reason):
    raised(NoFlankError, reason, measure_image, picture, MM)
