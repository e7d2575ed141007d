"""Whether two checkouts of the project simulate the same, bit for bit, on this machine.

python benchmarks/compare_checkouts.py OLD NEW

Runs the same scenes with the engine of either checkout, each in a process of its own, and compares the bits of all
that users can see of the final states. The scenes have every kind of particle, wall and option. Prints a table and
exits with 1 where a bit differs. Stored hashes would hold for one type of processor only; this holds for any.
"""

import argparse
import inspect
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

GOJI_DENSITY = 840.47
STEP_S = 1e-4
# What the argument was called before; see `Scene.simulation`.
RENAMED = {"curved_walls_above_m": "funnel_floor_m"}


# --- particles ---------------------------------------------------------------------------------------------------


def sphere(dem):
    """A sphere as large as a berry."""
    return dem.Shape.sphere(0.006, GOJI_DENSITY, "body")


def ellipsoid(dem):
    """A berry as one ellipsoid."""
    return dem.Shape.ellipsoid(
        np.array([0.02114, 0.01137, 0.00988]) / 2.0, GOJI_DENSITY, "body"
    )


def sum_of(dem, axes):
    """A sum of ellipsoids with the mass of the ellipsoid that has its extents."""
    axes = np.array(axes)
    solid = dem.Shape.ellipsoid(axes.sum(axis=0), GOJI_DENSITY, "body")
    return dem.Shape(axes, solid.mass_kg, solid.inertia_kg_m2, "body")


def sum_of_two(dem):
    """A barrel: the sum of two ellipsoids."""
    return sum_of(dem, [[7.399e-3, 0.94e-3, 0.94e-3], [3.171e-3, 4.745e-3, 4.0e-3]])


def sum_of_three(dem):
    """The sum of three ellipsoids."""
    return sum_of(dem, [[5e-3, 1e-3, 1e-3], [3e-3, 3e-3, 1e-3], [2e-3, 1.5e-3, 3e-3]])


def clump_of(dem, spheres):
    """A clump with the mass and moments of an ellipsoid of its length."""
    solid = dem.Shape.ellipsoid(np.array([0.01, 0.0055, 0.0055]), GOJI_DENSITY, "body")
    return dem.Clump(np.array(spheres), solid.mass_kg, solid.inertia_kg_m2, "body")


def smooth_clump(dem):
    """Overlapping spheres on a line, close enough to be nearly smooth."""
    x = np.linspace(-6e-3, 6e-3, 9)
    radius = 5e-3 * np.sqrt(1.0 - (x / 9e-3) ** 2)
    return clump_of(dem, np.column_stack([x, 0 * x, 0 * x, radius]))


def rough_clump(dem):
    """Sixteen spheres with dents between them, not symmetric."""
    rng = np.random.default_rng(16)
    places = rng.uniform(-1.0, 1.0, (16, 3)) * [7e-3, 3e-3, 2.5e-3]
    return clump_of(dem, np.column_stack([places, rng.uniform(2e-3, 3.5e-3, 16)]))


# --- walls -------------------------------------------------------------------------------------------------------


def funnel(dem, tube=0.0):
    """A funnel with rounded edges above a disc; `tube`: length of the tube that follows the cone [m]."""
    slope = math.radians(50.0)
    radius = 0.018
    edge = 0.001
    outlet = 0.08
    core = radius + edge
    height = outlet + tube
    offset = math.sin(slope) * core - math.cos(slope) * height - edge
    foot_r = offset * math.sin(slope)
    foot_z = -offset * math.cos(slope)
    along = math.cos(slope) * core + math.sin(slope) * height
    top = (
        (0.06 - foot_r) / math.cos(slope)
        + math.cos(slope) * foot_r
        + math.sin(slope) * foot_z
    )
    up = (math.cos(slope), math.sin(slope))
    line = (math.sin(slope), -math.cos(slope), offset, along, top, *up)
    walls = {
        "plate": dem.Plane((0, 0, 0), (0, 0, 1), "wall", 0.07),
        "cone": dem.Cone(line, "wall"),
    }
    if tube:
        walls["tube"] = dem.Cone((1.0, 0.0, radius, outlet, height, 0.0, 1.0), "wall")
        walls["neck"] = dem.RingEdge(core, edge, "wall", (up, (0.0, -1.0)), height)
        walls["outlet"] = dem.RingEdge(
            core, edge, "wall", ((0.0, 1.0), (0.0, 0.0)), outlet
        )
    else:
        walls["outlet"] = dem.RingEdge(core, edge, "wall", (up, (0.0, 0.0)), outlet)
    return walls


def box(dem, half=0.05):
    """A floor and four walls."""
    walls = {"floor": dem.Plane((0, 0, 0), (0, 0, 1), "wall")}
    for name, x, y in (
        ("east", 1, 0),
        ("west", -1, 0),
        ("north", 0, 1),
        ("south", 0, -1),
    ):
        walls[name] = dem.Plane((half * x, half * y, 0), (-x, -y, 0), "other")
    return walls


def wide_box(dem):
    """A box for thousands of bodies."""
    return box(dem, 0.25)


def drum(dem):
    """A turning drum with a level axis: a tube between two discs."""
    motion = dem.Motion(angular_velocity_rad_s=(0.0, 3.0, 0.0))
    return {
        "tube": dem.Cylinder((0, -0.03, 0), (0, 1, 0), 0.06, 0.06, "wall", motion),
        "front": dem.Plane((0, -0.03, 0), (0, 1, 0), "other", 0.06, motion),
        "back": dem.Plane((0, 0.03, 0), (0, -1, 0), "other", 0.06, motion),
    }


def ramp(dem, motion=None):
    """Vertices and faces of a roof that stands on the floor, as a mesh wall."""
    vertices = [
        (-0.03, -0.03, 0.0),
        (0.03, -0.03, 0.0),
        (0.03, 0.03, 0.0),
        (-0.03, 0.03, 0.0),
        (0, 0, 0.035),
    ]
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    keywords = {} if motion is None else {"motion": motion}
    return {
        **box(dem),
        "roof": dem.Mesh(
            np.array(vertices), np.array(faces), "wall", 0.001, **keywords
        ),
    }


# --- scenes ------------------------------------------------------------------------------------------------------


class Scene:
    """One simulation: particles, walls and options, and how long it runs."""

    def __init__(
        self,
        particles,
        walls,
        bodies=80,
        seconds=0.6,
        spread=0.03,
        first_m=0.03,
        **options,
    ):
        self.particles = particles if isinstance(particles, tuple) else (particles,)
        self.walls = walls
        self.bodies = bodies
        self.seconds = seconds
        self.spread = spread
        self.first_m = first_m
        self.options = options

    def simulation(self, dem):
        """The simulation with all its bodies, of the engine `dem`."""
        options = dict(self.options)
        sizes = options.pop("sizes", None)
        frame = options.pop("frame", None)
        known = inspect.signature(dem.Simulation.__init__).parameters
        options = {
            name if name in known else RENAMED[name]: value
            for name, value in options.items()
        }
        half = max(0.08, self.spread)
        height = self.first_m + 0.03 * self.bodies
        simulation = dem.Simulation(
            {f"shape {k}": make(dem) for k, make in enumerate(self.particles)},
            {
                "body": dem.Material(4.3e4, 0.32),
                "wall": dem.Material(1e6, 0.3),
                "other": dem.Material(1e5, 0.25),
            },
            {
                ("body", "body"): dem.Contact(0.2, 0.64, 0.04),
                ("body", "wall"): dem.Contact(0.25, 0.48, 0.18),
                ("body", "other"): dem.Contact(0.4, 0.3, 0.01),
            },
            STEP_S,
            capacity=self.bodies,
            lower=(-half, -half, -0.08),
            upper=(half, half, max(0.2, min(height, 0.6))),
            walls=self.walls(dem),
            largest_scale=1.0 if sizes is None else max(sizes),
            **options,
        )
        rng = np.random.default_rng(7)
        side = max(1, int(2.0 * self.spread / 0.023))
        pitch = 2.0 * self.spread / side
        for k in range(self.bodies):
            x, y = pitch * (np.array([k % side, k // side % side]) - 0.5 * (side - 1))
            place = np.array(
                [x, y, self.first_m + 0.023 * (k // side**2)]
            ) + 1e-4 * rng.normal(size=3)
            simulation.add(
                f"shape {k % len(self.particles)}",
                place,
                rng.normal(size=4),
                0.05 * rng.normal(size=3),
                rng.normal(size=3),
                scale=1.0 if sizes is None else float(rng.uniform(*sizes)),
            )
        if frame is not None:
            simulation.rolling_frame_rad_s[:] = frame
        return simulation

    def state(self, dem):
        """All that users can see of the simulation after its run, as named arrays."""
        simulation = self.simulation(dem)
        steps = round(self.seconds / STEP_S)
        simulation.run_steps(steps // 2)
        if "moving" in simulation.wall_set.names:
            simulation.set_motion("moving", dem.Motion(velocity_m_s=(0.0, 0.0, -0.02)))
        simulation.run_steps(steps - steps // 2)
        found = {
            name: np.array(getattr(simulation, name))
            for name in (
                "positions",
                "quaternions",
                "velocities",
                "angular_velocities",
                "angular_momenta",
                "present",
                "exit_times_s",
                "scales",
            )
        }
        found["energies"] = simulation.kinetic_energies()
        found["pairs"] = simulation.contacts()
        for name in ("sphere_contacts", "curved_contacts", "mesh_contacts"):
            for k, array in enumerate(getattr(simulation, name)()):
                found[f"{name}.{k}"] = np.array(array)
        return found


def moving_floor(dem, half=0.05):
    """A box whose floor rises and then sinks."""
    walls = box(dem, half)
    floor = walls.pop("floor")
    moving = dem.Plane(
        floor.point_m,
        floor.normal,
        "wall",
        motion=dem.Motion(velocity_m_s=(0.0, 0.0, 0.05)),
    )
    return {"moving": moving, **walls}


def moving_wide_floor(dem):
    """The same for thousands of bodies."""
    return moving_floor(dem, 0.25)


def moving_roof(dem):
    """A mesh that turns about the vertical."""
    return ramp(dem, dem.Motion(angular_velocity_rad_s=(0.0, 0.0, 4.0)))


POUR = {
    "seconds": 1.2,
    "spread": 0.024,
    "first_m": 0.13,
    "bodies": 60,
    "exit_height_m": 0.08,
    "curved_walls_above_m": 0.079,
    "floor_height_m": -0.05,
}
WITH_TUBE = {**POUR, "first_m": 0.15}
MANY = {"seconds": 0.3, "spread": 0.24, "first_m": 0.012, "bodies": 4200}
SMALL = (0.8, 1.2)


def tube_funnel(dem):
    """A funnel with a tube."""
    return funnel(dem, 0.02)


SCENES = {
    "pour sphere": Scene(sphere, funnel, **POUR),
    "pour ellipsoid": Scene(ellipsoid, funnel, **POUR),
    "pour sum of two": Scene(sum_of_two, funnel, **POUR),
    "pour sum of three": Scene(sum_of_three, funnel, **POUR),
    "pour smooth clump": Scene(smooth_clump, funnel, **POUR),
    "pour rough clump": Scene(rough_clump, funnel, **POUR),
    "tube ellipsoid": Scene(ellipsoid, tube_funnel, **WITH_TUBE),
    "tube sum of two": Scene(sum_of_two, tube_funnel, **WITH_TUBE),
    "tube clump": Scene(smooth_clump, tube_funnel, **WITH_TUBE),
    "release ellipsoid": Scene(ellipsoid, funnel, tension="release", **POUR),
    "cut ellipsoid": Scene(ellipsoid, funnel, tension="cut", **POUR),
    "release clump": Scene(rough_clump, funnel, tension="release", **POUR),
    "cut clump": Scene(smooth_clump, funnel, tension="cut", **POUR),
    "sizes ellipsoid": Scene(ellipsoid, funnel, sizes=SMALL, **POUR),
    "sizes sum of two": Scene(sum_of_two, funnel, sizes=SMALL, **POUR),
    "sizes clump": Scene(rough_clump, funnel, sizes=SMALL, **POUR),
    "mixed smooth": Scene((sphere, ellipsoid, sum_of_three), box, sizes=SMALL),
    "mixed clumps": Scene((smooth_clump, rough_clump), box, sizes=SMALL),
    "drum ellipsoid": Scene(ellipsoid, drum, bodies=30, spread=0.02, first_m=-0.03),
    "drum clump, frame": Scene(
        smooth_clump, drum, 30, 0.6, 0.02, -0.03, frame=(0.0, 3.0, 0.0)
    ),
    "drum sum, frame": Scene(
        sum_of_two, drum, 30, 0.6, 0.02, -0.03, frame=(0.0, 3.0, 0.0)
    ),
    "mesh sphere": Scene(sphere, ramp, first_m=0.05),
    "mesh ellipsoid": Scene(ellipsoid, ramp, first_m=0.05),
    "mesh clump": Scene(rough_clump, ramp, first_m=0.05),
    "moving mesh sum of two": Scene(sum_of_two, moving_roof, first_m=0.05),
    "moving mesh clump": Scene(smooth_clump, moving_roof, first_m=0.05),
    "moving plane ellipsoid": Scene(ellipsoid, moving_floor),
    "moving plane clump": Scene(rough_clump, moving_floor),
    "many, one thread": Scene(ellipsoid, wide_box, **MANY),
    "many, two threads": Scene(ellipsoid, wide_box, threads=2, **MANY),
    "many sums, two threads": Scene(sum_of_two, moving_wide_floor, threads=2, **MANY),
}


# --- comparison --------------------------------------------------------------------------------------------------


def write_states(folder, names):
    """Run scenes with the engine that this process finds, and write the states to a folder."""
    from repose import dem

    for name in names:
        began = time.perf_counter()
        state = SCENES[name].state(dem)
        np.savez(folder / f"{name}.npz", wall_s=time.perf_counter() - began, **state)


def environment_of(checkout):
    """The environment of a process that imports a checkout's sources."""
    return {**os.environ, "PYTHONPATH": str(checkout.resolve() / "src")}


def start(checkout, folder, names):
    """A process that writes the states of scenes with the engine of a checkout."""
    command = [sys.executable, __file__, "--write", str(folder), "--scenes", *names]
    return subprocess.Popen(command, env=environment_of(checkout))


def differences(first, second):
    """Names of the arrays that differ in a bit, with the largest difference of numbers."""
    found = []
    for name in first.files:
        if name == "wall_s":
            continue
        a = first[name]
        b = second[name]
        if a.shape != b.shape:
            found.append(f"{name} {a.shape} {b.shape}")
        elif a.tobytes() != b.tobytes():
            apart = np.abs(np.asarray(a, float) - np.asarray(b, float))
            found.append(f"{name} by {np.nanmax(apart, initial=0.0):.2g}")
    return found


def main():
    """Compare two checkouts; the exit code says whether they simulate the same."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "checkouts", nargs="*", type=Path, help="folders of two checkouts"
    )
    parser.add_argument(
        "--scenes",
        nargs="+",
        default=list(SCENES),
        choices=list(SCENES),
        metavar="SCENE",
    )
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.write is not None:
        write_states(arguments.write, arguments.scenes)
        return 0
    if len(arguments.checkouts) != 2:
        parser.error("two checkouts are needed")
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch, name) for name in ("old", "new")]
        for folder in folders:
            folder.mkdir()
        runs = [
            start(checkout, folder, arguments.scenes)
            for checkout, folder in zip(arguments.checkouts, folders, strict=True)
        ]
        if any([run.wait() for run in runs]):
            return 2
        failed = 0
        print(
            f"{'scene':26} {'bodies':>6} {'pairs':>6} {'old, s':>7} {'new, s':>7}  result"
        )
        for name in arguments.scenes:
            first, second = (np.load(folder / f"{name}.npz") for folder in folders)
            apart = differences(first, second)
            failed += bool(apart)
            print(
                f"{name:26} {int(first['present'].sum()):6} {len(first['pairs']):6} {first['wall_s']:7.2f} "
                f"{second['wall_s']:7.2f}  {'same bits' if not apart else '; '.join(apart)}"
            )
    print(
        f"{len(arguments.scenes) - failed} of {len(arguments.scenes)} scenes have the same bits"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
