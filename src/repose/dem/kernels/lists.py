"""Lists of contacts whose data lie in tiles: begin a contact, or move it in the list.

`data` is an array (tiles, rows * LANES), see `state.Pairs` and `state.WallContacts`.
Contact k of a list is lane k % LANES of tile k // LANES. The functions write `data` in
place.
"""

from . import state as st
from .jit import inlined
from .rows import LANES, write_vector


@inlined
def put_contact(data, k, nx, ny, nz):
    """Begin contact k with a normal (nx, ny, nz); set its other rows to zero."""
    tile = data[k // LANES]
    lane = k % LANES
    write_vector(tile, st.NORMAL, lane, nx, ny, nz)
    for row in range(st.PAIR_STATE, data.shape[1], LANES):
        tile[row + lane] = 0.0


@inlined
def move_contact(data, source, target):
    """Copy the numbers of contact `source` over those of contact `target`."""
    source_tile = data[source // LANES]
    target_tile = data[target // LANES]
    source_lane = source % LANES
    target_lane = target % LANES
    for row in range(0, data.shape[1], LANES):
        target_tile[row + target_lane] = source_tile[row + source_lane]
