"""The arrays of a simulation, grouped as named tuples that numba kernels take as arguments."""

from collections import namedtuple

import numpy as np

from .jit import inlined
from .rows import LANES, Rows

# Contacts and bodies lie in tiles of LANES, a row a quantity: number k is lane k % LANES of tile k // LANES.

CACHE_LINE = 8  # numbers
BLOCK = 256  # near pairs of a large simulation that are checked together
MOST_GROUPS = 60  # of bodies that lie together; each is one bit of a whole number
DEAD = 1e-100  # size below which motion and springs have died out [SI units]; its square is no denormal number yet
ROUNDING = 1e-12  # sums of path lengths over some thousand steps are exact to this [m]
# Places of `Grid.lengths`.
CELL, REACH, SKIN = range(3)
# Columns of `rows` (N, a multiple of 8): the data of a body for its contacts, one body after another.
# Of a body that does not turn only the first eight change. Then follow the inverse inertia in the world as xx, xy, xz,
# yy, yz, zz, and the shape: for clumps their quaternion. Spheres have only their radius there. The last is
# `share_column`.
POSITION, VELOCITY, INVERSE_MASS, ANGULAR_VELOCITY, INVERSE_INERTIA, SHAPE = (
    0,
    3,
    6,
    7,
    10,
    16,
)
SPHERE_RADIUS = INVERSE_INERTIA
PART = 6  # columns a part of the shape: the symmetric matrix R diag(a2, b2, c2) R' as xx, xy, xz, yy, yz, zz
MOST_PARTS = 3
SPHERES = -1  # in place of a number of parts: every body is a sphere
MOST_SPHERES = 64  # of a clump
# Columns of `load` (shares, N, 8), to be added up over the shares: force, torque, budget of the rolling torque, and the
# tangential dashpots times the squares of their arms.
ROLL, DASHPOTS = 6, 7
LOAD_COLUMNS = 8
# Rows of a tile of `motion`, data for the motion alone: quaternion (w x y z, body to world), angular momentum,
# displacement at which the neighbours are listed anew, 1 / principal moments, squared semi-axes of each part, radius.
# Of a tile at rest, a step reads only the row RELIST.
_motion = Rows()
QUATERNION = _motion.take(4)
ANGULAR_MOMENTUM = _motion.take(3)
RELIST = _motion.take()
INVERSE_MOMENTS = _motion.take(3)
SQUARES = _motion.take(3 * MOST_PARTS)
RADIUS = _motion.take()
MOTION_ROWS = _motion.count
# Rows of a tile of contacts, kept from step to step: normal of A towards B or the wall, rows of the geometry, rows of
# the force laws.
_pair = Rows()
NORMAL = _pair.take(3)
PAIR_STATE = _pair.end  # where the force laws' rows begin, for pairs
# Of a contact with a wall: azimuth and gap (curved), or offset along the normal, middle and squared radius (plane). Of
# a mesh: the azimuth about an edge, the gap.
_wall = Rows(_pair.end)
AZIMUTH = OFFSET = _wall.take()
MIDDLE = GAP = _wall.take(3)
RADIUS2 = _wall.take()
WALL_STATE = _wall.end  # where the force laws' rows begin, for walls

# Slots of `counts`.
(
    N_BODIES,
    N_PAIRS,
    N_NEAR,
    N_PLANE,
    N_CURVED,
    N_MOVED,
    STEPS,
    FULL,
    N_GONE,
    N_MESHED,
    N_FREE,
) = range(11)
COUNTS = 11

ABSENT, PRESENT, GONE = 0, 1, 2

CELLS_PER_BODY, FEWEST_CELLS = 64, 4096  # of the search for neighbours

# displacement: how far any point of a body may have moved until now. wall_check: the displacement, with that of the
# walls, at which the body is checked against walls again; wall_margin: the way left until then, the least of a tile.
Bodies = namedtuple(
    "Bodies",
    "rows load touched motion displacement wall_check presence passed exit_time every resting kind event events "
    "longest wall_margin",
)
Grid = namedtuple(
    "Grid",
    "cell following preceding head moved moved_list chain mark touching near shape origin lengths paths",
)
Pairs = namedtuple(
    "Pairs",
    "first second data near_first near_second near_limit near_normal near_check near_groups ended gap partner link",
)
# deepest (walls, N): largest overlap with which a contact of a smooth body may begin; infinite unless it is past the
# wall. Of clumps, known and past (walls, N): which spheres of a body touch a wall and which are past it, as bits; known
# of meshes is written anew in every step. Of smooth bodies they are empty tuples.
WallContacts = namedtuple(
    "WallContacts", "body wall feature data limit ended deepest known past"
)
Shared = namedtuple("Shared", "counters orders begins numbers due")
# loads: force on each wall and torque about the origin, (walls, 6) where a user asks for them, else (0, 6).
Walls = namedtuple(
    "Walls", "planes cones rings frames displaced motion moves material approach loads"
)
Physics = namedtuple(
    "Physics",
    "parts gravity law rolling law_constants rolling_constants n_state mixed_pairs mixed_walls dt rolling_frame "
    "exit_height curved_walls_above floor_height",
)

# Walls are numbered planes first, then cones, then rings, then meshes; cones and rings together are the curved walls.
# Walls.frames (curved and meshes, 12): origin and rotation, frame to world; displaced: whether it is not the world's.
# motion (walls, 9): velocity, angular velocity, pivot. moves: whether any of these is not zero. material: of each wall,
# as bodies.kind. approach: how far any wall may have come nearer until now [m], speed of the fastest [m/s], whether any
# moves.
# Places of `Walls.approach`.
WALL_PATH, WALL_SPEED, WALLS_MOVE = range(3)
# Columns of Walls.planes: point (3), normal from the inside into the wall (3), radius of the disc.
# Columns of Walls.cones: m_r, m_z (normal into the wall), offset k, s_min, s_max, e_r, e_z (up along the wall), radius.
# Columns of Walls.rings: core radius, height, edge radius, two gates (g_r, g_z) that the normal must not oppose.
PLANE_COLUMNS, CONE_COLUMNS, RING_COLUMNS = 7, 8, 7

# Scratch of a thread: a normal, the geometry of a contact and of another, a body's row in the frame of a wall,
# overlaps at STARTS places about an axis, the spheres of two bodies.
Scratch = namedtuple("Scratch", "normal out other local profile spheres")
STARTS = 24
SMALLEST_GAPS = 16  # that a search of the spheres of two bodies keeps, at most
SCRATCH = 64 + 32 + 10 * MOST_SPHERES + 3 * SMALLEST_GAPS


@inlined
def alive(x):
    """Set a velocity or a path below DEAD to 0.0: processors are slow with denormal numbers, to which decay leads."""
    return 0.0 if abs(x) < DEAD else x


@inlined
def scratch_of(numbers):
    """Return the parts of a `Scratch` in an array of SCRATCH numbers."""
    return Scratch(
        numbers[0:3],
        numbers[8:16],
        numbers[16:24],
        numbers[24:64],
        numbers[64 : 64 + STARTS],
        numbers[96:SCRATCH],
    )


def zeros(*shape):
    """Return an array of zeros that begins at a cache line: a vector that straddles two lines costs twice."""
    size = int(np.prod(shape))
    store = np.zeros(size + CACHE_LINE)
    skip = -store.ctypes.data % (8 * CACHE_LINE) // 8
    return store[skip : skip + size].reshape(shape)


@inlined
def share_column(parts):
    """Column of `rows` with the share of its tangential dashpots that a body takes, see `body_rotation.share_lanes`."""
    return SPHERE_RADIUS + 1 if parts == SPHERES else SHAPE + max(PART * parts, 4)


def row_end(parts):
    """Count the used columns of `rows`."""
    return share_column(parts) + 1


def each(names, shape, kind, value=0):
    """Return an array of its own for each name, filled with a value."""
    return {
        name: np.full(shape, value, kind) if value else np.zeros(shape, kind)
        for name in names.split()
    }


def new_bodies(n, parts, shares=1):
    """Arrays for n bodies of up to `parts` parts, all absent; shares: number of shares of the loads, see `parallel`.

    The arrays have whole tiles and at least one body more than n. This body n is always absent and stands in the unused
    lanes of contact tiles: it has no mass, so no force moves it, and a shape, so its geometry is finite.
    """
    padded = LANES * (n // LANES + 1)
    rows = zeros(padded, CACHE_LINE * -(-row_end(parts) // CACHE_LINE))
    rows[:, [SPHERE_RADIUS] if parts == SPHERES else [SHAPE, SHAPE + 3, SHAPE + 5]] = (
        1e-3 if parts == SPHERES else 1e-6
    )
    rows[:, share_column(parts)] = 1.0
    motion = zeros(padded // LANES, MOTION_ROWS * LANES)
    motion[:, :LANES] = 1.0
    motion[:, RADIUS : RADIUS + LANES] = 1e-3
    motion[:, SQUARES : SQUARES + 3 * LANES] = 1e-6
    return Bodies(
        rows=rows,
        load=zeros(shares, padded, LOAD_COLUMNS),
        touched=np.zeros((shares, padded // LANES), np.uint8),
        motion=motion,
        displacement=zeros(padded),
        wall_check=np.full(padded, np.inf),
        **each("presence passed kind event", padded, np.uint8),
        exit_time=np.full(padded, np.nan),
        every=np.arange(padded, dtype=np.uint32),
        resting=np.zeros(padded // LANES, np.uint8),
        events=np.zeros(padded, np.int64),
        **each("longest wall_margin", padded // LANES, float),
    )


def lanes_of(motion, row, columns, n):
    """Return the quantity of the first n bodies that starts at a row of `motion`, a copy (n, columns)."""
    first = row // LANES
    tiles = motion.reshape(len(motion), MOTION_ROWS, LANES)[:, first : first + columns]
    return tiles.transpose(0, 2, 1).reshape(-1, columns)[:n].copy()


def new_grid(n, lower, upper, cell):
    """Cells of edge `cell` [m] over a box, at most CELLS_PER_BODY for each of n bodies (or FEWEST_CELLS).

    The cells repeat in space like the tiles of a floor: a place outside of the box, or of the part of it that the cells
    cover, belongs to the cell at the same place of the repetition. So the memory depends on the number of bodies and
    not on the box. touching, near: number of pairs of each body in either list; lengths: edge of a cell, largest
    distance of two centres that may touch, skin; paths, in simulations that threads may share: how far a body of each
    group may have moved until now, and in the last step (see `parallel`).
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    shape = np.maximum(1.0, np.ceil((upper - lower) / cell))
    while shape.prod() > max(CELLS_PER_BODY * n, FEWEST_CELLS):
        shape[shape.argmax()] = np.ceil(0.5 * shape.max())
    shape = shape.astype(np.int64)
    return Grid(
        **each("cell following preceding chain mark", n, np.int64, -1),
        head=np.full(int(shape.prod()), -1, np.int64),
        moved=np.zeros(n, np.uint8),
        **each("moved_list touching near", n, np.int64),
        shape=shape,
        origin=lower.copy(),
        lengths=np.array([cell, 0.0, 0.0]),
        paths=np.zeros((2, MOST_GROUPS)),
    )


def new_contacts(n, rows):
    """Tiles for n contacts; unused lanes hold a valid normal."""
    data = zeros(-(-n // LANES), rows * LANES)
    data[:, 2 * LANES : 3 * LANES] = 1.0
    return data


def contact_rows(data, n):
    """Return the first n contacts of tiles as an array (n, rows of a tile)."""
    rows = data.shape[1] // LANES
    return data.reshape(-1, rows, LANES).transpose(0, 2, 1).reshape(-1, rows)[:n]


def whole_tiles(n):
    """Round up a number of contacts to that of whole tiles."""
    return LANES * -(-n // LANES)


def new_pairs(n_contacts, n_near, ghost, n_state):
    """Arrays for touching and near pairs; unused contacts have body `ghost`, and n_state rows are of the force laws."""
    n_contacts = whole_tiles(n_contacts)
    return Pairs(
        **each("first second", n_contacts, np.uint32, ghost),
        data=new_contacts(n_contacts, PAIR_STATE // LANES + n_state),
        **each("near_first near_second", n_near, np.uint32),
        near_limit=np.zeros(n_near),
        near_normal=np.zeros((n_near, 3)),
        near_check=np.zeros(n_near // BLOCK + 1),
        near_groups=np.zeros(n_near // BLOCK + 1, np.int64),
        ended=np.zeros(n_contacts, np.int64),
        gap=np.zeros(n_contacts),
        **each("partner link", 2 * n_contacts, np.int64),
    )


def new_wall_contacts(n_contacts, n_walls, n_bodies, ghost, rows, of_clumps):
    """Arrays for contacts with walls of one kind; `limit` is the displacement at the next check.

    `feature` is the number of the feature of a mesh, or else of the sphere of a clump.
    """
    n_contacts = whole_tiles(n_contacts)
    data = new_contacts(n_contacts, rows)
    data[:, RADIUS2 : RADIUS2 + LANES] = np.inf
    bits = (
        each("known past", (n_walls, n_bodies), np.uint64)
        if of_clumps
        else {"known": (), "past": ()}
    )
    return WallContacts(
        body=np.full(n_contacts, ghost, np.uint32),
        **each("wall feature", n_contacts, np.uint32),
        data=data,
        limit=np.full((n_walls, n_bodies), -1.0),
        ended=np.zeros(n_contacts, np.int64),
        deepest=np.full((n_walls, n_bodies), np.inf),
        **bits,
    )
