"""Check that the particles of a file may be a pile, and that one pile was measured.

A number that is certainly wrong raises an `InputError`. A sign that the measured shape
is not a single pile is a warning, as for a photograph. All lengths are in the unit of
the file, unless a name says otherwise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from repose.common.errors import InputError
from repose.common.numbers import format_significant
from repose.measure.conventions import UNITS
from repose.measure.further_responses import measure_half_widths
from repose.measure.outline_shape import (
    DOUBTFUL,
    PileSize,
    measure_drop,
    measure_rise,
    split_sides,
)
from repose.measure.particle_files import Particles

# Two bodies have the same position if the distance of their centres is less than this
# fraction of the smallest semi-axis.
SAME_POSITION_FRACTION = 0.01
N_POINTS = 2000  # number of random points in a pile at which the space is measured
# Largest fraction of a pile that grains fill. Grains of any sizes leave more space.
LARGEST_FILLED_FRACTION = 0.9
# The lowest grain of a pile is at most this many radii above the plate.
LARGEST_GAP_RADII = 1.0
# If a larger fraction of a pile is below the plate, the plate cannot be right.
LARGEST_FRACTION_BELOW = 0.1
# If a larger fraction of particles is outside the measured pile, a note says so.
LARGEST_FRACTION_OUTSIDE = 0.25
LARGEST_USUAL_RADIUS_M = 0.05
# The largest rise and drop of the outline of a single pile, in heights of the pile.
# These limits are wider than the limits for photographs in `PileSize`, because the file
# may contain spheres of clumps, which are smaller than the grains. The larger of both
# limits counts.
LARGEST_RISE_FRACTION_OF_SPHERES = 0.25
LARGEST_DROP_FRACTION_OF_SPHERES = 0.5
# The angles of a round pile differ between its views by less than this [degrees].
LARGEST_ANGLE_RANGE_DEG = 12.0
# The angles of a pile that is lower than this, in heights of a grain, depend on single
# grains. They are not compared.
LOWEST_ROUND_PILE_GRAINS = 4.0
# If the lowest layer reaches farther beyond the grains above it than both of these
# limits, it is a floor. They are in heights of a grain, and in radii of the layer.
LARGEST_FRINGE_GRAINS = 6.0
LARGEST_FRINGE_FRACTION = 0.3
# Middle of the lowest layer of grains, and of the layer above it, in heights of a grain
LOWEST_LAYER_GRAINS = 0.5
SECOND_LAYER_GRAINS = 1.5


class MeasuredShape(NamedTuple):
    """The outlines of a pile in several views, from which warnings about it follow.

    Attributes
    ----------
    profiles : sequence of tuple
        For each view the profile (W,) and the column of its crest.
    size : PileSize
        Size of the pile, and scale of the views.
    angles_deg : ndarray, (V,)
        Angle along the whole side in each view; NaN if it was not measured.
    """

    profiles: Sequence[tuple[np.ndarray, int]]
    size: PileSize
    angles_deg: np.ndarray


# --- errors ---------------------------------------------------------------------------


def require_unit(particles: Particles, unit: str, source: object) -> None:
    """Raise InputError if a file states another unit of lengths than `unit`."""
    if particles.unit not in (None, unit):
        raise InputError(
            source,
            key="unit of lengths",
            value=unit,
            allowed=f"{particles.unit}, which the file states (--unit {particles.unit})",
        )


def require_distinct_positions(particles: Particles, source: object) -> None:
    """Raise InputError if two bodies have nearly the same centre.

    This happens if a file repeats a particle, or contains several time steps.

    Parameters
    ----------
    particles : Particles
        The bodies, in the order of the rows of the file.
    source : object
        The file, for messages.
    """
    from scipy.spatial import cKDTree

    if len(particles.centres) < 2:
        return
    # Find the two nearest centres to each centre. One of them is this centre itself.
    distances, neighbours = cKDTree(particles.centres).query(particles.centres, k=2)
    is_repeated = distances[:, 1] < SAME_POSITION_FRACTION * particles.semi_axes.min()
    if is_repeated.any():
        row = int(np.flatnonzero(is_repeated)[0])
        # If both centres are equal, the centre itself may come first or second.
        other = int(neighbours[row][neighbours[row] != row][0])
        raise InputError(
            source,
            key=f"row {row + 1}",
            value=f"a particle at the position of row {other + 1}",
            allowed="each particle once, at a single time",
        )


def require_space_between(
    centres: np.ndarray, radii: np.ndarray, *, unit: str, source: object
) -> None:
    """Raise InputError if spheres fill nearly the whole pile, so they are too large.

    The user has then probably given diameters in place of radii. The volumes of the
    spheres cannot be added up, because the spheres of a clump may overlap. So random
    points of the pile are checked. Nothing is checked for fewer than four spheres.

    Parameters
    ----------
    centres : ndarray
        Centres (N, 3) of the spheres in the pile.
    radii : ndarray
        Their radii (N,).
    unit : str
        The unit of centres and radii, for the message.
    source : object
        The file, for messages.
    """
    from scipy.spatial import cKDTree

    # Take random points in tetrahedra whose corners are the centres of four spheres of
    # the pile.
    rng = np.random.default_rng(0)
    corners = rng.integers(len(centres), size=(N_POINTS, 4))
    # Leave out tetrahedra in which a sphere occurs twice. Its number then follows
    # itself in the sorted order.
    are_distinct = (np.diff(np.sort(corners)) > 0).all(axis=1)
    corners = corners[are_distinct]
    if len(corners) == 0:
        return
    weights = rng.dirichlet(np.ones(4), size=len(corners))
    points = np.einsum("nk,nki->ni", weights, centres[corners])

    # A point is filled if it lies within any sphere.
    tree = cKDTree(centres)
    largest_radius = float(radii.max())
    n_filled = 0
    for point in points:
        near = tree.query_ball_point(point, largest_radius)
        distances = np.linalg.norm(centres[near] - point, axis=1)
        n_filled += bool((distances < radii[near]).any())
    filled_fraction = n_filled / len(points)
    if filled_fraction > LARGEST_FILLED_FRACTION:
        raise InputError(
            source,
            key="radius",
            value=f"{format_significant(float(radii.mean()))} {unit}",
            allowed="the radius of grains with space between them; these grains fill "
            f"{filled_fraction:.0%} of the pile: is the given radius the diameter?",
        )


def require_touched_plate(
    base: float, *, lowest: float, radius: float, source: object
) -> None:
    """Raise InputError if no grain of the pile touches the plate.

    Parameters
    ----------
    base : float
        Height of the plate.
    lowest : float
        Height of the lowest point of the pile.
    radius : float
        Mean radius of the particles.
    source : object
        The file, for messages.
    """
    if lowest - base > LARGEST_GAP_RADII * radius:
        raise InputError(
            source,
            key="base",
            value=float(format_significant(base)),
            allowed="the height of the plate that the pile touches; its lowest grain is "
            f"at {format_significant(lowest)} (--base)",
        )


def require_pile_above(fraction_below: float, *, base: float, source: object) -> None:
    """Raise InputError if much of a pile lies below the plate that was found for it.

    Parameters
    ----------
    fraction_below : float
        Fraction of the touching particles that lie below the plate.
    base : float
        Height of the plate.
    source : object
        The file, for messages.
    """
    if fraction_below > LARGEST_FRACTION_BELOW:
        raise InputError(
            source,
            key="base",
            value=f"unclear: {fraction_below:.0%} of the pile is below the plane on which "
            f"most grains lie, {format_significant(base)}",
            allowed="--up, the direction against gravity, or --base, the height of the "
            "plate",
        )


# --- warnings and notes ---------------------------------------------------------------


def list_warnings(shape: MeasuredShape) -> list[str]:
    """List the signs that a measured shape is not a single pile.

    The outline of a single pile does not rise again away from its crest, and does not
    drop abruptly.

    Parameters
    ----------
    shape : MeasuredShape
        Outlines of the pile. The rise and the drop are medians over the views.

    Returns
    -------
    list of str
        A sentence for each warning, which begins with `DOUBTFUL`.
    """
    size = shape.size
    all_sides = [split_sides(*profile) for profile in shape.profiles]
    rise_mm = float(np.median([measure_rise(sides, size) for sides in all_sides]))
    drop_mm = float(np.median([measure_drop(sides, size) for sides in all_sides]))
    warnings = []
    largest_rise_mm = max(
        size.largest_rise_mm, LARGEST_RISE_FRACTION_OF_SPHERES * size.height_mm
    )
    if rise_mm > largest_rise_mm:
        warnings.append(
            f"{DOUBTFUL}: away from its crest the outline rises by "
            f"{rise_mm / size.height_mm:.0%} of the pile's height, as with two piles"
        )
    largest_drop_mm = max(
        size.largest_drop_mm, LARGEST_DROP_FRACTION_OF_SPHERES * size.height_mm
    )
    if drop_mm > largest_drop_mm:
        warnings.append(
            f"{DOUBTFUL}: the outline falls by {drop_mm / size.height_mm:.0%} of the "
            "pile's height at once, as with grains that are still falling, or with a "
            "wall made of particles"
        )
    warnings += [_make_roundness_warning(shape), _make_floor_warning(shape)]
    return [warning for warning in warnings if warning]


def _make_roundness_warning(shape: MeasuredShape) -> str:
    """Return a warning if the angles of the views differ much, else an empty string."""
    size = shape.size
    angles = shape.angles_deg[np.isfinite(shape.angles_deg)]
    is_too_low = size.height_mm < LOWEST_ROUND_PILE_GRAINS * size.grain_mm
    if is_too_low or not angles.size or np.ptp(angles) <= LARGEST_ANGLE_RANGE_DEG:
        return ""
    return (
        f"{DOUBTFUL}: its views have angles from {angles.min():.0f} to "
        f"{angles.max():.0f} degrees, so the pile is not round, as with a pile against "
        "a wall"
    )


def _make_floor_warning(shape: MeasuredShape) -> str:
    """Return a warning if the lowest layer reaches far beyond the pile, else no text.

    Such a layer is probably a floor made of particles. Its width is compared with the
    width of the layer above it.
    """
    size = shape.size
    profiles = [profile for profile, _ in shape.profiles]
    levels_mm = [
        LOWEST_LAYER_GRAINS * size.grain_mm,
        SECOND_LAYER_GRAINS * size.grain_mm,
    ]
    lowest_radius_mm, second_radius_mm = measure_half_widths(
        profiles, size.mm_per_pixel, levels_mm
    )
    fringe_mm = lowest_radius_mm - second_radius_mm
    is_floor = (
        fringe_mm > LARGEST_FRINGE_GRAINS * size.grain_mm
        and fringe_mm > LARGEST_FRINGE_FRACTION * lowest_radius_mm
    )
    if not is_floor:
        return ""
    return (
        f"{DOUBTFUL}: its lowest layer of grains reaches {fringe_mm:.3g} mm beyond the "
        "grains above, as with a floor made of particles; leave the floor out of the "
        "file, or give the height of the plate by --base"
    )


def list_notes(
    particles: Particles,
    is_measured: np.ndarray,
    *,
    radius_m: float,
    n_below: int,
) -> list[str]:
    """List notes on unusual particles, which do not make a pile doubtful.

    A note says that particles are large, that many of them are outside the pile, or
    that the pile has particles of several types.

    Parameters
    ----------
    particles : Particles
        N bodies.
    is_measured : ndarray
        Mask (N,) of the bodies in the measured pile.
    radius_m : float
        Mean radius of the bodies in m.
    n_below : int
        Number of bodies below the plate. They are outside the pile, too.

    Returns
    -------
    list of str
        A sentence for each note.
    """
    notes = []
    if radius_m > LARGEST_USUAL_RADIUS_M:
        units = ", ".join(UNITS)
        notes.append(
            f"its grains are {format_significant(2 * radius_m)} m wide; is the unit of "
            f"lengths wrong (--unit: one of {units})?"
        )
    n_bodies = len(is_measured)
    n_outside = n_bodies - int(is_measured.sum())
    if n_outside > LARGEST_FRACTION_OUTSIDE * n_bodies:
        notes.append(
            f"{n_outside} of {n_bodies} particles do not belong to the measured pile, "
            f"{n_below} of them below the plate"
        )
    counts = _count_types(particles.types, is_measured)
    if len(counts) > 1:
        listed = ", ".join(f"{name} ({count})" for name, count in counts.items())
        notes.append(
            f"the measured pile has particles of types {listed}; if a type is a wall or "
            "floor, leave it out of the file"
        )
    return notes


def _count_types(types: np.ndarray, is_measured: np.ndarray) -> Mapping[str, int]:
    """Count the bodies of each type in the measured pile; empty without types."""
    if len(types) == 0:
        return {}
    names, counts = np.unique(types[is_measured], return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))
