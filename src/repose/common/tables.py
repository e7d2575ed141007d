"""The reader of every table that a user writes, with one idea of a cell, a row and a fault.

A table is CSV as spreadsheets and other programs write it: UTF-8 or UTF-16; commas, semicolons or tabs; decimal
commas where nothing else can be meant. A reader declares its columns (`Column`); all faults are reported at once.
"""

import csv
import io
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import LABELS, plain_number
from repose.common.attached import plain_file
from repose.common.errors import InputError, raise_together, require

if TYPE_CHECKING:
    import pandas as pd

Path_ = str | os.PathLike
Fault = tuple[int, str, Any, str]  # row from 0, column, value, what is allowed
TABLE = "a CSV file"
MOST_COUNTED = 10_000  # faults
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
SEPARATORS = ",;\t"
# What spreadsheets write, in any language, into a cell whose formula failed or whose number is too wide for it.
NO_RESULT = re.compile(r"#([^\s,;]*[!?]|N/[ADV]|NV|I/T|GETTING_DATA|#+)")
DECIMAL_COMMA, DECIMAL_POINT = (
    re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?"),
    re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?"),
)
THOUSANDS = re.compile(
    r"[+-]?[1-9]\d{0,2},\d{3}"
)  # 1,234: may be a number of thousands
# What begins or is the name of a row that sums up others.
SUMMARY = re.compile(
    r"((geo\w*|grand|arithmetic|sample|weighted)? ?mean|average|av[eg]?|median|std|st(an)?d? ?dev|overall|summary|"
    r"moy(enne)?|durchschn(itt)?|mittelw(ert)?|stabw|prom(edio)?|gemiddelde|medelvärde|średnia|ortalama|keskiarvo|"
    r"среднее|průměr|medie|μέσοσ|coefficient of variation|quartile|[øσμ±]|x̄|平均[值値]?|均值|[标標][准準]偏?差|"
    r"최[대소]값?|평균|표준편차)([\W\d_].*)?|(±?(sample )?sd|se|sem|co?v|rsd|mw|n)( ?[(=%].*)?|m[eé]dia|mode|suma|iqr|"
    r"rms|gem|se mean|q[1-4]|varian[cz]e?|var|range|\d+ ?%( ?(ci|confidence.*|percentile))?|(sub|grand)? ?totals?|"
    r"standard ?(dev(iation)?|error|fehler|abweichung)|count|最[大小]值?|stdevp?|m(in|ax)(imum)?|m[íiáa][nx]im[oa]|"
    "span(nweite)?|(low|high|small|larg)est|valor medio|dev(iazione)? st.*|standaarddeviatie|keskihajonta|"
    "sum|mittel|summe|gesamt|anzahl|somme|desv.*|[eé]cart.?type"
)
# Of these some are names, too: of quarters, directions, people, shares, heights.
MAY_BE_NAMES = re.compile(
    r"n|se|av|m(ax|in)|mw|q[1-4]|\d+ ?%|span|prom|(low|high|small|larg)est"
)
# What may stand behind the name of a statistic.
BEHIND = re.compile(r"[ _]*(\(.*\)|\[.*\])|[ _]+(values?|of the \w+|in \w+)")
NOTHING = frozenset(("", "nan", "na", "n/a", "null", "none", "<na>"))
TRUTH = {"true": True, "false": False}
DIGITS = frozenset("0123456789+-.eE")
COUNTS = ("sample", "seed", "n_seeds", "round", "low", "high")
UNITS = ("deg", "mm", "m", "s", "g", "kg", "n", "j", "pa", "percent")
# For each unit others that people write in its place, by the number of them in one.
OTHER_UNITS = {
    "mm": {"cm": 0.1, "m": 0.001, "um": 1000.0, "inches": 1 / 25.4},
    "N": {"kN": 0.001, "gf": 1000 / 9.80665, "kgf": 1 / 9.80665, "mN": 1000.0},
}


@dataclass(frozen=True)
class Column:
    """A column of a table, as its reader declares it."""

    name: str
    kind: type = (
        float  # float, int or bool; str is a text; object is what nobody reads here
    )
    low: float = -math.inf
    high: float = math.inf
    above: bool = False  # whether `low` itself is too low
    empty: bool = False  # whether a cell may hold nothing: a number is NaN then
    once: bool = False  # whether a value may stand in one row alone
    needed: bool = True  # whether the table must have it
    words: str = ""  # what is allowed, where the kind and the range do not say it

    @property
    def allowed(self) -> str:
        """Say which cells are allowed."""
        if self.kind in (str, object):
            return "a cell with a result: the formula of the spreadsheet has none"
        words = "True or False" if self.kind is bool else self.words or self._by_range()
        return words + (", or nothing" if self.empty else "")

    def _by_range(self) -> str:
        """Say kind and range."""
        number = "a whole number" if self.kind is int else "a number"
        low = (
            ""
            if math.isinf(self.low)
            else f" {'above' if self.above else 'from'} {self.low:g}"
        )
        high = (
            ""
            if math.isinf(self.high)
            else f" {'to' if low else 'up to'} {self.high:g}"
        )
        return f"{number}{low}{high}" if low or high else "a finite number"

    def read(self, cell: Any) -> Any:
        """Read a cell; ValueError for one that is not allowed."""
        if isinstance(cell, str) and (
            NO_RESULT.fullmatch(cell) or (self.kind is str and not (cell or self.empty))
        ):
            raise ValueError(cell)
        if self.kind in (str, object):
            return cell
        text = str(cell).strip().casefold()
        if self.empty and text in NOTHING:
            return math.nan
        if self.kind is bool:
            if text not in TRUTH:
                raise ValueError(text)
            return TRUTH[text]
        number = plain_number(cell)
        if not self.takes(number, number) or (self.kind is int and number % 1):
            raise ValueError(text)
        return int(number) if self.kind is int else number

    def takes(self, least: float, most: float) -> bool:
        """Tell whether the numbers from `least` to `most` are finite and in the range."""
        inside = self.low < least if self.above else self.low <= least
        return (
            inside
            and most <= self.high
            and math.isfinite(least)
            and math.isfinite(most)
        )


@dataclass
class Table:
    """The cells of a table by column: as text without blanks around it, and those of declared columns as values."""

    source: object
    text: dict[str, Sequence[str]]
    comments: list[str]
    values: dict[str, list[Any]] = field(default_factory=dict)
    words: frozenset[str] = (
        frozenset()
    )  # names of the columns that are declared as text

    def __len__(self) -> int:
        return len(next(iter(self.text.values()), ()))

    def rows(self) -> list[dict[str, Any]]:
        """List the rows, with values where columns are declared."""
        return [
            dict(zip(self.values, row, strict=True))
            for row in zip(*self.values.values(), strict=True)
        ]

    def frame(self) -> "pd.DataFrame":
        """Make a table of pandas, with the types that its cells have."""
        import pandas as pd  # slow to import, which a pour should avoid

        buffer = io.StringIO()
        csv.writer(buffer).writerows(
            [self.text, *zip(*self.text.values(), strict=True)]
        )
        buffer.seek(0)
        return pd.read_csv(buffer).assign(
            **{name: self.text[name] for name in self.words & {*self.text}}
        )  # NA, too


def is_number(column: str) -> bool:
    """Tell whether the cells of a column are numbers: a contact parameter, a quantity with its unit, or a count."""
    return (
        column in COUNTS
        or column in LABELS
        or (column.rpartition("_")[2] in UNITS and "_" in column)
    )


def other_unit(unit: str, ratio: float) -> str:
    """Ask whether numbers that are `ratio` times what they should be are in another unit; empty if none is near."""
    near = [
        name for name, factor in OTHER_UNITS[unit].items() if 0.4 < ratio / factor < 2.5
    ]
    return f"; in {near[0]} instead of {unit}?" if near else ""


def read(
    path: Path_,
    columns: Iterable[str | Column],
    what: str = TABLE,
    others: Callable[[str], bool] = lambda name: False,
) -> Table:
    """Read a table with these columns; `others` tells which of those that are not declared hold numbers or nothing.

    Where columns are declared, a row that sums up others is refused.
    """
    table, known = sheet(path, what), list(columns)
    declared = {column.name: column for column in known if isinstance(column, Column)}
    needed = [
        one if isinstance(one, str) else one.name
        for one in known
        if isinstance(one, str) or one.needed
    ]
    check_columns(path, table.text, needed, what, declared)
    table.words = frozenset(
        name for name, column in declared.items() if column.kind is str
    )
    summaries = list(_summaries(table)) if declared else []
    for name in table.text:
        if name not in declared:
            declared[name] = Column(name, float if others(name) else object, empty=True)
    table.values, faults = check(
        table.text, declared.values(), {row for row, *_ in summaries}
    )
    refuse(path, [*summaries, *faults])
    return table


def check(
    cells: Mapping[str, Sequence[Any]],
    columns: Iterable[Column],
    left_out: Collection[int] = (),
) -> tuple[dict[str, list[Any]], list[Fault]]:
    """Read the cells of columns, without those of some rows; return the values, NaN for bad ones, and the faults."""
    values, faults = {}, []
    for column in columns:
        if column.name in cells:
            values[column.name], found = _check_column(
                column, cells[column.name], left_out
            )
            faults += found
    return values, faults


def refuse(source: object, faults: Iterable[Fault]) -> None:
    """Raise all faults of a table at once, in the order of its rows."""
    first = sorted(faults, key=lambda fault: fault[0])[:MOST_COUNTED]
    raise_together(
        InputError(f"{source}, row {row + 1}", name, value, words)
        for row, name, value, words in first
    )


def check_columns(
    path: object,
    table: Iterable[str],
    columns: Iterable[str],
    what: str = TABLE,
    optional: Collection[str] = (),
) -> None:
    """Raise InputError if a column is missing, or an optional one has capitals; `path` stands in the message."""
    columns = tuple(columns)
    needed = f"columns {', '.join(columns)}" + (f" of {what}" if what != TABLE else "")
    allowed = f"{needed}; found: {', '.join(map(str, table))}"
    for column in columns:
        require(column in table, path, f"column {column}", "missing", allowed)
    for name, plain in ((one, one.strip().casefold()) for one in map(str, table)):
        good = name in {*columns, *optional} or plain not in optional or plain in table
        require(good, path, "column", name, f"{plain}, without capitals and blanks")


def sheet(path: Path_, what: str = TABLE) -> Table:
    """Read the cells of a table as text, without empty rows and columns; its lines that begin with # are comments.

    InputError for a comment that looks like a row, with as many cells as the header: numbers, or no blank after its #.
    """
    comments, lines = [], []
    for line in io.StringIO(_text(path, what), newline=""):
        begin = line.lstrip(' "')
        is_comment = begin.startswith("#") and not re.match(
            NO_RESULT.pattern + r'"?\s*[,;\t]', begin
        )
        comments += [line] if is_comment else []
        lines.append("\n" if is_comment else line)
    first = next((k for k, line in enumerate(lines) if line.strip()), 0)
    separator = max(SEPARATORS, key=lines[first].count) if lines else ","
    if lines and (named := re.fullmatch(r'"?sep=(.)"?\s*', lines[first])):
        separator, lines[first] = named[1], "\n"
    cells = lines[first].count(separator) if lines else 0
    allowed = "a row that begins without #, or a comment that begins with '# '"
    for line in comments:
        counts = {
            line.count(separator),
            line.rstrip().rstrip(separator).count(separator),
        }
        rest = re.sub(r"[\s,;]", "", line.partition(separator)[2])
        is_row = (
            cells
            and cells in counts
            and ((rest and is_plain(rest)) or line.lstrip(' "')[1:2].strip())
        )
        require(not is_row, path, "line", line.strip(), allowed)
    rows = _rows(path, lines, separator, what)
    require(rows, path, "rows", 0, what)
    header = rows.pop(0)
    allowed = "names of columns, in a line that does not begin with #"
    numbers = is_plain(header) and any(cell[:1].isdigit() for cell in header)
    require(not numbers, path, "header", ", ".join(header), allowed)
    width = max((k for k, name in enumerate(header, start=1) if name), default=0)
    allowed = f"{width}, as in {', '.join(header):.60}"
    more = (
        f"{allowed}; a decimal comma needs ; between the columns"
        if separator == ","
        else allowed
    )
    odd = (
        (k, len(row))
        for k, row in enumerate(rows)
        if len(row) < width or any(row[width:])
    )
    refuse(path, ((k, "cells", n, more if n > width else allowed) for k, n in odd))
    columns = list(zip(*(row[:width] for row in rows), strict=True)) or [()] * width
    kept = [
        (name, column)
        for name, column in zip(header, columns, strict=False)
        if name or any(column)
    ]
    names = [name for name, _ in kept]
    raise_together(
        InputError(path, "header", name, "each column once")
        for name in names
        if names.count(name) > 1
    )
    return Table(path, _with_points(path, dict(kept), separator), comments)


def _text(path: Path_, what: str) -> str:
    """Read the text of a file in UTF-8 or, with its mark, in UTF-16."""
    try:
        content = plain_file(path).read_bytes()
        require(
            not content.startswith(b"PK\x03\x04"),
            path,
            "file",
            "a workbook",
            f"{what}: save its sheet as CSV",
        )
        text = content.decode("utf-16" if content.startswith(UTF_16) else "utf-8-sig")
    except OSError as error:
        raise InputError(path, "file", error.strerror, what) from error
    except UnicodeDecodeError as error:
        raise InputError(
            path, "table", str(error), f"{what} in UTF-8, or in UTF-16 with its mark"
        ) from error
    require(
        "\x00" not in text,
        path,
        "table",
        "a byte of zero",
        f"{what} in UTF-8, or in UTF-16 with its mark",
    )
    return text


def _rows(
    path: Path_, lines: Sequence[str], separator: str, what: str
) -> list[list[str]]:
    """Read the rows that are not empty."""
    rows, begun = [], 1
    reader = csv.reader(lines, delimiter=separator, strict=True, skipinitialspace=True)
    try:
        for row in reader:
            begun = reader.line_num + 1
            cells = [cell.strip() for cell in row]
            if any(cells):
                rows.append(cells)
    except csv.Error as error:
        raise InputError(
            f"{path}, line {begun}",
            "cells",
            lines[begun - 1].rstrip(),
            f"{what}: {error}",
        ) from None
    return rows


def _with_points(
    path: Path_, columns: dict[str, Sequence[str]], separator: str
) -> dict[str, Sequence[str]]:
    """Write decimal commas as points; InputError where a comma may be one of thousands, or both signs occur."""
    texts = {name: cells for name, cells in columns.items() if not is_plain(cells)}
    places = (
        (k, name, cell) for name, cells in texts.items() for k, cell in enumerate(cells)
    )
    commas = [place for place in places if DECIMAL_COMMA.fullmatch(place[2])]
    points = (
        f"{one} of {name}"
        for name, cells in columns.items()
        for one in cells
        if DECIMAL_POINT.fullmatch(one)
    )
    if commas and (point := next(points, "")):
        refuse(
            path,
            [(*commas[0], f"one decimal sign in the whole table; {point} has a point")],
        )
    if (
        separator != ";"
        and commas
        and all(THOUSANDS.fullmatch(cell) for *_, cell in commas)
    ):
        refuse(
            path,
            [
                (
                    *commas[0],
                    "a number with a decimal point: this may be one of thousands",
                )
            ],
        )
    changed = {name: list(columns[name]) for name in {name for _, name, _ in commas}}
    for k, name, cell in commas:
        changed[name][k] = cell.replace(",", ".")
    return columns | changed


def is_plain(cells: Sequence[Any]) -> bool:
    """Tell whether all cells are texts of digits, points, signs and exponents alone."""
    try:
        return DIGITS.issuperset("".join(cells))
    except TypeError:
        return False


def _summaries(table: Table) -> Iterator[Fault]:
    """Find rows that sum up others: their first cell says so, or one of a column that is not declared as text."""
    found = set()
    for k, (name, cells) in enumerate(table.text.items()):
        told = (
            BEHIND.sub("", one.casefold().replace(".", "")).strip(" :") for one in cells
        )
        words = [] if (k and name in table.words) or is_plain(cells) else list(told)
        kinds = {word for word in words if word}
        flags = len(kinds) > 1 and max(map(len, kinds)) == 1  # such as Y and N
        of_runs = flags or (
            words and SUMMARY.fullmatch(words[0])
        )  # such as the same method in each row
        counts = Counter(words)
        for row, word in enumerate(() if k and of_runs else words):
            # a name stands in several rows, or has other rows below it
            once = not MAY_BE_NAMES.fullmatch(word) or (
                counts[word] == 1 and all(map(SUMMARY.fullmatch, words[row:]))
            )
            if once and row not in found and SUMMARY.fullmatch(word):
                found.add(row)
                yield (
                    row,
                    name,
                    cells[row],
                    "a row of its own measurement; leave out rows that sum up others",
                )


def _check_column(
    column: Column, cells: Sequence[Any], left_out: Collection[int]
) -> tuple[list[Any], list[Fault]]:
    """Read the cells of a column, as `check` does."""
    faults: list[Fault] = []
    values = [] if left_out else _read_at_once(column, cells)
    for k, cell in enumerate(cells if len(values) < len(cells) else ()):
        try:
            values.append(math.nan if k in left_out else column.read(cell))
        except (TypeError, ValueError, OverflowError):
            values.append(math.nan)
            faults.append((k, column.name, _shown(column, cell), column.allowed))
    seen: dict[Any, int] = {}
    for k, value in enumerate(values if column.once else ()):
        if k not in left_out and value == value and seen.setdefault(value, k) != k:
            faults.append(
                (
                    k,
                    column.name,
                    value,
                    f"each {column.name} once; row {seen[value] + 1} has it, too",
                )
            )
    return values, faults


def _read_at_once(column: Column, cells: Sequence[Any]) -> list[Any]:
    """Read a column of good plain numbers; empty where a look at each cell is needed."""
    if column.kind not in (float, int) or not is_plain(cells):
        return []
    try:
        values: list[Any] = list(map(column.kind, cells))
    except ValueError:
        return []
    return values if values and column.takes(min(values), max(values)) else []


def _shown(column: Column, cell: Any) -> Any:
    """Return a cell for a message: numbers out of range without quotes."""
    try:
        number = plain_number(cell)
    except (TypeError, ValueError):
        return cell
    return number if column.kind is not bool and math.isfinite(number) else cell
