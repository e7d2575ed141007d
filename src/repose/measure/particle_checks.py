"""Check that the particles of a file may be a pile, and that one pile was measured.

A number that would certainly be wrong is refused with an `InputError`. Signs that the
measured shape is no single pile are doubts, as of a photograph. All lengths are in the
unit of the file, unless a name says otherwise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from repose.common.errors import InputError
from repose.common.numbers import format_significant
from repose.measure.conventions import UNITS
from repose.measure.further_responses import measure_half_widths
from repose.measure.outline_shape import (
    DOUBT,
    PileSize,
    measure_drop,
    measure_rise,
    split_sides,
)
from repose.measure.particle_files import Particles

# Two bodies are at the same place if their centres are nearer than this fraction of the
# smallest semi-axis.
SAME_PLACE_FRACTION = 0.01
# Random places between the grains of a pile. Grains of any sizes leave more space.
N_PLACES = 2000
LARGEST_FILLED_FRACTION = 0.9
# The lowest grain of a pile is at most this many radii above the plate.
LARGEST_GAP_RADII = 1.0
# Share of a pile below the plate from which the plate cannot be right.
LARGEST_FRACTION_BELOW = 0.1
# Share of particles outside the measured pile that deserves a line.
LARGEST_FRACTION_OUTSIDE = 0.25
LARGEST_USUAL_RADIUS_M = 0.05
# Limits of the outline in heights of the pile. They are wider than those of
# photographs, because the file may hold spheres of clumps, which are smaller than the
# grains.
LARGEST_RISE_FRACTION_OF_SPHERES = 0.25
LARGEST_DROP_FRACTION_OF_SPHERES = 0.5
# Angles of a round pile differ between its views by less [degrees]. Those of a pile of
# fewer grains depend on single grains.
LARGEST_ANGLE_RANGE_DEG = 12.0
LOWEST_ROUND_PILE_GRAINS = 4.0
# A lowest layer that reaches farther beyond the grains above it is a floor: in heights
# of a grain, and as a fraction of the layer's radius
LARGEST_SKIRT_GRAINS = 6.0
LARGEST_SKIRT_FRACTION = 0.3


class MeasuredShape(NamedTuple):
    """The outlines from which doubts about a pile follow.

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


def require_distinct_places(particles: Particles, source: object) -> None:
    """Raise InputError if two bodies have the same centre."""
    from scipy.spatial import cKDTree

    if len(particles.centres) < 2:
        return
    # The nearest centre to each centre is itself, and the next one that of another
    # body.
    distances, neighbours = cKDTree(particles.centres).query(particles.centres, k=2)
    is_repeated = distances[:, 1] < SAME_PLACE_FRACTION * particles.semi_axes.min()
    if is_repeated.any():
        row = int(np.flatnonzero(is_repeated)[0])
        other = int(neighbours[row][neighbours[row] != row][0])
        raise InputError(
            source,
            key=f"row {row + 1}",
            value=f"a particle at the place of row {other + 1}",
            allowed="each particle once, at a single time",
        )


def require_space_between(
    centres: np.ndarray, radii: np.ndarray, *, unit: str, source: object
) -> None:
    """Raise InputError if spheres fill the pile without space between them.

    The spheres of a clump may overlap each other. Therefore the space is measured, at
    random places within the pile.

    Parameters
    ----------
    centres : ndarray
        Centres (N, 3) of the spheres in the pile.
    radii : ndarray
        Their radii (N,).
    unit : str
        The unit of both, for the message.
    source : object
        The file, for messages.
    """
    from scipy.spatial import cKDTree

    # A mean of four centres with random weights lies within the pile.
    rng = np.random.default_rng(0)
    corners = rng.integers(len(centres), size=(N_PLACES, 4))
    are_distinct = (np.diff(np.sort(corners)) > 0).all(axis=1)
    corners = corners[are_distinct]
    if len(corners) == 0:
        return
    weights = rng.dirichlet(np.ones(4), size=len(corners))
    places = np.einsum("nk,nki->ni", weights, centres[corners])

    # A place is filled if it lies within any sphere.
    tree = cKDTree(centres)
    largest_radius = float(radii.max())
    n_filled = 0
    for place in places:
        near = tree.query_ball_point(place, largest_radius)
        distances = np.linalg.norm(centres[near] - place, axis=1)
        n_filled += bool((distances < radii[near]).any())
    filled_fraction = n_filled / len(places)
    if filled_fraction > LARGEST_FILLED_FRACTION:
        raise InputError(
            source,
            key="radius",
            value=f"{format_significant(float(radii.mean()))} {unit}",
            allowed=f"the radius of grains with space between them; these fill "
            f"{filled_fraction:.0%} of the pile: is it the diameter?",
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
        Share of the touching particles that lie below the plate.
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


# --- remarks --------------------------------------------------------------------------


def list_doubts(shape: MeasuredShape) -> list[str]:
    """List the signs that a measured shape is no single pile.

    Parameters
    ----------
    shape : MeasuredShape
        Outlines of the pile. What happens in half of the views counts.

    Returns
    -------
    list of str
        A sentence for each doubt.
    """
    size = shape.size
    all_sides = [split_sides(*profile) for profile in shape.profiles]
    rise_mm = float(np.median([measure_rise(sides, size) for sides in all_sides]))
    drop_mm = float(np.median([measure_drop(sides, size) for sides in all_sides]))
    doubts = []
    if rise_mm > max(
        size.largest_rise_mm, LARGEST_RISE_FRACTION_OF_SPHERES * size.height_mm
    ):
        doubts.append(
            f"{DOUBT}: away from its crest the outline rises by {rise_mm / size.height_mm:.0%} of "
            "the Height, as of two piles"
        )
    if drop_mm > max(
        size.largest_drop_mm, LARGEST_DROP_FRACTION_OF_SPHERES * size.height_mm
    ):
        doubts.append(
            f"{DOUBT}: the outline falls by {drop_mm / size.height_mm:.0%} of the Height at once, "
            "as of grains that still fall, or of a wall of particles"
        )
    return doubts + _list_doubts_of_base(shape)


def _list_doubts_of_base(shape: MeasuredShape) -> list[str]:
    """List the signs that the foot of a pile is not that of a free round pile."""
    size = shape.size
    doubts = []
    angles = shape.angles_deg[np.isfinite(shape.angles_deg)]
    is_high = size.height_mm >= LOWEST_ROUND_PILE_GRAINS * size.grain_mm
    if is_high and angles.size and np.ptp(angles) > LARGEST_ANGLE_RANGE_DEG:
        doubts.append(
            f"{DOUBT}: its views have angles from {angles.min():.0f} to {angles.max():.0f} "
            "degrees: it is not round, as of a pile at a wall"
        )

    # Compare the radius within the lowest layer of grains with that above it.
    profiles = [profile for profile, _ in shape.profiles]
    levels_mm = [0.5 * size.grain_mm, 1.5 * size.grain_mm]
    layer_mm, above_mm = measure_half_widths(profiles, size.mm_per_pixel, levels_mm)
    skirt_mm = layer_mm - above_mm
    if (
        skirt_mm > LARGEST_SKIRT_GRAINS * size.grain_mm
        and skirt_mm > LARGEST_SKIRT_FRACTION * layer_mm
    ):
        doubts.append(
            f"{DOUBT}: its lowest layer of grains reaches {skirt_mm:.3g} mm beyond those above, as "
            "of a floor of particles: leave it out of the file, or give the plate by --base"
        )
    return doubts


def list_notes(
    particles: Particles,
    is_measured: np.ndarray,
    *,
    radius_m: float,
    n_below: int,
) -> list[str]:
    """List what a user should know about the particles that were measured.

    Parameters
    ----------
    particles : Particles
        N bodies.
    is_measured : ndarray
        Mask (N,) of the bodies in the measured pile.
    radius_m : float
        Mean radius of the bodies in m.
    n_below : int
        Number of bodies below the plate.

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
            f"lengths another one (--unit: one of {units})?"
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
