"""The arrays of a simulation, grouped as named tuples that numba kernels take as they are."""

from collections import namedtuple

import numpy as np

# Columns of `rows` (N, 16), two cache lines a body: position, quaternion, velocity, angular velocity.
Q = 3
BODY_COLUMNS = 16
# Columns of `load` (N, 8): force, torque, budget of the rolling torque.
ROLL = 6
LOAD_COLUMNS = 8
# Contacts lie in tiles of LANES, a row a quantity: normal, tangential spring, and for a wall its azimuth (curved) or
# offset (plane). Contact k is lane k % LANES of tile k // LANES.
LANES = 32
CONTACT_ROWS = 7
NORMAL, SPRING, AZIMUTH, OFFSET = 0, 3 * LANES, 6 * LANES, 6 * LANES

# Slots of `counts`.
N_BODIES, N_PAIRS, N_DORMANT, N_PLANE, N_CURVED, N_MOVED, STEPS, FULL, STAMP = range(9)

ABSENT, PRESENT, GONE = 0, 1, 2

Bodies = namedtuple(
    "Bodies",
    "rows momentum load odometer presence passed exit_time",
)
Grid = namedtuple(
    "Grid", "reference cell following preceding head moved moved_list mark shape origin lengths"
)
Pairs = namedtuple(
    "Pairs", "first second data dormant_first dormant_second dormant_limit dormant_normal ended"
)
WallContacts = namedtuple("WallContacts", "body wall data limit ended")
Walls = namedtuple("Walls", "planes cones rings")
Physics = namedtuple(
    "Physics",
    "squares inertia mobility gravity law_pair law_wall mass dt mur_pair mur_wall tension "
    "exit_height funnel_floor floor_height",
)

# Columns of Walls.planes: point (3), normal from the inside into the wall (3), radius of the disc.
# Columns of Walls.cones: m_r, m_z (normal into the wall), offset k, s_min, s_max, e_r, e_z (up along the wall), radius.
# Columns of Walls.rings: core radius, height, edge radius, two gates (g_r, g_z) that the normal must not oppose.
PLANE_COLUMNS, CONE_COLUMNS, RING_COLUMNS = 7, 8, 7


def new_bodies(n):
    """Arrays for n bodies, none of them present yet."""
    rows = np.zeros((n, BODY_COLUMNS))
    rows[:, Q] = 1.0
    return Bodies(
        rows=rows,
        momentum=np.zeros((n, 4)),
        load=np.zeros((n, LOAD_COLUMNS)),
        odometer=np.zeros(n),
        presence=np.zeros(n, np.uint8),
        passed=np.zeros(n, np.uint8),
        exit_time=np.full(n, np.nan),
    )


def new_grid(n, lower, upper, cell):
    """Cells of edge `cell` [m] over a box; what lies outside belongs to the nearest cell of the box."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    shape = np.maximum(1, np.ceil((upper - lower) / cell)).astype(np.int64)
    return Grid(
        reference=np.zeros((n, 3)),
        cell=np.full(n, -1, np.int64),
        following=np.full(n, -1, np.int64),
        preceding=np.full(n, -1, np.int64),
        head=np.full(int(shape.prod()), -1, np.int64),
        moved=np.zeros(n, np.uint8),
        moved_list=np.zeros(n, np.int64),
        mark=np.full(n, -1, np.int64),
        shape=shape,
        origin=lower.copy(),
        lengths=np.array([cell, 0.0, 0.0]),
    )


def new_contacts(n):
    """Tiles for n contacts; unused lanes hold a harmless normal."""
    data = np.zeros((-(-n // LANES), CONTACT_ROWS * LANES))
    data[:, 2 * LANES : 3 * LANES] = 1.0
    return data


def contact_rows(data, n):
    """The first n contacts of tiles as an array (n, CONTACT_ROWS)."""
    return data.reshape(-1, CONTACT_ROWS, LANES).transpose(0, 2, 1).reshape(-1, CONTACT_ROWS)[:n]


def new_pairs(n_contacts, n_dormant):
    """Room for touching pairs and for pairs that lie dormant."""
    return Pairs(
        first=np.zeros(n_contacts, np.int64),
        second=np.zeros(n_contacts, np.int64),
        data=new_contacts(n_contacts),
        dormant_first=np.zeros(n_dormant, np.int64),
        dormant_second=np.zeros(n_dormant, np.int64),
        dormant_limit=np.zeros(n_dormant),
        dormant_normal=np.zeros((n_dormant, 3)),
        ended=np.zeros(n_contacts, np.int64),
    )


def new_wall_contacts(n_contacts, n_walls, n_bodies):
    """Room for contacts with walls of one kind; `limit` is the odometer reading that calls for a new look."""
    return WallContacts(
        body=np.zeros(n_contacts, np.int64),
        wall=np.zeros(n_contacts, np.int64),
        data=new_contacts(n_contacts),
        limit=np.full((n_walls, n_bodies), -1.0),
        ended=np.zeros(n_contacts, np.int64),
    )
