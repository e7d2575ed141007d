"""Bodies and simulations the engine's tests share."""

import math

import numpy as np

from repose.dem import (
    Contact,
    Material,
    Mesh,
    Plane,
    Shape,
    Simulation,
    random_quaternion,
)
from repose.dem.kernels import clump_tile as ct
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl

GOJI = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)
BERRY = np.array([[0.02114, 0.01137, 0.00988]]) / 2.0
BARREL = np.array([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]]) * 1e-3
DENSITY = 840.47
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")
DOWN = (0.0, 0.0, -9.81)
LANES = st.LANES


class OneShape(Simulation):
    @property
    def mass_kg(self):
        return self.shapes["body"].mass_kg

    def add(self, *arguments, **keywords):
        return super().add("body", *arguments, **keywords)


def simulation(
    semi_axes=BERRY,
    contact=None,
    wall_contact=None,
    walls=None,
    dt=1e-5,
    capacity=2,
    body=GOJI,
    **keywords,
):
    axes = np.atleast_2d(semi_axes)
    solid = Shape.ellipsoid(axes.sum(axis=0), DENSITY, "body")
    keywords = (
        {"gravity_m_s2": (0.0, 0.0, 0.0)}
        | {"lower": (-0.1, -0.1, -0.1), "upper": (0.1, 0.1, 0.1)}
        | keywords
    )
    contact = contact or Contact(0.3, 0.5, 0.0)
    shapes = {"body": Shape(axes, solid.mass_kg, solid.inertia_kg_m2, "body")}
    contacts = {("body", "body"): contact, ("body", "wall"): wall_contact or contact}
    return OneShape(
        shapes,
        {"body": body, "wall": PVC},
        contacts,
        dt,
        capacity=capacity,
        walls=walls,
        **keywords,
    )


def head_on(e, speed=0.5, dt=2e-6, contact=None, **keywords):
    s = simulation(
        np.full((1, 3), 0.006), contact or Contact(e, 0.0, 0.0), dt=dt, **keywords
    )
    s.add((-0.00601, 0.0, 0.0), (1, 0, 0, 0), (speed, 0.0, 0.0))
    s.add((0.00601, 0.0, 0.0), (1, 0, 0, 0), (-speed, 0.0, 0.0))
    return s


def mesh_of(solid, radius, **keywords):
    return Mesh(
        np.array(solid.vertices), np.array(solid.faces), "wall", radius, **keywords
    )


def tile_of(law, material, contact, radius, mass=1e-3, tension="keep"):
    """A tile of equal contacts of two bodies at rest, normals along z, and what they keep."""
    tile = np.zeros((tl.LAW_ROW + law.n_rows, LANES))
    kept = np.zeros((ct.PAIR_STATE // LANES + law.n_state, LANES))
    tile[tl.LAW_ROW :][: law.n_constants] = law.constants(
        material, material, contact, tension
    )[:, None]
    tile[tl.INVERSE_MASS // LANES] = 1.0 / mass
    tile[tl.RADIUS // LANES] = radius
    kept[2] = 1.0
    return tile, kept


def normal_force(law, tile, kept, overlap, at=st.PAIR_STATE, dt=0.0):
    """Normal force of each lane at an overlap; above 0 where it pushes."""
    tile[tl.GAP // LANES] = -np.asarray(overlap)
    law.kernel(law.make_options("keep"), tile.ravel(), kept.ravel(), at, dt)
    return -tile[tl.TO_A // LANES + 2]


def random_direction(rng):
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def angular_momentum(s):
    return (
        np.cross(s.positions, s.masses_kg[:, None] * s.velocities) + s.angular_momenta
    ).sum(axis=0)


def energy_shares(s, rounds, steps):
    """Run for so many rounds of steps: the largest energy after one, and the last, over the energy before."""
    energy = s.kinetic_energies().sum()
    shares = []
    for _ in range(rounds):
        s.run_steps(steps)
        shares.append(s.kinetic_energies().sum() / energy)
    return max(shares), shares[-1]


def harmless_hits(make, seed, count, aim):
    """Throw bodies at what `make()` gives, where `aim` says by a level direction and another; the number of hits.

    Each comes, spinning, from 30 mm away, and its hits give it no energy. One that is added touching is not thrown.
    """
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(count):
        s = make()
        angle = rng.uniform(0.0, 2.0 * math.pi)
        place, direction = aim(
            rng,
            np.array([math.cos(angle), math.sin(angle), 0.0]),
            random_direction(rng),
        )
        direction = direction / np.linalg.norm(direction)
        start = place + 0.008 * rng.normal(size=3) + 0.03 * direction
        turn = random_quaternion(rng)
        velocity = -rng.uniform(0.2, 1.2) * direction
        Simulation.add(s, *s.shapes, start, turn, velocity, 30.0 * rng.normal(size=3))
        s.run_steps(1)
        if s.counts[st.N_PLANE] + s.counts[st.N_CURVED]:
            continue
        most, last = energy_shares(s, 10, round(0.008 / s.physics.dt))
        assert most <= 1.0 + 1e-5
        hits += last < 0.999
    return hits


def bits(s):
    values = (
        s.positions,
        s.quaternions,
        s.velocities,
        s.angular_momenta,
        s.walls.planes,
        s.walls.frames,
        s.contacts(),
    )
    return b"".join(np.ascontiguousarray(v).tobytes() for v in values)
