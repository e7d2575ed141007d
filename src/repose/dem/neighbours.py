"""Which pairs touch: cells, dormant pairs and odometers.

Every body keeps an odometer, a bound of how far any of its points has moved. A pair that does not touch lies dormant
with a limit: gap at the last look plus both odometers at that time. While the sum of the odometers stays below it the
pair cannot touch and is not looked at. The list holds every pair whose reference positions (where a body was last put
into its cell) are closer than two bounding radii and a skin; a body that has moved by half a skin is put in its cell
anew, alone.
"""

import math

from . import state as st
from .contact import solve_gap
from .jit import inlined, kernel
from .lists import put_contact

# A proven gap above this share of the skin is good enough; below it the true gap is found.
EARLY = 0.25
TOLERANCE = 1e-4


@inlined
def cell_of(grid, x, y, z):
    """Index of the cell of a point; points outside the box belong to its nearest cell."""
    edge = grid.lengths[0]
    i = math.floor((x - grid.origin[0]) / edge)
    j = math.floor((y - grid.origin[1]) / edge)
    k = math.floor((z - grid.origin[2]) / edge)
    i = min(max(i, 0), grid.shape[0] - 1)
    j = min(max(j, 0), grid.shape[1] - 1)
    k = min(max(k, 0), grid.shape[2] - 1)
    return (i * grid.shape[1] + j) * grid.shape[2] + k


@kernel
def unlink(grid, i):
    """Take body i out of its cell."""
    cell = grid.cell[i]
    if cell < 0:
        return
    before = grid.preceding[i]
    after = grid.following[i]
    if before >= 0:
        grid.following[before] = after
    else:
        grid.head[cell] = after
    if after >= 0:
        grid.preceding[after] = before
    grid.cell[i] = -1


@kernel
def link(grid, i, x, y, z):
    """Put body i into the cell of its present position, which becomes its reference."""
    cell = cell_of(grid, x, y, z)
    grid.reference[i, 0] = x
    grid.reference[i, 1] = y
    grid.reference[i, 2] = z
    grid.cell[i] = cell
    grid.preceding[i] = -1
    grid.following[i] = grid.head[cell]
    if grid.head[cell] >= 0:
        grid.preceding[grid.head[cell]] = i
    grid.head[cell] = i


@inlined
def mark_moved(grid, counts, i):
    """Ask for new neighbours of body i at the next step."""
    if grid.moved[i] == 0:
        grid.moved[i] = 1
        grid.moved_list[counts[st.N_MOVED]] = i
        counts[st.N_MOVED] += 1


@inlined
def drop_dormant(pairs, counts, k):
    """Remove dormant pair k; the last one takes its place."""
    last = counts[st.N_DORMANT] - 1
    counts[st.N_DORMANT] = last
    pairs.dormant_first[k] = pairs.dormant_first[last]
    pairs.dormant_second[k] = pairs.dormant_second[last]
    pairs.dormant_limit[k] = pairs.dormant_limit[last]
    for c in range(3):
        pairs.dormant_normal[k, c] = pairs.dormant_normal[last, c]


@inlined
def add_dormant(pairs, counts, i, j, limit, nx, ny, nz):
    """Append a dormant pair."""
    k = counts[st.N_DORMANT]
    if k >= pairs.dormant_limit.shape[0]:
        counts[st.FULL] = 1
        return
    counts[st.N_DORMANT] = k + 1
    pairs.dormant_first[k] = i
    pairs.dormant_second[k] = j
    pairs.dormant_limit[k] = limit
    pairs.dormant_normal[k, 0] = nx
    pairs.dormant_normal[k, 1] = ny
    pairs.dormant_normal[k, 2] = nz


@inlined
def add_contact(pairs, counts, i, j, normal):
    """Append a touching pair with a relaxed spring."""
    k = counts[st.N_PAIRS]
    if k >= pairs.first.shape[0]:
        counts[st.FULL] = 1
        return
    counts[st.N_PAIRS] = k + 1
    pairs.first[k] = i
    pairs.second[k] = j
    put_contact(pairs.data, k, normal[0], normal[1], normal[2], 0.0)


@kernel
def wake(bodies, pairs, counts, grid, squares, normal):
    """Look at the dormant pairs whose odometers have used up their gap; drop those of bodies that changed cells."""
    odometer = bodies.odometer
    moved = grid.moved
    early = EARLY * grid.lengths[2]
    k = 0
    while k < counts[st.N_DORMANT]:
        i = pairs.dormant_first[k]
        j = pairs.dormant_second[k]
        if moved[i] | moved[j]:
            drop_dormant(pairs, counts, k)
            continue
        total = odometer[i] + odometer[j]
        if total >= pairs.dormant_limit[k]:
            for c in range(3):
                normal[c] = pairs.dormant_normal[k, c]
            gap = solve_gap(squares, bodies.rows, i, j, normal, TOLERANCE, early)
            if gap <= 0.0:
                drop_dormant(pairs, counts, k)
                add_contact(pairs, counts, i, j, normal)
                continue
            pairs.dormant_limit[k] = total + gap
            for c in range(3):
                pairs.dormant_normal[k, c] = normal[c]
        k += 1


@kernel
def find_partners(bodies, pairs, counts, grid, squares, i, normal):
    """List body i's pairs anew: dormant with the gap found, or touching. Partners with today's mark touch already."""
    rows = bodies.rows
    diameter = grid.lengths[1]
    reach2 = (diameter + grid.lengths[2]) ** 2
    early = EARLY * grid.lengths[2]
    cell = grid.cell[i]
    kz = cell % grid.shape[2]
    ky = (cell // grid.shape[2]) % grid.shape[1]
    kx = cell // (grid.shape[2] * grid.shape[1])
    for cx in range(max(kx - 1, 0), min(kx + 2, grid.shape[0])):
        for cy in range(max(ky - 1, 0), min(ky + 2, grid.shape[1])):
            for cz in range(max(kz - 1, 0), min(kz + 2, grid.shape[2])):
                j = grid.head[(cx * grid.shape[1] + cy) * grid.shape[2] + cz]
                while j >= 0:
                    # two bodies that both moved find each other once
                    if j != i and grid.mark[j] != counts[st.STAMP] and not (grid.moved[j] == 1 and j < i):
                        rx = grid.reference[j, 0] - grid.reference[i, 0]
                        ry = grid.reference[j, 1] - grid.reference[i, 1]
                        rz = grid.reference[j, 2] - grid.reference[i, 2]
                        if rx * rx + ry * ry + rz * rz < reach2:
                            a = min(i, j)
                            b = max(i, j)
                            dx = rows[b, 0] - rows[a, 0]
                            dy = rows[b, 1] - rows[a, 1]
                            dz = rows[b, 2] - rows[a, 2]
                            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
                            normal[0] = dx / distance
                            normal[1] = dy / distance
                            normal[2] = dz / distance
                            gap = distance - diameter
                            if gap <= 0.0:
                                gap = solve_gap(squares, rows, a, b, normal, TOLERANCE, early)
                            if gap <= 0.0:
                                add_contact(pairs, counts, a, b, normal)
                            else:
                                total = bodies.odometer[a] + bodies.odometer[b]
                                add_dormant(pairs, counts, a, b, total + gap, normal[0], normal[1], normal[2])
                    j = grid.following[j]


@kernel
def update_pairs(bodies, pairs, counts, grid, squares, normal):
    """Bring the lists of touching and dormant pairs up to the present positions."""
    wake(bodies, pairs, counts, grid, squares, normal)
    n_moved = counts[st.N_MOVED]
    if n_moved == 0:
        return
    for m in range(n_moved):
        i = grid.moved_list[m]
        unlink(grid, i)
        if bodies.presence[i] == st.PRESENT:
            link(grid, i, bodies.rows[i, 0], bodies.rows[i, 1], bodies.rows[i, 2])
    n_touching = counts[st.N_PAIRS]
    for m in range(n_moved):
        i = grid.moved_list[m]
        if bodies.presence[i] == st.PRESENT:
            counts[st.STAMP] += 1
            for k in range(n_touching):
                if pairs.first[k] == i:
                    grid.mark[pairs.second[k]] = counts[st.STAMP]
                elif pairs.second[k] == i:
                    grid.mark[pairs.first[k]] = counts[st.STAMP]
            find_partners(bodies, pairs, counts, grid, squares, i, normal)
    for m in range(n_moved):
        grid.moved[grid.moved_list[m]] = 0
    counts[st.N_MOVED] = 0
