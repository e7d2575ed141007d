"""The wrong lines that are drawn at random are the small slips that they are meant to be."""

import pytest
from kinds import Source


def wrong_lines(line):
    """All programs that a line can become."""
    source = Source(line.encode())
    changed = [
        source.changed(place, wrong)
        for place in source.places()
        for wrong in place.wrong
    ]
    return {content.decode() for content in changed if content is not None}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("a < b", {"a <= b"}),
        ("a >= b", {"a > b"}),
        ("a == b", set()),
        ("a < (b) <= c", {"a <= (b) <= c", "a < (b) < c"}),
        ("a in b", {"a not in b"}),
        ("a not in b", {"a in b"}),
        ("a is not None", {"a is None"}),
        ("x = 3", {"x = 4", "x = 2"}),
        ("x = 2.0", {"x = 2.2", "x = 1.8"}),
        ("x = 0.0", {"x = 0.1", "x = -0.1"}),
        ("x = True", set()),
        ("f(a, b, c)", {"f(b, a, c)"}),
        ("f(a, a)", set()),
        ("f(a, *b)", set()),
        ("f(a, b=c)", set()),
        ("a and b", {"(b)", "(a)"}),
        ("(a or b) and c", {"(c)", "(a or b)", "((a)) and c", "((b)) and c"}),
        ("x = [k for k in m if k]", {"x = [k for k in m if True]"}),
        ("x = a if b else c", {"x = a if True else c", "x = a if False else c"}),
        ("if TYPE_CHECKING: f()", set()),
        ("x: Literal[1] = y", set()),
        ("f'{a:3} {b < c}'", set()),
        ("'ä'; a < b", {"'ä'; a <= b"}),
    ],
)
def test_every_wrong_line_of_a_line_is_drawn(line, expected):
    assert wrong_lines(line) == expected
