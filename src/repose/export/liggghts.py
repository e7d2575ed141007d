"""The deck of LIGGGHTS-PUBLIC 3.8: multispheres among a mesh and a plane."""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.job import Job
from repose.export.laws import (
    damped_alone,
    differences,
    equivalent_restitution,
    limited_friction,
    rolled,
    rolling_coefficient,
    skin_m,
    undamped_tangent,
)
from repose.export.surface import AROUND, stl
from repose.export.template import filled

# LIGGGHTS refuses a smaller coefficient of restitution.
LEAST_RESTITUTION = 0.05
ROLLING_MODELS = {"budget": "epsd2", "constant_torque": "cdt", "epsd": "epsd", "epsd2": "epsd2"}


def deck(job: Job) -> dict[str, str]:
    """The files of a LIGGGHTS run by name: in.pour, clump.txt, funnel.stl."""
    half = max(job.plate_radius_m, 0.5 * job.funnel.inlet_diameter_m) + 4.0 * job.bounding_radius_m
    steps = job.steps(job.duration_s)
    text = filled(
        "liggghts.in",
        head=differences(job, "# ", _differences(job)),
        seed=prime(job.seed),
        half=half,
        below=job.bounding_radius_m,
        top=job.factory_height_m + 4.0 * job.bounding_radius_m,
        skin=skin_m(job),
        young_grain=job.grain.elastic_modulus_pa,
        young_wall=job.wall.elastic_modulus_pa,
        poisson_grain=job.grain.poisson_ratio,
        poisson_wall=job.wall.poisson_ratio,
        e_gg=equivalent_restitution(job.grains, LEAST_RESTITUTION),
        e_gp=equivalent_restitution(job.on_wall, LEAST_RESTITUTION),
        mus_gg=job.grains.static_friction,
        mus_gp=job.on_wall.static_friction,
        mur_gg=rolling_coefficient(job, job.grains),
        mur_gp=rolling_coefficient(job, job.on_wall),
        cohesion=_cohesion(job),
        model=("cohesion sjkr " if job.contact_law == "sjkr" else "")
        + f"rolling_friction {ROLLING_MODELS[job.rolling_law]}",
        fold=1.1 * 360.0 / AROUND,
        limit_force="off" if job.tension == "keep" else "on",
        time_step=job.time_step_s,
        gravity=job.gravity_m_s2,
        density=job.density_kg_m3,
        spheres=len(job.spheres_m),
        mass=job.mass_kg,
        ixx=float(job.inertia_kg_m2[0]),
        iyy=float(job.inertia_kg_m2[1]),
        izz=float(job.inertia_kg_m2[2]),
        factory_radius=job.factory_radius_m,
        factory_low=job.factory_height_m - 1e-4,
        factory_high=job.factory_height_m + 1e-4,
        count=job.count,
        rate=float(job.rate_per_s),
        every=job.steps(1.0 / job.rate_per_s),
        thermo=max(1, steps // 20),
        steps=steps,
    )
    clump = "".join(" ".join(f"{value:.9g}" for value in sphere) + "\n" for sphere in job.spheres_m)
    return {"in.pour": text, "clump.txt": clump, "funnel.stl": stl(job.funnel)}


def _cohesion(job):
    """The properties that the further laws need."""
    lines = []
    if job.contact_law == "sjkr":
        gg, gp = (pair.constants[COHESION_ENERGY_DENSITY.name] for pair in (job.grains, job.on_wall))
        values = f"{gg:.8g} {gp:.8g} {gp:.8g} {gp:.8g}"
        lines.append(
            f"fix             cohesion all property/global cohesionEnergyDensity peratomtypepair 2 {values}"
        )
    if job.rolling_law == "epsd":
        damping = "fix             rolling_damping all property/global coefficientRollingViscousDamping"
        lines.append(f"{damping} peratomtypepair 2 {' '.join(4 * [f'{ETA:g}'])}")
    return "".join(line + "\n" for line in lines)


def prime(seed: int) -> int:
    """A prime above 10000, as LIGGGHTS needs for its random numbers; different for each seed (0 or more)."""
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number


def _differences(job):
    """Differences of LIGGGHTS from this engine."""
    lines = [rolled(job), damped_alone(), undamped_tangent(), *limited_friction(job)]
    if job.tension == "release":
        lines.append(
            "coefficientRestitution is the number that gives the study's damping; with limitForce an impact then "
            "ends with the restitution calibrated"
        )
    for name, pair in (("grains", job.grains), ("grain and wall", job.on_wall)):
        if equivalent_restitution(pair, LEAST_RESTITUTION) == LEAST_RESTITUTION:
            lines.append(
                f"{name}: the study's damping is stronger than coefficientRestitution {LEAST_RESTITUTION:g} gives, "
                "the least that LIGGGHTS takes"
            )
    return lines
