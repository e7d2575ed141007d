"""Walls in any place and motion: their frames, the velocity of their surface, and the load on them."""

import math

from . import state as st
from . import tile as tl
from .jit import inlined, kernel
from .rows import L
from .state import PART, POSITION, SHAPE, SPHERE_RADIUS, SPHERES


@inlined
def into_frame(frame, x, y, z):
    """Return a world vector in the axes of a frame (12,)."""
    return (
        frame[3] * x + frame[6] * y + frame[9] * z,
        frame[4] * x + frame[7] * y + frame[10] * z,
        frame[5] * x + frame[8] * y + frame[11] * z,
    )


@inlined
def out_of_frame(frame, x, y, z):
    """Return a vector of a frame (12,) in world axes."""
    return (
        frame[3] * x + frame[4] * y + frame[5] * z,
        frame[6] * x + frame[7] * y + frame[8] * z,
        frame[9] * x + frame[10] * y + frame[11] * z,
    )


@inlined
def rotate_to_world(frame, values, at):
    """Rotate three numbers of an array from a frame into the world, in place."""
    values[at], values[at + 1], values[at + 2] = out_of_frame(
        frame, values[at], values[at + 1], values[at + 2]
    )


@inlined
def contact_to_world(walls, wall, out):
    """Rotate normal and contact point of a contact from the frame of a curved wall or mesh into the world."""
    if walls.displaced[wall]:
        rotate_to_world(walls.frames[wall], out, 0)
        rotate_to_world(walls.frames[wall], out, 5)


@kernel
def row_in_frame(row, parts, frame, local):
    """Position and shape of a body as seen from a frame, written to `local` (a row)."""
    x, y, z = into_frame(frame, row[0] - frame[0], row[1] - frame[1], row[2] - frame[2])
    local[POSITION], local[POSITION + 1], local[POSITION + 2] = x, y, z
    if parts == SPHERES:
        local[SPHERE_RADIUS] = row[SPHERE_RADIUS]
    for part in range(parts):
        s = SHAPE + PART * part
        # the columns of S, each into the frame; then the rows
        ax, ay, az = into_frame(frame, row[s], row[s + 1], row[s + 2])
        bx, by, bz = into_frame(frame, row[s + 1], row[s + 3], row[s + 4])
        cx, cy, cz = into_frame(frame, row[s + 2], row[s + 4], row[s + 5])
        local[s], local[s + 1], local[s + 2] = into_frame(frame, ax, bx, cx)
        _xy, local[s + 3], local[s + 4] = into_frame(frame, ay, by, cy)
        _xz, _yz, local[s + 5] = into_frame(frame, az, bz, cz)


@inlined
def surface_velocity(motion, x, y, z):
    """Velocity of a moving wall (9,) at a place."""
    rx, ry, rz = x - motion[6], y - motion[7], z - motion[8]
    return (
        motion[0] + motion[4] * rz - motion[5] * ry,
        motion[1] + motion[5] * rx - motion[3] * rz,
        motion[2] + motion[3] * ry - motion[4] * rx,
    )


@inlined
def rotated_about(angle, ux, uy, uz, x, y, z):
    """Return a vector rotated by an angle about a unit axis (Rodrigues)."""
    cos, sin = math.cos(angle), math.sin(angle)
    along = (ux * x + uy * y + uz * z) * (1.0 - cos)
    return (
        x * cos + (uy * z - uz * y) * sin + ux * along,
        y * cos + (uz * x - ux * z) * sin + uy * along,
        z * cos + (ux * y - uy * x) * sin + uz * along,
    )


@kernel
def move_walls(walls, dt):
    """Move all moving walls by one time step."""
    planes = walls.planes
    n_planes = planes.shape[0]
    for w in range(walls.moves.shape[0]):
        if walls.moves[w] == 0:
            continue
        motion = walls.motion[w]
        px, py, pz = motion[6], motion[7], motion[8]
        rate = math.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
        inv = 1.0 / rate if rate > 0.0 else 0.0
        ux, uy, uz = motion[3] * inv, motion[4] * inv, motion[5] * inv
        angle = rate * dt
        place = planes[w] if w < n_planes else walls.frames[w - n_planes]
        x, y, z = rotated_about(
            angle, ux, uy, uz, place[0] - px, place[1] - py, place[2] - pz
        )
        for c in range(3):
            motion[6 + c] += dt * motion[c]
        place[0], place[1], place[2] = motion[6] + x, motion[7] + y, motion[8] + z
        if w < n_planes:
            place[3], place[4], place[5] = rotated_about(
                angle, ux, uy, uz, place[3], place[4], place[5]
            )
        else:
            for c in range(3):
                x, y, z = rotated_about(
                    angle, ux, uy, uz, place[3 + c], place[6 + c], place[9 + c]
                )
                place[3 + c], place[6 + c], place[9 + c] = x, y, z
    walls.approach[st.WALL_PATH] += dt * walls.approach[st.WALL_SPEED]


@kernel
def move_plane_contacts(flat, walls, n):
    """Move the contacts with moving planes to the present places of the planes."""
    for k in range(n):
        wall = flat.wall[k]
        if walls.moves[wall]:
            write_plane(flat.data[k // st.LANES], k % st.LANES, walls.planes[wall])


@inlined
def write_plane(tile, lane, plane):
    """Write a plane into a lane of contacts: normal, offset, middle, squared radius."""
    offset = 0.0
    for c in range(3):
        tile[st.NORMAL + c * st.LANES + lane] = plane[3 + c]
        tile[st.MIDDLE + c * st.LANES + lane] = plane[c]
        offset += plane[3 + c] * plane[c]
    tile[st.OFFSET + lane] = offset
    tile[st.RADIUS2 + lane] = plane[6] * plane[6]


@inlined
def load_walls(walls, first_wall, contacts, base, n, t):
    """Add the forces of a tile of contacts, and their torques about the origin, to the loads of the walls, if asked.

    The arm of a wall is zero, so the torque on B is only the couple of a law of rolling.
    """
    if walls.loads.shape[0] == 0:
        return
    for lane in range(min(L, n - base)):
        load = walls.loads[first_wall + contacts.wall[base + lane]]
        fx, fy, fz = (
            -t[tl.TO_A + lane],
            -t[tl.TO_A + L + lane],
            -t[tl.TO_A + 2 * L + lane],
        )
        x = t[tl.A + lane] + t[tl.RA + lane]
        y = t[tl.A + L + lane] + t[tl.RA + L + lane]
        z = t[tl.A + 2 * L + lane] + t[tl.RA + 2 * L + lane]
        load[0], load[1], load[2] = load[0] + fx, load[1] + fy, load[2] + fz
        load[3] += y * fz - z * fy + t[tl.TO_B + 3 * L + lane]
        load[4] += z * fx - x * fz + t[tl.TO_B + 4 * L + lane]
        load[5] += x * fy - y * fx + t[tl.TO_B + 5 * L + lane]
