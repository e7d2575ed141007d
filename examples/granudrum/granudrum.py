"""The drum of a GranuDrum with spheres of microcrystalline cellulose: filled, turned, and its surface measured.

    python examples/granudrum/granudrum.py

turns drums with the published parameters, and compares their surfaces with the measured and the published ones. With
`--files FOLDER` it reads the grains of the published run (`post` of TrialSimulations/sim0144_45rpm in its repository).
"""

import argparse
import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from repose.bench.drum import Drum, set_rotation
from repose.dem import Contact, Material, Shape, Simulation
from repose.measure import bed
from repose.measure.silhouette import Grains

DRUM = Drum(radius_m=0.042, length_m=0.020)
DENSITY_KG_M3, POISSON, RESTITUTION = 1580.0, 0.3, 0.3
YOUNG_PA = 1e6  # of 5e6 published: half of the time
DIAMETERS_MM = np.linspace(1.05, 1.50, 10)
SHARES = (
    np.array([647, 7388, 26250, 25250, 17013, 10531, 6886, 3663, 1862, 513]) / 100_003
)  # by number
# By number, of the grains in the published run's own files: too few small ones, so 3.3 % more volume.
INSERTED = np.array([23, 257, 2173, 2899, 1954, 1209, 790, 421, 214, 60]) / 10_000
STEP_FRACTION = 0.95  # of the longest stable time step
PUBLISHED = {"sliding": 0.561, "rolling": 0.293, "grains": 29_185}
TURNED_S, AVERAGED_S = 1.5, 0.2  # from rest, as published
FRAME_S, MM_PER_PIXEL = 0.01, 0.2
COVERED = 0.1  # share of the frames: grey level 30 between the picture's background, 8, and its bed, 232


def drum(
    sliding: float,
    rolling: float,
    grains: float,
    seed: int,
    young_pa: float = YOUNG_PA,
    shares: np.ndarray = SHARES,
) -> Simulation:
    """A drum at rest with a number of grains."""
    rng = np.random.default_rng(seed)
    count = round(grains)
    scales = rng.choice(DIAMETERS_MM / DIAMETERS_MM[-1], count, p=shares)
    largest_m = 1e-3 * DIAMETERS_MM[-1]
    half = np.array([DRUM.radius_m, 0.5 * DRUM.length_m, DRUM.radius_m])

    def scene(time_step_s):
        return Simulation(
            shapes={"grain": Shape.sphere(0.5 * largest_m, DENSITY_KG_M3, "mcc")},
            materials={"mcc": Material(young_pa / (2 + 2 * POISSON), POISSON)},
            contacts={
                ("mcc", "mcc"): Contact(
                    RESTITUTION, sliding, rolling, twisting_friction=0.0
                )
            },
            time_step_s=time_step_s,
            capacity=count,
            lower=-half,
            upper=half,
            walls=DRUM.walls("mcc"),
            contact_law="hertz_mindlin",
            rolling_law="constant_torque",
        )

    longest_s = scene(1e-7).longest_time_step() * scales.min()
    simulation, sites = scene(STEP_FRACTION * longest_s), _sites(1.01 * largest_m)
    while (
        simulation.n_bodies < count
    ):  # what the empty drum has no room for is added over the fallen bed
        free = sites
        if simulation.n_bodies:
            free = sites[cKDTree(simulation.positions).query(sites)[0] > largest_m]
        for place in free[: count - simulation.n_bodies]:
            simulation.add("grain", place, scale=scales[simulation.n_bodies])
        if simulation.n_bodies < count:
            simulation.run(0.05, progress=False)
    return simulation


def surfaces(
    simulation: Simulation,
    rpm: Sequence[float],
    x_mm: np.ndarray,
    turned_s: Sequence[float] = (TURNED_S,),
    averaged_s: float = AVERAGED_S,
) -> list[np.ndarray]:
    """Turn at one speed after the other; at each the mean surface, heights over the axis at abscissae [mm].

    As in the pictures of the instrument, the bed is lifted at negative x.
    """
    return [
        line(occupied, x_mm, COVERED)
        for occupied in occupied_shares(simulation, rpm, turned_s, averaged_s)
    ]


def occupied_shares(
    simulation: Simulation,
    rpm: Sequence[float],
    turned_s: Sequence[float],
    averaged_s: float,
) -> Iterator[np.ndarray]:
    """At each speed the share of the frames in which a grain is seen along the axis, by pixel."""
    for speed, before_s in zip(rpm, turned_s, strict=True):
        set_rotation(simulation, speed * math.pi / 30.0)
        simulation.run(before_s, progress=False)
        frames = []
        for _ in range(round(averaged_s / FRAME_S)):
            simulation.run(FRAME_S, progress=False)
            frames.append(simulation.positions.copy())
        if not DRUM.contains(simulation.positions).all():
            raise RuntimeError(f"a grain left the drum at {speed:g} rpm")
        of_frames = (
            grains(frame, simulation.shapes["grain"], simulation.scales)
            for frame in frames
        )
        yield bed.occupied_share(of_frames, DRUM.radius_m, MM_PER_PIXEL)


def grains(centres_m: np.ndarray, grain: Shape, scales: np.ndarray) -> Grains:
    """The spheres of a frame."""
    return Grains(
        centres_m,
        np.broadcast_to((1.0, 0.0, 0.0, 0.0), (len(centres_m), 4)),
        grain,
        scales,
    )


def published_shares(folder: Path) -> np.ndarray:
    """The same share for the published run, from the grains in its own files."""
    shares, grain = [], Shape.sphere(1.0, DENSITY_KG_M3, "mcc")
    paths = [
        path
        for path in sorted(folder.glob("particles_*.vtk"))
        if "boundingBox" not in path.name
    ]
    if not paths:
        raise FileNotFoundError(f"{folder} has no particles_*.vtk")
    for path in paths:
        data = path.read_bytes()
        number = int(data.split(b"POINTS ")[1].split()[0])
        at = data.index(b"float\n") + len(b"float\n")
        centres = np.frombuffer(data, ">f4", 3 * number, at).reshape(-1, 3) * (
            -1.0,
            -1.0,
            1.0,
        )  # it turns the other way
        at = data.index(b"double\n", data.index(b"\nradius ")) + len(b"double\n")
        radii = np.frombuffer(data, ">f8", number, at).astype(float)
        shares += [
            bed.side_view(grains(centres, grain, radii), DRUM.radius_m, MM_PER_PIXEL)
        ]
    return np.mean(shares, axis=0)


def line(occupied: np.ndarray, x_mm: np.ndarray, covered: float) -> np.ndarray:
    """Heights [mm] of the line on which the bed covers a share of the frames."""
    return 1e3 * bed.surface_heights(
        occupied, covered, -1e-3 * np.asarray(x_mm), DRUM.radius_m, MM_PER_PIXEL
    )


def _sites(spacing_m):
    """Places (M, 3) in the drum, a close packing of spheres of a diameter, the lowest first."""
    n = math.ceil(2 * DRUM.radius_m / spacing_m) + 1
    k = np.stack(np.meshgrid(*3 * [np.arange(-n, n + 1)], indexing="ij"), -1).reshape(
        -1, 3
    )
    places = (
        k[k.sum(axis=1) % 2 == 0] * spacing_m / math.sqrt(2.0)
    )  # face-centred cubic
    places[:, 1] += 0.25 * spacing_m
    inside = np.hypot(places[:, 0], places[:, 2]) < DRUM.radius_m - 0.5 * spacing_m
    places = places[inside & (np.abs(places[:, 1]) < 0.5 * (DRUM.length_m - spacing_m))]
    return places[np.argsort(places[:, 2], kind="stable")]


def main() -> None:
    """The published parameters in this engine: how far two lines of its surfaces are off the published ones."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument(
        "--rpm", type=int, nargs="+", default=[45, 15], choices=(45, 15)
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument(
        "--young-pa", type=float, default=YOUNG_PA, help="5e6 is published"
    )
    parser.add_argument(
        "--inserted", action="store_true", help="sizes that the published run inserted"
    )
    parser.add_argument(
        "--files",
        type=Path,
        help="the published run's own grains at the speed of --rpm, not a drum",
    )
    asked = parser.parse_args()
    if asked.files and len(asked.rpm) > 1:
        parser.error(
            f"--rpm is {asked.rpm}; expected the one speed of the files in {asked.files}"
        )
    shares = INSERTED if asked.inserted else SHARES
    data = pd.read_csv(
        Path(__file__).with_name("surface.csv"), comment="#", index_col="x_mm"
    ).loc[-24:24]
    for rpm, seed in itertools.product(asked.rpm, [0] if asked.files else asked.seeds):
        if asked.files:
            occupied = published_shares(asked.files)
        else:
            simulation = drum(
                **PUBLISHED, seed=seed, young_pa=asked.young_pa, shares=shares
            )
            (occupied,) = occupied_shares(simulation, (rpm,), (TURNED_S,), AVERAGED_S)
        for covered, of in itertools.product((COVERED, 0.5), ("measured", "theirs")):
            off = line(occupied, data.index, covered) - data[f"{of}_{rpm:g}rpm_mm"]
            print(
                f"{rpm:g} rpm, {asked.files or f'seed {seed}'}, {covered:.0%} of frames, {of}: "
                f"root mean square {math.sqrt((off**2).mean()):.2f} mm, mean {off.mean():+.2f} mm",
                flush=True,
            )


if __name__ == "__main__":
    main()
