"""Numbers with which the laws of other programs give the study's laws.

A program that takes a coefficient of restitution calculates its damping by a formula for contacts that may pull at the
end (Tsuji, Tanaka and Ishida 1992). Where the study's contact never pulls, its damping differs.
`equivalent_restitution` is the number with which the program's formula gives the study's damping; the program must then
limit the normal force to pushes.

The lever of the rolling resistance is here the distance from the contact to the centre of the clump, elsewhere the
effective radius of the two touching spheres. With `rolling_coefficient` the mean torque is the same.
"""

import math

from repose.dem.constants import OF_LAWS, SURFACE_ENERGY, TWISTING
from repose.dem.laws.law import COULOMB
from repose.export.job import Job, Pair

# Effect of a change of the normal load on a tangential force.
UNDER_LOAD = {
    "hertz_mindlin": "grows and falls with the normal load",
    "hertz_mindlin_rescaled": "stays on loading and falls on unloading",
    "kept": "stays as it is when the normal load changes",
}
DAMPED_ALONE = (
    "each pair of spheres is damped with the bodies' masses; in the study the spheres of one pair of bodies share "
    "the damping, and the mass counts the rotation"
)
UNDAMPED_TANGENT = (
    "no dashpot along the tangent; in the study Coulomb's limit holds it too. In LIGGGHTS and YADE it comes on "
    "top of that limit, in LAMMPS it winds up the spring: a grazing impact had 1.7 times the friction, or a sixth"
)
GAMMA = " (of each of two surfaces: the work of adhesion is w = 2 gamma, the pull-off force 3 pi gamma R*)"


def equivalent_restitution(pair: Pair, least: float = 0.0) -> float:
    """Compute the coefficient of restitution with which Tsuji's formula gives a pair's damping ratio beta.

    exp(-pi beta / sqrt(1 - beta^2)), 0 for beta from 1 on; never below `least`, the smallest value of the program.
    """
    beta = pair.damping_ratio
    if beta >= 1.0:
        return least
    return max(least, math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta)))


def rolling_coefficient(job: Job, pair: Pair) -> float:
    """Compute the coefficient of rolling friction for a program whose lever is the effective radius of two spheres.

    In laws that resist the rotation of one grain against the other, the lever of two grains is half of one grain's.
    """
    lever = job.lever_m
    if job.simulation.rolling_law != "budget" and pair is job.grains:
        lever *= 0.5
    return pair.rolling_friction * lever / pair.effective_radius_m


def rolling_stiffness(pair: Pair) -> float:
    """Compute the stiffness of a rolling spring [N m]: the stiffness of the tangential spring times R*^2."""
    return pair.tangential_stiffness_n_m * pair.effective_radius_m**2


def skin_m(job: Job) -> float:
    """Compute the reach of neighbour lists beyond the spheres [m]: three quarters of the mean radius.

    A grain that falls at 2 m/s moves 0.4 mm in a step; with this skin the lists last for several steps.
    """
    return 0.75 * job.mean_radius_m


def further_laws(job: Job) -> str:
    """Write the lines of a head on the constants that the contact law and the rolling law have besides."""
    gg, gp = job.grains.constants, job.on_wall.constants
    law, lines = job.simulation.contact_law, []
    for constant in OF_LAWS.get(law, ()):
        wall = f"{gp[constant.name]:.6g} between grain and wall{GAMMA if constant is SURFACE_ENERGY else ''}"
        lines.append(f"{law}: {constant.words} {gg[constant.name]:.6g} {constant.unit} between grains, {wall}.\n")
    if TWISTING.name in {**gg, **gp}:
        given = (pair.get(TWISTING.name, "3 pi / 16 mu_s") for pair in (gg, gp))
        words = "{}: {} between grains, {} between grain and wall; this deck has none.\n"
        lines.append(words.format(TWISTING.words, *given))
    return "".join(lines)


def unlike_the_study(job: Job, tangential: str = "hertz_mindlin") -> list[str]:
    """List the differences that several programs have: rolling, damping, tangential force.

    `tangential` is the program's law: a contact law of this engine, or "kept" for a force that does not change with
    load.
    """
    notes = [rolled(job), *([] if job.is_sphere else [DAMPED_ALONE]), UNDAMPED_TANGENT]
    if COULOMB[job.simulation.tension] != "total":
        notes.append("Coulomb's limit takes the damped normal force, in the study its elastic part")
    own = "hertz_mindlin" if job.simulation.contact_law == "hertz_mindlin" else "hertz_mindlin_rescaled"
    if own != tangential:
        notes.append(f"a tangential force {UNDER_LOAD[tangential]}; in the study it {UNDER_LOAD[own]}")
    return notes


def rolled(job: Job) -> str:
    """Describe a rolling resistance that is a limited spring between two spheres."""
    law = job.simulation.rolling_law
    if law != "budget":
        own = "a constant torque" if law == "constant_torque" else "its own stiffness and damping"
        return (
            f"rolling resistance is between two spheres, with {own}; in the study "
            f"{law} between two bodies, which resists spin about the normal too. Its coefficients here are "
            f"those of the study times the mean lever {1e3 * job.lever_m:.3g} mm over the radius of a sphere"
        )
    piles = "; with mu_r 0.1 piles of spheres stood 5 to 7 degrees lower so" if job.is_sphere else ""
    return (
        "rolling resistance is a spring with a limit against the relative rotation (model C of Ai et al. 2011, without "
        "damping or with); in the study a budget of each body (model A). Its coefficients here are those of the study "
        f"times the mean lever {1e3 * job.lever_m:.3g} mm over the effective radius of two spheres{piles}"
    )
