"""Measure a pile of any simulator from positions and sizes of its particles.

The pile is turned until gravity points down and shifted until its base lies at z = 0.
Then it is measured as a simulated pile of this program: from several sides, by the code
that measures photographs. Spheres may belong to clumps; ellipsoids may all differ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repose.common.errors import InputError, NoFlankError
from repose.common.numbers import format_significant
from repose.common.section import AUTO
from repose.dem.rotations import rotation_matrices
from repose.measure import particle_checks as checks
from repose.measure import pile
from repose.measure.clusters import largest_cluster
from repose.measure.conventions import DIRECTIONS, UNITS
from repose.measure.further_responses import measure_scatter, measure_silhouettes
from repose.measure.outline_shape import PileSize
from repose.measure.particle_files import NO_ROTATION, Particles
from repose.measure.results import PileResult
from repose.measure.settings import (
    COARSEST_MM_PER_PIXEL,
    FINEST_MM_PER_PIXEL,
    MeasureSettings,
)
from repose.measure.silhouette import Grains

# Radii [m] of grains, from a powder to a boulder; others show a wrong unit.
RADII_M = (1e-6, 1.0)
# Pixels across a grain of the file, where the settings leave the scale to the program.
PIXELS_PER_GRAIN = 32
# Thickness of the layer that holds the lowest points of all grains on the base, in
# radii
LAYER_RADII = 0.2
# The direction against gravity is clear only if the base has at least this many times
# as many grains as the best plane across any other direction.
MIN_COUNT_RATIO = 2.0
# Gap [radii] up to which spheres count as touching: positions are rounded when written.
CONTACT_GAP_RADII = 1e-3


@dataclass
class Ellipsoids(Grains):
    """N ellipsoids with different semi-axes (N, 3) in m. They have no `particle`."""

    particle: Any = None
    semi_axes_m: Any = None

    def support_points(self, normals: np.ndarray) -> np.ndarray:
        """Compute the points (N, K, 3) at which tangent planes touch the ellipsoids."""
        scaled = self.semi_axes_m[:, None] * normals
        distance = np.linalg.norm(scaled, axis=-1, keepdims=True)
        return self.semi_axes_m[:, None] * scaled / distance

    def __getitem__(self, selected: np.ndarray) -> "Ellipsoids":
        """Select ellipsoids by a mask (N,)."""
        return Ellipsoids(
            centres_m=self.centres_m[selected],
            quaternions=self.quaternions[selected],
            scales=self.scales[selected],
            semi_axes_m=self.semi_axes_m[selected],
        )


class _UnitSphere:
    """A sphere of radius 1 m. A grain's scale is then its radius in m."""

    spheres_m = np.array([[0.0, 0.0, 0.0, 1.0]])

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Compute the points at which planes of unit normals touch the sphere."""
        return n


@dataclass(frozen=True)
class ParticlePile:
    """The measured pile of a file of particles.

    Attributes
    ----------
    result : PileResult
        Angles by every line, and the Height.
    other_responses : dict
        ``packing_percent``, ``loose_percent`` and others of
        `repose.measure.further_responses`.
    up : str
        The direction that points up in the file.
    base : float
        Height of the base along it, in the unit of the file.
    n_grains, n_particles : int
        Numbers of grains and of their bodies that do not lie below the plate.
    warnings : tuple of str
        Signs that the measured shape is not a single pile. A pile with a warning is
        called doubtful.
    notes : tuple of str
        What a user should know about the particles that were measured.
    """

    result: PileResult
    other_responses: dict[str, float]
    up: str
    base: float
    n_grains: int
    n_particles: int
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def measure_particles(
    particles: Particles,
    settings: MeasureSettings | None = None,
    *,
    unit: str = "m",
    up: str | None = None,
    base: float | None = None,
    source: object = "particles",
) -> ParticlePile:
    """Measure the pile of a file of particles.

    Parameters
    ----------
    particles : Particles
        N bodies.
    settings : MeasureSettings, optional
        Settings as for a photograph. If they lack the height of a grain, it is the
        diameter of a sphere of the grains' mean volume. If the scale is `auto`, which
        is the default, a grain is `PIXELS_PER_GRAIN` pixels wide.
    unit : str
        Unit of lengths in the file, one of `UNITS`.
    up : str, optional
        Direction against gravity, one of `DIRECTIONS`. By default, `find_up` finds it.
    base : float, optional
        Height of the plate along `up`, in the unit of the file. By default, it is the
        median height of the lowest points of the grains in the lowest layer.
    source : object
        The file, for messages.

    Returns
    -------
    ParticlePile
        The measured pile.

    Raises
    ------
    InputError
        If the unit, the sizes or the height of the plate cannot be right, or if the
        direction of gravity is not clear.
    NoFlankError
        If there is no pile.
    """
    checks.require_unit(particles, unit, source)
    metres_per_unit = UNITS[unit]
    radius = particles.mean_radius
    _require_plausible_radius(radius, unit, source)
    checks.require_distinct_positions(particles, source)

    # Turn the pile upright, and shift its base to z = 0.
    if up is None:
        up = find_up(particles, source)
    up_vector = np.array(DIRECTIONS[up])
    bottoms = _find_lowest_points(particles, up_vector)
    is_base_given = base is not None
    if base is None:
        base = _find_base(bottoms, LAYER_RADII * radius)
    rotation = _make_rotation_to_z(up_vector)
    centres = particles.centres @ rotation.T
    _require_base_below(base, highest=centres[:, 2].max(), source=source)
    centres[:, 2] -= base

    # Contacts separate the pile from loose grains. They are known only between spheres.
    # No grain of a pile lies below the plate.
    is_above = centres[:, 2] > 0
    in_pile = None
    if particles.are_spheres:
        in_pile = _mark_pile(particles, centres)
        if not is_base_given:
            fraction_below = float(1 - is_above[in_pile].mean())
            checks.require_pile_above(fraction_below, base=base, source=source)
        if not is_above.all():
            in_pile = _mark_pile(particles, centres, is_above)
    is_measured = is_above if in_pile is None else in_pile
    checks.require_touched_plate(
        base, lowest=float(bottoms[is_measured].min()), radius=radius, source=source
    )

    # Draw the pile. `prepare_views` rejects a mere layer of grains, in which
    # `require_space_between` would find no space.
    grains = _make_grains(
        particles, centres * metres_per_unit, rotation, metres_per_unit
    )
    complete_settings = _complete_settings(settings, particles, metres_per_unit)
    height_m, views = pile.prepare_views(grains, complete_settings, in_pile)
    if in_pile is not None:
        radii = particles.semi_axes[in_pile, 0]
        checks.require_space_between(centres[in_pile], radii, unit=unit, source=source)
    profiles = [pile.find_profile(view) for view in views]

    result = pile.measure_profiles(profiles, height_m, complete_settings)
    shape = _measure_shape(
        [profile for profile, _ in profiles],
        height_m,
        complete_settings,
        _compute_pile_volume(particles, is_measured, metres_per_unit),
    )
    scatter = {} if in_pile is None else _measure_scatter(grains, in_pile)
    outlines = checks.MeasuredShape(
        profiles,
        _describe_size(particles, height_m, complete_settings, metres_per_unit),
        angles_deg=result.aor["whole"],
    )
    notes = checks.list_notes(
        particles,
        is_measured,
        radius_m=radius * metres_per_unit,
        n_below=int((~is_above).sum()),
    )
    return ParticlePile(
        result=result,
        other_responses=shape | scatter,
        up=up,
        base=base,
        n_grains=len(np.unique(particles.grains[is_above])),
        n_particles=int(is_above.sum()),
        warnings=tuple(checks.list_warnings(outlines)),
        notes=tuple(notes),
    )


def _require_plausible_radius(radius: float, unit: str, source: object) -> None:
    """Raise InputError for an impossible radius, which shows a wrong unit of lengths.

    Parameters
    ----------
    radius : float
        Mean radius of the particles in the unit.
    unit : str
        One of `UNITS`.
    source : object
        The file, for messages.
    """
    low, high = RADII_M
    if not low <= radius * UNITS[unit] <= high:
        raise InputError(
            source,
            key="radius",
            value=f"{format_significant(radius)} {unit}",
            allowed=f"a radius from {low:g} to {high:g} m; is the unit of lengths wrong?",
        )


def _require_base_below(base: float, *, highest: float, source: object) -> None:
    """Raise InputError if the plate lies above the centres of all particles.

    Parameters
    ----------
    base : float
        Height of the plate, in the unit of the file.
    highest : float
        Height of the highest centre.
    source : object
        The file, for messages.
    """
    if base >= highest:
        raise InputError(
            source,
            key="base",
            value=base,
            allowed=f"a height of the plate below all grains, less than {format_significant(highest)}",
        )


# --- gravity and base -----------------------------------------------------------------


def find_up(particles: Particles, source: object = "particles") -> str:
    """Find the direction against gravity from the plane on which most grains lie.

    The plane is the plate, on which the lowest layer of the pile lies. The direction is
    perpendicular to it.

    Parameters
    ----------
    particles : Particles
        N bodies.
    source : object
        The file, for messages.

    Returns
    -------
    str
        One of `DIRECTIONS`.

    Raises
    ------
    InputError
        If no direction has clearly more grains on its plane than all others.
    """
    layer_thickness = LAYER_RADII * particles.mean_radius
    counts = {}
    for name, direction in DIRECTIONS.items():
        bottoms = _find_lowest_points(particles, np.array(direction))
        base = _find_base(bottoms, layer_thickness)
        is_on_base = np.abs(bottoms - base) < layer_thickness
        # No grain of a pile lies below the plate. So subtract each grain below the
        # plane from the number of grains on it.
        is_below = bottoms < base - layer_thickness
        counts[name] = int(is_on_base.sum()) - int(is_below.sum())
    first, second, *_ = sorted(counts, key=lambda name: -counts[name])
    if counts[first] < MIN_COUNT_RATIO * max(counts[second], 1):
        raise InputError(
            source,
            key="direction of gravity",
            value=f"unclear: the best plane across {first} has {max(counts[first], 0)} "
            f"more grains on it than below it, and the best plane across {second} has "
            f"{max(counts[second], 0)} more",
            allowed=f"--up, one of {', '.join(DIRECTIONS)}",
        )
    return first


def _find_lowest_points(particles: Particles, up: np.ndarray) -> np.ndarray:
    """Compute the height of the lowest point of each body.

    Parameters
    ----------
    particles : Particles
        N bodies.
    up : ndarray
        Unit vector (3,) against gravity.

    Returns
    -------
    ndarray
        Heights (N,) along `up`, in the unit of the file.
    """
    # The ellipsoid with semi-axes a, b, c extends by sqrt((a ux)² + (b uy)² + (c uz)²)
    # from its centre along a unit vector u in its own frame. The sum over i turns `up`
    # into this frame, by the transpose of the rotation.
    up_body = np.einsum("nij,i->nj", rotation_matrices(particles.quaternions), up)
    reach = np.linalg.norm(particles.semi_axes * up_body, axis=1)
    return particles.centres @ up - reach


def _find_base(bottoms: np.ndarray, layer_thickness: float) -> float:
    """Find the height of the plate, as the median of the lowest layer of grains.

    This layer is the densest one of a given thickness, so that grains that fell from
    the plate do not count. If several layers are equally dense, it is the lowest.

    Parameters
    ----------
    bottoms : ndarray
        Heights (N,) of the lowest points of the bodies.
    layer_thickness : float
        Thickness of the layer, in the same unit.
    """
    # Let a layer begin at each bottom, and count the bottoms within its thickness.
    ordered = np.sort(bottoms)
    ends = np.searchsorted(ordered, ordered + layer_thickness, side="right")
    counts = ends - np.arange(len(ordered))
    first = int(np.argmax(counts))
    return float(np.median(ordered[first : ends[first]]))


def _make_rotation_to_z(up: np.ndarray) -> np.ndarray:
    """Make the rotation matrix that turns a direction along an axis into z.

    Parameters
    ----------
    up : ndarray
        Unit vector (3,) along one of the axes, in either sense.

    Returns
    -------
    ndarray
        Rotation matrix (3, 3), whose third row is `up`.
    """
    axis = int(np.argmax(np.abs(up)))
    if axis == 2:
        # Half a turn about x if `up` points along -z, else no rotation
        return np.diag([1.0, up[2], up[2]])
    # The new x is the other one of the axes x and y of the file.
    across = np.zeros(3)
    across[1 - axis] = 1.0
    return np.array([across, np.cross(up, across), up])


# --- the pile -------------------------------------------------------------------------


def _make_grains(
    particles: Particles,
    centres_m: np.ndarray,
    rotation: np.ndarray,
    metres_per_unit: float,
) -> Grains:
    """Convert the bodies of a file to grains, in metres and with z pointing up.

    Parameters
    ----------
    particles : Particles
        N bodies in the frame and the unit of the file. Their orientations and sizes are
        converted here.
    centres_m : ndarray
        Their centres (N, 3), already in m and in the new frame.
    rotation : ndarray
        Rotation (3, 3) from the file's frame to the new one.
    metres_per_unit : float
        Number of metres in one unit of length of the file.

    Returns
    -------
    Grains
        The bodies. They are `Ellipsoids`, a subclass, unless all of them are spheres.
    """
    from scipy.spatial.transform import Rotation

    if particles.are_spheres:
        # A sphere looks the same in any orientation. Each one is a sphere of radius 1 m
        # in the scale of its radius in m; its three semi-axes are equal.
        identity_quaternions = np.tile(NO_ROTATION, (len(centres_m), 1))
        radii_m = particles.semi_axes[:, 0] * metres_per_unit
        return Grains(centres_m, identity_quaternions, _UnitSphere(), radii_m)
    orientations = Rotation.from_quat(particles.quaternions, scalar_first=True)
    new_orientations = Rotation.from_matrix(rotation) * orientations
    return Ellipsoids(
        centres_m,
        new_orientations.as_quat(scalar_first=True),
        semi_axes_m=particles.semi_axes * metres_per_unit,
    )


def _mark_pile(
    particles: Particles, centres: np.ndarray, allowed: np.ndarray | None = None
) -> np.ndarray:
    """Mark the spheres in the pile, which is the largest cluster of touching grains.

    A grain is a single sphere, or a clump of several spheres. Two clumps touch each
    other if any two of their spheres do.

    Parameters
    ----------
    particles : Particles
        N bodies in the unit of the file; all of them are spheres.
    centres : ndarray
        Centres (N, 3) in the same unit, which may be turned and shifted.
    allowed : ndarray, optional
        Mask (N,) of the spheres that may belong to the pile. By default, all may.

    Returns
    -------
    ndarray
        Mask (N,) of the spheres in the pile.
    """
    from scipy.spatial import cKDTree

    # Find the pairs of spheres that are near enough to touch, and keep those that do.
    radii = particles.semi_axes[:, 0]
    gap = CONTACT_GAP_RADII * float(radii.mean())
    largest_distance = 2 * float(radii.max()) + gap
    pairs = cKDTree(centres).query_pairs(largest_distance, output_type="ndarray")
    first, second = pairs.T
    distances = np.linalg.norm(centres[first] - centres[second], axis=1)
    is_touching = distances <= radii[first] + radii[second] + gap

    # A contact of two spheres is a contact of their grains. Grains have the numbers 0,
    # 1, 2 and so on.
    grains = particles.grains
    contacts = grains[pairs[is_touching]]
    is_grain_allowed = np.zeros(int(grains.max()) + 1, bool)
    is_grain_allowed[grains if allowed is None else grains[allowed]] = True
    is_in_pile = largest_cluster(contacts, is_grain_allowed)
    return is_in_pile[grains]


def _choose_scale(diameter_mm: float) -> float:
    """Choose the scale of the views in mm per pixel, so that they resolve a grain.

    `diameter_mm` is the diameter of a grain. The scale stays within its bounds.
    """
    scale = diameter_mm / PIXELS_PER_GRAIN
    return min(max(scale, FINEST_MM_PER_PIXEL), COARSEST_MM_PER_PIXEL)


def _complete_settings(
    settings: MeasureSettings | None, particles: Particles, metres_per_unit: float
) -> MeasureSettings:
    """Complete the settings with the scale of the views and the height of a grain.

    The scale depends on the size of a body of the file, because the views show these
    bodies. The height is that of a whole grain, which may be a clump of several bodies.

    Parameters
    ----------
    settings : MeasureSettings or None
        The user's settings. If they lack the height of a grain, it is set to the
        diameter of a sphere with the mean volume of the grains.
    particles : Particles
        The bodies.
    metres_per_unit : float
        Number of metres in one unit of length of the file.

    Returns
    -------
    MeasureSettings
        The settings with a scale and the height of a grain.
    """
    settings = settings or MeasureSettings.with_defaults(mm_per_pixel=AUTO)
    if settings.mm_per_pixel == AUTO:
        # Twice the radius, and 1000 mm in a metre
        diameter_mm = 2e3 * particles.mean_radius * metres_per_unit
        settings = settings.with_scale(_choose_scale(diameter_mm))
    if settings.berry_height_mm is not None:
        return settings
    # A sphere of the volume V has the diameter (6 V / pi) ** (1 / 3).
    volume_m3 = _compute_volumes(particles).sum() * metres_per_unit**3
    n_grains = len(np.unique(particles.grains))
    height_mm = 1e3 * (6 / math.pi * volume_m3 / n_grains) ** (1 / 3)
    return settings.with_grain_height(height_mm)


def _describe_size(
    particles: Particles,
    height_m: float,
    settings: MeasureSettings,
    metres_per_unit: float,
) -> PileSize:
    """Return the size of a pile, on which the limits of its outline depend.

    Parameters
    ----------
    particles : Particles
        The bodies. The longest axis of long ones counts as the height of a grain.
    height_m : float
        Height of the pile.
    settings : MeasureSettings
        Settings with the scale of the views and the height of a grain.
    metres_per_unit : float
        Number of metres in one unit of length of the file.
    """
    # `_complete_settings` has set both.
    assert settings.berry_height_mm is not None
    assert not isinstance(settings.mm_per_pixel, str)
    longest_mm = 2e3 * float(particles.semi_axes.mean(axis=0).max()) * metres_per_unit
    return PileSize(
        height_mm=1e3 * height_m,
        grain_mm=max(settings.berry_height_mm, longest_mm),
        mm_per_pixel=settings.mm_per_pixel,
    )


def _compute_volumes(particles: Particles) -> np.ndarray:
    """Compute the volumes (N,) of the bodies; spheres of a clump may overlap."""
    return 4 / 3 * math.pi * particles.semi_axes.prod(axis=1)


def _compute_pile_volume(
    particles: Particles, is_measured: np.ndarray, metres_per_unit: float
) -> float | None:
    """Compute the volume of the particles in the pile in m³.

    Parameters
    ----------
    particles : Particles
        N bodies.
    is_measured : ndarray
        Mask (N,) of the bodies in the pile.
    metres_per_unit : float
        Number of metres in one unit of length of the file.

    Returns
    -------
    float or None
        The volume. None if there are clumps, whose spheres overlap by unknown volumes.
    """
    n_grains = len(np.unique(particles.grains))
    if n_grains < len(particles.grains):
        return None
    volumes_m3 = _compute_volumes(particles)[is_measured] * metres_per_unit**3
    return float(volumes_m3.sum())


def _measure_shape(
    profiles: Sequence[np.ndarray],
    height_m: float,
    settings: MeasureSettings,
    volume_m3: float | None,
) -> dict[str, float]:
    """Measure the base and the flanks of the pile, and how densely grains fill it.

    Parameters
    ----------
    profiles : sequence of ndarray
        For each view the heights (W,) of all columns over the plate in pixels.
    height_m : float
        Height of the pile.
    settings : MeasureSettings
        Settings with the height of a grain, from `_complete_settings`.
    volume_m3 : float or None
        Volume of the grains in the pile; None if it is unknown.

    Returns
    -------
    dict
        The responses by name. The dict is empty if `measure_silhouettes` raises
        NoFlankError, which means that the pile is too low. It has no
        ``packing_percent`` if the volume is unknown, or if it is so large that the
        bodies must overlap.
    """
    assert settings.berry_height_mm is not None
    try:
        shape = measure_silhouettes(
            profiles,
            mm_per_pixel=settings.mm_per_pixel,
            height_mm=1e3 * height_m,
            grain_mm=settings.berry_height_mm,
            grains_mm3=math.nan if volume_m3 is None else 1e9 * volume_m3,
        )
    except NoFlankError:
        return {}
    bodies_overlap = shape["packing_percent"] > 100 * checks.LARGEST_FILLED_FRACTION
    if volume_m3 is None or bodies_overlap:
        del shape["packing_percent"]
    return shape


def _measure_scatter(grains: Grains, in_pile: np.ndarray) -> dict[str, float]:
    """Measure how the grains lie scattered around the middle of the pile.

    `in_pile` is the mask (N,) of the grains in the pile. The plate counts as infinite,
    because the file does not tell its radius.
    """
    middle = grains.centres_m[in_pile].mean(axis=0) * [1.0, 1.0, 0.0]
    return measure_scatter(grains.centres_m - middle, in_pile, math.inf)
