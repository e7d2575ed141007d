"""White rice before grey walls and on grey plates, whose mean tone it has: only its roughness shows the pile.

`pytest -n0 -m slow -s -k twelve_of_rice` measures the photographs of the first twelve seeds and prints their errors.
"""

from pathlib import Path

import numpy as np
import sixty
from pinhole import Heap, Scene, truth

from repose.measure.photographs import photograph as photographs

SEEDS = range(8101, 8113)  # chosen before any of them was measured


def scene(seed: int) -> Scene:
    """A pile with greys, light, size of grains, camera and sheet drawn at random."""
    rng = np.random.default_rng([2032, seed])
    heap = Heap(0.0, 0.0, rng.uniform(44, 58), rng.uniform(26, 36), foot=1.5)
    left = -heap.half - rng.uniform(160, 185)
    right = heap.half + rng.uniform(40, 70)
    away = rng.uniform(500, 1200)
    wide = int(rng.choice([880, 960, 1040, 1200]))
    wall, plate = rng.uniform(120, 220, (2, 1)) + rng.uniform(-3, 3, (2, 3))
    return Scene(
        seed=seed,
        heaps=(heap,),
        axes=tuple(rng.uniform(0.8, 1.2) * np.array((6.8, 2.9, 2.3))),
        colour=sixty.GRAINS["rice"][0],
        wall=tuple(wall),
        plate=tuple(plate),
        eye=(
            rng.uniform(-0.06, 0.06) * away,
            -away,
            rng.uniform(0.4, 1.1) * heap.height + 0.02 * away * rng.uniform(-0.2, 1),
        ),
        aim=(0.5 * (left - 20 + right), 0.0, rng.uniform(45, 70)),
        roll=rng.uniform(-6, 6),
        size=(wide, 3 * wide // 4),
        focal=wide * away / (right - left + 60),
        wall_at=rng.uniform(150, 500),
        shadow=rng.uniform(0.1, 0.6),
        uneven=rng.uniform(0.05, 0.5),
        texture=rng.uniform(0.005, 0.03),
        noise=rng.uniform(1, 3),
        blur=rng.uniform(0.4, 1.0),
        loose=int(rng.choice([0, 6])),
        left=left,
    )


def measured(seed: int, folder: Path) -> photographs.Photograph:
    return sixty.measured(scene(seed), folder / f"{seed}.png")


def errors(seed: int, photograph: photographs.Photograph) -> tuple[float, float]:
    """Measured minus true angle [deg] and Height [mm]."""
    true = truth(scene(seed))
    assert photograph.measurement is not None
    return (
        photograph.measurement.aor_deg - true.angle,
        photograph.measurement.height_mm - true.height,
    )
