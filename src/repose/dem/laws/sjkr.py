"""Hertz-Mindlin contact with a cohesion in proportion to the area of contact.

This is the simplified JKR model of LIGGGHTS.

The normal force of `hertz_mindlin_rescaled` less k A, with the cohesion energy density
k [J/m3] and the area A of the circle in which two spheres of radii r_a and r_b, at a
distance r of their centres, cut each other; on a wall r_a = R:

    A = pi/4 (r_a + r_b - r) (r + r_a - r_b) (r - r_a + r_b) (r + r_a + r_b) / r^2
    A = pi (R^2 - r^2)    on a wall

With delta = r_a + r_b - r, R* = r_a r_b / (r_a + r_b) and S = r_a + r_b both are

    A = pi/4 delta (2 S - delta) (4 R* S - 2 S delta + delta^2) / (S - delta)^2

with 1/S = 0 on a wall. That is about 2 pi R* delta. Of a smooth body r is the root of
the product of its two radii of curvature at the contact. There is no attraction across
a gap, and the strongest pull depends on the stiffness: at rest without load sqrt(delta)
= 3 pi k sqrt(R*) / (2 E*), about. Friction is limited by the normal force without
cohesion, as there.

Rows of the scratch tile `t`, after those of `hertz_mindlin`: DENSITY is k, INVERSE_SUM
1/S. A contact keeps in `c` the rows of `hertz_mindlin_rescaled`.

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
from ..kernels import clump_tile as ct
from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows, add_vector, lane_vector
from ..materials import Contact, Material
from . import hertz_mindlin
from .hertz_mindlin import contact_sizes, push
from .hertz_mindlin_rescaled import LAST_CIRCLE, SPRING, keep_force
from .hertz_mindlin_rescaled import LAW as RESCALED
from .law import ENDS, LIMITS
from .tangential import slip

SimplifiedJkr = namedtuple("SimplifiedJkr", "tension friction_limit")

_rows = Rows(tl.LAW)
_rows.take(hertz_mindlin.LAW.n_rows)
DENSITY = _rows.take()
INVERSE_SUM = _rows.take()


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of `hertz_mindlin`, zeros for its other rows, and k (n,).

    SI.
    """
    hertz_constants = hertz_mindlin.constants(a, b, contact, tension)
    values = np.zeros(hertz_mindlin.LAW.n_rows + 1)
    values[: hertz_mindlin.LAW.n_constants] = hertz_constants
    values[-1] = contact.constants[COHESION_ENERGY_DENSITY.name]
    return values


@inlined
def area(overlap: float, radius: float, inverse_sum: float) -> float:
    """Compute the area A of the circle in which two spheres cut each other.

    `radius` is R*, `inverse_sum` 1/S. The formula is that of the header, divided by S
    in the numerator and in the denominator, with share = delta / S.
    """
    # The limit keeps unused lanes finite, in which both bodies are in one place.
    share = min(overlap * inverse_sum, 0.5)
    factor = max(4.0 * radius - 2.0 * overlap + overlap * share, 0.0)
    numerator = 0.25 * math.pi * overlap * (2.0 - share) * factor
    return numerator / ((1.0 - share) * (1.0 - share))


def geometry(
    law: Any, t: np.ndarray, c: np.ndarray, of_spheres: int, on_wall: int
) -> None:
    """Compute the row INVERSE_SUM of each lane, as `law.surfaces` describes."""
    for k in range(L):
        if on_wall:
            t[INVERSE_SUM + k] = 0.0
        elif of_spheres:
            radii = c[ct.REACH + k]  # the sum of both
            t[INVERSE_SUM + k] = 1.0 / radii if radii > 0.0 else 0.0
        else:
            radii = math.sqrt(t[tl.AREA_A + k]) + math.sqrt(t[tl.AREA_B + k])
            t[INVERSE_SUM + k] = 1.0 / radii


@inlined
def pull(t: np.ndarray, c: np.ndarray) -> None:
    """Add the cohesion k A to the force on body A of each lane, towards B."""
    for k in range(L):
        gap = t[tl.GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        force = t[DENSITY + k] * area(overlap, t[tl.RADIUS + k], t[INVERSE_SUM + k])
        nx, ny, nz = lane_vector(c, st.NORMAL, k)
        add_vector(t, tl.TO_A, k, force * nx, force * ny, force * nz)


def kernel(law: Any, t: np.ndarray, c: np.ndarray, first: int, dt: float) -> None:
    """Compute the forces of each lane, as `law.contact_forces` describes."""
    contact_sizes(t)
    keep_force(t, c, first + SPRING, first + LAST_CIRCLE)
    slip(t, c, first + SPRING, dt)
    push(t, c, first + SPRING, law.tension, law.friction_limit)
    pull(t, c)


LAW = replace(
    RESCALED,
    name="sjkr",
    options=SimplifiedJkr,
    constants=constants,
    n_constants=hertz_mindlin.LAW.n_rows + 1,
    n_rows=_rows.count,
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
