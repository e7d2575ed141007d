"""Tiles: arrays in which the values of a quantity of 32 contacts or bodies are neighbours.

A tile is a flat array of doubles. It consists of rows of LANES numbers. A row is one
quantity, a lane is one contact or one body:

    tile[row + lane]                     a scalar of a lane; `row` is a multiple of LANES
    tile[row + c * LANES + lane]         component c of a vector or matrix of a lane

A row is named by the place of its first number, so `GAP` stands for the numbers
tile[GAP : GAP + LANES]. `Rows` gives these places to the quantities of a tile. The
functions below read and write the vectors and matrices of one lane. A loop over all
lanes becomes vector code, which handles eight lanes (or four) at once.
"""

from .jit import inlined

LANES = 32
L = LANES  # short, for formulas


class Rows:
    """Gives the rows of a tile to quantities, one after another.

    Parameters
    ----------
    first : int
        Place of the first number that is free.
    """

    def __init__(self, first: int = 0) -> None:
        self.first = first
        self.end = first

    def take(self, count: int = 1) -> int:
        """Take the next `count` rows; return the place of their first number."""
        place = self.end
        self.end += count * LANES
        return place

    def take_each(self, count: int) -> list[int]:
        """Take the next `count` rows; return the place of each."""
        return [self.take() for _ in range(count)]

    @property
    def count(self) -> int:
        """Number of rows taken so far."""
        return (self.end - self.first) // LANES


@inlined
def vector_at(values, first):
    """Return the three numbers of an array that begin at a place."""
    return values[first], values[first + 1], values[first + 2]


@inlined
def set_vector(values, first, x, y, z):
    """Write three numbers to an array, beginning at a place."""
    values[first] = x
    values[first + 1] = y
    values[first + 2] = z


@inlined
def lane_vector(tile, row, lane):
    """Return the vector (x, y, z) of a lane; `row` is its first row."""
    return tile[row + lane], tile[row + L + lane], tile[row + 2 * L + lane]


@inlined
def write_vector(tile, row, lane, x, y, z):
    """Write the vector of a lane; `row` is its first row."""
    tile[row + lane] = x
    tile[row + L + lane] = y
    tile[row + 2 * L + lane] = z


@inlined
def add_vector(tile, row, lane, x, y, z):
    """Add to the vector of a lane; `row` is its first row."""
    tile[row + lane] += x
    tile[row + L + lane] += y
    tile[row + 2 * L + lane] += z


@inlined
def lane_matrix(tile, row, lane):
    """Return the symmetric matrix (xx, xy, xz, yy, yz, zz) of a lane."""
    return (
        tile[row + lane],
        tile[row + L + lane],
        tile[row + 2 * L + lane],
        tile[row + 3 * L + lane],
        tile[row + 4 * L + lane],
        tile[row + 5 * L + lane],
    )


@inlined
def write_matrix(tile, row, lane, xx, xy, xz, yy, yz, zz):
    """Write the symmetric matrix of a lane; `row` is the first of its six rows."""
    write_vector(tile, row, lane, xx, xy, xz)
    write_vector(tile, row + 3 * L, lane, yy, yz, zz)
