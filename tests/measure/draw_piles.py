"""Drawn photographs of piles for readers without piles: grains are poured with hidden parameters.

In a crop's folder, where config.yaml and sizes.csv are filled in but for the targets:
`python CHECKOUT/tests/measure/draw_piles.py` writes photographs/pile_1.jpg to pile_5.jpg.
"""

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

import cv2
import numpy as np
import yaml
from rendered import CROPS, Scene, photograph

from repose.cli import main as repose

HIDDEN = {
    "e_gg": 0.5,
    "mus_gg": 0.5,
    "mur_gg": 0.08,
    "e_gp": 0.5,
    "mus_gp": 0.8,
    "mur_gp": 0.3,
}
NO_TARGET = {
    "response": "height_mm",
    "value": 50.0,
    "sd": 1.0,
    "repetitions": 5,
    "range": [1.0, 99.0],
}
FIRST_SEED = 2001
SIZE = (1600, 1200)  # of a photograph: each pile is more than 80 pixels high
# blue first
TABLE = (140, 142, 145)
WALL = (170, 105, 55)


def pour(config: str, count: int) -> tuple[dict, np.lib.npyio.NpzFile]:
    crop = yaml.safe_load(Path(config).read_text()) | {
        "targets": [NO_TARGET],
        "photograph": None,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hidden.yaml"
        path.write_text(yaml.safe_dump(crop))
        options = [f"--set={name}={value}" for name, value in HIDDEN.items()]
        options += [f"--seed={seed}" for seed in range(FIRST_SEED, FIRST_SEED + count)]
        arguments = ["stage", "pour", "--apparatus", "funnel", "--config", str(path)]
        # The stage prints the path of its file, which lies in the temporary folder.
        with contextlib.redirect_stdout(io.StringIO()):
            status = repose([*arguments, *options, "--out", folder])
        if status:
            raise SystemExit(status)
        record = json.loads((Path(folder) / "heap.pours.json").read_text())
        with np.load(Path(folder) / "heap.npz") as saved:
            return record, {name: saved[name] for name in saved.files}


def scene(crop: str, arrays: dict, number: int) -> Scene:
    """A pile on a grey table before a blue wall, the sheet to its left, the camera a little tilted."""
    seed = FIRST_SEED + number - 1
    kept = arrays[f"in_pile_{seed}"]
    centres = 1e3 * arrays[f"position_{seed}"][kept]
    rng = np.random.default_rng([2026, number])
    half = float(np.hypot(*centres.T[:2]).max())
    height = float(centres[:, 2].max())
    left = -half - 180
    return Scene(
        seed=number,
        crop=crop,
        angle=25.0,
        height=height,
        wall=WALL,
        ground=TABLE,
        texture="cloth",
        position=(
            rng.uniform(-20, 20),
            -0.95 * (half + 90 - left) * rng.uniform(1.05, 1.15),
            height + 15,
        ),
        aim=(0.5 * (half + 60 + left), 0, 50),
        rotation=(0.0, 0.0, rng.uniform(-4, 4)),
        size=SIZE,
        focal=0.9 * SIZE[0],
        uneven=rng.uniform(0, 0.4),
        sheet_left=left,
        simulated_grains=(
            centres,
            arrays[f"quaternion_{seed}"][kept],
            np.ones(len(centres)),
        ),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--crop", choices=CROPS, default="pea", help="its colour and axes (pea)"
    )
    parser.add_argument("--config", default="config.yaml")
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--out", default="photographs")
    args = parser.parse_args()
    _, arrays = pour(args.config, args.count)
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    for number in range(1, args.count + 1):
        picture = photograph(scene(args.crop, arrays, number))
        cv2.imwrite(
            str(out / f"pile_{number}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 90]
        )
        print(f"{out}/pile_{number}.jpg")


if __name__ == "__main__":
    main()
