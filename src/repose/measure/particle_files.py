"""Read the positions and sizes of particles from the files that simulators write.

A particle is a single body: a sphere, an ellipsoid, or one sphere of a clump. A clump
is a grain that consists of several spheres. Four formats are read.

dump
    Text of LAMMPS and LIGGGHTS: the last of its time steps.
table
    A CSV file, or columns separated by blanks, with a header: any table that
    `repose.common.tables` reads.
Yade
    Text of ``yade.export.text``, whose first line names the columns: ``#format
    x_y_z_r``.
VTK
    Points with values, by `repose.measure.vtk_files`.

`COLUMN_NAMES` lists the names that a column may have. Lengths are in the unit of the
file.
"""

import itertools
import mimetypes
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.common import tables
from repose.common.errors import InputError
from repose.common.files import StrPath
from repose.measure import vtk_files

# Header lines in a dump. LAMMPS calls a section of a dump an item, and a particle an
# atom.
DUMP_ITEM = "ITEM:"  # begins each header line
ATOMS_ITEM = "ITEM: ATOMS"  # is followed by the names of the columns, and then by rows
COUNT_ITEM = "ITEM: NUMBER OF ATOMS"
UNITS_ITEM = "ITEM: UNITS"
# Unit of lengths in those styles of units of LAMMPS whose unit is known here
LENGTH_UNITS = {"si": "m", "cgs": "cm"}
YADE_FORMAT = "#format "  # begins the text of Yade
TABLE = "a table with a header"  # describes a file that has no other format
# Names that a column may have, by the quantity, in the order in which they are
# preferred.
COLUMN_NAMES = {
    "x": ("x", "xu"),
    "y": ("y", "yu"),
    "z": ("z", "zu"),
    "radius": ("radius", "r", "rad", "radii"),
    "diameter": ("diameter", "d"),
    "a": ("a", "semi_axis_a"),
    "b": ("b", "semi_axis_b"),
    "c": ("c", "semi_axis_c"),
    "shapex": ("shapex", "c_shape[1]"),
    "shapey": ("shapey", "c_shape[2]"),
    "shapez": ("shapez", "c_shape[3]"),
    "qw": ("qw", "quatw", "c_quat[1]"),
    "qx": ("qx", "quati", "c_quat[2]"),
    "qy": ("qy", "quatj", "c_quat[3]"),
    "qz": ("qz", "quatk", "c_quat[4]"),
    "type": ("type",),
    "grain": ("grain", "mol", "clump", "clumpid", "id_multisphere"),
}
ID_COLUMN = "id"  # of a particle
# Lowest id of a clump. A lower number marks a particle outside clumps: -1 in Yade and
# LIGGGHTS. In LAMMPS, clumps are molecules, and a particle outside them has mol 0.
LOWEST_CLUMP_ID = 0
LOWEST_MOLECULE_ID = 1
MOLECULE_COLUMN = "mol"
# A radius and a diameter of one particle agree to this fraction, because they are
# rounded.
SIZE_TOLERANCE = 0.01
ONCE = "each particle once, at a single time"
POSITION = ("x", "y", "z")
SEMI_AXES = ("a", "b", "c")
FULL_AXES = ("shapex", "shapey", "shapez")
QUATERNION = ("qw", "qx", "qy", "qz")
SIZE_COLUMNS = "radius, diameter, or a, b, c with qw, qx, qy, qz"
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)  # as a quaternion
NO_TYPES = np.empty(0, dtype=str)


class Particles(NamedTuple):
    """Positions and sizes of N bodies, in the unit of the file.

    Attributes
    ----------
    centres : ndarray, (N, 3)
    semi_axes : ndarray, (N, 3)
        Three equal ones of a sphere.
    quaternions : ndarray, (N, 4)
        Orientations w, x, y, z, which turn the body's frame into that of the file.
    grains : ndarray of int, (N,)
        Number of the grain that the body belongs to; spheres of a clump share it.
    types : ndarray of str, (N,)
        Type of each body; empty if the file has none.
    unit : str or None
        Unit of lengths, one of `repose.measure.conventions.UNITS`, if the file has it.
    """

    centres: np.ndarray
    semi_axes: np.ndarray
    quaternions: np.ndarray
    grains: np.ndarray
    types: np.ndarray = NO_TYPES
    unit: str | None = None

    @property
    def mean_radius(self) -> float:
        """Cube root of the product of the mean semi-axes."""
        return float(np.prod(self.semi_axes.mean(axis=0)) ** (1 / 3))

    @property
    def are_spheres(self) -> bool:
        """Whether all bodies are spheres."""
        return bool((self.semi_axes == self.semi_axes[:, :1]).all())


def is_particle_file(path: StrPath) -> bool:
    """Tell whether a file may contain particles, by its name and its first bytes.

    This is True for a VTK file and for any text file. It is False for a file that is
    named like a picture, and for any other binary file. It is also True for each
    compressed file, without looking inside, because `read_particles` then tells the
    user to unpack it.
    """
    kind, compression = mimetypes.guess_type(path)
    if kind is not None and kind.startswith("image/"):
        return False
    if compression is not None:
        return True
    with Path(path).open("rb") as file:
        start = file.read(vtk_files.START_BYTES)
    if vtk_files.is_vtk(start):
        return True
    # A text file contains no null byte, except in UTF-16.
    return b"\0" not in start or start.startswith(tables.UTF_16_MARKS)


def read_particles(path: StrPath, radius: float | None = None) -> Particles:
    """Read the particles of a file in any of the formats that this module lists.

    Parameters
    ----------
    path : path
        The file.
    radius : float, optional
        Radius of all particles, for a file without sizes. Such a file needs no header;
        without one, its columns are x, y and z.

    Returns
    -------
    Particles
        The particles, in the unit of the file.

    Raises
    ------
    InputError
        If there are no particles, if a column is missing, if a cell is not a number or
        has an invalid value, or if both the file and `radius` give sizes.
    """
    _reject_compressed(path)
    table = _read_table(Path(path), may_lack_header=radius is not None)
    if radius is not None:
        _reject_sizes(path, table)
        table["radius"] = radius
    if table.empty:
        raise InputError(
            path,
            key="file",
            value="without particles",
            allowed="a row for each particle",
        )
    columns = _find_columns(table)
    _require_unique_ids(path, table)
    _require_columns(path, table, columns, POSITION)
    return Particles(
        centres=_read_numbers(path, table, columns, POSITION),
        semi_axes=_read_semi_axes(path, table, columns),
        quaternions=_read_quaternions(path, table, columns),
        grains=_find_grains(table, columns),
        types=table[columns["type"]].to_numpy(str) if "type" in columns else NO_TYPES,
        unit=table.attrs.get("unit"),
    )


def _reject_compressed(path: StrPath) -> None:
    """Raise InputError for a file whose name says that it is compressed."""
    _, compression = mimetypes.guess_type(path)
    if compression is not None:
        raise InputError(
            path,
            key="file",
            value=f"compressed ({compression})",
            allowed="the unpacked file",
        )


def _find_grains(table: pd.DataFrame, columns: dict[str, str]) -> np.ndarray:
    """Return the number of the grain to which each particle belongs.

    All particles of a clump belong to one grain. A particle outside clumps is a grain
    of its own. This is every particle of a file without clump ids, and otherwise each
    particle whose clump id is lower than the lowest valid one.

    Parameters
    ----------
    table : DataFrame
        The table of the file, a row for each particle.
    columns : dict
        Column of each quantity in the table, from `_find_columns`.

    Returns
    -------
    ndarray of int
        Number (N,) of the grain of each particle, counted from 0.
    """
    rows = np.arange(len(table))
    if "grain" not in columns:
        return rows
    column = columns["grain"]
    clump_ids = table[column]
    is_molecule = str(column).strip().lower() == MOLECULE_COLUMN
    lowest_id = LOWEST_MOLECULE_ID if is_molecule else LOWEST_CLUMP_ID
    # A clump id may be any text. Text becomes NaN here, which is not lower.
    is_single = pd.to_numeric(clump_ids, errors="coerce") < lowest_id
    # Give each single particle a name that no clump has. Then number the different
    # names.
    single_names = [f"single particle {row}" for row in rows]
    names = np.where(is_single, single_names, clump_ids.astype(str))
    numbers, _ = pd.factorize(names)
    return numbers


# --- formats --------------------------------------------------------------------------


def _read_table(path: Path, may_lack_header: bool = False) -> pd.DataFrame:
    """Read a file in one of the formats as a table, a row for each particle.

    The formats are VTK, a dump of LAMMPS or LIGGGHTS, a text file of Yade, and any
    other table. The first three are recognised by the first bytes of the file, in this
    order. In any other table, the first row is a header unless all its cells are
    numbers.

    Parameters
    ----------
    path : Path
        The file.
    may_lack_header : bool
        Whether the file may be a table without a header, whose columns are x, y and z.

    Returns
    -------
    DataFrame
        The table. Its cells may be text or numbers. The unit of lengths is in `attrs`,
        if the file states it.

    Raises
    ------
    InputError
        If the file has none of these formats.
    """
    with path.open("rb") as file:
        start = file.read(vtk_files.START_BYTES)
    if vtk_files.is_vtk(start):
        return vtk_files.read_table(path)
    text = tables.read_text(path, "text")
    if text.startswith(DUMP_ITEM):
        return _read_dump(path, text)
    if text.startswith(YADE_FORMAT):
        header, *lines = text.splitlines()
        names = header.removeprefix(YADE_FORMAT).split("_")
        return _split_rows(path, names, _leave_out_comments(lines))
    rows = _leave_out_comments(text.splitlines())
    first_cells = _split_row_of_numbers(rows[0]) if rows else []
    lacks_header = len(first_cells) > 0 and all(map(_is_number, first_cells))
    # `read_sheet` also reports a file without rows.
    if not lacks_header:
        return tables.read_sheet(path, TABLE).text
    if may_lack_header and len(first_cells) == len(POSITION):
        # Replace the separators of all rows by blanks, as `_split_rows` expects them.
        blank_separated = [" ".join(_split_row_of_numbers(row)) for row in rows]
        return _split_rows(path, list(POSITION), blank_separated)
    example = "x,y,z" if may_lack_header else "x,y,z,radius"
    raise InputError(
        path,
        key="header",
        value="missing",
        allowed=f"the names of the columns in the first line, as {example}; the first "
        f"line is {rows[0]}",
    )


def _leave_out_comments(lines: list[str]) -> list[str]:
    """Select the lines that are neither empty nor a comment."""
    texts = [line.strip() for line in lines]
    return [text for text in texts if text and text[0] != tables.COMMENT_SIGN]


def _split_row_of_numbers(row: str) -> list[str]:
    """Split a row of numbers, without names, into its cells.

    In a row with a semicolon or a tab, semicolons, tabs and blanks separate the cells,
    and a comma is a decimal comma. In any other row, commas and blanks separate them.
    """
    if ";" in row or "\t" in row:
        return row.replace(",", ".").replace(";", " ").split()
    return row.replace(",", " ").split()


def _is_number(cell: str) -> bool:
    """Tell whether a cell of a table is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _reject_sizes(path: StrPath, table: pd.DataFrame) -> None:
    """Raise InputError for a table that has sizes although the user gave a radius."""
    size_quantities = {"radius", "diameter", *SEMI_AXES, *FULL_AXES}
    for quantity, column in _find_columns(table).items():
        if quantity in size_quantities:
            raise InputError(
                path,
                key=f"column {column}",
                value="found",
                allowed="no column of sizes where a radius is given",
            )


def _read_dump(path: Path, text: str) -> pd.DataFrame:
    """Read the last time step of a dump of LAMMPS or LIGGGHTS.

    A dump contains one or more time steps. Each has several header lines, then the line
    `ATOMS_ITEM` with the names of the columns, and then a row for each particle.

    Parameters
    ----------
    path : Path
        The file, for messages.
    text : str
        Its content.

    Returns
    -------
    DataFrame
        A row for each particle. The entry ``unit`` of its `attrs` is the unit of
        lengths; None if the dump states none.

    Raises
    ------
    InputError
        If the dump has no particles, or if its last time step is incomplete.
    """
    lines = text.splitlines()
    header_indices = [
        index for index, line in enumerate(lines) if line.startswith(ATOMS_ITEM)
    ]
    if not header_indices:
        raise InputError(
            path,
            key="file",
            value=f"a dump without {ATOMS_ITEM}",
            allowed="a complete dump",
        )
    last_header = header_indices[-1]
    names = lines[last_header].removeprefix(ATOMS_ITEM).split()
    # All lines after the last header are rows of particles. If the dump was cut off,
    # there are fewer of them than the time step states.
    rows = lines[last_header + 1 :]
    count = _read_count(path, lines)
    if len(rows) != count:
        raise InputError(
            path,
            key=ATOMS_ITEM,
            value=f"{len(rows)} rows",
            allowed=f"{count} rows, a complete dump",
        )
    table = _split_rows(path, names, rows)
    table.attrs["unit"] = LENGTH_UNITS.get(_find_item(lines, UNITS_ITEM))
    return table


def _find_item(lines: list[str], item: str) -> str:
    """Return the line after the last header line `item`, or ``missing`` without one."""
    value = "missing"
    # Add a line to the list, so that its last line has a next one, too.
    for line, next_line in itertools.pairwise([*lines, value]):
        if line == item:
            value = next_line.strip()
    return value


def _read_count(path: Path, lines: list[str]) -> int:
    """Read the number of particles in the last time step of a dump.

    The number is on the line after the header line `COUNT_ITEM`. Raises InputError if
    it is missing.
    """
    count = _find_item(lines, COUNT_ITEM)
    if not count.isdecimal():
        raise InputError(
            path,
            key=COUNT_ITEM,
            value=count,
            allowed="the number of particles, a whole number",
        )
    return int(count)


def _split_rows(path: Path, names: list[str], rows: list[str]) -> pd.DataFrame:
    """Split rows at blanks into the columns `names`; empty rows are left out.

    Raises InputError for a row whose number of cells differs from that of the names.
    """
    cells_of_rows = [row.split() for row in rows if row.strip()]
    for number, cells in enumerate(cells_of_rows, start=1):
        if len(cells) != len(names):
            raise InputError(
                path,
                key=f"row {number}",
                value=f"{len(cells)} values",
                allowed=f"{len(names)}: {names}",
            )
    return pd.DataFrame(cells_of_rows, columns=names)


# --- columns --------------------------------------------------------------------------


def _find_columns(table: pd.DataFrame) -> dict[str, str]:
    """Find the column of each quantity by its possible names, in any letter case.

    Returns
    -------
    dict
        The name of the column in the file, by quantity of `COLUMN_NAMES`. Quantities
        that the file lacks are left out.
    """
    column_by_name = {str(name).strip().lower(): name for name in table.columns}
    columns = {}
    for quantity, names in COLUMN_NAMES.items():
        found = [column_by_name[name] for name in names if name in column_by_name]
        if found:
            columns[quantity] = found[0]
    return columns


def _require_columns(
    path: StrPath,
    table: pd.DataFrame,
    columns: dict[str, str],
    quantities: tuple[str, ...],
) -> None:
    """Raise InputError for a table without one of the needed quantities.

    Parameters
    ----------
    path : path
        The file, for messages.
    table : DataFrame
        Its table.
    columns : dict
        Column of each quantity in the table, from `_find_columns`.
    quantities : tuple of str
        Quantities of `COLUMN_NAMES`.
    """
    for quantity in quantities:
        if quantity not in columns:
            found = ", ".join(map(str, table.columns))
            raise InputError(
                path,
                key=f"column {quantity}",
                value="missing",
                allowed=(
                    f"a column named {' or '.join(COLUMN_NAMES[quantity])}; found: {found}"
                ),
            )


def _require_unique_ids(path: StrPath, table: pd.DataFrame) -> None:
    """Raise InputError for a table in which two particles have the same id."""
    names = [name for name in table.columns if str(name).strip().lower() == ID_COLUMN]
    for name in names:
        is_repeated = table[name].duplicated()
        if is_repeated.any():
            row = int(np.flatnonzero(is_repeated)[0])
            raise InputError(
                path,
                key=f"column {name}, row {row + 1}",
                value=_convert_to_plain(table[name].iloc[row]),
                allowed=ONCE,
            )


def _convert_to_plain(value: object) -> object:
    """Convert a number of numpy to a plain one, for a message."""
    return value.item() if isinstance(value, np.generic) else value


def _read_numbers(
    path: StrPath,
    table: pd.DataFrame,
    columns: dict[str, str],
    quantities: tuple[str, ...],
) -> np.ndarray:
    """Read the numbers of several quantities from their columns of the table.

    Parameters
    ----------
    path : path
        The file, for messages.
    table : DataFrame
        Its table of N rows.
    columns : dict
        Column of each quantity in the table, from `_find_columns`.
    quantities : tuple of str
        The K quantities.

    Returns
    -------
    ndarray
        Numbers (N, K).

    Raises
    ------
    InputError
        For the first value that is not a finite number.
    """
    numbers = np.empty((len(table), len(quantities)))
    for index, quantity in enumerate(quantities):
        column = columns[quantity]
        # Text that is not a number becomes NaN.
        values = pd.to_numeric(table[column], errors="coerce").to_numpy(float)
        is_bad = ~np.isfinite(values)
        if is_bad.any():
            row = int(np.flatnonzero(is_bad)[0])
            raise InputError(
                path,
                key=f"column {column}, row {row + 1}",
                value=_convert_to_plain(table[column].iloc[row]),
                allowed="a finite number",
            )
        numbers[:, index] = values
    return numbers


def _read_semi_axes(
    path: StrPath, table: pd.DataFrame, columns: dict[str, str]
) -> np.ndarray:
    """Read and check the semi-axes of the particles.

    Parameters
    ----------
    path : path
        The file, for messages.
    table : DataFrame
        Its table of N rows.
    columns : dict
        Column of each quantity in the table, from `_find_columns`.

    Returns
    -------
    ndarray
        Semi-axes (N, 3); three equal ones for a sphere.

    Raises
    ------
    InputError
        If there is no size, if a size is not positive, or if particles that are not
        spheres lack an orientation.
    """
    semi_axes = _read_sizes(path, table, columns)
    is_bad = (semi_axes <= 0).any(axis=1)
    if is_bad.any():
        row = int(np.flatnonzero(is_bad)[0])
        value = float(semi_axes[row].min())
        raise InputError(
            path, key=f"size, row {row + 1}", value=value, allowed="a number above 0"
        )
    are_spheres = (semi_axes == semi_axes[:, :1]).all()
    if not are_spheres and "qw" not in columns:
        names = ", ".join(QUATERNION)
        raise InputError(
            path, key="orientation", value="missing", allowed=f"columns {names}"
        )
    return semi_axes


def _read_sizes(
    path: StrPath, table: pd.DataFrame, columns: dict[str, str]
) -> np.ndarray:
    """Read semi-axes from the columns of sizes that a table has.

    A table may give sizes in several ways. They are tried in this order: three
    semi-axes, three full diameters along the axes, a radius, a diameter.

    Parameters
    ----------
    path : path
        The file, for messages.
    table : DataFrame
        Its table of N rows.
    columns : dict
        Column of each quantity in the table, from `_find_columns`.

    Returns
    -------
    ndarray
        Semi-axes (N, 3) in the unit of the file.

    Raises
    ------
    InputError
        If there are no sizes, or if a radius and a diameter contradict each other.
    """
    if columns.keys() >= set(SEMI_AXES):
        return _read_numbers(path, table, columns, SEMI_AXES)
    if columns.keys() >= set(FULL_AXES):
        # LAMMPS writes the full diameters along the axes, and 0 for a point particle.
        return 0.5 * _read_numbers(path, table, columns, FULL_AXES)
    if "radius" in columns:
        radii = _read_numbers(path, table, columns, ("radius",))
        if "diameter" in columns:
            _require_same_sizes(path, table, columns, radii[:, 0])
        return np.repeat(radii, 3, axis=1)
    if "diameter" in columns:
        diameters = _read_numbers(path, table, columns, ("diameter",))
        return np.repeat(0.5 * diameters, 3, axis=1)
    found = ", ".join(map(str, table.columns))
    raise InputError(
        path,
        key="size",
        value="missing",
        allowed=f"columns {SIZE_COLUMNS}; found: {found}",
    )


def _require_same_sizes(
    path: StrPath, table: pd.DataFrame, columns: dict[str, str], radii: np.ndarray
) -> None:
    """Raise InputError for a diameter that is not twice the radius (N,) of its row."""
    diameters = _read_numbers(path, table, columns, ("diameter",))[:, 0]
    is_bad = np.abs(diameters - 2 * radii) > SIZE_TOLERANCE * np.abs(diameters)
    if is_bad.any():
        row = int(np.flatnonzero(is_bad)[0])
        raise InputError(
            path,
            key=f"column {columns['diameter']}, row {row + 1}",
            value=float(diameters[row]),
            allowed=f"twice column {columns['radius']}, which has {radii[row]:g}; or one "
            "of the two columns alone",
        )


def _read_quaternions(
    path: StrPath, table: pd.DataFrame, columns: dict[str, str]
) -> np.ndarray:
    """Read the orientations (N, 4) of the particles as quaternions w, x, y, z.

    If the table has none, the particles are not rotated. The parameters are those of
    `_read_semi_axes`. Raises InputError if some of the four columns are missing.
    """
    if "qw" not in columns:
        return np.tile(NO_ROTATION, (len(table), 1))
    _require_columns(path, table, columns, QUATERNION)
    return _normalise(path, _read_numbers(path, table, columns, QUATERNION))


def _normalise(path: StrPath, quaternions: np.ndarray) -> np.ndarray:
    """Scale quaternions (N, 4) to length 1; raise InputError for one of length 0."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    is_zero = lengths[:, 0] == 0
    if is_zero.any():
        row = int(np.flatnonzero(is_zero)[0])
        raise InputError(
            path, key=f"orientation, row {row + 1}", value=0, allowed="a quaternion"
        )
    return quaternions / lengths
