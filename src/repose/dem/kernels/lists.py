"""Begin contacts in a list whose data are stored in tiles, and move them within it.

`data` is an array (tiles, rows * LANES), see `state.Pairs` and `state.WallContacts`.
Contact k of a list is lane k % LANES of tile k // LANES. The functions change `data` in
place.
"""

from . import state
from .jit import inlined
from .rows import LANES, write_vector


@inlined
def put_contact(data, k, nx, ny, nz):
    """Begin contact k of a list: write its normal, and set its other rows to zero.

    In every force law, zeros mean a relaxed spring.

    Parameters
    ----------
    data : array (tiles, rows * LANES)
        Tiles of the numbers that the contacts keep. Contact k is lane k % LANES of tile
        k // LANES. The array is changed in place.
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
    """Overwrite contact `target` of a list with all data of contact `source`.

    Parameters
    ----------
    data : array (tiles, rows * LANES)
        Tiles of the numbers that the contacts keep. Contact k is lane k % LANES of tile
        k // LANES. The array is changed in place.
    source, target : int
        Indices of the two contacts in the list.
    """
    source_tile = data[source // LANES]
    target_tile = data[target // LANES]
    source_lane = source % LANES
    target_lane = target % LANES
    for row in range(0, data.shape[1], LANES):
        target_tile[row + target_lane] = source_tile[row + source_lane]
