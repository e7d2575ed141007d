"""Restitution of an impact of two bodies, or of a body and a plane.

The bodies meet without friction and without spin, in random orientations, off centre. Restitution is -u' / u: u is the
relative velocity of the bodies where they first touch, along the normal there; u' is the same where they part, at that
time. In the stiff limit the bodies have no time to turn while they touch, so both places and both normals are the same.
No other component of the velocity changes there: the share 1 - e^2 of the energy of the normal motion is lost.

At the real softness the bodies turn while they touch: the contact moves, more spheres of a clump begin to touch, and no
law of a single contact returns its e exactly.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from repose.dem import Clump, Shape, Simulation, random_quaternion
from repose.dem.rotations import rotation_matrices, rotation_matrix
from repose.grain.build import make_particle
from repose.grain.mesh_from_axes import berry_mesh

from .case import Effort, Row, Rows, close, reported
from .machine import (
    BERRY_DENSITY,
    BERRY_M,
    ON_FLOOR,
    UP,
    Body,
    before_impact,
    frictionless,
    random_direction,
)

MASS_G = 1.25
BARREL_M = ((7.399e-3, 0.94e-3, 0.94e-3), (3.171e-3, 4.745e-3, 4.0e-3))
CLUMPS = {"smooth clump": (14, "smooth"), "rough clump": (16, "rough")}
ASKED = (0.1, 0.3, 0.5, 0.7, 0.9)
SPEEDS_M_S = (0.2, 1.0)
OFFSET = 0.8  # largest distance of the centres across the approach, over the sum of the smallest half extents
STEEPEST = 0.3  # a plane is hit with at least this share of the speed
STIFFER = 1e7  # moduli in the stiff limit over the real moduli
STEPS_PER_CONTACT = 120
LOOK = 3  # steps between two checks
LEAD = 2.0  # steps until they touch
LONGEST = 12  # contact times after which a hit is abandoned
SPACING_M, LANE = 0.08, 40
STIFF_TOLERANCE = 0.02  # of the mean, absolute
CONTACTS_NOTE = (
    "mean over the hits; where they lie together the pair is as many times as stiff"
)
SOFT_NOTE = "the bodies turn while they touch"


@functools.cache
def particles() -> dict[str, Shape | Clump]:
    """Make shapes of every kind of particle by name, each as large as a published fruit and of the material "berry"."""
    volume = 4.0 / 3.0 * math.pi * np.prod(BERRY_M)
    solid = Shape.ellipsoid(np.sum(BARREL_M, axis=0), BERRY_DENSITY, "berry")
    shapes: dict[str, Shape | Clump] = {
        "sphere": Shape.sphere(
            np.cbrt(3.0 * volume / (4.0 * math.pi)), BERRY_DENSITY, "berry"
        ),
        "ellipsoid": Shape.ellipsoid(BERRY_M, BERRY_DENSITY, "berry"),
        "sum of two": Shape(
            np.array(BARREL_M), MASS_G * 1e-3, solid.inertia_kg_m2, "berry"
        ),
    }
    mesh, _shape = berry_mesh(2e3 * np.array(BERRY_M), MASS_G, BERRY_DENSITY)
    for name, (spheres, surface) in CLUMPS.items():
        shapes[name] = make_particle(
            mesh, BERRY_DENSITY, "multisphere", spheres, surface
        ).dem_shape("berry")
    return shapes


class Hits(NamedTuple):
    """Restitution of hits, and their contacts."""

    restitution: (
        np.ndarray
    )  # (count,), NaN for bodies that had not parted after `LONGEST` contact times
    contacts: np.ndarray  # (count,), most contacts at any check


def _turned_spheres(clump: Clump, turn: np.ndarray) -> np.ndarray:
    """Turn a clump's spheres into the world: rows of centre and radius (M, 4)."""
    return np.column_stack([clump.spheres_m[:, :3] @ turn.T, clump.spheres_m[:, 3]])


def _deepest(
    value: Callable[[np.ndarray], np.ndarray], start: np.ndarray
) -> np.ndarray:
    """Find the unit vector (3,) of the least `value` of vectors (M, 3), on ever smaller caps of directions."""
    rng = np.random.default_rng(1)
    best, width = start, 1.5
    for _ in range(40):
        n = best + width * np.vstack([np.zeros(3), rng.normal(size=(120, 3))])
        n /= np.linalg.norm(n, axis=1)[:, None]
        best, width = n[np.argmin(value(n))], 0.7 * width
    return best


def first_touch(
    shape: Shape | Clump,
    turn_a: np.ndarray,
    turn_b: np.ndarray,
    offset: np.ndarray,
    direction: np.ndarray,
) -> float:
    """Find the distance [m] at which two bodies touch, the second at offset + distance * direction.

    Spheres touch in closed form. Convex bodies overlap at a distance s as long as (offset + s d) . n < h(n) for all n,
    h the sum of their extents, so s is the least (h(n) - offset . n) / (d . n) over n . d > 0.
    """
    if isinstance(shape, Clump):
        a, b = _turned_spheres(shape, turn_a), _turned_spheres(shape, turn_b)
        offset_across = b[None, :, :3] + offset - a[:, None, :3]
        along = offset_across @ direction
        square = (
            along**2
            - np.sum(offset_across**2, axis=-1)
            + (a[:, None, 3] + b[None, :, 3]) ** 2
        )
        return float(
            np.max(
                np.sqrt(
                    square, where=square > 0.0, out=np.full(square.shape, -math.inf)
                )
                - along
            )
        )

    def distance(n: np.ndarray) -> np.ndarray:
        towards = n @ direction
        reach = shape.support(n @ turn_a) + shape.support(-n @ turn_b) - n @ offset
        return np.where(towards > 0.05, reach / np.maximum(towards, 0.05), math.inf)

    return float(distance(_deepest(distance, direction)[None])[0])


def nearest(
    shape: Body, turn_a: np.ndarray, turn_b: np.ndarray, between: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Find normal and place (3,) where two bodies that just touch do so, the place from the first centre [m].

    `between` (3,) is the way from the first centre to the second [m].
    """
    if isinstance(shape, Clump):
        a, b = _turned_spheres(shape, turn_a), _turned_spheres(shape, turn_b)
        ways = b[None, :, :3] + between - a[:, None, :3]
        lengths = np.linalg.norm(ways, axis=-1)
        i, j = np.unravel_index(
            np.argmin(lengths - a[:, None, 3] - b[None, :, 3]), lengths.shape
        )
        normal = ways[i, j] / lengths[i, j]
        arm = a[i, :3] + a[i, 3] * normal
    else:

        def gap(n: np.ndarray) -> np.ndarray:
            return shape.support(n @ turn_a) + shape.support(-n @ turn_b) - n @ between

        normal = _deepest(gap, between / np.linalg.norm(between))
        arm = turn_a @ shape.support_point(normal @ turn_a)
    return normal, arm


def hits(
    shape: Body,
    restitution: float,
    times: float,
    on_plane: bool,
    count: int,
    **keywords: Any,
) -> Hits:
    """Simulate restitution and contacts of `count` isolated hits of two bodies, or of a body and a plane."""
    rng = np.random.default_rng(3)
    edge = SPACING_M * (count // LANE + 1)
    lower, upper = 3 * (-SPACING_M,), (edge, SPACING_M * LANE, SPACING_M)
    room: dict[str, Any] = {
        "capacity": 2 * count,
        "lower": lower,
        "upper": upper,
    } | keywords
    room["walls"] = ON_FLOOR if on_plane else {}
    contact = frictionless(restitution)
    simulation, step = before_impact(
        shape, contact, max(SPEEDS_M_S), STEPS_PER_CONTACT, times, **room
    )
    for k in range(count):
        middle = SPACING_M * np.array([k // LANE, k % LANE, 0.0])
        (_throw_at_plane if on_plane else _throw_pair)(
            simulation, rng, shape, middle, step
        )
    return _returned(simulation, on_plane)


def _throw_pair(
    simulation: Simulation, rng: Generator, shape: Body, middle: np.ndarray, step: float
) -> None:
    """Add two bodies that will touch after two steps, the second in motion."""
    speed = rng.uniform(*SPEEDS_M_S)
    turn_a, turn_b, direction = (
        random_quaternion(rng),
        random_quaternion(rng),
        random_direction(rng),
    )
    across = np.cross(direction, random_direction(rng))
    reach = 2.0 * OFFSET * shape.half_extents_m.min()
    offset = reach * math.sqrt(rng.uniform()) * across / np.linalg.norm(across)
    distance = first_touch(
        shape, rotation_matrix(turn_a), rotation_matrix(turn_b), offset, direction
    )
    simulation.add("body", middle, turn_a)
    place = middle + offset + (distance + LEAD * step * speed) * direction
    simulation.add("body", place, turn_b, -speed * direction)


def _throw_at_plane(
    simulation: Simulation, rng: Generator, shape: Body, middle: np.ndarray, step: float
) -> None:
    """Add a body that will touch the plane after two steps."""
    speed, turn, direction = (
        rng.uniform(*SPEEDS_M_S),
        random_quaternion(rng),
        random_direction(rng),
    )
    while -direction @ UP < STEEPEST:
        direction = random_direction(rng)
    height = shape.support(-rotation_matrix(turn)[2]) + LEAD * step * speed
    simulation.add("body", middle + height * np.array(UP), turn, speed * direction)


def _returned(simulation: Simulation, on_plane: bool) -> Hits:
    """Run until the bodies that are about to meet have parted."""
    count = simulation.n_bodies // (1 if on_plane else 2)
    before = np.array([_approach(simulation, k, on_plane) for k in range(count)])
    most, after = np.zeros(count, np.int64), np.full(count, math.nan)
    for _ in range(LONGEST * STEPS_PER_CONTACT // LOOK):
        simulation.run_steps(LOOK)
        contacts = _contacts(simulation, count, on_plane)
        for k in np.flatnonzero(
            (most > 0) & (contacts == 0) & np.isnan(after)
        ).tolist():
            after[k] = _approach(simulation, k, on_plane)
        most = np.where(np.isnan(after), np.maximum(most, contacts), most)
        if not np.isnan(after).any():
            break
    return Hits(-after / before, most)


def _contacts(simulation: Simulation, count: int, on_plane: bool) -> np.ndarray:
    """Count the contacts now in each hit (count,)."""
    shape = simulation.shapes["body"]
    if not on_plane:
        bodies = (
            simulation.sphere_contacts()[0]
            if isinstance(shape, Clump)
            else simulation.contacts()
        )
        return np.bincount(bodies[:, 0] // 2, minlength=count)
    height, up = (
        simulation.positions[:, 2],
        rotation_matrices(simulation.quaternions)[:, 2],
    )
    if isinstance(shape, Clump):
        return np.sum(
            height[:, None] + up @ shape.spheres_m[:, :3].T < shape.spheres_m[:, 3],
            axis=1,
        )
    return (height < shape.support(-up)).astype(np.int64)


def _approach(simulation: Simulation, k: int, on_plane: bool) -> float:
    """Return the speed at which two bodies approach where they are nearest, along the normal there."""
    shape, velocities, turning = (
        simulation.shapes["body"],
        simulation.velocities,
        simulation.angular_velocities,
    )
    if on_plane:
        down = -np.array(UP)
        turn = rotation_matrix(simulation.quaternions[k])
        return (
            velocities[k]
            + np.cross(turning[k], turn @ shape.support_point(down @ turn))
        ) @ down
    a, b = 2 * k, 2 * k + 1
    turn_a, turn_b = rotation_matrices(simulation.quaternions[[a, b]])
    between = simulation.positions[b] - simulation.positions[a]
    normal, arm = nearest(shape, turn_a, turn_b, between)
    point_a = velocities[a] + np.cross(turning[a], arm)
    return (point_a - velocities[b] - np.cross(turning[b], arm - between)) @ normal


def restitution_of_hits(effort: Effort) -> Rows:
    """Compare simulated with nominal restitution, of every particle: pairs and planes, stiff and soft as a grain."""
    count = max(24, effort.hits // 100)
    sides = product(
        ((STIFFER, "stiff limit"), (1.0, "real softness")),
        ((False, "pairs"), (True, "plane")),
    )
    for ((times, limit), (on_plane, partner)), (name, shape) in product(
        list(sides), particles().items()
    ):
        at = f"{limit}, {partner}, {name}"
        thrown = [hits(shape, e, times, on_plane, count, **effort.laws) for e in ASKED]
        for e, own in zip(ASKED, thrown, strict=True):
            yield _row(f"{at}: restitution at {e:.1f}", own.restitution, e, times > 1.0)
        if isinstance(shape, Clump):
            most = np.mean([own.contacts for own in thrown])
            yield reported(f"{at}: most contacts at a time", "", most, CONTACTS_NOTE)


def _row(quantity: str, values: np.ndarray, nominal: float, judged: bool) -> Row:
    """Compare the mean restitution of hits, judged in the stiff limit, with their spread in the note."""
    low, high = np.nanpercentile(values, (5, 95))
    lost = int(np.isnan(values).sum())
    note = f"sd {np.nanstd(values):.3f}, 5-95 % {low:.3f} to {high:.3f}" + (
        f", {lost} not parted" if lost else ""
    )
    mean = float(np.nanmean(values))
    if not judged:
        return reported(
            quantity, "", mean, f"{note}; {SOFT_NOTE}", nominal, "asked for"
        )
    return replace(
        close(
            quantity,
            "",
            mean,
            nominal,
            "asked for",
            tolerance=STIFF_TOLERANCE,
            scale=1.0,
        ),
        note=note,
    )
