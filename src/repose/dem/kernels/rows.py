"""Places of the rows of a tile, given to the quantities one after another."""

LANES = 32


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
