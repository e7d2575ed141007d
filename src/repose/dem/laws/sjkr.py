"""Contact law of Hertz and Mindlin, with a cohesion proportional to the contact area.

This is the simplified JKR model of LIGGGHTS.

The normal force is that of `hertz_mindlin_rescaled` minus k A, where k is the cohesion
energy density [J/m3]. A is the area of the circle in which two spheres intersect whose
radii are r_a and r_b and whose centres are r apart. For a sphere on a wall, r_a = R:

    A = pi/4 (r_a + r_b - r) (r + r_a - r_b) (r - r_a + r_b) (r + r_a + r_b) / r^2
    A = pi (R^2 - r^2)    on a wall

With delta = r_a + r_b - r, R* = r_a r_b / (r_a + r_b) and S = r_a + r_b, both areas are

    A = pi/4 delta (2 S - delta) (4 R* S - 2 S delta + delta^2) / (S - delta)^2

with 1/S = 0 on a wall. This is about 2 pi R* delta. The radius of a smooth body is the
geometric mean of its two radii of curvature at the contact. There is no attraction
across a gap. The strongest pull depends on the stiffness. At rest without load,
sqrt(delta) is about 3 pi k sqrt(R*) / (2 E*). Friction is limited by the normal force
without cohesion.

Rows of the tile `scratch`, after those of `hertz_mindlin`: DENSITY is k, INVERSE_SUM
1/S. A contact keeps in `history` the rows of `hertz_mindlin_rescaled`.

References
----------
LIGGGHTS(R)-PUBLIC, cohesion model sjkr.
"""

import math
from collections import namedtuple
from dataclasses import replace
from typing import Any

import numpy as np

from ..constants import COHESION_ENERGY_DENSITY
from ..kernels import clump_tile, state, tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows, add_vector, lane_vector
from ..materials import Contact, Material
from . import hertz_mindlin
from .hertz_mindlin import compute_contact_circles, compute_forces
from .hertz_mindlin_rescaled import LAST_CIRCLE, SPRING, rescale_springs
from .hertz_mindlin_rescaled import LAW as RESCALED
from .law import ENDS, LIMITS
from .tangential import update_springs

SimplifiedJkr = namedtuple("SimplifiedJkr", "tension friction_limit")

_scratch_rows = Rows(tile.LAW)
_scratch_rows.take(hertz_mindlin.LAW.n_rows)
DENSITY = _scratch_rows.take()
INVERSE_SUM = _scratch_rows.take()


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of the law for two materials, in SI units.

    Parameters
    ----------
    a, b : Material
        The two materials.
    contact : Contact
        Their contact, with its cohesion energy density.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.

    Returns
    -------
    ndarray (n,)
        The constants of `hertz_mindlin`, zeros for the other rows of that law, and k.
    """
    hertz_constants = hertz_mindlin.constants(a, b, contact, tension)
    values = np.zeros(hertz_mindlin.LAW.n_rows + 1)
    values[: hertz_mindlin.LAW.n_constants] = hertz_constants
    values[-1] = contact.constants[COHESION_ENERGY_DENSITY.name]
    return values


@inlined
def compute_contact_area(overlap: float, radius: float, inverse_sum: float) -> float:
    """Compute the area A of the circle in which two spheres intersect [m2].

    The formula is the last one in the module's docstring. Numerator and denominator are
    divided by S^2, and relative_overlap is delta / S.

    Parameters
    ----------
    overlap, radius : float
        The overlap delta, 0 or more, and the effective radius R* [m].
    inverse_sum : float
        1/S, with the sum S of both radii [1/m]; 0 on a wall.
    """
    # In unused lanes both bodies have the same position. The limit 0.5 keeps the values
    # there finite.
    relative_overlap = min(overlap * inverse_sum, 0.5)
    factor = max(4.0 * radius - 2.0 * overlap + overlap * relative_overlap, 0.0)
    numerator = 0.25 * math.pi * overlap * (2.0 - relative_overlap) * factor
    return numerator / ((1.0 - relative_overlap) * (1.0 - relative_overlap))


def geometry(
    law: Any, scratch: np.ndarray, history: np.ndarray, of_spheres: int, on_wall: int
) -> None:
    """Compute the inverse sum of the radii at each lane's contact (row INVERSE_SUM).

    The radii are those of the two surfaces at the contact. The kernel of the law needs
    the sum for the contact area.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch, history : numpy.ndarray
        The tiles of 32 contacts, one in each lane, see `law.surfaces`.
    of_spheres, on_wall : int
        Flags, 1 or 0: whether the contacts are those of spheres of clumps, and whether
        body B is a wall.
    """
    for lane in range(LANES):
        # A wall has an infinite radius.
        if on_wall:
            scratch[INVERSE_SUM + lane] = 0.0
        elif of_spheres:
            # Contacts of spheres of clumps keep the sum of the radii (row REACH), which
            # is 0 in unused lanes.
            sum_of_radii = history[clump_tile.REACH + lane]
            scratch[INVERSE_SUM + lane] = (
                1.0 / sum_of_radii if sum_of_radii > 0.0 else 0.0
            )
        else:
            # The radius of a smooth body is the geometric mean of its two radii of
            # curvature. AREA_A and AREA_B are the products of these radii. They are
            # above 0 in all lanes, also those of the absent body.
            sum_of_radii = math.sqrt(scratch[tile.AREA_A + lane]) + math.sqrt(
                scratch[tile.AREA_B + lane]
            )
            scratch[INVERSE_SUM + lane] = 1.0 / sum_of_radii


@inlined
def add_cohesion(scratch: np.ndarray, history: np.ndarray) -> None:
    """Add the cohesion k A to the force on body A of each lane, towards B.

    Call it after `compute_forces`, which writes this force. The row TO_A of `scratch`
    is changed.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    """
    for lane in range(LANES):
        gap = scratch[tile.GAP + lane]
        overlap = -gap if gap < 0.0 else 0.0
        cohesion = scratch[DENSITY + lane] * compute_contact_area(
            overlap, scratch[tile.RADIUS + lane], scratch[INVERSE_SUM + lane]
        )
        nx, ny, nz = lane_vector(history, state.NORMAL, lane)
        add_vector(
            scratch, tile.TO_A, lane, cohesion * nx, cohesion * ny, cohesion * nz
        )


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the forces of LANES contacts, one in each lane, of this time step.

    Parameters
    ----------
    law : namedtuple
        The options of the law as integers: `tension` and `friction_limit`.
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    compute_contact_circles(scratch)
    rescale_springs(scratch, history, first + SPRING, first + LAST_CIRCLE)
    update_springs(scratch, history, first + SPRING, dt)
    compute_forces(scratch, history, first + SPRING, law.tension, law.friction_limit)
    add_cohesion(scratch, history)


LAW = replace(
    RESCALED,
    name="sjkr",
    options=SimplifiedJkr,
    constants=constants,
    n_constants=hertz_mindlin.LAW.n_rows + 1,
    n_rows=_scratch_rows.count,
    kernel=kernel,
    words={
        "normal": RESCALED.words["normal"]
        + ", less k times the area of contact (LIGGGHTS: sjkr)",
        "tangential": RESCALED.words["tangential"],
    },
    limits={name: f"{text} without cohesion" for name, text in LIMITS.items()},
    ends={
        "keep": ENDS["keep"],
        "release": (
            "the force without cohesion never pulls; without cohesion the damping "
            "gives the restitution set"
        ),
    },
    asks=(COHESION_ENERGY_DENSITY,),
    geometry=geometry,
)
