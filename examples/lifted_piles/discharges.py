"""The discharges of the other project: the filled tube stands on a plate with a hole, whose plug is drawn down.

    python examples/lifted_piles/discharges.py ROW SEED

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
    EDGE_M,
    FALLING_M_S,
    FILLED_M,
    HERE,
    LAWS,
    NUMBERS,
    OUT,
    POISSON,
    PUBLISHED,
    STEP_FRACTION,
    TUBE_GAP_M,
    TUBE_LENGTH_M,
    TUBE_PANELS,
    TUBE_RADIUS_M,
    UP,
    WINDOW,
    YOUNG_PA,
    Contents,
    diameters_mm,
    line_of,
    places_m,
    tube_radius_m,
)

from repose.common.files import read_json, write_json
from repose.common.provenance import engine_hash
from repose.dem import (
    Contact,
    Cylinder,
    Material,
    Mesh,
    Motion,
    Plane,
    RingEdge,
    Shape,
    Simulation,
)

HOLE_M, PLATE_M = 0.011, 0.046  # radii
PLUG_M, PLUG_HEIGHT_M, PLUG_M_S, DRAWN_S = 0.0135, 0.0008, 0.5, 0.09
LOWEST_M, COUNTED_M = 0.004, -0.030
SETTLED_S, FLOWING_S, SAMPLE_S = 0.4, 1.4, 0.008


def plate() -> Mesh:
    """The plate with its hole, of the panels that theirs has."""
    turn = np.arange(TUBE_PANELS) * (2.0 * math.pi / TUBE_PANELS)
    circle = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(TUBE_PANELS)])
    inner, outer = np.arange(TUBE_PANELS), TUBE_PANELS + np.arange(TUBE_PANELS)
    faces = [
        [inner, outer, np.roll(outer, -1)],
        [inner, np.roll(outer, -1), np.roll(inner, -1)],
    ]
    return Mesh(
        np.vstack([HOLE_M * circle, PLATE_M * circle]),
        np.concatenate([np.transpose(one) for one in faces]),
        "wheat",
        edge_radius_m=EDGE_M,
    )


def closed(
    contents: Contents, seed: int, modulus: float = 1.0, grains: int = sum(NUMBERS)
) -> Simulation:
    """The grains in the air over the closed hole."""
    sizes_mm, largest_m = diameters_mm(grains), 1e-3 * DIAMETERS_MM.max()

    def empty(step_s: float) -> Simulation:
        return Simulation(
            shapes={"grain": Shape.sphere(0.5 * largest_m, DENSITY_KG_M3, "wheat")},
            materials={
                "wheat": Material(modulus * YOUNG_PA / (2.0 + 2.0 * POISSON), POISSON)
            },
            contacts={
                ("wheat", "wheat"): Contact(
                    contents.rest,
                    contents.fric,
                    contents.rollfric,
                    twisting_friction=0.0,
                )
            },
            time_step_s=step_s,
            capacity=grains,
            lower=(-TUBE_RADIUS_M, -TUBE_RADIUS_M, COUNTED_M),
            upper=(TUBE_RADIUS_M, TUBE_RADIUS_M, TUBE_LENGTH_M),
            walls={
                "tube": Cylinder(
                    (0.0, 0.0, TUBE_GAP_M), UP, TUBE_LENGTH_M, tube_radius_m(), "wheat"
                ),
                "plate": plate(),
                "plug": Plane((0.0, 0.0, PLUG_HEIGHT_M), UP, "wheat", PLUG_M - EDGE_M),
                "plug_edge": RingEdge(
                    PLUG_M - EDGE_M, EDGE_M, "wheat", height_m=PLUG_HEIGHT_M - EDGE_M
                ),
            },
            **LAWS,
            exit_height_m=COUNTED_M,
            floor_height_m=COUNTED_M - 0.005,
        )

    scale = sizes_mm.min() / DIAMETERS_MM.max()
    simulation = empty(STEP_FRACTION * scale * empty(1e-7).longest_time_step())
    region = (FILLED_M[0], LOWEST_M, FILLED_M[2])
    for size_mm, centre in zip(
        sizes_mm, places_m(5e-4 * sizes_mm, seed, region), strict=True
    ):
        simulation.add(
            "grain",
            centre,
            velocity_m_s=(0.0, 0.0, -FALLING_M_S),
            scale=size_mm / DIAMETERS_MM.max(),
        )
    return simulation


def opened(simulation: Simulation) -> np.ndarray:
    """Settle, draw the plug down, let the grains run: when each fell through the counted height [s], or infinity."""
    simulation.run(SETTLED_S, progress=False)
    for speed_m_s, seconds in ((PLUG_M_S, DRAWN_S), (0.0, FLOWING_S - DRAWN_S)):
        for part in ("plug", "plug_edge"):
            simulation.set_motion(part, Motion((0.0, 0.0, -speed_m_s)))
        simulation.run(seconds, progress=False)
    return np.where(
        np.isfinite(simulation.exit_times_s), simulation.exit_times_s, math.inf
    )


def rate_g_s(left_s: np.ndarray, masses_g: np.ndarray, until_s: float) -> float:
    """Slope of the mass that has left over time, between 20 and 80 % of all that leaves, sampled every 8 ms."""
    times = np.arange(0.0, until_s + 0.5 * SAMPLE_S, SAMPLE_S)
    order = np.argsort(left_s, kind="stable")
    gone = np.concatenate([[0.0], np.cumsum(masses_g[order])])[
        np.searchsorted(left_s[order], times, side="right")
    ]
    inside = (gone >= WINDOW[0] * gone[-1]) & (gone <= WINDOW[1] * gone[-1])
    if inside.sum() < 5:
        inside = gone > 0.0
    return float(line_of(times[inside], gone[inside])[0])


def rows() -> pd.DataFrame:
    """The parameters of the discharges, by the number of their row."""
    return (
        pd.read_csv(HERE / "parameters.csv")
        .query("test == 'discharge'")
        .set_index("row")
    )


def name(row: int, seed: int, modulus: float) -> str:
    """Name of a discharge's file."""
    return f"discharge_{row}_seed_{seed}_modulus_{modulus:g}"


def measured(contents: Contents, seed: int, modulus: float = 1.0) -> dict:
    """Run a discharge, and measure its rate."""
    began = time.process_time()
    simulation = closed(contents, seed, modulus)
    left_s = opened(simulation)
    masses_g = (
        1e3
        * DENSITY_KG_M3
        * math.pi
        / 6.0
        * (1e-3 * DIAMETERS_MM.max() * simulation.scales) ** 3
    )
    return {
        "rate_g_s": rate_g_s(left_s, masses_g, SETTLED_S + FLOWING_S),
        "left_g": float(masses_g[np.isfinite(left_s)].sum()),
        "early": int((left_s < SETTLED_S).sum()),
        "grains": simulation.n_bodies,
        "time_step_s": simulation.time_step_s,
        "processor_s": time.process_time() - began,
        "engine": engine_hash(),
    }


def one(row: int, seed: int, modulus: float) -> dict:
    """Run and measure a discharge, or read the file that has it."""
    path = OUT / f"{name(row, seed, modulus)}.json"
    for kept in (path, PUBLISHED / path.name):
        if kept.exists():
            return read_json(kept)
    contents = Contents(*rows().loc[row, list(Contents._fields)])
    record = {"row": row, "seed": seed, "modulus": modulus, **contents._asdict()}
    record |= measured(contents, seed, modulus)
    write_json(path, record)
    return record


def main() -> None:
    """Run one discharge and print its numbers."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("row", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument(
        "--modulus",
        type=float,
        default=1.0,
        metavar="FACTOR",
        help="over the modulus of the decks",
    )
    asked = parser.parse_args()
    for key, value in one(asked.row, asked.seed, asked.modulus).items():
        print(f"{key}: {value}", flush=True)


if __name__ == "__main__":
    main()
