"""Hertz-Mindlin contact whose tangential force falls with the normal load: `hertz_mindlin` with another spring.

There the spring's force is S_t delta_t with the present S_t. So it grows when the contact is pressed, without any work,
and a closed path (slide, press, slide back, unload) can give energy. Here pressing leaves the force as it is, and
unloading lowers it with the radius a of the contact circle:

    dF_t = -S_t v_t dt  where a grows,    dF_t = -S_t v_t dt + F_t da / a  where it shrinks,    S_t = 8 G* a

Kept as delta_t with F_t = -S_t delta_t, that is delta_t times a_before / a where a grows. LAMMPS calls it
`mindlin_rescale/force`.

References
----------
Mindlin and Deresiewicz, J. Appl. Mech. 20 (1953) 327. Elata and Berryman, Mech. Mater. 24 (1996) 229: the energy of
closed paths. Thornton, Cummins and Cleary, Powder Technol. 210 (2011) 189: the force lowered on unloading.
"""

from collections import namedtuple
from dataclasses import replace
from typing import Any

import numpy as np

from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows
from .hertz_mindlin import LAW as HERTZ_MINDLIN
from .hertz_mindlin import contact_sizes, push
from .tangential import slip

HertzMindlinRescaled = namedtuple("HertzMindlinRescaled", "tension friction_limit")

_state = Rows()
SPRING = _state.take(3)
LAST_CIRCLE = _state.take()  # radius of the contact circle a step ago


@inlined
def keep_force(t: np.ndarray, c: np.ndarray, spring: int, last: int) -> None:
    """Shorten the springs of the contacts that were pressed, so that their force stays."""
    for k in range(L):
        circle, before = t[tl.CIRCLE + k], c[last + k]
        share = before / circle if circle > before else 1.0
        c[last + k] = circle
        c[spring + k] *= share
        c[spring + L + k] *= share
        c[spring + 2 * L + k] *= share


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the forces of each lane, as `law.contact_forces` asks for them."""
    contact_sizes(t)
    keep_force(t, c, at + SPRING, at + LAST_CIRCLE)
    slip(t, c, at + SPRING, dt)
    push(t, c, at + SPRING, law.tension, law.friction_limit)


LAW = replace(
    HERTZ_MINDLIN,
    name="hertz_mindlin_rescaled",
    options=HertzMindlinRescaled,
    n_state=_state.count,
    kernel=kernel,
    words={
        "normal": HERTZ_MINDLIN.words["normal"],
        "tangential": "Mindlin without slip, damped, its force kept on loading and lowered on unloading (LAMMPS: "
        "mindlin_rescale/force); Coulomb's limit mu_s times {limit}",
    },
)
