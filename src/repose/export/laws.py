"""Compute the numbers with which other programs reproduce the study's force laws.

A program that reads a coefficient of restitution computes its damping with the formula
of Tsuji, Tanaka and Ishida (1992). This formula allows the two bodies to attract each
other at the end of a contact. If the study forbids this attraction, its damping is
different. `compute_equivalent_restitution` returns the restitution for which the
formula gives the damping of the study. The program must then suppress attractive normal
forces, too.

In the study, the lever arm of the rolling resistance is the distance from the contact
to the centre of the clump. In other programs, it is the effective radius of the two
touching spheres. With the coefficient of `compute_rolling_coefficient`, the mean torque
is the same in both.
"""

import math

from repose.dem.constants import OF_LAWS, SURFACE_ENERGY, TWISTING
from repose.dem.laws import ROLLING_LAWS
from repose.export.job import Job, Pair


def compute_equivalent_restitution(pair: Pair, minimum: float = 0.0) -> float:
    """Compute the restitution for which Tsuji's formula gives the damping of a pair.

    Parameters
    ----------
    pair : Pair
        The contact, with its damping ratio beta.
    minimum : float, optional
        The smallest restitution that the program accepts.

    Returns
    -------
    float
        exp(-pi beta / sqrt(1 - beta^2)) for beta below 1, and 0 for larger beta, but at
        least `minimum`.
    """
    beta = pair.damping_ratio
    if beta >= 1.0:
        return minimum
    return max(minimum, math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta)))


def compute_rolling_coefficient(job: Job, pair: Pair) -> float:
    """Compute the coefficient of rolling friction of a pair for another program.

    In the study, the lever arm of the torque is the mean distance from the surface to
    the centre of the grain. In the program, it is the effective radius of two spheres.
    The coefficient is scaled so that both torques are equal.

    If a law resists the rotation of one grain relative to another, the lever arm
    between two grains is half the mean distance.

    Parameters
    ----------
    job : Job
        The grain and its pour.
    pair : Pair
        The contact, `job.grains` or `job.on_wall`.

    Returns
    -------
    float
        The coefficient.
    """
    lever = job.lever_m
    law = ROLLING_LAWS.entry(job.simulation.rolling_law)
    if pair is job.grains and not law.of_each_body:
        lever *= 0.5
    return pair.rolling_friction * lever / pair.effective_radius_m


def compute_rolling_stiffness(pair: Pair) -> float:
    """Compute the stiffness of a rolling spring [N m].

    The stiffness is the tangential stiffness of the contact times the squared effective
    radius.
    """
    return pair.tangential_stiffness_n_m * pair.effective_radius_m**2


def describe_law_constants(job: Job) -> list[str]:
    """Describe the constants of the force laws in comment lines of an input script.

    The lines are for constants beyond restitution and the coefficients of friction,
    such as the surface energy of a contact law with adhesion.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    list of str
        A line for each constant of the contact law, and one for the twisting friction
        if the study sets it. A line has the values between grains, and between grain
        and wall. The list is empty if there are no such constants.
    """
    grains = job.grains.constants
    on_wall = job.on_wall.constants
    law = job.simulation.contact_law
    lines = []
    # `OF_LAWS` has the constants of each contact law, and `words` is the description
    # of a constant.
    for constant in OF_LAWS.get(law, ()):
        line = (
            f"{law}: {constant.words} {grains[constant.name]:.6g} {constant.unit} between "
            f"grains, {on_wall[constant.name]:.6g} between grain and wall"
        )
        # Some programs define the surface energy differently, so state the definition.
        if constant is SURFACE_ENERGY:
            line += (
                " (of each of two surfaces: the work of adhesion is w = 2 gamma, the "
                "pull-off force 3 pi gamma R*)"
            )
        lines.append(f"{line}.")

    # The twisting friction resists the spin about the normal. It may be set for both
    # contacts, for one or for none. If it is not set for a contact, the engine computes
    # it from the static friction mu_s. No other program has it.
    if TWISTING.name in grains or TWISTING.name in on_wall:
        default = "3 pi / 16 mu_s"
        lines.append(
            f"{TWISTING.words}: {grains.get(TWISTING.name, default)} between grains, "
            f"{on_wall.get(TWISTING.name, default)} between grain and wall; this input "
            "script has none."
        )
    return lines
