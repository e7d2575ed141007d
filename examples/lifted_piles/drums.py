"""The drums of the other project, upright and tilted: filled, turned and measured as its decks say.

    python examples/lifted_piles/drums.py ROW SEED [--tilted] [--grain wheat] [--walls smooth]

runs row ROW of parameters.csv, and writes its numbers to results/examples/lifted_piles. README.md says what differs.
"""

import argparse
import math
import time

import numpy as np
import pandas as pd
from lifted_piles import (
    DENSITY_KG_M3,
    DIAMETERS_MM,
    FALLING_M_S,
    FEWEST_IN_SHELL,
    HERE,
    LAWS,
    NUMBERS,
    OUT,
    POISSON,
    PUBLISHED,
    ROUNDS,
    SHELL,
    STEP_FRACTION,
    TRIMMED,
    WINDOW,
    YOUNG_PA,
    Contents,
    Grains,
    line_of,
    rings,
)
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from repose.bench.drum import Drum
from repose.common.files import read_json, write_json
from repose.common.provenance import engine_hash
from repose.dem import Contact, Material, Motion, Shape, Simulation
from repose.dem.rotations import random_quaternion

DRUM = Drum(radius_m=0.075, length_m=0.025)
COVER = (
    0.36,
    0.29,
)  # static and rolling friction of covers, and of all of the tilted drum
GRAINS, PERIOD_S = 4600, 12.0
REGION_M = (0.0735, 0.011)  # radius and half length that take the grains
FILLED_S, REFILLED_S, TRIES = 0.8, 0.1, 50
FRAME_S = 0.2
SPUN_S, FRAMES = {False: 3.0, True: 7.0}, {False: 17, True: 33}  # by tilted
SLAB_M = (-0.0135, -0.0051)  # the grains at the lower cover of the tilted drum
FEWEST_BINS = 4
# Walls of the tilted drum: the first are theirs. The covers of the last do not turn.
WALLS = ("cover", "smooth", "grains", "standing")
WHEAT_MM = np.array(
    [6.75, 3.26, 2.77]
)  # axes of wheat (crops/wheat), here of the volume of the sphere
MOST_REFILLS = 60  # long grains need more room where they are thrown in


def of_shape(grain: str, radius_m: float) -> np.ndarray:
    """Semi-axes (3,) of a grain with the volume of a sphere [m]."""
    return radius_m * (
        WHEAT_MM / np.prod(WHEAT_MM) ** (1 / 3) if grain == "wheat" else np.ones(3)
    )


def drum(
    contents: Contents,
    seed: int,
    tilted: bool,
    modulus: float = 1.0,
    grains: int = GRAINS,
    grain: str = "sphere",
    wall: str = WALLS[0],
) -> Simulation:
    """The drum, filled in steps of 0.1 s and at rest."""
    axes_m, rng = (
        of_shape(grain, 5e-4 * DIAMETERS_MM.max()),
        np.random.default_rng(seed),
    )
    shape = Shape.sphere(axes_m[0], DENSITY_KG_M3, "wheat")
    if grain == "wheat":
        shape = Shape.ellipsoid(axes_m, DENSITY_KG_M3, "wheat")
    friction = {"smooth": (0.0, 0.0), "grains": (contents.fric, contents.rollfric)}.get(
        wall, COVER
    )
    walls = DRUM.walls("cover")
    if not tilted:
        walls |= {"shell": DRUM.walls("wheat")["shell"]}
    material = Material(modulus * YOUNG_PA / (2.0 + 2.0 * POISSON), POISSON)
    half = np.array([DRUM.radius_m, 0.5 * DRUM.length_m, DRUM.radius_m])
    down = math.radians(45.0 if tilted else 0.0)

    def empty(step_s: float) -> Simulation:
        return Simulation(
            shapes={"grain": shape},
            materials={"wheat": material, "cover": material},
            contacts={
                ("wheat", "wheat"): Contact(
                    contents.rest,
                    contents.fric,
                    contents.rollfric,
                    twisting_friction=0.0,
                ),
                ("wheat", "cover"): Contact(
                    contents.rest, *friction, twisting_friction=0.0
                ),
            },
            time_step_s=step_s,
            capacity=grains,
            lower=-half,
            upper=half,
            walls=walls,
            gravity_m_s2=(0.0, -9.81 * math.sin(down), -9.81 * math.cos(down)),
            **LAWS,
        )

    scale = DIAMETERS_MM.min() / DIAMETERS_MM.max()
    simulation = empty(STEP_FRACTION * scale * empty(1e-7).longest_time_step())
    longest = axes_m.max() / (5e-4 * DIAMETERS_MM.max())
    refills = round(FILLED_S / REFILLED_S)
    for refill in range(refills if grain == "sphere" else MOST_REFILLS):
        missing = grains - simulation.n_bodies
        if refill >= refills and not missing:
            break
        sizes_mm = np.sort(
            rng.choice(DIAMETERS_MM, missing, p=np.array(NUMBERS) / sum(NUMBERS))
        )[::-1]
        before = Grains.of(simulation)
        for size_mm, centre in thrown(
            before.centres_m, longest * before.radii_m, longest * sizes_mm, rng
        ):
            scale, turn = size_mm / longest / DIAMETERS_MM.max(), (1.0, 0.0, 0.0, 0.0)
            if grain == "wheat":
                turn = random_quaternion(rng)
            simulation.add("grain", centre, turn, (0.0, 0.0, -FALLING_M_S), scale=scale)
        simulation.run(REFILLED_S, progress=False)
    return simulation


def seen(simulation: Simulation, grain: str) -> Grains:
    """Grains as spheres of their volume whose tops are those of the grains."""
    now = Grains.of(simulation)
    if grain == "wheat":
        turns = Rotation.from_quat(simulation.quaternions, scalar_first=True)
        up = turns.as_matrix()[:, 2] * of_shape(grain, 1.0)
        now.centres_m[:, 2] += now.radii_m * (np.linalg.norm(up, axis=1) - 1.0)
    return now


def thrown(
    centres_m: np.ndarray,
    radii_m: np.ndarray,
    sizes_mm: np.ndarray,
    rng: np.random.Generator,
) -> list[tuple]:
    """Sizes and centres of those of the spheres that find room among others, each with 50 tries."""
    found: list[tuple] = []
    for size_mm in sizes_mm:
        r = 5e-4 * size_mm
        out, turn, along = rng.random((3, TRIES))
        out, turn = (REGION_M[0] - r) * np.sqrt(out), 2.0 * math.pi * turn
        places = np.column_stack(
            [
                out * np.cos(turn),
                (REGION_M[1] - r) * (2.0 * along - 1.0),
                out * np.sin(turn),
            ]
        )
        free = np.flatnonzero((cdist(places, centres_m) > radii_m + r).all(axis=1))
        if len(free):
            found.append((size_mm, places[free[0]]))
            centres_m, radii_m = (
                np.vstack([centres_m, places[free[0]]]),
                np.append(radii_m, r),
            )
    return found


def frame_angle(grains: Grains, tilted: bool = False) -> float:
    """Angle of the surface of one frame [deg], along the drum's axis; of a tilted drum at its lower cover."""
    along = grains.centres_m[:, 1]
    if tilted:
        grains = Grains(
            *(values[(along >= SLAB_M[0]) & (along <= SLAB_M[1])] for values in grains)
        )
    width, tops, x = grains.median_m, grains.tops_m, grains.centres_m[:, 0]
    middles, heights = rings(x - x.min(), tops, width)
    middles = middles + x.min()
    low, high = (middles.min() + share * np.ptp(middles) for share in WINDOW)
    chord = (middles >= low) & (middles <= high)
    if chord.sum() < FEWEST_BINS:
        chord[:] = True
    line = line_of(middles[chord], heights[chord])
    off = heights - np.polyval(line, middles)
    near = chord & (np.abs(off) <= TRIMMED * off[chord].std())
    if FEWEST_BINS <= near.sum() < chord.sum():
        line = line_of(middles[near], heights[near])
    for _ in range(ROUNDS):
        shell = (
            (x >= low)
            & (x <= high)
            & (np.abs(tops - np.polyval(line, x)) <= SHELL * width)
        )
        if shell.sum() < FEWEST_IN_SHELL:
            break
        line = line_of(x[shell], tops[shell])
    return math.degrees(math.atan(abs(line[0])))


def turned(
    simulation: Simulation, tilted: bool, grain: str = "sphere", wall: str = WALLS[0]
) -> list[float]:
    """Turn the drum and its covers, and measure the frames after the start."""
    for part in DRUM.walls("cover"):
        if part == "shell" or wall != "standing":
            simulation.set_motion(
                part,
                Motion(angular_velocity_rad_s=(0.0, 2.0 * math.pi / PERIOD_S, 0.0)),
            )
    simulation.run(SPUN_S[tilted], progress=False)
    angles = [frame_angle(seen(simulation, grain), tilted)]
    while len(angles) < FRAMES[tilted]:
        simulation.run(FRAME_S, progress=False)
        angles.append(frame_angle(seen(simulation, grain), tilted))
    return angles


def rows(tilted: bool) -> pd.DataFrame:
    """The parameters of the drums, by the number of their row."""
    table = pd.read_csv(HERE / "parameters.csv")
    return table[table["test"] == ("tilted_drum" if tilted else "drum")].set_index(
        "row"
    )


def name(
    row: int,
    seed: int,
    modulus: float,
    tilted: bool,
    grain: str = "sphere",
    wall: str = WALLS[0],
) -> str:
    """Name of a drum's file."""
    other = "" if (grain, wall) == ("sphere", WALLS[0]) else f"_{grain}_{wall}"
    return (
        f"{'tilted' if tilted else 'drum'}_{row}_seed_{seed}_modulus_{modulus:g}{other}"
    )


def measured(
    contents: Contents,
    seed: int,
    tilted: bool,
    modulus: float = 1.0,
    grain: str = "sphere",
    wall: str = WALLS[0],
) -> dict:
    """Run a drum, and measure its angle."""
    began = time.process_time()
    simulation = drum(contents, seed, tilted, modulus, grain=grain, wall=wall)
    angles = turned(simulation, tilted, grain, wall)
    return {
        "angle_deg": float(np.mean(angles)),
        "frames_sd_deg": float(np.std(angles, ddof=1)),
        "angles_deg": angles,
        "grains": simulation.n_bodies,
        "left": int((~DRUM.contains(simulation.positions)).sum()),
        "time_step_s": simulation.time_step_s,
        "processor_s": time.process_time() - began,
        "engine": engine_hash(),
    }


def one(
    row: int,
    seed: int,
    modulus: float,
    tilted: bool,
    grain: str = "sphere",
    wall: str = WALLS[0],
) -> dict:
    """Run and measure a drum, or read the file that has it."""
    path = OUT / f"{name(row, seed, modulus, tilted, grain, wall)}.json"
    for kept in (path, PUBLISHED / path.name):
        if kept.exists():
            return read_json(kept)
    contents = Contents(*rows(tilted).loc[row, list(Contents._fields)])
    record = {
        "row": row,
        "seed": seed,
        "modulus": modulus,
        "grain": grain,
        "walls": wall,
        **contents._asdict(),
    }
    record |= measured(contents, seed, tilted, modulus, grain, wall)
    write_json(path, record)
    return record


def main() -> None:
    """Run one drum and print its numbers."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("row", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument(
        "--tilted", action="store_true", help="by 45 degrees, all walls as the covers"
    )
    parser.add_argument(
        "--modulus",
        type=float,
        default=1.0,
        metavar="FACTOR",
        help="over the modulus of the decks",
    )
    parser.add_argument(
        "--grain",
        choices=("sphere", "wheat"),
        default="sphere",
        help="wheat: an ellipsoid",
    )
    parser.add_argument(
        "--walls",
        choices=WALLS,
        default=WALLS[0],
        help="friction of the tilted drum's walls",
    )
    asked = parser.parse_args()
    for key, value in one(
        asked.row, asked.seed, asked.modulus, asked.tilted, asked.grain, asked.walls
    ).items():
        print(f"{key}: {value}", flush=True)


if __name__ == "__main__":
    main()
