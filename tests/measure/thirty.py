"""The thirty photographs that the measurement is judged by: ten of each of three cameras, and the sheet alone.

`python tests/measure/thirty.py --draw 0 1 2 3` measures thirty photographs of each draw and prints their errors as
table rows; `--picture FILE` draws the figure of photographs that can and that cannot be measured.
"""

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
from rendered import CROPS, Scene, photograph, truth

from repose.measure.photographs import photograph as photographs
from repose.measure.photographs.drawing import overlay
from repose.measure.settings import MeasureSettings

# Walls and plates, blue first.
PALETTE = {
    "white": (225, 228, 230),
    "grey": (140, 142, 145),
    "blue": (170, 105, 55),
    "wood": (95, 140, 185),
    "green": (95, 140, 80),
    "black": (45, 45, 48),
}
# Size, focal length in widths, k1 and k2.
CAMERAS = [
    ((1600, 1200), 0.80, (0.0, 0.0)),
    ((1680, 1260), 0.95, (-0.12, 0.02)),
    ((1520, 1140), 1.40, (0.08, -0.02)),
]


def scenes(camera, draw=0):
    """Ten scenes of a camera, 0 to 2; conditions are drawn at random, each disturbance in about half of them.

    draw: another thirty for every number; the measurement was made with those of 0 in view.
    """
    size, focal, distortion = CAMERAS[camera]
    made = []
    for k in range(10):
        number = 10 * camera + k
        rng = np.random.default_rng([2026, number, draw] if draw else [2026, number])
        crop = list(CROPS)[number % len(CROPS)]
        angle = rng.uniform(24, 40)
        height = rng.uniform(45, 70)
        width_mm = 2 * height / np.tan(np.radians(angle)) + 330
        half = 0.5 * width_mm - 165
        left = -half - 170 - rng.uniform(0, 20)
        away = focal * (half + 120 - left) * rng.uniform(1.1, 1.3)
        side = rng.uniform(-0.15, 0.15) * away
        colours = [PALETTE[name] for name in rng.choice(list(PALETTE), 2)]
        made.append(
            Scene(
                seed=1000 * draw + number,
                crop=crop,
                angle=angle,
                height=height,
                wall=colours[0],
                ground=colours[1],
                texture=("plain", "cloth", "wood", "speckle")[number % 4],
                position=(
                    side,
                    -away,
                    height + np.tan(np.radians(rng.uniform(-2, 5))) * away,
                ),
                aim=(0.5 * (half + 60 + left), 0, 60),
                rotation=(*rng.uniform(-4, 4, 2), rng.uniform(-15, 15)),
                distortion=distortion,
                size=size,
                focal=focal * size[0],
                wall_at=rng.uniform(150, 500),
                uneven=rng.uniform(0, 0.5),
                shadow=rng.uniform(0.2, 0.6),
                hand=rng.choice([0, 1]) * rng.uniform(0.25, 0.5),
                loose=int(rng.choice([0, 1]) * rng.integers(3, 16)),
                ruler=str(rng.choice(["", "standing"])),
                sheet_left=left,
                sheet_yaw=rng.uniform(-1, 1),
            )
        )
    return made


def sheet_alone(camera):
    """Eight scenes of the same camera with the sheet alone, in all parts of the picture."""
    size, focal, distortion = CAMERAS[camera]
    made = []
    for k in range(8):
        rng = np.random.default_rng([2027, 10 * camera + k])
        away = focal * 420.0
        u, v = ((-1, -1), (1, -1), (-1, 1), (1, 1), (0, -1), (0, 1), (-1, 0), (1, 0))[k]
        made.append(
            Scene(
                seed=100 + 10 * camera + k,
                aim=(130 * u, 0, 90 + 60 * v),
                rotation=(0, 0, rng.uniform(-10, 10)),
                position=(rng.uniform(-0.4, 0.4) * away, -away, rng.uniform(80, 260)),
                distortion=distortion,
                size=size,
                focal=focal * size[0],
                with_pile=False,
                sheet_left=-70,
                sheet_yaw=rng.uniform(-25, 25),
            )
        )
    return made


def errors(folder, kept=range(30), of_the_sheet=8, draw=0):
    """By number, of those kept: angle [deg] and Height [mm] minus the truth, or the reason of a refusal.

    of_the_sheet: how many photographs show the sheet alone, at most 8.
    """
    missed = {}
    for camera in range(3):
        chosen = [scene for scene in scenes(camera, draw) if scene.seed % 1000 in kept]
        alone = sheet_alone(camera)[:of_the_sheet] if chosen else []
        paths = {
            scene.seed: folder / f"{scene.seed}.png" for scene in (*chosen, *alone)
        }
        for scene in (*chosen, *alone):
            cv2.imwrite(str(paths[scene.seed]), photograph(scene))
        for crop in sorted({scene.crop for scene in chosen}):
            same = [scene for scene in chosen if scene.crop == crop]
            settings = MeasureSettings.with_defaults(berry_height_mm=same[0].berry_mm)
            found = photographs.measure_photographs(
                [paths[scene.seed] for scene in same],
                settings,
                photographs.Scale(),
                [paths[scene.seed] for scene in alone],
            )
            for scene, photograph_ in zip(same, found, strict=True):
                seen = photograph_.measurement
                # The two sides of each drawn pile are alike, so where they differ a
                # line does not follow the pile.
                if seen is None or photograph_.sides_warning:
                    missed[scene.seed % 1000] = photograph_.remarks or (
                        photograph_.rejection_reason
                    )
                    continue
                true = truth(scene, settings)
                missed[scene.seed % 1000] = (
                    seen.aor_deg - true.aor_deg,
                    seen.height_mm - true.height_mm,
                )
    return missed


# A scene that is drawn in a second, and what goes wrong.
SMALL = {
    "seed": 5,
    "crop": "pea",
    "angle": 28.0,
    "height": 40.0,
    "size": (1000, 750),
    "focal": 950.0,
    "position": (0.0, -520.0, 45.0),
    "aim": (-60.0, 0.0, 50.0),
    "sheet_left": -240.0,
    "wall": PALETTE["white"],
    "ground": PALETTE["blue"],
}
TILTED = {
    "rotation": (0.0, 0.0, 14.0),
    "crop": "goji",
    "height": 55.0,
    "wall": PALETTE["green"],
    "angle": 33.0,
    "position": (0.0, -680.0, 60.0),
    "sheet_left": -280.0,
    "aim": (-80.0, 0.0, 50.0),
}
CLOTH = {
    "crop": "maize",
    "texture": "cloth",
    "ground": PALETTE["black"],
    "loose": 12,
    "uneven": 0.4,
}
GOOD = (
    ({}, "a plain wall"),
    (TILTED, "tilted by 14°"),
    (CLOTH | {"ruler": "standing"}, "cloth, loose grains, a ruler"),
    (
        {"crop": "wheat", "hand": 0.45, "shadow": 0.5, "wall": PALETTE["grey"]},
        "the shadow of a hand",
    ),
)
BAD = (
    ({"aim": (-170.0, 0.0, 50.0), "focal": 1500.0}, "runs out of the picture"),
    ({"sheet_left": -130.0}, "the sheet hides a part"),
    ({"position": (0.0, -520.0, 190.0)}, "the crest from 17 degrees above"),
    (
        {"wall": (60, 150, 95), "ground": (60, 150, 95), "texture": "speckle"},
        "background is not plain",
    ),
)


def measured(folder, scene, name="pile"):
    path = Path(folder) / f"{name}.png"
    cv2.imwrite(str(path), photograph(scene))
    return photographs.measure_photographs(
        [path],
        MeasureSettings.with_defaults(berry_height_mm=scene.berry_mm),
        photographs.Scale(),
    )[0]


def picture(path):
    """Draw four photographs that are measured, what was found in them, and four that are refused."""
    import matplotlib.pyplot as plt

    canvas, axes = plt.subplots(
        3, 4, figsize=(7.5, 4.3), height_ratios=(3, 1.4, 3), layout="constrained"
    )
    with tempfile.TemporaryDirectory() as folder:
        for column, (change, title) in enumerate(GOOD):
            photograph = measured(folder, Scene(**SMALL | change))
            axes[0, column].imshow(cv2.imread(str(photograph.path))[..., ::-1])
            axes[0, column].set_title(title, fontsize=8)
            axes[1, column].imshow(
                overlay(photograph.view, photograph.measurement)[..., ::-1]
            )
            found = photograph.measurement
            axes[1, column].set_title(
                f"{found.aor_deg:.1f}°, Height {found.height_mm:.1f} mm", fontsize=8
            )
        for column, (change, reason) in enumerate(BAD):
            photograph = measured(folder, Scene(**SMALL | change))
            axes[2, column].imshow(cv2.imread(str(photograph.path))[..., ::-1])
            axes[2, column].set_title(f"refused:\n{reason}", fontsize=7.5)
            if reason not in photograph.rejection_reason:
                raise AssertionError(f"{reason}: {photograph.rejection_reason}")
    for axis in axes.flat:
        axis.set_axis_off()
    canvas.savefig(path, dpi=144)


def report(draw, missed):
    """Print what was refused and the row of a table; returns the errors of the others."""
    for number, outcome in sorted(missed.items()):
        if isinstance(outcome, str):
            print(f"  {number}: {outcome}")
    found = np.array(
        [outcome for outcome in missed.values() if not isinstance(outcome, str)]
    )
    mean = found.mean(0)
    sd = found.std(0, ddof=1)
    most = np.abs(found).max(0)
    cells = [
        f"{mean[k]:+.2f} ± {sd[k] / len(found) ** 0.5:.2f} | {most[k]:.2f}"
        for k in range(2)
    ]
    print(" | ".join(["", str(draw), str(len(found)), *cells, ""]).strip(), flush=True)
    return found


def main():
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--draw", type=int, nargs="+", default=[])
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args()
    if asked.picture:
        picture(asked.picture)
    for draw in asked.draw:
        with tempfile.TemporaryDirectory() as folder:
            report(draw, errors(Path(folder), draw=draw))


if __name__ == "__main__":
    main()
