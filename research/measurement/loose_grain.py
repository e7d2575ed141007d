"""How far one loose grain moves the angle of a pile, by every line: it lies or stands at the foot, or on the crest."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from repose.grain.particle import Particle
from repose.measure import pile, saved_pours
from research.measurement.measurement_study import VARIANTS, variants_of

DIRECTIONS_DEG = (0.0, 90.0, 180.0, 270.0)
# Attitude of the grain: the quaternion that turns its longest axis, x of the body, out of the horizontal.
ATTITUDES = {
    "lies": (1.0, 0.0, 0.0, 0.0),
    "stands": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
}


def shifts(
    heaps: Sequence[str | Path], particle: Particle, settings: pile.MeasureSettings
) -> pd.DataFrame:
    """Mean shift of each line's angle [deg] by one grain, with its standard error over piles and directions.

    A row for each line, place (``foot``, ``crest``) and attitude (``lies``, ``stands``). `heaps` are .npz files of the
    bench test funnel; the first good pour of each is taken.
    """
    rows = []
    for path in map(Path, heaps):
        poured = _first_good(path)
        before = variants_of(poured, particle, settings)
        for place, attitude, more in grains_beside(poured, particle):
            after = variants_of(more, particle, settings)
            rows += [
                {
                    "line": name,
                    "place": place,
                    "grain": attitude,
                    "shift": after[name] - before[name],
                }
                for name in VARIANTS
            ]
    table = pd.DataFrame(rows).groupby(["line", "place", "grain"], sort=False)["shift"]
    return table.agg(shift="mean", shift_se="sem", cases="count").reset_index()


def grains_beside(
    poured: Mapping[str, np.ndarray], particle: Particle
) -> Iterator[tuple[str, str, dict[str, np.ndarray]]]:
    """Yield the pile with one grain more: place, attitude and arrays, for each direction at foot and crest."""
    members = np.asarray(poured["in_pile"], bool)
    centres = np.asarray(poured["position"], float)[members]
    quaternions = np.asarray(poured["quaternion"], float)[members]
    top = int(centres[:, 2].argmax())
    for attitude, quaternion in ATTITUDES.items():
        turned = np.array([quaternion])
        up = reach(particle, turned, np.array([0.0, 0.0, 1.0]))[0]
        for azimuth in np.radians(DIRECTIONS_DEG):
            outwards = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
            aside = np.array([-outwards[1], outwards[0], 0.0])
            # of the grains that the new one would touch on its way in, the farthest
            width = reach(particle, turned, aside)[0] + reach(
                particle, quaternions, aside
            )
            in_the_way = np.abs(centres @ aside) < width
            edge = (centres @ outwards + reach(particle, quaternions, outwards))[
                in_the_way
            ].max()
            place = (edge + reach(particle, turned, outwards)[0]) * outwards + [
                0.0,
                0.0,
                up,
            ]
            yield "foot", attitude, _with(centres, quaternions, place, quaternion)
        height = (
            centres[top, 2]
            + reach(particle, quaternions[top : top + 1], np.array([0.0, 0.0, 1.0]))[0]
        )
        place = np.array([*centres[top, :2], height + up])
        yield "crest", attitude, _with(centres, quaternions, place, quaternion)


def reach(
    particle: Particle, quaternions: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Distance (N,) [m] from the centre of each body to its tangent plane in a direction of space."""
    in_body = Rotation.from_quat(quaternions, scalar_first=True).inv().apply(direction)
    return (particle.support_point(in_body) * in_body).sum(axis=1)


def _with(centres, quaternions, place, quaternion):
    """Arrays of a pour with one more grain, all of them the pile."""
    return {
        "position": np.vstack([centres, place]),
        "quaternion": np.vstack([quaternions, quaternion]),
        "in_pile": np.ones(len(centres) + 1, bool),
    }


def _first_good(npz: Path) -> dict[str, np.ndarray]:
    """Arrays of the first pour of a job that can be measured."""
    job = saved_pours.read_pours(npz.with_name(npz.stem + saved_pours.POURS_ENDING))
    seed = next(record["seed"] for record in job["pours"] if record["status"] == "ok")
    return saved_pours.select_pour(saved_pours.read_positions(npz), seed, npz)
