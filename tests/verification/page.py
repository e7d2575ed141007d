"""The tables of docs/verification.md that are written from the cases."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "verification.md"
CASES = "cases"  # the table with a line for each case
# deviations below this are rounding, which differs between processors
NEGLIGIBLE = 1e-9


def percent(deviation):
    """Write a relative deviation in per cent, with two digits."""
    if deviation is None:
        return "-"
    if deviation < NEGLIGIBLE:
        return "below 1e-7 %"
    if deviation < 0.1:
        return f"{100 * deviation:.2g} %"
    return f"{100 * deviation:.0f} %"


def case_name(function):
    """Name the case of a test function by its file and its own name."""
    file = function.__module__.rpartition(".")[2]
    name = function.__name__.removeprefix("test_").replace("_", " ")
    return f"`{file}.py`: {name}"


def lines_of(function, case):
    """Write the lines of a test's case, by table.

    One is for the table of all cases, the others for further tables.
    """
    description = function.__doc__.splitlines()[0].removesuffix(".")
    cells = [
        case_name(function),
        description,
        str(case.count),
        percent(case.largest_deviation),
        percent(case.largest_published),
        "; ".join(case.known_deviations) or "-",
    ]
    return {CASES: ["| " + " | ".join(cells) + " |"], **case.extra_lines}


def block(table):
    """Match a table of the page: its head, and its lines."""
    return re.compile(
        rf"(<!-- table: {table} -->\n\n(?:\|.*\n){{2}})((?:\|.*\n)*)", re.MULTILINE
    )


def read_lines(table):
    """Read the lines of a table of the page, without its head."""
    match = block(table).search(PAGE.read_text(encoding="utf-8"))
    assert match, f"{PAGE} has no table {table!r}"
    return match[2].splitlines()


def write_lines(table, lines):
    """Replace the lines of a table of the page."""
    text = PAGE.read_text(encoding="utf-8")
    rows = "".join(f"{line}\n" for line in lines)
    PAGE.write_text(
        block(table).sub(lambda match: match[1] + rows, text), encoding="utf-8"
    )
