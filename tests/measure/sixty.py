"""Sixty photographs drawn at random: cameras, distances, tones and piles; with every third one something is wrong.

`python tests/measure/sixty.py` draws and measures them and prints how many are measured, refused, and wrong in silence.
"""

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from rendered import CROPS, Scene, photograph, truth

from repose.measure import photographs
from repose.measure.settings import MeasureSettings

NUMBER = 60
CAMERAS = (  # size, focal length in widths, k1 and k2, number of photographs of the sheet alone
    ((1600, 1200), 0.80, (0.0, 0.0), 0),
    ((1280, 960), 0.75, (-0.10, 0.02), 5),
    ((1400, 1050), 1.50, (0.06, -0.02), 5),
    ((1200, 900), 2.80, (0.0, 0.0), 5),
    ((800, 600), 0.80, (0.0, 0.0), 0),
)
TROUBLE = ("a box behind the pile", "a heap beside it", "a heap that touches it", "cut off")
SEEN = 10.0  # difference of colours, CIE 1976, from which an eye sees the outline of a heap of grains
WRONG = 2.0, 3.0  # degrees, mm


class Outcome(NamedTuple):
    """What came of a photograph."""

    number: int
    trouble: str  # what is wrong with the picture; may be empty
    plain: bool  # an eye would measure it
    refused: str
    note: str
    angle: float  # measured minus true, degrees; NaN if refused
    height: float  # the same in mm


def scene(number: int, draw: int) -> Scene:
    """One of the photographs; conditions are drawn at random."""
    size, focal, distortion, _ = CAMERAS[number % len(CAMERAS)]
    rng = np.random.default_rng([2029, draw, number])
    crop = str(rng.choice(list(CROPS)))
    angle, height, foot = rng.uniform(24, 38), rng.uniform(35, 70), rng.choice([0, 1]) * rng.uniform(1, 5)
    half = (height + 2 * foot) / np.tan(np.radians(angle))
    left = -half - rng.uniform(160, 190)
    margin = rng.uniform(40, 110)
    away = max(focal * (half + 2 * margin - left), 380.0)
    made = {
        "seed": 1000 * draw + number,
        "crop": crop,
        "angle": angle,
        "height": height,
        "foot": foot,
        "wall": tone(rng),
        "ground": tone(rng),
        "texture": str(rng.choice(["plain", "cloth", "wood", "speckle"])),
        "position": (rng.uniform(-0.12, 0.12) * away, -away, rng.uniform(0.2, 1.1) * height),
        "aim": (0.5 * (half + left), 0, rng.uniform(40, 70)),
        "rotation": (*rng.uniform(-2, 2, 2), rng.uniform(-10, 10)),
        "distortion": distortion,
        "size": size,
        "focal": focal * size[0],
        "wall_at": rng.uniform(150, 600),
        "uneven": rng.uniform(0, 0.5),
        "shadow": rng.uniform(0.1, 0.6),
        "hand": rng.choice([0, 0, 1]) * rng.uniform(0.2, 0.5),
        "loose": int(rng.choice([0, 1]) * rng.integers(3, 16)),
        "ruler": str(rng.choice(["", "", "standing"])),
        "sheet_left": left,
        "sheet_yaw": rng.uniform(-1, 1),
    }
    match trouble(number):
        case "a box behind the pile":
            middle, wide = rng.uniform(-0.8, 0.8) * half, rng.uniform(30, 120)
            high = rng.uniform(0.7, 1.5) * height
            made["box"] = (middle - wide / 2, middle + wide / 2, high, half + rng.uniform(20, 80))
        case "a heap beside it":
            high = rng.uniform(0.4, 1.0) * height
            made["second"] = (
                half + high / np.tan(np.radians(angle)) + rng.uniform(5, 40),
                rng.uniform(-30, 60),
                high,
            )
            made["aim"] = (made["aim"][0] + 60, *made["aim"][1:])
        case "a heap that touches it":
            high = rng.uniform(0.4, 0.9) * height
            made["second"] = (rng.uniform(0.7, 1.1) * half, rng.uniform(-20, 40), high)
        case "cut off":
            made["aim"] = (made["aim"][0] - rng.uniform(0.55, 0.9) * (half + margin), *made["aim"][1:])
    return Scene(**made)


def trouble(number: int) -> str:
    """What is wrong with a photograph: something with every third one."""
    return TROUBLE[number // 3 % len(TROUBLE)] if number % 3 == 2 else ""


def tone(rng: np.random.Generator) -> tuple[float, ...]:
    """Colour of a wall or a table, blue first: grey or coloured, dark or light."""
    light = rng.uniform(25, 230)
    return tuple(np.clip(light * (1 + rng.choice([0.02, 0.35]) * rng.uniform(-1, 1, 3)), 12, 235))


def plain(one: Scene) -> bool:
    """Whether an eye sees the outline of the pile: grains differ from wall and table."""
    colours = np.array([[0.8 * np.array(CROPS[one.crop][0]), one.wall, one.ground]], np.float32) / 255
    grain, *behind = cv2.cvtColor(colours, cv2.COLOR_BGR2Lab)[0]
    return bool(min(np.linalg.norm(grain - other) for other in behind) > SEEN)


def sheets_alone(camera: int) -> list[Scene]:
    """Scenes of a camera with the sheet alone, in all parts of the picture."""
    size, focal, distortion, count = CAMERAS[camera]
    made = []
    for k, (u, v) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1), (0, 0))[:count]):
        rng = np.random.default_rng([2030, camera, k])
        away = focal * 420.0
        made.append(
            Scene(
                seed=k, aim=(130 * u, 0, 90 + 60 * v), rotation=(0, 0, rng.uniform(-10, 10)), distortion=distortion,
                position=(rng.uniform(-0.4, 0.4) * away, -away, rng.uniform(80, 260)), size=size,
                focal=focal * size[0], with_pile=False, sheet_left=-70, sheet_yaw=rng.uniform(-25, 25),
            )
        )  # fmt: skip
    return made


def outcomes(folder: Path, draw: int, numbers: range = range(NUMBER)) -> list[Outcome]:
    """Draw photographs into a folder, unless they are there, and measure them."""
    lens = {}
    for camera in sorted({number % len(CAMERAS) for number in numbers}):
        lens[camera] = [folder / f"lens_{camera}_{k}.png" for k in range(CAMERAS[camera][3])]
        for path, alone in zip(lens[camera], sheets_alone(camera), strict=True):
            if not path.exists():
                cv2.imwrite(str(path), photograph(alone))
    made = []
    for number in numbers:
        one, path = scene(number, draw), folder / f"{draw}_{number}.png"
        if not path.exists():
            cv2.imwrite(str(path), photograph(one))
        how = MeasureSettings(berry_height_mm=one.berry_mm)
        found = photographs.measure_all([path], how, photographs.Scale(), lens[number % len(CAMERAS)])[0]
        missed = np.nan, np.nan
        if found.measurement is not None:
            true = truth(one, how)
            missed = found.measurement.aor_deg - true.aor_deg, found.measurement.height_mm - true.height_mm
        made.append(Outcome(number, trouble(number), plain(one), found.refused, found.note, *missed))
    return made


def main() -> None:
    """Print the outcome of every photograph, and the counts."""
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("--draw", type=int, default=0)
    words.add_argument("--folder", type=Path, help="keeps the photographs")
    words.add_argument("--numbers", type=int, nargs="+", default=range(NUMBER))
    asked = words.parse_args()
    with tempfile.TemporaryDirectory() as kept:
        made = outcomes(asked.folder or Path(kept), asked.draw, asked.numbers)
    for one in made:
        result = one.refused or f"{one.angle:+.2f} deg {one.height:+.2f} mm"
        print(
            f"{one.number:2d} {one.trouble or '-'}; {'plain' if one.plain else 'not plain'}; {result}; {one.note}"
        )
    measured = [one for one in made if not one.refused]
    wrong = [one for one in measured if abs(one.angle) > WRONG[0] or abs(one.height) > WRONG[1]]
    silent = [one.number for one in wrong if not one.note]
    could = [one.number for one in made if one.refused and one.plain and not one.trouble]
    print(
        f"{len(measured)} of {len(made)} measured; wrong {len(wrong)}, in silence {len(silent)} {silent}; ",
        end="",
    )
    print(f"refused though an eye would measure it {len(could)} {could}")


if __name__ == "__main__":
    main()
