"""A simulation as a Python object: bodies in, positions out, every argument checked."""

import math

import numpy as np

from . import state as st
from . import tile as tl
from .engine import advance
from .materials import contact_law, effective_moduli
from .rigid import TILE_ROWS, place_shape
from .walls import STARTS

# Room for the lists of a simulation, per body; they grow when needed.
CONTACTS_PER_BODY, DORMANT_PER_BODY = 6, 6
SKIN_SHARE = 0.45  # skin of the neighbour list over the bounding radius


class Simulation:
    """Equal convex bodies among fixed walls.

    semi_axes_m (K, 3): semi-axes of the ellipsoids whose support functions add up to the body's [m].
    mass_kg, inertia_kg_m2 (3,): of one body, about its principal axes.
    body, wall: `Material`; body_body, body_wall: `Contact`.
    walls: `Walls` of arrays made by `planes_array` and the funnel builder of `repose.scenes`.
    time_step_s: at most `longest_time_step()`; lower, upper (3,): box in which most bodies stay [m].
    tension: "keep" lets the damped normal force pull at the end of an impact, so that a body leaves with the
    restitution asked for; "cut" limits it to pushing.
    exit_height_m: falling through this height sets a body's `exit_time`. floor_height_m: below it a body is gone.
    Raises ValueError naming the argument, the value and what is allowed.
    """

    def __init__(
        self,
        capacity,
        semi_axes_m,
        mass_kg,
        inertia_kg_m2,
        body,
        wall,
        body_body,
        body_wall,
        walls,
        time_step_s,
        lower,
        upper,
        *,
        gravity_m_s2=(0.0, 0.0, -9.81),
        tension="keep",
        exit_height_m=-math.inf,
        funnel_floor_m=-math.inf,
        floor_height_m=-math.inf,
    ):
        semi_axes = np.atleast_2d(np.asarray(semi_axes_m, float))
        if semi_axes.shape[1] != 3 or not np.all(semi_axes > 0.0):
            raise ValueError(f"semi_axes_m is {semi_axes_m!r}; allowed: (K, 3) lengths above 0")
        if not mass_kg > 0.0:
            raise ValueError(f"mass_kg is {mass_kg!r}; allowed: above 0")
        if tension not in ("keep", "cut"):
            raise ValueError(f"tension is {tension!r}; allowed: 'keep', 'cut'")
        if capacity < 1:
            raise ValueError(f"capacity is {capacity!r}; allowed: 1 or more")
        self.radius = float(semi_axes.max(axis=1).sum())
        skin = SKIN_SHARE * self.radius
        self.capacity = int(capacity)
        self.mass_kg = float(mass_kg)
        self.inertia_kg_m2 = np.asarray(inertia_kg_m2, float).copy()
        self.semi_axes_m = semi_axes
        self._moduli = effective_moduli(body, body)
        self.bodies = st.new_bodies(capacity, len(semi_axes))
        self.grid = st.new_grid(capacity, lower, upper, 2.0 * self.radius + skin)
        self.grid.lengths[1:] = 2.0 * self.radius, skin
        self.walls = walls
        self.pairs = st.new_pairs(
            CONTACTS_PER_BODY * capacity + 64, DORMANT_PER_BODY * capacity + 256, capacity
        )
        n_planes, n_curved = len(walls.planes), len(walls.cones) + len(walls.rings)
        self.flat = st.new_wall_contacts(n_planes * capacity + 64, n_planes, capacity, capacity)
        self.curved = st.new_wall_contacts(capacity + 64, n_curved, capacity, capacity)
        self.counts = np.zeros(9, np.int64)
        self.physics = st.Physics(
            parts=len(semi_axes),
            gravity=np.asarray(gravity_m_s2, float).copy(),
            law_pair=contact_law(body, body, body_body),
            law_wall=contact_law(body, wall, body_wall),
            dt=float(time_step_s),
            tension=1.0 if tension == "keep" else 0.0,
            exit_height=float(exit_height_m),
            funnel_floor=float(funnel_floor_m),
            floor_height=float(floor_height_m),
        )
        self._tile = st.zeros(tl.ROWS * tl.LANES)
        self._body_tile = st.zeros(TILE_ROWS * st.LANES)
        self._scratch = np.zeros(16 + STARTS)
        limit = self.longest_time_step()
        if not 0.0 < time_step_s <= limit:
            raise ValueError(f"time_step_s is {time_step_s!r}; allowed: above 0, at most {limit:.3g}")

    def longest_time_step(self, speed_m_s=2.0):
        """A fifteenth of the Hertz contact time of a head-on impact at a speed [s].

        t_c = 2.943 (5 sqrt(2) pi rho (1 - nu^2) / (4 E))^0.4 r / v^0.2 for equal spheres, here with m*, E* and R* of
        the body: t_c = 2.868 (m*^2 / (R* E*^2 v))^0.2 (Johnson 1985, Eq. 11.24).
        """
        young, mass = self._moduli[0], 0.5 * self.mass_kg
        radius = 0.5 * float(self.semi_axes_m.sum(axis=0).min())
        return 2.868 * (mass**2 / (radius * young**2 * speed_m_s)) ** 0.2 / 15.0

    @property
    def n_bodies(self):
        """How many bodies were added so far."""
        return int(self.counts[st.N_BODIES])

    @property
    def steps(self):
        """How many time steps were made."""
        return int(self.counts[st.STEPS])

    @property
    def time_s(self):
        """Simulated time [s]."""
        return float(self.counts[st.STEPS] * self.physics.dt)

    @property
    def positions(self):
        """Centres of the bodies added so far, a view (N, 3) [m]."""
        return self.bodies.rows[: self.n_bodies, 0:3]

    @property
    def quaternions(self):
        """Orientations (w, x, y, z), body to world, a copy (N, 4)."""
        return st.lanes_of(self.bodies.motion, st.QUATERNION, 4, self.n_bodies)

    @property
    def velocities(self):
        """Velocities of the centres, a view (N, 3) [m/s]."""
        return self.bodies.rows[: self.n_bodies, st.VELOCITY : st.VELOCITY + 3]

    @property
    def angular_velocities(self):
        """Angular velocities in the world frame, a view (N, 3) [rad/s]."""
        return self.bodies.rows[: self.n_bodies, st.TURNING : st.TURNING + 3]

    @property
    def angular_momenta(self):
        """Angular momenta about the centres in the world frame, a copy (N, 3) [kg m2/s]."""
        return st.lanes_of(self.bodies.motion, st.SPIN, 3, self.n_bodies)

    @property
    def present(self):
        """Which bodies are still there (N,)."""
        return self.bodies.presence[: self.n_bodies] == st.PRESENT

    def add(
        self, position_m, quaternion, velocity_m_s=(0.0, 0.0, 0.0), angular_velocity_rad_s=(0.0, 0.0, 0.0)
    ):
        """Add one body; returns its index. Raises ValueError when the capacity is used up."""
        i = self.n_bodies
        if i >= self.capacity:
            raise ValueError(f"capacity is {self.capacity}; body {i + 1} does not fit")
        row = self.bodies.rows[i]
        row[st.POSITION : st.POSITION + 3] = position_m
        row[st.VELOCITY : st.VELOCITY + 3] = velocity_m_s
        row[st.TURNING : st.TURNING + 3] = angular_velocity_rad_s
        row[st.INVERSE_MASS] = 1.0 / self.mass_kg
        quaternion = np.asarray(quaternion, float)
        quaternion = quaternion / np.linalg.norm(quaternion)
        turn = rotation_matrix(quaternion)
        spin = turn @ (self.inertia_kg_m2 * (turn.T @ row[st.TURNING : st.TURNING + 3]))
        lanes = self.bodies.motion[i // st.LANES, i % st.LANES :: st.LANES]
        for first, values in (
            (st.QUATERNION, quaternion),
            (st.SPIN, spin),
            (st.MOBILITY, 1.0 / self.inertia_kg_m2),
            (st.SQUARES, (self.semi_axes_m**2).ravel()),
            (st.RADIUS, [self.radius]),
        ):
            lanes[first // st.LANES : first // st.LANES + len(values)] = values
        place_shape(self.bodies, i, self.physics.parts, self._body_tile)
        self.bodies.presence[i] = st.PRESENT
        self.bodies.alarm[i] = -1.0
        self.bodies.resting[i // st.LANES] = 0
        self.counts[st.N_BODIES] = i + 1
        self.grid.moved[i] = 1
        self.grid.moved_list[self.counts[st.N_MOVED]] = i
        self.counts[st.N_MOVED] += 1
        return i

    def run_steps(self, steps):
        """Advance by a number of time steps."""
        left = int(steps)
        while left > 0:
            left -= advance(
                self.bodies, self.pairs, self.flat, self.curved, self.grid, self.walls, self.counts,
                self.physics, self._tile, self._body_tile, self._scratch, left,
            )  # fmt: skip
            if self.counts[st.FULL]:
                raise RuntimeError("a contact list overflowed within one step; bodies overlap wildly")
            if left > 0:
                self._grow()

    def _grow(self):
        """Double the lists that are filling up."""
        n_pairs, n_dormant = self.counts[st.N_PAIRS], self.counts[st.N_DORMANT]
        old = self.pairs
        contacts = len(old.first) * (2 if n_pairs * 4 > len(old.first) * 3 else 1)
        dormant = len(old.dormant_limit) * (2 if n_dormant * 4 > len(old.dormant_limit) * 3 else 1)
        self.pairs = st.new_pairs(contacts, dormant, self.capacity)
        self.pairs.data[: len(old.data)] = old.data
        for name in ("first", "second"):
            getattr(self.pairs, name)[:n_pairs] = getattr(old, name)[:n_pairs]
        for name in ("dormant_first", "dormant_second", "dormant_limit", "dormant_normal"):
            getattr(self.pairs, name)[:n_dormant] = getattr(old, name)[:n_dormant]
        self.flat = _grown(self.flat, self.counts[st.N_PLANE], self.capacity)
        self.curved = _grown(self.curved, self.counts[st.N_CURVED], self.capacity)

    def kinetic_energies(self):
        """Kinetic energy of each body, translation and rotation (N,) [J]."""
        translation = 0.5 * self.mass_kg * np.sum(self.velocities**2, axis=1)
        rotation = 0.5 * np.sum(self.angular_momenta * self.angular_velocities, axis=1)
        return translation + rotation

    def contacts(self):
        """Indices of the touching pairs (M, 2), sorted."""
        n = self.counts[st.N_PAIRS]
        pairs = np.column_stack([self.pairs.first[:n], self.pairs.second[:n]])
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def curved_contacts(self):
        """Contacts with cones, tubes and rings: body (M,), wall (M,), normal (M, 3), azimuth (M,) [rad].

        Walls are numbered with the cones and tubes first, then the rings.
        """
        n = self.counts[st.N_CURVED]
        rows = st.contact_rows(self.curved.data, n)
        return self.curved.body[:n].copy(), self.curved.wall[:n].copy(), rows[:, :3].copy(), rows[:, 6].copy()


def _grown(contacts, used, ghost):
    """Twice the room for wall contacts when three quarters are used."""
    if used * 4 <= len(contacts.body) * 3:
        return contacts
    bigger = st.new_wall_contacts(2 * len(contacts.body), *contacts.limit.shape, ghost)
    bigger.limit[:] = contacts.limit
    for name in ("body", "wall"):
        getattr(bigger, name)[:used] = getattr(contacts, name)[:used]
    bigger.data[: len(contacts.data)] = contacts.data
    return bigger


def rotation_matrix(quaternion):
    """Rotation matrix, body to world, of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def walls_of(planes=(), cones=(), rings=()):
    """Walls from rows of PLANE_COLUMNS, CONE_COLUMNS and RING_COLUMNS numbers (see `state`)."""
    return st.Walls(
        planes=np.array(planes, float).reshape(-1, st.PLANE_COLUMNS),
        cones=np.array(cones, float).reshape(-1, st.CONE_COLUMNS),
        rings=np.array(rings, float).reshape(-1, st.RING_COLUMNS),
    )
