"""Tiles: arrays that hold each quantity of 32 contacts or bodies side by side.

A tile is a flat array of doubles that consists of rows of LANES numbers. A row is one
quantity, and a lane is one contact or one body:

    tile[row + lane]               a scalar of a lane; `row` is a multiple of LANES
    tile[row + c * LANES + lane]   component c of a vector or matrix of a lane

The name of a row is the index of its first number, so `GAP` stands for the numbers
tile[GAP : GAP + LANES]. `Rows` assigns these indices to the quantities of a tile. The
functions below read and write the vectors and matrices of one lane. A loop over all
lanes becomes vector code, which handles eight lanes (or four) at once.
"""

from .jit import inlined

LANES = 32


class Rows:
    """Assign the rows of a tile to quantities, one after another.

    Parameters
    ----------
    first : int
        Index of the first free number.
    """

    def __init__(self, first: int = 0) -> None:
        self.first = first
        self.end = first

    def take(self, count: int = 1) -> int:
        """Reserve the next `count` rows, and return the index of their first number."""
        first = self.end
        self.end += count * LANES
        return first

    def take_each(self, count: int) -> list[int]:
        """Reserve the next `count` rows, and return the index of each first number."""
        return [self.take() for _ in range(count)]

    @property
    def count(self) -> int:
        """Number of reserved rows."""
        return (self.end - self.first) // LANES


@inlined
def vector_at(values, first):
    """Return three neighbouring numbers of an array as a vector (x, y, z).

    Parameters
    ----------
    values : array
        A flat array.
    first : int
        Index of x; y and z follow.
    """
    return values[first], values[first + 1], values[first + 2]


@inlined
def set_vector(values, first, x, y, z):
    """Write a vector (x, y, z) to three neighbouring elements of an array.

    Parameters
    ----------
    values : array
        A flat array; its three elements are overwritten.
    first : int
        Index of x; y and z follow.
    x, y, z : float
        The vector.
    """
    values[first] = x
    values[first + 1] = y
    values[first + 2] = z


@inlined
def lane_vector(tile, row, lane):
    """Return the vector (x, y, z) of one lane of a tile.

    Parameters
    ----------
    tile : array (rows * LANES,)
        The tile, with one quantity in each row of LANES numbers.
    row : int
        Index of the first number of the row of x; the rows of y and z follow.
    lane : int
        The lane, 0 to LANES - 1.
    """
    return tile[row + lane], tile[row + LANES + lane], tile[row + 2 * LANES + lane]


@inlined
def write_vector(tile, row, lane, x, y, z):
    """Write the vector (x, y, z) of one lane of a tile.

    Parameters
    ----------
    tile : array (rows * LANES,)
        The tile, with one quantity in each row of LANES numbers. The vector is
        overwritten.
    row : int
        Index of the first number of the row of x; the rows of y and z follow.
    lane : int
        The lane, 0 to LANES - 1.
    x, y, z : float
        The vector.
    """
    tile[row + lane] = x
    tile[row + LANES + lane] = y
    tile[row + 2 * LANES + lane] = z


@inlined
def add_vector(tile, row, lane, x, y, z):
    """Add (x, y, z) to the vector of one lane of a tile, in place.

    The arguments are those of `write_vector`.
    """
    tile[row + lane] += x
    tile[row + LANES + lane] += y
    tile[row + 2 * LANES + lane] += z


@inlined
def lane_matrix(tile, row, lane):
    """Return the symmetric matrix (xx, xy, xz, yy, yz, zz) of one lane of a tile.

    Its six numbers lie in six consecutive rows. `row` is the index of the first number
    of the row of xx.
    """
    return (
        tile[row + lane],
        tile[row + LANES + lane],
        tile[row + 2 * LANES + lane],
        tile[row + 3 * LANES + lane],
        tile[row + 4 * LANES + lane],
        tile[row + 5 * LANES + lane],
    )


@inlined
def write_matrix(tile, row, lane, xx, xy, xz, yy, yz, zz):
    """Write the symmetric matrix of one lane of a tile.

    Its six numbers are written to six consecutive rows. `row` is the index of the first
    number of the row of xx.
    """
    write_vector(tile, row, lane, xx, xy, xz)
    write_vector(tile, row + 3 * LANES, lane, yy, yz, zz)
