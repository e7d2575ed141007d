"""Contact law of Hertz and Mindlin whose tangential force falls with the normal load.

It is `hertz_mindlin` with another tangential spring.

In `hertz_mindlin`, the force of the spring is S_t delta_t with the present stiffness
S_t. The force therefore grows when the contact is pressed, without any work being done,
and a closed path (slide, press, slide back, unload) can yield energy. Here the force
does not change when the contact is pressed, and decreases with the radius a of the
contact circle when it is unloaded:

    dF_t = -S_t v_t dt                  where a grows,      S_t = 8 G* a
    dF_t = -S_t v_t dt + F_t da / a     where it shrinks

The contact keeps delta_t, where F_t = -S_t delta_t. When a grows, delta_t is multiplied
by the ratio of the previous a to the present one. LAMMPS calls this law
`mindlin_rescale/force`.

The rows are those of `hertz_mindlin`. A contact keeps one more row in `history`:
LAST_CIRCLE, the radius a of the previous step.

References
----------
Mindlin and Deresiewicz, J. Appl. Mech. 20 (1953) 327. Elata and Berryman, Mech. Mater.
24 (1996) 229: the energy of closed paths. Thornton, Cummins and Cleary, Powder Technol.
210 (2011) 189: the force lowered on unloading.
"""

from collections import namedtuple
from dataclasses import replace
from typing import Any

import numpy as np

from ..kernels import tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows
from .hertz_mindlin import LAW as HERTZ_MINDLIN
from .hertz_mindlin import compute_contact_circles, compute_forces
from .tangential import update_springs

HertzMindlinRescaled = namedtuple("HertzMindlinRescaled", "tension friction_limit")

_history_rows = Rows()
SPRING = _history_rows.take(3)
LAST_CIRCLE = _history_rows.take()


@inlined
def rescale_springs(
    scratch: np.ndarray, history: np.ndarray, spring: int, last_circle: int
) -> None:
    """Shorten springs of contacts whose circle has grown, so that their force is kept.

    The stiffness of a spring is proportional to the radius of the contact circle. When
    the radius grows by a factor since the last step, the length of the spring is
    divided by this factor. When it shrinks, the spring stays as it is. The springs and
    the radii in `history` are changed.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    spring, last_circle : int
        Indices at which rows of `history` begin: the three rows of the spring, and the
        radius of the contact circle in the previous step [m]. The radius is updated.
    """
    for lane in range(LANES):
        circle = scratch[tile.CIRCLE + lane]
        old_circle = history[last_circle + lane]
        # The spring becomes shorter by the factor by which its stiffness grows.
        factor = old_circle / circle if circle > old_circle else 1.0
        history[last_circle + lane] = circle
        history[spring + lane] *= factor
        history[spring + LANES + lane] *= factor
        history[spring + 2 * LANES + lane] *= factor


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


LAW = replace(
    HERTZ_MINDLIN,
    name="hertz_mindlin_rescaled",
    options=HertzMindlinRescaled,
    n_state=_history_rows.count,
    kernel=kernel,
    words={
        "normal": HERTZ_MINDLIN.words["normal"],
        "tangential": (
            "Mindlin without slip, damped, its force kept on loading and lowered on "
            "unloading (LAMMPS: mindlin_rescale/force); Coulomb's limit mu_s times "
            "{limit}"
        ),
    },
)
