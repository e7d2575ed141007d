"""The arrays of a simulation, grouped as named tuples, the arguments of the kernels.

The named tuples after the constants describe what each array holds. Contacts and the
motion of bodies are stored in tiles (see `rows`): number k is lane k % LANES of tile
k // LANES. Unless a comment says otherwise, all quantities are in SI units and all
vectors in world axes. Kernels change the arrays in place.
"""

from typing import Any, NamedTuple

import numpy as np

from .jit import inlined
from .rows import LANES, Rows

CACHE_LINE = 8  # doubles in a cache line
BLOCK = 256  # near pairs of a large simulation that are checked together
MOST_GROUPS = 60  # groups of bodies; each group is one bit of an int64
# Velocities and springs below this absolute value are set to zero [SI units]. The
# square of this number is not yet denormal.
TINY = 1e-100
# Sums of path lengths over a few thousand steps are exact to within this distance [m].
ROUNDING = 1e-12

# Indices in `Grid.lengths`: the edge of a cell, the largest distance of two centres
# whose bodies may touch, and the skin of the neighbour list, all in m.
CELL, REACH, SKIN = range(3)

# ---- Columns of `Bodies.rows` -------------------------------------------------------
# The data of a body that its contacts need. If a body does not turn, only its first
# eight columns change. The last column used is that of `share_column`.
POSITION = 0  # (3)
VELOCITY = 3  # (3)
INVERSE_MASS = 6
ANGULAR_VELOCITY = 7  # (3)
INVERSE_INERTIA = 10  # (6): xx, xy, xz, yy, yz, zz
# The shape. A smooth body has PART columns for each ellipsoid, with its symmetric
# matrix R diag(a^2, b^2, c^2) R' as xx, xy, xz, yy, yz, zz. A clump has its quaternion
# (w, x, y, z).
SHAPE = 16
PART = 6
# A sphere has neither inertia nor shape there, only its radius.
SPHERE_RADIUS = INVERSE_INERTIA

MOST_PARTS = 3  # largest number of ellipsoids in a smooth body
SPHERES = -1  # value of `Physics.parts` if every body is a sphere
MOST_SPHERES = 64  # largest number of spheres in a clump

# ---- Columns of `Bodies.load` -------------------------------------------------------
FORCE = 0  # (3)
TORQUE = 3  # (3), about the centre of the body
ROLL = 6  # budget of the rolling resistance: the torque that it can resist
DASHPOTS = 7  # sum of the tangential dashpots, each times the square of its arm
LOAD_COLUMNS = 8

# ---- Rows of a tile of `Bodies.motion` ----------------------------------------------
# Data that only the motion of a body needs. For a tile at rest, a step reads only
# RENEWAL.
_motion = Rows()
QUATERNION = _motion.take(4)  # (w, x, y, z), from the body's axes to the world's
ANGULAR_MOMENTUM = _motion.take(3)
RENEWAL = _motion.take()  # displacement at which the neighbours are listed again
INVERSE_MOMENTS = _motion.take(3)  # 1 / principal moments of inertia
SQUARES = _motion.take(3 * MOST_PARTS)  # squared semi-axes of each part
RADIUS = _motion.take()  # bounding radius
MOTION_ROWS = _motion.count

# ---- Rows of a tile of contacts -----------------------------------------------------
# The numbers that a contact keeps from step to step: the normal, then rows of the
# geometry, then rows of the force laws. The rows of the laws begin at PAIR_STATE for
# pairs of smooth bodies and at WALL_STATE for smooth bodies on walls. For clumps see
# `clump_tile`.
_pair = Rows()
NORMAL = _pair.take(3)  # from body A to body B, or into the wall
PAIR_STATE = _pair.end
# The rows of a contact with a wall have two meanings. With a plane, they are the offset
# of the plane along the normal, and the centre (3) and squared radius of its disc. With
# a cone, ring or mesh, they are the azimuth of the contact (for a mesh the angle about
# an edge) and the gap.
_wall = Rows(_pair.end)
AZIMUTH = OFFSET = _wall.take()
MIDDLE = GAP = _wall.take(3)
SQUARED_RADIUS = _wall.take()
WALL_STATE = _wall.end

# ---- Indices in `counts` -------------------------------------------------------------
(
    N_BODIES,
    N_PAIRS,  # touching pairs
    N_NEAR,  # near pairs, or entries of clumps including holes
    N_PLANE,  # contacts with planes
    N_CURVED,  # contacts with cones, tubes and rings
    N_MOVED,  # bodies in `Grid.moved_list`
    STEPS,  # time steps made
    FULL,  # 1 when a list had no room for an item
    N_GONE,  # bodies that left the simulation in the previous step
    N_MESHED,  # contacts with meshes
    N_FREE,  # holes in the list of entries of clumps
) = range(11)
COUNTS = 11

ABSENT, PRESENT, GONE = 0, 1, 2  # values of `Bodies.presence`

# The grid has at most this many cells per body, or FEWEST_CELLS if that is more.
CELLS_PER_BODY, FEWEST_CELLS = 64, 4096

# ---- Walls --------------------------------------------------------------------------
# Walls are numbered: planes first, then cones, then rings, then meshes. Cones and rings
# together are the curved walls. A tube is a cone.
# Columns of `Walls.planes`.
PLANE_POINT = 0  # (3), the centre of a disc
PLANE_NORMAL = 3  # (3), into the wall
PLANE_RADIUS = 6  # of the disc; infinite for a plane without an edge
PLANE_COLUMNS = 7
# Columns of `Walls.cones`, in the half plane (r, z) of the cone's own frame.
CONE_NORMAL_R, CONE_NORMAL_Z = 0, 1  # normal, into the wall
CONE_OFFSET = 2  # of the line along its normal
CONE_START, CONE_END = 3, 4  # the wall's two ends, as distances along the line
CONE_UP_R, CONE_UP_Z = 5, 6  # unit vector up along the line
CONE_COLUMNS = 8
# Columns of `Walls.rings`, in the ring's own frame. The edge is a torus. A body can
# touch only the part of it whose normal does not point away from either of the two
# gates (r, z).
RING_RADIUS, RING_HEIGHT = 0, 1  # of the circle in the middle of the torus
RING_EDGE_RADIUS = 2
RING_GATE_A_R, RING_GATE_A_Z, RING_GATE_B_R, RING_GATE_B_Z = 3, 4, 5, 6
RING_COLUMNS = 7
# Columns of `Walls.frames`.
FRAME_ORIGIN = 0  # (3)
FRAME_ROTATION = 3  # (9), row by row, from the frame's axes to the world's
# Columns of `Walls.motion`.
WALL_VELOCITY, WALL_SPIN, WALL_PIVOT = 0, 3, 6  # (3) each
# Indices in `Walls.approach`: how far any wall may have approached a body until now
# [m], the speed of the fastest wall [m/s], and whether any wall moves.
WALL_PATH, WALL_SPEED, WALLS_MOVE = range(3)


class Bodies(NamedTuple):
    """The bodies; N is a multiple of LANES, and T = N / LANES the number of tiles."""

    rows: Any  # (N, columns), see POSITION to SHAPE
    load: Any  # (shares, N, LOAD_COLUMNS): the sum over the shares acts on a body
    touched: Any  # (shares, T): 1 if a share of a tile's loads may differ from zero
    motion: Any  # (T, MOTION_ROWS * LANES)
    displacement: Any  # (N,): how far any point of the body may have moved until now
    wall_check: Any  # (N,): displacement of body and walls at the next wall check
    presence: Any  # (N,): ABSENT, PRESENT or GONE
    below_curved_walls: Any  # (N,): 1 once the body is below the curved walls
    exit_time: Any  # (N,): when it fell through the exit height [s]; NaN before
    indices: Any  # (N,): 0, 1, 2, ...: the index with which `simd` reads a whole tile
    resting: Any  # (T,): 1 if no body of the tile turned in the previous step
    material: Any  # (N,): index of the material
    event: Any  # (N,): bits of the events of a body, see `rigid`
    events: Any  # (N,): the bodies with events
    longest_path: Any  # (T,): longest path of the tile's bodies in the previous step
    wall_margin: Any  # (T,): path left until a body of the tile is due for walls


class Grid(NamedTuple):
    """The cells for the search of neighbours, with linked lists of their bodies."""

    cell: Any  # (N,): the cell of each body, or -1
    following: Any  # (N,): the next body in the same cell, or -1
    preceding: Any  # (N,): the body before it in the same cell, or -1
    head: Any  # (cells,): the first body of each cell, or -1
    moved: Any  # (N,): 1 for the bodies in `moved_list`
    moved_list: Any  # (N,): the bodies whose neighbours must be found again
    chain: Any  # (N,): first link of a body's partners, an index in `Pairs.link`, or -1
    mark: Any  # (N,): body i of an existing pair, during the search for pairs of i
    touching: Any  # (N,): number of touching pairs of each body
    near: Any  # (N,): number of near pairs of each body
    shape: Any  # (3,): number of cells along each axis
    origin: Any  # (3,): lower corner of the first cell
    lengths: Any  # (3,): see CELL, REACH, SKIN
    paths: Any  # (2, MOST_GROUPS): paths of the groups of bodies, see `parallel`


class Pairs(NamedTuple):
    """Pairs of smooth bodies that touch (contacts), and pairs that are near."""

    first: Any  # (contacts,): body A
    second: Any  # (contacts,): body B
    data: Any  # (tiles, rows * LANES)
    near_first: Any  # (near,)
    near_second: Any  # (near,)
    near_limit: Any  # (near,): sum of displacements at which the pair is checked
    near_normal: Any  # (near, 3): normal of the last check
    near_check: Any  # (blocks,): see `parallel`
    near_groups: Any  # (blocks,): groups of the bodies of each block, as bits
    ended: Any  # (contacts,): contacts that ended in this step
    gap: Any  # (contacts,): their gaps
    partner: Any  # (2 * contacts,): the body of a link of a chain, see `Grid.chain`
    link: Any  # (2 * contacts,): the next link of the chain, or -1


class WallContacts(NamedTuple):
    """Contacts with the walls of one kind; W is the number of these walls."""

    body: Any  # (contacts,)
    wall: Any  # (contacts,): index among the walls of this kind
    feature: Any  # (contacts,): feature of the mesh, or else sphere of the clump
    data: Any  # (tiles, rows * LANES)
    limit: Any  # (W, N): displacement of body and walls at the next search
    ended: Any  # (contacts,): contacts that ended in this step
    # (W, N), smooth bodies: the largest overlap with which a contact may begin. It is
    # infinite unless the body is past the wall, see `walls`.
    allowed_overlap: Any
    # (W, N), clumps: bits that mark the spheres of a body that touch the wall, and
    # those that are past it. Bits of meshes are rewritten in every step. Both are empty
    # tuples for smooth bodies.
    touching_bits: Any
    past_bits: Any


class Walls(NamedTuple):
    """The walls; C is the number of cones and rings, M that of meshes."""

    planes: Any  # (planes, PLANE_COLUMNS)
    cones: Any  # (cones, CONE_COLUMNS)
    rings: Any  # (rings, RING_COLUMNS)
    frames: Any  # (C + M, 12): origin, then rotation from frame to world
    displaced: Any  # (C + M,): 1 if the frame may differ from that of the world
    motion: Any  # (walls, 9): velocity, angular velocity, pivot
    moves: Any  # (walls,): 1 if the wall moves
    material: Any  # (walls,): index of the material, like `Bodies.material`
    approach: Any  # (3,): see WALL_PATH, WALL_SPEED, WALLS_MOVE
    loads: Any  # (walls, 6): force and torque about the origin; (0, 6) if not requested


class Physics(NamedTuple):
    """Quantities that usually do not change during a simulation."""

    parts: (
        Any  # ellipsoids of the smooth body with the most of them; 0: clumps; SPHERES
    )
    gravity: Any  # (3,)
    law: Any  # options of the contact law
    rolling: Any  # options of the rolling law
    law_constants: Any  # (materials, materials, constants)
    rolling_constants: Any  # (materials, materials, constants)
    n_state: Any  # rows of a contact that the contact law keeps
    mixed_pairs: Any  # whether bodies have several materials
    mixed_walls: Any  # whether contacts with walls have several pairs of materials
    dt: Any  # time step
    rolling_frame: Any  # (3,): angular velocity against which rolling is resisted
    exit_height: Any  # a body that falls through it gets an exit time
    curved_walls_above: Any  # bodies below it no longer touch curved walls
    floor_height: Any  # bodies below it are gone


class Shared(NamedTuple):
    """The arrays that the threads of a simulation share, see `parallel`."""

    counters: Any  # (BARRIER_SIZE,): counters of the barrier
    flags: Any  # (1,): 1 when all threads have to stop
    begins: Any  # (SHARES,): first item of each share
    n_found: Any  # (SHARES,): number of items that a share found
    touching: Any  # near pairs that touch, those of each share from its first item on


class Scratch(NamedTuple):
    """Working memory of one thread, views of one array."""

    normal: Any  # (3,): a normal, for the solver of gaps
    geometry: Any  # (8,): geometry of a contact with a wall, see `contact_geometry`
    other_geometry: Any  # (8,): of another feature of a mesh
    local_row: Any  # (40,): a row of `Bodies.rows` in the frame of a wall
    profile: Any  # (STARTS,): overlaps at equal angles about an axis
    spheres: Any  # the spheres of two bodies, see `sphere_search`


STARTS = 24  # angles about the axis of a curved wall at which a search starts
SMALLEST_GAPS = 16  # largest number of gaps that a search of two bodies keeps
# Indices at which the views of `Scratch` begin, each at a cache line.
_NORMAL_BEGIN, _GEOMETRY_BEGIN, _OTHER_BEGIN, _ROW_BEGIN = 0, 8, 16, 24
_PROFILE_BEGIN = 64
_SPHERES_BEGIN = 96
SCRATCH = _SPHERES_BEGIN + 10 * MOST_SPHERES + 3 * SMALLEST_GAPS


@inlined
def flush_tiny(value):
    """Return a velocity, spring or path, or 0.0 if its absolute value is below TINY.

    Values that decay would become denormal numbers, with which processors are slow.
    """
    return 0.0 if abs(value) < TINY else value


@inlined
def split_scratch(memory):
    """Return a `Scratch` whose arrays are views of an array of SCRATCH numbers.

    Kernels allocate nothing, so Python makes this array for each thread.
    """
    return Scratch(
        memory[_NORMAL_BEGIN : _NORMAL_BEGIN + 3],
        memory[_GEOMETRY_BEGIN:_OTHER_BEGIN],
        memory[_OTHER_BEGIN:_ROW_BEGIN],
        memory[_ROW_BEGIN:_PROFILE_BEGIN],
        memory[_PROFILE_BEGIN : _PROFILE_BEGIN + STARTS],
        memory[_SPHERES_BEGIN:SCRATCH],
    )


@inlined
def bounding_radius(bodies, i):
    """Return the largest distance of a point of body i from its centre [m]."""
    return bodies.motion[i // LANES, RADIUS + i % LANES]


@inlined
def share_column(parts):
    """Return the column of `Bodies.rows` with a body's dashpot fraction.

    This is the fraction of its tangential dashpots that the body allows to act, see
    `body_rotation.write_dashpot_shares`. The column follows the shape of the body.
    """
    return SPHERE_RADIUS + 1 if parts == SPHERES else SHAPE + max(PART * parts, 4)


def count_columns(parts):
    """Return the number of columns of `Bodies.rows` in use; see `Physics.parts`."""
    return share_column(parts) + 1


def aligned_zeros(*shape):
    """Return an array of zeros of the given shape that begins at a cache line.

    Reading a vector that straddles two cache lines takes twice as long.
    """
    size = int(np.prod(shape))
    # Make a longer array, and skip its numbers before the first cache line.
    padded = np.zeros(size + CACHE_LINE)
    skip = -padded.ctypes.data % (8 * CACHE_LINE) // 8
    return padded[skip : skip + size].reshape(shape)


def equal_arrays(names, shape, dtype, fill_value=0):
    """Return several equal arrays in a dictionary by name.

    Parameters
    ----------
    names : str
        Names of the arrays, with spaces between them.
    shape : int or tuple of int
        Shape of each array.
    dtype : data type
        Type of the numbers.
    fill_value : number
        Value of all numbers; 0 by default.
    """
    arrays = {}
    for name in names.split():
        if fill_value:
            arrays[name] = np.full(shape, fill_value, dtype)
        else:
            arrays[name] = np.zeros(shape, dtype)  # the memory is not touched yet
    return arrays


def new_bodies(n_bodies, parts, shares=1):
    """Return the arrays for a number of bodies, all of them absent.

    Parameters
    ----------
    n_bodies : int
        Number of bodies.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    shares : int
        Number of arrays of partial sums of the loads, see `parallel`.

    Returns
    -------
    Bodies
        The arrays, which consist of whole tiles and have room for at least one more
        body. This body, with the index `n_bodies`, is always absent. It is the "ghost"
        in unused lanes of contact tiles. It has no mass, so that no force moves it, and
        a small shape, so that its geometry is finite.
    """
    n_tiles = n_bodies // LANES + 1
    n_places = LANES * n_tiles
    # The number of places, and the number of columns rounded up, so that a row fills
    # whole cache lines
    n_columns = CACHE_LINE * -(-count_columns(parts) // CACHE_LINE)
    # All bodies have a small shape, a sphere of 1 mm, and no mass. The squared
    # semi-axes are 1e-6 m^2.
    rows = aligned_zeros(n_places, n_columns)
    if parts == SPHERES:
        rows[:, SPHERE_RADIUS] = 1e-3
    else:
        diagonal = [SHAPE, SHAPE + 3, SHAPE + 5]  # xx, yy, zz
        rows[:, diagonal] = 1e-6
    # The fraction of its tangential dashpots that a body allows to act
    rows[:, share_column(parts)] = 1.0
    motion = aligned_zeros(n_tiles, MOTION_ROWS * LANES)
    motion[:, QUATERNION : QUATERNION + LANES] = 1.0  # w of (w, x, y, z)
    motion[:, RADIUS : RADIUS + LANES] = 1e-3
    motion[:, SQUARES : SQUARES + 3 * LANES] = 1e-6
    return Bodies(
        rows=rows,
        load=aligned_zeros(shares, n_places, LOAD_COLUMNS),
        touched=np.zeros((shares, n_tiles), np.uint8),
        motion=motion,
        displacement=aligned_zeros(n_places),
        wall_check=np.full(n_places, np.inf),
        **equal_arrays(
            "presence below_curved_walls material event", n_places, np.uint8
        ),
        exit_time=np.full(n_places, np.nan),
        indices=np.arange(n_places, dtype=np.uint32),
        resting=np.zeros(n_tiles, np.uint8),
        events=np.zeros(n_places, np.int64),
        **equal_arrays("longest_path wall_margin", n_tiles, float),
    )


def copy_motion(motion, row, n_columns, n_bodies):
    """Return a copy of a quantity of the first bodies of `Bodies.motion` as a table.

    Parameters
    ----------
    motion : ndarray (tiles, MOTION_ROWS * LANES)
        `Bodies.motion`.
    row : int
        First row of the quantity in a tile, such as QUATERNION.
    n_columns : int
        Number of its rows, one for each component.
    n_bodies : int
        Number of bodies.

    Returns
    -------
    ndarray (n_bodies, n_columns)
        One row for each body.
    """
    # Select the rows of the quantity from an array (tiles, rows, lanes).
    first = row // LANES
    tiles = motion.reshape(len(motion), MOTION_ROWS, LANES)[
        :, first : first + n_columns
    ]
    return tiles.transpose(0, 2, 1).reshape(-1, n_columns)[:n_bodies].copy()


def new_grid(n_bodies, lower, upper, cell):
    """Return the cells of the search for neighbours, for bodies in a box.

    The grid has at most CELLS_PER_BODY cells per body (or FEWEST_CELLS), so that the
    memory depends on the number of bodies and not on the box. The grid repeats in space
    like the tiles of a floor. A point outside it belongs to the cell at the same
    position in the repeated grid.

    Parameters
    ----------
    n_bodies : int
        Number of bodies.
    lower, upper : array_like (3,)
        Corners of the box [m].
    cell : float
        Edge of a cell [m].
    """
    lower = np.asarray(lower, float)
    upper = np.asarray(upper, float)
    max_cells = max(CELLS_PER_BODY * n_bodies, FEWEST_CELLS)
    shape = np.maximum(1.0, np.ceil((upper - lower) / cell))
    # Halve the number of cells along the longest side until there are few enough.
    while shape.prod() > max_cells:
        shape[shape.argmax()] = np.ceil(0.5 * shape.max())
    shape = shape.astype(np.int64)
    # In the linked lists of bodies, -1 means that there is none. The caller sets the
    # other two lengths, REACH and SKIN.
    return Grid(
        **equal_arrays("cell following preceding chain mark", n_bodies, np.int64, -1),
        head=np.full(int(shape.prod()), -1, np.int64),
        moved=np.zeros(n_bodies, np.uint8),
        **equal_arrays("moved_list touching near", n_bodies, np.int64),
        shape=shape,
        origin=lower.copy(),
        lengths=np.array([cell, 0.0, 0.0]),
        paths=np.zeros((2, MOST_GROUPS)),
    )


def new_contacts(n_contacts, rows):
    """Return tiles for contacts, all unused.

    Unused lanes hold a valid normal, (0, 0, 1), so that their geometry is finite.

    Parameters
    ----------
    n_contacts : int
        Number of contacts, a multiple of LANES.
    rows : int
        Number of rows in a tile.

    Returns
    -------
    ndarray (tiles, rows * LANES)
        The tiles.
    """
    data = aligned_zeros(-(-n_contacts // LANES), rows * LANES)
    normal_z = NORMAL + 2 * LANES
    data[:, normal_z : normal_z + LANES] = 1.0
    return data


def contact_rows(data, n_contacts):
    """Return a copy of the first contacts of an array of tiles as a table.

    The table has a row for each contact and a column for each row of a tile.

    `data` (tiles, rows * LANES) has one contact in each lane.
    """
    rows = data.shape[1] // LANES
    return (
        data.reshape(-1, rows, LANES).transpose(0, 2, 1).reshape(-1, rows)[:n_contacts]
    )


def round_up_to_tiles(n_contacts):
    """Return `n_contacts`, rounded up to whole tiles (a multiple of LANES)."""
    return LANES * -(-n_contacts // LANES)


def new_pairs(n_contacts, n_near, ghost, n_state):
    """Return empty lists for touching and near pairs of smooth bodies.

    Parameters
    ----------
    n_contacts, n_near : int
        Capacity of the lists: the largest numbers of pairs.
    ghost : int
        Index of the ghost, the absent body in unused contacts.
    n_state : int
        Number of rows that the force laws keep for each contact.

    Returns
    -------
    Pairs
        The lists.
    """
    n_contacts = round_up_to_tiles(n_contacts)
    return Pairs(
        **equal_arrays("first second", n_contacts, np.uint32, ghost),
        data=new_contacts(n_contacts, PAIR_STATE // LANES + n_state),
        **equal_arrays("near_first near_second", n_near, np.uint32),
        near_limit=np.zeros(n_near),
        near_normal=np.zeros((n_near, 3)),
        near_check=np.zeros(n_near // BLOCK + 1),
        near_groups=np.zeros(n_near // BLOCK + 1, np.int64),
        ended=np.zeros(n_contacts, np.int64),
        gap=np.zeros(n_contacts),
        **equal_arrays("partner link", 2 * n_contacts, np.int64),
    )


def new_wall_contacts(n_contacts, n_walls, n_bodies, ghost, rows, are_clumps):
    """Return an empty list for contacts with the walls of one kind.

    Unused elements hold the ghost, an absent body without mass. A tile has a row for
    each quantity and a lane for each of LANES contacts.

    Parameters
    ----------
    n_contacts : int
        Capacity of the list: the largest number of contacts.
    n_walls, n_bodies : int
        Number of walls of this kind, and of bodies.
    ghost : int
        Index of the ghost, the absent body in unused contacts.
    rows : int
        Rows of a tile.
    are_clumps : bool
        Whether the bodies are clumps.

    Returns
    -------
    WallContacts
        The list.
    """
    n_contacts = round_up_to_tiles(n_contacts)
    data = new_contacts(n_contacts, rows)
    # Unused lanes lie on a plane without an edge, so that their gap is finite.
    data[:, SQUARED_RADIUS : SQUARED_RADIUS + LANES] = np.inf
    # Only the spheres of clumps need bits that mark them. For smooth bodies these are
    # empty tuples, which numba knows from their type.
    if are_clumps:
        bits = equal_arrays("touching_bits past_bits", (n_walls, n_bodies), np.uint64)
    else:
        bits = {"touching_bits": (), "past_bits": ()}
    # A limit of -1.0 is below every displacement, so each wall is searched in the first
    # step. An infinite allowed overlap means that no body is past a wall.
    return WallContacts(
        body=np.full(n_contacts, ghost, np.uint32),
        **equal_arrays("wall feature", n_contacts, np.uint32),
        data=data,
        limit=np.full((n_walls, n_bodies), -1.0),
        ended=np.zeros(n_contacts, np.int64),
        allowed_overlap=np.full((n_walls, n_bodies), np.inf),
        **bits,
    )
