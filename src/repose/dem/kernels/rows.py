"""Places of the rows of a tile, given to the quantities one after another, and the vectors of a lane."""

from .jit import inlined

LANES = 32
L = LANES


class Rows:
    """Gives rows of LANES numbers to quantities, one after another; `first` is the place of the first number."""

    def __init__(self, first: int = 0) -> None:
        self.first = self.end = first

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
        """Number of rows given so far."""
        return (self.end - self.first) // LANES


@inlined
def lane_vector(tile, at, k):
    """Return a lane's vector, whose first row begins at a place of a tile."""
    return tile[at + k], tile[at + L + k], tile[at + 2 * L + k]


@inlined
def write_vector(tile, at, k, x, y, z):
    """Write a lane's vector."""
    tile[at + k] = x
    tile[at + L + k] = y
    tile[at + 2 * L + k] = z


@inlined
def add_vector(tile, at, k, x, y, z):
    """Add to a lane's vector."""
    tile[at + k] += x
    tile[at + L + k] += y
    tile[at + 2 * L + k] += z
