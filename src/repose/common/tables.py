"""Read tables that users write: measured sizes, runs of a simulator, profiles.

A table is CSV, as spreadsheets and other programs write it. A reader declares its
columns (`Column`), and all invalid cells of a table are reported at once. A single
invalid cell is called a fault.

Many functions have a parameter `what`. It is a description of the expected file, such
as "a CSV file", for messages about a file that is something else.
"""

import csv
import io
import math
import os
import re
import sys
import unicodedata
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.common.attached import require_plain_file
from repose.common.errors import InputError, raise_together, shown
from repose.common.numbers import format_significant
from repose.common.summary_rows import find_summary_row

if TYPE_CHECKING:
    import pandas as pd

StrPath = str | os.PathLike
# An invalid cell: its row, counted from 0, its column, its value, and the allowed
# values.
Fault = tuple[int, str, Any, str]


class CellFault(NamedTuple):
    """A `Fault` whose parts have names.

    Attributes
    ----------
    row : int
        The row, counted from 0.
    column : str
        The name of the column.
    value : object
        The value of the cell, as the message shows it.
    allowed : str
        Description of the allowed values.
    """

    row: int
    column: str
    value: Any
    allowed: str


TABLE = "a CSV file"
COMMENT_SIGN = "#"
UNNAMED = "the column without a name"
UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")  # byte order marks
SEPARATORS = ",;\t"
# In a table from Excel, the first line may state the character that separates the
# cells.
SEPARATOR_LINE_PATTERN = re.compile(r'"?sep=."?', re.IGNORECASE)
BLANKS_PATTERN = r"\s+"  # separates cells if the header has none of `SEPARATORS`
# A message describes the columns that are not read: at most this many of them, each
# with at most this many of its values.
MAX_DESCRIBED_COLUMNS = 30
MAX_SHOWN_VALUES = 5
# If an extreme of measured numbers occurs at least this often, it may mark failed runs.
MIN_REPEATS = 3
NUMBER_PATTERN = re.compile(
    r"\s*[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)\s*",
    re.ASCII | re.IGNORECASE,
)
# NaN in the forms in which programs in C may print it, such as -nan or nan(ind).
NAN_PATTERN = re.compile(r"[+-]?nan(\(\w*\))?", re.ASCII | re.IGNORECASE)
FIRST_DIGIT_PATTERN = re.compile(r"[+-]?[.,]?\d")
WHOLE_NUMBER_PATTERN = re.compile(r"\d+", re.ASCII)
DECIMAL_COMMA_PATTERN = re.compile(
    r"[+-]?\d*,\d+(e[+-]?\d+)?", re.ASCII | re.IGNORECASE
)
DECIMAL_POINT_PATTERN = re.compile(
    r"[+-]?\d*\.\d+(e[+-]?\d+)?", re.ASCII | re.IGNORECASE
)


@dataclass(frozen=True)
class Column:
    """A column of a table, as its reader declares it.

    Parameters
    ----------
    name : str
        Name in the header, which may differ in form (`match_column_names`).
    kind : type
        ``float``, ``int``, ``bool`` or ``str``; ``object`` for a column whose cells are
        not checked.
    low, high : float
        Smallest and largest allowed number.
    above : bool
        Whether `low` itself is not allowed, so that a number must be larger than it.
    may_be_empty : bool
        Whether a cell may be empty; an empty number is read as NaN.
    once : bool
        Whether all values must differ from each other.
    needed : bool
        Whether the table must have the column.
    words : str
        Description of the allowed values, for messages. It is only needed if the kind
        and the bounds do not describe them.
    """

    name: str
    kind: type = float
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    may_be_empty: bool = False
    once: bool = False
    needed: bool = True
    words: str = ""

    @property
    def allowed(self) -> str:
        """Description of the allowed cells, for messages."""
        if self.kind is str:
            text = "text"
        elif self.kind is bool:
            text = "True or False"
        else:
            text = self.words or self._describe_allowed_numbers()
        return f"{text}, or nothing" if self.may_be_empty else text

    def _describe_allowed_numbers(self) -> str:
        """Describe the kind of number and its bounds, as in ``a number above 0``."""
        bounds = ""
        # With `above`, the lower bound itself is not allowed.
        if math.isfinite(self.low):
            preposition = "above" if self.above else "from"
            bounds += f" {preposition} {self.low:g}"
        if math.isfinite(self.high):
            preposition = "to" if bounds else "up to"
            bounds += f" {preposition} {self.high:g}"
        if self.kind is int:
            return f"a whole number{bounds}"
        # Bounds already imply that the number is finite.
        return f"a number{bounds}" if bounds else "a finite number"

    def read(self, cell: Any) -> Any:
        """Convert a cell to a value of the column, and check it.

        Parameters
        ----------
        cell : object
            The text of the cell, or a value that was converted before.

        Returns
        -------
        object
            A value of the column's kind. Text is returned unchanged. If cells may be
            empty, an empty cell of a column of numbers or booleans becomes NaN.

        Raises
        ------
        ValueError, TypeError
            If the cell is not allowed.
        """
        # The kind `object` declares a column without checking its cells.
        if self.kind is object:
            return cell
        if self.kind is str:
            if not self.may_be_empty and not str(cell).strip():
                raise ValueError("an empty cell is not allowed")
            return cell

        if self.may_be_empty and is_missing(cell):
            return math.nan
        if self.kind is bool:
            return _read_boolean(cell)
        return self._read_number(cell)

    def _read_number(self, cell: Any) -> int | float:
        """Convert a cell to a number; raise ValueError if it is not allowed.

        An integer may be written as 3.0.
        """
        number = parse_number(cell)
        is_valid = self._is_inside(number)
        if self.kind is int:
            is_valid = is_valid and number.is_integer()
        if not is_valid:
            raise ValueError(f"{cell!r} is not {self.allowed}")
        return int(number) if self.kind is int else number

    def _is_inside(self, number: float) -> bool:
        """Tell whether a number is finite and within the bounds."""
        if self.above and number == self.low:
            return False
        return math.isfinite(number) and self.low <= number <= self.high


@dataclass
class Table:
    """The cells of a table.

    Attributes
    ----------
    source : object
        Its file, for messages.
    text : pandas.DataFrame
        Every cell as text without blanks around it.
    comments : list of str
        The lines that begin with ``#``.
    values : dict of str to list
        The cells of each column: values if the column is declared, otherwise text.
    text_columns : frozenset of str
        Names of the columns that are declared as text.
    """

    source: object
    text: "pd.DataFrame"
    comments: list[str]
    values: dict[str, list[Any]] = field(default_factory=dict)
    text_columns: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.text)

    def rows(self) -> list[dict[str, Any]]:
        """List the rows as mappings from the name of a column to its cell in `values`."""
        rows = zip(*self.values.values(), strict=True)
        return [dict(zip(self.values, row, strict=True)) for row in rows]

    def frame(self) -> "pd.DataFrame":
        """Make a data frame, whose columns have the types that pandas finds."""
        import pandas as pd

        table = pd.read_csv(io.StringIO(self.text.to_csv(index=False)))
        # Restore columns of text, because pandas reads text such as NA as an empty
        # cell.
        for name in self.text_columns & set(self.text):
            table[name] = self.text[name].tolist()
        return table


def parse_number(value: object) -> float:
    """Read a number in a form that is usual in tables.

    Raises
    ------
    ValueError
        If the value has another form, even one that Python accepts, such as ``1_0``,
        True, or digits of other scripts.
    """
    if isinstance(value, bool | np.bool_):
        raise ValueError(f"{value!r} is not a number")
    if isinstance(value, str) and not NUMBER_PATTERN.fullmatch(value):
        raise ValueError(f"{value!r} is not a number")
    return float(value)  # type: ignore[arg-type]


def holds_numbers(cells: Iterable[str]) -> bool:
    """Tell whether at least half of the filled cells of a column are numbers."""
    filled = [cell for cell in cells if cell]
    n_numbers = sum(NUMBER_PATTERN.fullmatch(cell) is not None for cell in filled)
    return n_numbers > 0 and len(filled) <= 2 * n_numbers


def holds_measurements(cells: Iterable[str]) -> bool:
    """Tell whether a column holds measured numbers.

    At least one of them must have a decimal point, because a column of integers may be
    a label.
    """
    cells = list(cells)
    return holds_numbers(cells) and any(
        DECIMAL_POINT_PATTERN.fullmatch(cell) for cell in cells
    )


def _numbers_the_rows(cells: Iterable[str]) -> bool:
    """Tell whether a column seems to number the rows.

    In such a column, more than half of the cells are filled, all with different
    integers.
    """
    cells = list(cells)
    filled = [cell for cell in cells if cell]
    is_mostly_filled = 2 * len(filled) > len(cells)
    are_different = len(set(filled)) == len(filled)
    are_integers = all(WHOLE_NUMBER_PATTERN.fullmatch(cell) for cell in filled)
    return is_mostly_filled and are_different and are_integers


def read(
    path: StrPath,
    columns: Iterable[str | Column],
    what: str = TABLE,
    is_number_column: Callable[[Iterable[str]], bool] = holds_numbers,
    optional: Iterable[str] = (),
    find_unused_rows: "Callable[[pd.DataFrame], Collection[int]] | None" = None,
) -> Table:
    """Read a table, require these columns in it, and check its cells.

    Parameters
    ----------
    path : path
        A CSV file in one of the forms that `read_sheet` accepts.
    columns : iterable of str or Column
        Columns that the table must have, except a `Column` that is not `needed`. A
        column that is given as `Column` is declared: its cells are converted to values.
        Of any other column, only the name is required.
    what : str
        Description of the expected file, for messages.
    is_number_column : callable
        Function that tells from the cells of an undeclared column whether it holds
        numbers. If it does, each of its cells must be a number or empty. In a column
        that seems to contain row numbers, a cell must not be empty.
    optional : iterable of str
        Names of other columns that the table may have. A column whose name differs only
        in form gets the name from this list.
    find_unused_rows : callable, optional
        Function that gets the cells as text, and returns the rows whose numbers the
        caller does not use. The check for a row that sums up the others ignores them.

    Returns
    -------
    Table
        The table. Its columns have the names that the caller uses.

    Raises
    ------
    InputError
        If the file is not a table, lacks a column, has a cell that its column does not
        allow, or ends with a row that sums up the others (`find_summary_row`).
    """
    columns = list(columns)
    declared = {column.name: column for column in columns if isinstance(column, Column)}
    names = [
        column.name if isinstance(column, Column) else column for column in columns
    ]
    may_be_missing = {name for name, column in declared.items() if not column.needed}
    needed_names = [name for name in names if name not in may_be_missing]

    # Rename columns whose names differ only in form from those that the caller uses.
    table = read_sheet(path, what, names)
    new_names = match_column_names(table.text, [*names, *optional])
    table.text = table.text.rename(columns=new_names)
    require_columns(path, table.text, needed_names, what)

    # Check the cells, and complete the table with their values. A column that is not
    # declared keeps its text.
    unused_rows = () if find_unused_rows is None else find_unused_rows(table.text)
    values = _convert_and_check(
        path, table.text, declared, is_number_column, unused_rows
    )
    table.values = {
        name: values.get(name, table.text[name].tolist()) for name in table.text
    }
    table.text_columns = frozenset(
        name for name, column in declared.items() if column.kind is str
    )
    return table


def _convert_and_check(
    path: StrPath,
    cells: "pd.DataFrame",
    declared: Mapping[str, Column],
    is_number_column: Callable[[Iterable[str]], bool],
    unused_rows: Collection[int],
) -> dict[str, list[Any]]:
    """Convert the cells of declared columns to values, and check all cells of a table.

    Parameters
    ----------
    path : path
        The file of the table, for messages.
    cells : pandas.DataFrame
        The cells as text.
    declared : mapping of str to Column
        The declared columns by name. The table may lack some of them.
    is_number_column : callable
        Function that tells from the cells of an undeclared column whether it holds
        numbers.
    unused_rows : collection of int
        Rows that cannot sum up the others.

    Returns
    -------
    dict of str to list
        The values of each declared column that the table has.

    Raises
    ------
    InputError
        For all invalid cells, and for a row that sums up the others.
    """
    values, faults = convert_columns(cells, declared.values())
    undeclared = [
        _describe_undeclared_column(name, cells[name], is_number_column)
        for name in cells
        if name not in declared
    ]
    _, other_faults = convert_columns(cells, undeclared)
    summary_faults = _find_summary_row_fault(cells, declared, unused_rows)
    refuse(path, [*faults, *other_faults, *summary_faults])
    return values


def _describe_undeclared_column(
    name: str, cells: "pd.Series", is_number_column: Callable[[Iterable[str]], bool]
) -> Column:
    """Make a declaration with which an undeclared column can be checked.

    Parameters
    ----------
    name : str
        Name of the column.
    cells : pandas.Series
        Its cells as text.
    is_number_column : callable
        Function that tells from the cells whether the column holds numbers.

    Returns
    -------
    Column
        A column of numbers, or one whose cells are not checked.
    """
    return Column(
        name,
        kind=float if is_number_column(cells) else object,
        may_be_empty=not _numbers_the_rows(cells),
        words="a finite number, as most cells of this column",
    )


def convert_columns(
    cells: Mapping[str, Sequence[Any]],
    columns: Iterable[Column],
    skipped_rows: Collection[int] = (),
) -> tuple[dict[str, list[Any]], list[Fault]]:
    """Convert the cells of declared columns to values, and list the invalid cells.

    Parameters
    ----------
    cells : mapping of str to sequence
        The cells by column. Declared columns that are missing here are skipped.
    columns : iterable of Column
        The columns to read.
    skipped_rows : collection of int
        Rows whose cells are neither converted nor checked. Their values are NaN.

    Returns
    -------
    values : dict of str to list
        The values of each column; NaN for an invalid cell.
    faults : list of Fault
        The invalid cells, column by column. The function `refuse` of this module raises
        them as errors.
    """
    values: dict[str, list[Any]] = {}
    faults: list[Fault] = []
    for column in columns:
        if column.name not in cells:
            continue
        column_cells = list(cells[column.name])
        column_values, column_faults = _read_column(column, column_cells, skipped_rows)
        values[column.name] = column_values
        faults += column_faults
    return values, faults


def refuse(source: object, faults: Iterable[Fault]) -> None:
    """Raise all invalid cells of a table as one error, in the order of its rows.

    Parameters
    ----------
    source : object
        The file of the table, which the messages name.
    faults : iterable of Fault
        Invalid cells, as `convert_columns` returns them. If there are none, nothing is
        raised.

    Raises
    ------
    InputError
        With a message for each fault.
    """
    raise_together(
        InputError(
            f"{source}, row {row + 1}",
            key=column or UNNAMED,
            value=value,
            allowed=allowed,
        )
        for row, column, value, allowed in sorted(faults, key=lambda fault: fault[0])
    )


def require_columns(
    path: object,
    column_names: Iterable[str],
    required: Iterable[str],
    what: str = TABLE,
) -> None:
    """Raise an InputError if a table lacks one of the required columns.

    Parameters
    ----------
    path : object
        The file of the table, for messages.
    column_names : iterable of str
        The names of its columns.
    required : iterable of str
        Names that it must have.
    what : str
        Description of the expected table. The message names it, unless it is the
        general `TABLE`.
    """
    found = [str(name) for name in column_names]
    required_names = tuple(required)
    description = "" if what == TABLE else f" of {what}"
    for name in required_names:
        if name in found:
            continue
        allowed = (
            f"columns {', '.join(required_names)}{description}; "
            f"found: {', '.join(found)}"
        )
        # Point out a column whose name only looks like the missing one.
        for other in found:
            allowed += _explain_difference(name, other)
        raise InputError(path, key=f"column {name}", value="missing", allowed=allowed)


def _explain_difference(name: str, other: str) -> str:
    """Explain how two names of columns that look alike differ.

    Names of the same length may look alike if every difference between them involves a
    character outside ASCII, such as a Cyrillic a.

    Parameters
    ----------
    name : str
        The name that is missing in a table.
    other : str
        A name that the table has.

    Returns
    -------
    str
        The end of a message; empty if the names do not look alike.
    """
    if len(name) != len(other):
        return ""
    differences = []
    for character, other_character in zip(name, other, strict=True):
        if character == other_character:
            continue
        if character.isascii() and other_character.isascii():
            return ""
        differences.append(
            f"U+{ord(other_character):04X} where {name} has U+{ord(character):04X}"
        )
    return f"; {other} has {', '.join(differences)}" if differences else ""


def describe_columns(columns: Mapping[str, Sequence[Any]]) -> list[str]:
    """Describe each column of numbers in a line: count, mean and range.

    A subcommand prints these lines to show what it has read from a table. Columns with
    a cell that is not a number are left out. Some programs write the same extreme
    number for every failed run. `_describe_extreme` therefore adds to the minimum or
    maximum how often it occurs, if it is repeated while most other numbers are not.

    Parameters
    ----------
    columns : mapping of str to sequence
        Values or strings by column, such as a data frame or `Table.values`.

    Returns
    -------
    list of str
        Lines such as ``long_mm: 20 numbers, mean 21.14, from 19.8 to 23.1``.
    """
    lines = []
    for name, cells in columns.items():
        # Leave out a column with a cell that is not a number.
        texts = [str(cell).strip() for cell in cells if not is_missing(cell)]
        if not texts or not all(NUMBER_PATTERN.fullmatch(text) for text in texts):
            continue
        numbers = np.array([float(text) for text in texts])
        # Like an empty cell, an infinite response marks a failed run.
        numbers = numbers[np.isfinite(numbers)]
        if not len(numbers):
            continue
        lines.append(
            f"{name or UNNAMED}: {len(numbers)} numbers, mean {format_significant(numbers.mean())}, "
            f"from {_describe_extreme(numbers, numbers.min())} "
            f"to {_describe_extreme(numbers, numbers.max())}"
        )
    return lines


def _describe_extreme(numbers: np.ndarray, value: float) -> str:
    """Format an extreme of a column, with its count if only this number is repeated.

    Parameters
    ----------
    numbers : ndarray, (rows,)
        The numbers of the column.
    value : float
        The lowest or the highest of them.
    """
    _, counts = np.unique(numbers, return_counts=True)
    count = int((numbers == value).sum())
    if count >= MIN_REPEATS and np.median(counts) == 1:
        return f"{format_significant(value)} ({count} times)"
    return format_significant(value)


def describe_unread(
    columns: Mapping[str, Sequence[Any]], hint_if_few: str
) -> dict[str, str]:
    """Describe the values of columns that no one reads, except constant columns.

    Parameters
    ----------
    columns : mapping of str to sequence
        The cells of the columns that the reader of the table ignores.
    hint_if_few : str
        Text to append for a column with few different values. Such a column may show
        which runs failed.

    Returns
    -------
    dict of str to str
        A sentence for each column, such as ``column done is not read; it has 'True' 12
        times, 'False' 4 times``. A column without a name has the key `UNNAMED`. If
        there are more than `MAX_DESCRIBED_COLUMNS` columns, the key "" has a sentence
        with the number of the others.
    """
    sentences: dict[str, str] = {}
    n_further_columns = 0
    for name, cells in columns.items():
        counts = Counter("" if is_missing(cell) else str(cell) for cell in cells)
        is_constant = len(counts) < 2
        if is_constant:
            continue
        if len(sentences) == MAX_DESCRIBED_COLUMNS:
            n_further_columns += 1
            continue
        # If all values differ, they are no categories, even if they are few.
        has_few_values = len(counts) <= MAX_SHOWN_VALUES and len(counts) < len(cells)
        hint = hint_if_few if has_few_values else ""
        described_name = f"column {name}" if name else UNNAMED
        sentences[name or UNNAMED] = (
            f"{described_name} is not read; it has {_list_frequent_values(counts)}{hint}"
        )
    if n_further_columns:
        sentences[""] = f"{n_further_columns} further columns are not read"
    return sentences


def _list_frequent_values(counts: "Counter[str]") -> str:
    """List the most frequent values of a column with their counts.

    Parameters
    ----------
    counts : Counter of str
        How often the column has each value.

    Returns
    -------
    str
        A list such as ``'True' 12 times, 'False' once``. At most `MAX_SHOWN_VALUES`
        values are listed. The end of the list states how many other values there are.
    """
    texts = []
    for value, count in counts.most_common(MAX_SHOWN_VALUES):
        times = "once" if count == 1 else f"{count} times"
        texts.append(f"{shown(value)} {times}")
    n_others = len(counts) - len(texts)
    others = f" and {n_others} other values" if n_others else ""
    return f"{', '.join(texts)}{others}"


def print_columns(path: StrPath) -> None:
    """Print the lines of `describe_columns` for a user's table on stderr."""
    for line in describe_columns(read_sheet(path).text):
        print(f"{path}: {line}", file=sys.stderr)


def read_sheet(
    path: StrPath, what: str = TABLE, known_names: Iterable[str] = ()
) -> Table:
    """Read the cells of a table as text.

    The encoding is UTF-8, with or without a byte order mark, or UTF-16 with one. The
    separator of the cells is found from the header. It is a comma, a semicolon or a
    tab. If the header has none of them, blanks separate the cells. With semicolons and
    tabs a number may have a decimal comma. Lines that begin with ``#`` are comments.
    Empty rows, empty columns without a name, and a first line such as ``sep=;`` are
    left out.

    Parameters
    ----------
    path : path
        The file.
    what : str
        Description of the expected file, for messages.
    known_names : iterable of str
        Names of columns that its reader uses. They help to explain a missing header.

    Returns
    -------
    Table
        The cells as text. Its `values` are empty; only `read` fills them.

    Raises
    ------
    InputError
        If the file cannot be read as a table, lacks a header, or has two columns of the
        same name.
    """
    lines, comments = _read_lines_and_comments(path, what)
    _require_header(path, lines, comments, known_names)
    separator = _find_separator(_read_header(lines))
    header_and_cells = _split_cells(path, "\n".join(lines), separator, what)
    # Join names that span several lines of the file, as Design-Expert writes them.
    names = [" ".join(name.split()) for name in header_and_cells.iloc[0]]
    _require_complete_last_row(path, lines[-1], separator, len(names))
    cells = header_and_cells.iloc[1:].reset_index(drop=True)
    cells = _name_columns(path, cells, names)
    # A file with commas between its columns cannot have decimal commas as well.
    if separator in (";", "\t"):
        cells = _replace_decimal_commas(path, cells)
    return Table(path, cells, comments)


def _require_header(
    path: StrPath,
    lines: Sequence[str],
    comments: Sequence[str],
    known_names: Iterable[str],
) -> None:
    """Check that the names of the columns are in the first line of a table.

    One known name in the first line is enough. Without any, the names may be in a later
    line, for example below a title, or in a comment, or they may be missing.

    Parameters
    ----------
    path : path
        The file of the table, for messages.
    lines : list of str
        All lines of the file. Each comment is replaced by an empty line.
    comments : list of str
        The comments.
    known_names : iterable of str
        Names of columns that the reader uses.

    Raises
    ------
    InputError
        If the first line has no known name, but a later line or a comment has, or if
        the first line has numbers. The message says which of these it is.
    """
    known = {normalise_name(name) for name in known_names}
    header = _read_header(lines)
    if not known or _count_known_names(header, known):
        return

    cause = _find_cause_of_missing_header(header, lines, comments, known)
    if cause:
        raise InputError(
            path,
            key="header",
            value=header.strip(),
            allowed=f"names of the columns; {cause}",
        )


def _find_cause_of_missing_header(
    header: str, lines: Sequence[str], comments: Sequence[str], known: Collection[str]
) -> str:
    """Find out why the first line of a table has no known name.

    Parameters
    ----------
    header : str
        The first line that is not empty.
    lines, comments : sequence of str
        All lines, and the comments among them.
    known : collection of str
        The known names of columns, normalised.

    Returns
    -------
    str
        The cause, with advice; empty if none was found. It follows "names of the
        columns;" in a message, so "them" means these names.
    """
    # A single known name may also be a word of a title, or the first cell of a row.
    # Therefore require two known names, or one if the reader knows only one.
    n_required_names = min(2, len(known))
    for comment in comments:
        text = comment.lstrip(f' "{COMMENT_SIGN}')
        if _count_known_names(text, known) >= n_required_names:
            return f"{shown(comment)} has them, but is a comment: remove its #"
    for number, line in enumerate(lines, 1):
        if _count_known_names(line, known) >= n_required_names:
            return f"line {number} has them: remove the lines above it"
    if holds_numbers(_split_line(header)):
        return "the first line has numbers"
    return ""


def _count_known_names(line: str, known: Collection[str]) -> int:
    """Count how many of the known names, which are normalised, are cells of a line."""
    return len({normalise_name(cell) for cell in _split_line(line)}.intersection(known))


def _split_line(line: str) -> list[str]:
    """Split a line into cells without blanks and quotes around them.

    Separators inside quotes also separate cells.
    """
    separator = _find_separator(line)
    cells = line.split(None if separator == BLANKS_PATTERN else separator)
    return [cell.strip(' "') for cell in cells]


def _name_columns(
    path: StrPath, cells: "pd.DataFrame", names: Sequence[str]
) -> "pd.DataFrame":
    """Name the columns of a table, and leave out empty columns without a name.

    Parameters
    ----------
    path : path
        The file of the table, for messages.
    cells : pandas.DataFrame
        The cells as text. Columns are numbered from 0.
    names : sequence of str
        The name of each column.

    Returns
    -------
    pandas.DataFrame
        The cells, in columns with names.

    Raises
    ------
    InputError
        If two columns have the same name.
    """
    kept_columns = [
        column
        for column, name in enumerate(names)
        if name or (cells[column] != "").any()
    ]
    kept_names = [names[column] for column in kept_columns]
    for name, count in Counter(kept_names).items():
        if count != 1:
            # Columns without a name have the same empty name, which a message cannot
            # show.
            detail = "" if name else f"; {count} columns with cells have no name"
            raise InputError(
                path, key="header", value=name, allowed=f"each column once{detail}"
            )
    return cells[kept_columns].set_axis(kept_names, axis=1)


def _read_lines_and_comments(path: StrPath, what: str) -> tuple[list[str], list[str]]:
    """Read the lines of a table, and separate its comments.

    Parameters
    ----------
    path : path
        The file.
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    lines : list of str
        All lines. Each comment is replaced by an empty line, so that the line numbers
        in messages remain correct. So is a first line such as ``sep=;``.
    comments : list of str
        The lines that begin with ``#``.
    """
    text = read_text(path, what).replace("\r\n", "\n").replace("\r", "\n")
    comments = []
    lines = []
    for number, line in enumerate(text.split("\n")):
        if number == 0 and SEPARATOR_LINE_PATTERN.fullmatch(line):
            lines.append("")
            continue
        # Spreadsheets put a comment into quotes if it contains a separator.
        if line.lstrip(' "').startswith(COMMENT_SIGN):
            comments.append(line)
            lines.append("")
        else:
            lines.append(line)
    return lines, comments


def read_text_rows(
    path: StrPath, columns: Iterable[Column], what: str = TABLE
) -> list[dict[str, str]]:
    """Read the cells of a table as text, without importing pandas.

    Use this function for a table that `read` has checked in an earlier process. The
    cells are not checked again. Without pandas, which is slow to import, a process
    starts faster.

    Parameters
    ----------
    path : path
        A CSV file in one of the forms that `read_sheet` accepts.
    columns : iterable of Column
        The declared columns. The table may write their names in another form
        (`match_column_names`).
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    list of dict
        For each row, the cells by the names of their columns. A row that is shorter
        than the header lacks the last columns.

    Raises
    ------
    InputError
        If the file is not text, or lacks a column that is needed.
    """
    header, *rows = _split_rows(path, what)
    declared = list(columns)
    new_names = match_column_names(header, [column.name for column in declared])
    names = [new_names.get(name, name) for name in header]
    required = [column.name for column in declared if column.needed]
    require_columns(path, names, required, what)
    return [dict(zip(names, row, strict=False)) for row in rows]


def _split_rows(path: StrPath, what: str) -> list[list[str]]:
    """Split a table into the cells of its rows, without importing pandas.

    Parameters
    ----------
    path : path
        The file.
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    list of list of str
        The cells of each row. Blanks around the text of a cell are removed, and each
        series of blanks inside it becomes one space. The first row is the header. Empty
        rows are left out.

    Raises
    ------
    InputError
        If the file is not text, or is empty.
    """
    lines, _ = _read_lines_and_comments(path, what)
    separator = _find_separator(_read_header(lines))
    # If blanks separate the cells, the reader treats a series of them as one, because
    # it skips blanks after the separator.
    reader = csv.reader(
        (f"{line.strip(' ')}\n" for line in lines),
        delimiter=" " if separator == BLANKS_PATTERN else separator,
        skipinitialspace=True,
    )
    rows = []
    for row in reader:
        cells = [" ".join(cell.split()) for cell in row]
        if any(cells):
            rows.append(cells)
    if not rows:
        raise InputError(path, key="rows", value=0, allowed=what)
    return rows


def _require_complete_last_row(
    path: StrPath, last_line: str, separator: str, n_columns: int
) -> None:
    """Raise an InputError if a file ends within a row.

    Separators inside quotes are counted, too. The check may then miss a file that was
    cut off, but never rejects a complete one.

    Parameters
    ----------
    path : path
        The file, for the message.
    last_line : str
        The text after the last line break. In a complete file it is empty, or a row
        with all its cells.
    separator : str
        The character that separates the cells, or `BLANKS_PATTERN`.
    n_columns : int
        Number of cells of the header.

    Raises
    ------
    InputError
        If the last row has fewer cells than the header.
    """
    # The last line may be the end of a quoted cell that spans several lines.
    is_within_quotes = last_line.count('"') % 2 == 1
    # Several blanks may separate two cells, so these cells cannot be counted here.
    is_blank_separated = separator == BLANKS_PATTERN
    if not last_line.strip() or is_within_quotes or is_blank_separated:
        return
    n_cells = last_line.count(separator) + 1
    if n_cells < n_columns:
        raise InputError(
            path,
            key="last row",
            value=f"{n_cells} cells",
            allowed=f"{n_columns} cells, as in the header; was the file cut off?",
        )


def read_text(path: StrPath, what: str) -> str:
    """Read a file as text in UTF-8 or UTF-16.

    Parameters
    ----------
    path : path
        The file.
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    str
        The content of the file.

    Raises
    ------
    InputError
        If the file cannot be read, or is not text in one of these encodings.
    """
    # A file that cannot be opened has no encoding, so that error only names `what`.
    allowed = f"{what} in UTF-8, or in UTF-16 with a byte order mark"
    try:
        content = require_plain_file(path).read_bytes()
    except OSError as error:
        raise InputError(
            path, key="file", value=error.strerror, allowed=what
        ) from error
    # The encoding "utf-8-sig" is UTF-8 with or without a byte order mark.
    encoding = "utf-16" if content.startswith(UTF_16_MARKS) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(
            path, key="table", value=str(error), allowed=allowed
        ) from error
    # A text with null bytes is probably UTF-16 without a byte order mark.
    if "\0" in text:
        raise InputError(path, key="table", value="a null byte", allowed=allowed)
    return text


def _read_header(lines: Iterable[str]) -> str:
    """Return the header of a table: its first line with content.

    If a quoted name spans several lines, the header includes all of these lines.
    """
    header = ""
    for line in lines:
        header += f"{line}\n"
        if header.strip() and header.count('"') % 2 == 0:
            break
    return header


def _find_separator(header: str) -> str:
    """Find out from the header of a table which character separates its cells.

    Returns
    -------
    str
        The most frequent of `SEPARATORS`, or `BLANKS_PATTERN` if the header has none of
        them.
    """
    separator = max(SEPARATORS, key=header.count)
    if separator not in header and " " in header.strip():
        return BLANKS_PATTERN
    return separator


def _split_cells(path: StrPath, text: str, separator: str, what: str) -> "pd.DataFrame":
    """Split the text of a table into cells, and leave out rows without content.

    Parameters
    ----------
    path : path
        Its file, for messages.
    text : str
        The lines, with the header.
    separator : str
        The character that separates the cells, or `BLANKS_PATTERN`.
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    pandas.DataFrame
        The cells as strings without whitespace around them. Row 0 is the header, and
        the columns are numbered.

    Raises
    ------
    InputError
        If the text is empty, or a row has more cells than the first.
    """
    # Import pandas only here: it is slow, and a process that simulates reads no table.
    import pandas as pd

    try:
        cells = pd.read_csv(
            io.StringIO(text),
            sep=separator,
            header=None,
            index_col=False,
            dtype=object,
            na_filter=False,
            skipinitialspace=True,
        )
    except pd.errors.EmptyDataError:
        raise InputError(path, key="rows", value=0, allowed=what) from None
    except pd.errors.ParserError as error:
        # Such as "Expected 3 fields in line 5, saw 4", without pandas' beginning.
        problem = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise InputError(
            path,
            key="cells",
            value=problem,
            allowed=f"{what} with as many cells in a row as in its header; "
            "if numbers have decimal commas, ; must separate the columns",
        ) from None

    # Remove the whitespace around each cell: `skipinitialspace` has removed only the
    # spaces before it. Then leave out rows in which all cells are empty.
    cells = cells.map(str.strip)
    has_content = (cells != "").any(axis=1)
    cells = cells[has_content].reset_index(drop=True)
    if len(cells) == 0:
        raise InputError(path, key="rows", value=0, allowed=what)
    return cells


def _replace_decimal_commas(path: StrPath, cells: "pd.DataFrame") -> "pd.DataFrame":
    """Replace the decimal commas of numbers by decimal points.

    Parameters
    ----------
    path : path
        The file of the table, for messages.
    cells : pandas.DataFrame
        The cells as text, without the header.

    Returns
    -------
    pandas.DataFrame
        The cells with decimal points.

    Raises
    ------
    InputError
        If some numbers have a comma and others a point, because their meaning is then
        unclear.
    """
    has_comma = cells.map(
        lambda cell: DECIMAL_COMMA_PATTERN.fullmatch(cell) is not None
    )
    if not has_comma.to_numpy().any():
        return cells

    # If a number has a decimal point, `refuse` raises an error for the first such cell.
    # The message also shows a number with a decimal comma.
    has_point = cells.map(
        lambda cell: DECIMAL_POINT_PATTERN.fullmatch(cell) is not None
    )
    if has_point.to_numpy().any():
        row, column = np.argwhere(has_point.to_numpy())[0].tolist()
        first_with_comma = cells.to_numpy()[has_comma.to_numpy()][0]
        fault = CellFault(
            row,
            column=str(cells.columns[column]),
            value=cells.iat[row, column],
            allowed=(
                "the same decimal sign in the whole table, but "
                f"{first_with_comma} has a comma"
            ),
        )
        refuse(path, [fault])

    with_points = cells.map(lambda cell: cell.replace(",", "."))
    return cells.where(~has_comma, with_points)


def match_column_names(found: Iterable[str], declared: Iterable[str]) -> dict[str, str]:
    """Match columns of a table to declared names that differ from theirs only in form.

    Differences in form are capital letters, blanks, the encoding of accents, and signs
    that look alike, such as micro and Greek mu. If several columns match one declared
    name, it is unclear which of them is meant, so they keep their names.

    Parameters
    ----------
    found : iterable of str
        Names of the columns of a table.
    declared : iterable of str
        Names that its reader uses.

    Returns
    -------
    dict of str to str
        The declared name for each column to rename.
    """
    found_names = list(found)
    declared_names = set(declared)

    # Normalise the declared names that the table lacks. Readers declare no two names
    # that differ only in form.
    missing_names = {
        normalise_name(name): name for name in declared_names.difference(found_names)
    }

    # Match them to the other columns of the table.
    undeclared = [name for name in found_names if name not in declared_names]
    normalised_counts = Counter(normalise_name(name) for name in undeclared)
    new_names = {}
    for name in undeclared:
        normalised = normalise_name(name)
        if normalised in missing_names and normalised_counts[normalised] == 1:
            new_names[name] = missing_names[normalised]
    return new_names


def normalise_name(name: object) -> str:
    """Convert a name to the form in which `match_column_names` compares names."""
    # Invisible characters, such as the byte order mark, have the category Cf.
    visible = [
        character for character in str(name) if unicodedata.category(character) != "Cf"
    ]
    form = unicodedata.normalize("NFKC", "".join(visible)).casefold()
    return unicodedata.normalize("NFKC", " ".join(form.split()))


def _read_column(
    column: Column, cells: Sequence[Any], skipped_rows: Collection[int]
) -> tuple[list[Any], list[Fault]]:
    """Convert the cells of a column to values, and list the invalid cells.

    Parameters
    ----------
    column : Column
        The declaration of the column. If its values must differ (`once`), a cell that
        repeats an earlier value is also invalid.
    cells : sequence
        The cells of the column.
    skipped_rows : collection of int
        Rows whose cells are neither converted nor checked.

    Returns
    -------
    values : list
        The value of each cell. It is NaN for an invalid cell or a skipped row, even in
        a column of integers or text.
    faults : list of Fault
        The invalid cells.
    """
    values: list[Any] = []
    faults: list[Fault] = []
    for row, cell in enumerate(cells):
        value: Any = math.nan
        if row not in skipped_rows:
            try:
                value = column.read(cell)
            except (TypeError, ValueError, OverflowError):
                fault = CellFault(
                    row,
                    column=column.name,
                    value=_format_invalid_cell(column, cell),
                    allowed=f"{column.allowed}{_explain_form(column, cell)}",
                )
                faults.append(fault)
        values.append(value)
    if column.once:
        faults += _find_repeated_values(column.name, values)
    return values, faults


def _find_repeated_values(name: str, values: Sequence[Any]) -> list[Fault]:
    """Find the values of a column that repeat an earlier one.

    Parameters
    ----------
    name : str
        Name of the column.
    values : sequence
        Its values. NaN, which stands for an empty or invalid cell, may be repeated.

    Returns
    -------
    list of Fault
        The cells with such values.
    """
    faults: list[Fault] = []
    first_row_of_value: dict[Any, int] = {}
    for row, value in enumerate(values):
        # Only NaN differs from itself.
        is_nan = value != value
        if is_nan:
            continue
        first_row = first_row_of_value.setdefault(value, row)
        if first_row != row:
            fault = CellFault(
                row,
                column=name,
                value=value,
                allowed=f"each {name} once; row {first_row + 1} has it as well",
            )
            faults.append(fault)
    return faults


def _format_invalid_cell(column: Column, cell: Any) -> Any:
    """Convert an invalid cell to the value that a message shows.

    A finite number that is out of bounds becomes a float, so that the message writes it
    without quotes. Any other cell is returned unchanged.
    """
    if column.kind is bool:
        return cell
    try:
        number = parse_number(cell)
    except (TypeError, ValueError, OverflowError):
        return cell
    return number if math.isfinite(number) else cell


def _explain_form(column: Column, cell: Any) -> str:
    """Explain how to write a number, if text only begins like one.

    Parameters
    ----------
    column : Column
        The declaration of the column.
    cell : object
        The invalid cell.

    Returns
    -------
    str
        The end of a message; empty for any other cell.
    """
    is_text_of_number = column.kind in (float, int) and isinstance(cell, str)
    if not is_text_of_number or NUMBER_PATTERN.fullmatch(cell):
        return ""
    if not FIRST_DIGIT_PATTERN.match(cell):
        return ""
    return "; a number is written as 0.35 or 3.5e-01"


def is_missing(cell: Any) -> bool:
    """Tell whether a cell is empty: blank text, text such as "nan", None, or NaN."""
    if isinstance(cell, str):
        text = cell.strip()
        return not text or NAN_PATTERN.fullmatch(text) is not None
    if isinstance(cell, int | float):
        # Only NaN differs from itself.
        return cell != cell
    # Any other value may be one of the types that pandas uses for a missing value.
    import pandas as pd  # slow to import

    return bool(pd.api.types.is_scalar(cell) and pd.isna(cell))


def _read_boolean(cell: Any) -> bool:
    """Read True or False, in upper or lower case; raise ValueError for other text."""
    text = str(cell).strip().casefold()
    if text not in ("true", "false"):
        raise ValueError(f"{cell!r} is neither True nor False")
    return text == "true"


def _find_summary_row_fault(
    cells: "pd.DataFrame",
    declared: Mapping[str, Column],
    unused_rows: Collection[int],
) -> list[Fault]:
    """Find a row at the end of a table that sums up the rows above, such as their means.

    Parameters
    ----------
    cells : pandas.DataFrame
        The cells of the table as text.
    declared : mapping of str to Column
        The columns that the reader declares, by name. Only those with numbers are
        compared.
    unused_rows : collection of int
        Rows whose numbers are ignored.

    Returns
    -------
    list of Fault
        One entry, for the first cell of the row. The list is empty if there is no such
        row.
    """
    number_columns = {}
    for name, column in declared.items():
        # A column of the kind `object` may have numbers, too.
        may_hold_numbers = column.kind not in (str, bool)
        if name in cells and may_hold_numbers and holds_numbers(cells[name]):
            # Empty the cells of unused rows instead of removing them, so that the
            # positions of the other rows remain correct.
            number_columns[name] = [
                "" if row in unused_rows else cell
                for row, cell in enumerate(cells[name])
            ]
    summary = find_summary_row(number_columns)
    if summary is None:
        return []
    fault = CellFault(
        summary.row,
        column=str(cells.columns[0]),
        value=cells.iat[summary.row, 0],
        allowed=f"a measurement in each row; this one has the {summary.statistic} of the "
        "rows above it in each column: leave it out",
    )
    return [fault]
