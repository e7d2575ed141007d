"""Rolling resistance law: a spring without a dashpot.

It is `epsd` without the rolling dashpot, and with the tangential stiffness in place of
the normal one:

    M_r = -k_r theta_r,     |M_r| <= mu_r F_c R,     k_r = k_s R^2,  k_s = 8 G* a

The lever R, the limit, the twisting spring and the rows are those of `epsd`. A sphere
that is held by the spring oscillates about its position.

References
----------
Iwashita and Oda, J. Eng. Mech. 124 (1998) 285. LIGGGHTS(R)-PUBLIC, rolling friction
model epsd2.
"""

from collections import namedtuple
from dataclasses import replace
from typing import Any

import numpy as np

from .epsd import LAW as EPSD
from .epsd import compute_torques

Epsd2 = namedtuple("Epsd2", "tension friction_limit")


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the torques on both bodies of 32 contacts, one in each lane.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch, history : numpy.ndarray
        The tiles of the contacts, see `law.rolling_resistance`.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    compute_torques(scratch, history, first, dt, 1, 0.0)


LAW = replace(
    EPSD,
    name="epsd2",
    options=Epsd2,
    kernel=kernel,
    words={
        "rolling": (
            "elastic-plastic spring against the rotation of one body relative to the "
            "other, without damping (LIGGGHTS: epsd2), at most mu_r times {limit} "
            "times the reduced lever; spin about the normal is resisted by at most "
            "mu_t (3 pi / 16 mu_s unless it is set) times {limit} times the radius "
            "of the contact circle"
        ),
    },
)
