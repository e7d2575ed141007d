"""Clumps against walls: contacts of single spheres, in closed form except with meshes.

A sphere touches a plane, the inside of a cone or a ring edge in one place at most, so one bit stores whether it does,
and no contact is tracked from step to step. The limits are those of `walls`, one for each wall and body: the shortest
path to a contact of any of its spheres that do not touch.
"""

import math

import numpy as np

from . import clump_tile as ct
from . import state as st
from .clumps import clear_bit, is_set, set_bit
from .features import FACE
from .frames import contact_to_world, into_frame, rotate_to_world, write_plane
from .jit import inlined, kernel
from .meshes import deepest_near, hand_over, search_mesh, track
from .rows import L, write_vector
from .sphere_search import PLACES_A, place_spheres
from .state import MOST_SPHERES, SHAPE
from .wall_contact import fill_contact
from .walls import add_wall_contact, sphere_beyond


@inlined
def sphere_arm(row, tile, lane):
    """Vector from the centre of the body to that of its sphere, in world axes."""
    return ct.rotated_vector(
        row[SHAPE],
        row[SHAPE + 1],
        row[SHAPE + 2],
        row[SHAPE + 3],
        tile[ct.CENTRE + lane],
        tile[ct.CENTRE + L + lane],
        tile[ct.CENTRE + 2 * L + lane],
    )


@inlined
def sphere_on_plane(x, y, z, radius, plane, out):
    """Contact of a sphere with a plane: fills `out`; returns how far its centre is beyond the disc's edge [m]."""
    nx, ny, nz = plane[3], plane[4], plane[5]
    dx, dy, dz = plane[0] - x, plane[1] - y, plane[2] - z
    along = nx * dx + ny * dy + nz * dz
    fill_contact(out, nx, ny, nz, along - radius, radius, radius)
    return math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0)) - plane[6]


@inlined
def seen_place(walls, wall, x, y, z):
    """Return a place in the frame of a curved wall or mesh."""
    if walls.displaced[wall]:
        frame = walls.frames[wall]
        return into_frame(frame, x - frame[0], y - frame[1], z - frame[2])
    return x, y, z


@inlined
def sphere_on_curved(walls, wall, x, y, z, radius, out):
    """Contact of a sphere with a cone or ring: fills `out` in world axes; returns its distance beyond the end [m]."""
    x, y, z = seen_place(walls, wall, x, y, z)
    beyond = sphere_beyond(x, y, z, radius, walls, wall, out)
    contact_to_world(walls, wall, out)
    return beyond


@inlined
def write_sphere(contacts, clumps, k, i, sphere):
    """Give contact k the sphere of a body."""
    tile, lane = contacts.data[k // L], k % L
    spheres, scale = clumps.spheres[clumps.shape[i]], clumps.scale[i]
    for c in range(3):
        tile[ct.CENTRE + c * L + lane] = scale * spheres[c, sphere]
    tile[ct.RADIUS + lane] = scale * spheres[3, sphere]


@inlined
def add_sphere(contacts, counts, slot, clumps, i, wall, sphere, out):
    """Append the contact of a sphere with a plane, cone or ring; returns its number, or -1 where there is no room."""
    k = add_wall_contact(contacts, counts, slot, i, wall, out)
    if k >= 0:
        contacts.feature[k] = sphere
        write_sphere(contacts, clumps, k, i, sphere)
        set_bit(contacts.known[wall, i : i + 1], sphere)
    return k


@inlined
def forget_sphere(contacts, clumps, counts, slot, k):
    """Note that the sphere of contact k, which is removed next, does not touch the wall."""
    if slot == st.N_MESHED:
        clumps.mesh_sphere[k] = clumps.mesh_sphere[counts[slot] - 1]
    else:
        bit = np.uint64(1) << np.uint64(contacts.feature[k])
        contacts.known[contacts.wall[k], contacts.body[k]] &= ~bit


@inlined
def free_way(gap, beyond, radius, past, sphere, leans):
    """How far a sphere may move before it can touch a wall, by its gap and its way beyond the end; 0.0: it touches.

    A sphere that overlaps the surface beyond the wall's end, or with its centre behind it, is past the wall (a bit of
    `past`, one word) until it is clear of the surface, unless its body leans on another wall.
    """
    if gap > 0.0:
        clear_bit(past, sphere)
        return gap
    outside = max(beyond, -gap - radius)
    if outside > 0.0 and not leans:
        set_bit(past, sphere)
    return -gap if is_set(past, sphere) else max(outside, 0.0)


@inlined
def touching(known, i):
    """Return the spheres of body i that touch any wall of this kind, as bits."""
    word = np.uint64(0)
    for wall in range(known.shape[0]):
        word |= known[wall, i]
    return word


@inlined
def sphere_slid_off(bodies, contacts, walls, k):
    """Note that contact k of a sphere slid over the end of a cone or ring: the next wall takes it over."""
    i = contacts.body[k]
    for wall in range(contacts.limit.shape[0]):
        past = contacts.past[wall, i : i + 1]
        if is_set(past, contacts.feature[k]):
            clear_bit(past, contacts.feature[k])
            contacts.limit[wall, i] = (
                bodies.displacement[i] + walls.approach[st.WALL_PATH]
            )


@kernel
def spheres_at_wall(bodies, contacts, slot, clumps, walls, counts, wall, i, s, out):
    """Find the spheres of body i that begin to touch a plane, cone or ring, by the slot of its contacts in `counts`.

    Returns how far the body may move before the next search.
    """
    nearest = math.inf
    held = touching(contacts.known, i) if slot == st.N_CURVED else np.uint64(0)
    for k in range(clumps.sizes[clumps.shape[i]]):
        if is_set(contacts.known[wall, i : i + 1], k):
            continue
        x, y, z = (
            s[PLACES_A + k],
            s[PLACES_A + MOST_SPHERES + k],
            s[PLACES_A + 2 * MOST_SPHERES + k],
        )
        radius = s[PLACES_A + 3 * MOST_SPHERES + k]
        if slot == st.N_CURVED:
            beyond = sphere_on_curved(walls, wall, x, y, z, radius, out)
        else:
            beyond = sphere_on_plane(x, y, z, radius, walls.planes[wall], out)
        past = contacts.past[wall, i : i + 1]
        if (held >> np.uint64(k)) & np.uint64(1) != np.uint64(0):
            clear_bit(past, k)  # the wall that the sphere touches hands it over
        free = free_way(out[3], beyond, radius, past, k, held != np.uint64(0))
        if free > 0.0:
            nearest = min(nearest, free)
            continue
        m = add_sphere(contacts, counts, slot, clumps, i, wall, k, out)
        if slot == st.N_PLANE and m >= 0:
            write_plane(contacts.data[m // L], m % L, walls.planes[wall])
    return nearest


@inlined
def place_clump(bodies, clumps, i, s):
    """Write the spheres of body i, in the world, to rows of the scratch."""
    shape = clumps.shape[i]
    place_spheres(
        bodies.rows[i],
        clumps.spheres[shape],
        clumps.sizes[shape],
        clumps.scale[i],
        0.0,
        0.0,
        0.0,
        s,
        PLACES_A,
    )


@inlined
def sphere_row(walls, frame, x, y, z, radius, local):
    """Write the row of a sphere in a frame, in the form that `meshes` takes."""
    if walls.displaced[frame]:
        home = walls.frames[frame]
        x, y, z = into_frame(home, x - home[0], y - home[1], z - home[2])
    local[0], local[1], local[2] = x, y, z
    square = radius * radius
    for c in range(st.PART):
        local[SHAPE + c] = 0.0
    local[SHAPE] = local[SHAPE + 3] = local[SHAPE + 5] = square


@inlined
def by_sphere(meshed, clumps):
    """Return the contacts with meshes, with the numbers of spheres instead of those of bodies."""
    m = meshed
    return st.WallContacts(
        clumps.mesh_sphere,
        m.wall,
        m.feature,
        m.data,
        m.limit,
        m.ended,
        m.deepest,
        m.known,
        m.past,
    )


@inlined
def follow_sphere(bodies, walls, meshes, meshed, clumps, n, k, end, out, other, local):
    """Track contact k of a sphere with a mesh through one step, as `meshes.follow_mesh`."""
    touches = by_sphere(meshed, clumps)
    mesh = meshed.wall[k]
    frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
    tile, lane = meshed.data[k // L], k % L
    row = bodies.rows[meshed.body[k]]
    x, y, z = sphere_arm(row, tile, lane)
    radius = tile[ct.RADIUS + lane]
    sphere_row(walls, frame, row[0] + x, row[1] + y, row[2] + z, radius, local)
    at = st.NORMAL + lane
    nx, ny, nz = tile[at], tile[at + L], tile[at + 2 * L]
    if walls.displaced[frame]:
        nx, ny, nz = into_frame(walls.frames[frame], nx, ny, nz)
    touching = (
        track(local, 1, meshes, tile, lane, meshed.feature[k], nx, ny, nz, out) >= 0.0
    )
    if not touching:
        touching = hand_over(local, 1, meshes, touches, n, k, radius, end, out, other)
    if touching and out[3] < 0.0 and meshes.kind[meshed.feature[k]] == FACE:
        deepest_near(local, 1, meshes, touches, k, out, other)
    if walls.displaced[frame]:
        rotate_to_world(walls.frames[frame], out, 0)
        rotate_to_world(walls.frames[frame], out, 5)
    # from the body's centre, not the sphere's
    out[5] += x
    out[6] += y
    out[7] += z
    return touching and out[3] <= end


@inlined
def spheres_at_mesh(
    bodies, meshed, clumps, walls, meshes, counts, mesh, i, s, out, other, local
):
    """Find the spheres of body i that begin to touch a mesh; returns how far it may move before the next search."""
    n = counts[st.N_MESHED]
    touches = by_sphere(meshed, clumps)
    for k in range(n):
        if meshed.body[k] == i and meshed.wall[k] == mesh:
            follow_sphere(
                bodies, walls, meshes, meshed, clumps, n, k, 0.0, out, other, local
            )
            write_vector(meshed.data[k // L], st.NORMAL, k % L, out[0], out[1], out[2])
    place_clump(bodies, clumps, i, s)
    frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
    nearest = math.inf
    for sphere in range(clumps.sizes[clumps.shape[i]]):
        at = PLACES_A + sphere
        radius = s[at + 3 * MOST_SPHERES]
        sphere_row(
            walls,
            frame,
            s[at],
            s[at + MOST_SPHERES],
            s[at + 2 * MOST_SPHERES],
            radius,
            local,
        )
        before = counts[st.N_MESHED]
        number = MOST_SPHERES * i + sphere
        nearest = min(
            nearest,
            search_mesh(
                local, touches, counts, 1, walls, meshes, mesh, number, radius, out
            ),
        )
        for k in range(before, counts[st.N_MESHED]):
            meshed.body[k] = i
            write_sphere(meshed, clumps, k, i, sphere)
    return nearest
