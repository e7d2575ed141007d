"""The driver of MercuryDPM: rigid clumps among triangles and a plane.

It follows the interfaces of MercuryDPM's clump drivers, and has neither been compiled nor run here.
"""

from repose.export.job import Job
from repose.export.laws import (
    damped_alone,
    differences,
    equivalent_restitution,
    limited_friction,
    rolled,
    rolling_coefficient,
    undamped_tangent,
)
from repose.export.surface import stl
from repose.export.template import filled

# Its rolling lever is twice the effective radius.
LEVER = 2.0


def deck(job: Job) -> dict[str, str]:
    """The files of a MercuryDPM driver by name: Pour.cpp, funnel.stl."""
    half = max(job.plate_radius_m, 0.5 * job.funnel.inlet_diameter_m) + 4.0 * job.bounding_radius_m
    pairs = {"gg": job.grains, "gp": job.on_wall}
    numbers: dict[str, float] = {}
    for name, pair in pairs.items():
        numbers |= {
            f"young_{name}": pair.effective_young_pa,
            f"shear_{name}": pair.effective_shear_pa,
            f"e_{name}": equivalent_restitution(pair, 1e-6),
            f"mus_{name}": pair.static_friction,
            f"mur_{name}": rolling_coefficient(job, pair) / LEVER,
            f"stiffness_{name}": pair.tangential_stiffness_n_m / LEVER**2,
        }
    text = filled(
        "mercurydpm.cpp.txt",
        head=differences(job, "// ", _differences(job)),
        spheres="".join(
            "    {" + ", ".join(f"{value:.9g}" for value in sphere) + "},\n" for sphere in job.spheres_m
        ),
        density=job.density_kg_m3,
        **numbers,
        count=job.count,
        every=job.steps(1.0 / job.rate_per_s),
        factory_radius=job.factory_radius_m,
        factory_height=job.factory_height_m,
        reach=job.bounding_radius_m,
        ixx=float(job.inertia_kg_m2[0]),
        iyy=float(job.inertia_kg_m2[1]),
        izz=float(job.inertia_kg_m2[2]),
        mass=job.mass_kg,
        gravity=job.gravity_m_s2,
        half=half,
        top=job.factory_height_m + 4.0 * job.bounding_radius_m,
        time_step=job.time_step_s,
        duration=float(job.duration_s),
        steps=job.steps(job.duration_s),
        seed=job.seed,
    )
    return {"Pour.cpp": text, "funnel.stl": stl(job.funnel)}


def _differences(job):
    """Differences of MercuryDPM from this engine, and features that were not tried."""
    lines = [
        "this driver was neither compiled nor run by those who wrote it",
        rolled(job),
        damped_alone(),
        undamped_tangent(),
        *limited_friction(job),
        "grains turn by three random angles, so not all orientations are alike",
    ]
    if job.tension != "keep":
        lines.append("the damped force may pull at the end of an impact; the damping is that of the study")
    return lines
