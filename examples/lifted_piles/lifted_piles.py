"""Piles of 4,000 spheres under a lifted tube, as the decks of another project say, in this engine.

    python examples/lifted_piles/lifted_piles.py pile ROW SEED --modulus FACTOR

fills the tube, lifts it, measures the pile and writes its numbers and its grains to results/examples/lifted_piles. A
pile that is there is not run again. README.md says what the decks have and what is here.
"""

import argparse
import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from repose.common.files import read_json, write_json, write_npz
from repose.common.provenance import engine_hash
from repose.dem import (
    Contact,
    Cylinder,
    Material,
    Motion,
    Plane,
    RingEdge,
    Shape,
    Simulation,
)

HERE, OUT = Path(__file__).parent, Path("results/examples/lifted_piles")
PUBLISHED = Path("results/published/lifted_piles")  # piles of an earlier run
UP = (0.0, 0.0, 1.0)

# --- what the decks say ---------------------------------------------------------------------------

DIAMETERS_MM = np.array([3.4, 3.7, 4.0])
NUMBERS = (1263, 1961, 776)  # of 4,000, from the shares by mass .25, .50, .25
DENSITY_KG_M3, YOUNG_PA, POISSON = 1400.0, 1e7, 0.25
TUBE_RADIUS_M, TUBE_LENGTH_M, TUBE_GAP_M, TUBE_PANELS = 0.040, 0.100, 0.0005, 48
SIDE_M = 0.13  # half the distance of the side walls
FILLED_M = (
    0.0375,
    0.003,
    0.085,
)  # radius, lowest and highest point of the cylinder that takes the grains
FALLING_M_S = 0.3
SETTLED_S, LIFTED_M, LIFTING_M_S, RELAXED_S = 0.4, 0.055, 0.010, 0.4
LAWS = {
    "contact_law": "hertz_mindlin",
    "rolling_law": "epsd2",
    "tension": "keep",
    "friction_limit": "total",
}

# --- choices of this side -------------------------------------------------------------------------

SIDES = (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1))
EDGE_M = 5e-5  # the tube's lower edge is sharp there; here it is rounded
STEP_FRACTION = 0.95  # of the longest stable time step
LOOK_S = 0.05
THROWN = 500  # places at once


class Contents(NamedTuple):
    """The parameters of a row: those of grains and of walls are the same."""

    fric: float
    rollfric: float
    rest: float


# --- fill and lift --------------------------------------------------------------------------------


def diameters_mm(grains: int = sum(NUMBERS)) -> np.ndarray:
    """Diameters of the grains, the largest first, in which order they find their places."""
    ends = np.round(np.cumsum(NUMBERS[::-1]) * grains / sum(NUMBERS)).astype(int)
    return np.repeat(DIAMETERS_MM[::-1], np.diff(ends, prepend=0))


def places_m(
    radii_m: np.ndarray, seed: int, filled_m: tuple[float, float, float] = FILLED_M
) -> np.ndarray:
    """Centres of spheres thrown into the cylinder one after another, each where it overlaps no earlier one."""
    rng, (radius, low, high) = np.random.default_rng(seed), filled_m
    centres, done = np.empty((len(radii_m), 3)), 0
    while done < len(radii_m):
        r, before = radii_m[done], done
        out, turn, up = rng.random((3, THROWN))
        out, turn, up = (
            (radius - r) * np.sqrt(out),
            2.0 * math.pi * turn,
            low + r + (high - low - 2.0 * r) * up,
        )
        thrown = np.column_stack([out * np.cos(turn), out * np.sin(turn), up])
        for centre in thrown[
            (cdist(thrown, centres[:done]) > radii_m[:done] + r).all(axis=1)
        ]:
            if done == len(radii_m) or radii_m[done] < r:
                break
            if (np.linalg.norm(centres[before:done] - centre, axis=1) > 2.0 * r).all():
                centres[done] = centre
                done += 1
    return centres


def tube_radius_m() -> float:
    """Radius of the round tube with the cross-section of theirs, which has 48 flat panels."""
    turn = 2.0 * math.pi / TUBE_PANELS
    return TUBE_RADIUS_M * math.sqrt(math.sin(turn) / turn)


def filled(
    contents: Contents,
    seed: int,
    modulus: float = 1.0,
    time_step_s: float | None = None,
    grains: int = sum(NUMBERS),
) -> Simulation:
    """The grains in the air inside the standing tube; modulus: over that of the decks."""
    sizes_mm = diameters_mm(grains)
    largest_m, tube = 1e-3 * DIAMETERS_MM.max(), tube_radius_m()
    sides = {
        side: Plane((x * SIDE_M, y * SIDE_M, 0.0), (-x, -y, 0.0), "wheat")
        for side, x, y in SIDES
    }
    grain = Material(modulus * YOUNG_PA / (2.0 + 2.0 * POISSON), POISSON)

    def empty(step_s: float) -> Simulation:
        return Simulation(
            shapes={"grain": Shape.sphere(0.5 * largest_m, DENSITY_KG_M3, "wheat")},
            materials={"wheat": grain},
            contacts={
                ("wheat", "wheat"): Contact(
                    contents.rest,
                    contents.fric,
                    contents.rollfric,
                    twisting_friction=0.0,
                )
            },
            time_step_s=step_s,
            capacity=len(sizes_mm),
            lower=(-SIDE_M, -SIDE_M, 0.0),
            upper=(SIDE_M, SIDE_M, TUBE_LENGTH_M),
            walls={
                "floor": Plane((0.0, 0.0, 0.0), UP, "wheat"),
                "tube": Cylinder(
                    (0.0, 0.0, TUBE_GAP_M + EDGE_M), UP, TUBE_LENGTH_M, tube, "wheat"
                ),
                "rim": RingEdge(
                    tube + EDGE_M,
                    EDGE_M,
                    "wheat",
                    ((0.0, 1.0), (0.0, 0.0)),
                    TUBE_GAP_M + EDGE_M,
                ),
                **sides,
            },
            **LAWS,
        )

    if time_step_s is None:
        scale = sizes_mm.min() / DIAMETERS_MM.max()
        time_step_s = STEP_FRACTION * scale * empty(1e-7).longest_time_step()
    simulation = empty(time_step_s)
    for size_mm, centre in zip(sizes_mm, places_m(5e-4 * sizes_mm, seed), strict=True):
        simulation.add(
            "grain",
            centre,
            velocity_m_s=(0.0, 0.0, -FALLING_M_S),
            scale=size_mm / DIAMETERS_MM.max(),
        )
    return simulation


class Grains(NamedTuple):
    """Grains at one moment."""

    centres_m: np.ndarray
    radii_m: np.ndarray
    speeds_m_s: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation) -> "Grains":
        """Those of a simulation, as they are now."""
        radii = 5e-4 * DIAMETERS_MM.max() * simulation.scales
        return cls(
            simulation.positions.copy(),
            radii,
            np.linalg.norm(simulation.velocities, axis=1),
        )

    def slower_than(self, speed_m_s: float) -> "Grains":
        """Only those that hardly move."""
        slow = self.speeds_m_s <= speed_m_s
        return Grains(*(values[slow] for values in self))

    @property
    def tops_m(self) -> np.ndarray:
        """Height of the highest point of each."""
        return self.centres_m[:, 2] + self.radii_m

    @property
    def median_m(self) -> float:
        """Median diameter."""
        return 2.0 * float(np.median(self.radii_m))


def lifted(simulation: Simulation) -> tuple[Grains, Grains, int]:
    """Settle, lift the tube, relax: grains before the lifting and at the end, and most grains behind the tube's wall.

    The tube has no outside. Behind its wall is a grain outside of it that is above its edge and would touch it there.
    """
    simulation.run(SETTLED_S, progress=False)
    settled, behind = Grains.of(simulation), 0
    for part in ("tube", "rim"):
        simulation.set_motion(part, Motion((0.0, 0.0, LIFTING_M_S)))
    looks = round(LIFTED_M / LIFTING_M_S / LOOK_S)
    for look in range(1, looks + 1):
        simulation.run(LOOK_S, progress=False)
        now = Grains.of(simulation)
        out = np.hypot(*now.centres_m[:, :2].T) - tube_radius_m()
        above = now.centres_m[:, 2] > TUBE_GAP_M + LIFTED_M * look / looks
        behind = max(behind, int((above & (out > 0.0) & (out < now.radii_m)).sum()))
    for part in ("tube", "rim"):
        simulation.set_motion(part, Motion())
    simulation.run(RELAXED_S, progress=False)
    return settled, Grains.of(simulation), behind


# --- measure --------------------------------------------------------------------------------------

REST_M_S, SETTLED_M_S = (
    0.010,
    0.050,
)  # faster grains are left out of the angle, of the density
FEWEST = 4  # grains in a ring, and tops that hold its height
REACH, SHELL = 1.5, 0.75  # in diameters: how far below, half thickness of the shell
WINDOW = (0.2, 0.8)
FLAT = 4.0  # diameters: a pile that is lower is measured between shares of its radius, not of its height
TRIMMED = 2.5  # standard deviations
ROUNDS, FEWEST_IN_SHELL = 3, 10


def rings(
    out_m: np.ndarray, tops_m: np.ndarray, width_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Radius and height of the surface in rings about the axis, each as wide as a grain.

    The height is the highest top that is one of four within one and a half diameters, and the highest of the four.
    """
    middles, heights = [], []
    ring = np.minimum(out_m // width_m, max(1, math.ceil(out_m.max() / width_m)) - 1)
    for number in np.unique(ring):
        tops = np.sort(tops_m[ring == number])
        if len(tops) < FEWEST:
            continue
        below = np.arange(1, len(tops) + 1) - np.searchsorted(
            tops, tops - REACH * width_m, side="right"
        )
        held = tops[below >= FEWEST]
        middles.append((number + 0.5) * width_m)
        heights.append(held[-1] if len(held) else np.median(tops))
    return np.array(middles), np.array(heights)


def angle(grains: Grains) -> dict:
    """The angle of a pile [deg] by two lines: through the rings of its flank, then through the tops near that line.

    Between 20 and 80 % of the height, where the pile is at least four diameters high, else of the radius.
    """
    everything, grains = len(grains.radii_m), grains.slower_than(REST_M_S)
    width, tops, weights = grains.median_m, grains.tops_m, grains.radii_m**3
    axis = weights @ grains.centres_m[:, :2] / weights.sum()
    out = np.hypot(*(grains.centres_m[:, :2] - axis).T)
    middles, heights = rings(out, tops, width)
    peak, foot = heights.max(), np.quantile(middles, 0.95)
    flat = peak < FLAT * width
    along, whole = (middles, foot) if flat else (heights, peak)
    flank = (along >= WINDOW[0] * whole) & (along <= WINDOW[1] * whole)
    if flank.sum() < 2:
        flank[:] = True
    line = line_of(middles[flank], heights[flank])
    off = heights - np.polyval(line, middles)
    near = flank & (np.abs(off) <= TRIMMED * off[flank].std())
    if 2 <= near.sum() < flank.sum():
        line = line_of(middles[near], heights[near])
    first, count = line, int(flank.sum())
    low, high = WINDOW[0] * max(peak, line[1]), WINDOW[1] * peak
    for _ in range(ROUNDS):
        on_line = np.polyval(line, out)
        inside = (
            (out >= WINDOW[0] * foot) & (out <= WINDOW[1] * foot)
            if flat
            else (on_line >= low) & (on_line <= high)
        )
        shell = inside & (np.abs(tops - on_line) <= SHELL * width)
        if shell.sum() < FEWEST_IN_SHELL:
            line, count = first, int(flank.sum())
            break
        line, count = line_of(out[shell], tops[shell]), int(shell.sum())
    return {
        "angle_deg": math.degrees(math.atan(-line[0])),
        "rings_angle_deg": math.degrees(math.atan(-first[0])),
        "height_mm": 1e3 * float(peak),
        "foot_mm": 1e3 * float(foot),
        "fitted": count,
        "flat": bool(flat),
        "moving": everything - len(grains.radii_m),
    }


def line_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Slope and height over 0 of the line of least squares."""
    return np.polyfit(x, y, 1)


def density(grains: Grains) -> dict:
    """Bulk density of the bed in the standing tube [kg/m3]: between two diameters from its floor and its surface.

    The cross-section is that of a round tube of 80 mm.
    """
    grains = grains.slower_than(SETTLED_M_S)
    masses, heights = (
        DENSITY_KG_M3 * 4.0 / 3.0 * math.pi * grains.radii_m**3,
        grains.centres_m[:, 2],
    )
    level, edge, area = (
        float(np.quantile(grains.tops_m, 0.99)),
        2.0 * grains.median_m,
        math.pi * TUBE_RADIUS_M**2,
    )
    whole = masses.sum() / (area * level)
    slab = math.nan
    if level - 2.0 * edge >= grains.median_m:
        inside = (heights >= edge) & (heights <= level - edge)
        slab = masses[inside].sum() / (area * (level - 2.0 * edge))
    return {
        "density_kg_m3": whole if math.isnan(slab) else slab,
        "whole_density_kg_m3": whole,
        "level_mm": 1e3 * level,
    }


# --- a pile in its file ---------------------------------------------------------------------------


def rows() -> pd.DataFrame:
    """The parameters of the piles, by the number of their row."""
    return pd.read_csv(HERE / "parameters.csv").query("test == 'pile'").set_index("row")


def name(row: int, seed: int, modulus: float, time_step_s: float | None = None) -> str:
    """Name of a pile's files."""
    step = "" if time_step_s is None else f"_step_{time_step_s:g}"
    return f"row_{row:02}_seed_{seed}_modulus_{modulus:g}{step}"


def one(row: int, seed: int, modulus: float, time_step_s: float | None = None) -> dict:
    """Run and measure a pile, or read the file that has it."""
    path = OUT / f"{name(row, seed, modulus, time_step_s)}.json"
    for kept in (path, PUBLISHED / path.name):
        if kept.exists():
            return read_json(kept)
    contents, began = (
        Contents(*rows().loc[row, list(Contents._fields)]),
        time.process_time(),
    )
    simulation = filled(contents, seed, modulus, time_step_s)
    settled, final, behind = lifted(simulation)
    record = {
        "row": row,
        "seed": seed,
        "modulus": modulus,
        **contents._asdict(),
        **angle(final),
        **density(settled),
    }
    record |= {
        "grains": simulation.n_bodies,
        "gone": int((~simulation.present).sum()),
        "most_behind_wall": behind,
        "energy_j": float(simulation.kinetic_energies().sum()),
        "time_step_s": simulation.time_step_s,
        "steps": int(simulation.steps),
        "processor_s": time.process_time() - began,
        "engine": engine_hash(),
    }
    arrays = {
        f"{when}_{key}": values.astype(np.float32)
        for when, of in (("settled", settled), ("final", final))
        for key, values in of._asdict().items()
    }
    write_npz(path.with_suffix(".npz"), arrays)
    write_json(path, record)  # last: its file says that the pile is done
    return record


def main() -> None:
    """Run one pile and print its numbers."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    commands = parser.add_subparsers(required=True)
    words = commands.add_parser("pile", help="a row of parameters.csv, and a seed")
    words.add_argument("row", type=int)
    words.add_argument("seed", type=int)
    words.add_argument(
        "--modulus",
        type=float,
        default=1.0,
        metavar="FACTOR",
        help="over the modulus of the decks",
    )
    words.add_argument(
        "--time-step",
        type=float,
        default=None,
        metavar="SECONDS",
        help="8e-6 is that of the decks",
    )
    asked = parser.parse_args()
    for key, value in one(
        asked.row, asked.seed, asked.modulus, asked.time_step
    ).items():
        print(f"{key}: {value}", flush=True)


if __name__ == "__main__":
    main()
