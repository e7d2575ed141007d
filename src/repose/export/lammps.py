"""The deck of LAMMPS: spheres, or rigid molecules of them, among a cone and a plane."""

import math

import numpy as np

from repose.apparatus.funnel import ConeLine
from repose.export.job import Job, Pair
from repose.export.laws import (
    damped_alone,
    equivalent_restitution,
    limited_friction,
    rolled,
    rolling_coefficient,
    rolling_stiffness,
    undamped_tangent,
)
from repose.export.template import filled

# Damping of the rolling spring over its critical damping, with the mass of a grain.
ROLLING_DAMPING = 0.5
# Powers, the highest first, of a restitution in the damping over sqrt(k m) of `damping tsuji` (Marshall 2009, Eq. 53).
TSUJI = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)
SPRINGS = {"hertz_mindlin": "mindlin", "hertz_mindlin_rescaled": "mindlin_rescale/force"}


def deck(job: Job) -> dict[str, str]:
    """The files of a LAMMPS run by name: in.pour, grain.mol."""
    cone, on_wall = job.funnel.cone_line(), contact_keywords(job, job.on_wall)
    low, high = (_on_line(cone, place) for place in (cone.first, cone.last))
    text = filled(
        "lammps.in",
        job,
        "# ",
        _differences(job),
        seed=job.seed,
        **damping_numbers(job),
        law_gg=contact_keywords(job, job.grains),
        law_gp=on_wall,
        cone_low_radius=low[0],
        cone_high_radius=high[0],
        cone_low=low[1],
        cone_high=high[1],
        tube=_tube(job, on_wall),
        near=2.0 * float(job.spheres_m[:, 3].max()),
    )
    return {"in.pour": text, "grain.mol": molecule(job)}


def contact_keywords(job: Job, pair: Pair) -> str:
    """A contact in the keywords of pair_style granular; the deck sets the variables damping, e_gg and e_gp.

    The moduli are those of two equal surfaces with the pair's E*.
    """
    restitution = "${e_gg}" if pair is job.grains else "${e_gp}"
    poisson = job.grain.poisson_ratio
    young = 2.0 * (1.0 - poisson**2) * pair.effective_young_pa
    stiffness = rolling_stiffness(pair) / pair.effective_radius_m**2
    rolling_damping = ROLLING_DAMPING * math.sqrt(stiffness * job.mass_kg)
    words = (
        f"hertz/material {young:.8g} {restitution} {poisson:.8g} "
        f"tangential {SPRINGS[job.contact_law]} {8.0 * pair.effective_shear_pa:.8g} 0 {pair.static_friction:.8g} "
        "damping ${damping} "
        f"rolling sds {stiffness:.8g} {rolling_damping:.8g} {rolling_coefficient(job, pair):.8g}"
    )
    return words if job.tension == "keep" else words + " limit_damping"


def damping_numbers(job: Job) -> dict[str, float]:
    """The numbers with which `coeff_restitution`, and `tsuji` of older versions, give the study's damping.

    For `tsuji` it is negative where no restitution gives the damping.
    """
    numbers = {}
    for name, pair in (("gg", job.grains), ("gp", job.on_wall)):
        numbers[f"e_{name}"] = equivalent_restitution(pair, 1e-6)
        roots = np.roots((*TSUJI[:-1], TSUJI[-1] - math.sqrt(5.0) * pair.damping_ratio))
        numbers[f"tsuji_{name}"] = float(roots[np.abs(roots.imag) < 1e-9].real.min())
    return numbers


def molecule(job: Job) -> str:
    """The grain as the text of a molecule template."""
    n = len(job.spheres_m)
    lines = ["a grain, from repose export", "", f"{n} atoms", f"{job.mass_kg:.9g} mass", "0 0 0 com"]
    lines += [" ".join(f"{value:.9g}" for value in (*job.inertia_kg_m2, 0.0, 0.0, 0.0)) + " inertia"]
    columns = {
        "Coords": [" ".join(f"{value:.9g}" for value in sphere[:3]) for sphere in job.spheres_m],
        "Types": ["1"] * n,
        "Diameters": [f"{2.0 * sphere[3]:.9g}" for sphere in job.spheres_m],
        "Masses": [f"{job.mass_kg / n:.9g}"] * n,
    }
    for name, words in columns.items():
        lines += ["", name, "", *(f"{k} {word}" for k, word in enumerate(words, start=1))]
    return "\n".join([*lines, ""])


def _on_line(cone: ConeLine, place: float) -> tuple[float, float]:
    """Return the point (r, z) at a place along the cone's line."""
    return (cone.offset * cone.normal_r + place * cone.up_r, cone.offset * cone.normal_z + place * cone.up_z)


def _tube(job: Job, law: str) -> str:
    """Write the lines of a tube below the cone."""
    if job.funnel.tube_length_m == 0.0:
        return ""
    radius, low, high = (0.5 * job.funnel.outlet_diameter_m, job.funnel.outlet_height_m, job.funnel.neck_height_m)
    return (
        f"region          tube cylinder z 0 0 {radius:.9g} {low:.9g} {high:.9g} side in open 1 open 2\n"
        f"fix             tube all wall/gran/region granular {law} region tube\n"
    )


def _differences(job: Job) -> list[str]:
    """List the differences between LAMMPS and this engine."""
    lines = [
        rolled(job),
        *damped_alone(job),
        undamped_tangent(),
        *limited_friction(job, job.contact_law),
        "the edge of the outlet is sharp",
    ]
    if job.tension == "release":
        lines.append(
            "the second number of hertz/material is the restitution that gives the study's damping; with limit_damping "
            "an impact then ends with the restitution calibrated"
        )
    return lines
