"""The thirty photographs that the measurement is judged by: ten of each of three cameras, and the sheet alone."""

import numpy as np
from rendered import CROPS, Scene

PALETTE = {  # walls and plates, blue first
    "white": (225, 228, 230),
    "grey": (140, 142, 145),
    "blue": (170, 105, 55),
    "wood": (95, 140, 185),
    "green": (95, 140, 80),
    "black": (45, 45, 48),
}
CAMERAS = (  # size, focal length in widths, k1 and k2
    ((1600, 1200), 0.80, (0.0, 0.0)),
    ((1680, 1260), 0.95, (-0.12, 0.02)),
    ((1520, 1140), 1.40, (0.08, -0.02)),
)


def scenes(camera):
    """Ten scenes of one of three cameras; conditions are drawn at random, each disturbance in about half of them.

    Parameters
    ----------
    camera : int
        From 0.

    Returns
    -------
    list of Scene
    """
    size, focal, distortion = CAMERAS[camera]
    made = []
    for k in range(10):
        number = 10 * camera + k
        rng = np.random.default_rng([2026, number])
        crop = list(CROPS)[number % len(CROPS)]
        angle, height = rng.uniform(24, 40), rng.uniform(45, 70)
        width_mm = 2 * height / np.tan(np.radians(angle)) + 330
        half = 0.5 * width_mm - 165
        left = -half - 170 - rng.uniform(0, 20)
        away = focal * (half + 120 - left) * rng.uniform(1.1, 1.3)
        side = rng.uniform(-0.15, 0.15) * away
        colours = [PALETTE[name] for name in rng.choice(list(PALETTE), 2)]
        made.append(
            Scene(
                seed=number, crop=crop, angle=angle, height=height, wall=colours[0], ground=colours[1],
                texture=("plain", "cloth", "wood", "speckle")[number % 4],
                position=(side, -away, height + np.tan(np.radians(rng.uniform(-2, 5))) * away),
                aim=(0.5 * (half + 60 + left), 0, 60), rotation=(*rng.uniform(-4, 4, 2), rng.uniform(-15, 15)),
                distortion=distortion, size=size, focal=focal * size[0], wall_at=rng.uniform(150, 500),
                uneven=rng.uniform(0, 0.5), shadow=rng.uniform(0.2, 0.6),
                hand=rng.choice([0, 1]) * rng.uniform(0.25, 0.5), loose=int(rng.choice([0, 1]) * rng.integers(3, 16)),
                ruler=str(rng.choice(["", "standing"])), sheet_left=left, sheet_yaw=rng.uniform(-1, 1),
            )
        )  # fmt: skip
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
                seed=100 + 10 * camera + k, aim=(130 * u, 0, 90 + 60 * v), rotation=(0, 0, rng.uniform(-10, 10)),
                position=(rng.uniform(-0.4, 0.4) * away, -away, rng.uniform(80, 260)), distortion=distortion,
                size=size, focal=focal * size[0], with_pile=False, sheet_left=-70, sheet_yaw=rng.uniform(-25, 25),
            )
        )  # fmt: skip
    return made
