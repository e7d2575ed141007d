"""Random legal pours: every particle, size, modulus, restitution and bench test; see README.md.

python tests/random_pours/pour.py --count 2000 --out tests/random_pours/pours.csv
"""

import argparse
import contextlib
import copy
import csv
import math
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import Scene, bench, names
from repose.bench.bounds import OVERLAP_LIMIT, SPEED_LIMIT, Bounded
from repose.bench.parameters import PAIRS, PARAMETERS
from repose.bench.scene import longest_time_step
from repose.bench.settings import SceneSettings
from repose.config import validation
from repose.config.pipeline import PipelineConfig
from repose.dem.constants import OF_LAWS, TWISTING
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.grain import berry as berries
from repose.grain import build
from repose.grain.settings import GrainSettings
from repose.measure.settings import FINEST_MM_PER_PIXEL

ROOT = Path(__file__).parents[2]
PARTICLES = {
    "ellipsoid": {"particle": "ellipsoid", "mass_g": None},
    "smooth": {"particle": "smooth"},
    "smooth_sizes": {"particle": "smooth", "size_distribution": "measured"},
    "spheres": {"particle": "multisphere", "spheres": 14},
    "spheres_fewest": {"particle": "multisphere", "spheres": "fewest"},
    "rough": {"particle": "multisphere", "spheres": 16, "surface": "rough"},
    "sphere": {"particle": "ellipsoid", "mass_g": None},  # all of its axes are alike
}
# Lowest and highest value of each kind of parameter.
RANGES = {"e": (0.02, 1.0), "mus": (0.0, 1.5), "mur": (0.0, 1.0), "mut": (0.0, 1.0)}
MAX_STEPS = 40_000  # most pours; MANY_SHARE of them have MANY berries and as many steps as they need
FALLS = 40  # time of a pour, over that of a fall by a berry's length
MANY = 300
MANY_SHARE = 0.01
LONGEST_S = 60.0
EXAMPLE_MM = 20.0  # length of the berries in the examples of bench tests
COLUMNS = [
    "number",
    "apparatus",
    "particle",
    "berries",
    "long_mm",
    "shear_modulus_pa",
    "e_gg",
    "e_gp",
    "contact_law",
    "rolling_law",
    "tension",
    "gravity_m_s2",
    "time_step_s",
    "share_of_limit",
    "steps",
    "status",
    "cpu_s",
    "energy_over_given",
    "speed_over_fall",
    "overlap_over_extent",
    "wall_overlap_over_extent",
    "reason",
]


class TooLong(Exception):
    """A pour took more than `LONGEST_S` of CPU time."""


class Largest:
    """The largest energy, speed and overlaps of a pour, each over what the laws of physics or the bounds allow."""

    energy = 0.0
    speed = 0.0
    overlap = 0.0
    wall_overlap = 0.0
    steps = 0
    began_s = None  # the first look: what is compiled before is no time of a pour

    def note(self, bounded):
        now_s = time.process_time()
        if self.began_s is None:
            self.began_s = now_s
        if now_s - self.began_s > LONGEST_S:
            raise TooLong
        s = bounded.simulation
        self.steps = s.steps
        if not s.n_bodies:
            return
        # kinetic and potential energy, over what the grains got by falling and by their first speed
        masses = s.masses_kg
        heights = s.positions[s.present, 2] - bounded.lowest_m
        potential = bounded.gravity * np.sum(masses[s.present] * heights)
        energy = s.kinetic_energies().sum() + potential
        given = masses.sum() * (
            bounded.gravity * bounded.fall_m + 0.5 * bounded.speed_m_s**2
        )
        if given > 0.0:
            self.energy = max(self.energy, float(energy / given))
        # the speed of the fastest grain, over that of a free fall
        fall = math.sqrt(2.0 * bounded.gravity * bounded.fall_m) + bounded.speed_m_s
        fastest = float(np.sqrt(np.square(s.velocities).sum(axis=1).max()))
        self.speed = max(self.speed, fastest / fall)
        # overlaps over the thickness of the smaller grain
        pairs, overlaps = s.overlaps()
        shares = overlaps / s.scales[pairs].min(axis=1) / bounded.thickness_m
        self.overlap = max(self.overlap, float(shares.max(initial=0.0)))
        bodies, _, overlaps = s.wall_overlaps()
        of_walls = overlaps / s.scales[bodies] / bounded.thickness_m
        self.wall_overlap = max(self.wall_overlap, float(of_walls.max(initial=0.0)))


def noting(seen):
    check = Bounded.check

    def noted(self, is_full=True):
        seen[-1].note(self)
        check(self, is_full)

    return noted


def sized(particle, factor):
    record = particle.record()
    powers = {
        "semi_axes_mm": 1,
        "spheres_mm": 1,
        "bounding_radius_mm": 1,
        "mass_g": 3,
        "volume_mm3": 3,
    }
    for key, power in (powers | {"inertia_g_mm2": 5}).items():
        record[key] = (np.array(record[key]) * factor**power).tolist()
    return type(particle).from_record(record)


def drawn(number, default, mean, particles):
    rng = np.random.default_rng([13, number])
    config = copy.deepcopy(default)
    apparatus = str(rng.choice(list(SCENES)))
    name = str(rng.choice(list(PARTICLES)))
    long_mm = float(10 ** rng.uniform(math.log10(0.5), math.log10(50.0)))
    factor = long_mm / mean["long_mm"]
    berry = dict(mean) | {
        key: factor * mean[key] for key in ("long_mm", "major_mm", "minor_mm")
    }
    if name == "sphere":
        berry |= dict.fromkeys(("major_mm", "minor_mm"), long_mm)
    berry["shear_modulus_pa"] = float(10 ** rng.uniform(4.0, 9.0))
    parameters = {
        key: float(rng.uniform(*RANGES[key.split("_")[0]])) for key in PARAMETERS
    }
    config["simulation"]["tension"] = str(rng.choice(["keep", "release"]))
    config["simulation"]["contact_law"] = str(rng.choice(list(CONTACT_LAWS)))
    config["simulation"]["rolling_law"] = str(rng.choice(list(ROLLING_LAWS)))
    rolling_law = ROLLING_LAWS.entry(config["simulation"]["rolling_law"])
    if rolling_law.twists and rng.random() < 0.5:
        parameters |= {
            f"{TWISTING.short}_{pair}": float(rng.uniform(*RANGES[TWISTING.short]))
            for pair in PAIRS
        }
    config["berry"]["size_distribution"] = PARTICLES[name].get(
        "size_distribution", "none"
    )
    particle = sized(particles[name], factor)
    parameters |= cohesion(
        rng, config["simulation"]["contact_law"], berry, particle.mass_kg
    )
    limit = longest_time_step(Scene.of(config, parameters, berry, particle))
    share = float(rng.choice([1.0, rng.uniform(0.3, 1.0)]))
    step_s = share * limit.time_step_s
    config["simulation"]["time_step_s"] = step_s
    many = bool(rng.random() < MANY_SHARE)
    # of a fall by a berry's length; gravity may rise to 100 m/s2, so that a pour ends within MAX_STEPS
    falls = 120 if many else FALLS
    tau_s = math.sqrt(2e-3 * long_mm / 9.81)
    room_s = MAX_STEPS * step_s
    gravity = 9.81 * min(10.0, max(1.0, (falls * tau_s / room_s) ** 2))
    tau_s *= math.sqrt(9.81 / gravity)
    span_s = falls * tau_s if many else min(falls * tau_s, room_s)
    if many:
        number_of = MANY
    else:
        # at most 1.5 grains for each fall by a berry's length
        number_of = min(int(rng.integers(20, 61)), max(20, round(1.5 * span_s / tau_s)))
    config["simulation"]["gravity_m_s2"] = gravity
    # the energy of a berry that falls by a ten thousandth of its length
    config["simulation"]["rest_energy_j"] = min(
        1e-3, 1e-4 * gravity * particle.mass_kg * 1e-3 * long_mm
    )
    config[apparatus] = config.get(apparatus, {}) | SCENES[apparatus](
        rng, long_mm, span_s, number_of
    )
    config["measure"] |= {
        "views": 2,
        # of the smallest grains, a configuration allows no finer scale
        "mm_per_pixel": max(
            FINEST_MM_PER_PIXEL, float(rng.uniform(0.02, 0.1) * long_mm)
        ),
    }
    return apparatus, name, share, config, parameters, particle, berry


def cohesion(rng, law, berry, mass_kg):
    """Constants of a law by parameter, so that spheres of the minor axis pull with up to about 3 of their weights."""
    radius_m = 0.5e-3 * berry["minor_mm"]
    stiffness_pa = 1.5 * berry["shear_modulus_pa"]
    most_n = 3 * 9.81 * mass_kg
    # about that of a weight, with E* = G / (1 - nu)
    overlap_m = (0.25 * most_n / (stiffness_pa * math.sqrt(0.5 * radius_m))) ** (2 / 3)
    found = {}
    for pair, reduced_m in (("gg", 0.5 * radius_m), ("gp", radius_m)):
        circle_m = (
            math.sqrt(2.0 * reduced_m * overlap_m) if law == "eepa" else reduced_m
        )
        most = {
            "gamma": most_n / (3.0 * math.pi * circle_m),
            "plas": 0.9,
            "k": (1.5 * most_n * (stiffness_pa / reduced_m) ** 2) ** (1 / 3) / math.pi,
        }
        for constant in OF_LAWS.get(law, ()):
            found[f"{constant.short}_{pair}"] = float(
                rng.uniform(0.0, most[constant.short])
            )
    return found


def _funnel(rng, d, span_s, n):
    """A funnel for berries of length d [mm] that pours for half of a span of time."""
    outlet = rng.uniform(1.5, 4.5)
    inlet = rng.uniform(6.0, 9.0)
    return {
        "berries": n,
        "rate_per_s": 2.0 * n / span_s,
        "duration_s": span_s,
        "rest_window_s": 0.1 * span_s,
        "rest_motion_mm": 0.05 * d,
        "inlet_diameter_mm": inlet * d,
        "outlet_diameter_mm": outlet * d,
        "rim_radius_mm": 0.05 * d,
        "cone_angle_deg": float(rng.uniform(45.0, 80.0)),
        "tube_length_mm": 0.0,
        "outlet_height_mm": rng.uniform(1.0, 4.0) * d,
        "plate_diameter_mm": rng.uniform(10.0, 30.0) * d,
        "factory_height_mm": rng.uniform(0.5, 3.0) * d,
        "factory_diameter_mm": rng.uniform(3.0, inlet) * d,
    }


def _drum(rng, d, span_s, n):
    """A drum for berries of length d [mm] that fills for a third of a span of time."""
    radius = rng.uniform(3.0, 6.0)
    return {
        "berries": n,
        "rate_per_s": 4.0 * n / span_s,
        "rotate_from_s": span_s / 3,
        "report_s": span_s / 2,
        "longest_rotation_s": span_s / 3,
        "settle_s": span_s / 6,
        "record_s": span_s / 30,
        "outer_diameter_mm": 2.2 * radius * d,
        "wall_thickness_mm": 0.1 * radius * d,
        "length_mm": rng.uniform(2.5, 5.0) * d,
        "factory_height_mm": 0.3 * radius * d,
        "angular_velocity_rad_s": min(10.0, rng.uniform(0.5, 2.0) / (span_s / 3)),
    }


def _cylinder(rng, d, span_s, n):
    """A cylinder for berries of length d [mm] that fills for half of a span of time, and is tapped."""
    diameter = rng.uniform(2.0, 4.0)
    return {
        "berries": n,
        "rate_per_s": 2.0 * n / span_s,
        "duration_s": span_s,
        "diameter_mm": diameter * d,
        "height_mm": rng.uniform(0.06, 0.2) * n / diameter**2 * d,
        "collar_mm": rng.uniform(4.0, 10.0) * d,
        "core_margin_mm": 0.02 * d,
        "speed_m_s": float(rng.uniform(0.0, 1.0)),
        "taps": int(rng.integers(0, 6)),
        "tap_mm": rng.uniform(0.02, 0.3) * d,
    }


def _discharge(rng, d, span_s, n):
    """A closed funnel for berries of length d [mm] that fills for a quarter of a span of time, then opens."""
    inlet = rng.uniform(6.0, 9.0)
    return {
        "berries": n,
        "rate_per_s": 4.0 * n / span_s,
        "open_from_s": 0.4 * span_s,
        "longest_s": 0.6 * span_s,
        "inlet_diameter_mm": inlet * d,
        "outlet_diameter_mm": rng.uniform(1.5, 4.5) * d,
        "rim_radius_mm": 0.05 * d,
        "cone_angle_deg": float(rng.uniform(45.0, 80.0)),
        "tube_length_mm": 0.0,
        "collar_mm": rng.uniform(4.0, 10.0) * d,
        "speed_m_s": float(rng.uniform(0.0, 1.0)),
    }


def _turning(rng, d, span_s, n):
    """A drum for berries of length d [mm] that fills for a third of a span of time, then turns; half are tilted."""
    drum = _drum(rng, d, span_s, n)
    shared = "berries rate_per_s rotate_from_s outer_diameter_mm wall_thickness_mm length_mm factory_height_mm record_s"
    measured = {"measure_from_s": 2 * span_s / 3, "measure_until_s": span_s}
    speed = {"angular_velocity_rad_s": min(10.0, rng.uniform(1.0, 6.0) / (span_s / 3))}
    tilt = {"tilt_deg": float(rng.choice([0.0, rng.uniform(0.0, 45.0)]))}
    return {key: drum[key] for key in shared.split()} | speed | measured | tilt


def _lifted_cylinder(rng, d, span_s, n):
    """A tube for berries of length d [mm] that fills for a third of a span of time, and is lifted in another."""
    diameter = rng.uniform(2.5, 5.0)
    length = 2.0 * n / diameter**2 + 2.0
    return {
        "berries": n,
        "rate_per_s": 4.0 * n / span_s,
        "lift_from_s": span_s / 3,
        "lifting_mm_s": 3.0 * length * d / span_s,
        "settle_s": span_s / 3,
        "diameter_mm": diameter * d,
        "length_mm": length * d,
        "rim_radius_mm": 0.05 * d,
        "plate_diameter_mm": rng.uniform(10.0, 30.0) * d,
    }


def _drawdown(rng, d, span_s, n):
    """A box for berries of length d [mm] that fills for a quarter of a span of time, then opens."""
    width = rng.uniform(4.0, 9.0)
    return {
        "berries": n,
        "rate_per_s": 4.0 * n / span_s,
        "open_from_s": 0.4 * span_s,
        "longest_s": 0.6 * span_s,
        "width_mm": width * d,
        "depth_mm": rng.uniform(2.0, 4.0) * d,
        "height_mm": rng.uniform(4.0, 10.0) * d,
        "slot_mm": rng.uniform(1.5, width - 1.0) * d,
        "floor_mm": 0.2 * d,
        "edge_radius_mm": 0.05 * d,
        "lower_width_mm": rng.uniform(10.0, 20.0) * d,
        "drop_mm": rng.uniform(2.0, 6.0) * d,
    }


def _drop_test(rng, d, _span_s, _n):
    """A drop of a berry of length d [mm]."""
    surface = str(rng.choice(["wall", "berry"]))
    height_mm = rng.uniform(1.0, 20.0) * d
    orientation = str(rng.choice(["random", "lying", "upright"]))
    return {"surface": surface, "height_mm": height_mm, "orientation": orientation}


def _inclined_plane(rng, _d, span_s, _n):
    """A plane that is tilted as fast as is allowed, for about ten spans of time or less; by 2 degrees at least."""
    steepest = max(2.0, min(rng.uniform(20.0, 60.0), 100.0 * span_s))
    tilting = {
        "tilting_deg_s": min(20.0, 2.0 * steepest),
        "steepest_deg": steepest,
        "settle_s": 0.1 * span_s,
    }
    return {"surface": str(rng.choice(["wall", "berry", "glued"]))} | tilting


SCENES = {
    "funnel": _funnel,
    "drum": _drum,
    "cylinder": _cylinder,
    "discharge": _discharge,
    "turning": _turning,
    "lifted_cylinder": _lifted_cylinder,
    "drawdown": _drawdown,
    "drop_test": _drop_test,
    "inclined_plane": _inclined_plane,
}


def _example(name, d):
    """The example of a bench test without a scene of its own, for berries of length d [mm]."""
    factor = d / EXAMPLE_MM
    section = dict(bench(name).example[name])
    for key in section:
        if key.endswith("_mm"):
            section[key] *= factor
    return section


for _name in names():
    SCENES.setdefault(_name, lambda rng, d, span_s, n, name=_name: _example(name, d))
STILL = ("funnel", "cylinder", "drop_test")  # no wall of these moves


def poured(number, default, mean, particles, seen):
    apparatus, name, share, config, parameters, particle, berry = drawn(
        number, default, mean, particles
    )
    row = {
        "number": number,
        "apparatus": apparatus,
        "particle": name,
        "berries": config[apparatus].get("berries", 1),
        "long_mm": f"{berry['long_mm']:.4g}",
        "shear_modulus_pa": f"{berry['shear_modulus_pa']:.3g}",
        "e_gg": f"{parameters['e_gg']:.2f}",
        "e_gp": f"{parameters['e_gp']:.2f}",
        "contact_law": config["simulation"]["contact_law"],
        "rolling_law": config["simulation"]["rolling_law"],
        "tension": config["simulation"]["tension"],
        "gravity_m_s2": f"{config['simulation']['gravity_m_s2']:.3g}",
        "time_step_s": f"{config['simulation']['time_step_s']:.3g}",
        "share_of_limit": f"{share:.2f}",
    }
    test = bench(apparatus)
    # the section as it is: a scene for small grains may be smaller than a configuration's may be
    drawn_section = {apparatus: test.settings.model_construct(**config[apparatus])}
    scene = Scene(
        SceneSettings(config, drawn_section), parameters, berry, particle, number
    )
    axes = [berry[key] for key in ("long_mm", "major_mm", "minor_mm")]
    faults = [*test.contradictions(scene.settings), *test.misfits(scene.settings, axes)]
    entries = {
        "parameters": {name: {"fixed": value} for name, value in parameters.items()}
    }
    # a study has a free parameter
    mus_gp = parameters["mus_gp"]
    entries["parameters"]["mus_gp"] = [mus_gp, mus_gp + 0.01]
    entries["validation"] = config["validation"] | {"published": None}
    faults += validation.find_time_step_problems(config | entries, particle, berry)
    if faults:
        return row | {
            "status": "refused",
            "reason": "; ".join(f"{key}: {allowed}" for key, allowed in faults),
        }
    seen.append(Largest())
    began = time.process_time()
    try:
        run = test.run(scene)
        record = test.result(run.record, run.arrays, scene)
        status = record["status"]
        reason = record["reason"]
    except TooLong:
        status = "HANG"
        reason = ""
    except Exception as error:
        status = "CRASH"
        reason = f"{type(error).__name__}: {error}"
    return row | {
        "steps": seen[-1].steps,
        "status": status,
        "cpu_s": f"{time.process_time() - began:.2f}",
        "reason": reason,
        "energy_over_given": f"{seen[-1].energy:.5g}",
        "speed_over_fall": f"{seen[-1].speed:.3g}",
        "overlap_over_extent": f"{seen[-1].overlap:.3g}",
        "wall_overlap_over_extent": f"{seen[-1].wall_overlap:.3g}",
    }


def violation(row):
    """What is not as it should be with a pour, or nothing."""
    if row["status"] in ("CRASH", "HANG"):
        return row["status"]
    if row["status"] in ("refused", "unstable"):
        return ""
    shares = [
        float(row[name])
        for name in (
            "speed_over_fall",
            "overlap_over_extent",
            "wall_overlap_over_extent",
        )
    ]
    if not all(
        share <= bound
        for share, bound in zip(
            shares, (SPEED_LIMIT, OVERLAP_LIMIT, OVERLAP_LIMIT), strict=True
        )
    ):
        return "exploded, and not called unstable"
    if row["apparatus"] in STILL and not float(row["energy_over_given"]) <= 1.0:
        return "energy gained"
    return ""


def counted(table):
    """How the pours of each bench test and particle ended, and their extremes."""
    place = [table["apparatus"], table["particle"]]
    ends = pd.crosstab(place, table["status"], margins=True)
    violations = (table["violation"] != "").groupby(place).sum()
    largest = (
        table.groupby(place)[COLUMNS[COLUMNS.index("cpu_s") : -1]]
        .max()
        .add_prefix("largest ")
    )
    return ends.join(violations).join(largest)


def study():
    """The default's configuration and mean grain, and the body of each kind of particle."""
    config = PipelineConfig.load(ROOT / "config/config.yaml").config
    section = config["berry"]
    table1 = ROOT / "resources/published/table1.csv"
    mean = berries.compute_mean_grain(
        section["sizes"], section["compression"], table1, section["density_kg_m3"]
    )[1]
    ball = mean | dict.fromkeys(("major_mm", "minor_mm"), mean["long_mm"])
    means = {name: ball if name == "sphere" else mean for name in PARTICLES}
    settings = {
        name: GrainSettings.model_construct(**section | entry)
        for name, entry in PARTICLES.items()
    }
    particles = {
        name: build.make_configured_particle(means[name], entry)
        for name, entry in settings.items()
    }
    return config, mean, particles


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="cases 0 to COUNT - 1")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--out", default=Path(__file__).with_name("pours.csv"), type=Path
    )
    args = parser.parse_args()
    done = set(pd.read_csv(args.out)["number"]) if args.out.is_file() else set()
    config, mean, particles = study()
    warnings.simplefilter("ignore", RuntimeWarning)  # what overflows in an explosion
    seen = [Largest()]
    Bounded.check = noting(seen)
    with (
        args.out.open("a", newline="") as table,
        contextlib.suppress(KeyboardInterrupt),
    ):
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        if not done:
            writer.writeheader()
        for number in range(args.first, args.count):
            if number not in done:
                writer.writerow(poured(number, config, mean, particles, seen))
                table.flush()
    table = pd.read_csv(args.out)
    table["violation"] = [violation(row) for row in table.to_dict("records")]
    bad = table.loc[table["violation"] != "", ["number", "violation"]]
    print(counted(table).to_string(), bad.to_string(), sep="\n")
    return int(len(bad) > 0)


if __name__ == "__main__":
    sys.exit(main())
