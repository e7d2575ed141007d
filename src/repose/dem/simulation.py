"""A simulation as a Python object: bodies in, positions out, every argument checked."""

import math

import numpy as np

from . import features
from . import state as st
from . import tile as tl
from .engine import advance
from .materials import Contact, Material, contact_law, effective_moduli
from .rigid import TILE_ROWS, place_shape
from .shapes import Shape
from .surfaces import Cone, Mesh, Motion, Plane, RingEdge, WallSet, frame_of
from .walls import STARTS

# Room for the lists of a simulation, per body; they grow when needed.
CONTACTS_PER_BODY, DORMANT_PER_BODY = 6, 6
SKIN_SHARE = 0.45  # skin of the neighbour list over the largest bounding radius
STEPS_PER_CONTACT = 15  # the longest time step is this share of a head-on impact's contact time
FASTEST_IMPACT_M_S = 2.0


def _checked(name, mapping, kind):
    """A mapping of names to objects of a kind, or ValueError."""
    if not mapping or not all(isinstance(value, kind) for value in mapping.values()):
        raise ValueError(f"{name} is {mapping!r}; allowed: names, each with a {kind.__name__}")
    return dict(mapping)


class Simulation:
    """Convex bodies of given shapes among walls.

    shapes: names to `Shape`; materials: names to `Material`; contacts: pairs of material names, in any order, to
    `Contact`, for every pair of materials that can meet.
    time_step_s: above 0, at most `longest_time_step()`. capacity: most bodies. lower, upper (3,): a box in which most
    bodies stay [m]; it only steers the search for neighbours.
    walls: names to `Plane`, `Cone`, `Cylinder`, `RingEdge`, `Mesh`. gravity_m_s2 (3,).
    tension: "keep" lets the damped normal force pull at the end of an impact, so that a body leaves with the
    restitution asked for; "cut" limits it to pushing.
    largest_scale: the largest scale that `add` will be given.
    exit_height_m: falling through this height sets a body's exit time. funnel_floor_m: a body below it never meets a
    cone, cylinder or ring again. floor_height_m: below it a body is gone.
    Raises ValueError naming the argument, the value and what is allowed.
    """

    def __init__(
        self,
        shapes,
        materials,
        contacts,
        time_step_s,
        *,
        capacity,
        lower,
        upper,
        walls=None,
        gravity_m_s2=(0.0, 0.0, -9.81),
        tension="keep",
        largest_scale=1.0,
        exit_height_m=-math.inf,
        funnel_floor_m=-math.inf,
        floor_height_m=-math.inf,
    ):
        self.shapes = _checked("shapes", shapes, Shape)
        self.materials = _checked("materials", materials, Material)
        if tension not in ("keep", "cut"):
            raise ValueError(f"tension is {tension!r}; allowed: 'keep', 'cut'")
        if not (isinstance(capacity, int | np.integer) and capacity >= 1):
            raise ValueError(f"capacity is {capacity!r}; allowed: a whole number, 1 or more")
        if not largest_scale > 0.0:
            raise ValueError(f"largest_scale is {largest_scale!r}; allowed: above 0")
        if not np.all(np.asarray(lower, float) < np.asarray(upper, float)):
            raise ValueError(
                f"lower is {lower!r}, upper {upper!r}; allowed: lower below upper in every direction"
            )
        self.capacity = int(capacity)
        self.largest_scale = float(largest_scale)
        self.radius = largest_scale * max(shape.bounding_radius_m for shape in self.shapes.values())
        self.wall_set = WallSet(dict(walls or {}))
        self._set_materials(_pairs_of(contacts))
        parts = max(len(shape.semi_axes_m) for shape in self.shapes.values())
        skin = SKIN_SHARE * self.radius
        self.bodies = st.new_bodies(self.capacity, parts)
        self.grid = st.new_grid(self.capacity, lower, upper, 2.0 * self.radius + skin)
        self.grid.lengths[1:] = 2.0 * self.radius, skin
        self.walls = self._wall_arrays(np.linalg.norm(np.subtract(upper, lower)))
        self.pairs = st.new_pairs(
            CONTACTS_PER_BODY * capacity + 64, DORMANT_PER_BODY * capacity + 256, self.capacity
        )
        n_planes, n_curved = len(self.walls.planes), len(self.walls.cones) + len(self.walls.rings)
        surfaces = self.wall_set.of(Mesh)
        self.meshes = features.join([mesh.part for mesh in surfaces], self._slide())
        self.flat = st.new_wall_contacts(n_planes * capacity + 64, n_planes, capacity, self.capacity)
        self.curved = st.new_wall_contacts(capacity + 64, n_curved, capacity, self.capacity)
        self.meshed = st.new_wall_contacts(
            capacity + 64 if surfaces else 1, len(surfaces), capacity, self.capacity
        )
        self.counts = np.zeros(st.COUNTS, np.int64)
        wall_kinds = {surface.material for surface in self.wall_set.surfaces.values()}
        self.physics = st.Physics(
            parts=parts,
            gravity=np.asarray(gravity_m_s2, float).copy(),
            laws=self._laws,
            mixed_pairs=len(self._kinds) > 1,
            mixed_walls=len(self._kinds) > 1 or len(wall_kinds) > 1,
            dt=float(time_step_s),
            tension=1.0 if tension == "keep" else 0.0,
            rolling_frame=np.zeros(3),
            exit_height=float(exit_height_m),
            funnel_floor=float(funnel_floor_m),
            floor_height=float(floor_height_m),
        )
        self._tile = st.zeros(tl.ROWS * st.LANES)
        self._body_tile = st.zeros(TILE_ROWS * st.LANES)
        self._scratch = st.zeros(64 + STARTS)
        limit = self.longest_time_step()
        if not 0.0 < time_step_s <= limit:
            raise ValueError(f"time_step_s is {time_step_s!r}; allowed: above 0, at most {limit:.3g}")

    def _set_materials(self, contacts):
        """Number the materials, those of bodies first, and make the table of force laws."""
        names = list(dict.fromkeys(shape.material for shape in self.shapes.values()))
        self._kinds = {name: k for k, name in enumerate(names)}
        names += dict.fromkeys(s.material for s in self.wall_set.surfaces.values() if s.material not in names)
        self._wall_kinds = {name: k for k, name in enumerate(names)}
        for name in names:
            if name not in self.materials:
                raise ValueError(f"material is {name!r}; allowed: {', '.join(self.materials)}")
        self._laws = np.zeros((len(names), len(names), tl.LAW_ROWS))
        self._meetings = []
        for a in self._kinds:
            for b in names:
                if (a, b) not in contacts:
                    raise ValueError(
                        f"contacts has no pair ({a!r}, {b!r}); every pair of materials that can meet needs one"
                    )
                law = contact_law(self.materials[a], self.materials[b], contacts[a, b])
                self._laws[self._kinds[a], self._wall_kinds[b]] = law
                self._laws[self._wall_kinds[b], self._kinds[a]] = law
                self._meetings.append((a, b))

    def _wall_arrays(self, size):
        """The walls as the kernels take them; size: of the box the bodies stay in [m]."""
        planes, cones, rings, meshes = (self.wall_set.of(kind) for kind in (Plane, Cone, RingEdge, Mesh))
        surfaces = [*planes, *cones, *rings, *meshes]
        frames = np.array([frame_of(surface) for surface in (*cones, *rings, *meshes)]).reshape(-1, 12)
        motion = np.array([surface.motion.row() for surface in surfaces]).reshape(-1, 9)
        moves = np.any(motion[:, :6] != 0.0, axis=1)
        speeds = [
            _approach(surface, row, frame, size)
            for surface, row, frame in zip(surfaces, motion, [*[None] * len(planes), *frames], strict=True)
        ]
        return st.Walls(
            planes=np.array([wall.row() for wall in planes]).reshape(-1, st.PLANE_COLUMNS),
            cones=np.array([wall.row() for wall in cones]).reshape(-1, st.CONE_COLUMNS),
            rings=np.array([wall.row() for wall in rings]).reshape(-1, st.RING_COLUMNS),
            frames=frames,
            turned=(np.any(frames != frame_of(_HOME), axis=1) | moves[len(planes) :]).astype(np.uint8),
            motion=motion,
            moves=moves.astype(np.uint8),
            material=np.array([self._wall_kinds[s.material] for s in surfaces], np.uint8),
            creep=np.array([0.0, max(speeds, default=0.0), float(moves.any())]),
        )

    def set_motion(self, wall, motion):
        """Give a wall another `Motion` from now on. Raises ValueError for a name that is not a wall's."""
        if not isinstance(motion, Motion):
            raise ValueError(f"motion is {motion!r}; allowed: a Motion")
        self.wall_set = self.wall_set.with_motion(wall, motion)
        old, size = self.walls, float(np.linalg.norm(self.grid.shape * self.grid.lengths[0]))
        new = self._wall_arrays(size)
        # walls stay where their motion has brought them; so do the pivots of the others
        new.planes[:], new.frames[:] = old.planes, old.frames
        k = self.wall_set.names.index(wall)
        others = np.arange(len(old.motion)) != k
        new.motion[others] = old.motion[others]
        new.creep[0] = old.creep[0]
        new.turned[:] |= old.turned
        self.walls = new
        self.bodies.alarm[: self.n_bodies][self.present] = -1.0

    @property
    def rolling_frame_rad_s(self):
        """Angular velocity of the frame against which rolling is resisted, a view (3,); zero unless set [rad/s]."""
        return self.physics.rolling_frame

    def longest_time_step(self, speed_m_s=FASTEST_IMPACT_M_S):
        """A fifteenth of the shortest Hertz contact time of two bodies that meet head-on at a speed [s].

        t_c = 2.868 (m*^2 / (R* E*^2 v))^0.2 (Johnson 1985, Eq. 11.24), over all pairs of shapes.
        """
        shortest = math.inf
        for a in self.shapes.values():
            for b in self.shapes.values():
                young, _ = effective_moduli(self.materials[a.material], self.materials[b.material])
                mass = 1.0 / (1.0 / a.mass_kg + 1.0 / b.mass_kg)
                radius = 1.0 / (1.0 / a.smallest_radius_m + 1.0 / b.smallest_radius_m)
                shortest = min(shortest, 2.868 * (mass**2 / (radius * young**2 * speed_m_s)) ** 0.2)
        return shortest / STEPS_PER_CONTACT

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
        self,
        shape,
        position_m,
        quaternion=(1.0, 0.0, 0.0, 0.0),
        velocity_m_s=(0.0, 0.0, 0.0),
        angular_velocity_rad_s=(0.0, 0.0, 0.0),
        scale=1.0,
    ):
        """Add one body; returns its index.

        shape: a name; position [m] and orientation (w, x, y, z), body to world; velocities in the world frame;
        scale: of its lengths. Raises ValueError naming the argument, also when the capacity is used up.
        """
        i = self.n_bodies
        if i >= self.capacity:
            raise ValueError(f"capacity is {self.capacity}; body {i + 1} does not fit")
        if shape not in self.shapes:
            raise ValueError(f"shape is {shape!r}; allowed: {', '.join(self.shapes)}")
        if not 0.0 < scale <= self.largest_scale:
            raise ValueError(
                f"scale is {scale!r}; allowed: above 0, at most largest_scale, {self.largest_scale}"
            )
        quaternion = np.asarray(quaternion, float)
        length = np.linalg.norm(quaternion)
        if quaternion.shape != (4,) or not (math.isfinite(length) and length > 0.0):
            raise ValueError(f"quaternion is {quaternion!r}; allowed: four finite numbers that are not all 0")
        kind = self.shapes[shape]
        row = self.bodies.rows[i]
        row[st.POSITION : st.POSITION + 3] = position_m
        row[st.VELOCITY : st.VELOCITY + 3] = velocity_m_s
        row[st.TURNING : st.TURNING + 3] = angular_velocity_rad_s
        if not np.all(np.isfinite(row[: st.SHAPE])):
            raise ValueError(
                f"position_m is {position_m!r}, velocity_m_s {velocity_m_s!r}; allowed: finite numbers"
            )
        row[st.INVERSE_MASS] = 1.0 / (kind.mass_kg * scale**3)
        quaternion = quaternion / length
        inertia = kind.inertia_kg_m2 * scale**5
        turn = rotation_matrix(quaternion)
        spin = turn @ (inertia * (turn.T @ row[st.TURNING : st.TURNING + 3]))
        squares = np.zeros(3 * st.MOST_PARTS)
        squares[: kind.semi_axes_m.size] = ((kind.semi_axes_m * scale) ** 2).ravel()
        lanes = self.bodies.motion[i // st.LANES, i % st.LANES :: st.LANES]
        for first, values in (
            (st.QUATERNION, quaternion),
            (st.SPIN, spin),
            (st.MOBILITY, 1.0 / inertia),
            (st.SQUARES, squares),
            (st.RADIUS, [kind.bounding_radius_m * scale]),
        ):
            lanes[first // st.LANES : first // st.LANES + len(values)] = values
        place_shape(self.bodies, i, self.physics.parts, self._body_tile)
        self.bodies.kind[i] = self._kinds[kind.material]
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
                self.bodies, self.pairs, self.flat, self.curved, self.meshed, self.grid, self.walls, self.meshes,
                self.counts, self.physics, self._tile, self._body_tile, self._scratch, left,
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
        self.meshed = _grown(self.meshed, self.counts[st.N_MESHED], self.capacity)

    def kinetic_energies(self):
        """Kinetic energy of each body, translation and rotation (N,) [J]."""
        inverse = self.bodies.rows[: self.n_bodies, st.INVERSE_MASS]
        masses = np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0.0)
        translation = 0.5 * masses * np.sum(self.velocities**2, axis=1)
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

    def mesh_contacts(self):
        """Contacts with meshes: body (M,), mesh (M,), feature (M,), normal into the wall (M, 3), overlap (M,) [m].

        Meshes and features are numbered in the order of the walls: of each mesh its triangles, then its edges and
        vertices that can be touched. A contact is found before it bears: the overlap is that of the last step.
        """
        n = self.counts[st.N_MESHED]
        rows = st.contact_rows(self.meshed.data, n)
        body, wall, feature = (getattr(self.meshed, name)[:n].copy() for name in ("body", "wall", "feature"))
        return body, wall, feature, rows[:, :3].copy(), -rows[:, st.MESH_GAP // st.LANES]

    def _slide(self):
        """How far the point that touches a plane may slide over a body that turns, over the path of its odometer."""
        return max(
            float(np.sum(shape.semi_axes_m.max(axis=1) ** 2 / shape.semi_axes_m.min(axis=1)))
            / shape.bounding_radius_m
            for shape in self.shapes.values()
        )


def _grown(contacts, used, ghost):
    """Twice the room for wall contacts when three quarters are used."""
    if used * 4 <= len(contacts.body) * 3:
        return contacts
    bigger = st.new_wall_contacts(2 * len(contacts.body), *contacts.limit.shape, ghost)
    bigger.limit[:] = contacts.limit
    for name in ("body", "wall", "feature"):
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


_HOME = Cone((), "")  # its frame is the world


def _pairs_of(contacts):
    """Contacts by pairs of names in both orders, or ValueError."""
    both = {}
    for pair, contact in dict(contacts).items():
        if not (isinstance(pair, tuple) and len(pair) == 2 and isinstance(contact, Contact)):
            raise ValueError(f"contacts has {pair!r}: {contact!r}; allowed: (material, material): Contact")
        both[pair] = both[pair[::-1]] = contact
    return both


def _approach(surface, motion, frame, size):
    """How fast any point of a wall may come nearer to a body [m/s]; nothing for one that turns about its own axis."""
    velocity, turning, pivot = motion[:3], motion[3:6], motion[6:]
    speed = float(np.linalg.norm(velocity))
    if not turning.any():
        return speed
    if isinstance(surface, Mesh):
        axis = turning / np.linalg.norm(turning)
        offset = surface.vertices_m - pivot
        across = np.linalg.norm(offset - np.outer(offset @ axis, axis), axis=1)
        return speed + float(np.linalg.norm(turning) * across.max())
    if frame is None:  # a plane turns in itself about its normal only, and a disc about its middle
        axis, place = surface.row()[3:6], np.asarray(surface.point_m, float)
    else:
        axis, place = frame[3:].reshape(3, 3)[:, 2], frame[:3]
    rate = np.linalg.norm(turning)
    aligned = abs(abs(axis @ turning) - rate) < 1e-12 * rate
    offset = place - pivot
    if aligned and np.linalg.norm(offset - (offset @ axis) * axis) < 1e-12:
        return speed
    return speed + float(rate * (size + np.linalg.norm(offset)))
