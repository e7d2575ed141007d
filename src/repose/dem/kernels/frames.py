"""Walls in any place and motion: their frames, the velocity of their surface, their load.

Reads `Walls.motion` and `Walls.moves`. `move_walls` writes the places of moving walls
(`Walls.planes`, `Walls.frames`), their pivots and `Walls.approach`;
`move_plane_contacts` writes the planes in the tiles of `WallContacts.data`; `load_walls`
adds to `Walls.loads`. A frame is a row of `Walls.frames` (12,): the origin, then the
rotation from the frame's axes to the world's, row by row.
"""

import math

from . import contact_geometry as cg
from . import state as st
from . import tile as tl
from .jit import inlined, kernel
from .rows import L, lane_vector, set_vector, vector_at
from .state import FRAME_ORIGIN, FRAME_ROTATION, PART, SHAPE, SPHERES

# Places of the rotation in a frame. XY is the x component of the frame's y axis.
XX, XY, XZ, YX, YY, YZ, ZX, ZY, ZZ = range(FRAME_ROTATION, FRAME_ROTATION + 9)


@inlined
def into_frame(frame, x, y, z):
    """Return a vector of the world in the axes of a frame."""
    return (
        frame[XX] * x + frame[YX] * y + frame[ZX] * z,
        frame[XY] * x + frame[YY] * y + frame[ZY] * z,
        frame[XZ] * x + frame[YZ] * y + frame[ZZ] * z,
    )


@inlined
def out_of_frame(frame, x, y, z):
    """Return a vector of a frame in world axes."""
    return (
        frame[XX] * x + frame[XY] * y + frame[XZ] * z,
        frame[YX] * x + frame[YY] * y + frame[YZ] * z,
        frame[ZX] * x + frame[ZY] * y + frame[ZZ] * z,
    )


@inlined
def place_in_frame(frame, x, y, z):
    """Return a place in the world as seen from a frame."""
    x0, y0, z0 = vector_at(frame, FRAME_ORIGIN)
    return into_frame(frame, x - x0, y - y0, z - z0)


@inlined
def rotate_to_world(frame, values, first):
    """Rotate three numbers of an array from a frame into world axes, in place."""
    x, y, z = vector_at(values, first)
    x, y, z = out_of_frame(frame, x, y, z)
    set_vector(values, first, x, y, z)


@inlined
def normal_to_world(walls, frame, geometry):
    """Rotate the normal of a contact geometry from a frame into world axes."""
    if walls.displaced[frame]:
        rotate_to_world(walls.frames[frame], geometry, cg.NORMAL)


@inlined
def contact_to_world(walls, frame, geometry):
    """Rotate normal and arm of a contact geometry from a frame into world axes.

    `frame` is the number of the wall's frame: curved walls first, then meshes.
    """
    if walls.displaced[frame]:
        rotate_to_world(walls.frames[frame], geometry, cg.NORMAL)
        rotate_to_world(walls.frames[frame], geometry, cg.ARM)


@inlined
def mesh_frame(walls, mesh):
    """Return the number of the frame of a mesh in `Walls.frames`."""
    return walls.cones.shape[0] + walls.rings.shape[0] + mesh


@kernel
def row_in_frame(row, parts, frame, local_row):
    """Write position and shape of a body, as seen from a frame, to `local_row`.

    Both are rows of `Bodies.rows`; the other columns of `local_row` keep their values.
    """
    x, y, z = vector_at(row, st.POSITION)
    x, y, z = place_in_frame(frame, x, y, z)
    set_vector(local_row, st.POSITION, x, y, z)
    if parts == SPHERES:
        local_row[st.SPHERE_RADIUS] = row[st.SPHERE_RADIUS]
    for part in range(parts):
        # The columns of the symmetric matrix S, each rotated into the frame: R' S.
        s = SHAPE + PART * part
        ax, ay, az = into_frame(frame, row[s], row[s + 1], row[s + 2])
        bx, by, bz = into_frame(frame, row[s + 1], row[s + 3], row[s + 4])
        cx, cy, cz = into_frame(frame, row[s + 2], row[s + 4], row[s + 5])
        # Then the rows of that: R' S R. Only the upper triangle is kept.
        xx, xy, xz = into_frame(frame, ax, bx, cx)
        _yx, yy, yz = into_frame(frame, ay, by, cy)
        _zx, _zy, zz = into_frame(frame, az, bz, cz)
        set_vector(local_row, s, xx, xy, xz)
        set_vector(local_row, s + 3, yy, yz, zz)


@inlined
def surface_velocity(motion, x, y, z):
    """Return the velocity of a moving wall at a place: v + omega x r.

    `motion` is a row of `Walls.motion`.
    """
    vx, vy, vz = vector_at(motion, st.WALL_VELOCITY)
    ox, oy, oz = vector_at(motion, st.WALL_SPIN)
    px, py, pz = vector_at(motion, st.WALL_PIVOT)
    rx, ry, rz = x - px, y - py, z - pz
    return (
        vx + oy * rz - oz * ry,
        vy + oz * rx - ox * rz,
        vz + ox * ry - oy * rx,
    )


@inlined
def rotated_about(angle, ux, uy, uz, x, y, z):
    """Return a vector rotated by an angle [rad] about a unit axis u (Rodrigues)."""
    cos = math.cos(angle)
    sin = math.sin(angle)
    along = (ux * x + uy * y + uz * z) * (1.0 - cos)
    return (
        x * cos + (uy * z - uz * y) * sin + ux * along,
        y * cos + (uz * x - ux * z) * sin + uy * along,
        z * cos + (ux * y - uy * x) * sin + uz * along,
    )


@kernel
def move_walls(walls, dt):
    """Move all moving walls by one time step [s].

    Writes the planes and frames of these walls, their pivots, and how far any wall may
    have come nearer.
    """
    planes = walls.planes
    n_planes = planes.shape[0]
    for wall in range(walls.moves.shape[0]):
        if walls.moves[wall] == 0:
            continue
        motion = walls.motion[wall]
        px, py, pz = vector_at(motion, st.WALL_PIVOT)
        ox, oy, oz = vector_at(motion, st.WALL_SPIN)
        rate = math.sqrt(ox**2 + oy**2 + oz**2)
        inverse = 1.0 / rate if rate > 0.0 else 0.0
        ux, uy, uz = ox * inverse, oy * inverse, oz * inverse
        angle = rate * dt
        # a plane is moved itself, another wall with its frame; both begin with a place
        place = planes[wall] if wall < n_planes else walls.frames[wall - n_planes]
        x, y, z = rotated_about(
            angle, ux, uy, uz, place[0] - px, place[1] - py, place[2] - pz
        )
        for axis in range(3):
            motion[st.WALL_PIVOT + axis] += dt * motion[st.WALL_VELOCITY + axis]
        place[0] = motion[st.WALL_PIVOT] + x
        place[1] = motion[st.WALL_PIVOT + 1] + y
        place[2] = motion[st.WALL_PIVOT + 2] + z
        if wall < n_planes:
            nx, ny, nz = vector_at(place, st.PLANE_NORMAL)
            nx, ny, nz = rotated_about(angle, ux, uy, uz, nx, ny, nz)
            set_vector(place, st.PLANE_NORMAL, nx, ny, nz)
        else:
            # the columns of the rotation are the axes of the frame
            for axis in range(3):
                column = FRAME_ROTATION + axis
                x, y, z = rotated_about(
                    angle,
                    ux,
                    uy,
                    uz,
                    place[column],
                    place[column + 3],
                    place[column + 6],
                )
                place[column] = x
                place[column + 3] = y
                place[column + 6] = z
    walls.approach[st.WALL_PATH] += dt * walls.approach[st.WALL_SPEED]


@kernel
def move_plane_contacts(flat, walls, n):
    """Write the present place of moving planes to the first n contacts with planes."""
    for k in range(n):
        wall = flat.wall[k]
        if walls.moves[wall]:
            write_plane(flat.data[k // L], k % L, walls.planes[wall])


@inlined
def write_plane(tile, lane, plane):
    """Write normal, offset, middle and squared radius of a plane to a contact's lane."""
    offset = 0.0
    for axis in range(3):
        normal = plane[st.PLANE_NORMAL + axis]
        point = plane[st.PLANE_POINT + axis]
        tile[st.NORMAL + axis * L + lane] = normal
        tile[st.MIDDLE + axis * L + lane] = point
        offset += normal * point
    tile[st.OFFSET + lane] = offset
    radius = plane[st.PLANE_RADIUS]
    tile[st.RADIUS2 + lane] = radius * radius


@inlined
def load_walls(walls, first_wall, contacts, base, n, t):
    """Add the loads of a tile of contacts to their walls, if the user asked for them.

    Parameters
    ----------
    first_wall : int
        Number of the first wall of this kind.
    contacts : WallContacts
        Contacts with walls of one kind; the tile begins with contact `base`.
    n : int
        Number of contacts in the list.
    t : array
        Scratch tile with the forces on the bodies.
    """
    if walls.loads.shape[0] == 0:
        return
    for lane in range(min(L, n - base)):
        load = walls.loads[first_wall + contacts.wall[base + lane]]
        force_x, force_y, force_z = lane_vector(t, tl.TO_A, lane)
        fx, fy, fz = -force_x, -force_y, -force_z
        # The torque on B is only the couple of a law of rolling: a wall has no arm.
        couple_x, couple_y, couple_z = lane_vector(t, tl.TO_B + st.TORQUE * L, lane)
        x = t[tl.A + lane] + t[tl.RA + lane]
        y = t[tl.A + L + lane] + t[tl.RA + L + lane]
        z = t[tl.A + 2 * L + lane] + t[tl.RA + 2 * L + lane]
        load[0] += fx
        load[1] += fy
        load[2] += fz
        load[3] += y * fz - z * fy + couple_x
        load[4] += z * fx - x * fz + couple_y
        load[5] += x * fy - y * fx + couple_z
