"""Sixty photographs by the renderer `pinhole`: all at random, and something wrong with every fifth.

`pytest -n0 -m slow -s -k all_sixty` measures them and prints how many are measured, refused, and wrong in silence.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image
from pinhole import Heap, Scene, Truth, photograph, truth

from repose.measure.photographs import photograph as photographs
from repose.measure.photographs import sheet
from repose.measure.photographs.drawing import draw_rejected_overlay, overlay
from repose.measure.settings import MeasureSettings

NUMBER = 60
GRAINS = {  # colour, blue first; axes [mm]
    "goji": ((38, 44, 190), (19.0, 11.0, 10.0)),
    "wheat": ((92, 150, 196), (6.6, 3.4, 3.0)),
    "maize": ((40, 165, 225), (11.0, 8.5, 5.5)),
    "rice": ((238, 240, 242), (6.8, 2.9, 2.3)),
    "bean": ((30, 28, 32), (9.5, 6.8, 5.6)),
    "pea": ((70, 170, 110), (7.6, 7.4, 7.2)),
}
BACKGROUNDS = (
    (235, 236, 238),
    (28, 27, 26),
    (140, 142, 145),
    (170, 105, 55),
    (95, 140, 185),
    (95, 140, 80),
)
TROUBLE = (
    "two heaps",
    "two that touch",
    "a layer",
    "a level top",
    "cut off",
    "no heap",
)
SEEN = 10.0  # CIE 1976: from this difference of colours an eye sees the outline of a heap of grains
WRONG = 2.0, 3.0  # degrees, mm


class Outcome(NamedTuple):
    number: int
    trouble: str  # what is wrong with the scene; may be empty
    plain: bool  # an eye sees the outline
    refused: str
    note: str
    angle: float  # measured minus true, degrees; NaN if refused
    height: float  # the same in mm

    @property
    def wrong(self) -> bool:
        """Whether the numbers are off, or belong to no heap."""
        inaccurate = abs(self.angle) > WRONG[0] or abs(self.height) > WRONG[1]
        return not self.refused and (inaccurate or self.trouble in TROUBLE[2:])


def scene(number: int) -> Scene:
    rng = np.random.default_rng([2031, number])
    colour, axes = GRAINS[list(GRAINS)[number % len(GRAINS)]]
    angle = rng.uniform(24, 36)
    height = rng.uniform(42, 65)
    heap = Heap(0.0, 0.0, height, angle, foot=rng.choice([0.0, 1.5]))
    half = heap.half
    left = -heap.half - rng.uniform(160, 185)
    right = heap.half + rng.uniform(40, 70)
    away = float(np.exp(rng.uniform(np.log(450), np.log(5000))))
    middle = 0.5 * (left - 20 + right)
    heaps: tuple = (heap,)
    match trouble(number):
        case "two heaps":
            heaps = heap, Heap(1.1 * half + 40, 10.0, 0.6 * height, angle)
            right += 110
        case "two that touch":
            heaps = heap, Heap(0.75 * half, 0.0, 0.75 * height, angle)
            right += 40
        case "a layer":
            heaps = (Heap(0.0, 0.0, 8.0, 60.0, flat=90.0),)
        case "a level top":
            heaps = (Heap(0.0, 0.0, 0.5 * height, angle, flat=0.5 * half),)
        case "cut off":
            middle -= 0.5 * half + right - half
        case "no heap":
            heaps = (Heap(0.0, 0.0, 1e-3, angle),)
    walls = rng.permutation(len(BACKGROUNDS))[:2]
    return Scene(
        seed=number,
        heaps=heaps,
        axes=axes,
        colour=colour,
        wall=BACKGROUNDS[walls[0]],
        plate=BACKGROUNDS[walls[1]],
        eye=(
            rng.uniform(-0.06, 0.06) * away,
            -away,
            rng.uniform(0.3, 1.1) * height + 0.02 * away * rng.uniform(-0.2, 1),
        ),
        aim=(middle, 0.0, rng.uniform(45, 75)),
        roll=rng.uniform(-8, 8),
        size=(880, 660),
        focal=880 * away / (right - left + 60),
        wall_at=rng.uniform(150, 500),
        shadow=rng.uniform(0.1, 0.6),
        uneven=rng.uniform(0, 0.5),
        texture=rng.uniform(0.005, 0.04),
        noise=rng.uniform(1, 4),
        blur=rng.uniform(0.4, 1.2),
        loose=12 if trouble(number) == "no heap" else int(rng.choice([0, 6])),
        left=left,
    )


def trouble(number: int) -> str:
    """What is wrong with a scene: something with every fifth one."""
    return TROUBLE[number // 5 % len(TROUBLE)] if number % 5 == 4 else ""


def plain(drawn: Scene) -> bool:
    """Whether an eye sees the outline of the pile: grains differ from wall and table."""
    colours = (
        np.array([[0.8 * np.array(drawn.colour), drawn.wall, drawn.plate]], np.float32)
        / 255
    )
    grain, *behind = cv2.cvtColor(colours, cv2.COLOR_BGR2Lab)[0]
    return bool(min(np.linalg.norm(grain - other) for other in behind) > SEEN)


def saved(
    path: Path, make: Callable[[], np.ndarray], focal: float | None, **options: int
) -> Path:
    """The file of a photograph, drawn if it is not there; its EXIF entry may state the focal length (in its width)."""
    if not path.exists():
        exif = Image.Exif()
        if focal:
            exif[0x8769] = {0xA405: round(36 * focal)}
        Image.fromarray(make()[..., ::-1]).save(path, exif=exif, **options)
    return path


def show(found: photographs.Photograph, path: Path) -> None:
    """Draw what was found in a photograph beside it."""
    seen = found.measurement
    shown = (
        overlay(found.view, seen)
        if seen is not None
        else draw_rejected_overlay(found.view, found.pile)
    )
    cv2.imwrite(str(path.with_name(f"{path.stem}_found.png")), shown)


def measured(
    drawn: Scene, path: Path, focal_stated: bool = False
) -> photographs.Photograph:
    """The photograph, drawn if it is not there, and measured."""
    settings = MeasureSettings.with_defaults(berry_height_mm=drawn.grain_mm)
    focal = drawn.focal / max(drawn.size) if focal_stated else None
    path = saved(
        path,
        lambda: photograph(drawn, sheet.draw_sheet(), sheet.compute_size_mm()),
        focal,
    )
    return photographs.measure_photographs([path], settings, photographs.Scale())[0]


def outcome(number: int, folder: Path) -> Outcome:
    """Draw a photograph into a folder and measure it; what was found in it lies beside it."""
    drawn = scene(number)
    found = measured(drawn, folder / f"{number}.png")
    seen = found.measurement
    missed = (np.nan, np.nan)
    if seen is not None:
        true = (
            truth(drawn)
            if trouble(number) not in TROUBLE[2:]
            else Truth(np.nan, np.nan)
        )
        missed = seen.aor_deg - true.angle, seen.height_mm - true.height
    show(found, folder / f"{number}.png")
    return Outcome(
        number,
        trouble(number),
        plain(drawn),
        # the two sides of these piles are alike: where they differ, a line does not follow
        found.rejection_reason or found.sides_warning,
        found.remarks,
        *missed,
    )


def from_a_distance(away: float, eye: float = 25.0, seed: int = 1) -> Scene:
    """A cone of fine grains, photographed from a distance in mm with the zoom that shows it equally large."""
    return Scene(
        seed,
        heaps=(Heap(0, 0, 36, 30),),
        axes=(2.7, 2.5, 2.3),
        eye=(0, -away, eye),
        aim=(-65, 0, 45),
        left=-215,
        focal=1000 * away / 340,
    )


def silent(made: list[Outcome]) -> list[int]:
    return [
        outcome.number
        for outcome in made
        if outcome.wrong and photographs.DOUBTFUL not in outcome.note
    ]


def lost(made: list[Outcome]) -> list[int]:
    """Numbers of the photographs that are refused though an eye would measure them."""
    return [
        outcome.number
        for outcome in made
        if outcome.refused and outcome.plain and not outcome.trouble
    ]


def report(made: list[Outcome]) -> str:
    good = np.array(
        [
            outcome[-2:]
            for outcome in made
            if not outcome.refused and not outcome.trouble
        ]
    )
    mean = good.mean(0)
    most = np.abs(good).max(0)
    measured = sum(not outcome.refused for outcome in made)
    return (
        f"{measured} of {len(made)} measured; wrong in silence {silent(made)}; refused though an eye would measure "
        f"{lost(made)}; heaps: {mean[0]:+.2f} deg, {mean[1]:+.2f} mm, largest {most[0]:.2f}, {most[1]:.2f}"
    )
