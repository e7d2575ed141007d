"""Restitution of random hits of every kind of particle, in pairs and on a plane.

See `random_hits`.
"""

import numpy as np
import pytest
from verification.random_hits import STIFF_LIMIT, particles, simulate_hits

from repose.dem import Clump

pytestmark = pytest.mark.slow

RESTITUTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
HITS = 24  # of each particle and restitution
TOLERANCE = 0.02  # of the mean of stiff hits, absolute
TABLE = "restitution"  # of the page


def throw_all(case, stiffness, stiffening, laws):
    """Throw every particle at its like and at a plane.

    Yield the mean restitutions, and add the lines of the page.
    """
    for on_plane in (False, True):
        target = "on a plane" if on_plane else "pairs"
        for name, shape in particles().items():
            thrown = [
                simulate_hits(shape, e, stiffening, on_plane, HITS, **laws)
                for e in RESTITUTIONS
            ]
            cells = [f"{stiffness}, {target}", name]
            for hits in thrown:
                mean = np.nanmean(hits.restitution)
                spread = np.nanstd(hits.restitution)
                cells.append(f"{mean:.3f} ± {spread:.3f}")
            contacts = np.mean([hits.contacts for hits in thrown])
            cells.append(f"{contacts:.1f}" if isinstance(shape, Clump) else "1")
            case.add_line(TABLE, "| " + " | ".join(cells) + " |")
            means = [float(np.nanmean(hits.restitution)) for hits in thrown]
            yield f"{stiffness}, {target}, {name}", means


def test_stiff_hits(case, laws):
    """Stiff bodies of every shape rebound with the configured restitution."""
    for hit, means in throw_all(case, "stiff", STIFF_LIMIT, laws):
        for e, mean in zip(RESTITUTIONS, means, strict=True):
            case.close(f"{hit}: restitution at {e:g}", mean, e, TOLERANCE, scale=1.0)


def test_soft_hits(case, laws):
    """Soft bodies, which rotate during an impact, rebound roughly as configured."""
    for hit, means in throw_all(case, "soft", 1.0, laws):
        for e, mean in zip(RESTITUTIONS, means, strict=True):
            case.within(f"{hit}: restitution at {e:g}", mean, e - 0.16, e + 0.16)
