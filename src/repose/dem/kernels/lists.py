"""Lists of contacts whose data lie in tiles: begin a contact, or move it in the list.

`data` is an array (tiles, rows * LANES), see `state.Pairs` and `state.WallContacts`.
Contact k of a list is lane k % LANES of tile k // LANES. The functions write `data` in
place.
"""

from . import state
from .jit import inlined
from .rows import LANES, write_vector


@inlined
def put_contact(data, k, nx, ny, nz):
    """Begin contact k of a list with a normal; set its other rows to zero.

    Zeros mean a relaxed spring, for any force law.

    Parameters
    ----------
    data : array (tiles, rows * LANES)
        What the contacts of the list keep; contact k is lane k % LANES of tile k //
        LANES.
    k : int
        Index of the contact in its list.
    nx, ny, nz : float
        Unit normal of the contact.
    """
    tile = data[k // LANES]
    lane = k % LANES
    write_vector(tile, state.NORMAL, lane, nx, ny, nz)
    for row in range(state.PAIR_STATE, data.shape[1], LANES):
        tile[row + lane] = 0.0


@inlined
def move_contact(data, source, target):
    """Copy all that contact `source` of a list keeps over contact `target`.

    Parameters
    ----------
    data : array (tiles, rows * LANES)
        What the contacts of the list keep; contact k is lane k % LANES of tile k //
        LANES.
    source, target : int
        Numbers of the two contacts.
    """
    source_tile = data[source // LANES]
    target_tile = data[target // LANES]
    source_lane = source % LANES
    target_lane = target % LANES
    for row in range(0, data.shape[1], LANES):
        target_tile[row + target_lane] = source_tile[row + source_lane]
