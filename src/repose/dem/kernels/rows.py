"""Numbers for the rows of a tile: every quantity gets the next free rows."""

LANES = 32


class Rows:
    """Gives rows of LANES numbers to quantities, one after another.

    Parameters
    ----------
    first : int
        Place of the first number of the first row.
    """

    def __init__(self, first: int = 0) -> None:
        self.first = self.end = first

    def take(self, count: int = 1) -> int:
        """The place of the first number of the next `count` rows."""
        place = self.end
        self.end += count * LANES
        return place

    def take_each(self, count: int) -> list[int]:
        """The places of the next `count` rows, one by one."""
        return [self.take() for _ in range(count)]

    @property
    def count(self) -> int:
        """How many rows were given so far."""
        return (self.end - self.first) // LANES
