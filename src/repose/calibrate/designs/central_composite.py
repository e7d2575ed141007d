"""Central composite designs: a factorial, two axial runs per factor, centre runs."""

from typing import NamedTuple

import numpy as np

from repose.calibrate.designs.coding import make_full_factorial

# With at least this many factors, the factorial part is only the half fraction, which
# has half of the corners of the cube.
MIN_HALF_FRACTION_FACTORS = 5


class CentralComposite(NamedTuple):
    """A central composite design."""

    coded: np.ndarray  # (n, factors), the runs in coded units and standard order
    axial_distance: float  # distance of the axial runs from the centre


def central_composite(factors: int, axial: str, centres: int) -> CentralComposite:
    """Make a central composite design.

    The design is that of Box and Hunter, Multi-factor experimental designs for
    exploring response surfaces, Ann. Math. Statist. 28 (1957) 195-241.

    Parameters
    ----------
    factors : int
        Number of factors, from 2 to 7.
    axial : str
        With "rotatable" the axial distance is the fourth root of the number of
        factorial runs. The variance of a prediction then depends only on its distance
        from the centre. With any other word, such as "face_centred", the distance is 1,
        and there are only three levels.
    centres : int
        Number of centre runs.

    Returns
    -------
    CentralComposite
        The runs in coded units, and the axial distance.
    """
    if factors < MIN_HALF_FRACTION_FACTORS:
        corners = make_full_factorial(factors)
    else:
        # The half fraction: the last factor is the product of the others.
        corners = make_full_factorial(factors - 1)
        corners = np.column_stack([corners, corners.prod(axis=1)])
    distance = len(corners) ** 0.25 if axial == "rotatable" else 1.0
    # Each factor has two axial runs, at -distance and distance, in which all other
    # factors are 0.
    axial_runs = distance * np.kron(np.eye(factors), np.array([[-1.0], [1.0]]))
    centre_runs = np.zeros((centres, factors))
    coded = np.vstack([corners, axial_runs, centre_runs])
    return CentralComposite(coded, distance)
