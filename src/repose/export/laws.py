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
from repose.export.job import Job, Pair

GAMMA = " (of each of two surfaces: the work of adhesion is w = 2 gamma, the pull-off force 3 pi gamma R*)"


def equivalent_restitution(pair: Pair, least: float = 0.0) -> float:
    """Compute the coefficient of restitution with which Tsuji's formula gives a pair's damping ratio beta.

    exp(-pi beta / sqrt(1 - beta^2)), 0 for beta from 1 on; never below `least`, the smallest value of the program.
    """
    beta = pair.damping_ratio
    return (
        least
        if beta >= 1.0
        else max(least, math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta)))
    )


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


def further_laws(job: Job) -> str:
    """Write the lines of a head on the constants that the contact law and the rolling law have besides."""
    gg, gp = job.grains.constants, job.on_wall.constants
    law, lines = job.simulation.contact_law, []
    for constant in OF_LAWS.get(law, ()):
        wall = f"{gp[constant.name]:.6g} between grain and wall{GAMMA if constant is SURFACE_ENERGY else ''}"
        lines.append(
            f"{law}: {constant.words} {gg[constant.name]:.6g} {constant.unit} between grains, {wall}.\n"
        )
    if TWISTING.name in {**gg, **gp}:
        given = (pair.get(TWISTING.name, "3 pi / 16 mu_s") for pair in (gg, gp))
        words = (
            "{}: {} between grains, {} between grain and wall; this deck has none.\n"
        )
        lines.append(words.format(TWISTING.words, *given))
    return "".join(lines)
