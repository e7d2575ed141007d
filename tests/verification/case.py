"""Comparisons of a simulated case with known answers.

Each is asserted where it is made.
"""

from verification.page import percent

CLOSED_FORM = 0.003  # largest relative deviation from a closed form
PUBLISHED = 0.025  # the same, from a number that was read off a published figure


class Case:
    """The comparisons of one test; they make up its line of docs/verification.md."""

    def __init__(self):
        self.count = 0
        self.largest_deviation = None  # from answers
        self.largest_published = None  # from published numbers
        self.known_deviations = []
        self.extra_lines = {}  # of further tables of the page, by the table's name

    def close(self, quantity, result, answer, tolerance=CLOSED_FORM, scale=None):
        """Assert that a result is the answer.

        The deviation is relative to `scale`, by default to the answer.
        """
        deviation = abs(result - answer) / abs(scale or answer)
        self._check_deviation(quantity, result, answer, deviation, tolerance)
        self.largest_deviation = max(self.largest_deviation or 0.0, deviation)

    def near_published(self, quantity, result, published):
        """Assert that a result is near a number read off a published figure."""
        deviation = abs(result - published) / abs(published)
        self._check_deviation(quantity, result, published, deviation, PUBLISHED)
        self.largest_published = max(self.largest_published or 0.0, deviation)

    def _check_deviation(self, quantity, result, answer, deviation, tolerance):
        assert deviation <= tolerance, (
            f"{quantity}: {result:.7g} is not {answer:.7g}; "
            f"deviation {deviation:.2g}, tolerance {tolerance:g}"
        )
        self.count += 1

    def at_most(self, quantity, result, limit):
        """Assert that a result does not exceed a limit."""
        assert result <= limit, f"{quantity}: {result:.7g} is above {limit:.7g}"
        self.count += 1

    def within(self, quantity, result, low, high):
        """Assert that a result lies in a range."""
        assert low <= result <= high, (
            f"{quantity}: {result:.7g} is outside {low:g} to {high:g}"
        )
        self.count += 1

    def deviates(self, quantity, result, answer, expected_deviation, tolerance):
        """Assert that a result misses the answer by a known and explained deviation."""
        deviation = abs(result - answer) / abs(answer)
        assert abs(deviation - expected_deviation) <= tolerance, (
            f"{quantity}: {result:.7g} deviates by {deviation:.4g} from {answer:.7g}, "
            f"known are {expected_deviation:g} within {tolerance:g}"
        )
        self.count += 1
        self.known_deviations.append(f"{quantity}: {percent(deviation)}")

    def add_line(self, table, line):
        """Add a line to a further table of the page."""
        self.extra_lines.setdefault(table, []).append(line)
