"""Move walls, transform vectors to and from their frames, and add up their loads.

The module reads `Walls.motion` and `Walls.moves`. `move_walls` writes the positions of
moving walls (`Walls.planes`, `Walls.frames`), their pivots and `Walls.approach`.
`move_plane_contacts` writes the planes in the tiles of `WallContacts.data`.
`add_loads_of_walls` adds to `Walls.loads`. A frame is a row of `Walls.frames` (12,):
the origin, then the rotation from the frame's axes to the world's, row by row.
"""

import math

from . import contact_geometry, state, tile
from .jit import inlined, kernel
from .rows import LANES, lane_vector, set_vector, vector_at
from .state import FRAME_ORIGIN, FRAME_ROTATION, PART, SHAPE, SPHERES

# Columns of the rotation in a frame. XY is the x component of the frame's y axis.
XX, XY, XZ, YX, YY, YZ, ZX, ZY, ZZ = range(FRAME_ROTATION, FRAME_ROTATION + 9)


@inlined
def into_frame(frame, x, y, z):
    """Rotate a vector (x, y, z) from world axes into the axes of a frame.

    `frame` is a row of `Walls.frames`: the origin, then the rotation R from the frame's
    axes to the world's. The function returns R' times the vector.
    """
    return (
        frame[XX] * x + frame[YX] * y + frame[ZX] * z,
        frame[XY] * x + frame[YY] * y + frame[ZY] * z,
        frame[XZ] * x + frame[YZ] * y + frame[ZZ] * z,
    )


@inlined
def out_of_frame(frame, x, y, z):
    """Rotate a vector (x, y, z) from the axes of a frame into world axes.

    The function returns R times the vector, with the rotation R of `into_frame`.
    """
    return (
        frame[XX] * x + frame[XY] * y + frame[XZ] * z,
        frame[YX] * x + frame[YY] * y + frame[YZ] * z,
        frame[ZX] * x + frame[ZY] * y + frame[ZZ] * z,
    )


@inlined
def place_in_frame(frame, x, y, z):
    """Transform a point (x, y, z) of the world to the origin and axes of a frame."""
    x0, y0, z0 = vector_at(frame, FRAME_ORIGIN)
    return into_frame(frame, x - x0, y - y0, z - z0)


@inlined
def rotate_to_world(frame, values, first):
    """Rotate a vector in an array from a frame into world axes, in place.

    `frame` is a row of `Walls.frames`. `first` is the index of the vector's x component
    in `values`; y and z follow.
    """
    x, y, z = vector_at(values, first)
    x, y, z = out_of_frame(frame, x, y, z)
    set_vector(values, first, x, y, z)


@inlined
def normal_to_world(walls, frame, geometry):
    """Rotate the normal of a contact from a frame into world axes, in place.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the wall's frame. Curved walls come first, then meshes.
    geometry : array (8,)
        The contact (`contact_geometry`).
    """
    if walls.displaced[frame]:
        rotate_to_world(walls.frames[frame], geometry, contact_geometry.NORMAL)


@inlined
def contact_to_world(walls, frame, geometry):
    """Rotate normal and arm of a contact from a frame into world axes, in place.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the wall's frame. Curved walls come first, then meshes.
    geometry : array (8,)
        The contact (`contact_geometry`).
    """
    if walls.displaced[frame]:
        rotate_to_world(walls.frames[frame], geometry, contact_geometry.NORMAL)
        rotate_to_world(walls.frames[frame], geometry, contact_geometry.ARM)


@inlined
def mesh_frame(walls, mesh):
    """Return the index of a mesh's frame in `Walls.frames`, after the curved walls."""
    return walls.cones.shape[0] + walls.rings.shape[0] + mesh


@kernel
def write_row_in_frame(row, parts, frame, local_row):
    """Transform position and shape of a body to a frame, and write them to another row.

    The shape of a sphere is its radius. Any other body has a symmetric matrix S for
    each of its ellipsoids, stored as six columns: xx, xy, xz, yy, yz, zz. In the frame
    it is R' S R, with the rotation R of the frame.

    Parameters
    ----------
    row : array
        The body: a row of `Bodies.rows`. The module `state` names its columns.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    frame : array (12,)
        The row of `Walls.frames`.
    local_row : array
        Overwritten with position and shape. Its other columns keep their values.
    """
    x, y, z = vector_at(row, state.POSITION)
    # A position is shifted and rotated into the frame, while `into_frame` only rotates
    # a vector.
    x, y, z = place_in_frame(frame, x, y, z)
    set_vector(local_row, state.POSITION, x, y, z)
    if parts == SPHERES:
        local_row[state.SPHERE_RADIUS] = row[state.SPHERE_RADIUS]
    # For a sphere, `parts` is -1, so this loop does nothing.
    for part in range(parts):
        # R' S: rotate the three columns of S into the frame.
        first = SHAPE + PART * part
        ax, ay, az = into_frame(frame, row[first], row[first + 1], row[first + 2])
        bx, by, bz = into_frame(frame, row[first + 1], row[first + 3], row[first + 4])
        cx, cy, cz = into_frame(frame, row[first + 2], row[first + 4], row[first + 5])
        # R' S R: rotate the rows of R' S, and keep the upper triangle.
        xx, xy, xz = into_frame(frame, ax, bx, cx)
        _yx, yy, yz = into_frame(frame, ay, by, cy)
        _zx, _zy, zz = into_frame(frame, az, bz, cz)
        set_vector(local_row, first, xx, xy, xz)
        set_vector(local_row, first + 3, yy, yz, zz)


@inlined
def surface_velocity(motion, x, y, z):
    """Return the velocity v + omega x r of a moving wall at one of its points [m/s].

    Parameters
    ----------
    motion : array (9,)
        The row of `Walls.motion`: velocity v, angular velocity omega, pivot.
    x, y, z : float
        The point in the world [m]. r is the vector from the wall's pivot to the point.
    """
    vx, vy, vz = vector_at(motion, state.WALL_VELOCITY)
    omega_x, omega_y, omega_z = vector_at(motion, state.WALL_SPIN)
    pivot_x, pivot_y, pivot_z = vector_at(motion, state.WALL_PIVOT)
    rx, ry, rz = x - pivot_x, y - pivot_y, z - pivot_z
    return (
        vx + omega_y * rz - omega_z * ry,
        vy + omega_z * rx - omega_x * rz,
        vz + omega_x * ry - omega_y * rx,
    )


@inlined
def rotate_vector(angle, ux, uy, uz, x, y, z):
    """Rotate a vector about an axis by Rodrigues' formula, and return it.

    Parameters
    ----------
    angle : float
        The angle [rad].
    ux, uy, uz : float
        Unit vector along the axis.
    x, y, z : float
        The vector.
    """
    cos = math.cos(angle)
    sin = math.sin(angle)
    scaled_projection = (ux * x + uy * y + uz * z) * (1.0 - cos)
    return (
        x * cos + (uy * z - uz * y) * sin + ux * scaled_projection,
        y * cos + (uz * x - ux * z) * sin + uy * scaled_projection,
        z * cos + (ux * y - uy * x) * sin + uz * scaled_projection,
    )


@inlined
def rotate_frame(frame, angle, ux, uy, uz):
    """Rotate the axes of a frame about an axis, in place. The frame's origin stays.

    Parameters
    ----------
    frame : array (12,)
        The row of `Walls.frames`.
    angle : float
        The angle [rad].
    ux, uy, uz : float
        Unit vector along the axis.
    """
    # The columns of the rotation matrix are the axes of the frame.
    for axis in range(3):
        column = FRAME_ROTATION + axis
        x, y, z = rotate_vector(
            angle,
            ux,
            uy,
            uz,
            frame[column],
            frame[column + 3],
            frame[column + 6],
        )
        frame[column] = x
        frame[column + 3] = y
        frame[column + 6] = z


@kernel
def move_walls(walls, dt):
    """Move all moving walls by one time step.

    A wall rotates about its pivot, and the pivot moves with the wall's velocity. The
    function writes the planes or frames of these walls and their pivots. It also adds
    to `walls.approach[WALL_PATH]`, the distance by which any wall may have approached a
    body until now.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    dt : float
        Time step [s].
    """
    planes = walls.planes
    n_planes = planes.shape[0]
    for wall in range(walls.moves.shape[0]):
        if walls.moves[wall] == 0:
            continue
        # The wall rotates by an angle about the unit vector u. Without a rotation, both
        # are zero, and `rotate_vector` changes nothing.
        motion = walls.motion[wall]
        omega_x, omega_y, omega_z = vector_at(motion, state.WALL_SPIN)
        rate = math.sqrt(omega_x**2 + omega_y**2 + omega_z**2)
        inverse_rate = 1.0 / rate if rate > 0.0 else 0.0
        ux, uy, uz = (
            omega_x * inverse_rate,
            omega_y * inverse_rate,
            omega_z * inverse_rate,
        )
        angle = rate * dt
        # A plane is moved itself, any other wall by its frame. In both, the first three
        # columns are a point of the wall. Rotate the arm from the pivot to this point
        # before the pivot moves.
        surface = planes[wall] if wall < n_planes else walls.frames[wall - n_planes]
        pivot_x, pivot_y, pivot_z = vector_at(motion, state.WALL_PIVOT)
        arm_x, arm_y, arm_z = rotate_vector(
            angle,
            ux,
            uy,
            uz,
            surface[0] - pivot_x,
            surface[1] - pivot_y,
            surface[2] - pivot_z,
        )
        # Move the pivot. The wall's point is the pivot plus the rotated arm.
        for axis in range(3):
            motion[state.WALL_PIVOT + axis] += dt * motion[state.WALL_VELOCITY + axis]
        surface[0] = motion[state.WALL_PIVOT] + arm_x
        surface[1] = motion[state.WALL_PIVOT + 1] + arm_y
        surface[2] = motion[state.WALL_PIVOT + 2] + arm_z
        # Rotate the normal of a plane, or the axes of a frame.
        if wall < n_planes:
            nx, ny, nz = vector_at(surface, state.PLANE_NORMAL)
            nx, ny, nz = rotate_vector(angle, ux, uy, uz, nx, ny, nz)
            set_vector(surface, state.PLANE_NORMAL, nx, ny, nz)
        else:
            rotate_frame(surface, angle, ux, uy, uz)
    # WALL_SPEED bounds the speed with which any wall approaches a body.
    walls.approach[state.WALL_PATH] += dt * walls.approach[state.WALL_SPEED]


@kernel
def move_plane_contacts(flat, walls, n_contacts):
    """Update the copies of moving planes in the first n contacts with planes.

    Each contact keeps a copy of its plane, so that vector code can read it lane by
    lane.

    Parameters
    ----------
    flat : WallContacts
        The contacts with planes.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    n_contacts : int
        Number of contacts.
    """
    for k in range(n_contacts):
        wall = flat.wall[k]
        if walls.moves[wall]:
            write_plane(flat.data[k // LANES], k % LANES, walls.planes[wall])


@inlined
def write_plane(history, lane, plane):
    """Write normal, offset, centre and squared radius of a plane to a contact's lane.

    The offset is the signed distance of the plane from the origin along its normal. A
    row of the tile holds one quantity of LANES contacts, so component `axis` of a
    vector is in the row LANES * axis after the first one.

    Parameters
    ----------
    history : array (rows * LANES,)
        The contact's tile of `WallContacts.data`. The rows of the plane are overwritten
        in its lane.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    plane : array
        The row of `Walls.planes`.
    """
    offset = 0.0
    # PLANE_POINT, the point of the plane, is the centre of its disc (row MIDDLE).
    for axis in range(3):
        normal = plane[state.PLANE_NORMAL + axis]
        point = plane[state.PLANE_POINT + axis]
        history[state.NORMAL + axis * LANES + lane] = normal
        history[state.MIDDLE + axis * LANES + lane] = point
        offset += normal * point
    history[state.OFFSET + lane] = offset
    radius = plane[state.PLANE_RADIUS]
    history[state.SQUARED_RADIUS + lane] = radius * radius


@inlined
def add_loads_of_walls(walls, first_wall, contacts, base, n_contacts, scratch):
    """Add the forces of a tile of contacts to `walls.loads`, if the user requested it.

    The load of a wall is a row of `walls.loads`, six numbers: the force of all its
    contacts on it, and their torque about the origin of the world. The array is empty
    if nobody requested the loads. In the tile, body A is the body and B the wall, and
    the rows from TO_A and TO_B on hold the force and the torque on each.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    first_wall : int
        Index of the first wall of this kind among all walls.
    contacts : WallContacts
        The list of contacts with walls of one kind.
    base : int
        Index of the first contact of the tile.
    n_contacts : int
        Number of contacts in the list.
    scratch : array
        Scratch tile of the contacts (rows of `tile`) with the forces on the bodies.
    """
    # The user has not requested the loads.
    if walls.loads.shape[0] == 0:
        return
    for lane in range(min(LANES, n_contacts - base)):
        load = walls.loads[first_wall + contacts.wall[base + lane]]
        # The force on the wall is opposite to the force on the body.
        force_x, force_y, force_z = lane_vector(scratch, tile.TO_A, lane)
        fx, fy, fz = -force_x, -force_y, -force_z
        # The tile has no arm for a wall, so the torque on B is only the couple of a
        # rolling law. It is already the one that acts on the wall.
        torque_row = tile.TO_B + state.TORQUE * LANES
        couple_x, couple_y, couple_z = lane_vector(scratch, torque_row, lane)
        # The contact point is the body's centre plus the arm.
        body_x, body_y, body_z = lane_vector(scratch, tile.A, lane)
        arm_x, arm_y, arm_z = lane_vector(scratch, tile.RA, lane)
        x, y, z = body_x + arm_x, body_y + arm_y, body_z + arm_z
        # Add the force, then the torque: contact point x force, plus the couple.
        load[0] += fx
        load[1] += fy
        load[2] += fz
        load[3] += y * fz - z * fy + couple_x
        load[4] += z * fx - x * fz + couple_y
        load[5] += x * fy - y * fx + couple_z
