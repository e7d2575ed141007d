"""Random hits of two bodies, or of a body and a plane.

They are off centre and in random orientations, without friction and spin.

Restitution is -u' / u: u is the relative velocity of the bodies where they first touch,
along the normal there; u' is the same where they part, at that time. In the stiff limit
the bodies have no time to turn while they touch, so both places and both normals are
the same. No other component of the velocity changes there: the share 1 - e^2 of the
energy of the normal motion is lost.

At the real softness the bodies turn while they touch: the contact moves, more spheres
of a clump begin to touch, and no law of a single contact returns its e exactly.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from verification.simulations import (
    GRAIN_DENSITY,
    GRAIN_M,
    ON_FLOOR,
    UP,
    frictionless,
    random_direction,
    stiffened_simulation,
)

from repose.dem import Clump, Shape, random_quaternion
from repose.dem.rotations import rotation_matrices, rotation_matrix
from repose.grain.build import make_particle
from repose.grain.mesh_from_axes import make_grain_mesh

MASS_G = 1.25
BARREL_M = ((7.399e-3, 0.94e-3, 0.94e-3), (3.171e-3, 4.745e-3, 4.0e-3))
CLUMPS = {"smooth clump": (14, "smooth"), "rough clump": (16, "rough")}
SPEEDS_M_S = (0.2, 1.0)
# Largest distance of the centres across the approach, over the sum of the smallest half
# extents.
OFFSET = 0.8
STEEPEST = 0.3  # a plane is hit with at least this share of the speed
STIFF_LIMIT = 1e7  # moduli in the stiff limit over the real moduli
STEPS_PER_CONTACT = 120
STEPS_PER_CHECK = 3
STEPS_BEFORE = 2.0  # until the bodies touch
LONGEST = 12  # contact times after which a hit is abandoned
SPACING_M = 0.08
LANES = 40


@functools.cache
def particles():
    """Make shapes of every kind of particle by name, of the material "grain".

    Each is as large as a published fruit.
    """
    volume = 4.0 / 3.0 * math.pi * np.prod(GRAIN_M)
    radius = np.cbrt(3.0 * volume / (4.0 * math.pi))
    solid = Shape.ellipsoid(np.sum(BARREL_M, axis=0), GRAIN_DENSITY, "grain")
    shapes = {
        "sphere": Shape.sphere(radius, GRAIN_DENSITY, "grain"),
        "ellipsoid": Shape.ellipsoid(GRAIN_M, GRAIN_DENSITY, "grain"),
        "sum of two": Shape(
            np.array(BARREL_M), MASS_G * 1e-3, solid.inertia_kg_m2, "grain"
        ),
    }
    mesh, _ = make_grain_mesh(2e3 * np.array(GRAIN_M), MASS_G, GRAIN_DENSITY)
    for name, (spheres, surface) in CLUMPS.items():
        particle = make_particle(mesh, GRAIN_DENSITY, "multisphere", spheres, surface)
        shapes[name] = particle.dem_shape("grain")
    return shapes


class Hits(NamedTuple):
    """Restitution of hits, and their contacts."""

    restitution: np.ndarray  # (count,), NaN for bodies that have not parted in time
    contacts: np.ndarray  # (count,), most contacts at any check


def simulate_hits(shape, restitution, stiffening, on_plane, count, **keywords):
    """Simulate isolated hits of two bodies of a shape, or of a body and a plane."""
    rng = np.random.default_rng(3)
    edge = SPACING_M * (count // LANES + 1)
    world = {
        "capacity": 2 * count,
        "lower": 3 * (-SPACING_M,),
        "upper": (edge, SPACING_M * LANES, SPACING_M),
        "walls": ON_FLOOR if on_plane else {},
    }
    simulation, step = stiffened_simulation(
        shape,
        frictionless(restitution),
        stiffening,
        max(SPEEDS_M_S),
        STEPS_PER_CONTACT,
        **(keywords | world),
    )
    throw = _throw_at_plane if on_plane else _throw_pair
    for k in range(count):
        middle = SPACING_M * np.array([k // LANES, k % LANES, 0.0])
        throw(simulation, rng, shape, middle, step)
    return _run_until_parted(simulation, on_plane)


def _throw_pair(simulation, rng, shape, middle, step):
    """Add two bodies that touch after `STEPS_BEFORE` steps, the second in motion."""
    speed = rng.uniform(*SPEEDS_M_S)
    turn_a = random_quaternion(rng)
    turn_b = random_quaternion(rng)
    direction = random_direction(rng)
    across = np.cross(direction, random_direction(rng))
    largest_offset = 2.0 * OFFSET * shape.half_extents_m.min()
    offset = largest_offset * math.sqrt(rng.uniform()) * across / np.linalg.norm(across)
    distance = touching_distance(
        shape, rotation_matrix(turn_a), rotation_matrix(turn_b), offset, direction
    )
    simulation.add("body", middle, turn_a)
    place = middle + offset + (distance + STEPS_BEFORE * step * speed) * direction
    simulation.add("body", place, turn_b, -speed * direction)


def _throw_at_plane(simulation, rng, shape, middle, step):
    """Add a body that will touch the plane after `STEPS_BEFORE` steps."""
    speed = rng.uniform(*SPEEDS_M_S)
    turn = random_quaternion(rng)
    direction = random_direction(rng)
    while -direction @ UP < STEEPEST:
        direction = random_direction(rng)
    extent = shape.support(-rotation_matrix(turn)[2])
    height = extent + STEPS_BEFORE * step * speed
    simulation.add("body", middle + height * np.array(UP), turn, speed * direction)


def touching_distance(shape, turn_a, turn_b, offset, direction):
    """Find the distance [m] at which two bodies touch.

    The second body is at offset + distance * direction.

    Spheres touch in closed form. Convex bodies overlap at a distance s as long as
    (offset + s d) . n < h(n) for all n, h the sum of their extents, so s is the least
    (h(n) - offset . n) / (d . n) over n . d > 0.
    """
    if isinstance(shape, Clump):
        a = _turned_spheres(shape, turn_a)
        b = _turned_spheres(shape, turn_b)
        between = b[None, :, :3] + offset - a[:, None, :3]
        along = between @ direction
        radii = a[:, None, 3] + b[None, :, 3]
        square = along**2 - np.sum(between**2, axis=-1) + radii**2
        never = np.full(square.shape, -math.inf)
        root = np.sqrt(square, where=square > 0.0, out=never)
        return float(np.max(root - along))

    def distance(n):
        towards = n @ direction
        reach = shape.support(n @ turn_a) + shape.support(-n @ turn_b) - n @ offset
        return np.where(towards > 0.05, reach / np.maximum(towards, 0.05), math.inf)

    return float(distance(_minimise(distance, direction)[None])[0])


def _turned_spheres(clump, turn):
    """Turn a clump's spheres into the world: rows of centre and radius (M, 4)."""
    return np.column_stack([clump.spheres_m[:, :3] @ turn.T, clump.spheres_m[:, 3]])


def _minimise(function, start):
    """Find the unit vector (3,) with the smallest value of a function.

    The function takes vectors (M, 3). The search is random, on ever smaller caps.
    """
    rng = np.random.default_rng(1)
    best = start
    width = 1.5
    for _ in range(40):
        n = best + width * np.vstack([np.zeros(3), rng.normal(size=(120, 3))])
        n /= np.linalg.norm(n, axis=1)[:, None]
        best = n[np.argmin(function(n))]
        width = 0.7 * width
    return best


def nearest_point(shape, turn_a, turn_b, between):
    """Find normal (3,) and place (3,) of the contact of two bodies that just touch.

    The place is relative to the first centre [m].

    `between` (3,) points from the first centre to the second [m].
    """
    if isinstance(shape, Clump):
        a = _turned_spheres(shape, turn_a)
        b = _turned_spheres(shape, turn_b)
        vectors = b[None, :, :3] + between - a[:, None, :3]
        lengths = np.linalg.norm(vectors, axis=-1)
        gaps = lengths - a[:, None, 3] - b[None, :, 3]
        i, j = np.unravel_index(np.argmin(gaps), gaps.shape)
        normal = vectors[i, j] / lengths[i, j]
        return normal, a[i, :3] + a[i, 3] * normal

    def gap(n):
        return shape.support(n @ turn_a) + shape.support(-n @ turn_b) - n @ between

    normal = _minimise(gap, between / np.linalg.norm(between))
    return normal, turn_a @ shape.support_point(normal @ turn_a)


def _run_until_parted(simulation, on_plane):
    """Run until the bodies that are about to meet have parted."""
    count = simulation.n_bodies // (1 if on_plane else 2)
    before = np.array([_approach(simulation, k, on_plane) for k in range(count)])
    most = np.zeros(count, np.int64)
    after = np.full(count, math.nan)
    for _ in range(LONGEST * STEPS_PER_CONTACT // STEPS_PER_CHECK):
        simulation.run_steps(STEPS_PER_CHECK)
        contacts = _count_contacts(simulation, count, on_plane)
        parted = (most > 0) & (contacts == 0) & np.isnan(after)
        for k in np.flatnonzero(parted).tolist():
            after[k] = _approach(simulation, k, on_plane)
        most = np.where(np.isnan(after), np.maximum(most, contacts), most)
        if not np.isnan(after).any():
            break
    return Hits(-after / before, most)


def _count_contacts(simulation, count, on_plane):
    """Count the contacts now in each hit (count,)."""
    shape = simulation.shapes["body"]
    is_clump = isinstance(shape, Clump)
    if not on_plane:
        bodies = simulation.contacts()
        if is_clump:
            bodies = simulation.sphere_contacts()[0]
        return np.bincount(bodies[:, 0] // 2, minlength=count)

    height = simulation.positions[:, 2]
    up = rotation_matrices(simulation.quaternions)[:, 2]
    if is_clump:
        heights = height[:, None] + up @ shape.spheres_m[:, :3].T
        return np.sum(heights < shape.spheres_m[:, 3], axis=1)
    return (height < shape.support(-up)).astype(np.int64)


def _approach(simulation, k, on_plane):
    """Compute the speed of approach of hit k where the bodies are nearest."""
    shape = simulation.shapes["body"]
    velocities = simulation.velocities
    rotations = simulation.angular_velocities
    if on_plane:
        down = -np.array(UP)
        turn = rotation_matrix(simulation.quaternions[k])
        lowest = turn @ shape.support_point(down @ turn)
        return (velocities[k] + np.cross(rotations[k], lowest)) @ down

    a = 2 * k
    b = 2 * k + 1
    turn_a, turn_b = rotation_matrices(simulation.quaternions[[a, b]])
    between = simulation.positions[b] - simulation.positions[a]
    normal, point = nearest_point(shape, turn_a, turn_b, between)
    point_of_a = velocities[a] + np.cross(rotations[a], point)
    return (
        point_of_a - velocities[b] - np.cross(rotations[b], point - between)
    ) @ normal
