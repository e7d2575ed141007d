"""Make the input files of LAMMPS, with spheres or rigid molecules of them in a cone."""

import math

import numpy as np

from repose.export.decks import fill_template, format_head, join_numbers
from repose.export.job import Job, Pair
from repose.export.laws import (
    compute_equivalent_restitution,
    compute_rolling_coefficient,
    compute_rolling_stiffness,
)

# Damping of the rolling spring, as a fraction of critical damping for the mass of a
# grain.
ROLLING_DAMPING = 0.5
# Coefficients of the polynomial in the restitution that gives the damping over sqrt(k
# m) of `damping tsuji`, the highest power first (Marshall 2009, Eq. 53).
TSUJI_COEFFICIENTS = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)
# Smallest restitution that LAMMPS accepts.
MIN_RESTITUTION = 1e-6
# Imaginary part up to which a root counts as real.
IMAGINARY_TOLERANCE = 1e-9
# Keywords of LAMMPS for the tangential spring, by contact law of the study.
TANGENTIAL_SPRINGS = {
    "hertz_mindlin": "mindlin",
    "hertz_mindlin_rescaled": "mindlin_rescale/force",
}


def make_deck(job: Job) -> dict[str, str]:
    """Make the contents of in.pour and grain.mol for LAMMPS, by name of the file."""
    cone = job.surfaces.cone_line()
    text = fill_template(
        "lammps.in.jinja",
        job,
        head=format_head(job, _list_differences(job)),
        law_gg=format_contact_law(job, job.grains),
        law_gp=format_contact_law(job, job.on_wall),
        tube_radius=0.5 * job.surfaces.outlet_diameter_m,
        cone_low_radius=cone.offset * cone.normal_r + cone.first * cone.up_r,
        cone_low=cone.offset * cone.normal_z + cone.first * cone.up_z,
        cone_high_radius=cone.offset * cone.normal_r + cone.last * cone.up_r,
        cone_high=cone.offset * cone.normal_z + cone.last * cone.up_z,
        near=2.0 * float(job.particle.spheres_m[:, 3].max()),
        **compute_restitutions(job),
    )
    return {"in.pour": text, "grain.mol": format_molecule(job)}


def _list_differences(job: Job) -> list[str]:
    """List the differences between LAMMPS and the study."""
    differences = ["the edge of the outlet is sharp"]
    if job.simulation.tension == "release":
        differences.append(
            "the second number of hertz/material is not the calibrated restitution, but "
            "the number that gives the study's damping; together with limit_damping, an "
            "impact has the calibrated restitution"
        )
    return differences


def format_contact_law(job: Job, pair: Pair) -> str:
    """Format the contact law of a pair in the keywords of `pair_style granular`.

    Parameters
    ----------
    job : Job
        The study to export: grain, materials, contacts and pour.
    pair : Pair
        The contact, `job.grains` or `job.on_wall`.

    Returns
    -------
    str
        The keywords. They refer to variables that the input script defines: `damping`,
        and the restitutions `e_gg` between grains and `e_gp` between grain and wall.
    """
    # `pair` is one of two objects of the job, so compare its identity.
    restitution = "${e_gg}" if pair is job.grains else "${e_gp}"
    # LAMMPS computes E* of a contact from the modulus of a single material. Give it the
    # modulus for which two equal surfaces have the E* of the pair.
    poisson = job.grain.poisson_ratio
    young_pa = 2.0 * (1.0 - poisson**2) * pair.effective_young_pa

    # The tangential stiffness is this factor times the radius of the contact area.
    tangential_spring = TANGENTIAL_SPRINGS[job.simulation.contact_law]
    tangential_factor = 8.0 * pair.effective_shear_pa

    # The rolling spring of LAMMPS exerts a force at the contact instead of a torque, so
    # convert the stiffness from N m to N/m.
    stiffness_n_m = compute_rolling_stiffness(pair) / pair.effective_radius_m**2
    critical_damping = math.sqrt(stiffness_n_m * job.particle.mass_kg)
    rolling_damping = ROLLING_DAMPING * critical_damping

    # The 0 after the tangential factor is the tangential damping.
    keywords = (
        f"hertz/material {young_pa:.8g} {restitution} {poisson:.8g} "
        f"tangential {tangential_spring} {tangential_factor:.8g} 0 "
        f"{pair.static_friction:.8g} damping ${{damping}} "
        f"rolling sds {stiffness_n_m:.8g} {rolling_damping:.8g} "
        f"{compute_rolling_coefficient(job, pair):.8g}"
    )
    if job.simulation.tension == "release":
        keywords += " limit_damping"
    return keywords


def compute_restitutions(job: Job) -> dict[str, float]:
    """Compute the coefficients of restitution that give LAMMPS the study's damping.

    LAMMPS computes its damping from a coefficient of restitution by a formula of its
    own. The coefficients returned are therefore not the calibrated ones.

    Parameters
    ----------
    job : Job
        The study to export: grain, materials, contacts and pour.

    Returns
    -------
    dict
        ``e_gg`` and ``e_gp`` are the restitutions between grains, and between grain and
        wall, for the damping `coeff_restitution`. ``tsuji_gg`` and ``tsuji_gp`` are
        those for the damping `tsuji` of older versions. The latter are negative if no
        restitution gives the damping of the study.
    """
    restitutions = {}
    for name, pair in job.pairs.items():
        restitutions[f"e_{name}"] = compute_equivalent_restitution(
            pair, MIN_RESTITUTION
        )

        # Find the restitution at which the polynomial equals the study's damping, that
        # is, a real root of the polynomial minus this damping. The polynomial gives the
        # damping over sqrt(k m), which is sqrt(5) times the damping ratio for the
        # spring of Hertz's law. The polynomial falls from large negative restitutions
        # up to 1, where it is 0. Therefore its smallest root is the only one below 1.
        constant = TSUJI_COEFFICIENTS[-1] - math.sqrt(5.0) * pair.damping_ratio
        roots = np.roots((*TSUJI_COEFFICIENTS[:-1], constant))
        # Rounding leaves a tiny imaginary part in a real root.
        real_roots = roots[np.abs(roots.imag) < IMAGINARY_TOLERANCE].real
        restitutions[f"tsuji_{name}"] = float(real_roots.min())
    return restitutions


def format_molecule(job: Job) -> str:
    """Format the grain as a molecule of LAMMPS, whose spheres move as one rigid body.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    str
        The contents of a molecule file.
    """
    spheres_m = job.particle.spheres_m
    mass_kg = job.particle.mass_kg
    n_spheres = len(spheres_m)
    # LAMMPS reads the moments of inertia xx, yy, zz and the products xy, xz, yz. The
    # particle is in principal axes, so the products are zero.
    inertia = join_numbers((*job.particle.inertia_kg_m2, 0.0, 0.0, 0.0))
    lines = [
        "a grain, from repose export",
        "",
        f"{n_spheres} atoms",
        f"{mass_kg:.9g} mass",
        "0 0 0 com",
        f"{inertia} inertia",
    ]

    # Each section has a numbered row for each sphere. The blank lines around the name of
    # a section are part of the format. LAMMPS takes the mass and inertia of the grain
    # from the lines above, so the masses of its spheres may all be equal.
    sections = {
        "Coords": [join_numbers(sphere[:3]) for sphere in spheres_m],
        "Types": ["1"] * n_spheres,
        "Diameters": [f"{2.0 * sphere[3]:.9g}" for sphere in spheres_m],
        "Masses": [f"{mass_kg / n_spheres:.9g}"] * n_spheres,
    }
    for name, rows in sections.items():
        lines += ["", name, ""]
        lines += [f"{number} {row}" for number, row in enumerate(rows, start=1)]
    return "\n".join([*lines, ""])
