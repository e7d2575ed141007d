"""The deck of LAMMPS: spheres, or rigid molecules of them, among a cone and a plane."""

import math

import numpy as np

from repose.export.job import Job, Pair
from repose.export.laws import (
    equivalent_restitution,
    rolling_coefficient,
    rolling_stiffness,
)
from repose.export.template import filled, head, numbers

# Damping of the rolling spring over its critical damping, with the mass of a grain.
ROLLING_DAMPING = 0.5
# Powers, the highest first, of a restitution in the damping over sqrt(k m) of `damping tsuji` (Marshall 2009, Eq. 53).
TSUJI = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)
SPRINGS = {
    "hertz_mindlin": "mindlin",
    "hertz_mindlin_rescaled": "mindlin_rescale/force",
}


def deck(job: Job) -> dict[str, str]:
    """Write the files of a LAMMPS run by name: in.pour, grain.mol."""
    cone = job.surfaces.cone_line()
    law_gg, law_gp = (contact_keywords(job, pair) for pair in job.pairs.values())
    values = {
        "law_gg": law_gg,
        "law_gp": law_gp,
        "tube_radius": 0.5 * job.surfaces.outlet_diameter_m,
    }
    values |= {
        "near": 2.0 * float(job.particle.spheres_m[:, 3].max()),
        "head": head(job, "# ", "lammps"),
    }
    for end, place in (("low", cone.first), ("high", cone.last)):
        values[f"cone_{end}_radius"] = cone.offset * cone.normal_r + place * cone.up_r
        values[f"cone_{end}"] = cone.offset * cone.normal_z + place * cone.up_z
    return {
        "in.pour": filled("lammps.in", job, **values, **damping_numbers(job)),
        "grain.mol": molecule(job),
    }


def contact_keywords(job: Job, pair: Pair) -> str:
    """Write a contact in the keywords of pair_style granular; the deck sets the variables damping, e_gg and e_gp.

    The moduli are those of two equal surfaces with the pair's E*.
    """
    restitution = "${e_gg}" if pair is job.grains else "${e_gp}"
    poisson = job.grain.poisson_ratio
    young = 2.0 * (1.0 - poisson**2) * pair.effective_young_pa
    stiffness = rolling_stiffness(pair) / pair.effective_radius_m**2
    rolling_damping = ROLLING_DAMPING * math.sqrt(stiffness * job.particle.mass_kg)
    law = SPRINGS[job.simulation.contact_law]
    words = (
        f"hertz/material {young:.8g} {restitution} {poisson:.8g} "
        f"tangential {law} {8.0 * pair.effective_shear_pa:.8g} 0 {pair.static_friction:.8g} "
        "damping ${damping} "
        f"rolling sds {stiffness:.8g} {rolling_damping:.8g} {rolling_coefficient(job, pair):.8g}"
    )
    return words if job.simulation.tension == "keep" else words + " limit_damping"


def damping_numbers(job: Job) -> dict[str, float]:
    """Compute the numbers with which `coeff_restitution`, and `tsuji` of older versions, give the study's damping.

    For `tsuji` it is negative where no restitution gives the damping.
    """
    found = {}
    for name, pair in job.pairs.items():
        found[f"e_{name}"] = equivalent_restitution(pair, 1e-6)
        roots = np.roots((*TSUJI[:-1], TSUJI[-1] - math.sqrt(5.0) * pair.damping_ratio))
        found[f"tsuji_{name}"] = float(roots[np.abs(roots.imag) < 1e-9].real.min())
    return found


def molecule(job: Job) -> str:
    """Write the grain as the text of a molecule template."""
    spheres, mass_kg = job.particle.spheres_m, job.particle.mass_kg
    n = len(spheres)
    lines = [
        "a grain, from repose export",
        "",
        f"{n} atoms",
        f"{mass_kg:.9g} mass",
        "0 0 0 com",
    ]
    lines.append(numbers((*job.particle.inertia_kg_m2, 0.0, 0.0, 0.0)) + " inertia")
    columns = {
        "Coords": [numbers(sphere[:3]) for sphere in spheres],
        "Types": ["1"] * n,
        "Diameters": [f"{2.0 * sphere[3]:.9g}" for sphere in spheres],
        "Masses": [f"{mass_kg / n:.9g}"] * n,
    }
    for name, words in columns.items():
        lines += [
            "",
            name,
            "",
            *(f"{k} {word}" for k, word in enumerate(words, start=1)),
        ]
    return "\n".join([*lines, ""])
